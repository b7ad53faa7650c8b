"""Free modes of the anti-oscillator model of several sites.

In the coordinates u (p,), the displacements of the sites, and eta (N,), the amplitudes of the
constraint modes of unit mass, the model is

    K = diag(k0, omega_i^2),      M = [[m0 + P P', P], [P', 1]],

with the forces on u alone. Its free modes are those of the flexibility G = L^-1 M L^-T,
K + s M = L L', s > 0 only where k0 is singular: eigenvalues theta = 1/(omega^2 + s). The mass form
M^-1 K would lose the low modes to the rounding of the highest as m0 -> 0; here theta -> 0, and such
modes are what they should be, a residual compliance without inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.damping_matrix import DampingMatrix, along
from antiosc.models.parameters import Parameters

#: theta over the largest, below which a mode has no inertia.
INERTIALESS = 1e-13
#: Shift over the lowest elastic omega^2.
MODEL_SHIFT = 0.1
#: Share of k0 in k0 + s (m0 + P P'), s the lowest omega_i^2, below which a motion is rigid.
UNRESISTED = 1e-11


@dataclass(frozen=True)
class ReducedModes:
    """Mass-normalised free modes of a model of several sites.

    Attributes
    ----------
    omega : (J,) ascending, exactly 0 for rigid-body modes [rad/s].
    shape : (p + N, J) the modes in u and eta.
    residual : (p + N, p) displacements per force without inertia; its first p rows are r.
    """

    omega: Array
    shape: Array
    residual: Array


def reduced_modes(k0: Array, m0: Array, P: Array, omega: Array, rigid: Array) -> ReducedModes:
    """The free modes; `rigid` (p, q): displacements of the sites in rigid-body modes of unit mass.

    InputError where a combination of the sites has neither mass nor stiffness.
    """
    p, q = rigid.shape
    size = p + omega.size
    K, M = np.diag(np.append(np.zeros(p), omega**2)), np.eye(size)
    K[:p, :p], M[:p, :p], M[:p, p:], M[p:, :p] = k0, m0 + P @ P.T, P, P.T
    rigid_shapes = np.zeros((size, q))
    rigid_shapes[:p] = rigid
    try:
        shift = _lowest(K, M, rigid_shapes) if q else 0.0
        L = np.linalg.cholesky(K + shift * M)
    except np.linalg.LinAlgError:
        raise InputError(
            "k0 and m0 + P P' leave a combination of the sites without mass and stiffness (or are "
            "not positive semidefinite)."
        ) from None
    basis = scipy.linalg.null_space((L.T @ rigid_shapes).T) if q else np.eye(size)
    transformed = scipy.linalg.solve_triangular(L, basis, lower=True, trans="T")
    theta, vectors = np.linalg.eigh(transformed.T @ M @ transformed)
    theta, vectors = theta[::-1], vectors[:, ::-1]
    heavy = theta > INERTIALESS * theta.max(initial=0.0)
    shape = transformed @ vectors
    own = np.sqrt(theta[heavy])
    residual = shape[:, ~heavy] @ shape[:p, ~heavy].T
    elastic = np.sqrt(np.maximum(1 / theta[heavy] - shift, 0.0))
    return ReducedModes(
        omega=np.append(np.zeros(q), elastic),
        shape=np.hstack([rigid_shapes, shape[:, heavy] / own]),
        residual=residual,
    )


def rigid_motions(k0: Array, m_st: Array, omega: Array) -> Array:
    """Displacements (p, q) of the sites in the rigid-body modes of unit mass that k0 permits."""
    scale = stiffness_scale(k0, m_st, omega)
    stiff = k0 * scale[:, None] * scale
    values, vectors = np.linalg.eigh((stiff + stiff.T) / 2)
    free = scale[:, None] * vectors[:, np.abs(values) < UNRESISTED]
    mass = free.T @ m_st @ free
    root = np.linalg.cholesky(mass) if mass.size else mass
    return np.asarray(np.linalg.solve(root, free.T).T)


def stiffness_scale(k0: Array, m_st: Array, omega: Array) -> Array:
    """1/sqrt (p,) of the diagonal of k0 + s m_st, s the lowest omega^2 of the model."""
    mass, stiffness = np.abs(m_st.diagonal()), np.abs(k0.diagonal())
    s = float(omega[0]) ** 2 if omega.size else 0.0
    if s == 0.0 and np.any(mass > 0):
        s = float(np.max(stiffness[mass > 0] / mass[mass > 0]))
    return np.asarray(1 / np.sqrt(np.maximum(stiffness + s * mass, np.finfo(float).tiny)))


def _lowest(K: Array, M: Array, rigid_shapes: Array) -> float:
    """A shift of the size of the lowest elastic omega^2 of (K, M) with rigid modes."""
    weight = M @ rigid_shapes
    shift = float(np.trace(K) / np.trace(M)) or 1.0
    for _ in range(3):  # each knows the lowest to rounding over its own share in the shift
        L = np.linalg.cholesky(K + shift * M)
        half = scipy.linalg.solve_triangular(L, M - weight @ weight.T, lower=True)
        elastic = scipy.linalg.solve_triangular(L, half.T, lower=True)
        theta = float(np.linalg.eigvalsh((elastic + elastic.T) / 2).max(initial=0.0))
        if theta <= 0:
            return shift
        shift = MODEL_SHIFT * max(1 / theta - shift, 1e-9 * shift)
    return shift


#: Share of the static mass of a site that has no mass but damping: its least mass.
LEAST_MASS = 1e-8


def checked_size(model: Parameters, damping: DampingMatrix, given: Any) -> DampingMatrix:
    """The damping of a model sorted as its frequencies, which were given in another order."""
    lead, hidden = model.lead, model.hidden_count
    size = lead + model.n + hidden
    if damping.n != size:
        raise InputError(
            f"the damping of this model needs a matrix of its {size} coordinates ({lead} of sites, "
            f"{model.n} anti-oscillators, {hidden} hidden motions); got one of {damping.n}."
        )
    order = np.argsort(np.asarray(given, dtype=float), kind="stable")
    if np.array_equal(order, np.arange(order.size)):
        return damping
    rows = np.concatenate((np.arange(lead), lead + order, np.arange(lead + order.size, size)))
    return along(damping, np.eye(size)[:, rows])


def damped_modes(model: Parameters, k0: Array, m0: Array, P: Array, rigid: Array) -> ReducedModes:
    """The free modes of `reduced_modes`; a damped site without mass gets a little of it."""
    if isinstance(model.damping, DampingMatrix):
        p = len(k0)
        least = LEAST_MASS * (m0 + P @ P.T).diagonal()
        acted = sum(
            (np.sum(L[:, :p] ** 2, axis=0) for L, _ in model.damping.factors),
            np.sum(model.damping.factor[:, :p] ** 2, axis=0),
        )
        m0 = m0 + np.diag(np.where((acted > 0) & (m0.diagonal() < least), least, 0.0))
    return reduced_modes(k0, m0, P, model.omega, rigid)


def damping_of(model: Parameters, omega: Array, shape: Array | None) -> dict[str, Any]:
    """The decay or the damping of the modes (size, J) in u, eta and the hidden motions."""
    damping = model.damping
    if damping is None:
        return {"decay": None}
    if isinstance(damping, DampingMatrix):
        return {} if shape is None else {"damping": along(damping, shape)}
    return {"decay": damping.decay(omega)}
