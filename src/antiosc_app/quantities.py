"""Numbers of a result as JSON, each with its error bar and causes, or the reason for no bar."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antiosc import SceneHistory
from antiosc.fields.pictures import MAP_QUANTITIES
from antiosc.impact.histories.bars import DEFLECTION, QUANTITIES, ErrorBudget
from antiosc.strikes.map_results import hardest
from antiosc_app.cards import bar_of_fall, dent_depth
from antiosc_app.headline import (
    CAUSE_REMEDIES,
    NO_ESTIMATE_TEXT,
    force_bar,
    no_bar_reason,
    with_force_error,
)
from antiosc_app.probes import probes_of
from antiosc_app.results import FALL_QUANTITIES
from antiosc_app.scene_file.document import place_text
from antiosc_app.scene_file.run import SceneResults, error_budget, varied_values

if TYPE_CHECKING:
    from antiosc import Many

#: A number with its name, unit and bar, as JSON.
Quantity: TypeAlias = dict[str, Any]
#: How far a bar reaches below and above a number.
BarSides: TypeAlias = tuple[float, float]
#: Why numbers have no bar.
SCENE_BAR_TEXT = "a scene of several contacts has no error bars"
FALL_BAR_TEXT = "only the force of a fall has a bar, by its law, and its stress"
MAP_BAR_TEXT = "a map has no error bars, an impact at this site alone has them"
#: What narrows a bar by a cause that no single impact has.
REMEDIES_BY_CAUSE = CAUSE_REMEDIES | {
    "force": "narrow the bar of the peak force",
    "number": "run more (n)",
}
#: Most impacts of a sweep that are told.
MAX_SWEEP_ROWS = 50


def quantity(
    name: str,
    value: float,
    unit: str,
    bar: BarSides | str,
    causes: Mapping[str, BarSides] | None = None,
    **more: object,
) -> Quantity:
    """A number as JSON; `bar`: errors below and above, or the reason why they are unknown.

    `causes`: cause -> its share of the bar, below and above; `more`: further keys.
    """
    told = [
        {"cause": cause, "below": below, "above": above, "narrowed_by": REMEDIES_BY_CAUSE[cause]}
        for cause, (below, above) in (causes or {}).items()
    ]
    ends = f"none: {bar}" if isinstance(bar, str) else [value - bar[0], value + bar[1]]
    return {"name": name, "value": value, "unit": unit, "bar": ends, "causes": told, **more}


def quantities(results: SceneResults) -> list[Quantity]:
    """All numbers of the results of a scene."""
    kinds = {
        **{
            "history": _history_quantities,
            "fall": _fall_quantities,
            "batch": _sweep_quantities,
            "sample": _sample_quantities,
        },
        **{"map": _map_quantities, "tradeoff": _tradeoff_quantities},
    }
    made = (kinds[name](results) for name in kinds if getattr(results, name) is not None)
    return [one for numbers in made for one in numbers]


def _history_quantities(results: SceneResults) -> Iterator[Quantity]:
    """The numbers of an impact or of each contact of a scene, of its stresses and probes."""
    hit = results.history
    budget = error_budget(hit)
    if isinstance(hit, SceneHistory):
        for contact, (name, unit) in product(hit.assembly.scene.contacts, QUANTITIES.items()):
            value = float(getattr(hit[contact.a, contact.b], name))
            yield quantity(name, value, unit, SCENE_BAR_TEXT, contact=[contact.a, contact.b])
    else:
        reason = no_bar_reason(hit)
        values = {name: (float(getattr(hit, name)), unit) for name, unit in QUANTITIES.items()}
        if hit.site_motion is not None:
            values[DEFLECTION] = hit.site_motion.largest_displacement, "m"
        for name, (value, unit) in values.items():
            yield _quantity_with_bar(budget, name, value, unit, reason)
        if hit.restitution is not None:
            sides = None if budget is None else budget.restitution_sides
            yield quantity("restitution", hit.restitution, "1", sides or reason)
        if dent := dent_depth(hit):
            yield quantity("dent", dent, "m", "it follows from the law of the contact")

    for name, peak in (results.stresses or {}).items():
        yield _judged_stress(name, peak, peak.worst_point, force_bar(budget))
    for probe in probes_of(results):
        peak = probe.numbers()
        error = None if peak["error"] is None else peak["error"] * abs(peak["value"])
        bar = NO_ESTIMATE_TEXT if error is None else (error, error)
        yield quantity(probe.name, peak["value"], peak["unit"], bar, time=peak["time"])


def _quantity_with_bar(
    budget: ErrorBudget | None, name: str, value: float, unit: str, reason: str = NO_ESTIMATE_TEXT
) -> Quantity:
    """The quantity `name` of an impact with its bar from a budget; `reason`: why it has none."""
    if budget is None or (name == DEFLECTION and budget.deflection is None):
        return quantity(name, value, unit, reason)

    shares = {cause: share for cause, share in budget.shares(name).items() if share is not None}
    causes = {c: (shares[c] * value, shares[c] * value) for c in budget.causes if c in shares}
    if "below" not in shares:
        reason = budget.unknown.get(name) or budget.footnote
        return quantity(name, value, unit, reason, causes)
    sides = shares["below"] * value, shares["above"] * value
    return quantity(name, value, unit, sides, causes, condition=budget.condition.strip())


def _judged_stress(name: str, peak: Any, margin: Any, force_error: float | None) -> Quantity:
    """The judged value of the stress field `peak`, with its error bar due to mesh and force.

    `margin`: worst point or None; `force_error`: relative error of the force or None.
    """
    if margin is None:
        value, point, time = peak.largest(1)[0]
        return quantity(name, value, peak.unit, "it is not judged", point=list(point), time=time)

    value, unit = margin.value, "Pa" if margin.is_stress else "1"
    place = {"point": margin.point.tolist(), "time": margin.time, "strength": margin.strength}
    if force_error is None or not margin.has_bar:
        reason = "the force has no bar" if margin.has_bar else margin.remedy
        return quantity(name, value, unit, reason or margin.note, **place)
    low, high = with_force_error(margin, force_error).stresses
    least, largest = margin.errors or (value, value)
    causes = {
        "mesh": (value - least, largest - value),
        "force": (force_error * value, force_error * value),
    }
    return quantity(name, value, unit, (value - low, high - value), causes, **place)


def _fall_quantities(results: SceneResults) -> Iterator[Quantity]:
    """The hardest impact of a fall, its shock and stress; for an ensemble its quantiles."""
    fall, worst = results.fall, results.worst
    if not hasattr(fall, "flights"):
        yield from _quantile_quantities(fall, FALL_QUANTITIES)
    elif fall.hardest is not None:
        impact = fall.impacts[fall.hardest]
        error = None if impact.law_error is None else impact.law_error * impact.peak_force
        law = {} if error is None else {"law": (error, error)}
        yield quantity("peak_force", impact.peak_force, "N", law.get("law", FALL_BAR_TEXT), law)
        shocks = {"shock": max(one.g for one in fall.shocks)}
        shocks |= {name: peak.g for name, peak in (results.peaks or {}).items()}
        for name, g in shocks.items():
            yield quantity(name, g, "g", FALL_BAR_TEXT)
        if worst is not None and worst.exposure is not None:
            yield _judged_stress(worst.quantity, worst, worst.margin(), bar_of_fall(fall, worst))


def _sample_quantities(results: SceneResults) -> Iterator[Quantity]:
    """The quantiles of a Monte Carlo study."""
    return _quantile_quantities(results.sample, QUANTITIES)


def _quantile_quantities(ensemble: Many, units: Mapping[str, str]) -> Iterator[Quantity]:
    """Quantiles of an ensemble with confidence limits; `units`: quantity -> unit."""
    for name, unit in units.items():
        for q in ensemble.quantiles:
            one = ensemble.quantile(name, q)
            sides = one.value - one.low, one.high - one.value
            yield quantity(name, one.value, unit, sides, {"number": sides}, quantile=q)


def _sweep_quantities(results: SceneResults) -> Iterator[Quantity]:
    """The numbers of the first impacts of a sweep."""
    for i in range(min(len(results.batch), MAX_SWEEP_ROWS)):
        lists = varied_values(results.compiled).items()
        at = {place_text(place): values[i] for place, values in lists}
        for name, unit in QUANTITIES.items():
            value = float(getattr(results.batch, name)[i])
            yield _quantity_with_bar(results.facts[i], name, value, unit) | {"at": at}


def _map_quantities(results: SceneResults) -> Iterator[Quantity]:
    """The largest value of each quantity of a map, and its place."""
    for name, values in results.map.quantities().items():
        site = hardest(results.map, values=values)
        place = {"point": results.map.points[site].tolist(), "at": "the largest"}
        unit = MAP_QUANTITIES.get(name, ("", ""))[1] or "1"
        yield quantity(name, float(values[site]), unit, MAP_BAR_TEXT, **place)


def _tradeoff_quantities(results: SceneResults) -> Iterator[Quantity]:
    """The force of each method, with its bar and its cost."""
    assert results.tradeoff is not None
    for member in (*results.tradeoff.table, *results.tradeoff.others):
        cost = {key: getattr(member, key) for key in ("method", "dofs", "n", "seconds")}
        side = member.force_bar * member.peak_force
        bar = (side, side) if np.isfinite(side) else "the unreduced model has no bar"
        yield quantity("peak_force", member.peak_force, "N", bar, **cost)
