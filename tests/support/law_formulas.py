"""Forces of the contact laws by formulas in Python, with which those of the C library compare."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

import antiosc as ao

SOURCE = Path(__file__).parents[2] / "csrc" / "laws.c"


def numbers_of(name: str) -> list[float]:
    """The coefficients of a polynomial of csrc/laws.c."""
    (found,) = re.findall(rf"{name}\[\] = \{{(.*?)\}}", SOURCE.read_text(), re.DOTALL)
    return [float(value) for value in found.split(",")]


def mixed(name: str, law: ao.ElasticPlastic) -> np.ndarray:
    """The coefficients of a sphere that yields, with those of an elastic side."""
    more = np.array(numbers_of(f"{name}_ELASTIC"))
    return np.array(numbers_of(name)) + law.elastic_share**1.5 * more


def unloading_power(law: ao.ContactLaw, m: float) -> float:
    """Of unloading from a deepest indentation m."""
    if isinstance(law, ao.ElasticPlastic):
        x = whole(law, m)[0] / law.yield_indentation
        return 1.25 + 0.25 / max(x, 1.0) ** 0.5
    return 2.5 if isinstance(law, ao.YangSun) else 1.5


def virgin(law: ao.ContactLaw, d: float) -> float:
    """Force of a new contact at an indentation d > 0, at rest."""
    if law.compliance and not isinstance(law, ao.Hertz):
        return whole(law, d)[1]
    return whole_virgin(law, d)


def whole(law: ao.ContactLaw, d: float) -> tuple[float, float]:
    """The indentation with that of the patch, and the force: of d + c F by the law without c.

    The patch takes 0.7 of the flexibility in which the contact unloads, or less.
    """
    free = law.without(0.0)

    def rest(x: float) -> float:
        most = 0.7 / steepness(free) * (x - permanent(free, x) if law.has_memory else x)
        return x - min(law.compliance * whole_virgin(free, x), most) - d

    x = d if law.compliance == 0 else brentq(rest, d, 4 * d, xtol=1e-300, rtol=1e-14)
    return x, whole_virgin(free, x)


def steepness(law: ao.ContactLaw) -> float:
    """Slope at the end of the unloading curve from (0, 0) to (1, 1)."""
    if isinstance(law, ao.Tabulated):
        return float(law.parameters()[-2])
    if isinstance(law, ao.YangSun):
        return 2.5
    return 1.0 if isinstance(law, ao.Linear) else float(getattr(law, "exponent", 1.5))


def whole_virgin(law: ao.ContactLaw, d: float) -> float:
    """Force of a new contact, at rest, of a law without a patch."""
    k = getattr(law, "stiffness", 0.0)
    if isinstance(law, ao.Linear):
        return k * d
    if isinstance(law, ao.Hertz) and law.compliance:
        end, c = law.valid_force, law.compliance
        reach = (end / k) ** (2 / 3) - c * end
        if d > reach:
            return end + (d - reach) / ((2 / 3) * k ** (-2 / 3) * end ** (-1 / 3) - c)
        return brentq(lambda F: (F / k) ** (2 / 3) - c * F - d, 0.0, end, xtol=1e-12, rtol=1e-14)
    if isinstance(law, ao.Thornton) and d > law.yield_indentation:
        y = law.yield_indentation
        return k * y**1.5 + 1.5 * k * y**0.5 * (d - y)
    if isinstance(law, ao.ElasticPlastic) and d > law.yield_indentation:
        x = d / law.yield_indentation
        return law.yield_force * x * float(polyval(x**-0.25, mixed("PRESSING", law)))
    if isinstance(law, ao.Tabulated):
        n = int(law.parameters()[2])
        x, y = np.array(law.parameters()[5 : 5 + n]), points(law)
        cubic = PchipInterpolator(x, y)
        return float(cubic(d) if d < x[-1] else y[-1] + cubic(x[-1], 1) * (d - x[-1]))
    return float(k * d ** getattr(law, "exponent", 1.5))


def points(law: ao.Tabulated) -> np.ndarray:
    """Forces of the loading table's points."""
    values, n = np.array(law.parameters()[5:]), int(law.parameters()[2])
    return np.append(values[4 * n : 5 * n - 1], values[5 * n])


def permanent(law: ao.ContactLaw, m: float) -> float:
    """Permanent indentation after a deepest one m, as the laws' papers have it."""
    if law.compliance:
        return permanent(law.without(0.0), whole(law, m)[0])
    if isinstance(law, ao.ElasticPlastic):
        x = max(m / law.yield_indentation, 1.0)
        return float(m * (1 - x**-0.5 * polyval(x**-0.25, mixed("RECOVERY", law))))
    if isinstance(law, ao.Thornton):
        hertz = law.stiffness * m**1.5
        return m * (1 - virgin(law, m) / hertz) if m > law.yield_indentation else 0.0
    if isinstance(law, ao.YangSun):
        return m * (1 - (law.critical / m) ** 0.4) if m > law.critical else 0.0
    return law.parameters()[1] * m


def restitution_of(d: float) -> float:
    """Ratio e' of parting and closing speed of two free bodies for a damping factor d >= 0."""
    if d == 0:
        return 1.0

    def mismatch(e: float) -> float:
        return np.log1p(d) - d - (np.log1p(-e * d) + e * d)

    high = min(1.0, (1 - 1e-15) / d)
    return high if mismatch(high) <= 0 else float(brentq(mismatch, 0.0, high, xtol=1e-16))
