"""The anti-oscillator model of one site in free modes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from antiosc._types import Array
from antiosc.models.modal import ModalBody, arrow_modes
from antiosc.models.motion import Inertia

if TYPE_CHECKING:
    from antiosc.models.anti_oscillators import AntiOscillators

#: m0 is negligible if its own free mode lies so far above the last pole (squared frequencies).
MASSLESS_SITE = 1e-15


def modal(model: AntiOscillators) -> ModalBody:
    """The free modes of a model of one site, its hidden rigid motions in front."""
    massless = model.m0 == 0
    if model.n:
        top = float(model.omega[-1]) ** 2
        massless = model.m0 * top <= MASSLESS_SITE * (model.k0 + float(model.k.sum()))
    # equal frequencies act at the site as one mode
    poles, group = np.unique(model.omega**2, return_inverse=True)
    mass = np.zeros(poles.size)
    np.add.at(mass, group.ravel(), model.m)
    x, shape = arrow_modes(model.k0, 0.0 if massless else model.m0, mass, poles)
    shape = shape[np.concatenate(([0], 1 + group.ravel()))]
    residual = np.zeros(model.n + 1)
    if massless:
        residual[0] = 1.0 / (model.k0 + float(model.k.sum()))
    omega = np.sqrt(x)
    seen = ModalBody(
        omega=omega,
        b=shape[0],
        r=float(residual[0]),
        decay=None if model.damping is None else model.damping.decay(omega),
        weight=None if model.participation is None else shape.T @ model.participation,
        shape=shape,
        residual=residual,
        basis=None if model.shapes is None else (model.shapes,),
        amplitude=_relative(model.n),
        direction=model.direction,
    )
    return seen if model.inertia is None else _with_hidden(model, seen, model.inertia)


def _with_hidden(model: AntiOscillators, seen: ModalBody, inertia: Inertia) -> ModalBody:
    """The body with its hidden rigid-body motions as additional modes."""
    count = len(inertia.momentum) - model.n - 1
    none, own = np.zeros(count), np.eye(count)
    # in front, so that the frequencies ascend; their coordinates follow lambda
    shape = np.roll(block_diag(seen.shape, own), count, axis=1)
    amplitude = block_diag(seen.amplitude, own)
    momentum = (amplitude @ shape).T @ inertia.momentum
    basis, decay, weight = seen.basis, seen.decay, seen.weight
    if basis is not None and count:
        basis = None if model.hidden is None else (*basis, model.hidden)
    if decay is not None and model.damping is not None:
        decay = np.concatenate((none + model.damping.alpha / 2, decay))
    if model.direction is not None:
        pull = momentum[:, :3] @ model.direction
        weight = pull if weight is None else np.concatenate((pull[:count], weight))
    return replace(
        seen,
        omega=np.concatenate((none, seen.omega)),
        b=np.concatenate((none, seen.b)),
        decay=decay,
        weight=weight,
        shape=shape,
        residual=np.concatenate((seen.residual, none)),  # type: ignore[arg-type]
        basis=basis,
        amplitude=amplitude,
        inertia=inertia.along(momentum),
    )


def _relative(n: int) -> Array:
    """Amplitudes lambda_0 and lambda_i - lambda_0 of psi_0 and psi_i, Article eq. (8)."""
    turn = np.eye(n + 1)
    turn[1:, 0] = -1.0
    return turn
