"""The unreduced model, superposition and natural modes against direct solves and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.extraction.superposition import MOST_DENSE_ROWS
from antiosc.reduce.site import functional
from marks import FREE_ON_PURPOSE

pytestmark = FREE_ON_PURPOSE


@pytest.fixture(scope="module", params=["clamped", "sliding", "free"])
def plate(request) -> tuple[ao.Structure, ao.Site]:
    """A small plane part: held, free to slide across the impact, or free."""
    supports = {
        "clamped": [ao.Support(lambda x: np.isclose(x[0], 0))],
        "sliding": [ao.Support(lambda x: np.isclose(x[0], 0), "y")],
        "free": [],
    }[request.param]
    part = ao.Structure(
        rectangle(), ao.Solid(70e9, 0.3, 2700.0, plane="stress", thickness=0.01), supports=supports
    )
    return part, ao.Site(point=(0.31, 0.06), direction=(0, -1), radius=0.03)


def rectangle() -> ao.Mesh:
    import tempfile

    text = """
    Point(1) = {0, 0, 0}; Point(2) = {0.4, 0, 0}; Line(1) = {1, 2}; Transfinite Curve {1} = 17;
    a[] = Extrude {0, 0.06, 0} { Curve{1}; Layers{3}; Recombine; };
    Physical Surface("part") = {a[1]};
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.geo"
        path.write_text(text)
        return ao.read_mesh(path, size=0.4)


def direct(part: ao.Structure, site: ao.Site, omega: np.ndarray) -> np.ndarray:
    """bᵀ(K - ω²M)⁻¹b by dense solves."""
    b = functional(part, site).b
    free = np.setdiff1d(np.arange(len(b)), part.fixed)
    K, M = (csr(matrix)[free][:, free].toarray() for matrix in (part.K, part.M))
    return np.array([b[free] @ np.linalg.solve(K - w**2 * M, b[free]) for w in omega])


@pytest.mark.slow
@pytest.mark.sample(-1)
def test_full_is_the_direct_solution(plate):
    part, site = plate
    omega = np.array([300.0, 5e3, 4.1e4, 2e5])
    full = ao.full(part, site)
    H = full.modal().receptance(omega)
    np.testing.assert_allclose(H.real, direct(part, site, omega), rtol=1e-6)
    assert full.r == 0
    # and the anti-oscillators say the same
    model = ao.extract(part, site, n=part.dofs - 5, method="modes", tol=1e-14)
    np.testing.assert_allclose(model.dynamic_stiffness(omega) * H.real, 1, rtol=1e-5)


@pytest.mark.slow
def test_static_correction_makes_the_rest_static(plate):
    """With it the receptance errs as ω² beyond the modes kept; without, by a constant."""
    part, site = plate
    omega = np.array([500.0, 1000.0])
    H = direct(part, site, omega)
    plain = ao.superposition(part, site, 6).modal()
    corrected = ao.superposition(part, site, 6, static_correction=True).modal()
    off = np.abs(plain.receptance(omega).real - H)
    left = np.abs(corrected.receptance(omega).real - H)
    assert corrected.r == pytest.approx(off[0], rel=0.01)
    assert np.all(left < 1e-3 * off)


def test_massless_dofs_are_a_compliance():
    """A spring in series with a mass-spring: the struck dof has no mass."""
    K = np.array([[3.0, -3.0], [-3.0, 5.0]])
    M = np.diag([0.0, 2.0])
    part = ao.Structure.from_matrices(K, M)
    full = ao.full(part, ao.Site(dof=0))
    assert full.n == 1
    assert full.omega[0] == pytest.approx(1.0, rel=1e-10)
    assert full.r == pytest.approx(1 / 3, rel=1e-8)
    assert full.body.weight is None


def test_bad_input():
    part = ao.Structure.from_matrices(np.diag([1.0, 2.0]), np.eye(2))
    with pytest.raises(ao.InputError, match="n must be at most the structure's 2 dofs"):
        ao.superposition(part, ao.Site(dof=0), 3)
    import scipy.sparse as sp

    n = MOST_DENSE_ROWS + 1
    big = ao.Structure.from_matrices(sp.identity(n), sp.identity(n))
    with pytest.raises(ao.InputError, match=f"at most {MOST_DENSE_ROWS} dofs on one rank; got {n}"):
        ao.full(big, ao.Site(dof=0))


