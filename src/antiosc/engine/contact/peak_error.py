"""The error of a peak force by the contact's law, without another run."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

from antiosc.engine.contact.choice import Choice
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz
from antiosc.engine.contact.surfaces import Matter

#: Strain under a ball over a/R (D. Tabor, The Hardness of Metals, Oxford 1951).
TABOR = 0.2
#: Relative change of Hertz's force by large strains over the root of indentation by radius, and the
#: range of this ratio in which it holds: a rigid sphere on an elastic half-space (nu = 0.3) has
#: 3.8, 5.4, 6.7, 7.9 and 11.5 % less force at 0.01, 0.02, 0.04, 0.05 and 0.1, with 1.5 % of it by
#: the grid (measured).
STRAINED = 0.38
LEAST_STRAIN = 0.01
LARGEST_STRAIN = 0.1
#: The same for a soft ball: more peak force at equal work, over the root and over the ratio itself,
#: of which the larger holds. A rubber hemisphere (nu = 0.48) on a rigid mass has 3.3, 9.4, 15, 27,
#: 41 and 57 % more at 0.01, 0.05, 0.1, 0.2, 0.3 and 0.4, a ball between two flats 1.2 to 31 %
#: (measured).
STRAINED_BALL = 0.49, 1.5
LARGEST_BALL = 0.4
#: The peak force grows with the stiffness to this power, at equal work.
HERTZ_POWER = 0.4


def error_of_peak(choice: Choice, peak: float, contact_time: float) -> float | None:
    """Relative error of a peak force [N] due to its law, without another run; None if unknown.

    For a contact that yields it is the measured error of the law and of the equivalent circle, and
    the change of the force at equal work by the lowest and the highest yield strength; for an
    elastic one, the effect of large strains.
    """
    law = choice.law
    soft = choice.soft
    elastic = None if choice.unknown else _elastic_error(choice, peak)
    if elastic is None or not isinstance(law, ElasticPlastic) or soft is None:
        return elastic
    depth = _depth(law, "force", peak)
    work = law.loading_work(depth)
    rate = mean_strain_rate(law, depth, contact_time)
    other_laws = other_strengths(law, soft, peak, rate)
    peaks = [force_after(other_law, work) for other_law in other_laws]
    by_strength = max((abs(peak_k / peak - 1) for peak_k in peaks), default=0.0)
    by_error = law.error_at(depth)[0] + choice.error if peak > law.yield_force else 0.0
    return elastic + by_error + by_strength


def force_after(law: ElasticPlastic, work: float) -> float:
    """Force [N] at which loading has taken a work [J]."""
    return _force(law, _depth(law, "work", work))


def other_strengths(
    law: ElasticPlastic, soft: Matter, peak: float, rate: float
) -> list[ElasticPlastic]:
    """The law with the lowest yield strength, and with the highest at a strain rate [1/s].

    A law is omitted if it equals `law`, or if the contact yields neither by it nor by `law`.
    """
    changed_laws = [replace(law, yield_strength=strength) for strength in soft.strengths_at(rate)]
    return [
        other_law
        for other_law in changed_laws
        if other_law != law and peak > min(law.yield_force, other_law.yield_force)
    ]


def elastic_strain(choice: Choice, peak: float, depth: float) -> float:
    """Indentation `depth` over the relative radius of a contact at a point; 0 if it yields."""
    law = choice.law
    yields = isinstance(law, ElasticPlastic) and peak > law.yield_force
    return 0.0 if yields else depth * choice.curvature


def largest_strain(choice: Choice) -> float:
    """Indentation over the radius up to which the effect of large strains is known."""
    return LARGEST_BALL if choice.soft_ball else LARGEST_STRAIN


def by_strain(choice: Choice, strain: float) -> tuple[float, ...]:
    """Factors of the stiffness between which large strains leave it; () where they have no effect.

    `strain` is the indentation over the radius. A soft ball stiffens as it flattens, and the more
    the closer a rigid body is behind it.
    """
    if strain < LEAST_STRAIN:
        return ()
    share = STRAINED * sqrt(min(strain, LARGEST_STRAIN))
    if not choice.soft_ball:
        return 1 - share, 1 + share
    peak = 1 + max(STRAINED_BALL[0] * sqrt(strain), STRAINED_BALL[1] * strain)
    return 1 - share, peak ** (1 / HERTZ_POWER)


def mean_strain_rate(law: ElasticPlastic, depth: float, contact_time: float) -> float:
    """Strain rate [1/s] of a contact with a largest indentation [m]."""
    return 2 * TABOR * sqrt(depth / law.radius) / contact_time


def _elastic_error(choice: Choice, peak: float) -> float | None:
    """Relative error of an elastic peak force by large strains; None beyond their range."""
    law = choice.law
    if not isinstance(law, ElasticPlastic | Hertz | Gonthier):
        return 0.0
    strain = elastic_strain(choice, peak, (peak / law.stiffness) ** (2 / 3))
    if strain > largest_strain(choice):
        return None
    return max((abs(factor**HERTZ_POWER - 1) for factor in by_strain(choice, strain)), default=0.0)


def _force(law: ElasticPlastic, depth: float) -> float:
    return law.force(depth, 0.0, law.touch(1.0))


def _depth(law: ElasticPlastic, quantity: str, value: float) -> float:
    """The indentation [m] at which the force [N] or the work [J] of loading has this value."""
    from scipy.optimize import brentq

    def excess(depth: float) -> float:
        return (_force(law, depth) if quantity == "force" else law.loading_work(depth)) - value

    high = law.yield_indentation
    while excess(high) < 0:
        high *= 4
    return float(brentq(excess, 0.0, high, xtol=1e-9 * high))
