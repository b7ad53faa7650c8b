"""`Placement`: the rigid motion that places a part in an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array, BoolArray
from antiosc.base.checks import Checked, array, checked_by, coordinates, number, shown
from antiosc.base.errors import InputError


def in_space(point: ArrayLike) -> Array:
    """Three coordinates of a point of two or three; z = 0 where there are two."""
    x = np.asarray(point, dtype=float)
    return np.pad(x, (0, 3 - len(x)))


def _checked_point(name: str, value: object) -> tuple[float, ...]:
    return tuple(in_space(coordinates(name, value)).tolist())


def checked_axis(name: str, value: object) -> tuple[float, ...]:
    """The direction of an axis, or InputError."""
    axis = array(name, value, (3,))
    if not np.linalg.norm(axis):
        raise InputError(f"{name} must not be the zero vector.")
    return tuple(axis.tolist())


@dataclass(frozen=True)
class Placement(Checked):
    """A rotation about an axis, then a translation: x → c + R (x − c) + shift.

    Parameters
    ----------
    shift : sequence of 2 or 3 floats
        Translation, m.
    axis : sequence of 3 floats
        Direction of the axis of rotation.
    angle : float
        Angle of the rotation, rad, positive by the right-hand rule.
    about : sequence of 2 or 3 floats
        The point c on the axis of rotation, m.
    """

    shift: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_checked_point))
    axis: Sequence[float] = field(default=(0.0, 0.0, 1.0), metadata=checked_by(checked_axis))
    angle: float = field(default=0.0, metadata=checked_by(number, "rad"))
    about: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_checked_point))

    @property
    def rotation(self) -> Array:
        """R (3, 3), by Rodrigues' formula; exact for quarter turns about a coordinate axis."""
        unit = np.array(self.axis) / np.linalg.norm(self.axis)
        cross = skew(unit)
        sine, cosine = np.sin(self.angle), np.cos(self.angle)
        R = np.eye(3) + sine * cross + (1 - cosine) * cross @ cross
        whole = np.round(R)
        return whole if np.abs(R - whole).max() < 1e-15 else R

    def placed(self, x: Array) -> Array:
        """Where points (n, 3) of the part lie in the assembly."""
        about = np.array(self.about)
        return about + (x - about) @ self.rotation.T + self.shift

    def own(self, x: Array) -> Array:
        """Coordinates in the part of points (n, 3) of the assembly."""
        about = np.array(self.about)
        return about + (x - self.shift - about) @ self.rotation


def skew(a: Array) -> Array:
    """The matrix (3, 3) with skew(a) b = a × b; (n, 3, 3) for vectors (n, 3)."""
    a = np.asarray(a, dtype=float)
    zero = np.zeros(a.shape[:-1])
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rigid_motions(points: Array, axes: Array, moves: BoolArray, centre: Array) -> Array:
    """Unit translations along x, y, z and rotations about `centre` (3,) on n dofs (n, 6).

    `points` and `axes` (n, 3): where each dof is, and its direction; `moves` (n,): whether it is
    a displacement, or else a rotation.
    """
    result = np.zeros((len(points), 6))
    result[moves, :3] = axes[moves]
    result[moves, 3:] = np.cross(points[moves] - centre, axes[moves])
    result[~moves, 3:] = axes[~moves]
    return result


def placement(name: str, given: Placement | Sequence[float] | None) -> Placement:
    """`given` as a Placement: one itself, or a translation of 2 or 3 numbers."""
    if given is None:
        return Placement()
    if isinstance(given, Placement):
        return given
    try:
        return Placement(shift=given)
    except InputError as error:
        raise InputError(
            f"at[{name!r}] must be a translation (x, y, z) in m or a Placement; got {shown(given)}."
        ) from error
