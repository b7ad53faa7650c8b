"""From derivatives by modes to those by the parameters that the bodies were given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping, ModalBody
from antiosc.models.motion import Motion
from antiosc.simulation.impactors import Impactor, RigidMass, Sphere

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

    phi (C, J): the modes.
    """

    K: Array
    M: Array
    phi: Array


def by_matrices(model: AntiOscillators, modes: ModalBody, by: ByModes) -> ByMatrices:
    """Derivatives by the matrices of a model of one site, coordinates lambda.

    The modes solve K phi = x M phi, phi' M phi = 1. With a massless site (m0 = 0) the site follows
    the others, and its compliance r is the mode without inertia.
    """
    hidden = model.hidden_count
    assert modes.shape is not None
    phi = modes.shape[: model.n + 1, hidden:]
    x = modes.omega[hidden:] ** 2
    inertia = np.diag(np.concatenate(([model.m0], model.m)))
    square, site, load, start, v, g, decay = (
        each[hidden:] for each in (by.square, by.site, by.load, by.start, by.v, by.g, by.decay)
    )
    if isinstance(model.damping, Damping):
        square = square + decay * _decay_slopes(model, modes.omega)[hidden:]
    by_phi = np.zeros_like(phi)
    by_phi[0] = site
    # loads and starts are phi' p with a given p: what the participations say
    by_phi += np.outer(inertia @ phi @ g, load)
    rigid = (x == 0) & (phi[0] != 0)
    if modes.inertia is not None:
        by_phi += np.outer(inertia @ phi @ v, start)
    elif rigid.any() and v.any():  # V b/(b b) of the one rigid mode that moves the site
        by_phi[0, rigid] -= start[rigid] * v[rigid] / phi[0, rigid]
    coupling = phi.T @ by_phi  # of mode k into mode j
    apart = x - x[:, None]
    np.fill_diagonal(apart, 1.0)
    mixed = coupling / apart
    np.fill_diagonal(mixed, 0.0)
    within = np.diag(square) + mixed
    by_K = phi @ within @ phi.T
    by_M = -phi @ (within * x + 0.5 * np.diag(np.diag(coupling))) @ phi.T
    if modes.r > 0:
        at_site = modes.r * (phi @ by_phi[0])
        by_K[0] -= at_site
        by_M[0] += modes.r * (phi @ (x * by_phi[0]))
        by_K[0, 0] -= modes.r**2 * by.r
    return ByMatrices((by_K + by_K.T) / 2, (by_M + by_M.T) / 2, phi)


def by_model(model: AntiOscillators, modes: ModalBody, by: ByMatrices) -> Values:
    """Derivatives by m0, k0, m and omega of a model of one site.

    With a massless site there is no derivative by m0: None.
    """
    springs = by.K[0, 0] + np.diag(by.K)[1:] - 2 * by.K[0, 1:]
    return {
        "m0": None if modes.r > 0 else float(by.M[0, 0]),
        "k0": float(by.K[0, 0]),
        "m": np.diag(by.M)[1:] + model.omega**2 * springs,
        "omega": 2 * model.omega * model.m * springs,
    }


def _decay_slopes(model: AntiOscillators, omega: Array) -> Array:
    """Derivatives (J,) of the decays of free modes by their omega^2."""
    d = model.damping
    assert isinstance(d, Damping)
    ratio = d.decay(omega) - d.alpha / 2 - d.beta * omega**2 / 2  # ratio_j omega_j
    slope = np.divide(ratio, 2 * omega**2, out=np.zeros_like(omega), where=omega > 0)
    return np.asarray(slope + d.beta / 2)
