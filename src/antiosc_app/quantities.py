"""Numbers of a result as JSON, each with its error bar and causes, or why it has none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antiosc import SceneHistory
from antiosc.extension import DEFLECTION, MAP_QUANTITIES, QUANTITIES, ErrorBudget, hardest
from antiosc_app.cards import bar_of_fall, dent_of
from antiosc_app.headline import REMEDIES, force_bar, with_force
from antiosc_app.probes import probes_of
from antiosc_app.results import FALL_QUANTITIES
from antiosc_app.scene_file.document import label
from antiosc_app.scene_file.run import SceneResults, error_budget, varied

if TYPE_CHECKING:
    from antiosc import Many

#: A number with its name, unit and bar, as JSON.
Quantity: TypeAlias = dict[str, Any]
#: How far a bar reaches below and above a number.
Sides: TypeAlias = tuple[float, float]
#: Why numbers have no bar.
NOT_ESTIMATED = 'extract with error = "estimate"'
NO_BAR_OF_SCENE = "a scene of several contacts has no error bars"
NO_BAR_OF_FALL = "only the force of a fall has a bar, by its law, and its stress"
NO_BAR_OF_MAP = "a map has no error bars, an impact at this site alone has them"
#: What narrows a bar by a cause that no single impact has.
REMEDY_OF_CAUSE = REMEDIES | {"force": "narrow the bar of the peak force", "number": "run more (n)"}
#: Most impacts of a sweep that are told.
MOST_ROWS = 50


def quantity(
    name: str,
    value: float,
    unit: str,
    bar: Sides | str,
    causes: Mapping[str, Sides] | None = None,
    **more: object,
) -> Quantity:
    """A number as JSON; `bar`: how far it may lie below and above, or why this is not known.

    `causes`: cause -> its share of the bar, below and above; `more`: further keys.
    """
    told = [
        {"cause": cause, "below": below, "above": above, "narrowed_by": REMEDY_OF_CAUSE[cause]}
        for cause, (below, above) in (causes or {}).items()
    ]
    ends = f"none: {bar}" if isinstance(bar, str) else [value - bar[0], value + bar[1]]
    return {"name": name, "value": value, "unit": unit, "bar": ends, "causes": told, **more}


def quantities(results: SceneResults) -> list[Quantity]:
    """All numbers of the results of a scene."""
    kinds = {
        **{"history": _of_history, "fall": _of_fall, "batch": _of_sweep, "sample": _of_sample},
        **{"map": _of_map, "tradeoff": _of_tradeoff},
    }
    made = (kinds[name](results) for name in kinds if getattr(results, name) is not None)
    return [one for numbers in made for one in numbers]


def _of_history(results: SceneResults) -> Iterator[Quantity]:
    """The numbers of an impact or of each contact of a scene, of its stresses and probes."""
    hit = results.history
    budget = error_budget(hit)
    if isinstance(hit, SceneHistory):
        for contact, (name, unit) in product(hit.assembly.scene.contacts, QUANTITIES.items()):
            value = float(getattr(hit[contact.a, contact.b], name))
            yield quantity(name, value, unit, NO_BAR_OF_SCENE, contact=[contact.a, contact.b])
    else:
        values = {name: (float(getattr(hit, name)), unit) for name, unit in QUANTITIES.items()}
        if hit.site_motion is not None:
            values[DEFLECTION] = hit.site_motion.largest, "m"
        for name, (value, unit) in values.items():
            yield _budgeted(budget, name, value, unit)
        if hit.restitution is not None:
            sides = None if budget is None else budget.restitution_sides
            yield quantity("restitution", hit.restitution, "1", sides or NOT_ESTIMATED)
        if dent := dent_of(hit):
            yield quantity("dent", dent, "m", "it follows from the law of the contact")

    for name, peak in (results.stresses or {}).items():
        yield _judged_stress(name, peak, peak.worst_point, force_bar(budget))
    for probe in probes_of(results):
        peak = probe.numbers()
        error = None if peak["error"] is None else peak["error"] * abs(peak["value"])
        bar = NOT_ESTIMATED if error is None else (error, error)
        yield quantity(probe.name, peak["value"], peak["unit"], bar, time=peak["time"])


def _budgeted(budget: ErrorBudget | None, name: str, value: float, unit: str) -> Quantity:
    """The quantity `name` of an impact with its error bar by a budget."""
    if budget is None or (name == DEFLECTION and budget.deflection is None):
        return quantity(name, value, unit, NOT_ESTIMATED)

    shares = {cause: share for cause, share in budget.shares(name).items() if share is not None}
    causes = {c: (shares[c] * value, shares[c] * value) for c in budget.causes if c in shares}
    if "below" not in shares:
        reason = budget.unknown.get(name) or budget.footnote
        return quantity(name, value, unit, reason, causes)
    sides = shares["below"] * value, shares["above"] * value
    return quantity(name, value, unit, sides, causes, condition=budget.condition.strip())


def _judged_stress(name: str, peak: Any, margin: Any, force: float | None) -> Quantity:
    """The judged value of the stress field `peak`, with its bar by mesh and force.

    `margin`: its worst point, or None; `force`: relative error of the force, or None.
    """
    if margin is None:
        value, point, time = peak.largest(1)[0]
        return quantity(name, value, peak.unit, "it is not judged", point=list(point), time=time)

    value, unit = margin.value, "Pa" if margin.is_stress else "1"
    place = {"point": margin.point.tolist(), "time": margin.time, "strength": margin.strength}
    if force is None or not margin.has_bar:
        reason = "the force has no bar" if margin.has_bar else margin.remedy
        return quantity(name, value, unit, reason or margin.note, **place)
    low, high = with_force(margin, force).stresses
    least, largest = margin.errors or (value, value)
    causes = {"mesh": (value - least, largest - value), "force": (force * value, force * value)}
    return quantity(name, value, unit, (value - low, high - value), causes, **place)


def _of_fall(results: SceneResults) -> Iterator[Quantity]:
    """The hardest impact of a fall, its shock and its stress; of an ensemble its quantiles."""
    fall, worst = results.fall, results.worst
    if not hasattr(fall, "flights"):
        yield from _quantiles(fall, FALL_QUANTITIES)
    elif fall.hardest is not None:
        impact = fall.impacts[fall.hardest]
        error = None if impact.law_error is None else impact.law_error * impact.peak_force
        law = {} if error is None else {"law": (error, error)}
        yield quantity("peak_force", impact.peak_force, "N", law.get("law", NO_BAR_OF_FALL), law)
        shocks = {"shock": max(one.g for one in fall.shocks)}
        shocks |= {name: peak.g for name, peak in (results.peaks or {}).items()}
        for name, g in shocks.items():
            yield quantity(name, g, "g", NO_BAR_OF_FALL)
        if worst is not None and worst.exposure is not None:
            yield _judged_stress(worst.quantity, worst, worst.margin(), bar_of_fall(fall, worst))


def _of_sample(results: SceneResults) -> Iterator[Quantity]:
    """The quantiles of a Monte Carlo study."""
    return _quantiles(results.sample, QUANTITIES)


def _quantiles(ensemble: Many, units: Mapping[str, str]) -> Iterator[Quantity]:
    """Quantiles of an ensemble with confidence limits; `units`: quantity -> unit."""
    for name, unit in units.items():
        for q in ensemble.quantiles:
            one = ensemble.quantile(name, q)
            sides = one.value - one.low, one.high - one.value
            yield quantity(name, one.value, unit, sides, {"number": sides}, quantile=q)


def _of_sweep(results: SceneResults) -> Iterator[Quantity]:
    """The numbers of the first impacts of a sweep."""
    for i in range(min(len(results.batch), MOST_ROWS)):
        lists = varied(results.compiled).items()
        at = {label(place): values[i] for place, values in lists}
        for name, unit in QUANTITIES.items():
            value = float(getattr(results.batch, name)[i])
            yield _budgeted(results.facts[i], name, value, unit) | {"at": at}


def _of_map(results: SceneResults) -> Iterator[Quantity]:
    """The largest value of each quantity of a map, and its place."""
    for name, values in results.map.quantities().items():
        site = hardest(results.map, values=values)
        place = {"point": results.map.points[site].tolist(), "at": "the largest"}
        unit = MAP_QUANTITIES.get(name, ("", ""))[1] or "1"
        yield quantity(name, float(values[site]), unit, NO_BAR_OF_MAP, **place)


def _of_tradeoff(results: SceneResults) -> Iterator[Quantity]:
    """The force of each method, with its bar and its cost."""
    assert results.tradeoff is not None
    for member in (*results.tradeoff.table, *results.tradeoff.others):
        cost = {key: getattr(member, key) for key in ("method", "dofs", "n", "seconds")}
        side = member.force_bar * member.peak_force
        bar = (side, side) if np.isfinite(side) else "the unreduced model has no bar"
        yield quantity("peak_force", member.peak_force, "N", bar, **cost)
