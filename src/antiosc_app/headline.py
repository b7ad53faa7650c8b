"""Sentences and cautions on a result, and the error bars of its force and stress."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from antiosc import History, ImpactMap, LinearBody, SceneHistory
from antiosc.base.texts import capitalised, engineering, percent, plus_minus, point_text
from antiosc.impact.histories.bars import ErrorBudget
from antiosc.models.body import piercing_warning
from antiosc.strikes.map_results import hardest, left_out_text, low_band_text, trusted
from antiosc_app.scene_file.run import coarse_cell_sentence

if TYPE_CHECKING:
    from antiosc import Margin, PeakField

#: What brings error bars.
NO_ESTIMATE_TEXT = 'extract with error = "estimate"'
#: Relative error of a force from which it is told before the numbers.
WIDE_BAR = 0.5
#: Share of a bar below which its cause is not told.
MIN_CAUSE_SHARE = 0.05
#: Cause of the largest share of a bar -> what reduces it.
CAUSE_REMEDIES: dict[str, str] = {
    "mesh": "use smaller elements around the site",
    "truncation": "extract more anti-oscillators",
    "time": "use a smaller tol",
    "patch": "take a smaller patch on smaller elements",
    "noise": "measure with less noise and up to a higher frequency",
    "stretch": "extract with a larger number of motions that stretch",
    "law": "give the yield strength of the part's own material, with its range",
}


def sentences_of_history(
    hit: History, budget: ErrorBudget | None, fields: Mapping[str, PeakField]
) -> list[str]:
    """Sentences that explain the results of an impact; `fields`: quantity -> its `PeakField`."""
    footnote = "" if budget is None else budget.footnote
    stress = stress_sentences(fields, force_bar(budget))
    told = [hit.verdict, *stress, largest_cause_text(budget), footnote, hit.explanation]
    return [sentence for sentence in told if sentence]


def sentences_of_map(impact_map: ImpactMap) -> list[str]:
    """Sentences on the sites of a map with the largest force, largest stress, lowest stiffness."""
    sentences = []
    points = impact_map.points

    if impact_map.peak_force is not None:
        i = hardest(impact_map)
        force = engineering(float(impact_map.peak_force[i]), "N")
        sentences.append(
            f"The largest force, {force}, arises at {point_text(points[i])}; a map has no error"
            " bars, an impact at this site alone has them."
        )

    if impact_map.peak_stress is not None:
        exposure = impact_map.exposure
        i = hardest(impact_map, values=impact_map.peak_stress if exposure is None else exposure)
        stress = engineering(float(impact_map.peak_stress[i]), "Pa")
        share = "" if exposure is None else f", {exposure[i]:.3g} of the yield strength"
        sentences.append(
            f"A blow at {point_text(points[i])} stresses the part most: {stress}{share}."
        )

    softest = min(trusted(impact_map), key=lambda site: impact_map.models.k0[site])
    stiffness = engineering(float(impact_map.models.k0[softest]), "N/m")
    sentences.append(
        f"The softest place, of a static stiffness k0 of {stiffness}, is at"
        f" {point_text(points[softest])}."
    )
    return sentences


def caution_of_map(impact_map: ImpactMap) -> str:
    """Text on doubtful sites of a map and on impacts beyond its models' frequencies; or ""."""
    sentences = (left_out_text(impact_map), low_band_text(impact_map))
    return " ".join(capitalised(sentence) for sentence in sentences if sentence)


def caution_of_impact(hit: History, budget: ErrorBudget | None) -> str:
    """Caution to read before the numbers of an impact; "" if nothing casts doubt on them."""
    cautions = []
    if not isinstance(hit, SceneHistory):
        cautions += [
            hit.assembly.theory_warning,
            piercing_warning(hit.model, hit.impactor),
            hit.unfinished,
        ]

    coarse = coarse_cell_sentence(hit)
    cautions.append(coarse)
    if budget is None:
        cautions.append("" if coarse else f"there is no error bar: {NO_ESTIMATE_TEXT}")
    elif budget["peak_force"].known >= WIDE_BAR:
        cautions.append(f"the force is a rough one, ± {percent(budget['peak_force'].known)}")
    return " ".join(_as_sentence(text) for text in cautions if text)


