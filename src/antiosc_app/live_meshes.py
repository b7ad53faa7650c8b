"""The 3-D data of the live page: the struck part and its fields, and the sites of a map.

Displacement and stress of a point are linear in the modal displacements and the contact force. The
page gets the principal fields of the run, as many as needed, with the factors that multiply them.
For a map it gets the free modes of all sites.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from antiosc import History, ImpactMap, Structure
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.stresses import von_mises_of_components
from antiosc.engine.contact.base import is_compiled
from antiosc.fields.fields import outer_faces, shapes_of, tensors_at_nodes
from antiosc.fields.pictures import MAP_QUANTITIES
from antiosc.io.facets import oriented
from antiosc.models.body import checked_body
from antiosc.recovery import source
from antiosc.recovery.place import NodeTensors
from antiosc.strikes.map_results import hardest
from antiosc.strikes.map_stresses import sides
from antiosc_app.live import Data, finite_parameters, impact_data, modal_data

#: Largest number of fields of the motion and of the stress.
MAX_FIELD_COUNTS = (12, 8)
#: Error of these fields over the largest value.
FIELD_ERROR = 0.01
#: Number of times of the run from which the fields are chosen.
SAMPLE_COUNT = 120
#: A point is held if its displacement is below this share of the largest in all shapes.
HELD_DISPLACEMENT_RATIO = 1e-12
#: Largest integer of coordinates and fields.
MAX_INTEGER = 32767
#: Half-width of a drawn beam over the size of the part.
BEAM_HALF_WIDTH = 0.012


def part_data(structure: Structure, hit: History) -> Data | None:
    """The struck part for the page, with motion and stress, the same on all ranks.

    None for a part without a surface, or a model without shapes.
    """
    try:
        shapes = shapes_of(structure, hit, "structure")
        points, cells, displacements = source(structure).at_nodes(structure, shapes)
        skin = surface_of_cells(points, cells)
        stress = _stress_columns(structure, hit, shapes)
    except AntioscError:  # without shapes, elements or outline there is nothing to turn
        return None
    skin, displacements, stress = structure.comm.bcast((skin, displacements, stress), root=0)
    page, used_nodes = drawn_surface(skin)
    node = skin.node[used_nodes]
    displacements = displacements[node]
    times = np.linspace(0.0, float(hit.run.time[-1]), SAMPLE_COUNT)
    x = _field_amplitudes(hit, times)
    to_shapes = _amplitudes_of_shapes(hit)
    page["held"] = _held_points(displacements).astype(np.uint8)
    motion = displacements @ to_shapes
    page["motion"] = principal_fields(
        motion, x, MAX_FIELD_COUNTS[0], lambda u: np.linalg.norm(u, axis=1)
    )
    if stress is not None:
        stress_fields = [field[node] @ to_shapes for field in stress]
        page["stress"] = [
            principal_fields(field, x, MAX_FIELD_COUNTS[1], _von_mises) for field in stress_fields
        ]
    return page


def geometry_data(points: Array, faces: IntArray) -> Data:
    """Points (P, 3) [m] and faces for the page.

    Coordinates are `middle` + `half` * integer / MAX_INTEGER [m].
    """
    low = points.min(axis=0)
    high = points.max(axis=0)
    middle = (low + high) / 2
    half = float((high - low).max() / 2) or 1.0
    return {
        "points": np.round((points - middle) / half * MAX_INTEGER).astype(np.int16),
        "faces": faces.astype(np.uint32),
        "middle": middle.tolist(),
        "half": half,
    }


class PageSurface(NamedTuple):
    """Surface of a structure: points (P, 3) [m], triangles (T, 3), mesh node (P,) of a point."""

    points: Array
    faces: IntArray
    node: IntArray


def drawn_surface(skin: PageSurface) -> tuple[Data, IntArray]:
    """(`geometry_data` of a surface without unused points, numbers of the used points)."""
    used_points, faces = np.unique(skin.faces, return_inverse=True)
    return geometry_data(skin.points[used_points], faces.reshape(-1, 3)), used_points


def surface_of_cells(points: Array, cells: Sequence[tuple[str, IntArray]]) -> PageSurface:
    """The surface of cells at points (N, 3) [m]; lines are drawn as square bars.

    `cells`: blocks (kind, nodes (n, k)).
    """
    pieces: list[tuple[Array, IntArray]] = [(points, np.arange(len(points)))]
    faces: list[IntArray] = []
    for block in cells:
        block_faces = outer_faces([block])
        if block_faces.shape[1] == 2:
            start = sum(len(node) for _, node in pieces)
            corners, block_faces, node = _square_bars(points, block_faces)
            pieces.append((corners, node))
            block_faces = block_faces + start
        elif block_faces.shape[1] == 4:
            block_faces = np.vstack([block_faces[:, [0, 1, 2]], block_faces[:, [0, 2, 3]]])
        if block_faces.shape[1] == 3 and len(block_faces):
            places = np.concatenate([x for x, _ in pieces])
            faces.append(oriented(places, block_faces)[0])
    if not faces:
        raise InputError("nodes alone have no surface.")
    places, nodes = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return PageSurface(places, np.vstack(faces), nodes)


def _square_bars(points: Array, lines: IntArray) -> tuple[Array, IntArray, IntArray]:
    """(points (8 n, 3) [m], triangles, nodes (8 n,)) of square bars along lines (n, 2)."""
    edges = points[lines[:, 1]] - points[lines[:, 0]]
    other = np.where(np.abs(edges).argmin(axis=1)[:, None] == np.arange(3), 1, 0)
    first = np.cross(edges, other)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(edges, first) / np.linalg.norm(edges, axis=1, keepdims=True)
    width = BEAM_HALF_WIDTH * float(np.ptp(points, axis=0).max())
    around = [first + second, second - first, -first - second, first - second]
    corners = width * np.stack(around, axis=1)
    ends = [points[lines[:, k]][:, None] + corners for k in (0, 1)]

    near, far = np.moveaxis(np.arange(8 * len(lines)).reshape(len(lines), 2, 4), 1, 0)
    faces = []
    for k in range(4):
        a, b, c, d = near[:, k], near[:, (k + 1) % 4], far[:, (k + 1) % 4], far[:, k]
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    node = np.repeat(lines.ravel(), 4)
    return np.stack(ends, axis=1).reshape(-1, 3), np.vstack(faces), node


def _stress_columns(structure: Structure, hit: History, shapes: Array) -> list[Array] | None:
    """Stresses (N, 6, columns) [Pa] at all nodes, for each place in the section.

    [] on ranks other than 0; None for beams whose section has no outline. `shapes`: columns of
    displacements.
    """
    stresses = []
    for side in sides(structure):
        try:
            points, _, tensors = tensors_at_nodes(
                structure, hit, "structure", shapes, "stress", [side]
            )
        except InputError:
            return None
        if structure.comm.rank == 0:
            stresses += _nodal_averages(tensors, len(points))
    return stresses


def _nodal_averages(tensors: NodeTensors, n: int) -> list[Array]:
    """Tensors (N, 6, columns) averaged over the cells at each of `n` nodes, for each place in the
    section.
    """
    means = []
    for place in dict.fromkeys(origin.place for origin in tensors.origins):
        origins = [k for k, origin in enumerate(tensors.origins) if origin.place == place]
        mask = np.isin(tensors.origin, origins)
        total = np.zeros((n, *tensors.columns.shape[1:]))
        count = np.zeros(n)
        np.add.at(total, tensors.nodes[mask], tensors.columns[mask])
        np.add.at(count, tensors.nodes[mask], 1.0)
        means.append(total / np.maximum(count, 1.0)[:, None, None])
    return means


def _field_amplitudes(hit: History, times: Array) -> Array:
    """Coordinates (n, B) at n times [s], to which displacements are linear.

    They are J modal displacements, the contact force [N] and, for second-order forces, products of
    pairs of amplitudes.
    """
    q, _ = hit.states(times)
    q = q[:, hit.assembly.stacked.spans["structure"]]
    forces = hit.assembly.stretch_forces.get("structure")
    pairs = [] if forces is None else [forces.pairs(q @ forces.modes)]
    return np.column_stack([q, hit.force_at(times), *pairs])


def _amplitudes_of_shapes(hit: History) -> Array:
    """Matrix that maps `_field_amplitudes` to amplitudes of the model's shapes."""
    _, body = hit.of("structure")
    size = body.omega.size
    q, force = np.split(np.eye(size + 1), [size], axis=1)
    factors = np.asarray(body.amplitudes(body.coordinates(q, force))).T
    forces = hit.assembly.stretch_forces.get("structure")
    count = 0 if forces is None else forces.size * (forces.size + 1) // 2
    return block_diag(factors, np.eye(count))


