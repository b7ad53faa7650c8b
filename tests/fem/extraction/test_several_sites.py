"""One model with several sites: against direct solves, and sites alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from chains import loose_chains, receptance
from marks import FREE_ON_PURPOSE
from several import CORNERS, OMEGA, block_with_corners, sites_of

pytestmark = FREE_ON_PURPOSE

Array = NDArray[np.float64]


METHODS = ("krylov", "modes")


def _check_inverse(Z: Array, H: Array, limit: float) -> None:
    """Z is H⁻¹, with the sites scaled by their compliances at each frequency."""
    size = np.sqrt(np.abs(np.einsum("wpp->wp", H)))
    product = (Z @ H) * size[:, :, None] / size[:, None, :]
    assert np.abs(product - np.eye(H.shape[-1])).max() < limit


CASES = {
    "supported": ((12,), 1, 3),
    "free, p < r": ((5, 6, 5), 0, 2),
    "free, p = r": ((5, 7), 0, 2),
    "free, p > r": ((12,), 0, 3),
    "partly free": ((6, 6, 5), 1, 4),
    "one site": ((12,), 1, 1),
    "one site, free": ((9,), 0, 1),
}


@pytest.mark.sample
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_all_modes_are_the_structure(case, method, rng):
    sizes, held, p = CASES[case]
    K, M = loose_chains(sizes, held, rng)
    B = rng.standard_normal((len(K), p))
    structure = ao.Structure.from_matrices(K, M)
    model = ao.extract(structure, sites_of(B), len(K) - p, method)
    assert model.sites == tuple(f"s{i}" for i in range(p))
    assert model.k0.shape == model.m0.shape == (p, p)
    assert model.P.shape == (p, model.n)
    assert model.omega.shape == (model.n,)
    H = receptance(K, M, B, OMEGA)
    _check_inverse(model.dynamic_stiffness(OMEGA), H, 1e-9)
    found = model.site_modes().receptance(OMEGA)
    np.testing.assert_allclose(found, H, atol=1e-9 * np.abs(H).max())
    np.testing.assert_allclose(model.m0, np.linalg.inv(B.T @ np.linalg.solve(M, B)), rtol=1e-9)


@pytest.mark.parametrize("p", [1, 2])
def test_first_blocks_match_the_moments(p, rng):
    """N blocks of p vectors match 2N moments ΦᵀM TʲΦ of the constrained structure."""
    K, M = loose_chains((40,), 1, rng)
    B = rng.standard_normal((40, p))
    Y = np.linalg.solve(K, B)
    shapes = Y @ np.linalg.inv(B.T @ Y)
    T = np.linalg.solve(K, M) - Y @ np.linalg.solve(B.T @ Y, Y.T @ M)
    for blocks in (1, 2, 4):
        model = ao.extract(ao.Structure.from_matrices(K, M), sites_of(B), p * blocks)
        power = shapes
        for j in range(1, 2 * blocks + 2):
            power = T @ power
            exact = shapes.T @ M @ power
            moment = (model.P / model.omega ** (2 * j)) @ model.P.T
            error = np.abs(moment - exact).max() / np.abs(exact).max()
            assert error < 1e-11 if j <= 2 * blocks else error > 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_sites_that_cannot_move_independently(method, rng):
    K, M = loose_chains((14,), 1, rng)
    B = rng.standard_normal((14, 2))
    three = np.column_stack([B, 0.3 * B[:, 0] - 2 * B[:, 1]])
    model = ao.extract(ao.Structure.from_matrices(K, M), sites_of(three), 12, method)
    assert model.k0.shape == (2, 2)
    assert model.sites == ("s0", "s1", "s2")
    np.testing.assert_allclose(model.dependence @ three[:, model.info["independent"]].T, three.T)
    H = receptance(K, M, three, OMEGA)
    found = model.site_modes().receptance(OMEGA)
    np.testing.assert_allclose(found, H, atol=1e-9 * np.abs(H).max())


def test_sites_of_a_rigid_part_follow_its_motion():
    """Five sites on a structure that has two motions only."""
    K, M = 1e3 * np.array([[1.0, -1.0], [-1.0, 1.0]]), np.diag([1.0, 2.0])
    B = np.array([[1.0, 0.0, 0.5, 0.2, -0.3], [0.0, 1.0, 0.5, 0.8, 1.3]])
    model = ao.extract(ao.Structure.from_matrices(K, M), sites_of(B), 1)
    assert model.n == 0
    follow = model.dependence @ B[:, model.info["independent"]].T
    np.testing.assert_allclose(follow, B.T, atol=1e-14)


def test_a_repeated_frequency_is_kept_as_often_as_the_sites_see_it():
    """Five equal oscillators on two masses that are the sites: two of five can be told apart."""
    k, m = 1e4, 0.1
    K = np.diag([1e5, 2e5, *[k] * 5]).astype(float)
    M = np.diag([1.0, 2.0, *[m] * 5])
    for i, base in enumerate((0, 0, 1, 1, 1)):
        K[base, base] += k
        K[base, 2 + i] = K[2 + i, base] = -k
    model = ao.extract(
        ao.Structure.from_matrices(K, M), {"a": ao.Site(dof=0), "b": ao.Site(dof=1)}, 5, "modes"
    )
    assert model.n == 2
    assert model.info["modes_merged"] == 3
    np.testing.assert_allclose(model.m.sum(axis=0), np.diag([2 * m, 3 * m]), atol=1e-12)
    np.testing.assert_allclose(model.omega, np.sqrt(k / m), rtol=1e-9)


@pytest.fixture(scope="module")
def block() -> ao.Structure:
    return block_with_corners()


@pytest.mark.parametrize(
    ("sites", "words"),
    [
        ({}, "names no site"),
        ({"a:b": CORNERS["near"]}, "a text without ':'"),
        ({"": CORNERS["near"]}, "the name of a site"),
        ({1: CORNERS["near"]}, "the name of a site"),
        ({"a": (0.1, 0.02, 0.04)}, "site must be a Site"),
    ],
)
def test_bad_names(block, sites, words):
    with pytest.raises(ao.InputError, match=words):
        ao.extract(block, sites)


@pytest.mark.sample(-1)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("held", [0, 1])
def test_one_named_site_is_the_site_alone(held, method, rng):
    K, M = loose_chains((30,), held, rng)
    structure, site = ao.Structure.from_matrices(K, M), ao.Site(vector=rng.standard_normal(30))
    for n in (3, 8):
        alone = ao.extract(structure, site, n, method)
        named = ao.extract(structure, {"tip": site}, n, method)
        np.testing.assert_allclose(named.omega, alone.omega, rtol=1e-9)
        np.testing.assert_allclose(named.m[:, 0, 0], alone.m, rtol=1e-9)
        np.testing.assert_allclose(named.m0[0, 0], alone.m0, rtol=1e-9)
        np.testing.assert_allclose(named.k0[0, 0], alone.k0, rtol=1e-9)


@pytest.mark.sample(-1)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("held", [0, 1])
def test_every_truncation_is_passive(held, method, rng):
    K, M = loose_chains((25,), held, rng)
    B = rng.standard_normal((25, 3))
    structure = ao.Structure.from_matrices(K, M)
    least = np.linalg.inv(B.T @ np.linalg.solve(M, B))
    for n in range(12):
        model = ao.extract(structure, sites_of(B), n, method)
        assert model.n == n
        assert np.linalg.eigvalsh(model.m0 - least)[0] > -1e-12
        assert np.linalg.eigvalsh(model.k0)[0] > -1e-9 * np.abs(model.k0).max()
        shapes = model.shapes
        np.testing.assert_allclose(B.T @ shapes[:, :3], np.eye(3), atol=1e-11)
        np.testing.assert_allclose(shapes[:, :3].T @ M @ shapes[:, :3], model.m_st, atol=1e-11)
        np.testing.assert_allclose(shapes[:, :3].T @ M @ shapes[:, 3:], model.P, atol=1e-11)


def test_lowest_krylov_ones_are_the_antiresonances(block):
    krylov = ao.extract(block, CORNERS, 24)
    modes = ao.extract(block, CORNERS, 8, "modes")
    count = min(krylov.info["converged"], 8)
    assert count >= 5
    np.testing.assert_allclose(krylov.omega[:count], modes.omega[:count], rtol=1e-6)
    np.testing.assert_allclose(krylov.m[:count], modes.m[:count], rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(krylov.k0, modes.k0, rtol=1e-11)
    np.testing.assert_allclose(krylov.m_st, modes.m_st, rtol=1e-11)


def test_the_other_site_free_is_the_site_alone(block):
    """The receptance of a site does not depend on which others the model has."""
    both = ao.extract(block, CORNERS, 60).site_modes()
    alone = ao.extract(block, CORNERS["far"], 40)
    omega = np.linspace(0.1, 1, 20) * 1.5 * alone.omega[0] * (1 + 0.01j)
    H = both.receptance(omega)[:, 1, 1]
    np.testing.assert_allclose(H * alone.dynamic_stiffness(omega), 1.0, atol=1e-7)
