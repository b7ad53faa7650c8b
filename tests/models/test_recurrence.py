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
DOFS, N = 60, 6
SITES = {1: ao.Site(dof=DOFS - 1), 2: {"end": ao.Site(dof=DOFS - 1), "middle": ao.Site(dof=30)}}
DAMPING = ao.Damping(), ao.Damping(alpha=60.0, beta=1e-4), ao.Damping(0.02, 5.0, 1e-5)


@dataclass
class Assembled:
    """A chain of random springs and masses, struck at one or two places, and its Krylov model."""

    K: Array
    M: Array
    recurrence: Recurrence
    #: (J,), (DOFS, J) of the modes of the model, of unit mass
    omega: Array
    shapes: Array

    @property
    def A(self) -> Array:
        return self.K + self.recurrence.shift * self.M

    @property
    def root(self) -> Array:
        """(M⁻¹K)^(1/2)."""
        x, U = scipy.linalg.eigh(self.K, self.M)
        return U @ (np.sqrt(np.maximum(x, 0.0))[:, None] * (U.T @ self.M))


def assembled(free: bool, expansion: float | None, sites: int) -> Assembled:
    rng = np.random.default_rng(1)
    springs = rng.uniform(1.0, 3.0, DOFS) * 1e6
    springs[0] *= not free
    K = np.diag(springs + np.append(springs[1:], 0.0))
    K -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    M = np.diag(rng.uniform(0.5, 1.0, DOFS))
    part = ao.Structure.from_matrices(sp.csr_matrix(K), sp.csr_matrix(M))
    model = ao.extract(part, SITES[sites], n=N, proof=True, expansion=expansion)  # type: ignore[arg-type]
    assert model.recurrence is not None
    assert model.shapes is not None

    V = model.shapes
    x, Y = scipy.linalg.eigh(V.T @ K @ V, V.T @ M @ V)
    omega, shapes = np.sqrt(np.where(x > 1e-6, x, 0.0)), V @ Y
    modes = model.recurrence.modes(N)
    np.testing.assert_allclose(modes.omega, omega, 1e-7, 1e-5)
    shapes *= np.sign(shapes[-1] * modes.b[:, 0])
    return Assembled(K, M, model.recurrence, omega, shapes)


def misses(part: Assembled, recurrence: Recurrence, damping: ao.Damping) -> list[float]:
    """Relative errors of what drives the error of the motion, at random moments."""
    rng = np.random.default_rng(2)
    K, M, A, U = part.K, part.M, part.A, part.shapes
    modes, s, size = recurrence.modes(N), recurrence.shift, part.omega.size
    p = modes.b.shape[1]
    B = np.eye(DOFS)[:, [DOFS - 1, 30][:p]]
    d, x = damping.decay(part.omega)[:, None], part.omega[:, None] ** 2
    stiff, ratio = x + s, damping.ratio * part.omega[:, None]

    # forces and the motion under them, with two derivatives, at 50 moments
    scale = 1e3
    F = [rng.normal(size=(p, 50)) * scale**i for i in range(3)]
    q = [rng.normal(size=(size, 50)) * scale ** (i - 2) for i in range(2)]
    b = [U.T @ B @ f for f in F]
    lag = np.where(part.omega > np.median(part.omega), 2.5 / np.maximum(part.omega, 1.0), 0.0)
    held = lag[:, None] * (x * q[1] - b[1])
    q.append(b[0] - x * q[0] - 2 * d * q[1] - held)

    # the load that the motion leaves, and the lift, under which the structure takes what K and
    # inertia leave of it
    C = damping.alpha * M + damping.beta * K + 2 * damping.ratio * M @ part.root
    left = B @ F[0] - M @ U @ q[2] - C @ U @ q[1] - K @ U @ q[0]
    z = [np.linalg.solve(A, B @ F[i] - M @ U @ (b[i] - x * q[i]) - K @ U @ q[i]) for i in range(3)]
    true = left - M @ z[2] - C @ z[1] - K @ z[0]

    # the same by the recurrence
    f = [modes.residual @ (b[i] - stiff * q[i]) for i in range(3)]
    W = -z[0] @ np.linalg.pinv(f[0], 1e-9)
    phi = f[2] + damping.alpha * f[1] - s * f[0]
    phi += s * damping.beta * modes.residual @ (stiff * q[1])
    psi = modes.residual @ b[1]
    load = M @ W @ phi + damping.beta * K @ W @ psi + 2 * damping.ratio * M @ part.root @ W @ f[1]
    load += M @ U @ held
    load -= 2 * M @ (damping.ratio * part.root @ U @ q[1] - U @ (ratio * q[1]))

    # its norms
    state = np.array([*q[:2], *b])
    drive, lost = (
        np.sum(np.einsum("kij,ijt->kt", rows, state) ** 2, axis=0)
        for rows in (modes.drive(damping, lag), modes.losses(damping))
    )
    true_drive = np.sum(W @ phi * (M @ W @ phi), axis=0)
    true_lost = damping.beta / 4 * np.sum(W @ psi * (K @ W @ psi), axis=0)
    true_lost += damping.ratio / 2 * np.sum(W @ f[1] * (M @ part.root @ W @ f[1]), axis=0)
    energy = np.sum(z[0] * (A @ z[0]), axis=0) / np.sum(f[0] ** 2, axis=0)
    moved = np.abs(B.T @ z[0]).max() / np.abs(z[0]).max()
    return [
        float(np.linalg.norm(load - true) / np.linalg.norm(true)),
        float(np.abs(energy - 1).max()),
        float(np.abs(drive / true_drive - 1).max()),
        float(np.max((true_lost - lost) / np.maximum(lost, 1e-300))) if damping.beta else 0.0,
        float(moved),
    ]


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("expansion", [None, 100.0])
@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize("sites", [1, 2])
def test_the_residual_is_that_of_the_assembled_structure(
    sites: int, damping: ao.Damping, expansion: float | None, free: bool
) -> None:
    part = assembled(free, expansion, sites)
    assert max(misses(part, part.recurrence, damping)) < 1e-7


@pytest.mark.parametrize("sites", [1, 2])
@pytest.mark.parametrize(("name", "seen"), [("coupling", 1), ("inertia", 2)])
def test_a_residual_a_tenth_too_small_is_seen(name: str, seen: int, sites: int) -> None:
    """β × 0.9, and the inertia of W."""
    part = assembled(False, 100.0, sites)
    H = part.recurrence.H.copy()
    if name == "coupling":
        H[N:, :N] *= 0.9
    else:
        H[N:, N:] *= 0.9
    wrong = replace(part.recurrence, H=H)
    found = misses(part, wrong, ao.Damping(alpha=60.0, beta=1e-4))
    assert found[seen] > 0.09


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("expansion", [None, 100.0])
@pytest.mark.parametrize("sites", [1, 2])
def test_what_one_ratio_leaves_is_within_its_bound(
    sites: int, expansion: float | None, free: bool
) -> None:
    part = assembled(free, expansion, sites)
    left = part.root @ part.shapes - part.shapes * part.omega
    sizes = np.sqrt(np.einsum("ij,ij->j", left, part.M @ left))
    bounds = part.recurrence.modes(N).brake(ao.Damping(0.05)) / (2 * 0.05)
    slack = 1e-5 * part.omega.max()
    assert np.all(sizes <= bounds + slack)
    assert np.all(bounds[1:] < 30 * sizes[1:] + slack)