def _held_points(displacements: Array) -> BoolArray:
    """Mask (P,) of the points that are held.

    A component of their `displacements` (P, 3, columns) is 0 in all columns, and is not 0 at other
    points.
    """
    reach = np.abs(displacements).max(axis=2, initial=0.0)
    is_moving = reach.max(axis=0) > 0
    return (reach[:, is_moving] <= HELD_DISPLACEMENT_RATIO * reach.max()).any(axis=1)


def principal_fields(
    coordinate_fields: Array, x: Array, max_fields: int, field_size: Callable[[Array], Array]
) -> Data:
    """At most `max_fields` principal fields of coordinate_fields @ x, as integers for the page.

    `coordinate_fields` (P, c, B): field of c components at P points for unit coordinates; `x` (n,
    B): coordinates at n times. The field is `fields` (K, P, c) × `scale` (K,) × (`factors` (K, B)
    x); `largest` is its largest `field_size` in the run. Coordinates are weighted by their largest
    values, so that the fields are also accurate in runs with other amplitudes.
    """
    points, components, count = coordinate_fields.shape
    weights = np.abs(x).max(axis=0)
    weights[weights == 0] = 1e-12 * (weights.max() or 1.0)
    flat = coordinate_fields.reshape(-1, count) * weights
    scaled_x = (x / weights).T
    vectors = np.linalg.eigh(flat.T @ flat)[1][:, ::-1]
    exact = flat @ scaled_x
    largest = float(field_size(exact.reshape(points, components, -1)).max(initial=0.0))
    count_kept = min(max_fields, count)
    for k in range(1, count_kept + 1):
        error = exact - flat @ vectors[:, :k] @ (vectors[:, :k].T @ scaled_x)
        if np.abs(error).max(initial=0.0) <= FIELD_ERROR * np.abs(exact).max(initial=0.0):
            count_kept = k
            break
    basis = (flat @ vectors[:, :count_kept]).T
    scale = np.abs(basis).max(axis=1)
    scale[scale == 0] = 1.0
    return {
        "fields": np.round(basis / scale[:, None] * MAX_INTEGER).astype(np.int16).ravel(),
        "scale": scale / MAX_INTEGER,
        "factors": (vectors[:, :count_kept] / weights[:, None]).T.ravel(),
        "largest": largest,
    }


