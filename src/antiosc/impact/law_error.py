"""What the law of a contact may be off by: its share of the bars of an impact.

Each cause is a repetition of the impact by a law that is changed by it: the measured error of the
law, the range of the yield strength, its growth with the strain rate, hardening, and the curvature
of the mesh. The largest change of each is taken, and all are added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import sqrt

from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.choice import Choice, choose
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz
from antiosc.engine.contact.surfaces import Matter, Surface
from antiosc.impact.auto_contact import choice_of
from antiosc.impact.histories import History
from antiosc.impact.histories.parts import NO_ERROR, differences, with_floor
from antiosc.models.body import Body

#: The law is the caller's.
GIVEN = "The contact's law was given: its error is not in these bars."
#: Strain under a ball over a/R (D. Tabor, The Hardness of Metals, Oxford 1951).
TABOR = 0.2
#: Errors of the law grow with the depth: the largest then changes the peak by more than the same
#: error at all depths, 1.29 times as much at most (benchmarks/elastoplastic/pairs.py).
GROWS = 1.4
#: Share of Hertz's force that large strains change, over the root of indentation by radius, and the
#: range in which it is taken: a rigid sphere on an elastic half-space (nu = 0.3) has 3.8, 5.4, 6.7,
#: 7.9 and 11.5 % less force at 0.01, 0.02, 0.04, 0.05 and 0.1, with 1.5 % of it by the grid
#: (benchmarks/elastoplastic/finite_strain.py elastic).
STRAINED, LEAST_STRAIN, LARGEST_STRAIN = 0.38, 0.01, 0.1
#: Largest error of a force that is repeated.
MOST = 0.9
#: Repeats the impact by another law, to a tolerance.
ByLaw = Callable[[ContactLaw, float], History]


def law_errors(raw: History, by_law: ByLaw, tol: float) -> tuple[dict[str, float] | None, str]:
    """Errors of the three quantities due to the law, and why they are missing; reruns to `tol`.

    The shares are None where they are not known, and 0 for a law of the caller's own.
    """
    if not raw.contacts:
        return NO_ERROR, ""
    choice = choice_of(raw.law, raw.model, raw.impactor)
    if choice is None:
        return NO_ERROR, GIVEN
    if choice.unknown:
        return None, f"The total is not known: {choice.unknown}."
    strain = _elastic_strain(choice, raw.peak_force, raw.deepest)
    if strain > LARGEST_STRAIN:
        return None, (
            f"The total is not known: the contact is pressed in by {strain:.2g} of its radius, and "
            f"the error of its elastic law is known up to {LARGEST_STRAIN:g} (a blunter striker)."
        )
    total = dict(NO_ERROR)
    for cause in causes(raw, choice):
        changed = [differences(raw, by_law(law, tol)) for law in cause]
        for name in total:
            total[name] += max((one[name] for one in changed), default=0.0)
    return with_floor(total), ""


def causes(raw: History, choice: Choice) -> Iterator[list[ContactLaw]]:
    """For each cause of error, the laws that differ by this error."""
    yield list(_by_curvature(raw, choice.law))
    strain = _elastic_strain(choice, raw.peak_force, raw.deepest)
    yield list(_by_strain(choice.law, strain))
    law, soft = choice.law, choice.soft
    if not isinstance(law, ElasticPlastic) or soft is None:
        return
    if raw.peak_force <= law.yield_force:
        return
    yield list(_by_error(law, choice.error, raw))
    yield [replace(law, elastic_share=share) for share in choice.shares or ()]
    yield list(_by_strength(law, soft, raw))


def _by_curvature(raw: History, law: ContactLaw) -> Iterator[ContactLaw]:
    """The laws for the smallest and the largest possible curvatures of the surfaces."""
    pair = [body.surface() for body in (raw.model, raw.impactor) if isinstance(body, Body)]
    surfaces = [one for one in pair if one is not None]
    if len(surfaces) < 2 or not any(one.error for one in surfaces):
        return
    for sign in (-1.0, 1.0):
        first, second = (_bent(one, sign * one.error) for one in surfaces)
        other = choose(first, second).law
        if type(other) is type(law):
            yield other


def _elastic_strain(choice: Choice, peak: float, depth: float) -> float:
    """Largest indentation over the relative radius, of a contact at a point that stays elastic."""
    law = choice.law
    yields = isinstance(law, ElasticPlastic) and peak > law.yield_force
    return 0.0 if yields else depth * choice.curvature


def _by_strain(law: ContactLaw, strain: float) -> Iterator[ContactLaw]:
    """The elastic law with the forces that large strains take or add."""
    share = _strain_share(strain)
    for factor in (1 - share, 1 + share) if share else ():
        if isinstance(law, ElasticPlastic):
            scaled = factor * law.modulus, factor * law.yield_strength
            yield replace(law, modulus=scaled[0], yield_strength=scaled[1])
        elif isinstance(law, Hertz | Gonthier):
            yield replace(law, stiffness=factor * law.stiffness)


def _strain_share(strain: float) -> float:
    """Share of the force that large strains may change at an indentation over the radius."""
    return STRAINED * sqrt(strain) if strain >= LEAST_STRAIN else 0.0


def _bent(surface: Surface, change: float) -> Surface:
    """A surface with changed curvatures [1/m]; flat directions stay flat."""
    low, high = (k + change if k else k for k in surface.curvatures)
    return replace(surface, curvatures=(low, high), error=0.0)


def _by_error(law: ElasticPlastic, elliptic: float, raw: History) -> Iterator[ContactLaw]:
    """The law with E and Y scaled so that its forces change by its measured error."""
    share = min(GROWS * law.error_at(raw.deepest)[0] + elliptic, MOST)
    for factor in (1 - share, 1 + share):
        yield replace(law, modulus=factor * law.modulus, yield_strength=factor * law.yield_strength)


def _by_strength(law: ElasticPlastic, soft: Matter, raw: History) -> Iterator[ContactLaw]:
    """The law with the lowest yield strength, and with the highest at the run's strain rate."""
    for strength in soft.strengths_at(strain_rate(law, raw)):
        if strength != law.yield_strength:
            yield replace(law, yield_strength=strength)


