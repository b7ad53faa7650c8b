"""The four answers on an impact: does the part break, how hard, how far, and where is it stressed.

They are the first output on the terminal, on the page and in the report, in the same words.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from antiosc import Fall, History
from antiosc.base.errors import NOTE_WEIGHT, message_weight, sorted_by_weight
from antiosc.base.texts import (
    capitalised,
    engineering,
    percent,
    plain_number,
    point_text,
    restitution_text,
)
from antiosc.fields.margin import ELASTIC
from antiosc.impact.histories.bars import DEFLECTION, QUANTITIES, ErrorBudget
from antiosc.impact.histories.verdict import unknown_dent, yield_share
from antiosc_app.headline import force_bar, with_force_error
from antiosc_app.presentation import Card, Rows

if TYPE_CHECKING:
    from antiosc import Margin, PeakField
    from antiosc_studies.drops.fall import WorstField

#: What a verdict is, from which its colour follows.
SAFE_TONE, DENT_TONE, BENDS_TONE, UNKNOWN_TONE = "safe", "dent", "bends", "unknown"
#: The questions in the order in which they are answered.
BREAKS_QUESTION = "does it break"
FORCE_QUESTION = "largest force"
DEFLECTION_QUESTION = "deflection"
STRESS_QUESTION = "largest stress"
#: Most rows below the answers, and most cautions below these.
MAX_ROWS, MAX_CAUTIONS = 8, 3


def cards_of_history(
    hit: History, budget: ErrorBudget | None, fields: Mapping[str, PeakField] | None
) -> list[Card]:
    """The four answers on an impact of two bodies; without `fields` (quantity -> stress field) the
    answers on stress are "…".
    """
    force = force_bar(budget)
    hard = Card(FORCE_QUESTION, _text_with_bar(hit, budget, "peak_force"))
    far = Card(DEFLECTION_QUESTION, deflection_text(hit, budget))
    if fields is None:
        return [Card(BREAKS_QUESTION, "…"), hard, far, Card(STRESS_QUESTION, "…")]

    has_bar = force is not None
    judged = [
        (with_force_error(peak.worst_point, force), peak.exposure is not None)
        for peak in fields.values()
        if peak.worst_point is not None
    ]
    margins = [margin for margin, has_strength in judged if has_strength]
    stress = stress_text([margin for margin, _ in judged], has_bar=has_bar)
    return [
        verdict_card(margins, dent_depth(hit), has_bar=has_bar),
        hard,
        far,
        Card(STRESS_QUESTION, stress),
    ]


def cards_of_fall(fall: Fall, worst: WorstField | None) -> list[Card]:
    """The four answers on a fall, with the largest shock instead of the deflection."""
    hardest = fall.hardest
    if hardest is None:
        return [Card(BREAKS_QUESTION, f"{capitalised(fall.message)}.", SAFE_TONE)]
    impact = fall.impacts[hardest]
    force = engineering(impact.peak_force, "N")
    bar = f" ± {percent(impact.law_error)}" if impact.law_error else " (no error bar)"
    shock = max(one.g for one in fall.shocks)

    judged = worst is not None and worst.exposure is not None
    error = bar_of_fall(fall, worst) if worst is not None and judged else None
    margins = [with_force_error(worst.margin(), error)] if worst is not None and judged else []
    dent = float(max(fall.dents, default=0.0))
    return [
        verdict_card(margins, dent, has_bar=error is not None),
        Card(FORCE_QUESTION, f"{force}{bar}, impact {hardest + 1} of {len(fall.impacts)}"),
        Card("largest shock", f"{plain_number(shock, 3)} g of the centre of mass"),
        Card(STRESS_QUESTION, stress_text(margins, has_bar=error is not None)),
    ]


def dent_depth(hit: History) -> float | None:
    """Depth of the dent [m]; None if it is not known whether the contact yields."""
    if hit.dent is not None:
        return float(hit.dent.depth)
    share = yield_share(hit)
    return None if share is None or share > 1 or unknown_dent(hit) else 0.0


def verdict_card(margins: Sequence[Margin], dent: float | None, *, has_bar: bool) -> Card:
    """Whether the part breaks, by its largest exposure within error bars and the dent's depth [m].

    `has_bar`: whether the force has an error bar. A stress whose bar reaches the strength because
    of coarse cells decides nothing: the answer then asks for finer cells.
    """
    if not margins:
        return Card(
            BREAKS_QUESTION,
            "Cannot say: no strength or no stress of the part is known.",
            UNKNOWN_TONE,
        )
    worst = max(margins, key=lambda margin: margin.bounds[1])
    told = judged_text(worst, has_bar=has_bar)
    answer = capitalised(worst.answer)
    if worst.answer == "cannot say":
        return Card(BREAKS_QUESTION, f"{answer}: {told}; {worst.remedy}.", UNKNOWN_TONE)
    if not has_bar and not worst.reached:
        return Card(
            BREAKS_QUESTION, f"Cannot say: the stress has no error bar, {told}.", UNKNOWN_TONE
        )
    if worst.answer != ELASTIC:
        return Card(BREAKS_QUESTION, f"{answer}: {told}.", BENDS_TONE)
    if dent is None:
        text = f"{answer} away from the contact, {told}; of a dent nothing is known."
        return Card(BREAKS_QUESTION, text, UNKNOWN_TONE)
    if dent > 0:
        text = f"A dent of {engineering(dent, 'm')} remains; elsewhere {worst.answer}, {told}."
        return Card(BREAKS_QUESTION, text, DENT_TONE)
    return Card(BREAKS_QUESTION, f"{answer}: {told}.", SAFE_TONE)


def judged_text(margin: Margin, *, has_bar: bool) -> str:
    """Text of the judged stress and the strength: "121 MPa (79 MPa to 169 MPa) of 235 MPa"."""
    if not margin.is_stress:
        if not margin.has_bar:
            return f"exposure {margin.exposure:.2g} without a bar, failure from 1"
        low, high = margin.bounds
        return f"exposure {low:.2g} to {high:.2g}, failure from 1"
    bar = f" ({range_text_of(margin)})" if has_bar else ""
    return f"{engineering(margin.value, 'Pa')}{bar} of {engineering(margin.strength, 'Pa')}"


def range_text_of(margin: Margin) -> str:
    """Text of the smallest and the largest stress within the error bar."""
    if not margin.has_bar:
        return "no bar"
    low, high = margin.stresses
    return f"{engineering(low, 'Pa')} to {engineering(high, 'Pa')}"


def stress_text(margins: Sequence[Margin], *, has_bar: bool) -> str:
    """Text of the stress with the largest exposure, its range and its place."""
    stresses = [margin for margin in margins if margin.is_stress]
    if not stresses:
        return "not known"
    worst = max(stresses, key=lambda margin: margin.exposure)
    bar = range_text_of(worst) if has_bar else "no error bar"
    return f"{engineering(worst.value, 'Pa')} ({bar}) at {point_text(worst.point)}"


def deflection_text(hit: History, budget: ErrorBudget | None) -> str:
    """Text of the largest deflection of the site, with its error bar."""
    if budget is not None and budget.deflection is not None:
        return budget.shown(DEFLECTION, 3)
    motion = hit.site_motion
    return (
        "the part moves on"
        if motion is None
        else f"{engineering(motion.largest_displacement, 'm')} (no bar)"
    )


def rows_of_history(
    hit: History, budget: ErrorBudget | None, fields: Mapping[str, PeakField] | None = None
) -> Rows:
    """Rows (name, text) below the answers of an impact: contact time, restitution, impulse, …"""
    e = hit.restitution
    rebound = "not defined" if e is None else restitution_text(e)
    rows = [
        ("contact time", _text_with_bar(hit, budget, "contact_time")),
        ("contacts", hit.count_text),
        ("restitution", budget.shown_restitution(e) if budget else rebound),
        ("impulse", _text_with_bar(hit, budget, "impulse")),
    ]
    if dent := dent_depth(hit):
        rows.append(("dent", engineering(dent, "m")))
    return rows + _mesh_round_rows((fields or {}).values())


def rows_of_fall(fall: Fall, worst: WorstField | None = None) -> Rows:
    """Rows (name, text) below the answers of a fall: number of impacts, lost energy."""
    lost = float(fall.impacts.column("lost").sum()) if len(fall.impacts) else 0.0
    rows = [("impacts", f"{len(fall.impacts)}"), ("lost in all", engineering(lost, "J"))]
    return rows + _mesh_round_rows([] if worst is None else [worst])


def _mesh_round_rows(fields: Iterable[PeakField]) -> Rows:
    """Rows (name, text) on the mesh refinements that brought stresses to a tolerance."""
    told = dict.fromkeys(field.rounds for field in fields if field.rounds)
    return [("stress mesh", rounds) for rounds in told]


def bar_of_fall(fall: Fall, worst: WorstField) -> float | None:
    """Relative error, due to the contact law, of the force in the impact with the judged stress."""
    number = 0 if worst.exposure is None else worst.margin().impact
    return fall.impacts[number - 1 if number else int(worst.impact[worst.judged])].law_error


def listed_cautions(first_caution: str, warnings: Iterable[str]) -> list[str]:
    """`first_caution`, and those `warnings` that question the numbers, by weight, each once."""
    told = [
        capitalised(str(one))
        for one in sorted_by_weight(list(warnings))
        if message_weight(one) < NOTE_WEIGHT
    ]
    others = [one for one in dict.fromkeys(told) if one not in first_caution]
    return [one for one in (first_caution, *others) if one]


def _text_with_bar(hit: History, budget: ErrorBudget | None, name: str) -> str:
    """Text of the quantity `name` of an impact with its error bar."""
    if budget:
        return budget.shown(name, 3)
    return f"{engineering(getattr(hit, name), QUANTITIES[name])} (no error bar)"
