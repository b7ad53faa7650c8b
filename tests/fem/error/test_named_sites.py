"""The mesh's error of models with several sites, against finer meshes and single sites."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from marks import FREE_ON_PURPOSE
from parts import ALUMINIUM, STEEL, box, line, plate

pytestmark = FREE_ON_PURPOSE


def solid(share: int, *supports: ao.Support) -> ao.Structure:
    mesh = box((12 * share, 4 * share, 2 * share), (0.12, 0.04, 0.02))
    return ao.Structure(mesh, ao.Solid(**ALUMINIUM), supports)


def beam(share: int, *supports: ao.Support) -> ao.Structure:
    section = ao.Section.circle(0.02)
    return ao.Structure(
        line(0.5, 4 * share, (1.0, 0.0, 0.0)), ao.Beam(**STEEL, section=section), supports
    )


def sheet(share: int, *supports: ao.Support) -> ao.Structure:
    mesh = ao.read_mesh(plate((12 * share, 8 * share), (0.3, 0.2), "triangle").dolfinx, gdim=3)
    return ao.Structure(mesh, ao.Shell(**STEEL, thickness=4e-3), supports)


def on(height: float, *places: tuple[float, float], radius: float | None) -> dict[str, ao.Site]:
    sites = [ao.Site((x, y, height), (0, 0, -1), radius) for x, y in places]
    return dict(zip("ab", sites, strict=False))


CLAMP = ao.Support(lambda x: np.isclose(x[0], 0))
PARTS = {
    "solid": (solid, on(0.02, (0.09, 0.02), (0.05, 0.02), radius=15e-3)),
    "beam": (beam, on(0.0, (0.25, 0.0), (0.5, 0.0), radius=None)),
    "sheet": (sheet, on(0.0, (0.15, 0.1), (0.25, 0.15), radius=0.03)),
}


def compliance(model: ao.AntiOscillators) -> np.ndarray:
    return np.linalg.inv(np.atleast_2d(model.k0))


@pytest.mark.parametrize("kind", PARTS)
def test_each_site_has_the_estimate_that_it_has_by_itself(kind):
    make, sites = PARTS[kind]
    part = make(1, CLAMP)
    both = ao.extract(part, sites, n=6, error="estimate")
    assert both.strain_error.shape == (2 + both.n, 2 + both.n)
    change = compliance(both.corrected()) - compliance(both)
    for i, site in enumerate(sites.values()):
        one = ao.extract(part, site, n=6, error="estimate")
        alone = compliance(one.corrected()) - compliance(one)
        # a beam has an error of rounding: it is exact at its nodes
        assert change[i, i] == pytest.approx(alone[0, 0], rel=1e-6, abs=1e-9 / one.k0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["solid", "sheet"])
def test_the_estimate_is_about_the_error_to_a_finer_mesh(kind):
    """The whole matrix of compliances, the coupling of the sites too; and the frequencies."""
    make, sites = PARTS[kind]
    model = ao.extract(make(1, CLAMP), sites, n=8, error="estimate")
    fine = ao.extract(make(2, CLAMP), sites, n=8)
    softer = model.corrected()
    true, estimated = (compliance(one) - compliance(model) for one in (fine, softer))
    size = np.linalg.norm(true, 2)
    assert 0.8 < np.linalg.norm(estimated, 2) / size < 1.6
    assert np.linalg.norm(true - estimated, 2) < 0.6 * size
    left = np.abs(softer.omega[:3] / fine.omega[:3] - 1)
    assert (left < 0.7 * np.abs(model.omega[:3] / fine.omega[:3] - 1)).all()


def test_rigid_motions_of_a_free_part_stay():
    """Two sites see two rigid-body motions, four sites three of them and one stiffness."""
    part = solid(1)
    places = [(0.09, 0.02), (0.03, 0.025), (0.03, 0.015), (0.1, 0.015)]
    sites = [ao.Site((x, y, 0.02), (0, 0, -1), 12e-3) for x, y in places]
    for count, elastic in ((2, 0), (4, 1)):
        named = {str(i): site for i, site in enumerate(sites[:count])}
        model = ao.extract(part, named, n=6, error="estimate")
        softer = model.corrected()
        values, before = (np.linalg.eigvalsh(one.k0) for one in (softer, model))
        assert np.sum(values > 1.0) == elastic  # N/m
        assert values[-1] <= before[-1]
        np.testing.assert_allclose(softer.rigid, model.rigid)
        assert (softer.omega[:4] < model.omega[:4]).all()


def test_a_corrected_model_is_a_sum_of_reduced_matrices():
    """Z of (K⁻¹ + K⁻¹EK⁻¹)⁻¹ and of the unchanged M, in the shapes of a model by hand."""
    rng = np.random.default_rng(4)
    p, n = 2, 5
    root = rng.standard_normal((p, p + 1))
    k0, m0 = 1e5 * root @ root.T, np.diag([0.1, 0.2])
    P, omega = rng.standard_normal((p, n)), np.linspace(700.0, 4e3, n)
    K = np.zeros((p + n, p + n))
    K[:p, :p], K[p:, p:] = k0, np.diag(omega**2)
    errors = np.linalg.cholesky(K) @ rng.standard_normal((p + n, p + n)) * 0.05
    model = ao.AntiOscillators(
        m0=m0, k0=k0, P=P, omega=omega, sites=("a", "b"), strain_error=errors @ errors.T
    )
    M = np.block([[m0 + P @ P.T, P], [P.T, np.eye(n)]])
    F = np.linalg.inv(K)
    softer = np.linalg.inv(F + F @ model.strain_error @ F)
    for x in np.linspace(1e5, 2e7, 7):
        Z = np.linalg.inv(np.linalg.inv(softer - x * M)[:p, :p])
        np.testing.assert_allclose(model.corrected().dynamic_stiffness(x**0.5), Z, rtol=1e-7)
