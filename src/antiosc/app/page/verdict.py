"""The first screen of a report: what struck what, how hard, and whether it holds."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc.app.page.assets import Data
from antiosc.base.engineering import engineering, percent, place, with_bar
from antiosc.models.body import LinearBody, places_of
from antiosc.simulation.histories import History
from antiosc.simulation.histories.parts import QUANTITIES, ErrorBar
from antiosc.studies.map_results import ImpactMap, hardest

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure
    from antiosc.results.peaks import PeakField

#: The cause of the largest share of a bar -> what reduces it.
REMEDIES = {
    "mesh": "use smaller elements around the site",
    "truncation": "extract more anti-oscillators (n)",
    "time": "use a smaller tol",
    "patch": "choose another radius of the patch",
    "geometry": "use smaller or curved elements along the curved surface",
    "noise": "measure with less noise, or average more blows",
    "band": "measure up to a higher frequency",
    "model": "use solid elements in place of beams or shells",
}
#: What is told of a striker, with its unit, and the word before it.
STRIKERS = {"mass": ("kg", "of"), "velocity": ("m/s", "at")}


class Headline(NamedTuple):
    """What struck what, its numbers (name, value with bar), and sentences of the verdict."""

    about: str
    numbers: list[tuple[str, str]]
    sentences: list[str]


def of_history(
    hit: History,
    structure: Structure | None,
    budget: Mapping[str, ErrorBar],
    fields: Mapping[str, PeakField],
    worst: Data | None,
) -> Headline:
    """The headline of an impact of two bodies.

    `fields`: its `PeakField`s by quantity; `worst`: the largest stress of the picture, if known.
    """
    known = {name: bar.total for name, bar in budget.items()}
    numbers = [
        (name.replace("_", " "), with_bar(getattr(hit, name), unit, known.get(name)))
        for name, unit in QUANTITIES.items()
    ]
    e = hit.restitution
    numbers.append(("restitution", "not defined" if e is None else f"{e:.3f}"))
    sentences = [*_stresses(fields, worst), _absorbed(hit), _accuracy(budget)]
    return Headline(_struck(hit, structure), numbers, [s for s in sentences if s])


def of_map(found: ImpactMap) -> Headline:
    """The headline of a map."""
    numbers = [("sites", f"{len(found)}")]
    sentences = []
    if found.peak_force is not None and found.contact_time is not None:
        worst_site = hardest(found)
        low, high = float(np.nanmin(found.peak_force)), float(found.peak_force[worst_site])
        numbers.append(("peak force", f"{engineering(low, 'N')} to {engineering(high, 'N')}"))
        times = (engineering(float(end(found.contact_time)), "s") for end in (np.nanmin, np.nanmax))
        numbers.append(("contact time", " to ".join(times)))
        where = place(found.points[worst_site])
        sentences.append(f"The largest force, {engineering(high, 'N')}, arises at {where}.")
        if found.doubtful.any():
            sentences.append(f"{found.doubtful.sum()} doubtful sites are left out of it.")
    if found.peak_stress is not None:
        sentences.append(_most_dangerous(found))
    worst = float(found.error.max())
    sentences.append(
        f"The free modes leave an error of Z of at most {percent(worst)} up to"
        f" {engineering(found.band / (2 * np.pi), 'Hz')}; the mesh's error is not estimated."
    )
    about = f"{_body(found.impactor)} strikes {_named(found.info.get('structure', 'a part'))}."
    return Headline(about if found.impactor else "Models over a surface", numbers, sentences)


def _most_dangerous(found: ImpactMap) -> str:
    """Where a blow stresses the part most, and whether it yields."""
    assert found.peak_stress is not None
    assert found.stress_points is not None
    share = found.exposure
    i = hardest(found, of=found.peak_stress if share is None else share)
    told = (
        f"A blow at {place(found.points[i])} stresses the part most:"
        f" {engineering(found.peak_stress[i], 'Pa')} at {place(found.stress_points[i])}"
    )
    if share is None:
        return f"{told}; the material has no yield_strength to compare it with."
    count = int(np.sum(share >= 1))
    where = f"at {count} of {len(found)} sites" if count else "nowhere"
    return f"{told}, {share[i]:.3g} of the yield strength; yield is reached {where}."


def _struck(hit: History, structure: Structure | None) -> str:
    part = "a model" if structure is None else _named(structure.describe())
    places = list(places_of(hit.model).values())
    where = f" at {place(places[0])}" if len(places) == 1 else ""
    return f"{_body(hit.impactor)} strikes {part}{where}."


def _body(body: LinearBody | None) -> str:
    """A striker in words: "A sphere of 32.9 g at 2.00 m/s"."""
    kind = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(body).__name__).lower()
    told = [f"{'An' if kind[0] in 'aeiou' else 'A'} {kind}"]
    for name, (unit, word) in STRIKERS.items():
        value = getattr(body, name, None)
        if isinstance(value, float) and value:
            told.append(f"{word} {engineering(value, unit)}")
    return " ".join(told)


def _named(described: str) -> str:
    """What `Structure.describe` begins with: the name of the mesh, without its numbers."""
    return re.split("[:,]", described, maxsplit=1)[0]


def _stresses(fields: Mapping[str, PeakField], worst: Data | None) -> list[str]:
    """Whether strengths are reached, and where; else the largest stress of the picture."""
    told = []
    for peak in fields.values():
        if peak.exposure is not None:
            sentence = peak.margin().sentence
            told.append(f"{sentence[0].upper()}{sentence[1:]}.")
        if peak.doubt:
            told.append(f"{peak.doubt[0].upper()}{peak.doubt[1:].rstrip('.')}.")
    if not fields and worst is not None:
        value, time = engineering(worst["value"], "Pa"), engineering(worst["time"], "s")
        told.append(
            f"The largest von Mises stress is about {value} at {place(worst['place'])}, {time};"
            " the material has no yield_strength to compare it with."
        )
    return told


def _absorbed(hit: History) -> str:
    """Which share of the striker's energy stays."""
    if len(hit.bodies) != 2 or not hit.contacts:
        return ""
    striker = list(hit.bodies.values())[1]
    before, after = (float(striker.kinetic[k] + striker.strain[k]) for k in (0, -1))
    if before <= 0 or after > before:
        return ""
    return (
        f"Of the striker's {engineering(before, 'J')}, {percent(1 - after / before)} stay in the"
        " part and the contact."
    )


def _accuracy(budget: Mapping[str, ErrorBar]) -> str:
    """What limits the accuracy, and what to do."""
    if not budget:
        return (
            "There is no error bar, for the mesh's error is not estimated:"
            ' error="estimate" of extract gives one.'
        )
    bar = budget["peak_force"]
    cause = max(budget.causes, key=lambda name: getattr(bar, name))  # type: ignore[attr-defined]
    return (
        f"The largest part of the bar of the peak force comes from the {cause},"
        f" {percent(getattr(bar, cause))}: to narrow it, {REMEDIES[cause]}."
    )
