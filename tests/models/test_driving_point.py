"""Dynamic stiffness, shares and bands of models against sums written out and small matrices."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.models import driving_point as bands

M = np.array([0.3, 0.2, 0.0, 0.1])
POLES = np.array([1e4, 5e4, 7.0, 2e5])
K0, M0 = 2e3, 0.05


def stiffness(x, m, m0):
    return K0 - x * m0 - sum(x * a * p / (p - x) for a, p in zip(m, POLES, strict=True) if a > 0)


def test_a_share_is_the_change_of_z_if_the_mass_moves_to_the_site():
    found = bands.shares(K0, M0, M, POLES)
    for i in (0, 1, 3):
        x = POLES[i] * (1 + 0.01j) ** 2
        without = M.copy()
        without[i] = 0.0
        changed = stiffness(x, without, M0 + M[i]) - stiffness(x, M, M0)
        assert found[i] == pytest.approx(abs(changed / stiffness(x, M, M0)), rel=1e-10)
    assert found[2] == 0


def test_a_share_of_receptance_is_the_change_without_the_mode():
    b, poles = np.array([1.0, 0.3, 0.7]), np.array([0.0, 1e4, 9e4])
    found = bands.shares_of_receptance(b, poles)
    for i in (1, 2):
        x = poles[i] * (1 + 0.01j) ** 2
        terms = b**2 / (poles - x)
        assert found[i] == pytest.approx(abs(terms[i] / terms.sum()), rel=1e-12)
    assert found[0] == 1


@pytest.mark.parametrize(("top", "lowest"), [(1e4, 1e3), (5e2, 1e3)])
def test_samples_reach_the_top_and_no_peak_lies_between_two(top, lowest):
    x = bands.samples(top, lowest)
    assert x.real[-1] == pytest.approx(top)
    assert x.real[0] == pytest.approx(0.25 * min(top, lowest))
    np.testing.assert_allclose(x.imag / x.real, 0.01, rtol=1e-12)
    ratio = x.real[1:] / x.real[:-1]
    assert ratio.max() < np.exp(0.0100001)
    assert ratio.min() > np.exp(0.009)


def sites(p: int = 3, n: int = 4):
    rng = np.random.default_rng(3)
    root = rng.normal(size=(p, p))
    k0, m0 = root @ root.T * 1e4, np.diag(rng.uniform(0.1, 0.5, p))
    return k0, m0, rng.normal(size=(n, p)) * 0.3, np.sort(rng.uniform(1e4, 1e6, n))


def test_stiffness_at_sites_is_the_condensed_matrix():
    """Oscillators P_i on the sites: K − xM of sites and oscillators, the latter eliminated."""
    k0, m0, P, poles = sites()
    p, n = len(k0), len(poles)
    m_st = m0 + P.T @ P
    K = np.block([[k0, np.zeros((p, n))], [np.zeros((n, p)), np.diag(poles)]])
    M = np.block([[m_st, P.T], [P, np.eye(n)]])
    x = np.array([2e4, 3e5 + 1e3j])
    found = bands.stiffness_at_sites(x, k0, m0, P, poles)
    for one, Z in zip(x, found, strict=True):
        D = K - one * M
        condensed = D[:p, :p] - D[:p, p:] @ np.linalg.solve(D[p:, p:], D[p:, :p])
        np.testing.assert_allclose(Z, condensed, rtol=1e-10)


def test_semidefinite_clips_what_is_negative_on_equal_scales():
    rng = np.random.default_rng(5)
    root = rng.normal(size=(4, 3))
    sound = root @ root.T
    np.testing.assert_allclose(bands.semidefinite(sound), sound, atol=1e-14)
    scale = np.array([1.0, 1e4, 1e-3, 0.0])
    vectors = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    unit = (vectors * [1.0, 0.5, 0.2, -1e-6]) @ vectors.T
    unit /= np.sqrt(np.outer(unit.diagonal(), unit.diagonal()))
    values, turned = np.linalg.eigh(unit)
    clipped = (turned * np.maximum(values, 0.0)) @ turned.T
    full = np.array([1.0, 1e4, 1e-3, 5.0])
    found = bands.semidefinite(unit * np.outer(full, full))
    np.testing.assert_allclose(found, clipped * np.outer(full, full), rtol=1e-9)
    # a site without mass has no coupling either
    found = bands.semidefinite(unit * np.outer(scale, scale) + 1e-30)
    assert np.abs(found[3]).max() < 1e-14
    assert np.linalg.eigvalsh(found).min() > -1e-12 * np.abs(found).max()
