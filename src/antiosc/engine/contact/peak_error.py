"""The error of a peak force due to the contact law, estimated without another run."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

from antiosc.engine.contact.choice import Choice
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz

#: Strain under a ball over a/R (D. Tabor, The Hardness of Metals, Oxford 1951).
TABOR_STRAIN = 0.2
#: Relative change of Hertz's force by large strains over the root of indentation by radius, and the
#: range of this ratio in which it holds: a rigid sphere on an elastic half-space (nu = 0.3) has
#: 3.8, 5.4, 6.7, 7.9 and 11.5 % less force at 0.01, 0.02, 0.04, 0.05 and 0.1, with 1.5 % of it by
#: the grid (measured).
FORCE_LOSS_BY_STRAIN = 0.38
LEAST_STRAIN = 0.01
LARGEST_STRAIN = 0.1
#: The same for a soft ball: more peak force at equal work, over the root and over the ratio itself,
#: of which the larger holds. A rubber hemisphere (nu = 0.48) on a rigid mass has 3.3, 9.4, 15, 27,
#: 41 and 57 % more at 0.01, 0.05, 0.1, 0.2, 0.3 and 0.4, a ball between two flats 1.2 to 31 %
#: (measured).
BALL_FORCE_GAIN = 0.49, 1.5
LARGEST_BALL_STRAIN = 0.4
#: The peak force grows with the stiffness to this power, at equal work.
HERTZ_POWER = 0.4


def error_of_peak(choice: Choice, peak: float, contact_time: float) -> float | None:
    """Relative error of a peak force [N] due to law and yield strength; None if unknown."""
    if unknown_error_reason(choice, peak):
        return None

    law = choice.law
    error = error_of_law(choice, peak)
    if not isinstance(law, ElasticPlastic):
        return error

    work = law.loading_work(_depth(law, "force", peak))
    other_laws = weakest_and_strongest(choice, peak, contact_time)
    peaks = [_force(other, _depth(other, "work", work)) for other in other_laws]

    return error + max((abs(peak_k / peak - 1) for peak_k in peaks), default=0.0)


def error_of_law(choice: Choice, peak: float) -> float:
    """Relative error of a peak force [N] due to its law, without the yield strength's error."""
    law = choice.law
    factors = stiffness_factors(choice, _strain(choice, peak))
    error = choice.curvature_error
    error += max((abs(factor**HERTZ_POWER - 1) for factor in factors), default=0.0)
    if isinstance(law, ElasticPlastic) and choice.soft is not None and peak > law.yield_force:
        error += law.error_at(_depth(law, "force", peak))[0] + choice.error
    return error


def unknown_error_reason(choice: Choice, peak: float) -> str:
    """Reason why the error of a peak force [N] due to its law is unknown; "" if it is known."""
    strain = _strain(choice, peak)
    largest = largest_strain(choice)
    reasons = [choice.unknown]
    if strain > largest:
        reasons.append(
            f"the contact is pressed in by {strain:.2g} of its radius, and the error of its elastic"
            f" law is known up to {largest:g} (a blunter striker)"
        )
    return "; ".join(filter(None, reasons))


def weakest_and_strongest(choice: Choice, peak: float, contact_time: float) -> list[ElasticPlastic]:
    """Laws with the lowest and the highest strength at the contact's strain rate; [] if yielding
    does not matter."""
    law = choice.law
    soft = choice.soft
    if not isinstance(law, ElasticPlastic) or soft is None:
        return []

    rate = mean_strain_rate(law, _depth(law, "force", peak), contact_time)
    changed_laws = [replace(law, yield_strength=strength) for strength in soft.strengths_at(rate)]
    return [
        other_law
        for other_law in changed_laws
        if other_law != law and peak > min(law.yield_force, other_law.yield_force)
    ]


def largest_strain(choice: Choice) -> float:
    """Largest ratio of indentation to radius for which the effect of large strains is known."""
    return LARGEST_BALL_STRAIN if choice.soft_ball else LARGEST_STRAIN


def stiffness_factors(choice: Choice, strain: float) -> tuple[float, ...]:
    """Bounds on the factor of stiffness by a `strain` (indentation/radius); () if it is small."""
    if strain < LEAST_STRAIN:
        return ()
    share = FORCE_LOSS_BY_STRAIN * sqrt(min(strain, LARGEST_STRAIN))
    if not choice.soft_ball:
        return 1 - share, 1 + share
    peak = 1 + max(BALL_FORCE_GAIN[0] * sqrt(strain), BALL_FORCE_GAIN[1] * strain)
    return 1 - share, peak ** (1 / HERTZ_POWER)


def mean_strain_rate(law: ElasticPlastic, depth: float, contact_time: float) -> float:
    """Mean strain rate [1/s] of a contact with the largest indentation `depth` [m]."""
    return 2 * TABOR_STRAIN * sqrt(depth / law.radius) / contact_time


def _strain(choice: Choice, peak: float) -> float:
    """Indentation over relative radius at a peak force [N]; 0 beyond yield and for other laws."""
    law = choice.law
    yields = isinstance(law, ElasticPlastic) and peak > law.yield_force
    if yields or not isinstance(law, ElasticPlastic | Hertz | Gonthier):
        return 0.0
    return (peak / law.stiffness) ** (2 / 3) * choice.curvature


def _force(law: ElasticPlastic, depth: float) -> float:
    return law.force(depth, 0.0, law.touch(1.0))


def _depth(law: ElasticPlastic, quantity: str, value: float) -> float:
    """Indentation [m] at which "force" [N] or "work" [J] of loading has this value."""
    from scipy.optimize import brentq

    def excess(depth: float) -> float:
        return (_force(law, depth) if quantity == "force" else law.loading_work(depth)) - value

    high = law.yield_indentation
    while excess(high) < 0:
        high *= 4
    return float(brentq(excess, 0.0, high, xtol=1e-9 * high))
