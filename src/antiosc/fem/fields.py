"""Displacement fields of a body, computed from its model after an impact.

The modal form of the body (`ModalBody`) defines the sum of its shapes, for anti-oscillators Article
(8), w(x, t) = λ0 ψ0(x) + Σ (λi − λ0) ψi(x): `probe` evaluates the sum at one point for all times,
`write_series` at all nodes for some times, in files that ParaView opens.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc._types import Array, IntArray
from antiosc.checks import array, coordinates, instance, text
from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.layout import Member
from antiosc.fem.assembly.placement import Placement
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh import closest_point
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mpi import collective, on_root
from antiosc.fem.readers import KINDS
from antiosc.fem.readers.neutral import FACETS
from antiosc.fem.series import listing, write_frames
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.fem.vtu import Frames
from antiosc.simulation.history import History, no_field
from antiosc.simulation.scene_history import SceneHistory
from antiosc.threads import one_thread


def _what(history: History | SceneHistory) -> tuple[Any, ...]:
    """Data of a history that must be equal on all ranks, without the last digits of its numbers."""
    of = list(history.assembly.bodies) if isinstance(history, SceneHistory) else history.model
    return of, history.status, f"{history.time[-1]:.6g}"


@collective(history=_what)
@one_thread()
def probe(
    structure: Structure,
    history: History | SceneHistory,
    point: Sequence[float],
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
    part: str | None = None,
) -> Array:
    """Displacements in m of one point of the structure at `times`: (n, 3), of plane parts (n, 2).

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History or SceneHistory
    point : sequence of 2 or 3 floats
        Coordinates in m; the nearest point of the structure is taken.
    times : array_like (n,), optional
        Times in s; default: those of the history.
    body : str
        Which of the bodies `structure` is: "structure" or "impactor"; of a scene its name (default:
        the only one that has shapes).
    part : str, optional
        Of an assembly: the part of which the nearest point is taken; default: of all parts.
    """
    x, given = np.zeros(3), coordinates("point", point)
    x[: len(given)] = given
    if part is not None:
        text("part", part)
    parts = _parts(structure, history, body, part)
    found = [closest_point.closest(m.part.mesh, m.at.own(x[None])[0]) for m, _ in parts]
    k = int(np.argmin([nearest.distance for nearest in found]))
    member, shapes = parts[k]
    values = _at_point(member, found[k], shapes)
    components = [name for name in "xyz" if name in member.part.form.components]
    at = history.time if times is None else array("times", times, (None,))
    return _amplitudes(history, at, body) @ values[: len(components)].T


def _at_point(member: Member, nearest: closest_point.ClosestPoint, shapes: Array) -> Array:
    """Displacements (3, columns) of a point of a part for shapes (rows of this rank, columns)."""
    mesh, form = member.part.mesh, member.part.form
    shapes = compat.with_ghosts(form.space, shapes)
    values = None
    if mesh.comm.rank == nearest.rank:
        values = np.zeros((3, shapes.shape[1]))
        for axis, name in enumerate("xyz"):
            path = form.components.get(name)
            if path is not None:
                dofs = compat.subspace(form.space, path).dofmap.cell_dofs(nearest.cell)
                weights = compat.tabulate(form.space, path, nearest.X.reshape(1, -1))[0]
                values[axis] = weights @ shapes[dofs]
    return np.asarray(member.at.rotation @ mesh.comm.bcast(values, root=nearest.rank))


@collective(history=_what)
@one_thread()
def write_series(
    structure: Structure,
    history: History | SceneHistory,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Path:
    """Write the displacement field as a series that ParaView opens (`.pvd` with `.vtu` files).

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History or SceneHistory
    path : str or Path
        The `.pvd` file (the ending is added where it is missing); the frames go beside it as
        `<name>_0000.vtu` and on.
    times : array_like (n,), optional
        Times in s; default: 40 evenly over the history.
    body : str
        Which of the bodies `structure` is: "structure" or "impactor"; of a scene its name (default:
        the only one that has shapes).

    Returns
    -------
    Path
        Of the `.pvd`, written last: until then it is absent, or lists no frame.
    """
    target = listing(path)
    parts = _parts(structure, history, body)
    if times is None:
        times = np.linspace(history.time[0], history.time[-1], 40)
    at = array("times", times, (None,))
    gathered = [_gathered(member, shapes) for member, shapes in parts]
    amplitudes = _amplitudes(history, at, body)

    def write() -> None:
        points, cells, shapes = _side_by_side(gathered)
        kinds = [_kind(m.part.mesh, c) for (m, _), c in zip(parts, cells, strict=True)]
        frames = Frames(points, list(zip(kinds, cells, strict=True)))
        write_frames(target, frames, at, (shapes @ a for a in amplitudes))

    on_root(structure.comm, write)
    return target


@collective(history=_what)
@one_thread()
def skin(
    structure: Structure, history: History | SceneHistory, time: float, *, body: str = "structure"
) -> tuple[Array, IntArray, Array]:
    """The surface of a part and its motion at one time, the same on all ranks.

    Returns
    -------
    points : (P, 3) [m], nodes of the mesh.
    faces : (F, 3 or 4) indices of their corners, in order around the face: the outer faces of a
        solid, the cells of a sheet or of a plane part.
    moved : (P, 3) [m], displacements of the points at `time` [s].

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; a mesh of lines.
    """
    parts = [pair for pair in _parts(structure, history, body) if pair[0].part.mesh.tdim > 1]
    if not parts:
        raise InputError("a mesh of lines has no surface: write_series writes its motion.")
    gathered = [_gathered(member, shapes) for member, shapes in parts]
    points, cells, shapes = _side_by_side(gathered)
    moved = shapes @ _amplitudes(history, array("time", [time], (1,)), body)[0]
    faces = [_outer(m.part.mesh.cell, c) for (m, _), c in zip(parts, cells, strict=True)]
    if len({f.shape[1] for f in faces}) > 1:  # of several parts: quadrilaterals as triangles
        faces = [
            np.vstack([f[:, [0, 1, 2]], f[:, [0, 2, 3]]]) if f.shape[1] == 4 else f for f in faces
        ]
    outer: tuple[Array, IntArray, Array] = structure.comm.bcast(
        (points, np.vstack(faces), moved), root=0
    )
    return outer


def _kind(mesh: Mesh, cells: IntArray) -> str:
    """meshio's name of the kind of cells."""
    return next(n for n, k in KINDS.items() if (k.shape, k.nodes) == (mesh.cell, cells.shape[1]))