@pytest.mark.slow
def test_the_field_is_that_of_a_direct_solve(plate):
    """u = (K - ω²M)⁻¹b everywhere: by all modes, and by few with the residual shape at low ω."""
    part, site = plate
    b = functional(part, site).b
    free = np.setdiff1d(np.arange(len(b)), part.fixed)
    K, M = (csr(matrix)[free][:, free].toarray() for matrix in (part.K, part.M))

    def direct_field(omega):
        u = np.zeros(len(b))
        u[free] = np.linalg.solve(K - omega**2 * M, b[free])
        return u

    def by_modes(model, omega):
        """Modal amplitudes of a unit harmonic force: b/(ω_j² - ω²), and 1 of the residual shape."""
        residual = model.body.basis[-1][:, 0] if model.r else 0.0
        return model.shapes @ (model.b / (model.omega**2 - omega**2)) + residual

    seen = ao.full(part, site)
    few = ao.superposition(part, site, 8, static_correction=True)
    for model, omega, off in ((seen, 9e3, 1e-6), (few, 200.0, 1e-4)):
        u, exact = by_modes(model, omega), direct_field(omega)
        np.testing.assert_allclose(u, exact, atol=off * np.abs(exact).max())


@pytest.mark.slow
def test_weight_of_a_free_part_is_its_mass(plate):
    """The rigid-body mode b = 1/√m_CR feels gravity as the body it belongs to."""
    part, site = plate
    model = ao.superposition(part, site, 3)
    assert model.body.weight is not None
    if model.omega[0] == 0:
        reduced = ao.extract(part, site, n=3, method="modes")
        assert reduced.participation is not None
        total = reduced.participation.sum() / np.sqrt(reduced.m_st)
        assert model.body.weight[-model.n] == pytest.approx(total, rel=1e-8)
    else:
        assert part.rigid_modes.shape[1] < 3


@pytest.mark.slow
def test_a_pinned_beam_by_its_closed_form():
    """ω = (kπ/l)²√(EI/ρA) in both planes; effective masses 8/(kπ)² of the mass for odd k."""
    beam = ao.Beam(
        **parts.STEEL, section=ao.Section.rectangle(0.01, 0.01), orientation=(0, 0, 1), shear=False
    )
    ends = [ao.Support(name, ("x", "y", "z", "rx")) for name in ("left", "right")]
    part = ao.Structure(parts.line(1.0, 40, (1.0, 0, 0)), beam, ends)
    modes = part.natural_modes(8)
    k = np.repeat([1, 2, 3, 4], 2)
    exact = (k * np.pi) ** 2 * np.sqrt(210e9 * 0.01**2 / 12 / 7850)
    np.testing.assert_allclose(modes.omega, exact, rtol=5e-5)
    np.testing.assert_array_equal(modes.multiplicity, 2)
    np.testing.assert_allclose(modes.frequency, modes.omega / 6.283185307179586, rtol=1e-12)
    shares = modes.effective_mass[:, 1:].sum(axis=1) / modes.mass
    pairs = shares[::2] + shares[1::2]  # in the two planes together
    np.testing.assert_allclose(pairs, 2 * np.array([8, 0, 8 / 9, 0]) / np.pi**2, atol=1e-5)
    assert np.abs(modes.participation[:, 0]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False])
def test_effective_masses_sum_to_the_mass_that_moves(held):
    """Over all modes: rᵀM⁻¹r with r = M e on the free dofs; of a free part the total mass."""
    solid = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
    supports = [ao.Support("left")] if held else []
    part = ao.Structure(parts.plate((4, 2), (0.2, 0.06)), solid, supports)
    modes = ao.natural_modes(part, part.dofs)
    assert modes.n == part.dofs
    total = modes.effective_mass.sum(axis=0)
    free = np.setdiff1d(np.arange(part.rows), part.fixed)
    M = csr(part.M)[free][:, free].toarray()
    for axis in (0, 1):
        r = part.uniform_inertia(np.eye(3)[axis])[free]
        assert total[axis] == pytest.approx(r @ np.linalg.solve(M, r), rel=1e-9)
    assert total[2] == 0
    if held:
        assert np.all(total[:2] < modes.mass)
        assert np.all(total[:2] > 0.8 * modes.mass)
    else:
        np.testing.assert_allclose(total[:2], modes.mass, rtol=1e-9)
        np.testing.assert_allclose(modes.effective_mass[:3, :2].sum(axis=0), modes.mass, rtol=1e-9)
        np.testing.assert_array_equal(modes.omega[:3], 0)
        np.testing.assert_array_equal(modes.multiplicity[:3], 3)
