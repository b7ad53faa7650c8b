"""The model softened by the energies of the errors of its strains: closer to the exact structure.

A displacement element is too stiff. With the shapes psi of a model, K = diag(k0, k_i) their
stiffness and E_ij the energies of the errors of their strains, the reduced flexibility

    F = K^-1 + K^-1 E K^-1

is that of the exact structure to first order: its loads K q stay, and the strains that the mesh
lacks are added. The anti-oscillators of F and of the unchanged masses are the corrected model. The
off-diagonal terms of E matter: k0 and omega_i changed one by one have even the wrong sign. The
first column of F is the static mode; what remains of F when the site is held belongs to the
constraint modes. With k0 = 0 the first shape is a rigid motion, and only the others soften.

Elements that interpolate strains (shells) are too soft by the work of the section forces on what
the interpolation changes: this `strain_misfit`, of either sign, is added to E.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.parameters import Parameters

M = TypeVar("M", bound=Parameters)

#: Least change of the flexibility of any combination of loads, a share of it.
LEAST_CHANGE = -0.5
#: Share of an anti-oscillator in the static mass below which its mass is rounding.
MASSLESS_SHARE = 1e-12
#: Message for a model without the errors of its strains.
NO_ESTIMATE = (
    "the error of the mesh is not known: extract the model from its mesh with error='estimate'."
)


def corrected(model: M) -> M:
    """The softened model; see `AntiOscillators.corrected`."""
    E = model.strain_error
    if E is None:
        raise InputError(NO_ESTIMATE)
    if model.strain_misfit is not None:
        E = E + model.strain_misfit
    k0, static, omega, Q = _softened(model.k0, model.m, model.omega, E)
    # amplitudes of the modes of unit mass, and their inertia against the static mode; they span the
    # same shapes, and so the residual mass stays
    unit = Q / np.sqrt(model.m)[:, None]
    c = unit.T @ (model.m * static)
    turn = np.zeros((model.n + 1, model.n + 1))  # the new shapes in terms of the old ones
    turn[0, 0], turn[1:, 0], turn[1:, 1:] = 1.0, static - 1, unit * c
    kept = c**2 > MASSLESS_SHARE * (model.m0 + model.m.sum())
    turn = turn[:, np.append(True, kept)]
    p, inertia = model.participation, model.inertia
    if p is not None:  # psi_0 is what moves with m0 and all psi_i
        p = turn.T @ np.append(p.sum(), p[1:])
        p[0] -= p[1:].sum()
    if inertia is not None:
        own, hidden = np.split(inertia.momentum, [model.n + 1])
        inertia = inertia.along(np.vstack((turn.T @ own, hidden)))
    return replace(
        model,
        m0=model.m0 + float(np.sum(c[~kept] ** 2)),
        k0=k0,
        m=c[kept] ** 2,
        omega=omega[kept],
        participation=p,
        shapes=None if model.shapes is None else model.shapes @ turn,
        inertia=inertia,
        strain_error=None,
        strain_misfit=None,
    )


def _softened(k0: float, m: Array, omega: Array, E: Array) -> tuple[float, Array, Array, Array]:
    """(k0, 1 + amplitudes of psi_i in the static mode (N,), omega (N,), modes (N, N)).

    The modes are columns of unit length, of amplitudes times sqrt(m_i).
    """
    scale = np.append(0.0, 1 / (omega * np.sqrt(m)))
    if k0 > 0:
        scale[0] = k0**-0.5
    values, vectors = np.linalg.eigh(scale[:, None] * E * scale)
    # the error relative to the energy
    grown = (vectors * np.maximum(values, LEAST_CHANGE)) @ vectors.T
    F = scale[:, None] * (np.eye(len(scale)) + grown) * scale
    static, held = np.zeros(len(m)), F[1:, 1:]
    if k0 > 0:
        static = F[1:, 0] / F[0, 0]
        held = held - np.outer(F[1:, 0], static)
        k0 = 1 / float(F[0, 0])
    root = np.sqrt(m)
    theta, Q = np.linalg.eigh(root[:, None] * held * root)
    return k0, 1 + static, theta[::-1] ** -0.5, Q[:, ::-1]


def energy_error(model: Parameters, E: Array, weights: Array) -> float:
    """Share of the errors of strains in the strain energy, of amplitudes with these weights.

    E (N + 1, N + 1): the errors of the model; `weights` (N + 1, N + 1): sum of a aᵀ of the
    amplitudes a of psi_0 ... psi_N.
    """
    energy = float(np.diag(weights) @ np.append(model.k0, model.k))
    return float(np.sum(weights * E)) / energy if energy > 0 else 0.0
