"""Data of a fall for the page of a report: the moving part, its impacts, and the headline."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from antiosc import Fall
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AntioscError
from antiosc.base.texts import capitalised, engineering, percent, plain_number, point_text
from antiosc_app.cards import bar_of_fall
from antiosc_app.headline import WIDE_BAR, stress_sentences
from antiosc_app.live import Data
from antiosc_app.live_meshes import geometry_data, surface_of_cells
from antiosc_studies.drops.fall import WorstField
from antiosc_studies.drops.impacts import total_force
from antiosc_studies.drops.pictures import state_at, surface_of

#: Number of times at which the page shows the part in one flight at most.
MAX_FLIGHT_FRAMES = 40
#: Number of times at which the page shows the part in all.
FRAME_COUNT = 300
#: Number of samples of a force.
FORCE_SAMPLE_COUNT = 800
#: Numbers of an impact, and their units.
IMPACT_UNITS = (
    ("peak_force", "N"), ("contact_time", "s"), ("impulse", "N s"), ("lost", "J"),
    ("speed_before", "m/s"), ("speed_after", "m/s"),
)  # fmt: skip


def data_of_fall(fall: Fall, worst: WorstField | None) -> Data:
    """The data of a fall for the page, the same on every rank; `worst`: stress for the colours."""
    points, faces = _fall_surface(fall)
    ends = [0.0, *(impact.time for impact in fall.impacts), fall.end.time]
    frames = max(2, min(MAX_FLIGHT_FRAMES, FRAME_COUNT // len(ends)))
    flights = [np.linspace(*ends_of_flight, frames) for ends_of_flight in pairwise(ends)]
    times = np.unique(np.concatenate(flights))
    states = [state_at(fall, time) for time in times.tolist()]
    part = geometry_data(points, faces)
    if worst is not None:
        nearest = cKDTree(worst.points - fall.body.centre).query(points)[1]
        values = worst.values / (float(worst.values.max()) or 1.0)
        part["values"] = values[nearest].astype(np.float32)
    return {
        "fall": {
            "part": part,
            "centre": fall.body.centre.tolist(),
            "time": times,
            "places": np.array([state.centre for state in states], dtype=np.float32),
            "turns": np.array([state.R for state in states], dtype=np.float32),
            "impacts": [_impact_data(fall, k, times) for k in range(len(fall.impacts))],
            "most": None if worst is None else engineering(worst.values.max(), worst.unit),
            "what": "" if worst is None else f"largest {worst.label} in all impacts",
        }
    }


def _fall_surface(fall: Fall) -> tuple[Array, IntArray]:
    """The part's surface, the same on all ranks: points (P, 3) [m] from the centre of mass, and
    triangles (T, 3).
    """
    structure = fall.body.structure
    if structure is None:
        return surface_of(fall.body)
    from antiosc.recovery import source

    try:
        nodes, cells, _ = source(structure).at_nodes(structure, np.zeros((structure.rows, 0)))
        outer = surface_of_cells(nodes, cells)
    except AntioscError:  # given matrices have no cells
        return surface_of(fall.body)
    outer = structure.comm.bcast(outer, root=0)
    used_nodes, faces = np.unique(outer.faces, return_inverse=True)
    return outer.points[used_nodes] - fall.body.centre, faces.reshape(-1, 3)


def _impact_data(fall: Fall, k: int, times: Array) -> Data:
    """The data of impact `k` for the page; `times` [s] are those of the page's frames."""
    impact = fall.impacts[k]
    body = fall.body
    touch = state_at(fall, fall.impacts[k].time)
    bar = f" ± {percent(impact.law_error)}" if impact.law_error else ""
    time, force = total_force([fall.episodes[i] for i in fall.groups[k]])
    samples = np.linspace(0.0, float(time[-1]), FORCE_SAMPLE_COUNT)
    return {
        **{name: getattr(impact, name) for name, _ in IMPACT_UNITS},
        "bar": impact.law_error or 0.0,
        "shown": [
            f"{engineering(impact.peak_force, 'N')}{bar}",
            engineering(impact.contact_time, "s"),
            f"{plain_number(fall.shocks[k].g, 3)} g",
        ],
        "time": impact.time,
        "at": point_text(impact.place),
        "point": impact.place.tolist(),
        "place": (touch.R @ (impact.place - body.centre) + touch.centre).tolist(),
        "frame": int(np.searchsorted(times, impact.time)),
        "curve": {"time": samples, "force": np.interp(samples, time, force)},
    }


def sentences_of_fall(fall: Fall, worst: WorstField | None) -> list[str]:
    """Sentences that explain the results of a fall: height, stress, contact, how it ended."""
    height = engineering(fall.setting.height, "m")
    about = f"A part of {engineering(fall.body.mass, 'kg')} falls from {height}"
    told = [about, fall.flat]
    if worst is not None and worst.exposure is not None:
        told += stress_sentences({worst.quantity: worst}, bar_of_fall(fall, worst))

    told += [fall.contact_verdict, *fall.notes, f"the fall ended: {fall.message}"]
    return [f"{capitalised(one.rstrip('.'))}." for one in dict.fromkeys(told) if one]


def caution_of_fall(fall: Fall) -> str:
    """Sentence if the force of the hardest impact has no error bar or a wide one; else ""."""
    if fall.hardest is None:
        return ""
    if reason := fall.no_bar(fall.hardest):
        return f"There is no error bar: {reason}."

    bar = fall.impacts[fall.hardest].law_error or 0.0
    return f"The force is a rough one, ± {percent(bar)}." if bar >= WIDE_BAR else ""
