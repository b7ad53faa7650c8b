"""From derivatives by modes to those by the parameters that the bodies were given."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping, ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.bodies.impactors import Impactor, RigidMass, Sphere

Values = dict[str, Any]


@dataclass(frozen=True, eq=False)
class ByModes:
    """Derivatives by the modes of one body, and the modes' loads and start.

    square, decay, load, start (J,); site (J,) by the displacement of its one site, r by its
    residual compliance. `v`, `g` (J,): modal velocities at the start and loads.
    """

    square: Array
    decay: Array
    site: Array
    r: float
    load: Array
    start: Array
    v: Array
    g: Array


def by_body(body: Any, modes: ModalBody, by: ByModes, closing: float) -> Values:
    """Derivatives by the parameters of a body of one site; {} for a foreign one.

    `closing`: the speed [m/s] at the start with which the body closes its contact.
    """
    found: Values = {}
    if isinstance(body, Impactor):
        found = by_body(body.body, modes, by, closing)
        found.pop("initial_velocity", None)
    elif isinstance(body, RigidMass | Sphere):
        mass = body.mass
        found["mass"] = float(by.start @ by.v + by.load @ by.g - by.site @ modes.b) / (2 * mass)
    elif isinstance(body, AntiOscillators):
        found = by_model(body, modes, by_matrices(body, modes, by))
    else:
        return {}
    velocity = getattr(body, "velocity", 0.0)
    name = "velocity" if isinstance(body, RigidMass | Sphere | Impactor) else "initial_velocity"
    if isinstance(velocity, Motion):
        return found
    speed = velocity or closing
    if speed:
        found[name] = float(by.start @ by.v) / speed
    return found


@dataclass(frozen=True, eq=False)
class ByMatrices:
    """Derivatives by the model's matrices in its own coordinates, K and M (C, C).

    The sums phi within phi' and -phi (within x + turned) phi' over the modes phi (C, J), x (J,)
    their omega^2, made symmetric; with a massless site -r phi `first` and r phi x `first` in the
    row of the site, and `corner` in its place.
    """

    phi: Array
    within: Array
    x: Array
    turned: Array
    first: Array
    r: float
    corner: float

    @cached_property
    def K(self) -> Array:
        found = self.phi @ self.within @ self.phi.T
        found[0] -= self.r * (self.phi @ self.first)
        found[0, 0] += self.corner
        return np.asarray((found + found.T) / 2)

    @cached_property
    def M(self) -> Array:
        found = -self.phi @ (self.within * self.x + np.diag(self.turned)) @ self.phi.T
        found[0] += self.r * (self.phi @ (self.x * self.first))
        return np.asarray((found + found.T) / 2)

    def lines(self) -> tuple[Array, Array, Array]:
        """The first row of K, and the diagonals of K and M (C,) each, without the matrices."""
        phi, both = self.phi, self.phi @ self.within
        at_site = self.r * (phi @ self.first)
        row = (phi @ (self.within.T @ phi[0] + self.within @ phi[0]) - at_site) / 2
        diagonal = np.einsum("ij,ij->i", both, phi)
        mass = -np.einsum("ij,ij->i", both * self.x + phi * self.turned, phi)
        corner = self.corner - at_site[0]
        row[0], diagonal[0] = diagonal[0] + corner, diagonal[0] + corner
        mass[0] += self.r * float(phi[0] @ (self.x * self.first))
        return row, diagonal, mass


def by_matrices(model: AntiOscillators, modes: ModalBody, by: ByModes) -> ByMatrices:
    """Derivatives by the matrices of a model of one site, coordinates lambda.

    The modes solve K phi = x M phi, phi' M phi = 1. With a massless site (m0 = 0) the site follows
    the others, and its compliance r is the mode without inertia.
    """
    hidden = model.hidden_count
    assert modes.shape is not None
    phi = modes.shape[: model.n + 1, hidden:]
    x = modes.omega[hidden:] ** 2
    square, site, load, start, v, g, decay = (
        each[hidden:] for each in (by.square, by.site, by.load, by.start, by.v, by.g, by.decay)
    )
    if isinstance(model.damping, Damping):
        square = square + decay * _decay_slopes(model, modes.omega)[hidden:]
    rigid = (x == 0) & (phi[0] != 0)
    moving = modes.inertia is not None
    if (
        not moving and rigid.any() and v.any()
    ):  # V b/(b b) of the one rigid mode that moves the site
        site = site.copy()
        site[rigid] -= start[rigid] * v[rigid] / phi[0, rigid]
    # loads and starts are phi' p with a given p: what the participations say; phi' M phi = 1
    first, coupling = site.copy(), np.outer(phi[0], site)  # coupling of mode k into mode j
    for slope, value in ((load, g), (start, v))[: 1 + moving]:
        if value.any():
            coupling += np.outer(value, slope)
            first += model.m0 * float(phi[0] @ value) * slope
    apart = x - x[:, None]
    apart.flat[:: x.size + 1] = 1.0
    turned = coupling.diagonal() / 2
    within = coupling / apart
    within.flat[:: x.size + 1] = square
    return ByMatrices(phi, within, x, turned, first, modes.r, -(modes.r**2) * by.r)


def by_model(model: AntiOscillators, modes: ModalBody, by: ByMatrices) -> Values:
    """Derivatives by m0, k0, m and omega of a model of one site.

    With a massless site there is no derivative by m0: None.
    """
    row, diagonal, mass = by.lines()
    springs = row[0] + diagonal[1:] - 2 * row[1:]
    return {
        "m0": None if modes.r > 0 else float(mass[0]),
        "k0": float(row[0]),
        "m": mass[1:] + model.omega**2 * springs,
        "omega": 2 * model.omega * model.m * springs,
    }


def _decay_slopes(model: AntiOscillators, omega: Array) -> Array:
    """Derivatives (J,) of the decays of free modes by their omega^2."""
    d = model.damping
    assert isinstance(d, Damping)
    ratio = d.decay(omega) - d.alpha / 2 - d.beta * omega**2 / 2  # ratio_j omega_j
    slope = np.divide(ratio, 2 * omega**2, out=np.zeros_like(omega), where=omega > 0)
    return np.asarray(slope + d.beta / 2)
