"""Extraction by constraint modes against direct harmonic solves, dense eigenproblems and hand."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import antiosc as ao
import parts
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.extraction.eigenmodes import ModeSolver
from extraction_cases import CASES, LEFT, ON_TOP, SOLID, extract, free_part, load
from marks import FREE_ON_PURPOSE


def real_part(name: str) -> tuple[ao.Structure, ao.Site, int]:
    if name == "lever":
        solid = ao.Solid(**parts.ALUMINIUM, plane="stress", thickness=0.012)
        mesh = ao.read_mesh("meshes/lever.msh")
        part = ao.Structure(mesh, solid, [ao.Support("clamp")])
        return part, ao.Site((0.135, 0.0), (-0.6, 1), radius=0.004), 12
    if name == "arch":
        solid = ao.Solid(**parts.STEEL, plane="strain")
        part = ao.Structure(ao.read_mesh("meshes/arch.msh"), solid, [ao.Support("clamp")])
        top = 0.1 * np.array([np.sin(0.3), np.cos(0.3)])
        return part, ao.Site(top, (0.2, -1), radius=0.006), 12
    if name == "frame":
        beam = ao.Beam(**parts.STEEL, section=ao.Section.tube(0.04, 0.003))
        part = ao.Structure(ao.read_mesh("meshes/frame.msh"), beam, [ao.Support("feet")])
        return part, ao.Site((0.43, 0.0, 1.3), (0.2, 1, -0.5)), 20
    mesh = ao.read_mesh("meshes/bracket.step", size=0.015)
    floor = ao.Support(lambda x: np.isclose(x[2], 0))
    part = ao.Structure(mesh, ao.Solid(**parts.ALUMINIUM), [floor])
    eye = np.array([0.02, 0.03, 0.06]) + 0.018 * np.array([0, np.sin(0.4), np.cos(0.4)])
    return part, ao.Site(eye, (-0.5, -0.3, -1), snap=True), 12


pytestmark = FREE_ON_PURPOSE


@pytest.fixture(scope="module", params=list(CASES))
def case(request):
    """(structure, b, rigid modes, model with every anti-oscillator)."""
    structure, site, rigid = CASES[request.param]()
    model = extract(structure, site, structure.dofs - 1, tol=1e-13)
    return structure, load(structure, site), rigid, model


@pytest.mark.slow
def test_all_modes_give_the_direct_harmonic_solution(case):
    """Z(ω) = 1/bᵀ(K − ω²M)⁻¹b at 20 frequencies up to the middle of the anti-oscillators."""
    structure, b, rigid, model = case
    assert structure.rigid_modes.shape[1] == rigid
    top = model.omega[-1] / 2
    omega = top * np.arange(1, 21) / 20
    Z = parts.direct_stiffness(structure.K, structure.M, b, omega)
    # Relative to the terms that Z is the sum of: near its zeros they cancel.
    poles = np.abs(1 - (omega[:, None] / model.omega) ** 2)
    terms = model.k0 + omega**2 * model.m0 + (omega[:, None] ** 2 * model.m / poles).sum(axis=1)
    np.testing.assert_array_less(np.abs(model.dynamic_stiffness(omega) - Z), 1e-8 * terms)
    lowest = omega[omega < 3 * model.omega[0]]
    if len(lowest):
        plain = model.dynamic_stiffness(lowest) / Z[: len(lowest)] - 1
        assert np.abs(plain).max() < 1e-8


def test_static_quantities(case):
    structure, b, rigid, model = case
    K, M, b = free_part(structure, b)
    if not rigid:
        y = np.linalg.solve(K, b)
        assert model.k0 == pytest.approx(1 / (b @ y), rel=1e-9)
        assert model.m_st == pytest.approx(y @ M @ y / (b @ y) ** 2, rel=1e-9)
    elif model.k0 == 0:
        R = scipy.linalg.eigh(K, M)[1][:, :rigid]
        assert model.m_st == pytest.approx(1 / np.sum((b @ R) ** 2), rel=1e-6)
    else:  # it slides, but not along the impact
        y = np.linalg.lstsq(K / K.max(), b / K.max(), rcond=1e-13)[0]
        assert model.k0 == pytest.approx(1 / (b @ y), rel=1e-6)
    assert model.m.min() > 0
    assert model.m0 >= 0
    assert np.all(np.diff(model.omega) > 0)


def test_shapes_are_what_they_are_called(case):
    structure, b, _, model = case
    psi0, psi = model.shapes[:, 0], model.shapes[:, 1:]
    M, K = csr(structure.M), csr(structure.K)
    assert b @ psi0 == pytest.approx(1.0, rel=1e-10)
    reach = np.abs(psi).max(axis=0) * np.abs(b).sum()
    assert np.all(np.abs(b @ psi) < 1e-8 * reach)
    np.testing.assert_allclose(np.einsum("ij,ij->j", psi, M @ psi), model.m, rtol=1e-8)
    np.testing.assert_allclose(psi0 @ (M @ psi), model.m, rtol=1e-6)
    low = model.omega < 0.3 * model.omega[-1]
    np.testing.assert_allclose(
        np.einsum("ij,ij->j", psi, K @ psi)[low], (model.omega**2 * model.m)[low], rtol=1e-6
    )
    residual = psi0 - psi.sum(axis=1)
    assert residual @ (M @ residual) == pytest.approx(model.m0, abs=1e-8 * model.m_st)


@pytest.mark.parametrize("supports", [LEFT, (), [ao.Support("left", ("x", "z"))]],
                         ids=["supported", "free", "hinged"])  # fmt: skip
@pytest.mark.slow
def test_slepc_finds_what_a_dense_solver_finds(supports):
    """1155 dofs, too many for the dense branch: constraint modes against LAPACK on a null space."""
    structure = ao.Structure(parts.box((5, 3, 2), (0.12, 0.05, 0.04)), SOLID, supports)
    assert structure.K.getSize()[0] > 1000
    site = ON_TOP
    model = extract(structure, site, 12)
    K, M, b = free_part(structure, load(structure, site))
    basis = scipy.linalg.null_space(b[None, :])
    x, phi = scipy.linalg.eigh(basis.T @ K @ basis, basis.T @ M @ basis, subset_by_index=(0, 39))
    omega = np.sqrt(np.maximum(x, 0))
    rigid = structure.rigid_modes.shape[1]
    if rigid:
        R = scipy.linalg.eigh(K, M, subset_by_index=(0, rigid - 1))[1]
        phi_st = R @ (R.T @ b) / np.sum((R.T @ b) ** 2)
    else:
        phi_st = np.linalg.solve(K, b)
        phi_st /= b @ phi_st
    m = (phi.T @ (basis.T @ (M @ phi_st))) ** 2
    m_st = phi_st @ M @ phi_st
    omega, m = omega[omega > 1], m[omega > 1]  # without rigid motions, whose m is rounding
    # observable: a share of |Z| above 1e-8 at the mode's own frequency with one per cent of damping
    poles, at = omega**2, (omega * (1 + 0.01j)) ** 2
    parts_of_Z = m * at[:, None] * poles / (poles - at[:, None])
    Z = model.k0 - at * (m_st - m.sum()) - parts_of_Z.sum(axis=1)
    seen = np.abs(np.diag(parts_of_Z) / Z) > 1e-8
    np.testing.assert_allclose(model.omega, omega[seen][:12], rtol=1e-8)
    np.testing.assert_allclose(model.m, m[seen][:12], rtol=1e-5, atol=1e-9 * m_st)
    assert model.m_st == pytest.approx(m_st, rel=1e-8)
    assert model.n == 12
    for name, value in model.info["checks"].items():
        assert value < 1e-7, name


@pytest.mark.slow
def test_a_free_square_bar_struck_obliquely_is_a_plane_beam():
    """Bending across the impact, torsion and stretching are there, and carry nothing."""
    L = 0.8
    section = ao.Section.rectangle(0.02, 0.02)
    space = ao.Structure(parts.line(L, 8, (1, 0, 0)), ao.Beam(**parts.STEEL, section=section))
    plane = ao.Structure(parts.line(L, 8), ao.Beam(**parts.STEEL, section=section))
    oblique = extract(space, ao.Site((0.3 * L, 0, 0), (0, 3, -4)), 6)
    flat = extract(plane, ao.Site((0.3 * L, 0), (0, 1)), 6)
    np.testing.assert_allclose(oblique.omega, flat.omega, rtol=1e-7)
    np.testing.assert_allclose(oblique.m, flat.m, rtol=1e-5)
    assert oblique.m_st == pytest.approx(flat.m_st, rel=1e-9)
    assert oblique.k0 == flat.k0 == 0.0
    assert oblique.info["modes_unobservable"] > 6


# --- The bound on what the truncated modes do to Z: their mass on poles above the last known on


@cache
def bar(supported: bool = True, n: tuple[int, int, int] = (6, 2, 2)) -> ao.Structure:
    """Of square section: bending comes in pairs."""
    supports = [ao.Support("left")] if supported else []
    return ao.Structure(parts.box(n, (0.2, 0.04, 0.04)), ao.Solid(**parts.STEEL), supports)


@cache
def dense(structure: ao.Structure) -> np.ndarray:
    """Elastic frequencies of all modes."""
    free = np.setdiff1d(np.arange(structure.K.getSize()[0]), structure.fixed)
    K, M = (csr(A)[free][:, free].toarray() for A in (structure.K, structure.M))
    rigid = structure.rigid_modes.shape[1]
    return np.sqrt(np.abs(scipy.linalg.eigh(K, M, eigvals_only=True)))[rigid:]


@pytest.mark.slow
@pytest.mark.parametrize("supported", [True, False])
def test_modes_are_those_of_the_matrices(supported):
    structure = bar(supported)
    found = ModeSolver(structure).lowest(15)
    omega = dense(structure)
    assert np.min(np.diff(omega[:10]) / omega[:9]) < 1e-6  # a pair
    np.testing.assert_allclose(found.omega, omega[: len(found.omega)], rtol=1e-8)
    M_phi = multiply(structure.M, found.phi)
    np.testing.assert_allclose(found.phi.T @ M_phi, np.eye(len(found.omega)), atol=1e-10)
    np.testing.assert_allclose(structure.rigid_modes.T @ M_phi, 0, atol=1e-8)
    residual = multiply(structure.K, found.phi) - M_phi * found.omega**2
    assert np.max(np.abs(residual)) < 1e-5 * np.max(np.abs(M_phi * found.omega**2))


@pytest.mark.slow
def test_all_modes_up_to_a_frequency():
    structure = bar()
    omega = dense(structure)
    reach = 0.5 * (omega[24] + omega[25])
    found = ModeSolver(structure).lowest(3, lambda modes: modes.omega[-1] >= reach)
    assert found.omega[-1] >= reach
    np.testing.assert_allclose(found.omega, omega[: len(found.omega)], rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("n", [(4, 3, 3), (8, 2, 2)])
def test_no_mode_of_a_pair_is_missed(n):
    """What is found is the lowest part of the spectrum, wherever the search ends."""
    structure = bar(True, n)
    omega = dense(structure)
    for count in (10, 14, 15, 20, 25, 30):
        found = ModeSolver(structure).lowest(count).omega
        np.testing.assert_allclose(found, omega[: len(found)], rtol=1e-8)


@pytest.mark.slow
def test_zeros_of_the_model_are_the_free_frequencies(case):
    """The reduced system's own modes are those of the structure that move the site."""
    structure, b, rigid, model = case
    K, M, b = free_part(structure, b)
    x, phi = scipy.linalg.eigh(K, M)
    omega = np.sqrt(np.maximum(x, 0))
    omega[:rigid] = 0.0
    seen = (b @ phi) ** 2
    # groups of equal frequencies move the site together
    found = model.modal()
    assert np.all(np.diff(found.omega) >= 0)
    low = (found.omega < 0.5 * model.omega[-1]) & (found.b != 0)
    lowest, strength = found.omega[low], found.b[low] ** 2
    assert np.count_nonzero(found.omega == 0) == rigid
    assert len(lowest) > 5
    for w, s in zip(lowest, strength, strict=True):
        near = np.abs(omega - w) <= 1e-7 * w + 1e-3 * (w == 0)
        assert near.any()
        assert seen[near].sum() == pytest.approx(s, rel=1e-5, abs=1e-9 * seen.max())
    # and none that moves the site is missing
    total = seen[omega < 0.5 * model.omega[-1]].sum()
    assert strength.sum() == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize("name", ["lever", "frame"])
