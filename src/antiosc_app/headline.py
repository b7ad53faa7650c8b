"""What stands first of a result: what strikes what, numbers with their bars, the verdict."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from antiosc import IMPACTORS, History, ImpactMap, LinearBody, SceneHistory, named_impactor
from antiosc.base.errors import InputError
from antiosc.base.texts import (
    capitalised,
    engineering,
    percent,
    plus_minus,
    point_text,
    restitution_text,
)
from antiosc.extension import QUANTITIES, ErrorBudget, hardest, left_out_text, low_band, trusted
from antiosc.models.auto_contact import piercing
from antiosc.models.body import site_points
from antiosc_app.scene_file.run import coarse_cells

if TYPE_CHECKING:
    from antiosc import Margin, PeakField, Structure

#: Relative error of a force from which it is told before the numbers.
WIDE = 0.5
#: Share of a bar below which its cause is not told.
LEAST_SHARE = 0.05
#: Cause of the largest share of a bar -> what reduces it.
REMEDIES = {
    "mesh": "use smaller elements around the site",
    "truncation": "extract more anti-oscillators",
    "time": "use a smaller tol",
    "patch": "take a smaller patch on smaller elements",
    "noise": "measure with less noise, or average more blows",
    "band": "measure up to a higher frequency",
    "model": "use solid elements in place of beams or shells",
    "stretch": "extract with a larger number of motions that stretch",
    "law": "give the yield strength of the part's own material, with its range",
}
#: Attribute of a striker in a headline -> (its unit, the preposition).
STRIKER_WORDS = {"mass": ("kg", "of"), "velocity": ("m/s", "at")}


class Headline(NamedTuple):
    """Striker and part, the numbers (name, value with error bar), and sentences of the verdict.

    `caution`: what must be read before the numbers, "" if nothing must; `footnote`: what the bars
    leave out. `kinds` of the sentences tell the page which hold for the computed case alone.
    """

    about: str
    numbers: list[tuple[str, str]]
    sentences: list[str]
    kinds: tuple[str, ...] = ()
    caution: str = ""
    footnote: str = ""


def headline_of_history(
    hit: History,
    structure: Structure | None,
    budget: ErrorBudget | None,
    fields: Mapping[str, PeakField],
    file: str = "",
) -> Headline:
    """The headline of an impact of two bodies.

    `fields`: its `PeakField`s by quantity; `file`: name of the part's file, if known.
    """
    e = hit.restitution
    rebound = restitution_text(e) if e is not None else "not defined"
    numbers = [(name.replace("_", " "), _shown(hit, budget, name)) for name in QUANTITIES]
    numbers.append(("restitution", budget.shown_restitution(e) if budget else rebound))
    sentences = [
        ("contact", hit.verdict),
        *(("stress", sentence) for sentence in stress_sentences(fields, force_bar(budget))),
        ("accuracy", largest_share(budget)),
    ]
    known = [(kind, text) for kind, text in sentences if text]
    places = list(site_points(hit.model).values())
    part = file or ("a model" if structure is None else _named(structure.describe()))
    place = f" at {point_text(places[0])}" if len(places) == 1 else ""
    return Headline(
        f"{_body(hit.impactor)} strikes {part}{place}.",
        numbers,
        [text for _, text in known],
        tuple(kind for kind, _ in known),
        caution_of(hit, budget),
        "" if budget is None else budget.footnote,
    )


def headline_of_map(
    impact_map: ImpactMap, structure: Structure | None = None, file: str = ""
) -> Headline:
    """The headline of a map; `file`: name of the part's file, if known."""
    numbers = [("sites", f"{len(impact_map)}")]
    sentences = []
    rows = trusted(impact_map)
    if impact_map.peak_force is not None:
        for name, unit in (("peak_force", "N"), ("contact_time", "s")):
            values = getattr(impact_map, name)[rows]
            ends = (engineering(float(end(values)), unit) for end in (np.nanmin, np.nanmax))
            numbers.append((name.replace("_", " "), " to ".join(ends)))
        i = hardest(impact_map)
        force = engineering(float(impact_map.peak_force[i]), "N")
        place = point_text(impact_map.points[i])
        sentences.append(
            f"The largest force, {force}, arises at {place}; a map has no error bars, an impact at"
            " this site alone has them."
        )
    if impact_map.peak_stress is not None:
        i = most_stressed(impact_map)
        stress = engineering(float(impact_map.peak_stress[i]), "Pa")
        share = (
            ""
            if impact_map.exposure is None
            else (f", {impact_map.exposure[i]:.3g} of the yield strength")
        )
        sentences.append(
            f"A blow at {point_text(impact_map.points[i])} stresses the part most: {stress}{share}."
        )
    softest = min(rows, key=lambda site: impact_map.models.k0[site])
    stiffness = engineering(float(impact_map.models.k0[softest]), "N/m")
    sentences.append(
        f"The softest place, of a static stiffness k0 of {stiffness}, is at"
        f" {point_text(impact_map.points[softest])}."
    )
    part = file or _named(impact_map.info.get("structure", "a part"))
    about = "Models over a surface."
    if impact_map.impactor is not None:
        about = f"{_body(impact_map.impactor)} strikes {part}."
    return Headline(about, numbers, sentences, caution=" ".join(map_cautions(impact_map)))


def map_cautions(impact_map: ImpactMap) -> list[str]:
    """Sentences on the doubtful sites of a map, and on models of too low a band."""
    sentences = (left_out_text(impact_map), low_band(impact_map))
    return [capitalised(sentence) for sentence in sentences if sentence]


def most_stressed(impact_map: ImpactMap) -> int:
    """Number of the site whose blow stresses the part most; without stresses the hardest one."""
    if impact_map.peak_stress is None:
        return hardest(impact_map)
    values = impact_map.peak_stress if impact_map.exposure is None else impact_map.exposure
    return hardest(impact_map, values=values)


