"""The numbers of a result, each with its bar by cause, or the reason why it has none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

from antiosc import SceneHistory
from antiosc.extension import DEFLECTION, MAP_QUANTITIES, QUANTITIES, ErrorBudget, hardest, trusted
from antiosc_app.cards import bar_of_fall, dent_of
from antiosc_app.headline import REMEDIES, force_bar, with_force
from antiosc_app.presentation import Columns
from antiosc_app.probes import probes_of
from antiosc_app.results import FALLS
from antiosc_app.scene_file.document import label
from antiosc_app.scene_file.run import SceneResults, error_budget, varied

#: A number with its name, unit and bar, as JSON.
Quantity: TypeAlias = dict[str, Any]
#: Why a number has no bar, where no other reason is known.
NOT_ESTIMATED = 'there is no error bar: extract with error = "estimate"'
OF_SCENE = "a scene of several contacts has no error bars"
OF_FALL = "a fall has a bar of its force by the contact law, and of its stress, alone"
OF_MAP = "a map has no error bars, an impact at this site alone has them"
#: What narrows a cause that `REMEDIES` does not have.
OTHERS = {"force": "narrow the bar of the peak force", "number": "run more of them (n)"}
#: Most impacts of a sweep whose numbers are told.
MOST_ROWS = 50


def quantity(
    name: str,
    value: float,
    unit: str,
    bar: tuple[float, float] | str,
    causes: dict[str, tuple[float, float]] | None = None,
    **more: object,
) -> Quantity:
    """A number with its bar (lowest, highest), or why it has none.

    `causes` : cause -> share of the bar below and above, in the unit of the number.
    """
    shares = {} if causes is None else causes
    told = [
        {
            "cause": cause,
            "below": below,
            "above": above,
            "narrowed_by": {**REMEDIES, **OTHERS}[cause],
        }
        for cause, (below, above) in shares.items()
    ]
    bar_told = f"none: {bar.rstrip('.')}" if isinstance(bar, str) else list(bar)
    return {"name": name, "value": value, "unit": unit, "bar": bar_told, "causes": told, **more}


def quantities(results: SceneResults) -> list[Quantity]:
    """All numbers of a result."""
    kinds = {
        **{"history": _of_history, "fall": _of_fall, "batch": _of_sweep},
        **{"map": _of_map, "tradeoff": _of_tradeoff, "found": _of_blow},
    }
    made = [kinds[name](results) for name in kinds if getattr(results, name) is not None]
    return [one for numbers in made for one in numbers]


# -- an impact


def _of_history(results: SceneResults) -> Iterator[Quantity]:
    """The numbers of an impact, or of each contact of a scene; those of its probes."""
    hit = results.history
    if isinstance(hit, SceneHistory):
        for contact in hit.contact_histories:
            for name, unit in QUANTITIES.items():
                value = float(getattr(contact, name))
                ends = {"contact": [contact.a, contact.b]}
                yield quantity(name, value, unit, OF_SCENE, **ends)
    else:
        yield from _of_impact(hit, results.stresses or {})
    for probe in probes_of(results):
        peak = probe.numbers()
        error = peak["error"]
        value = peak["value"]
        told = "the impact has no bar, and so the probe has none"
        bar = told if error is None else (value - error * abs(value), value + error * abs(value))
        yield quantity(f"probe {probe.name}", value, peak["unit"], bar, time=peak["time"])


def _of_impact(hit: Any, stresses: Any) -> Iterator[Quantity]:
    """The numbers of an impact of two bodies."""
    budget = error_budget(hit)
    for name, unit in QUANTITIES.items():
        yield of_budget(budget, name, float(getattr(hit, name)), unit)
    if budget is not None and budget.deflection is not None:
        yield of_budget(budget, DEFLECTION, budget.deflection.value, "m")
    elif hit.site_motion is not None:
        yield quantity(DEFLECTION, hit.site_motion.largest, "m", NOT_ESTIMATED)

    if hit.restitution is not None:
        sides = None if budget is None else budget.restitution_sides
        e = hit.restitution
        bar = NOT_ESTIMATED if sides is None else (e - sides[0], e + sides[1])
        yield quantity("restitution", e, "1", bar)
    if dent := dent_of(hit):
        yield quantity("dent", dent, "m", "the depth follows from the contact law")
    yield from _of_stresses(stresses, force_bar(budget))


def of_budget(budget: ErrorBudget | None, name: str, value: float, unit: str) -> Quantity:
    """A number with its bar by the causes of an error budget."""
    if budget is None:
        return quantity(name, value, unit, NOT_ESTIMATED)
    shares = budget.shares(name)
    causes = {
        cause: (shares[cause] * abs(value),) * 2
        for cause in budget.causes
        if shares.get(cause) is not None
    }
    if shares["below"] is None:
        reason = budget.unknown.get(name) or budget.footnote
        return quantity(name, value, unit, reason, causes)
    bar = (value * (1 - shares["below"]), value * (1 + shares["above"]))
    return quantity(name, value, unit, bar, causes, condition=budget.condition.strip())


def _of_stresses(fields: Any, force: float | None) -> Iterator[Quantity]:
    """The judged stress of each field, or its exposure, with its bar by mesh and force."""
    for name, peak in fields.items():
        margin = peak.worst_point
        if margin is None:
            value, point, time = peak.largest(1)[0]
            place = {"point": list(point), "time": time}
            yield quantity(name, value, peak.unit, "it is not judged", **place)
            continue
        yield of_margin(margin, name, force)


def of_margin(margin: Any, name: str, force: float | None) -> Quantity:
    """The worst point of a stress field."""
    unit = "Pa" if margin.is_stress else "1"
    place = {"point": margin.point.tolist(), "time": margin.time, "strength": margin.strength}
    place |= {"criterion": margin.criterion, "scope": margin.scope}
    if not margin.has_bar or force is None:
        reason = margin.note or margin.remedy if not margin.has_bar else "the force has no bar"
        return quantity(name, margin.value, unit, reason or "the mesh", **place)
    low, high = margin.errors or (margin.value, margin.value)
    causes = {
        "mesh": (margin.value - low, high - margin.value),
        "force": (force * margin.value, force * margin.value),
    }
    return quantity(name, margin.value, unit, with_force(margin, force).stresses, causes, **place)


# -- falls and studies


def _of_fall(results: SceneResults) -> Iterator[Quantity]:
    """The hardest impact of a fall, its shock and its stress; of an ensemble its quantiles."""
    fall, worst = results.fall, results.worst
    if not hasattr(fall, "flights"):
        for name, unit in FALLS.items():
            for q in fall.quantiles:
                found = fall.quantile(name, q)
                causes = {"number": (found.value - found.low, found.high - found.value)}
                bar = (found.low, found.high)
                yield quantity(name, found.value, unit, bar, causes, quantile=q)
        return
    if fall.hardest is None:
        return
    impact = fall.impacts[fall.hardest]
    value, error = float(impact.peak_force), impact.law_error
    law = {} if error is None else {"law": (error * value, error * value)}
    bar = OF_FALL if error is None else (value * max(1 - error, 0.0), value * (1 + error))
    yield quantity("peak_force", value, "N", bar, law, impact=fall.hardest + 1)
    yield quantity("shock", float(max(one.g for one in fall.shocks)), "g", OF_FALL)
    yield quantity("dent", float(max(fall.dents, default=0.0)), "m", OF_FALL)
    for name, peak in (results.peaks or {}).items():
        yield quantity(f"accelerometer {name}", peak.g, "g", OF_FALL)
    if worst is not None and worst.exposure is not None:
        yield of_margin(worst.margin(), worst.quantity, bar_of_fall(fall, worst))


def _of_sweep(results: SceneResults) -> Iterator[Quantity]:
    """The numbers of each impact of a sweep, the first `MOST_ROWS`."""
    batch = results.batch
    lists = {label(place): given for place, given in varied(results.compiled).items()}
    for i in range(min(len(batch), MOST_ROWS)):
        at = {name: values[i] for name, values in lists.items()}
        for name, unit in QUANTITIES.items():
            value = float(getattr(batch, name)[i])
            yield {**of_budget(results.facts[i], name, value, unit), "at": at}


def _of_map(results: SceneResults) -> Iterator[Quantity]:
    """The largest and the smallest value of each quantity of a map, with its place."""
    impact_map = results.map
    sites = np.asarray(trusted(impact_map))
    for name, values in impact_map.quantities().items():
        unit = MAP_QUANTITIES.get(name, ("", "1"))[1] or "1"
        known = sites[np.isfinite(values[sites])]
        if not known.size:
            continue
        for what, site in (
            ("largest", hardest(impact_map, values=values)),
            ("smallest", known[np.argmin(values[known])]),
        ):
            point = impact_map.points[site].tolist()
            yield quantity(f"{what} {name}", float(values[site]), unit, OF_MAP, point=point)


def _of_tradeoff(results: SceneResults) -> Iterator[Quantity]:
    """The force of each method, with its bar and its cost."""
    compared = results.tradeoff
    assert compared is not None
    for member in (*compared.table, *compared.others):
        value, share = member.peak_force, member.force_bar
        cost = {"dofs": member.dofs, "n": member.n, "seconds": member.seconds}
        cost |= {"method": member.method, "gigabytes": member.gigabytes, "cells": member.size}
        none = "the unreduced model has no bar"
        bar = (value * max(1 - share, 0.0), value * (1 + share)) if np.isfinite(share) else none
        yield quantity("peak_force", value, "N", bar, **cost)


def _of_blow(results: SceneResults) -> Sequence[Quantity]:
    """The numbers of a blow that was found in signals."""
    numbers: Columns = results.found.numbers()
    told = {name: value for name, value in numbers.items() if isinstance(value, float)}
    return [quantity(name, value, "SI", "its message says it") for name, value in told.items()]
