"""Description of the rigid-body motions that the supports of a structure permit."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.mpi import bounds
from antiosc.fem.structure import rigid_body_modes

#: Share of a motion below which a part of it is rounding.
MOTION_ROUNDING = 1e-6


def described(mesh: Mesh, form: WeakForm, modes: Array) -> str:
    """The motions spanned by rigid-body modes (rows of this rank, r): "translation along x, …".

    Collective: every rank gets the same text.
    """
    low, high = bounds(mesh.comm, mesh.dolfinx.geometry.x)
    centre, size = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    unit = rigid_body_modes.about(form, centre)
    unit[:, 3:] /= size
    # the coefficients (6, r) of each mode: exact, the modes lie in the span of the unit motions
    motions = np.linalg.pinv(dot(mesh.comm, unit, unit)) @ dot(mesh.comm, unit, modes)
    return of_body(motions / np.linalg.norm(motions, axis=0), centre, size)


def of_body(motions: Array, centre: Array, size: float) -> str:
    """The motions (6, m) of a body in words.

    Their coefficients are of unit translations along x, y, z and of rotations about axes through
    `centre` (3,), scaled by 1/`size` [m].
    """
    moves, rotations = _divided(motions)
    words = [f"translation along {_name(move)}" for move in moves]
    for velocity, spin in rotations:
        words.append(_turn(velocity, spin, moves, centre, size))
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _divided(motions: Array) -> tuple[Array, list[tuple[Array, Array]]]:
    """Translations (t, 3), and motions that turn as (velocity of the centre, spin) pairs."""
    _, values, right = np.linalg.svd(motions[3:])
    turning = int(np.sum(values > MOTION_ROUNDING))
    moves = _reduced((motions @ right[turning:].T)[:3].T)
    turning_ones = (motions @ right[:turning].T).T
    # spins in echelon form, so that axes of the mesh show where they are among them
    order = _reduced(turning_ones[:, [3, 4, 5, 0, 1, 2]], columns=3)
    keep = np.eye(3) if not len(moves) else np.eye(3) - np.linalg.pinv(moves) @ moves
    return moves, [(keep @ row[3:], row[:3]) for row in order]


def _reduced(rows: Array, columns: int | None = None) -> Array:
    """The reduced echelon form of independent rows, pivots among the first `columns`."""
    rows = np.array(rows, dtype=float)
    row = 0
    for column in range(rows.shape[1] if columns is None else columns):
        if row == len(rows):
            break
        pivot = row + int(np.argmax(np.abs(rows[row:, column])))
        if abs(rows[pivot, column]) <= MOTION_ROUNDING * np.abs(rows[row:]).max():
            continue
        rows[[row, pivot]] = rows[[pivot, row]]
        rows[row] /= rows[row, column]
        others = np.arange(len(rows)) != row
        rows[others] -= np.outer(rows[others, column], rows[row])
        row += 1
    return np.where(np.abs(rows) > MOTION_ROUNDING, rows, 0.0)


def _turn(velocity: Array, spin: Array, moves: Array, centre: Array, size: float) -> str:
    """One motion that rotates; `spin` in units of 1/size."""
    axis = spin / np.linalg.norm(spin)
    along = float(velocity @ axis)
    words = f"rotation about {_name(axis)}"
    if abs(along) > MOTION_ROUNDING * np.linalg.norm(velocity) and abs(along) > MOTION_ROUNDING:
        words = f"a screw motion along {_name(axis)}"
    if len(moves) and np.linalg.matrix_rank(np.cross(moves, axis), MOTION_ROUNDING) == 2:
        return words  # with these translations the axis may lie anywhere
    through = centre + size * np.cross(spin, velocity) / float(spin @ spin)
    through = np.where(np.abs(through) > MOTION_ROUNDING * size, through, 0.0)
    return f"{words} through ({', '.join(f'{c:.4g}' for c in through)}) m"


def _name(direction: Array) -> str:
    """x, y or z, or the direction in numbers."""
    unit = direction / np.linalg.norm(direction)
    largest = int(np.argmax(np.abs(unit)))
    if abs(unit[largest]) > 1 - MOTION_ROUNDING:
        return "xyz"[largest]
    return "(" + ", ".join(f"{c:.3g}" for c in np.round(unit, 6) + 0.0) + ")"
