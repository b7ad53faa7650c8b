"""Errors of an impact due to its contact law.

For each cause of error the impact is repeated with a changed law. The causes are the measured error
of the law, the range of the yield strength, its growth with the strain rate, hardening, and the
curvature of the mesh. The largest change by each cause is taken, and all are added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from antiosc.base.errors import SiteError
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.choice import Choice, choose
from antiosc.engine.contact.laws import ElasticPlastic, Gonthier, Hertz, YangSun
from antiosc.engine.contact.peak_error import (
    by_strain,
    elastic_strain,
    largest_strain,
    mean_strain_rate,
    other_strengths,
)
from antiosc.engine.contact.surfaces import Surface
from antiosc.impact.histories import History
from antiosc.impact.histories.bars import NO_ERROR, all_changes, with_floor
from antiosc.models.auto_contact import choice_of
from antiosc.models.body import Body

#: Note for a law given by the caller.
GIVEN = "The contact's law was given: its error is not in these bars."
#: Before the reason why the error of a law that was chosen is not known.
NOT_KNOWN = "The error of the contact's law is not known: "
#: Note for a mesh by whose error of the curvature the surfaces may fit into each other.
UNKNOWN_CURVATURE = (
    f"{NOT_KNOWN}the curvature of the surface at the site is too uncertain (smaller"
    " elements around the site)."
)
#: Factor for errors of the law that grow with the depth: these change the peak by up to 1.29 times
#: as much as the same error at all depths (measured).
GROWS = 1.4
#: Largest relative error of the force with which the impact is repeated.
MOST = 0.9
#: Least indentation that damages a laminate, over the largest one: 94 % of that one remains then.
LEAST_CRITICAL = 1e-3
#: Repeats the impact by another law, to a tolerance.
ByLaw = Callable[[ContactLaw, float], History]


def law_errors(raw: History, by_law: ByLaw, tol: float) -> tuple[dict[str, float] | None, str]:
    """(errors of the three quantities due to the law, or None; the reason if they are missing).

    The impact is repeated to `tol`. The errors are 0 for a law that the caller gave.
    """
    if not raw.contacts:
        return NO_ERROR, ""
    choice = choice_of(raw.law, raw.model, raw.impactor)
    if choice is None:
        return NO_ERROR, GIVEN
    changed, reason = _changed_laws(raw, choice)
    if reason:
        return None, reason
    total = dict(NO_ERROR)
    for cause in changed:
        relative_changes = [all_changes(raw, by_law(law, tol)) for law in cause]
        for name in total:
            total[name] += max((shares[name] for shares in relative_changes), default=0.0)
    return with_floor(total), ""


def _changed_laws(raw: History, choice: Choice) -> tuple[Sequence[Sequence[ContactLaw]], str]:
    """(the changed laws of each cause of an error, why the error is not known or "")."""
    if reasons := _reasons(raw, choice):
        return [], f"{NOT_KNOWN}{'; '.join(reasons)}."
    try:
        return [list(cause) for cause in causes(raw, choice)], ""
    except SiteError:
        return [], UNKNOWN_CURVATURE


def _reasons(raw: History, choice: Choice) -> list[str]:
    """Why the error of the law is not known; [] where it is."""
    reasons = []
    if choice.unknown and not isinstance(choice.law, YangSun):
        reasons.append(choice.unknown)
    strain = elastic_strain(choice, raw.peak_force, raw.deepest)
    largest = largest_strain(choice)
    if strain > largest:
        reasons.append(
            f"the contact is pressed in by {strain:.2g} of its radius, and the error of its elastic"
            f" law is known up to {largest:g} (a blunter striker)"
        )
    return reasons


def causes(raw: History, choice: Choice) -> Iterator[Sequence[ContactLaw]]:
    """Yield the changed laws for each cause of an error of the law."""
    yield list(_by_curvature(raw, choice.law))
    strain = elastic_strain(choice, raw.peak_force, raw.deepest)
    yield _scaled(choice.law, by_strain(choice, strain))
    law = choice.law
    soft = choice.soft
    if isinstance(law, YangSun):
        yield _by_damage(law, raw.deepest)
    if not isinstance(law, ElasticPlastic) or soft is None:
        return
    if raw.peak_force > law.yield_force:
        yield _by_error(law, raw.deepest, choice.error)
        yield [replace(law, elastic_share=share) for share in choice.shares or ()]
    yield other_strengths(law, soft, raw.peak_force, strain_rate(law, raw))


def _by_curvature(raw: History, law: ContactLaw) -> Iterator[ContactLaw]:
    """The laws for the smallest and the largest possible curvatures of the surfaces."""
    pair = [body.surface() for body in (raw.model, raw.impactor) if isinstance(body, Body)]
    surfaces = [surface for surface in pair if surface is not None]
    if len(surfaces) < 2 or not any(surface.error for surface in surfaces):
        return
    for sign in (-1.0, 1.0):
        first, second = (_bent(surface, sign * surface.error) for surface in surfaces)
        other_law = choose(first, second).law
        if type(other_law) is type(law):
            yield other_law


def _by_damage(law: YangSun, deepest: float) -> list[ContactLaw]:
    """The law of a laminate that is not damaged, and of one in which almost all of the indentation
    [m] remains: the loading is the same, and the damage of any laminate lies between.
    """
    return [replace(law, critical=share * deepest) for share in (LEAST_CRITICAL, 1.0)]


def _by_error(law: ElasticPlastic, depth: float, elliptic: float) -> list[ContactLaw]:
    """The law with all forces changed by its error at a depth [m] plus the error of an elliptic
    contact.
    """
    share = min(GROWS * law.error_at(depth)[0] + elliptic, MOST)
    return _scaled(law, (1 - share, 1 + share))


def _scaled(law: ContactLaw, factors: Sequence[float]) -> list[ContactLaw]:
    """The law with all forces changed by each factor; none if a law cannot be scaled."""
    if isinstance(law, ElasticPlastic):
        return [
            replace(law, modulus=factor * law.modulus, yield_strength=factor * law.yield_strength)
            for factor in factors
        ]
    if isinstance(law, Hertz | Gonthier):
        return [replace(law, stiffness=factor * law.stiffness) for factor in factors]
    return []


def _bent(surface: Surface, change: float) -> Surface:
    """A surface with its curvatures changed by `change` [1/m]; flat directions stay flat."""
    low, high = (k + change if k else k for k in surface.curvatures)
    return replace(surface, curvatures=(low, high), error=0.0)


def strain_rate(law: ElasticPlastic, raw: History) -> float:
    """Mean strain rate [1/s] of the first contact: Tabor's strain over half of its duration."""
    start, end = raw.contacts[0]
    return mean_strain_rate(law, raw.deepest, end - start)
