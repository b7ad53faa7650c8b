"""Fields on meshes: values at a point and at the nodes of all parts; errors of stresses.

Strains and stresses at a node of a solid are means over the cells of one material around the node;
a node between two materials has two values. In sheets and beams each cell has its own values, as
neighbouring cells may meet at a fold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import shown
from antiosc.base.errors import InputError, name_list
from antiosc.base.stresses import (
    COMPONENT_AXES,
    tensors_of_components,
    vector_length,
    von_mises_of_components,
)
from antiosc.fem.elements.weak_form import Material
from antiosc.fem.mesh.surface import kind_of_cells, volume_and_surface
from antiosc.fem.platform import compat, done_on_all
from antiosc.fem.prestress.state import initial_strain
from antiosc.fem.structure.meshed import Member, MeshedStructure, beams_alone
from antiosc.fem.structure.place import places_at
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.recovery.place import (
    NO_OUTLINE_REASON,
    NodeTensors,
    Origin,
    Place,
    Reach,
    layers_of,
    on_outlines,
    strength_of,
)
from antiosc.recovery.tensors import PointsInCells, evaluator

#: Points at which shapes are evaluated at once.
POINTS_AT_ONCE = 4096


def tensors_of_part(
    part: MeshedStructure, shapes: Array, quantity: str, place: Place, materials: Sequence[int]
) -> tuple[IntArray, IntArray, Array]:
    """(nodes (S,), materials (S,), tensors (S, 6, columns)) in cells of `materials`; collective."""
    mesh = part.mesh
    shapes = compat.with_ghosts(part.form.space, shapes)
    evaluate = evaluator(part, quantity, place)
    material = part.part_of_cells()[: compat.cell_index_map(mesh.dolfinx).size_local]
    selected = np.flatnonzero(np.isin(material, materials))
    nodes = compat.geometry_nodes(mesh.dolfinx)[selected]
    material = material[selected]
    X = mesh.geometry.reference_nodes

    solid = part.kind.name == "solid"
    if solid:  # a slot for each node and material
        keys = nodes * len(part.parts) + material[:, None]
    else:
        keys = np.arange(nodes.size).reshape(nodes.shape)

    slots, slot_of = np.unique(keys, return_inverse=True)
    slot_of = slot_of.reshape(keys.shape)
    node = slots // len(part.parts) if solid else nodes.ravel()
    kind = slots % len(part.parts) if solid else np.repeat(material, nodes.shape[1])
    total = np.zeros((len(slots), 6, shapes.shape[1]))
    count = np.zeros(len(slots))
    step = max(1, POINTS_AT_ONCE // len(X))

    def work() -> None:
        """Add the components of all cells to the sums at their nodes."""
        for first in range(0, len(selected), step):
            components = _at_nodes_of(selected[first : first + step], part, shapes, evaluate)
            slot_rows = slot_of[first : first + step].ravel()
            entries = np.ones(len(slot_rows)), (slot_rows, np.arange(len(slot_rows)))
            at_slots = csr_matrix(entries, (len(slots), len(slot_rows)))
            total[:] += (at_slots @ components.reshape(len(slot_rows), -1)).reshape(total.shape)
            count[:] += np.bincount(slot_rows, minlength=len(slots))

    done_on_all(mesh.comm, work)  # an error may be that of one rank
    if solid:
        _join_ranks(part, slots, total, count)

    return node, kind, total / count[:, None, None]


def _at_nodes_of(
    cells: IntArray,
    part: MeshedStructure,
    shapes: Array,
    evaluate: Callable[[PointsInCells], Array],
    factors: Array | None = None,
) -> Array:
    """Components (cells · nodes, 6, columns) of the tensors by `evaluate` at nodes of `cells`."""
    X = part.mesh.geometry.reference_nodes
    places = np.repeat(cells, len(X)), np.tile(X, (len(cells), 1))
    tensors = evaluate(PointsInCells(part, shapes, *places, factors))
    return np.stack([tensors[:, i, j] for i, j in COMPONENT_AXES], axis=1)


def stress_errors_of_part(part: MeshedStructure, shapes: Array, factors: Array) -> Array:
    """Estimated error (nodes,) [Pa] of von Mises stress: largest difference of a cell's stress from
    the mean at the node (Zienkiewicz and Zhu); on sheets at the worse face. A node at a fold or of
    one cell gets the largest error at other nodes of its cells. `factors` (nodes, columns): of
    `shapes`, at the time of each node's value."""
    mesh = part.mesh
    cells_of_rank = compat.cell_index_map(mesh.dolfinx).size_local
    nodes = compat.geometry_nodes(mesh.dolfinx)[:cells_of_rank]
    material = part.part_of_cells()[:cells_of_rank]
    stresses, normals = _stresses_of_cells(part, shapes, factors)
    slots, slot_of = np.unique(nodes * len(part.parts) + material[:, None], return_inverse=True)
    slot_of = slot_of.reshape(nodes.shape)
    values = np.concatenate([stresses, normals], axis=2)
    total = np.zeros((len(slots), values.shape[2], 1))
    count = np.zeros(len(slots))
    np.add.at(total, slot_of, values[..., None])
    np.add.at(count, slot_of, 1.0)
    _join_ranks(part, slots, total, count, np.add)
    means = total[..., 0] / count[:, None]
    alone = count == 1
    if normals.shape[2]:  # at folds
        spread = np.linalg.eigvalsh(tensors_of_components(means[:, stresses.shape[2] :]))
        alone |= spread[:, -1] < FOLD_EIGENVALUE
    size = von_mises_of_components if part.kind.name == "solid" else vector_length
    difference = size(stresses - means[slot_of, : stresses.shape[2]])
    elsewhere = np.where(alone[slot_of] & (count[slot_of] > 1), 0.0, difference)
    difference = np.where(alone[slot_of], elsewhere.max(axis=1, keepdims=True), difference)
    largest = np.zeros((len(slots), 1, 1))
    np.maximum.at(largest[:, 0, 0], slot_of, difference)
    _join_ranks(part, slots, largest, count, np.maximum)
    result = np.zeros(len(mesh.dolfinx.geometry.x))
    np.maximum.at(result, slots // len(part.parts), largest[:, 0, 0])
    return result


def _stresses_of_cells(part: MeshedStructure, shapes: Array, factors: Array) -> tuple[Array, Array]:
    """(stresses (C, n, 6), empty array) at the n nodes of solid cells; on sheets (larger von
    Mises stress of both faces (C, n, 1), products n_i n_j of the unit normal (C, n, 6))."""
    shapes = compat.with_ghosts(part.form.space, shapes)
    is_solid = part.kind.name == "solid"
    places = [Place()] if is_solid else [Place("top"), Place("bottom")]
    evaluates = [evaluator(part, "stress", at) for at in places]
    cells_of_rank = compat.cell_index_map(part.mesh.dolfinx).size_local
    nodes = compat.geometry_nodes(part.mesh.dolfinx)[:cells_of_rank]
    X = part.mesh.geometry.reference_nodes
    stresses = np.zeros((cells_of_rank, len(X), 6 if is_solid else 1))
    normals = np.zeros((cells_of_rank, len(X), 0 if is_solid else 6))

    step = max(1, POINTS_AT_ONCE // len(X))
    for first in range(0, cells_of_rank, step):
        cells = np.arange(first, min(cells_of_rank, first + step))
        at_points = factors[nodes[cells].ravel()]
        if is_solid:
            tensors = _at_nodes_of(cells, part, shapes, evaluates[0], at_points)
            stresses[cells] = tensors.reshape(-1, len(X), 6)
            continue

        sides = []
        for evaluate in evaluates:
            columns = _at_nodes_of(cells, part, shapes, evaluate)
            tensors = np.einsum("pck,pk->pc", columns, at_points)
            sides.append(von_mises_of_components(tensors.reshape(-1, len(X), 6)))
        stresses[cells, :, 0] = np.max(sides, axis=0)

        _, J = part.mesh.geometry.at(np.repeat(cells, len(X)), np.tile(X, (len(cells), 1)))
        normal = np.cross(J[:, :, 0], J[:, :, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        products = [normal[:, i] * normal[:, j] for i, j in COMPONENT_AXES]  # of either sign
        normals[cells] = np.stack(products, axis=1).reshape(len(cells), len(X), 6)

    return stresses, normals


#: Least eigenvalue of the mean of n nᵀ over cells around a smooth node: 0.93 of two at 30°.
FOLD_EIGENVALUE = 0.93


def _join_ranks(
    part: MeshedStructure, slots: IntArray, total: Array, count: Array, joined: np.ufunc = np.add
) -> None:
    """Add `count`, and combine `total` by `joined`, at nodes shared between ranks, in place."""
    comm = part.mesh.comm
    parts = len(part.parts)
    if comm.size == 1:
        return

    number = np.asarray(part.mesh.dolfinx.geometry.input_global_indices)
    names = number[slots // parts] * parts + slots % parts
    names_of_all = np.concatenate(comm.allgather(names))
    common, times = np.unique(names_of_all, return_counts=True)
    shared_slots = np.flatnonzero(np.isin(names, common[times > 1]))
    pieces = comm.allgather((names[shared_slots], total[shared_slots], count[shared_slots]))

    for names_there, sums, numbers in (*pieces[: comm.rank], *pieces[comm.rank + 1 :]):
        _, here, there = np.intersect1d(names, names_there, return_indices=True)
        total[here] = joined(total[here], sums[there])
        count[here] += numbers[there]


def at_point(
    structure: Structure, shapes: Array, x: Array, part: str | None, reach: Reach
) -> Array:
    """Displacements (gdim, columns) of `shapes` at the point of the structure nearest to x (3,)."""
    moved = recovered(structure, shapes, x[None], part, "displacement", Place(), reach)[0]
    forms = [member.part.form for member in with_parts(structure).members(part)]
    return np.asarray(moved[: max(len(set(form.components) & set("xyz")) for form in forms)])


def recovered(
    structure: Structure,
    shapes: Array,
    points: Array,
    part: str | None,
    quantity: str,
    place: Place,
    reach: Reach,
    second_order: bool = False,
) -> Array:
    """`quantity` (P, …, columns) of `shapes` at the structure's points nearest to `points` (P, 3);
    `second_order`: with second-order strains."""
    _refuse_relaxing(structure, quantity)
    parts = with_parts(structure).fields(shapes, part)
    if place.stiffener is not None:
        parts = _stiffeners(parts, place.stiffener)
    if second_order:
        parts = _with_second_order(parts)
    members = [member for member, _ in parts]
    (middle,) = places_at(members, points.mean(axis=0)[None])
    member, shapes_of_part = parts[members.index(middle.member)]
    closest = member.closest(points)
    farthest = int(np.argmax(closest.distance))
    reach.check_at(points[farthest], replace(middle, nearest=closest[farthest]))

    # each point on the rank that has its cell
    mesh = member.part.mesh
    evaluate = evaluator(member.part, quantity, place)
    with_ghosts = compat.with_ghosts(member.part.form.space, shapes_of_part)
    here = closest.rank == mesh.comm.rank
    cells, X = closest.cell[here], closest.X[here]
    points_here = PointsInCells(member.part, with_ghosts, cells, X)
    values_here = done_on_all(mesh.comm, lambda: evaluate(points_here))

    values = np.zeros((len(points), *values_here.shape[1:]))
    values[here] = values_here
    values = np.asarray(mesh.comm.allreduce(values))
    return values if place.local else _rotated(member.at.rotation, values, quantity)


def _refuse_relaxing(structure: Structure, quantity: str) -> None:
    """InputError for stresses and section forces if a material relaxes."""
    if quantity in ("stress", "section_forces") and relaxes(structure):
        raise InputError(
            f"the {quantity.replace('_', ' ')} of materials that relax (prony) is not computed:"
            " probe the strain, or leave prony out."
        )


def relaxes(structure: Structure) -> bool:
    """Whether a material of the structure has Maxwell branches (`prony`)."""
    terms = structure.matrices.dissipation()
    return any(term.tau is not None and term.owner is not None for term in terms)


def _stiffeners(parts: list[tuple[Member, Array]], name: str) -> list[tuple[Member, Array]]:
    """[(beams, shapes on their dofs)] of the stiffeners named `name` on all sheets of `parts`."""
    beams = [
        (replace(member, part=beams_alone(lines)), lines.rows_of(shapes_of_part))
        for member, shapes_of_part in parts
        for group, lines in member.part.stiffeners.items()
        if group == name
    ]
    if not beams:
        groups = [group for member, _ in parts for group in member.part.stiffeners]
        raise InputError(
            f"no stiffener, a Beam on edges of a sheet, has the name {shown(name)}; "
            f"{name_list(name, groups, 'its stiffeners')}."
        )

    return beams


def _rotated(R: Array, values: Array, quantity: str) -> Array:
    """Vectors or tensors rotated by R from a part's axes to the assembly's axes."""
    if (np.eye(3) == R).all() or quantity == "section_forces":
        return values
    if quantity in ("displacement", "rotation"):
        return values if values.shape[1] == 1 else np.einsum("ij,pjk->pik", R, values)
    return np.einsum("ia,pabk,jb->pijk", R, values, R, optimize=True)


def at_nodes(
    structure: Structure, shapes: Array, part: str | None = None
) -> tuple[Array, list[tuple[str, IntArray]], Array]:
    """(points (P, 3), [(meshio's cell type, cells)] by part, shapes (P, 3, columns)) on rank 0."""
    parts = with_parts(structure).fields(shapes, part)
    points, cells, values = zip(*(_gathered(*part) for part in parts), strict=True)
    starts = np.cumsum([0, *map(len, points[:-1])])
    named = [
        (kind_of_cells(member.part.mesh, of_part), of_part + start)
        for (member, _), of_part, start in zip(parts, cells, starts, strict=True)
    ]
    return np.vstack(points), named, np.concatenate(values)


def preloaded_parts(structure: Structure, part: str | None) -> list[tuple[Member, Array]]:
    """[(part with second-order strains, its static displacements under prestress)]."""
    preload = structure.matrices.preload
    assert preload is not None

    displaced = []
    for member, displacement in with_parts(structure).fields(preload.q[:, None], part):
        of_cells = {k: e for k, e in preload.initial.items() if k not in member.part.stiffeners}
        strain = initial_strain(member.part, of_cells)
        strained = replace(member.part, initial=np.array(strain.x.array))
        displaced.append((replace(member, part=strained), displacement))

    return displaced


def _with_second_order(parts: Sequence[tuple[Member, Array]]) -> list[tuple[Member, Array]]:
    """The parts with initial strains of zero, so that second-order strains are computed."""
    strained = []
    for member, shapes_of_part in parts:
        zero = np.zeros(len(member.part.part_of_cells()))
        part = replace(member.part, initial=zero)
        strained.append((replace(member, part=part), shapes_of_part))
    return strained


def tensors_at_nodes(
    structure: Structure,
    shapes: Array | None,
    quantity: str,
    places: list[Place],
    part: str | None = None,
    ply: Place | None = None,
    second_order: bool = False,
) -> tuple[Array, list[tuple[str, IntArray]], NodeTensors]:
    """(points (P, 3), cells as for `at_nodes`, tensors at the points), on rank 0.

    A point has one tensor for each material, each cell of a sheet and each of `places`. `ply` is a
    place in one layer; it replaces `places` and selects the laminates that have this layer. Without
    `shapes` there is one column, the static state under the prestress. `second_order` includes the
    second-order strain of each shape.
    """
    _refuse_relaxing(structure, quantity)

    if shapes is None:
        parts = preloaded_parts(structure, part)
    else:
        parts = with_parts(structure).fields(shapes, part)

    if second_order:
        parts = _with_second_order(parts)
    points, cells, _ = at_nodes(structure, np.zeros((structure.rows, 0)), part)
    found: list[tuple[IntArray, Array, IntArray]] = []  # nodes, columns, origins of them
    origins = list[Origin]()

    start = 0
    for member, shapes_of_part in parts:
        of_part: list[tuple[IntArray, Array, IntArray]] = []
        for place, numbers in _evaluation_places(member.part, places, ply):
            arguments = shapes_of_part, quantity, place, numbers
            nodes, kind, columns = tensors_of_part(member.part, *arguments)
            of_part.append((nodes, columns, kind + len(origins)))
            origins += [
                Origin(strength_of(material, place) if n in numbers else None, place)
                for n, (material, _) in enumerate(member.part.parts)
            ]
        node_count = len(member.part.mesh.dolfinx.geometry.x)
        pieces = member.part.mesh.comm.gather((node_count, of_part), root=0) or []
        for size, of_rank in pieces:
            found += [(nodes + start, columns, kind) for nodes, columns, kind in of_rank]
            start += size

    if not found:
        empty = np.zeros(0, dtype=int)
        return points, cells, NodeTensors(empty, np.zeros((0, 6, 0)), empty, origins)

    node, columns, origin = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    return points, cells, NodeTensors(node, columns, origin, origins)


def materials_of(
    structure: Structure, part: str | None, stiffener: str | None = None
) -> list[Material]:
    """Materials of a structure, of one `part`, or of the beams of a `stiffener`."""
    parts = with_parts(structure).fields(np.zeros((structure.rows, 0)), part)
    if stiffener is not None:
        parts = _stiffeners(parts, stiffener)
    return [material for member, _ in parts for material, _ in member.part.parts]


def _evaluation_places(
    part: MeshedStructure, places: list[Place], ply: Place | None
) -> list[tuple[Place, list[int]]]:
    """[(place, numbers of the materials)] at which the tensors of a part are evaluated."""
    numbers = list(range(len(part.parts)))
    if ply is not None:
        stacks = [len(layers_of(material)) for material, _ in part.parts]
        with_layer = [n for n in numbers if stacks[n] > (ply.layer or 0)]
        return [(ply, with_layer)] if with_layer else []
    if part.kind.name == "beam" and places[0].fibre is None:
        on_edge = on_outlines([beam.section for beam, _ in part.parts], places[0])
        if not on_edge:
            raise InputError(f"{NO_OUTLINE_REASON}.")
        return [(place, numbers) for place in on_edge]

    return [(place, numbers) for place in (places if part.kind.sheet else places[:1])]


def displacements_of_rank(part: MeshedStructure, shapes: Array) -> Array:
    """Displacements (nodes, 3, columns) at the geometry nodes of this rank, ghosts included."""
    mesh, form = part.mesh, part.form
    shapes = compat.with_ghosts(form.space, shapes)
    geometry = mesh.geometry
    nodes = compat.geometry_nodes(mesh.dolfinx)

    result = np.zeros((len(mesh.dolfinx.geometry.x), 3, shapes.shape[1]))
    for axis, name in enumerate("xyz"):
        if name not in form.components:
            continue
        path = form.components[name]
        dofs = compat.cell_dofs(form.space, path, np.arange(len(nodes)))
        if nodes.shape[1] in (len(geometry.corners), dofs.shape[1]):
            result[nodes, axis] = shapes[dofs[:, : nodes.shape[1]]]
        else:
            table = compat.tabulate(form.space, path, geometry.reference_nodes)
            result[nodes, axis] = table @ shapes[dofs]

    return result


def _gathered(member: Member, shapes: Array) -> tuple[Array, IntArray, Array]:
    """(points (P, 3), cells in VTK's order, shapes (P, 3, columns)) of a part, on rank 0."""
    mesh = member.part.mesh
    shapes = displacements_of_rank(member.part, shapes)
    R = member.at.rotation
    if (np.eye(3) != R).any():
        shapes = np.einsum("cd,ndk->nck", R, shapes)
    cells_of_rank = compat.cell_index_map(mesh.dolfinx).size_local
    cells = compat.geometry_nodes(mesh.dolfinx)[:cells_of_rank]
    points = member.at.placed(mesh.dolfinx.geometry.x)
    pieces = mesh.comm.gather((points, cells, shapes), root=0)
    if pieces is None:
        return points, cells, shapes
    order = np.argsort(compat.node_order(mesh.cell, cells.shape[1], "vtk"))
    starts = np.cumsum([0] + [len(p) for p, _, _ in pieces[:-1]])

    return (
        np.vstack([p for p, _, _ in pieces]),
        np.vstack([c + s for s, (_, c, _) in zip(starts, pieces, strict=True)])[:, order],
        np.concatenate([f for _, _, f in pieces]),
    )


#: Kinds of parts whose stresses have an estimated error.
ESTIMATED_KINDS = {"solid", "sheet"}


def stress_jumps(
    structure: Structure, shapes: Array, factors: Array, part: str | None = None
) -> Array | None:
    """Estimated errors (P,) [Pa] of von Mises stress at the points of `at_nodes`, on rank 0; None
    without an estimate. `factors` (P, columns): factors of the shapes at the time of each point."""
    if not families(structure, part) & ESTIMATED_KINDS:
        return None
    parts = with_parts(structure).fields(shapes, part)
    errors = []
    start = 0
    for member, shapes_of_part in parts:
        comm = member.part.mesh.comm
        sizes = comm.allgather(len(member.part.mesh.dolfinx.geometry.x))
        first = start + sum(sizes[: comm.rank])
        errors_of_rank = np.zeros(sizes[comm.rank])
        if member.part.kind.name in ESTIMATED_KINDS:
            factors_of_rank = factors[first : first + len(errors_of_rank)]
            errors_of_rank = stress_errors_of_part(member.part, shapes_of_part, factors_of_rank)
        errors += comm.gather(errors_of_rank, root=0) or []
        start += sum(sizes)

    return np.concatenate([np.zeros(0), *errors])


def families(structure: Structure, part: str | None = None) -> set[str]:
    """Kinds of the selected parts, of "solid", "sheet", "beam" and "truss"."""
    return {member.part.kind.name for member in with_parts(structure).members(part)}


def half_thickness(structure: Structure, part: str | None = None) -> float:
    """Volume over surface [m] of the solids: half the mean thickness of their walls."""
    meshes = [member.part.mesh for member in with_parts(structure).members(part)]
    solids = [mesh for mesh in meshes if mesh.tdim == 3]
    volume, surface = np.sum([(0.0, 0.0), *map(volume_and_surface, solids)], axis=0)
    return float(volume / surface) if surface else 0.0