def no_bar_reason(hit: History) -> str:
    """Why an impact has no error budget, or what brings it."""
    if coarse_cell_sentence(hit):
        return "the cell at the site is too large"
    return NO_ESTIMATE_TEXT


def _as_sentence(text: str) -> str:
    """A text as a sentence: it begins with a capital and ends with a full stop."""
    return f"{capitalised(text).rstrip('.')}."


def largest_cause_text(budget: ErrorBudget | None) -> str:
    """Sentence on the largest cause of the force's error bar, with the remedy; or ""."""
    if budget is None:
        return ""
    bar = budget["peak_force"]
    cause = max(budget.causes, key=lambda name: getattr(bar, name))
    if getattr(bar, cause) < MIN_CAUSE_SHARE:
        return ""
    share = percent(getattr(bar, cause))
    remedy = CAUSE_REMEDIES[cause]
    return f"Most of the bar of the peak force comes from the {cause}, {share}: {remedy}."


class NumericalBar(float):
    """A relative error of a force without the contact law's share, which is not known."""


def force_bar(budget: ErrorBudget | None) -> float | None:
    """Relative error of the peak force; None if the mesh's share of it is not known."""
    if budget is None or "mesh" in budget.unknown:
        return None
    bar = budget["peak_force"]
    return NumericalBar(bar.numerical) if bar.total is None else bar.total


def stress_sentences(fields: Mapping[str, PeakField], force_error: float | None) -> list[str]:
    """A sentence on the largest value of each stress field; `force_error`: relative."""
    sentences = []
    for name, peak in fields.items():
        if peak.worst_point is None:
            value, point, time = peak.largest(1)[0]
            place = f"at {point_text(point)}, {engineering(time, 's')}"
            told = f"largest {name.replace('_', ' ')} {engineering(value, peak.unit, 4)} {place}"
        else:
            bar = stress_bar(peak, force_error)
            told = with_force_error(peak.worst_point, force_error).sentence
            told += "" if bar is None else f" (that stress {plus_minus(bar)})"
        sentences.append(_as_sentence(told))
    return sentences


def with_force_error(worst: Margin, force_error: float | None) -> Margin:
    """The margin with the relative error of the force (0 for None) included in its error bar."""
    return replace(worst, force_error=force_error or 0.0)


def stress_bar(peak: PeakField, force_error: float | None) -> tuple[float, float] | None:
    """(below, above): relative error bar of the judged stress; None if it is not known."""
    worst = peak.worst_point
    if force_error is None or worst is None or not worst.is_stress or not worst.has_bar:
        return None
    if not worst.value or not peak.largest_mesh_error:
        return None
    low, high = (end / worst.value for end in with_force_error(worst, force_error).stresses)
    return 1 - low, high - 1


def judged_stress_data(fields: Mapping[str, PeakField]) -> dict[str, Any]:
    """Value [Pa], time [s] and place [m] of the judged stress, for the page; {} without one."""
    margins = [peak.worst_point for peak in fields.values()]
    worst = next(
        (
            one
            for one in margins
            if one is not None and one.is_stress and one.criterion != "tension"
        ),
        None,
    )
    if worst is None:
        return {}
    return {
        "stress": worst.value,
        "stress_time": worst.time,
        "stress_place": worst.point.tolist(),
    }


def striker_text(body: LinearBody | None) -> str:
    """Kind, mass and speed of a striker: "Sphere, 32.9 g, 2.00 m/s"."""
    units = {"mass": "kg", "velocity": "m/s"}
    values = {name: getattr(body, name, None) for name in units}
    known = [engineering(x, units[n]) for n, x in values.items() if isinstance(x, float) and x]
    return ", ".join([type(body).__name__, *known])
