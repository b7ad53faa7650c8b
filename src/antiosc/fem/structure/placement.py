"""`Placement`: the rigid motion that places a part in an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import array, coordinates, number, shown
from antiosc.base.declared import Checked, checked_by
from antiosc.base.errors import InputError


def _in_space(name: str, value: Any) -> tuple[float, ...]:
    given = coordinates(name, value)
    return (*given, 0.0)[:3]


def _axis(name: str, value: Any) -> tuple[float, ...]:
    axis = array(name, value, (3,))
    if not np.linalg.norm(axis):
        raise InputError("axis must not be the zero vector: it is the axis of rotation.")
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

    shift: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_in_space))
    axis: Sequence[float] = field(default=(0.0, 0.0, 1.0), metadata=checked_by(_axis))
    angle: float = field(default=0.0, metadata=checked_by(number, "rad"))
    about: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_in_space))

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


def placement(name: str, given: Any) -> Placement:
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
