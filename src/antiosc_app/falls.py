"""A fall on the page of a report: the moving part, its impacts, and the headline."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from antiosc import Fall
from antiosc.base._types import Array, IntArray
from antiosc.base.cfc import SHOCK_FILTER
from antiosc.base.errors import AntioscError
from antiosc.base.texts import capitalised, engineering, percent, plain, point_text
from antiosc_app.fall_caution import caution_of_fall, law_bar
from antiosc_app.live import (
    Data,
    Headline,
    bar_of_fall,
    stress_sentences,
    stresses_of_impacts,
)
from antiosc_app.live_meshes import geometry, surface
from antiosc_app.results import how_it_ended
from antiosc_studies.drops.fall import WorstField
from antiosc_studies.drops.pictures import at, surface_of
from antiosc_studies.drops.impacts import force_of

#: Number of times at which the page shows the part in one flight at most.
OF_FLIGHT = 40
#: Number of times at which the page shows the part in all.
FRAMES = 300
#: Quantile of the values that ends the colours where the largest exceeds it so many times; part.js.
USUAL, SPIKE = 0.995, 1.5
#: Number of samples of a force.
CURVE = 800
#: Numbers of an impact, and their units.
NUMBERS = (
    ("peak_force", "N"), ("contact_time", "s"), ("impulse", "N s"), ("lost", "J"),
    ("speed_before", "m/s"), ("speed_after", "m/s"),
)  # fmt: skip


def data_of_fall(fall: Fall, worst: WorstField | None) -> Data:
    """The page's data of a fall, the same on every rank; `worst` colours the part."""
    points, faces = _surface(fall)
    ends = [0.0, *(impact.time for impact in fall.impacts), fall.end.time]
    frames = max(2, min(OF_FLIGHT, FRAMES // len(ends)))
    flights = [np.linspace(*ends_of_flight, frames) for ends_of_flight in pairwise(ends)]
    times = np.unique(np.concatenate(flights))
    states = [at(fall, time) for time in times.tolist()]
    part = geometry(points, faces)
    if worst is not None:
        nearest = cKDTree(worst.points - fall.body.centre).query(points)[1]
        part["values"] = np.minimum(worst.values / (_top(fall, worst) or 1.0), 1.0)[nearest]
        part["values"] = part["values"].astype(np.float32)
    return {
        "fall": {
            "part": part,
            "centre": fall.body.centre.tolist(),
            "time": times,
            "places": np.array([state.centre for state in states], dtype=np.float32),
            "turns": np.array([state.R for state in states], dtype=np.float32),
            "impacts": [_impact(fall, k, times) for k in range(len(fall.impacts))],
            "stresses": [one._asdict() for one in stresses_of_impacts(fall, worst)],
            "stressed": None if worst is None else _stressed(worst),
            "most": None if worst is None else _legend(fall, worst),
            "what": "" if worst is None else f"largest {worst.label} in all impacts",
        }
    }


def _stressed(worst: WorstField) -> list[float]:
    """Coordinates of the largest stress, around which *Finer mesh here* refines too."""
    return [float(x) for x in worst.points[worst.judged]]


def _top(fall: Fall, worst: WorstField) -> float:
    """The end of the scale of colours: the largest value, or what it exceeds at few points."""
    largest = _largest(fall, worst)
    usual = float(np.quantile(worst.values, USUAL))
    return usual if 0 < SPIKE * usual < largest else largest


def _largest(fall: Fall, worst: WorstField) -> float:
    """The largest value, with those of the impacts where these are stresses too."""
    stresses = stresses_of_impacts(fall, worst) if worst.unit == "Pa" else []
    return float(max([worst.values.max(), *(one.stress for one in stresses)]))


def _legend(fall: Fall, worst: WorstField) -> str:
    """Text at the end of the scale of colours."""
    top, largest = (engineering(end(fall, worst), worst.unit) for end in (_top, _largest))
    return top if top == largest else f"{top} and more, up to {largest}"


def _surface(fall: Fall) -> tuple[Array, IntArray]:
    """Points (P, 3) relative to the centre of mass and triangles (T, 3), the same on all ranks."""
    structure = fall.body.structure
    if structure is None:
        return surface_of(fall)
    from antiosc.extension import source  # a rigid body does without meshes

    try:
        nodes, cells, _ = source(structure).at_nodes(structure, np.zeros((structure.rows, 0)))
        outer = surface(nodes, cells)
    except AntioscError:  # given matrices have no cells
        return surface_of(fall)
    outer = structure.comm.bcast(outer, root=0)
    used_nodes, faces = np.unique(outer.faces, return_inverse=True)
    return outer.points[used_nodes] - fall.body.centre, faces.reshape(-1, 3)


def _impact(fall: Fall, k: int, times: Array) -> Data:
    """The page's data of an impact: its numbers, its place above the floor, its force over time."""
    impact = fall.impacts[k]
    body = fall.body
    touch = at(fall, fall.impacts[k].time)
    time, force = force_of([fall.episodes[i] for i in fall.groups[k]])
    samples = np.linspace(0.0, float(time[-1]), CURVE)
    return {
        **{name: getattr(impact, name) for name, _ in NUMBERS},
        "bar": law_bar(impact),
        "told": _done_to_part(fall, k),
        "touches": impact.touches,
        "contact_time_note": impact.contact_time_note,
        "time": impact.time,
        "at": point_text(impact.place),
        "point": impact.place.tolist(),
        "place": (touch.R @ (impact.place - body.centre) + touch.centre).tolist(),
        "frame": int(np.searchsorted(times, impact.time)),
        "curve": {"time": samples, "force": np.interp(samples, time, force)},
    }


def _done_to_part(fall: Fall, k: int) -> str:
    """The dent of an impact, if there is one that is known, and the shock of the part."""
    depth = float(fall.dents[k])
    dent = "" if np.isnan(depth) else f"a dent of {engineering(depth, 'm')}"
    shock = f"the centre of mass has {plain(fall.shocks[k].g, 3)} g through {SHOCK_FILTER}"
    return "; ".join(filter(None, (dent, shock)))


def headline_of_fall(fall: Fall, worst: WorstField | None) -> Headline:
    """The headline of a fall: the part, the strongest impact, and whether the part survives."""
    height = engineering(fall.setting.height, "m")
    about = f"{part_text(fall)} falls from {height} onto {floor_text(fall)}."
    impacts = fall.impacts
    hardest = fall.hardest
    if hardest is None:
        return Headline(about, [("impacts", "none")], [f"{fall.message}."])
    strongest = impacts[hardest]
    numbers = [("impacts", f"{len(impacts)}"), ("hardest", f"impact {hardest + 1}")]
    values = [engineering(getattr(strongest, name), unit) for name, unit in NUMBERS[:3]]
    if bar := law_bar(strongest):
        values[0] += f" ± {percent(bar)}"
    if note := strongest.contact_time_note:
        values[1] += f" {note}"
    labels = "peak force", "contact time", "impulse"
    numbers += zip(labels, values, strict=True)
    numbers.append(("lost in all", engineering(float(impacts.column("lost").sum()), "J")))
    caution = caution_of_fall(fall)
    sentences = [*_verdict(fall, worst, hardest), how_it_ended(fall.message)]
    return Headline(about, numbers, sentences, caution=caution)


def _verdict(fall: Fall, worst: WorstField | None, hardest: int) -> list[str]:
    """Sentences on yielding of part and contacts, and on the limits of the accuracy."""
    sentences = [contact := fall.contact_verdict]
    if worst is not None and worst.exposure is not None:
        sentences += stress_sentences({worst.quantity: worst}, bar_of_fall(fall, worst))
        sentences += [fall.stress_limits, _other_order(fall, worst)]
    sentences += (note for note in fall.notes[::-1] if note != contact)  # what was assumed
    if fall.missed:
        sentences.append(
            f"in {fall.missed} of {len(fall.episodes)} contacts the forces did not reach tol"
        )
    plain = (sentence.rstrip(".") for sentence in sentences if sentence)
    return [f"{capitalised(sentence)}." for sentence in plain]


def _other_order(fall: Fall, worst: WorstField) -> str:
    """Sentence on an impact with a larger stress than one with a larger force; "" if none has."""
    forces = fall.impacts.column("peak_force")
    stresses = [one.stress for one in stresses_of_impacts(fall, worst)]
    if not stresses or np.array_equal(np.argsort(forces), np.argsort(stresses)):
        return ""
    return (
        "the stresses of the impacts are not in the order of their forces: each strikes at another "
        "place, and what is left out around its contact has another size"
    )


def part_text(fall: Fall) -> str:
    """Text of the part: "A part of 120 g"."""
    return f"A part of {engineering(fall.body.mass, 'kg')}"


def floor_text(fall: Fall) -> str:
    """Text of the floor."""
    floor = fall.setting.floor
    if floor.layer is not None:
        return f"a soft layer of {engineering(floor.layer.thickness, 'm')}"
    if isinstance(floor.material, str):
        return f"a floor of {floor.material}"
    return "a rigid floor" if floor.rigid else "an elastic floor"