def _outer(cell: str, cells: IntArray) -> IntArray:
    """Corners of the outer faces of solid cells, or of plane cells, in order around each."""
    faces = [cells[:, list(f)] for f in FACETS[cell]]
    if cell in ("triangle", "quadrilateral"):  # the first corner of each edge around the cell
        return cells[:, [edge[0] for edge in FACETS[cell]]]
    listed = np.vstack(faces)
    _, first, count = np.unique(
        np.sort(listed, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(listed[first[count == 1]])


def _parts(
    structure: Structure, history: History | SceneHistory, body: str, name: str | None = None
) -> list[tuple[Member, Array]]:
    """The parts of the structure (or the one named) with the shapes of the body.

    Shapes are on the rows of this rank, columns side by side.
    """
    shapes = _shapes(structure, history, body)
    if isinstance(structure.matrices, AssembledMatrices):
        joined = structure.matrices
        return [(member, joined.own_fields(member, shapes)) for member in joined.members(name)]
    meshed = on_mesh(structure)
    if name is not None:
        raise InputError(f"part={name!r} names a part of an assembly; {meshed.mesh.name} is one.")
    return [(Member("", meshed, Placement(), 0), shapes)]


def _shapes(structure: Structure, history: History | SceneHistory, body: str) -> Array:
    """Shapes of the body on the rows of this rank, columns side by side."""
    instance("structure", structure, Structure, "a Structure")
    kinds = (History, SceneHistory)
    instance("history", history, kinds, "a History, which simulate and Scene.run return")
    model, own = history.of(body)  # type: ignore[arg-type]
    if own.basis is None:
        raise InputError(no_field(model))
    rows = structure.rows
    fits = all(len(block) == rows for block in own.basis)
    if not all(structure.comm.allgather(fits)):  # on some rank they may fit by chance
        raise InputError(
            f"the model's shapes have {len(own.basis[0])} rows, the structure {rows}: the model "
            "was extracted from another structure."
        )
    return np.column_stack(own.basis)


def _amplitudes(history: History | SceneHistory, times: Array, body: str) -> Array:
    """Factors (n, B) of those shapes at `times`."""
    _, own = history.of(body)  # type: ignore[arg-type]
    return own.amplitudes(history.coordinates(times, body))  # type: ignore[arg-type]


def _at_nodes(mesh: Mesh, form: WeakForm, shapes: Array) -> Array:
    """Displacement shapes at the geometry nodes of this rank: (nodes, 3, N + 1).

    Lagrange nodes of a cell come in one order, vertices first: a geometry node is the dof of
    the same local number.
    """
    nodes = compat.geometry_nodes(mesh.dolfinx)
    result = np.zeros((len(mesh.dolfinx.geometry.x), 3, shapes.shape[1]))
    for axis, name in enumerate("xyz"):
        if name in form.components:
            dofs = compat.cell_dofs(form.space, form.components[name], np.arange(len(nodes)))
            result[nodes, axis] = shapes[dofs[:, : nodes.shape[1]]]
    return result


def _gathered(member: Member, shapes: Array) -> tuple[Array, IntArray, Array]:
    """Points, cells (VTK's node order) and shapes of all ranks on rank 0."""
    mesh, form = member.part.mesh, member.part.form
    shapes = _at_nodes(mesh, form, compat.with_ghosts(form.space, shapes))
    R = member.at.rotation
    if (np.eye(3) != R).any():
        shapes = np.einsum("cd,ndk->nck", R, shapes)
    own = compat.cell_map(mesh.dolfinx).size_local
    cells = compat.geometry_nodes(mesh.dolfinx)[:own]
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


def _side_by_side(
    gathered: Sequence[tuple[Array, IntArray, Array]],
) -> tuple[Array, list[IntArray], Array]:
    """Points and shapes of all parts, and the cells of each part."""
    starts = np.cumsum([0] + [len(points) for points, _, _ in gathered[:-1]])
    return (
        np.vstack([points for points, _, _ in gathered]),
        [cells + start for (_, cells, _), start in zip(gathered, starts, strict=True)],
        np.concatenate([shapes for _, _, shapes in gathered]),
    )
