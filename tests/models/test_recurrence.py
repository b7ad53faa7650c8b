"""The residual of a Krylov model, against the residual of its motion in the assembled structure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

import antiosc as ao
from antiosc.models.recurrence import Recurrence

Array = NDArray[np.float64]
DOFS, N = 60, 5


@dataclass
class Assembled:
    """A chain of random springs and masses, struck at its end, and its Krylov model."""

    K: Array
    M: Array
    b: Array
    recurrence: Recurrence
    #: of the modes of the model, of unit mass
    omega: Array
    shapes: Array

    @property
    def root(self) -> Array:
        """(M⁻¹K)^(1/2)."""
        x, U = scipy.linalg.eigh(self.K, self.M)
        return U @ (np.sqrt(np.maximum(x, 0.0))[:, None] * (U.T @ self.M))


def assembled(free: bool, expansion: float | None) -> Assembled:
    rng = np.random.default_rng(1)
    springs = rng.uniform(1.0, 3.0, DOFS) * 1e6
    springs[0] *= not free
    K = np.diag(springs + np.append(springs[1:], 0.0))
    K -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    M = np.diag(rng.uniform(0.5, 1.0, DOFS))
    part = ao.Structure.from_matrices(sp.csr_matrix(K), sp.csr_matrix(M))
    site = ao.Site(dof=DOFS - 1)
    model = ao.extract(part, site, n=N, proof=True, expansion=expansion)
    assert model.recurrence is not None
    assert model.shapes is not None

    V = model.shapes
    x, Y = scipy.linalg.eigh(V.T @ K @ V, V.T @ M @ V)
    omega = np.sqrt(np.where(x > 1e-6, x, 0.0))
    shapes = V @ Y
    shapes *= np.where(shapes[-1] < 0, -1, 1)
    return Assembled(K, M, np.eye(DOFS)[-1], model.recurrence, omega, shapes)


def misses(part: Assembled, recurrence: Recurrence, damping: ao.Damping) -> list[float]:
    """Relative errors of what drives the error of the motion, at a random moment."""
    rng = np.random.default_rng(2)
    K, M, U = part.K, part.M, part.shapes
    modes, s = recurrence.modes(N), recurrence.shift
    sign = np.where(modes.b < 0, -1, 1)  # as the shapes here
    np.testing.assert_allclose(modes.omega, part.omega, 1e-8, 1e-5)
    d, x = damping.decay(part.omega), part.omega**2

    # a force and the motion under it, with two derivatives
    scale = 1e3
    F = rng.normal(size=3) * scale ** np.arange(3)
    q = [rng.normal(size=x.size) / scale**2, rng.normal(size=x.size) / scale]
    q.append(U.T @ part.b * F[0] - x * q[0] - 2 * d * q[1])

    # the load that the motion leaves, and the lift, under which the structure takes what K and
    # inertia leave of it
    C = damping.alpha * M + damping.beta * K + 2 * damping.ratio * M @ part.root
    left = part.b * F[0] - M @ U @ q[2] - C @ U @ q[1] - K @ U @ q[0]
    A = K + s * M
    z = [
        np.linalg.solve(A, part.b * F[i] - M @ U @ (U.T @ part.b * F[i] - x * q[i]) - K @ U @ q[i])
        for i in range(3)
    ]
    true = left - M @ z[2] - C @ z[1] - K @ z[0]

    # the same by the recurrence
    state = np.array([sign * q[0], sign * q[1], *(sign * (U.T @ part.b) * f for f in F)])
    f, rate = (modes.residual @ (state[2 + i] - (x + s) * state[i]) for i in range(2))
    w = -z[0] / (np.sign(f) * np.sqrt(z[0] @ A @ z[0]))
    drive, losses = modes.drive(damping), modes.losses(damping)
    by_inertia, (by_stiffness, by_ratio) = np.sum(drive * state), (losses * state).sum(axis=(1, 2))
    load = M @ w * by_inertia / np.sqrt(w @ M @ w)
    load += (
        2
        * damping.ratio
        * M
        @ (part.root @ w * rate - part.root @ U @ q[1] + U @ (part.omega * q[1]))
    )
    if damping.beta:
        load += 2 * np.sqrt(damping.beta / (w @ K @ w)) * K @ w * by_stiffness
    lost = damping.ratio / 2 * w @ M @ part.root @ w * rate**2

    error = np.linalg.norm(load - true) / np.linalg.norm(true)
    energy = abs(f) / np.sqrt(z[0] @ A @ z[0]) - 1
    return [error, energy, part.b @ w / np.linalg.norm(w), max(lost - by_ratio**2, 0.0)]


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("expansion", [None, 100.0])
@pytest.mark.parametrize(
    "damping", [ao.Damping(), ao.Damping(alpha=60.0, beta=1e-4), ao.Damping(0.02, 5.0, 1e-5)]
)
def test_the_residual_is_that_of_the_assembled_structure(
    free: bool, expansion: float | None, damping: ao.Damping
) -> None:
    part = assembled(free, expansion)
    np.testing.assert_allclose(misses(part, part.recurrence, damping), 0.0, atol=1e-8)


@pytest.mark.parametrize("name", ["coupling", "diagonal"])
def test_a_residual_a_tenth_too_small_is_seen(name: str) -> None:
    """β × 0.9, and the inertia of w."""
    part = assembled(False, 100.0)
    values = getattr(part.recurrence, name).copy()
    values[N] *= 0.9
    wrong = replace(part.recurrence, **{name: values})
    assert misses(part, wrong, ao.Damping(alpha=60.0, beta=1e-4))[0] > 0.04


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("expansion", [None, 100.0])
def test_what_one_ratio_leaves_is_within_its_bound(free: bool, expansion: float | None) -> None:
    part = assembled(free, expansion)
    left = part.root @ part.shapes - part.shapes * part.omega
    sizes = np.sqrt(np.einsum("ij,ij->j", left, part.M @ left))
    bounds = part.recurrence.modes(N).brake(ao.Damping(0.05)) / (2 * 0.05)
    slack = 1e-5 * part.omega.max()
    assert np.all(sizes <= bounds + slack)
    assert np.all(bounds[1:] < 30 * sizes[1:])