def strain_rate(law: ElasticPlastic, raw: History) -> float:
    """Mean strain rate [1/s] of the first contact: Tabor's strain over half of its duration."""
    start, end = raw.contacts[0]
    return mean_strain_rate(law, raw.deepest, end - start)


def mean_strain_rate(law: ElasticPlastic, depth: float, contact_time: float) -> float:
    """Strain rate [1/s] of a contact with a largest indentation [m]."""
    return 2 * TABOR * sqrt(depth / law.radius) / contact_time


def error_of_peak(choice: Choice, peak: float, contact_time: float) -> float | None:
    """Relative error of a peak force [N] by its law, without another run; None: not known.

    Where the contact yields, the measured error of the law and of an ellipse, and what the least
    and the largest yield strength make of the force at equal work; elsewhere what large strains do.
    """
    law, soft = choice.law, choice.soft
    if choice.unknown:
        return None
    if not isinstance(law, ElasticPlastic) or soft is None or peak <= law.yield_force:
        return _elastic_error(choice, peak)
    depth = _depth(law, "force", peak)
    work = law.loading_work(depth)
    changes = [0.0]
    for strength in soft.strengths_at(mean_strain_rate(law, depth, contact_time)):
        other = replace(law, yield_strength=strength)
        changes.append(abs(_force(other, _depth(other, "work", work)) / peak - 1))
    return law.error_at(depth)[0] + choice.error + max(changes)


def _elastic_error(choice: Choice, peak: float) -> float | None:
    """Error of the peak force of an elastic contact by large strains, None beyond their range.

    At equal work the force grows with the stiffness to the power of 0.4.
    """
    law = choice.law
    if not isinstance(law, ElasticPlastic | Hertz | Gonthier):
        return 0.0
    strain = _elastic_strain(choice, peak, (peak / law.stiffness) ** (2 / 3))
    return None if strain > LARGEST_STRAIN else 1 - (1 - _strain_share(strain)) ** 0.4


def _force(law: ElasticPlastic, depth: float) -> float:
    return law.force(depth, 0.0, law.touch(1.0))


def _depth(law: ElasticPlastic, of: str, value: float) -> float:
    """The indentation [m] at which the force [N] or the work [J] of loading has this value."""
    from scipy.optimize import brentq

    def beyond(depth: float) -> float:
        return (_force(law, depth) if of == "force" else law.loading_work(depth)) - value

    high = law.yield_indentation
    while beyond(high) < 0:
        high *= 4
    return float(brentq(beyond, 0.0, high, xtol=1e-9 * high))
