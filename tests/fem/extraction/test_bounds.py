"""The claimed bounds of Z against direct solves; rigid-body motions that hardly move the site."""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg

import antiosc as ao
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.models import driving_point as bands
from antiosc.models.free_modes import error_bound, site_models
from antiosc.models.motion import with_rigid_mode
from loose_bodies import (
    exact_stiffness,
    loose_bodies,
)
from marks import FREE_ON_PURPOSE
from parts import STEEL, box


def _slide(angle: float) -> tuple[ao.Structure, ao.Site]:
    """A stack of five masses, the lowest held in y by a spring, all free to slide along x.

    It is struck at its top, across the slide but for the angle.
    """
    m, k = np.array([0.5, 0.3, 0.4, 0.2, 0.1]), np.array([4e7, 2e7, 3e7, 1e7, 2e7])
    n = len(m)
    across = np.diag(k) + np.diag(np.append(k[1:], 0.0))
    across -= np.diag(k[1:], 1) + np.diag(k[1:], -1)
    along = across - np.diag([k[0], *np.zeros(n - 1)])
    K = np.block([[along, np.zeros((n, n))], [np.zeros((n, n)), across]])
    b = np.zeros(2 * n)
    b[n - 1], b[-1] = np.sin(angle), np.cos(angle)
    M = np.diag(np.concatenate([m, m]))
    return ao.Structure.from_matrices(K, M), ao.Site(vector=b)


METHODS = ("krylov", "modes")


# --- A rigid-body motion that hardly moves the site ----------------------------------------------


ANGLES = np.geomspace(1e-1, 1e-15, 12)


def _check_forces(structure: ao.Structure, sites: list[ao.Site], n: int, method: str) -> None:
    """From one site to the next the force changes by the square of the angle, and by what the
    last of n modes adds: rounding hides the rigid motion, and another takes its place."""
    forces = []
    for site in sites:
        model = ao.extract(structure, site, n, method)
        hit = ao.simulate(model, ao.RigidMass(0.2, 1.0), ao.Hertz(1e9), duration=1e-3, step=2e-6)
        forces.append(np.interp(np.linspace(0, 1e-3, 500), hit.time, hit.force))
    for angle, (one, following) in zip(ANGLES, pairwise(forces), strict=True):
        assert np.abs(following - one).max() <= (3 * angle**2 + 2e-4) * forces[-1].max()


@FREE_ON_PURPOSE
@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("method", METHODS)
def test_force_on_a_block_is_continuous_in_the_angle_to_its_slide(method):
    rails = ao.Support(lambda x: np.isclose(x[2], 0), ["y", "z"])
    block = ao.Structure(box((4, 3, 2), (0.1, 0.06, 0.03)), ao.Solid(**STEEL), [rails])
    sites = [
        ao.Site((0.07, 0.033, 0.03), (np.sin(angle), 0, -np.cos(angle)), radius=0.025)
        for angle in [*ANGLES, 0.0]
    ]
    _check_forces(block, sites, 20, method)


