"""A map as the page strikes it: the free modes of every site, one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from antiosc.app.page import blow
from antiosc.app.page.assets import Data
from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.contact import Hertz
from antiosc.contact.base import is_compiled
from antiosc.models.body import checked_body
from antiosc.studies.map_results import ImpactMap, hardest

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure

#: Most sites with models on a page.
MOST = 5000
#: Area of the part over that of the map from which the part is drawn behind it.
BEHIND = 1.02
#: Quantities of a map that the page shows: what it strikes anew first.
SHOWN = {
    "peak_force": ("peak force", "N"),
    "contact_time": ("contact time", "s"),
    "peak_deflection": ("peak deflection (computed case)", "m"),
    "peak_stress": ("largest stress (computed case)", "Pa"),
    "exposure": ("danger: stress over yield (computed case)", ""),
    "k0": ("static stiffness", "N/m"),
}


def of_map(found: ImpactMap, structure: Structure | None = None) -> tuple[Data, Data] | None:
    """Blow and sites for the page, on every rank; None for a map that it cannot strike anew.

    `structure` gives the surface behind sites that are points by themselves.
    """
    impactor, law, duration = found.impactor, found.contact, found.duration
    if impactor is None or law is None or duration is None or not is_compiled(law):
        return None
    striker = checked_body("impactor", impactor)
    speed = striker.velocity
    if len(found) > MOST or found.peak_force is None or not isinstance(speed, float):
        return None
    form = striker.modal()
    start = form.rigid_motion(-speed)
    one = blow.given(law, blow.modal(form, start), impactor, abs(speed))
    forms = [found.model(i).modal() for i in range(len(found))]
    local = found.local_compliance + striker.local_compliance
    if not isinstance(law, Hertz):
        local = np.zeros(len(found))
    elif law.compliance > 0:
        local = np.full(len(found), law.compliance)
    quantities = {name: found.quantities()[name] for name in SHOWN if name in found.quantities()}
    every = {n: v for n, v in found.quantities().items() if n in ("impulse", "restitution")}
    sites = {
        "start": np.cumsum([0, *(form.omega.size for form in forms)]).astype(np.uint32),
        "omega": np.concatenate([form.omega for form in forms]),
        "b": np.concatenate([form.b for form in forms]),
        "r": np.array([form.r for form in forms]),
        "mobility": np.array([form.mobility for form in forms]),
        "local": local,
        "points": found.points.astype(np.float32).ravel(),
        "directions": found.directions.astype(np.float32).ravel(),
        "faces": (found.elements if found.elements.shape[1] == 3 else np.zeros((0, 3)))
        .astype(np.uint32)
        .ravel(),
        "alone": (found.alone if found.elements.shape[1] == 3 else np.arange(len(found))).tolist(),
        "first": hardest(found),
        "names": {name: SHOWN[name][0] for name in quantities},
        "units": {name: SHOWN[name][1] for name in quantities},
        "quantities": quantities | every,
    }
    if structure is not None:
        sites["skin"] = _skin(structure, _area(found.points, sites["faces"].reshape(-1, 3)))
    return {**one, "ratio": 0.0, "gap": striker.gap, "duration": duration, "bars": None}, sites


def _skin(structure: Structure, mapped: float) -> Data | None:
    """The surface of a part, the same on all ranks; None where there is none behind the map's."""
    from antiosc.app.page import body

    try:
        points, faces, _ = body.surface(structure, np.zeros((structure.rows, 0)))
    except InputError:
        return None
    points, faces = structure.comm.bcast((points, faces), root=0)
    if _area(points, faces) < BEHIND * mapped:
        return None
    used, faces = np.unique(faces, return_inverse=True)
    return body.geometry(points[used], faces.reshape(-1, 3))


def _area(points: Array, faces: IntArray) -> float:
    """Area [m^2] of triangles (T, 3)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