@pytest.mark.slow
def test_truncation_error_is_the_mass_left_out(name):
    """0 ≤ Z_N − Z ≤ ω⁴m0/(ω_N² − ω²): each mode above ω_N adds m_i ω⁴/(ω_i² − ω²) ≥ 0."""
    structure, site, n = real_part(name)
    model = extract(structure, site, n)
    assert model.n == n
    omega = model.omega[-1] / 2 * np.arange(1, 21) / 20
    Z = parts.direct_stiffness(structure.K, structure.M, load(structure, site), omega)
    excess = model.dynamic_stiffness(omega) - Z
    bound = omega**4 * model.m0 / (model.omega[-1] ** 2 - omega**2)
    rounding = 1e-8 * np.abs(Z) + 1e-8 * model.k0
    np.testing.assert_array_less(excess, bound + rounding)
    np.testing.assert_array_less(-excess, rounding)
    # The bound is not idle: a good part of it is there.
    assert excess[-1] > 1e-3 * bound[-1]


def test_a_massless_dof_has_no_frequency():
    """M may be singular: a rotation without inertia adds no anti-oscillator."""
    k = 1e4
    K = scipy.sparse.diags([[-k, -k], [2 * k, 2 * k, k], [-k, -k]], [-1, 0, 1])
    structure = ao.Structure.from_matrices(K, scipy.sparse.diags([[0.5, 0.0, 0.5]], [0]))
    model = extract(structure, ao.Site(dof=2), 2)
    # between the held mass 3 and mass 1 lie two springs in series
    np.testing.assert_allclose(model.omega, [np.sqrt((k + k / 2) / 0.5)], rtol=1e-10)
    assert model.m0 + model.m.sum() == pytest.approx(model.m_st)
