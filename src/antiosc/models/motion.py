"""Rigid-body motion in space: initial motion and momentum, and its share at a site.

A rigid motion with the velocity V of a reference point p and the spin W is written t = (V, W),
shape (6,): every point x moves with V + W x (x - p). The momentum and the angular momentum of a
body about p are then, as one array of shape (6,),

    (P, L) = S t,      S (6, 6): its mass, first moments and inertia tensor about p,

and the kinetic energy t'St/2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError, NotConvergedError
from antiosc.base.texts import FieldsRepr, ReprMixin
from antiosc.engine import library

#: Share of a body's inertia below which it has none about an axis.
INERTIALESS_SHARE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Inertia(ReprMixin):
    """Inertia of a body and momentum of its coordinates, in the axes of its mesh.

    Attributes
    ----------
    point : (3,) reference point p [m] of all moments.
    matrix : (6, 6) momentum [kg m/s] and angular momentum about p [kg m^2/s] of the whole body for
        unit velocities along x, y, z and unit spins about the axes through p (S above). Entries of
        out-of-plane motions of a plane body are zero.
    momentum : (C, 6) the same for a unit velocity of each coordinate of the body.
    """

    point: Array
    matrix: Array
    momentum: Array

    def __post_init__(self) -> None:
        for name, shape in (("point", (3,)), ("matrix", (6, 6)), ("momentum", (None, 6))):
            value = checks.floats(f"inertia.{name}", getattr(self, name), shape)
            checks.store(self, **{name: checks.read_only(value)})

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
        """The inertia with `momentum` (C, 6) of other coordinates."""
        return Inertia(self.point, self.matrix, momentum)

    def rotation(self, amplitudes: Array) -> Array:
        """Mean rotation vector (n, 3) [rad] from amplitudes (n, C), or its rate from their rates.

        A rigid body with this rate has the same angular momentum about its centre. The rotation is
        zero about axes without inertia.
        """
        amplitudes = checks.floats("amplitudes", amplitudes, (None, len(self.momentum)))
        centre = self.centre
        spins = np.eye(3)
        motions = np.concatenate((np.cross(spins, self.point - centre), spins), axis=1)
        tensor = self.moved(motions @ self.matrix, centre)[:, 3:]
        turning = self.moved(self.momentum, centre)[:, 3:]
        return np.asarray(amplitudes @ turning @ np.linalg.pinv(tensor, rcond=INERTIALESS_SHARE))

    def moved(self, momenta: Array, about: Array) -> Array:
        """Momenta (P, L) (..., 6) about `about` (3,), from `momenta` about the reference point."""
        momenta = checks.floats("momenta", momenta, None)
        about = checks.floats("about", about, (3,))
        if momenta.ndim == 0 or momenta.shape[-1] != 6:
            raise InputError(f"momenta must have shape (..., 6); got {momenta.shape}.")
        P = momenta[..., :3]
        L = momenta[..., 3:]
        return np.concatenate((P, L + np.cross(self.point - about, P)), axis=-1)


@dataclass(frozen=True, repr=False)
class Motion(FieldsRepr):
    """Initial rigid-body motion of a free body: velocity + spin x (x - about).

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
                checks.store(self, **{name: tuple(checks.floats(name, value, (3,)).tolist())})

    def at(self, inertia: Inertia) -> Array:
        """Velocity and spin (6,) of the motion, for the reference point of `inertia`."""
        checks.instance("inertia", inertia, Inertia, "an Inertia")
        centre = inertia.centre if self.about is None else np.asarray(self.about)
        spin = np.asarray(self.spin)
        velocity = np.asarray(self.velocity) + np.cross(spin, inertia.point - centre)
        motion = np.concatenate((velocity, spin))

        massless = (inertia.matrix.diagonal() == 0) & (motion != 0)
        if np.any(massless):
            names = ("along x", "along y", "along z", "about x", "about y", "about z")
            impossible = ", ".join(n for n, bad in zip(names, massless, strict=True) if bad)
            raise InputError(
                f"the body has no motion {impossible} (a plane body has x, y and rz): leave it out."
            )

        return motion


@dataclass(frozen=True, eq=False, repr=False)
class ModalState(FieldsRepr):
    """Initial state of a body of a scene, in its mass-normalised modes.

    Parameters
    ----------
    displacements : array_like, shape (J,)
        Modal displacements [kg^1/2 m], in the order of the body's modes.
    velocities : array_like, shape (J,)
        Modal velocities [kg^1/2 m/s].
    first_order : array_like, shape (2, I), optional
        States of the first-order modes of a body whose damping couples its modes; needed if
        Maxwell branches have not relaxed.
    """

    displacements: Array
    velocities: Array
    first_order: Array | None = None

    def __post_init__(self) -> None:
        q = checks.floats("displacements", self.displacements, (None,))
        v = checks.floats("velocities", self.velocities, (q.size,))
        checks.store(self, displacements=checks.read_only(q), velocities=checks.read_only(v))

        if self.first_order is not None:
            states = checks.floats("first_order", self.first_order, (2, None))
            checks.store(self, first_order=states)


def unit_vector(name: str, value: object) -> Array:
    """`value` (3,) scaled to length 1, or InputError."""
    vector = checks.floats(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length == 0:
        raise InputError(f"{name} must not be the zero vector.")
    return checks.read_only(vector / length)


def unit_vectors(name: str, vectors: Array) -> Array:
    """Rows of `vectors` (n, 3) scaled to length 1; InputError if one is zero."""
    length = np.linalg.norm(vectors, axis=1)
    if np.any(length == 0):
        raise InputError(f"{name} must not be a zero vector.")
    return np.asarray(vectors / length[:, None])


def arrow_modes(k0: float, m0: float, m: Array, poles: Array) -> tuple[Array, Array]:
    """(omega^2 (J,), modes of unit mass (N + 1, J), the site first) of a model of one site.

    k0 [N/m], m0 [kg] (0 removes a mode); m, poles (N,): masses > 0, *distinct* ascending omega_i^2.
    The zeros x_j of Z(x) = k0 - x m0 - sum_i m_i x p_i/(p_i - x), one between two poles, are found
    as shifts from the nearest pole, so that p_i - x_j is never a difference of nearly equal numbers
    (as in divide-and-conquer eigensolvers). A dense eigensolver would lose low modes as m0 -> 0.
    """
    n = poles.size
    if n == 0:
        if m0 == 0:
            return np.zeros(0), np.zeros((1, 0))
        return np.array([k0 / m0]), np.array([[1 / np.sqrt(m0)]])

    size = n + (m0 > 0)
    parameters = np.array([m, poles], dtype=float)
    x = np.empty(size)
    shape = np.empty((n + 1, size))
    address, to_x, to_shape = map(library.address, (parameters, x, shape))
    status = library.library.aom_arrow_modes(k0, m0, n, address, address + 8 * n, to_x, to_shape)
    if status or not (np.isfinite(x).all() and np.isfinite(shape).all()):
        raise NotConvergedError(
            f"{status or size} of {size} free frequencies have not converged; masses or frequencies"
            f" differ too much for double precision."
        )

    return x, shape


#: Share of a rigid-body motion in the compliance b'(K + sM)^-1 b, s about a tenth of the first
#: elastic omega^2, from which it is one that moves the site: then rounding is below 1e-11 over the
#: share in Z (2e-5 at 3e-7, of random structures). One that is left out has the share times
#: s/omega^2 in H.
RIGID_SHARE = 1e-5
