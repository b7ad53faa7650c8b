"""The corrected model against the softened matrices, solved directly."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.motion import Inertia


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


def test_a_misfit_counts_beside_the_error():
    """Of either sign: the corrected model is that of the sum."""
    given = model()
    rng = np.random.default_rng(9)
    root = np.sqrt(np.append(given.k0, given.k))
    work = rng.normal(size=(7, 7)) * 3e-4 * root * root[:, None]
    work = work + work.T
    both = given.strain_error + work
    assert np.linalg.eigvalsh(work)[0] < 0 < np.linalg.eigvalsh(both)[0]
    plain = ao.AntiOscillators(given.m0, given.k0, given.m, given.omega, strain_error=both)
    found = ao.AntiOscillators(
        given.m0,
        given.k0,
        given.m,
        given.omega,
        strain_error=given.strain_error,
        strain_misfit=work,
    )
    one, other = plain.corrected(), found.corrected()
    assert other.k0 == pytest.approx(one.k0, rel=1e-12)
    np.testing.assert_allclose(other.omega, one.omega, rtol=1e-12)
    np.testing.assert_allclose(other.m, one.m, rtol=1e-9)
    assert other.strain_misfit is None
    small = found.truncated(2)
    np.testing.assert_array_equal(small.strain_misfit, work[:3, :3])
    np.testing.assert_array_equal(small.strain_error, given.strain_error[:3, :3])


def test_all_masses_stay_and_everything_gets_softer():
    given = model()
    new = given.corrected()
    assert new.m0 == pytest.approx(given.m0, rel=1e-12)
    assert new.k0 < given.k0
    assert np.all(new.omega < given.omega)
    assert new.strain_error is None
