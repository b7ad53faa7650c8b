"""Displacement fields of a body, computed from its model after an impact.

The modal form of the body (`ModalBody`) defines the sum of its shapes, for anti-oscillators Article
(8), w(x, t) = λ0 ψ0(x) + Σ (λi − λ0) ψi(x): `write_series` evaluates the sum at all nodes for some
times, in files that ParaView opens (`antiosc.results.probe`: at one point for all times).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import array, filled, instance, path as checked_path
from antiosc.base.errors import InputError
from antiosc.base.process import one_thread
from antiosc.fem.fields import source
from antiosc.fem.fields.series import Frames, listing, write_frames, write_vtx
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.platform import collective, on_root
from antiosc.fem.structure.structure import Structure
from antiosc.models.modal import combined
from antiosc.results.saved_fields import SavedFields
from antiosc.simulation.histories.body_motion import (
    Motions,
    amplitudes,
    modes_of,
    of_unit_energies,
)
from antiosc.simulation.histories.history import History, SceneHistory
from antiosc.simulation.histories.scene_history import BodyHistory

#: Ratios of stiffness and of mass of a structure and of a model on its shapes from which they do
#: not belong together. A model that is corrected for its mesh is softer, and as heavy.
ANOTHER = 1.5, 1.01


def counted(history: Motions) -> tuple[object, ...]:
    """Data of a history that must be equal on all ranks, without the last digits of its numbers."""
    if isinstance(history, BodyHistory):
        return "body", history.placed.name, f"{history.time[-1]:.6g}"
    of = list(history.assembly.bodies) if isinstance(history, SceneHistory) else history.model
    return of, history.status, f"{history.time[-1]:.6g}"


@collective(history=counted)
@one_thread()
def write_series(
    structure: Structure,
    history: History,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Path:
    """Write the displacement field as a series that ParaView opens.

    It is a `.pvd` with `.vtu` files, or one `.bp` folder (VTX) where dolfinx has ADIOS2.

    Parameters
    ----------
    structure : Structure
        The structure from which the model of the body was extracted.
    history : History
    path : str or Path
        The `.pvd` file (the ending is added where it is missing); the frames go beside it as
        `<name>_0000.vtu` and on. With the ending `.bp` that folder, of a structure of one mesh;
        each rank writes its own part there.
    times : array_like (n,), optional
        Times in s; default: 40 evenly over the history.
    body : str
        Which of the bodies `structure` is: "structure" or "impactor"; of a scene its name (default:
        the only one that has shapes).

    Returns
    -------
    Path
        Of the `.pvd`. If the run is killed meanwhile, it is absent, or lists a whole series.
    """
    one_folder = checked_path("path", path).suffix.lower() == ".bp"
    target = checked_path("path", path) if one_folder else listing(path)
    own = shapes_of(structure, history, body)
    if times is None:
        times = np.linspace(history.time[0], history.time[-1], 40)
    at = filled("times", times)
    if one_folder:
        write_vtx(target, structure, own, at, amplitudes(history, at, body))
        return target
    points, cells, shapes = source(structure).at_nodes(structure, own)
    factors = amplitudes(history, at, body)

    def write() -> None:
        frames = Frames(points, cells)
        write_frames(target, frames, at, (shapes @ a for a in factors))

    on_root(structure.comm, write)
    return target


@collective(history=counted)
@one_thread()
def save_fields(
    structure: Structure,
    history: History,
    path: str | Path,
    times: ArrayLike | None = None,
    *,
    body: str = "structure",
) -> Path:
    """Write the displacements of all nodes at many times to one compact file.

    It holds the shapes once and their factors at each time; `SavedFields.load(path)` reads it with
    NumPy alone.

    Parameters
    ----------
    structure, history, body
        As for `write_series`.
    path : str or Path
        The `.npz` file.
    times : array_like (n,), optional
        Increasing times in s; default: those of the history.

    Raises
    ------
    InputError
        A model without shapes, or extracted from another structure; times that do not increase; a
        file that cannot be written.
    """
    target = checked_path("path", path)
    own = shapes_of(structure, history, body)
    at = np.unique(history.time) if times is None else filled("times", times)
    points, cells, shapes = source(structure).at_nodes(structure, own)
    factors = amplitudes(history, at, body)
    on_root(structure.comm, lambda: SavedFields(points, cells, shapes, at, factors).save(target))
    return target


@collective(history=counted)
@one_thread()
def skin(
    structure: Structure, history: History, time: float, *, body: str = "structure"
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
    own = shapes_of(structure, history, body)
    points, faces, shapes = source(structure).surface(structure, own)
    moved = shapes @ amplitudes(history, array("time", [time], (1,)), body)[0]
    outer: tuple[Array, IntArray, Array] = structure.comm.bcast((points, faces, moved), root=0)
    return outer


@collective(history=counted)
@one_thread()
def nodal_motion(
    structure: Structure, history: History, time: float, *, body: str = "structure"
) -> Array:
    """Displacements (P, 3) [m] at one time of the points that `peak_field` has."""
    own = shapes_of(structure, history, body)
    _, cells, shapes = source(structure).at_nodes(structure, own)
    used = np.unique(np.concatenate([numbers.ravel() for _, numbers in cells]))
    moved = shapes[used] @ amplitudes(history, array("time", [time], (1,)), body)[0]
    found: Array = structure.comm.bcast(moved, root=0)
    return found


def shapes_of(structure: Structure, history: Motions, body: str) -> Array:
    """Shapes of the body on the rows of this rank, columns side by side."""
    return np.column_stack(checked_shapes(structure, history, body, ANOTHER))


def checked_shapes(
    structure: Structure, history: Motions, body: str, limits: tuple[float, float]
) -> tuple[Array, ...]:
    """Blocks of the shapes of the body, which are those of the structure within these ratios."""
    instance("structure", structure, Structure, "a Structure")
    kinds = (History, BodyHistory)
    instance("history", history, kinds, "a History, which simulate and Scene.run return")
    own = modes_of(history, body)
    assert own.basis is not None
    rows = structure.rows
    fits = all(len(block) == rows for block in own.basis)
    if not all(structure.comm.allgather(fits)):  # on some rank they may fit by chance
        raise InputError(
            f"the model's shapes have {len(own.basis[0])} rows, the structure {rows}: the model "
            "was extracted from another structure."
        )
    factors, count = of_unit_energies(own)
    of_kinds = zip((structure.K, structure.M), ("stiff", "heavy"), limits, strict=True)
    for x, (matrix, what, limit) in zip(combined(own.basis, factors), of_kinds, strict=True):
        ratio = float(dot(structure.comm, x, multiply(matrix, x))) / max(count, 1)
        if count and not 1 / limit < ratio < limit:
            raise InputError(
                f"the structure is {ratio:.6g} times as {what} on the shapes of the model as the"
                " model: the model was extracted from another structure; give that of this run."
            )
    return own.basis
