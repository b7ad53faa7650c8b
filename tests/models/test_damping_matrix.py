"""Models with coupling dampers, and corrected ones, against direct solves of the matrices."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.motion import Inertia

OMEGA = np.geomspace(0.05, 60.0, 40)


def psd(rng: np.random.Generator, n: int, rank: int) -> np.ndarray:
    L = rng.normal(size=(rank, n))
    return L.T @ L


def drawn(rng: np.random.Generator, k0: float | None = None) -> ao.AntiOscillators:
    """A random model of one site, with dashpots and up to two branches."""
    n = int(rng.integers(0, 7))
    C = psd(rng, n + 1, int(rng.integers(0, n + 2))) * 10 ** rng.uniform(-3, 1.5)
    branches = [
        (psd(rng, n + 1, int(rng.integers(1, 3))), 10 ** rng.uniform(-2, 1))
        for _ in range(int(rng.integers(0, 3)))
    ]
    return ao.AntiOscillators(
        m0=0.2,
        k0=float(rng.choice([0.0, 3.0])) if k0 is None else k0,
        m=rng.uniform(0.1, 1.0, n),
        omega=np.sort(rng.uniform(1.0, 10.0, n)),
        damping=ao.DampingMatrix(C, branches),
    )


def matrices(model: ao.AntiOscillators) -> tuple[np.ndarray, np.ndarray]:
    """K and M in the displacement of the site and the amplitudes of unit mass."""
    P = np.sqrt(model.m)
    M = np.eye(model.n + 1)
    M[0, 0], M[0, 1:], M[1:, 0] = model.m_st, P, P
    return np.diag(np.append(model.k0, model.omega**2)), M


def direct(model: ao.AntiOscillators, omega: np.ndarray) -> np.ndarray:
    K, M = matrices(model)
    Z = K - omega[:, None, None] ** 2 * M + model.damping.stiffness(omega)
    return np.linalg.inv(Z)[:, 0, 0]


def test_first_order_modes_have_the_receptance_of_the_matrices():
    rng = np.random.default_rng(1)
    for _ in range(40):
        model = drawn(rng)
        exact = direct(model, OMEGA)
        np.testing.assert_allclose(model.modal().receptance(OMEGA), exact, rtol=1e-6)


@pytest.mark.parametrize("c", [2.0, 2.0 * (1 + 1e-12), 50.0, 1e-9])
def test_critical_and_strong_damping_of_one_oscillator(c):
    model = ao.AntiOscillators(m0=1.0, k0=1.0, m=[], omega=[], damping=ao.DampingMatrix([[c]]))
    exact = 1 / (1 - OMEGA**2 + 1j * OMEGA * c)
    np.testing.assert_allclose(model.modal().receptance(OMEGA), exact, rtol=1e-6)


def test_several_sites_and_files(tmp_path):
    rng = np.random.default_rng(5)
    N, p = 4, 2
    P = rng.normal(size=(p, N))
    k0, m0 = psd(rng, p, 3), psd(rng, p, 3)
    omega = np.array([3.0, 1.0, 2.0, 4.0])  # sorted by the model, with the matrix
    given = ao.DampingMatrix(psd(rng, p + N, 2), [(psd(rng, p + N, 1), 0.3)])
    model = ao.AntiOscillators(m0=m0, k0=k0, P=P, omega=omega, sites=("a", "b"), damping=given)
    K, M = np.diag(np.append(np.zeros(p), omega**2)), np.eye(p + N)
    K[:p, :p], M[:p, :p], M[:p, p:], M[p:, :p] = k0, m0 + P @ P.T, P, P.T
    Z = K - OMEGA[:, None, None] ** 2 * M + given.stiffness(OMEGA)
    exact = np.linalg.inv(Z)[:, :p, :p]
    model.save(tmp_path / "model.npz")
    for one in (model, ao.AntiOscillators.load(tmp_path / "model.npz")):
        np.testing.assert_allclose(one.site_modes().receptance(OMEGA), exact, rtol=1e-7)


@pytest.mark.slow
def test_truncated_models_and_all_others_are_passive():
    rng = np.random.default_rng(2)
    for _ in range(15):
        model = drawn(rng)
        for n in range(model.n + 1):
            H = model.truncated(n).modal().receptance(OMEGA)
            assert (H.imag <= 1e-12 * np.abs(H)).all()  # Re Z/(i omega) >= 0


def test_repeated_frequencies_stay_apart():
    """Two equal anti-oscillators with different damping are not merged into one."""
    C = np.diag([0.1, 0.2, 0.0, 0.3])
    model = ao.AntiOscillators(
        m0=1.0, k0=2.0, m=[1.0, 2.0, 2.0], omega=[1.0, 1.0, 3.0], damping=ao.DampingMatrix(C)
    )
    np.testing.assert_allclose(model.modal().receptance(OMEGA), direct(model, OMEGA), rtol=1e-8)


def model(n=6, k0=3e5, share=0.03, seed=1, **more) -> ao.AntiOscillators:
    """A model whose strains have errors of about this share of the energy."""
    rng = np.random.default_rng(seed)
    m, omega = rng.uniform(0.1, 1.0, n), np.sort(rng.uniform(500.0, 9e3, n))
    root = np.sqrt(np.append(k0, m * omega**2))
    errors = rng.normal(size=(n + 1, n + 3)) * root[:, None] * np.sqrt(share / (n + 3))
    E = errors @ errors.T
    return ao.AntiOscillators(m0=0.2, k0=k0, m=m, omega=omega, strain_error=E, **more)


def softened_matrices(given: ao.AntiOscillators) -> tuple[np.ndarray, np.ndarray]:
    """(K^-1 + K^-1 E K^-1)^-1 and M in terms of psi_0 ... psi_N."""
    F = np.diag(1 / np.append(given.k0, given.k))
    M = np.diag(np.append(given.m_st, given.m))
    M[0, 1:] = M[1:, 0] = given.m
    return np.linalg.inv(F + F @ given.strain_error @ F), M


@pytest.mark.parametrize("seed", range(4))
def test_corrected_model_has_the_dynamic_stiffness_of_the_softened_matrices(seed):
    given = model(seed=seed)
    K, M = softened_matrices(given)
    omega = np.linspace(10.0, 1.2 * given.omega[-1], 40)
    direct = [1 / np.linalg.inv(K - w**2 * M)[0, 0] for w in omega]
    np.testing.assert_allclose(given.corrected().dynamic_stiffness(omega), direct, rtol=1e-7)


def test_a_free_body_keeps_its_rigid_motion():
    given = model(k0=0.0)
    assert np.all(given.strain_error[0] == 0)
    new = given.corrected()
    K, M = softened_matrices(model())  # of the right shape; the stiffness follows
    F = np.diag(1 / given.k)
    K = np.zeros_like(K)
    K[1:, 1:] = np.linalg.inv(F + F @ given.strain_error[1:, 1:] @ F)
    M = np.diag(np.append(given.m_st, given.m))
    M[0, 1:] = M[1:, 0] = given.m
    omega = np.linspace(50.0, given.omega[-1], 30)
    direct = [1 / np.linalg.inv(K - w**2 * M)[0, 0] for w in omega]
    assert new.k0 == 0
    assert new.m_st == pytest.approx(given.m_st, rel=1e-12)
    np.testing.assert_allclose(new.dynamic_stiffness(omega), direct, rtol=1e-7)


def test_shapes_momentum_and_participation_follow():
    rng = np.random.default_rng(2)
    n, dofs = 6, 9
    shapes, loads = rng.normal(size=(dofs, n + 1)), rng.normal(size=(dofs, 6))
    hidden = rng.normal(size=(dofs, 1))
    momentum = np.vstack((shapes.T @ loads, hidden.T @ loads))
    inertia = Inertia(np.zeros(3), np.eye(6), momentum)
    parts = shapes.T @ loads[:, 2]
    parts[0] -= parts[1:].sum()
    given = model(
        k0=0.0, shapes=shapes, hidden=hidden, inertia=inertia, participation=parts,
        direction=(0, 0, 1),
    )  # fmt: skip
    new = given.corrected()
    moved = new.shapes.T @ loads
    np.testing.assert_allclose(new.inertia.momentum[:-1], moved, atol=1e-10)
    np.testing.assert_array_equal(new.inertia.momentum[-1], momentum[-1])
    assert new.participation[0] + new.participation[1:].sum() == pytest.approx(moved[0, 2])
    np.testing.assert_allclose(new.participation[1:], moved[1:, 2], atol=1e-10)