def _von_mises(stress: Array) -> Array:
    """Von Mises stress (P, columns) of stresses (P, 6, columns)."""
    return von_mises_of_components(np.moveaxis(stress, 1, -1))


#: Largest number of sites on a page.
MAX_MAP_SITES = 5000
#: The part is drawn behind a map if its area exceeds this times the map's.
MIN_AREA_RATIO = 1.02
#: Quantities of a map on the page; those that it does not recompute.
SHOWN_QUANTITIES = (
    "peak_force",
    "contact_time",
    "peak_deflection",
    "peak_stress",
    "exposure",
    "k0",
)
FIXED_QUANTITIES = ("peak_deflection", "peak_stress", "exposure")


def map_data(impact_map: ImpactMap, structure: Structure | None = None) -> tuple[Data, Data] | None:
    """(impact, sites) as data for the page, the same on every rank.

    None if the page cannot repeat the map's impacts. `structure`: the part drawn behind it.
    """
    impactor, law, duration = impact_map.impactor, impact_map.contact, impact_map.duration
    if impactor is None or law is None or duration is None or not is_compiled(law):
        return None
    if impact_map.peak_force is None or len(impact_map) > MAX_MAP_SITES:
        return None
    laws = [] if impact_map.laws is None else list(impact_map.laws)
    if any(type(blow) is not type(law) for blow in laws):
        return None
    striker = checked_body("impactor", impactor)
    if not isinstance(striker.velocity, float):
        return None

    speed, modal = striker.velocity, striker.modal()
    start = modal.rigid_motion(-speed)
    blow = impact_data(law, modal_data(modal, start), impactor, abs(speed))
    forms = [impact_map.model(i).modal() for i in range(len(impact_map))]
    local = impact_map.local_compliance + striker.local_compliance
    if law.compliance > 0:
        local = np.full(len(impact_map), law.compliance)
    elif law.without(1.0) is law:  # it is taken as given
        local = np.zeros(len(impact_map))

    known = impact_map.quantities()
    shown = [name for name in SHOWN_QUANTITIES if name in known]
    is_surface = impact_map.elements.shape[1] == 3
    faces = impact_map.elements if is_surface else np.zeros((0, 3), dtype=int)
    sites: Data = {
        "start": np.cumsum([0, *(modal.omega.size for modal in forms)]).astype(np.uint32),
        "omega": np.concatenate([modal.omega for modal in forms]),
        "b": np.concatenate([modal.b for modal in forms]),
        "r": np.array([modal.r for modal in forms]),
        "mobility": np.array([modal.inverse_mass for modal in forms]),
        "local": local,
        "points": impact_map.points.astype(np.float32).ravel(),
        "directions": impact_map.directions.astype(np.float32).ravel(),
        "faces": faces.astype(np.uint32).ravel(),
        "alone": _dotted_sites(impact_map).tolist(),
        "radii": np.zeros(0) if impact_map.radius is None else impact_map.radius,
        "first": hardest(impact_map),
        "doubtful": impact_map.doubtful.tolist(),
        "names": {
            n: MAP_QUANTITIES[n][0] + " (computed case)" * (n in FIXED_QUANTITIES) for n in shown
        },
        "units": {name: MAP_QUANTITIES[name][1] for name in shown},
        "quantities": {n: known[n] for n in (*shown, "impulse", "restitution") if n in known},
    }
    if laws:
        rows = [finite_parameters(site_law) for site_law in laws]
        params = np.array(rows).ravel()
        sites["laws"] = {"kind": blow["law"]["kind"], "size": len(rows[0]), "params": params}
    if structure is not None:
        sites["skin"] = _skin_behind_map(structure, _triangle_area(impact_map.points, faces))
    return {**blow, "ratio": 0.0, "gap": striker.gap, "duration": duration, "bars": None}, sites


def _dotted_sites(impact_map: ImpactMap) -> IntArray:
    """Numbers of the sites drawn as dots: sites that belong to no triangle of reliable sites."""
    if impact_map.elements.shape[1] != 3:
        return np.arange(len(impact_map))
    sound = ~impact_map.doubtful
    coloured = impact_map.elements[sound[impact_map.elements].all(axis=1)]
    return np.union1d(impact_map.alone, np.setdiff1d(np.flatnonzero(sound), coloured))


def _skin_behind_map(structure: Structure, map_area: float) -> Data | None:
    """The part's surface for the page, the same on all ranks.

    None without a surface, or if the map, of area `map_area` [m²], covers it.
    """
    try:
        points, cells, _ = source(structure).at_nodes(structure, np.zeros((structure.rows, 0)))
        skin: PageSurface = structure.comm.bcast(surface_of_cells(points, cells), root=0)
    except InputError:
        return None
    if _triangle_area(skin.points, skin.faces) < MIN_AREA_RATIO * map_area:
        return None
    return drawn_surface(skin)[0]


def _triangle_area(points: Array, faces: IntArray) -> float:
    """Area [m^2] of triangles (T, 3)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
