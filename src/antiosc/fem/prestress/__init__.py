"""`Prestress`, `Spin`: what a part carries before it is struck."""

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
    """Three numbers; two, for plane parts, get a third of 0."""
    given = coordinates(name, value, unit)
    return (*given, 0.0)[:3]


def _axis(name: str, value: object) -> tuple[float, ...]:
    axis = _vector(name, value, "")
    if not any(axis):
        raise InputError(f"{name} must not be the zero vector.")
    return axis


def _by_names(name: str, value: object, unit: str) -> dict[str, float]:
    return {key: number(f"the {name} on {key!r}", one, unit) for key, one in _named(name, value)}


def _vectors(name: str, value: object) -> dict[str, tuple[float, ...]]:
    return {key: _vector(f"the {name} on {key!r}", one, "N") for key, one in _named(name, value)}


def named_from(start: str, values: Mapping[str, T]) -> dict[str, T]:
    """Entries whose names begin with `start`, by the remainder of their names."""
    return {key[len(start) :]: one for key, one in values.items() if key.startswith(start)}


def _named(name: str, value: object) -> list[tuple[str, object]]:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise InputError(f"{name} must be a dict {{name of a group: value}}; got {shown(value)}.")
    return list(value.items())


@dataclass(frozen=True)
class Spin(Checked):
    """A steady rotation.

    Parameters
    ----------
    axis : sequence of 3 floats
        Its direction.
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
        """Ω² P (3, 3), 1/s²: the acceleration of a point at x is Ω² P (x − about)."""
        unit = np.array(self.axis) / np.linalg.norm(self.axis)
        return np.asarray(self.omega**2 * (np.eye(3) - np.outer(unit, unit)))


@dataclass(frozen=True)
class Prestress(Checked):
    """Loads that a supported part carries before it is struck, and while it is.

    Parameters
    ----------
    spin : Spin, optional
        The part and its supports turn about an axis. Coriolis forces are left out.
    gravity : sequence of 3 floats
        Acceleration, m/s².
    pressure : dict
        Group -> Pa: of faces of a solid (edges of a plane one), against them; of cells of a sheet,
        along their normal, towards the top. It turns with the surface.
    tension : dict
        Name -> N: of a `Bolt` of an assembly, of a group of cells of beams or bars, or of a
        stiffener: the force in it after all of them are tightened, before other loads. < 0: thrust.
    force : dict
        Group -> (x, y, z) N: the resultant, spread evenly; its direction is fixed.

    In an assembly groups are named "part:group".

    Raises
    ------
    InputError
        Values that are no numbers; with the structure: unknown groups, a part that is not held,
        loads at which it buckles.
    """

    spin: Spin | None = field(
        default=None, metadata=checked_by(instance, Spin, "a Spin(axis, omega)")
    )
    gravity: Sequence[float] = field(default=(0.0, 0.0, 0.0), metadata=checked_by(_vector, "m/s²"))
    pressure: Mapping[str, float] = field(
        default_factory=dict, metadata=checked_by(_by_names, "Pa")
    )
    tension: Mapping[str, float] = field(default_factory=dict, metadata=checked_by(_by_names, "N"))
    force: Mapping[str, Sequence[float]] = field(
        default_factory=dict, metadata=checked_by(_vectors)
    )


def of_part(loads: Prestress, name: str, R: Array, about: Array) -> Prestress:
    """Loads on the part `name` of an assembly, in the part's axes, without tensions.

    R (3, 3) turns the part in the assembly; `about` (3,) of the spin in the part.
    """
    spin = loads.spin
    if spin is not None:
        spin = Spin(tuple(R.T @ spin.axis), spin.omega, tuple(about))
    start = f"{name}:"
    forces = {key: tuple(R.T @ one) for key, one in named_from(start, loads.force).items()}
    pressure = named_from(start, loads.pressure)
    return Prestress(spin, tuple(R.T @ loads.gravity), pressure, {}, forces)


@dataclass(frozen=True, eq=False)
class Preload:
    """The static state of a structure under its prestress."""

    loads: Prestress
    q: Array  # (rows of this rank,) displacements and rotations
    #: load factor to buckling
    reserve: float
    #: name of a tension -> strain free of stress
    initial: Mapping[str, float]
    #: forces (rows of u, k) that it adds to K u, on dofs of supports too, of motions (rows of u, k)
    added: Callable[[Array], Array]

    @property
    def words(self) -> str:
        """The prestress in words, for descriptions of the structure and its models."""
        said = "prestress"
        if self.loads.spin is not None:
            said += f" with a spin of {self.loads.spin.omega:g} rad/s, without Coriolis forces"
        return f"{said}, {self.reserve_text}"

    @property
    def reserve_text(self) -> str:
        """The load factor to buckling in words."""
        if isinf(self.reserve):
            return "no buckling below 100 times the loads"
        return f"buckling at {self.reserve:.4g} times the loads"
