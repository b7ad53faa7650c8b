"""`Prestress`, `Spin`: static loads of a part before an impact."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isinf
from typing import TypeVar

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import Checked, checked_by, coordinates, instance, number, shown
from antiosc.base.errors import InputError

T = TypeVar("T")


def _vector(name: str, value: object, unit: str) -> tuple[float, ...]:
    """A checked vector of three numbers in `unit`; two numbers, of a plane part, get a third, 0."""
    components = coordinates(name, value, unit)
    return (*components, 0.0)[:3]


def _axis(name: str, value: object) -> tuple[float, ...]:
    """A non-zero vector of three numbers."""
    axis = _vector(name, value, "")
    if not any(axis):
        raise InputError(f"{name} must not be the zero vector.")
    return axis


def _numbers_by_names(name: str, value: object, unit: str) -> dict[str, float]:
    """Checked numbers, in `unit`, by name."""
    return {key: number(f"the {name} on {key!r}", item, unit) for key, item in _items(name, value)}


def _vectors_by_names(name: str, value: object) -> dict[str, tuple[float, ...]]:
    """Checked force vectors [N] by name."""
    return {key: _vector(f"the {name} on {key!r}", item, "N") for key, item in _items(name, value)}


def _items(name: str, value: object) -> list[tuple[str, object]]:
    """Items of a mapping with text keys; otherwise InputError."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise InputError(f"{name} must be a dict {{name of a group: value}}; got {shown(value)}.")
    return list(value.items())


@dataclass(frozen=True)
class Spin(Checked):
    """A steady rotation.

    Parameters
    ----------
    axis : sequence of 3 floats
        Direction of the axis.
    omega : float
        Angular velocity, rad/s.
    about : sequence of 2 or 3 floats
        A point on the axis, m.
    """

    axis: Sequence[float] = field(metadata=checked_by(_axis))
    omega: float = field(metadata=checked_by(number, "rad/s"))
    about: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_vector, "m"))

    @property
    def stiffness(self) -> Array:
        """Ω² P (3, 3), 1/s², P normal to the axis; centrifugal acceleration: Ω² P (x − about)."""
        unit = np.array(self.axis) / np.linalg.norm(self.axis)
        return np.asarray(self.omega**2 * (np.eye(3) - np.outer(unit, unit)))


@dataclass(frozen=True)
class Prestress(Checked):
    """Loads that a supported part carries before and during an impact.

    Parameters
    ----------
    spin : Spin, optional
        Rotation of the part and its supports about an axis; refused with point masses.
        Coriolis forces are neglected.
    gravity : sequence of 3 floats
        Acceleration, m/s².
    pressure : dict
        Group -> Pa. On faces of a solid (edges of a plane part) it acts inward; on cells of a
        sheet, along their normal toward the top. It follows the rotation of the surface.
    tension : dict
        Group of cells of beams or bars -> N: the force after all groups are tightened, before other
        loads act. Negative: compression.
    force : dict
        Group -> (x, y, z) N: resultant of an evenly distributed force of fixed direction.

    Raises
    ------
    InputError
        Values that are not numbers; when a structure is made: unknown groups, a part that can move
        as a rigid body, loads at which it buckles.
    """

    spin: Spin | None = field(
        default=None, metadata=checked_by(instance, Spin, "a Spin(axis, omega)")
    )
    gravity: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_vector, "m/s²"))
    pressure: Mapping[str, float] = field(
        default_factory=dict, metadata=checked_by(_numbers_by_names, "Pa")
    )
    tension: Mapping[str, float] = field(
        default_factory=dict, metadata=checked_by(_numbers_by_names, "N")
    )
    force: Mapping[str, Sequence[float]] = field(
        default_factory=dict, metadata=checked_by(_vectors_by_names)
    )


@dataclass(frozen=True, eq=False)
class Preload:
    """The static state of a structure under its prestress."""

    loads: Prestress
    q: Array  # (rows of this rank,) displacements and rotations under the loads
    #: load factor to buckling; inf: above some 100
    reserve: float
    #: group of `loads.tension` -> stress-free strain of its cells
    initial: Mapping[str, float]
    #: function of motions (rows of u, k): forces that the loads add to K u, also on supported dofs
    added: Callable[[Array], Array]

    @property
    def words(self) -> str:
        """The prestress as text, for descriptions of the structure and its models."""
        text = "prestress"
        if self.loads.spin is not None:
            text += f" with a spin of {self.loads.spin.omega:g} rad/s, without Coriolis forces"
        return f"{text}, {self.reserve_text}"

    @property
    def reserve_text(self) -> str:
        """The load factor to buckling as text."""
        if isinf(self.reserve):
            return "no buckling below 100 times the loads"
        return f"buckling at {self.reserve:.4g} times the loads"