def test_a_rigid_motion_of_enormous_mass_leaves_m0_in_the_impact():
    light = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.2], omega=[3e3])
    m0, m, omega, _, _ = with_rigid_mode(1e6, 0.1, light.m, light.omega, 1e-9)
    heavy = ao.AntiOscillators(m0=m0, k0=0.0, m=m, omega=omega)
    assert heavy.modal().r == 0.0  # the site is no massless point
    forces = [
        ao.simulate(one, ao.RigidMass(0.2, 1.0), ao.Hertz(1e9), duration=2e-3, step=1e-5).peak_force
        for one in (light, heavy)
    ]
    assert forces[1] == pytest.approx(forces[0], rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rigid", [0, 2])
def test_bound_of_free_modes_holds_however_little_a_rigid_motion_moves_the_site(rigid, method):
    rng = np.random.default_rng(rigid)
    omega, sites = np.sort(10 ** rng.uniform(0, 2, 30)), 12
    omega[:rigid] = 0.0
    b = rng.standard_normal((sites, 30)) * 10 ** rng.uniform(-3, 0, (sites, 30))
    b[:, :rigid] *= np.geomspace(1, 1e-15, sites)[:, None]
    shift = 0.1 * omega[rigid] ** 2 if rigid else 0.0
    C, G = b**2 @ (1 / (omega**2 + shift)), b**2 @ (1 / (omega**2 + shift) ** 2)
    known, band = (omega[:20], b[:, :20], C, G), 0.6 * omega[19]
    models = site_models(*known, 8, shift, method)
    bound = np.sum(error_bound(models, *known, band, shift), axis=0)
    w = bands.samples(band, min(omega[rigid], models.omega.min()), 0.003)
    H = b**2 @ (1 / (omega[:, None] ** 2 - w**2))
    error = np.max(np.abs(models.dynamic_stiffness(w) * H - 1), axis=1)
    assert np.all(error <= bound)
    assert np.all(bound < 20 * error + 1e-9)


# --- What rounding did --------------------------------------------------------------------------


@pytest.mark.fem
def test_modes_of_an_uneven_structure_are_orthogonal():
    K, M, b = loose_bodies(np.random.default_rng(20), 7)
    model = ao.extract(ao.Structure.from_matrices(K, M), ao.Site(vector=b), 5, "modes")
    assert model.info["checks"]["orthogonality"] < 1e-9


@pytest.mark.fem
def test_more_vectors_than_memory_holds_are_refused(monkeypatch):
    from antiosc.base import process

    structure = ao.Structure.from_matrices(_row(50), np.eye(50))
    monkeypatch.setattr(process, "free_memory", lambda: 1e4)
    # 42 vectors of 50 numbers, and M times each
    says = r"basis for n = 40 .* needs about 3.36e-05 GB .* reduce n"
    with pytest.raises(ao.OutOfMemoryError, match=says):
        ao.extract(structure, ao.Site(dof=7), 40)


@pytest.mark.fem
def test_krylov_steps_stay_orthogonal_to_rigid_motions_beside_stiff_springs():
    K, M, b = loose_bodies(np.random.default_rng(5), 5)
    structure = ao.Structure.from_matrices(K, M)
    model = ao.extract(structure, ao.Site(vector=b), len(b) - 5)
    still = structure.rigid_modes @ np.linalg.svd((structure.rigid_modes.T @ b)[None])[2][1:].T
    assert np.abs(still.T @ M @ model.shapes[:, 1:] / np.sqrt(model.m)).max() < 1e-11


# --- Loops that end -----------------------------------------------------------------------------


def _row(n: int) -> np.ndarray:
    """K of n masses between two walls."""
    k = np.linspace(1e6, 2e6, n + 1)
    return np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)


@pytest.mark.fem
def test_the_search_for_modes_ends_where_the_site_sees_none(monkeypatch):
    from antiosc.fem.extraction import eigenmodes

    monkeypatch.setattr(eigenmodes, "DENSE", 0)
    monkeypatch.setattr(eigenmodes, "DENSE_MANY", 0)
    monkeypatch.setattr(sys.modules["antiosc.fem.extraction.extract"], "SEARCHED", 1)
    K = scipy.linalg.block_diag(_row(3), _row(200))  # the site sees the first row only
    structure = ao.Structure.from_matrices(K, np.eye(203))
    site = ao.Site(dof=0)
    with pytest.warns(ao.AccuracyWarning, match="of the first 25 modes"):
        assert ao.extract(structure, site, 5, "modes").n < 5


@pytest.mark.fem
@pytest.mark.parametrize("method", METHODS)
def test_a_residual_mass_that_a_difference_would_lose(method):
    # a grain on a spring before ten tons that a soft spring holds
    K = np.array([[1e3, -1e3], [-1e3, 1e3 + 1.0]])
    structure = ao.Structure.from_matrices(K, np.diag([1e-9, 1e4]))
    model = ao.extract(structure, ao.Site(dof=0), 1, method)
    assert model.m_st == pytest.approx(1e4, rel=0.01)
    np.testing.assert_allclose(model.m0, 1e-9, rtol=1e-6)


@pytest.mark.fem
def test_full_keeps_a_resonance_of_small_static_compliance():
    structure = ao.Structure.from_matrices(np.diag([1e7, 1e4]), np.diag([1e-4, 1.0]))
    model = ao.full(structure, ao.Site(vector=[1.0, 1e-4]))
    assert model.n == 2  # 5e-4 of H at 100 rad/s, 1e-5 of it at rest


@pytest.mark.sample
@pytest.mark.fem
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("angle", [1e-1, 1e-3, 1e-4, 1e-6, 1e-7, 1e-9, 1e-12])
def test_bound_across_a_slide(angle, method):
    structure, site = _slide(angle)
    model = ao.extract(structure, site, method=method, band=2e4)
    omega = np.geomspace(10.0, 2e4, 150) * (1 + 1j * bands.DAMPING)  # the reference knows these
    K, M = (csr(a).toarray() for a in (structure.K, structure.M))
    exact = exact_stiffness(K, M, np.asarray(site.vector), omega)
    error = np.abs(model.dynamic_stiffness(omega) / exact - 1)
    assert np.max(error) <= model.info["band"]["error_bound"] < 1e-3
    assert (model.k0 == 0) == (angle > 1e-8)
