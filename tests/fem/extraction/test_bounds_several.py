"""The claimed bounds of Z of p ≥ 1 sites against eliminations in extended precision."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import block_diag, solve_triangular

import antiosc as ao
from antiosc.models import driving_point as bands
from chains import loose_chains
from loose_bodies import (
    check_bounds,
    elastic_frequencies,
    exact_receptances,
    loose_bodies,
    more_loads,
)
from several import sites_of

Array = NDArray[np.float64]
METHODS = ("krylov", "modes")


def _frequencies(model: ao.AntiOscillators) -> NDArray[np.complex128]:
    """Damped frequencies over the band, others than those at which the bound was found."""
    bottom, top = model.info["band"]["bottom"], model.info["band"]["top"]
    own = model.omega[(model.omega < top) & (model.omega > bottom)]
    return np.append(own, np.geomspace(bottom, top, 40)) * (1 + 1j * bands.DAMPING)


def _error(model: ao.AntiOscillators, H: Array, L: Array, omega: Array) -> Array:
    """‖HZ - 1‖ (W,) of sites in units in which their compliances are the identity."""
    Z = np.asarray(L.T @ model.dynamic_stiffness(omega) @ L)
    inverse = solve_triangular(L, np.eye(len(L)), lower=True)  # to rounding of each entry
    error = (inverse @ H @ inverse.T).astype(complex) @ Z - np.eye(len(L))
    return np.asarray(np.linalg.norm(error, 2, axis=(1, 2)))


def _extracted(seed: int) -> tuple[float, float, str]:
    """(largest error of Z over a band, claimed bound, what was extracted) of a random structure."""
    rng = np.random.default_rng(seed)
    rigid, method, p = seed % 8, METHODS[seed // 8 % 2], 1 + seed // 16 % 4
    K, M, b = loose_bodies(rng, rigid)
    B = more_loads(rng, K, b, p)
    band = float(rng.choice(elastic_frequencies(K, M, rigid))) * rng.uniform(0.5, 2)
    n = int(rng.integers(1, min(8, len(b)))) if rng.integers(2) else None
    sites = {f"s{i}": ao.Site(vector=column) for i, column in enumerate(B.T)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        structure = ao.Structure.from_matrices(K, M)
        model = ao.extract(structure, sites, n, method, band=band)
    kept = model.info["independent"]
    omega = _frequencies(model)
    H, other = exact_receptances(K, M, B[:, kept], omega)
    C = B[:, kept].T @ structure.factorize().solve_block(B[:, kept])
    L = np.linalg.cholesky((C + C.T) / 2)
    error = _error(model, H, L, omega)
    doubt = np.abs(error - _error(model, other, L, omega))
    what = f"seed {seed}: {method}, n = {n}, {rigid} rigid-body modes, {len(kept)} of {p} sites"
    return float(np.max(error - 10 * doubt)), model.info["band"]["error_bound"], what


@pytest.mark.slow
def test_bound_over_the_band_holds_for_forty():
    check_bounds(_extracted, range(40), 1 / 4)


def _stack(angle: float) -> tuple[Array, Array, Array]:
    """K, M and the loads of two sites of a stack of masses that slides along x, held in y.

    The sites push across the slide, the first but for the angle.
    """
    m, k = np.array([0.5, 0.3, 0.4, 0.2, 0.1]), np.array([4e7, 2e7, 3e7, 1e7, 2e7])
    across = np.diag(k) + np.diag(np.append(k[1:], 0.0))
    across -= np.diag(k[1:], 1) + np.diag(k[1:], -1)
    along = across - np.diag([k[0], 0, 0, 0, 0])
    B = np.zeros((10, 2))
    B[4, 0], B[9, 0], B[7, 1] = np.sin(angle), np.cos(angle), 1.0
    return block_diag(along, across), np.diag(np.concatenate([m, m])), B


@pytest.mark.sample
@pytest.mark.parametrize("angle", [1e-1, 1e-3, 1e-5, 1e-7])
def test_a_rigid_motion_that_hardly_moves_the_sites_is_beside(angle):
    K, M, B = _stack(angle)
    sites = {"top": ao.Site(vector=B[:, 0]), "middle": ao.Site(vector=B[:, 1])}
    model = ao.extract(ao.Structure.from_matrices(K, M), sites, 8, tol=1e-8)
    assert np.any(model.slide) == (angle < 1e-2)
    assert model.rigid.shape[1] == (angle > 1e-2)
    omega = np.geomspace(1.0, 2e4, 60) * (1 + 1j * bands.DAMPING)
    H, _ = exact_receptances(K, M, B, omega)
    found = model.site_modes().receptance(omega)
    size = np.sqrt(np.abs(np.einsum("wpp->wp", H)).astype(float))
    assert np.abs((found - H) / size[:, :, None] / size[:, None, :]).max() < 1e-6
    product = H @ model.dynamic_stiffness(omega) * size[:, None, :] / size[:, :, None]
    assert np.abs(product - np.eye(2)).max() < 1e-6
    assert np.sum(model.site_modes().omega == 0) == 1


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.slow
@pytest.mark.parametrize("held", [0, 1])
def test_bound_of_what_krylov_steps_leave_out(held, p, rng):
    K, M = loose_chains((80,), held, rng)
    B = np.eye(80)[:, [40, 23][:p]]
    structure, band = ao.Structure.from_matrices(K, M), 80.0
    L = np.linalg.cholesky(B.T @ structure.factorize().solve_block(B))
    ratios = []
    for n in range(5, 26, 3):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AccuracyWarning)  # fewer than the band needs
            model = ao.extract(structure, sites_of(B), n, band=band, accuracy=1e-13)
        omega = np.linspace(model.info["band"]["bottom"], band, 120) * (1 + 1j * bands.DAMPING)
        H = np.array([B.T @ np.linalg.solve(K - w**2 * M, B) for w in omega])
        error, bound = _error(model, H, L, omega).max(), model.info["band"]["error_bound"]
        if 1e-9 < error < 1e-1:
            ratios.append(bound / error)
    assert len(ratios) >= 2
    assert min(ratios) >= 1
    # 1/|sin arg z| is 50 at one per cent of damping; ‖H‖‖ΔZ‖ is far above ‖HΔZ‖ where one
    # combination of several sites resonates and others do not
    assert min(ratios) <= (50 if p == 1 else 1e4)
