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
from antiosc.checks import array, coordinates, instance
from antiosc.errors import InputError
from antiosc.fem import compat
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh import closest_point
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mpi import collective, on_root
from antiosc.fem.readers import KINDS
from antiosc.fem.readers.neutral import FACETS
from antiosc.fem.series import listing, write_frames
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.fem.vtu import Frames
from antiosc.simulation.history import Body, History, no_field
from antiosc.threads import one_thread


def _what(history: History) -> tuple[Any, ...]:
    """Data of a history that must be equal on all ranks, without the last digits of its numbers."""
    return history.model, history.status, f"{history.time[-1]:.6g}"


@collective(history=_what)
@one_thread()
def probe(
    structure: Structure,
    history: History,
    point: Sequence[float],
    times: ArrayLike | None = None,
    *,
    body: Body = "structure",
) -> Array:
    """Displacements (n, gdim) in m of one point of the structure at `times`.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History
    point : sequence of 2 or 3 floats
        Coordinates in m; the nearest point of the structure is taken.
    times : array_like (n,), optional
        Times in s; default: those of the history.
    body : "structure" or "impactor"
        Which of the two bodies `structure` is.
    """
    part, shapes = _shapes(structure, history, body)
    mesh, form = part.mesh, part.form
    shapes = compat.with_ghosts(form.space, shapes)
    x, given = np.zeros(3), coordinates("point", point)
    x[: len(given)] = given
    nearest = closest_point.closest(mesh, x)
    values = None
    if mesh.comm.rank == nearest.rank:
        values = np.zeros((mesh.gdim, shapes.shape[1]))
        for axis, name in enumerate("xyz"[: mesh.gdim]):
            path = form.components[name]
            dofs = compat.subspace(form.space, path).dofmap.cell_dofs(nearest.cell)
            weights = compat.tabulate(form.space, path, nearest.X.reshape(1, -1))[0]
            values[axis] = weights @ shapes[dofs]
    values = mesh.comm.bcast(values, root=nearest.rank)
    at = history.time if times is None else array("times", times, (None,))
    return _amplitudes(history, at, body) @ values.T


@collective(history=_what)
@one_thread()
def write_series(
    structure: Structure,
    history: History,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: Body = "structure",
) -> Path:
    """Write the displacement field as a series that ParaView opens (`.pvd` with `.vtu` files).

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History
    path : str or Path
        The `.pvd` file (the ending is added where it is missing); the frames go beside it as
        `<name>_0000.vtu` and on.
    times : array_like (n,), optional
        Times in s; default: 40 evenly over the history.
    body : "structure" or "impactor"
        Which of the two bodies `structure` is.

    Returns
    -------
    Path
        Of the `.pvd`, written last: until then it is absent, or lists no frame.
    """
    target = listing(path)
    part, shapes = _shapes(structure, history, body)
    mesh, form = part.mesh, part.form
    if times is None:
        times = np.linspace(history.time[0], history.time[-1], 40)
    at = array("times", times, (None,))
    shapes = _at_nodes(mesh, form, compat.with_ghosts(form.space, shapes))
    points, cells, shapes = _gathered(mesh, shapes)
    amplitudes = _amplitudes(history, at, body)

    def write() -> None:
        kind = next(
            n for n, k in KINDS.items() if (k.shape, k.nodes) == (mesh.cell, cells.shape[1])
        )
        frames = Frames(points, kind, cells)
        write_frames(target, frames, at, (shapes @ a for a in amplitudes))

    on_root(mesh.comm, write)
    return target


@collective(history=_what)
@one_thread()
def skin(
    structure: Structure, history: History, time: float, *, body: Body = "structure"
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
    part, shapes = _shapes(structure, history, body)
    mesh, form = part.mesh, part.form
    if mesh.tdim == 1:
        raise InputError("a mesh of lines has no surface: write_series writes its motion.")
    shapes = _at_nodes(mesh, form, compat.with_ghosts(form.space, shapes))
    points, cells, shapes = _gathered(mesh, shapes)
    moved = shapes @ _amplitudes(history, array("time", [time], (1,)), body)[0]
    faces = [cells[:, list(f)] for f in FACETS[mesh.cell]]
    if mesh.tdim == 2:  # corners in order: the first of each edge around the cell
        faces = [cells[:, [edge[0] for edge in FACETS[mesh.cell]]]]
    listed = np.vstack(faces)
    _, first, count = np.unique(
        np.sort(listed, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer: tuple[Array, IntArray, Array] = mesh.comm.bcast(
        (points, listed[first[count == 1]], moved), root=0
    )
    return outer


def _shapes(structure: Structure, history: History, body: Body) -> tuple[MeshedStructure, Array]:
    """The structure, and shapes of the body on the rows of this rank, columns side by side."""
    instance("structure", structure, Structure, "a Structure")
    instance("history", history, History, "a History, which simulate returns")
    model, own = history.of(body)
    if own.basis is None:
        raise InputError(no_field(model))
    rows = structure.rows
    fits = all(len(block) == rows for block in own.basis)
    if not all(structure.comm.allgather(fits)):  # on some rank they may fit by chance
        raise InputError(
            f"the model's shapes have {len(own.basis[0])} rows, the structure {rows}: the model "
            "was extracted from another structure."
        )
    return on_mesh(structure), np.column_stack(own.basis)


def _amplitudes(history: History, times: Array, body: Body) -> Array:
    """Factors (n, B) of those shapes at `times`."""
    return history.of(body)[1].amplitudes(history.coordinates(times, body))


def _at_nodes(mesh: Mesh, form: WeakForm, shapes: Array) -> Array:
    """Displacement shapes at the geometry nodes of this rank: (nodes, 3, N + 1).

    Lagrange nodes of a cell come in one order, vertices first: a geometry node is the dof of
    the same local number.
    """
    nodes = compat.geometry_nodes(mesh.dolfinx)
    result = np.zeros((len(mesh.dolfinx.geometry.x), 3, shapes.shape[1]))
    for axis, name in enumerate("xyz"[: mesh.gdim]):
        dofs = compat.cell_dofs(form.space, form.components[name], np.arange(len(nodes)))
        result[nodes, axis] = shapes[dofs[:, : nodes.shape[1]]]
    return result


def _gathered(mesh: Mesh, shapes: Array) -> tuple[Array, IntArray, Array]:
    """Points, cells (VTK's node order) and shapes of all ranks on rank 0."""
    own = compat.cell_map(mesh.dolfinx).size_local
    cells = compat.geometry_nodes(mesh.dolfinx)[:own]
    points = mesh.dolfinx.geometry.x
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
