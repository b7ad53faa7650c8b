"""From derivatives by modes to those by the parameters that the bodies were given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping, ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.bodies import Impactor, RigidMass, Sphere

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


class ByMatrices(NamedTuple):
    """Derivatives by the model's matrices K and M in its own coordinates, symmetric (C, C)."""

    K: Array
    M: Array


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
    within = coupling / apart
    within.flat[:: x.size + 1] = square
    K = phi @ within @ phi.T
    M = -phi @ (within * x + np.diag(coupling.diagonal() / 2)) @ phi.T
    K[0] -= modes.r * (phi @ first)
    K[0, 0] -= modes.r**2 * by.r
    M[0] += modes.r * (phi @ (x * first))
    return ByMatrices((K + K.T) / 2, (M + M.T) / 2)


def by_model(model: AntiOscillators, modes: ModalBody, by: ByMatrices) -> Values:
    """Derivatives by m0, k0, m and omega of a model of one site.

    With a massless site there is no derivative by m0: None.
    """
    springs = by.K[0, 0] + by.K.diagonal()[1:] - 2 * by.K[0, 1:]
    return {
        "m0": None if modes.r > 0 else float(by.M[0, 0]),
        "k0": float(by.K[0, 0]),
        "m": by.M.diagonal()[1:] + model.omega**2 * springs,
        "omega": 2 * model.omega * model.m * springs,
    }


def _decay_slopes(model: AntiOscillators, omega: Array) -> Array:
    """Derivatives (J,) of the decays of free modes by their omega^2."""
    d = model.damping
    assert isinstance(d, Damping)
    ratio = d.decay(omega) - d.alpha / 2 - d.beta * omega**2 / 2  # ratio_j omega_j
    slope = np.divide(ratio, 2 * omega**2, out=np.zeros_like(omega), where=omega > 0)
    return np.asarray(slope + d.beta / 2)
