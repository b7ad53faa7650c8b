"""What the live page turns: the struck part and its fields, and the sites of a map.

The displacement of a point is linear in the modal displacements and the force of the contact; so is
its stress. Of each the page gets a few fields with what they multiply: the principal fields of the
run, as many as it needs. Of a map it gets the free modes of every site, one after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from antiosc import History, ImpactMap, Structure
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.stresses import equivalent
from antiosc.engine.contact.base import is_compiled
from antiosc.extension import (
    MAP_QUANTITIES,
    NodeTensors,
    hardest,
    outer_faces,
    shapes_of,
    sides,
    source,
    tensors_at_nodes,
)
from antiosc.io.facets import oriented
from antiosc.models.body import checked_body
from antiosc_app.live import Data, finite_parameters, impact_data, modal_data

#: Most fields of the motion and of the stress, and what they may miss of the largest value.
MOST_FIELDS, FIELD_ERROR = (12, 8), 0.01
#: Times of the run by which fields are chosen.
TIMES = 120
#: A point whose displacement is this share of the largest one in all shapes is held.
HELD_RATIO = 1e-12
#: Whole numbers of coordinates and fields.
STEPS = 32767
#: Half the width of a beam without outline on the page, over the size of the part.
BEAM = 0.012


def of_structure(structure: Structure, hit: History) -> Data | None:
    """Surface and fields for the page, the same on all ranks; None of a part without a surface."""
    try:
        shapes = shapes_of(structure, hit, "structure")
        points, cells, moved = source(structure).at_nodes(structure, shapes)
        skin = surface(points, cells)
        stress = _stress(structure, hit, shapes)
    except AntioscError:  # without shapes, elements or outline there is nothing to turn
        return None
    skin, moved, stress = structure.comm.bcast((skin, moved, stress), root=0)
    used, faces = np.unique(skin.faces, return_inverse=True)
    node = skin.node[used]
    faces, moved = faces.reshape(-1, 3), moved[node]
    times = np.linspace(0.0, float(hit.run.time[-1]), TIMES)
    x = _coordinates(hit, times)
    to_shapes = _by_coordinates(hit)
    page = geometry(skin.points[used], faces)
    page["held"] = _held(moved).astype(np.uint8)
    page["motion"] = fields(
        moved @ to_shapes, x, MOST_FIELDS[0], lambda u: np.linalg.norm(u, axis=1)
    )
    if stress is not None:
        own = [each[node] @ to_shapes for each in stress]
        page["stress"] = [fields(each, x, MOST_FIELDS[1], _equivalent) for each in own]
        page["worst"] = _worst(own, x, skin.points[used], times)
    return page


def geometry(points: Array, faces: IntArray) -> Data:
    """Points in whole numbers: those of the box about `middle` with the half side `half` [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, float((high - low).max() / 2) or 1.0
    return {
        "points": np.round((points - middle) / half * STEPS).astype(np.int16),
        "faces": faces.astype(np.uint32),
        "middle": middle.tolist(),
        "half": half,
    }


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of a structure on the page.

    points (P, 3), faces (T, 3); `node` (P,) the node of the mesh to which each point belongs.
    """

    points: Array
    faces: IntArray
    node: IntArray


def surface(points: Array, cells: Sequence[tuple[str, IntArray]]) -> Surface:
    """Outer faces of cells at points (N, 3) as triangles; lines as bars. InputError for neither.

    Triangles go around alike, those of solids as seen from outside.
    """
    found: list[tuple[Array, IntArray]] = [(points, np.arange(len(points)))]
    faces: list[IntArray] = []
    for block in cells:
        own = outer_faces([block])
        if own.shape[1] == 2:
            start = sum(len(node) for _, node in found)
            corners, own, node = _bars(points, own)
            found.append((corners, node))
            own = own + start
        elif own.shape[1] == 4:
            own = np.vstack([own[:, [0, 1, 2]], own[:, [0, 2, 3]]])
        if own.shape[1] == 3 and len(own):
            places = np.concatenate([x for x, _ in found])
            faces.append(oriented(places, own)[0])
    if not faces:
        raise InputError("nodes alone have no surface.")
    places, nodes = (np.concatenate(each) for each in zip(*found, strict=True))
    return Surface(places, np.vstack(faces), nodes)


def _bars(points: Array, lines: IntArray) -> tuple[Array, IntArray, IntArray]:
    """Lines as square bars, four points at both ends of each: points, triangles, nodes."""
    along = points[lines[:, 1]] - points[lines[:, 0]]
    aside = np.cross(along, np.where(np.abs(along).argmin(axis=1)[:, None] == np.arange(3), 1, 0))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    third = np.cross(along, aside) / np.linalg.norm(along, axis=1, keepdims=True)
    width = BEAM * float(np.ptp(points, axis=0).max())
    corners = width * np.stack(
        [aside + third, third - aside, -aside - third, aside - third], axis=1
    )
    ends = [points[lines[:, k]][:, None] + corners for k in (0, 1)]
    own = np.arange(8 * len(lines)).reshape(len(lines), 2, 4)
    faces = []
    for k in range(4):
        a, b, c, d = own[:, 0, k], own[:, 0, (k + 1) % 4], own[:, 1, (k + 1) % 4], own[:, 1, k]
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    node = np.repeat(lines.ravel(), 4)
    return np.stack(ends, axis=1).reshape(-1, 3), np.vstack(faces), node


def _stress(structure: Structure, hit: History, shapes: Array) -> list[Array] | None:
    """Stresses (N, 6, columns) at all nodes on rank 0; None: unknown.

    Of sheets on both sides, of beams at each point of the outlines.
    """
    found = []
    for side in sides(structure):
        try:
            points, _, tensors = tensors_at_nodes(
                structure, hit, "structure", shapes, "stress", [side]
            )
        except InputError:  # a beam, whose section has no outline
            return None
        if structure.comm.rank == 0:
            found += _averages(tensors, len(points))
    return found


def _averages(tensors: NodeTensors, n: int) -> list[Array]:
    """Mean tensors (N, 6, columns) at each of N nodes, for each place of them."""
    found = []
    for place in dict.fromkeys(origin.place for origin in tensors.origins):
        here = [k for k, origin in enumerate(tensors.origins) if origin.place == place]
        own = np.isin(tensors.origin, here)
        total, count = np.zeros((n, *tensors.columns.shape[1:])), np.zeros(n)
        np.add.at(total, tensors.nodes[own], tensors.columns[own])
        np.add.at(count, tensors.nodes[own], 1.0)
        found.append(total / np.maximum(count, 1.0)[:, None, None])
    return found


def _coordinates(hit: History, times: Array) -> Array:
    """Modal displacements of the structure and the force of the contact (n, J + 1).

    Of a part that stretches the amplitudes of pairs of its modes follow.
    """
    q, _ = hit.states(times)
    q = q[:, hit.assembly.spans["structure"]]
    forces = hit.assembly.stretched.get("structure")
    pairs = [] if forces is None else [forces.pairs(q @ forces.modes)]
    return np.column_stack([q, hit.force_at(times), *pairs])


def _by_coordinates(hit: History) -> Array:
    """Factors (B, J + 1) of the shapes by modal displacements and force, and those of pairs."""
    _, own = hit.of("structure")
    size = own.omega.size
    q, force = np.eye(size + 1)[:, :size], np.eye(size + 1)[:, size]
    factors = np.asarray(own.amplitudes(own.coordinates(q, force))).T
    forces = hit.assembly.stretched.get("structure")
    count = 0 if forces is None else forces.size * (forces.size + 1) // 2
    return block_diag(factors, np.eye(count))


def _held(moved: Array) -> BoolArray:
    """Points (P,) with a component that no shape moves, though it moves elsewhere."""
    reach = np.abs(moved).max(axis=2, initial=0.0)
    moves = reach.max(axis=0) > 0
    return (reach[:, moves] <= HELD_RATIO * reach.max()).any(axis=1)


def fields(linear: Array, x: Array, most: int, size: Callable[[Array], Array]) -> Data:
    """Principal fields of `linear` (P, c, J + 1) over a run x (n, J + 1), in whole numbers.

    `fields` (K, P, c) times `scale` (K,) times `factors` (K, J + 1) times x is the field; `largest`
    is the largest `size` in the run. The coordinates are weighted by their largest values, so that
    fields also serve runs with other amplitudes.
    """
    points, components, count = linear.shape
    weights = np.abs(x).max(axis=0)
    weights[weights == 0] = 1e-12 * (weights.max() or 1.0)
    flat = linear.reshape(-1, count) * weights
    turned, own = (x / weights).T, np.linalg.eigh(flat.T @ flat)[1][:, ::-1]
    exact = flat @ turned
    largest = float(size(exact.reshape(points, components, -1)).max(initial=0.0))
    kept = min(most, count)
    for k in range(1, kept + 1):
        error = exact - flat @ own[:, :k] @ (own[:, :k].T @ turned)
        if np.abs(error).max(initial=0.0) <= FIELD_ERROR * np.abs(exact).max(initial=0.0):
            kept = k
            break
    basis = (flat @ own[:, :kept]).T
    scale = np.abs(basis).max(axis=1)
    scale[scale == 0] = 1.0
    return {
        "fields": np.round(basis / scale[:, None] * STEPS).astype(np.int16).ravel(),
        "scale": scale / STEPS,
        "factors": (own[:, :kept] / weights[:, None]).T.ravel(),
        "largest": largest,
    }


def _equivalent(stress: Array) -> Array:
    return equivalent(np.moveaxis(stress, 1, -1))


def _worst(stress: list[Array], x: Array, points: Array, times: Array) -> Data:
    """The largest von Mises stress at the times: value [Pa], place [m], time [s]."""
    values = np.max([_equivalent(each @ x.T) for each in stress], axis=0)
    i, k = np.unravel_index(int(values.argmax()), values.shape)
    return {
        "value": float(values[i, k]),
        "place": points[i].tolist(),
        "time": float(times[k]),
    }


#: Most sites with models on a page.
MOST_SITES = 5000
#: Area of the part over that of the map from which the part is drawn behind it.
LARGER_AREA = 1.02
#: Quantities of a map that the page shows: first those that it strikes anew.
SHOWN = ("peak_force", "contact_time", "peak_deflection", "peak_stress", "exposure", "k0")
COMPUTED = ("peak_deflection", "peak_stress", "exposure")


def sites_of_map(found: ImpactMap, structure: Structure | None = None) -> tuple[Data, Data] | None:
    """Blow and sites for the page, on every rank; None for a map that it cannot strike anew.

    `structure` gives the surface behind sites that are points by themselves.
    """
    impactor, law, duration = found.impactor, found.contact, found.duration
    if impactor is None or law is None or duration is None or not is_compiled(law):
        return None
    if found.stretched is not None and found.stretched.any():
        return None
    if found.laws is not None and any(type(one) is not type(law) for one in found.laws):
        return None
    striker = checked_body("impactor", impactor)
    speed = striker.velocity
    if len(found) > MOST_SITES or found.peak_force is None or not isinstance(speed, float):
        return None
    form = striker.modal()
    start = form.rigid_motion(-speed)
    one = impact_data(law, modal_data(form, start), impactor, abs(speed))
    forms = [found.model(i).modal() for i in range(len(found))]
    local = found.local_compliance + striker.local_compliance
    if law.compliance > 0:
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
        "doubtful": found.doubtful.tolist(),
        "names": {
            name: MAP_QUANTITIES[name][0] + " (computed case)" * (name in COMPUTED)
            for name in quantities
        },
        "units": {name: MAP_QUANTITIES[name][1] for name in quantities},
        "quantities": quantities | every,
    }
    if found.laws is not None:
        rows = [finite_parameters(each) for each in found.laws]
        sites["laws"] = {
            "kind": one["law"]["kind"],
            "size": len(rows[0]),
            "params": np.array(rows).ravel(),
        }
    if structure is not None:
        sites["skin"] = _skin(structure, _area(found.points, sites["faces"].reshape(-1, 3)))
    return {**one, "ratio": 0.0, "gap": striker.gap, "duration": duration, "bars": None}, sites


def _skin(structure: Structure, mapped: float) -> Data | None:
    """The surface of a part, the same on all ranks; None where there is none behind the map's."""
    try:
        points, cells, _ = source(structure).at_nodes(structure, np.zeros((structure.rows, 0)))
        skin: Surface = structure.comm.bcast(surface(points, cells), root=0)
    except InputError:
        return None
    if _area(skin.points, skin.faces) < LARGER_AREA * mapped:
        return None
    used, faces = np.unique(skin.faces, return_inverse=True)
    return geometry(skin.points[used], faces.reshape(-1, 3))


def _area(points: Array, faces: IntArray) -> float:
    """Area [m^2] of triangles (T, 3)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
