"""Free modes of the anti-oscillator model of one site or several: a body of an impact.

`arrow_modes` finds them for one site. With the displacements u (p,) of several sites, and the
amplitudes eta (N,) of the constraint modes of unit mass, the model is

    K = diag(k0, omega_i^2),      M = [[m0 + P P', P], [P', 1]],

with forces on u only. Its free modes are the eigenvectors of the flexibility G = L^-1 M L^-T, where
K + s M = L L' and s > 0 only if k0 is singular; the eigenvalues are theta = 1/(omega^2 + s). With
M^-1 K, rounding of the highest modes would spoil the low modes as m0 -> 0; here theta -> 0, and
such high modes correctly become a residual compliance without inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.damping import DampingMatrix, in_coordinates
from antiosc.models.modal import ModalBody, SiteModes, unchecked_body
from antiosc.models.motion import arrow_modes
from antiosc.models.parameters import Parameters

#: theta over the largest, below which a mode has no inertia.
INERTIALESS_THETA = 1e-13
#: Shift over the lowest elastic omega^2.
SHIFT_RATIO = 0.1
#: Share of the static mass of a site that has no mass but damping: its least mass.
LEAST_MASS_SHARE = 1e-8
#: m0 is negligible if its own free mode lies so far above the last pole (squared frequencies).
MASSLESS_RATIO = 1e-15


def free_modes(model: Parameters) -> ModalBody | SiteModes:
    """The free modes of a model in lambda (one site) or in u and eta; hidden motions come first."""
    p, hidden = model.n_sites, model.hidden_count

    # coordinates from u and eta, amplitudes of shapes from these (Article (8))
    of_lambda = np.diag(model.unit)
    to_shapes = np.eye(len(of_lambda))
    if not model.sites:
        of_lambda[1:, 0] = 1.0
        to_shapes[1:, 0] = -1.0

    if model.sites or isinstance(model.damping, DampingMatrix):
        found = _damped_modes(model)
        shape, residual = of_lambda @ found.shape, of_lambda @ found.residual
    else:
        found = _modes_at_one_site(model)
        shape, residual = found.shape, found.residual

    # with the hidden motions
    shape = _with_hidden(shape, hidden)
    residual = np.vstack((residual, np.zeros((hidden, p))))
    omega = np.concatenate((np.zeros(hidden), found.omega))
    decay = damping = None
    if isinstance(model.damping, DampingMatrix):
        damping = in_coordinates(model.damping, _with_hidden(found.shape, hidden))
    elif model.damping is not None:
        decay = model.damping.decay(omega)

    # what the body carries
    to_shapes = np.roll(_with_hidden(to_shapes, hidden), -hidden, axis=1)  # these last
    inertia = weight = None
    if model.inertia is not None:
        inertia = model.inertia.along((to_shapes @ shape).T @ model.inertia.momentum)
    if model.participation is not None and (inertia is None or not model.sites):
        weight = shape[: len(model.participation)].T @ model.participation
    if inertia is not None and model.direction is not None and not model.sites:
        weight = inertia.momentum[:, :3] @ model.direction
    blocks = (model.shapes, model.hidden)[: 1 + (hidden > 0)]

    known: dict[str, Any] = {
        "omega": omega,
        "decay": decay,
        "damping": damping,
        "weight": weight,
        "shape": shape,
        "inertia": inertia,
        "basis": None if any(block is None for block in blocks) else blocks,
    }
    if not model.sites:
        return unchecked_body(
            b=shape[0],
            r=float(residual[0, 0]),
            residual=residual[:, 0],
            amplitude=to_shapes,
            direction=model.direction,
            **known,
        )

    assert model.dependence is not None
    residual = residual @ model.dependence.T
    r = model.dependence @ residual[:p]
    local = dict(zip(model.sites, model.local_compliance.tolist(), strict=True))

    return SiteModes(
        b=shape[:p].T @ model.dependence.T,
        sites=model.columns,
        r=(r + r.T) / 2,
        residual=residual,
        directions=model.direction,
        local_compliance={name: value for name, value in local.items() if value},
        **known,
    )


def _with_hidden(shape: Array, hidden: int) -> Array:
    """`shape` (size, J) with `hidden` rows appended; the modes of these rows are put first."""
    padded = np.pad(shape, ((0, hidden), (hidden, 0)))
    padded[len(shape) :, :hidden] = np.eye(hidden)
    return padded


def _modes_at_one_site(model: Parameters) -> ReducedModes:
    """Free modes of the undamped model of one site, in the coordinates lambda."""
    poles = model.omega**2
    mass = model.m
    group = None
    stiffness = model.k0 + float((poles * mass).sum())
    massless = model.m0 == 0
    if model.n:
        massless = model.m0 * float(model.omega[-1]) ** 2 <= MASSLESS_RATIO * stiffness

    is_distinct = poles[1:] > poles[:-1]
    if not is_distinct.all():  # equal frequencies act at the site as one mode
        group = np.append([0, 1], 1 + np.cumsum(is_distinct))
        mass = np.asarray(np.bincount(group[1:], weights=mass)[1:], dtype=float)
        poles = np.append(poles[0], poles[1:][is_distinct])

    x, shape = arrow_modes(model.k0, 0.0 if massless else model.m0, mass, poles)
    residual = np.zeros((model.n + 1, 1))
    if massless:
        residual[0] = 1.0 / stiffness
    return ReducedModes(np.sqrt(x), shape if group is None else shape[group], residual)


def _damped_modes(model: Parameters) -> ReducedModes:
    """Free modes of a model in u and eta; a massless site gets a little mass if a damper acts."""
    m0, P = model.m0_matrix, model.inertias

    if isinstance(model.damping, DampingMatrix):
        p = len(m0)
        floor = LEAST_MASS_SHARE * (m0 + P @ P.T).diagonal()
        acted = sum(
            (np.sum(L[:, :p] ** 2, axis=0) for L, _ in model.damping.factors),
            np.sum(model.damping.factor[:, :p] ** 2, axis=0),
        )
        m0 = m0 + np.diag(np.where((acted > 0) & (m0.diagonal() < floor), floor, 0.0))

    return reduced_modes(model.k0_matrix, m0, P, model.omega, model.rigid_modes)


@dataclass(frozen=True, eq=False)
class ReducedModes:
    """Free modes of unit mass of a model, in u and eta, or in lambda for one site."""

    omega: Array  # (J,) ascending, exactly 0 for rigid-body modes [rad/s]
    shape: Array  # (p + N, J) the modes in u and eta
    residual: Array  # (p + N, p) displacements per force without inertia; its first p rows are r


def reduced_modes(k0: Array, m0: Array, P: Array, omega: Array, rigid: Array) -> ReducedModes:
    """Free modes of a model; `rigid` (p, q): displacements of sites in its rigid-body modes."""
    p, q = rigid.shape
    size = p + omega.size
    K = np.diag(np.append(np.zeros(p), omega**2))
    M = np.eye(size)
    K[:p, :p] = k0
    M[:p, :p] = m0 + P @ P.T
    M[:p, p:] = P
    M[p:, :p] = P.T
    rigid_shapes = np.zeros((size, q))
    rigid_shapes[:p] = rigid

    try:
        shift = _spectral_shift(K, M, rigid_shapes) if q else 0.0
        L = np.linalg.cholesky(K + shift * M)
    except np.linalg.LinAlgError:
        raise InputError(
            "k0 and m0 + P P' leave a combination of the sites without mass and stiffness (or are "
            "not positive semidefinite)."
        ) from None

    from scipy.linalg import null_space, solve_triangular

    basis = null_space((L.T @ rigid_shapes).T) if q else np.eye(size)
    transformed = solve_triangular(L, basis, lower=True, trans="T")
    theta, vectors = np.linalg.eigh(transformed.T @ M @ transformed)
    theta = theta[::-1]
    vectors = vectors[:, ::-1]
    heavy = theta > INERTIALESS_THETA * theta.max(initial=0.0)
    shape = transformed @ vectors
    omega_of_shapes = np.sqrt(theta[heavy])
    residual = shape[:, ~heavy] @ shape[:p, ~heavy].T
    elastic = np.sqrt(np.maximum(1 / theta[heavy] - shift, 0.0))
    return ReducedModes(
        omega=np.append(np.zeros(q), elastic),
        shape=np.hstack([rigid_shapes, shape[:, heavy] / omega_of_shapes]),
        residual=residual,
    )


def _spectral_shift(K: Array, M: Array, rigid_shapes: Array) -> float:
    """Shift s: SHIFT_RATIO times an estimate of the lowest elastic omega^2 of (K, M)."""
    from scipy.linalg import solve_triangular

    weight = M @ rigid_shapes
    shift = float(np.trace(K) / np.trace(M)) or 1.0
    for _ in range(3):  # each knows the lowest to rounding over its own share in the shift
        L = np.linalg.cholesky(K + shift * M)
        half = solve_triangular(L, M - weight @ weight.T, lower=True)
        elastic = solve_triangular(L, half.T, lower=True)
        theta = float(np.linalg.eigvalsh((elastic + elastic.T) / 2).max(initial=0.0))
        if theta <= 0:
            return shift
        shift = SHIFT_RATIO * max(1 / theta - shift, 1e-9 * shift)

    return shift