def caution_of(hit: History, budget: ErrorBudget | None) -> str:
    """What must be read before the numbers of an impact."""
    cautions = []
    if not isinstance(hit, SceneHistory):
        hopeless = hit.assembly.hopeless.replace("'structure'", "the part")
        cautions += [hopeless, piercing(hit.model, hit.impactor), hit.unfinished]
    cautions.append(coarse_cells(hit))
    if budget is None:
        cautions.append('there is no error bar: extract with error = "estimate"')
    elif budget["peak_force"].known >= WIDE:
        cautions.append(f"the force is a rough one, ± {percent(budget['peak_force'].known)}")
    return " ".join(f"{capitalised(text).rstrip('.')}." for text in cautions if text)


def largest_share(budget: ErrorBudget | None) -> str:
    """Sentence on the cause of most of the bar of the force, and what reduces it."""
    if budget is None:
        return ""
    bar = budget["peak_force"]
    cause = max(budget.causes, key=lambda name: getattr(bar, name))
    if getattr(bar, cause) < LEAST_SHARE:
        return ""
    share = percent(getattr(bar, cause))
    return f"Most of the bar of the peak force comes from the {cause}, {share}: {REMEDIES[cause]}."


class Numerical(float):
    """A relative error of a force without that of the contact's law, which is not known."""


def force_bar(budget: ErrorBudget | None) -> float | None:
    """Relative error of the largest force with its law's, or without where that is not known
    (`Numerical`); None if that by the mesh is not known.
    """
    if budget is None or "mesh" in budget.unknown:
        return None
    bar = budget["peak_force"]
    return Numerical(bar.without_law) if bar.total is None else bar.total


def stress_sentences(fields: Mapping[str, PeakField], force: float | None) -> list[str]:
    """The verdicts on strengths; `force`: relative error of the force, which stresses follow."""
    sentences = []
    for peak in fields.values():
        if peak.worst_point is not None:
            sentences.append(f"{capitalised(judgement(peak, force))}.")
        if peak.doubt:
            sentences.append(f"{capitalised(peak.doubt).rstrip('.')}.")
    return sentences


def judgement(peak: PeakField, force: float | None) -> str:
    """The margin in words, in whose verdict the error of the force counts, with its bar."""
    assert peak.worst_point is not None
    sentence = with_force(peak.worst_point, force).sentence
    bar = stress_bar(peak, force)
    return sentence if bar is None else f"{sentence} (that stress {plus_minus(bar)})"


def with_force(worst: Margin, force: float | None) -> Margin:
    """The worst point of a stress with the relative error of the force."""
    return replace(worst, force_error=force or 0.0)


def stress_bar(peak: PeakField, force: float | None) -> tuple[float, float] | None:
    """How far the judged stress may lie below and above, over itself, by mesh, patch and force;
    None if not all are known.
    """
    worst = peak.worst_point
    if force is None or worst is None or not worst.is_stress or not worst.has_bar:
        return None
    if not worst.value or not peak.largest_mesh_error:
        return None
    low, high = (end / worst.value for end in with_force(worst, force).stresses)
    return 1 - low, high - 1


def largest_stress(fields: Mapping[str, PeakField], force: float | None) -> dict[str, Any]:
    """The von Mises stress [Pa] nearest to yield, for the page; {} where none was sought.

    `strength`: null where it is not known; `scope`: where it is judged; `stress_place` [m]: null at
    the edge of a contact's surroundings; `stress_bar`: as of `stress_bar`.
    """
    for peak in fields.values():
        margin = peak.worst_point
        if margin is None or not margin.is_mises:
            continue
        bar = stress_bar(peak, force)
        return {
            "stress": margin.value,
            "strength": None if peak.exposure is None else margin.strength,
            "stress_bar": bar,
            "stress_note": "" if bar is not None else "no bar",
            "scope": margin.scope,
            "stress_time": margin.time,
            "stress_place": None if margin.at_edge else margin.point.tolist(),
        }
    return {}


def without_bars(structure: Structure) -> str:
    """Sentence why `extract(…, error="estimate")` refuses a structure; "" if it accepts it."""
    matrices = structure.matrices
    if not (matrices.meshed or matrices.assembled):
        return "matrices have no mesh"
    from antiosc.extension import ModelErrors, refuse_dampers

    try:
        refuse_dampers(structure, "an error bar")
        return ModelErrors(structure).skipped
    except InputError as error:
        return str(error)


def striker_text(body: LinearBody | None) -> str:
    """Kind, mass and speed of a striker: "sphere of 32.9 g at 2.00 m/s"."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(body).__name__).lower()
    standard = (n for n, known in IMPACTORS.items() if known.speed and body == named_impactor(n))
    text = [next(standard, words)]
    for name, (unit, word) in STRIKER_WORDS.items():
        value = getattr(body, name, None)
        if isinstance(value, float) and value:
            text.append(f"{word} {engineering(value, unit)}")
    return " ".join(text)


def _body(body: LinearBody | None) -> str:
    """Text of a striker with its article: "A sphere of 32.9 g at 2.00 m/s"."""
    text = striker_text(body)
    return f"{'An' if text[0] in 'aeiouIE' else 'A'} {text}"


def _named(described: str) -> str:
    """The name of the mesh in a description of `Structure.describe`."""
    return re.split(r"[:,]|(?<=of \d part) \(|(?<=parts) \(", described, maxsplit=1)[0]


def _shown(hit: History, budget: ErrorBudget | None, name: str) -> str:
    """A quantity with its bar, as text."""
    return budget.shown(name, 3) if budget else engineering(getattr(hit, name), QUANTITIES[name])
