"""Rigid-body motion in space: the initial motion of a free body, and its momentum.

A rigid motion with the velocity V of a reference point p and the spin W is written t = (V, W),
shape (6,): every point x moves with V + W x (x - p). A body carries then the momentum and the
angular momentum about p, as one array of shape (6,),

    (P, L) = S t,      S (6, 6): its mass, first moments and inertia tensor about p,

and the kinetic energy t'St/2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Brief, Given

#: Share of a body's inertia below which it has none about an axis.
INERTIALESS = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Inertia(Brief):
    """Inertia of a body and momentum of its coordinates, in the axes of its mesh.

    Attributes
    ----------
    point : (3,) reference point p [m] of all moments.
    matrix : (6, 6) momentum [kg m/s] and angular momentum about p [kg m^2/s] of the whole body for
        unit velocities along x, y, z and unit spins about the axes through p (S above). The entries
        of motions that a plane body does not have are zero.
    momentum : (C, 6) the same for a unit velocity of each of its coordinates.
    """

    point: Array
    matrix: Array
    momentum: Array

    def __post_init__(self) -> None:
        for name, shape in (("point", (3,)), ("matrix", (6, 6)), ("momentum", (None, 6))):
            value = checks.array(f"inertia.{name}", getattr(self, name), shape)
            checks.store(self, **{name: checks.kept(value)})
        S = self.matrix
        if S.diagonal().min() < 0 or np.any(np.abs(S - S.T) > 1e-9 * np.abs(S).max()):
            raise InputError("inertia.matrix must be symmetric with a diagonal >= 0.")
        if self.mass == 0:
            raise InputError("inertia.matrix must hold a mass > 0, along x, y and z.")

    @property
    def mass(self) -> float:
        """Mass of the body [kg]."""
        return float(self.matrix.diagonal()[:3].max())

    @property
    def centre(self) -> Array:
        """Centre of mass (3,) [m]."""
        # L = m (c - p) x V of a translation: the lower left block is m [c - p] x
        S = self.matrix
        moments = 0.5 * np.array([S[5, 1] - S[4, 2], S[3, 2] - S[5, 0], S[4, 0] - S[3, 1]])
        in_plane = S[2, 2] == 0
        if in_plane:  # a plane body in x and y has the third row alone
            moments = np.array([S[5, 1], -S[5, 0], 0.0])
        return np.asarray(self.point + moments / self.mass)

    def along(self, momentum: Array) -> Inertia:
        """The same body with other coordinates, whose momenta are `momentum` (C, 6)."""
        return Inertia(self.point, self.matrix, momentum)

    def rotation(self, amplitudes: Array) -> Array:
        """Rotation vectors (n, 3) [rad] of the rigid motion with amplitudes (n, C), or their rates.

        It is that of the whole body with the same angular momentum about its centre; zero about
        axes without inertia.
        """
        amplitudes = checks.array("amplitudes", amplitudes, (None, len(self.momentum)))
        centre, spins = self.centre, np.eye(3)
        motions = np.concatenate((np.cross(spins, self.point - centre), spins), axis=1)
        tensor = self.moved(motions @ self.matrix, centre)[:, 3:]
        turning = self.moved(self.momentum, centre)[:, 3:]
        return np.asarray(amplitudes @ turning @ np.linalg.pinv(tensor, rcond=INERTIALESS))

    def moved(self, momenta: Array, about: Array) -> Array:
        """(P, L) about another point `about` (3,) from `momenta` (..., 6) about the reference."""
        momenta, about = checks.array("momenta", momenta, None), checks.array("about", about, (3,))
        if momenta.ndim == 0 or momenta.shape[-1] != 6:
            raise InputError(f"momenta must have shape (..., 6); got {momenta.shape}.")
        P, L = momenta[..., :3], momenta[..., 3:]
        return np.concatenate((P, L + np.cross(self.point - about, P)), axis=-1)


@dataclass(frozen=True)
class Motion(Given):
    """The rigid-body motion with which a free body starts: velocity + spin x (x - about).

    Parameters
    ----------
    velocity : sequence of 3 floats
        Velocity of the point `about` [m/s], along the axes of the body's mesh.
    spin : sequence of 3 floats
        Angular velocity [rad/s].
    about : sequence of 3 floats, optional
        Point [m] that moves with `velocity`; by default the centre of mass.
    """

    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    spin: Sequence[float] = (0.0, 0.0, 0.0)
    about: Sequence[float] | None = None

    def __post_init__(self) -> None:
        for name in ("velocity", "spin", "about"):
            value = getattr(self, name)
            if value is not None:
                checks.store(self, **{name: tuple(checks.array(name, value, (3,)).tolist())})

    def at(self, inertia: Inertia) -> Array:
        """t = (V, W) of this motion at the reference point of `inertia`, shape (6,)."""
        checks.instance("inertia", inertia, Inertia, "an Inertia")
        centre = inertia.centre if self.about is None else np.asarray(self.about)
        spin = np.asarray(self.spin)
        velocity = np.asarray(self.velocity) + np.cross(spin, inertia.point - centre)
        motion = np.concatenate((velocity, spin))
        massless = (inertia.matrix.diagonal() == 0) & (motion != 0)
        if np.any(massless):
            names = ("along x", "along y", "along z", "about x", "about y", "about z")
            asked = ", ".join(n for n, bad in zip(names, massless, strict=True) if bad)
            raise InputError(
                f"the body has no motion {asked} (a plane body moves only along x and y and about "
                "z); leave it out of the Motion."
            )
        return motion


@dataclass(frozen=True, eq=False)
class ModalState(Given):
    """The state in which a body of a scene starts, in its mass-normalised modes.

    Parameters
    ----------
    displacements : array_like, shape (J,)
        Of the modes [kg^1/2 m], in the order of the body's modes.
    velocities : array_like, shape (J,)
        [kg^1/2 m/s].
    first_order : array_like, shape (2, I), optional
        Of the first-order modes of a body whose damping couples its modes, for branches that have
        not relaxed, which displacements and velocities do not tell.
    """

    displacements: Array
    velocities: Array
    first_order: Array | None = None

    def __post_init__(self) -> None:
        q = checks.array("displacements", self.displacements, (None,))
        v = checks.array("velocities", self.velocities, (q.size,))
        checks.store(self, displacements=checks.kept(q), velocities=checks.kept(v))
        if self.first_order is not None:
            checks.store(self, first_order=checks.array("first_order", self.first_order, (2, None)))


def unit_vector(name: str, value: object) -> Array:
    """`value` (3,) scaled to length 1, or InputError."""
    vector = checks.array(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise InputError(f"{name} must not be the zero vector.")
    return checks.kept(vector / length)


def unit_vectors(name: str, vectors: Array) -> Array:
    """Rows of `vectors` (n, 3) scaled to length 1; InputError for a zero one."""
    length = np.linalg.norm(vectors, axis=1)
    if np.any(length == 0):
        raise InputError(f"{name} must not be a zero vector.")
    return np.asarray(vectors / length[:, None])
