"""Natural modes against dense eigenvalues, repeated ones included."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.fem.extraction import eigenmodes
from antiosc.fem.extraction.eigenmodes import DENSE, ModeSolver
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.petsc_algebra import csr

pytestmark = pytest.mark.fem


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


@pytest.mark.sample
@pytest.mark.parametrize("supported", [True, False])
def test_modes_are_those_of_the_matrices(supported):
    structure = bar(supported)
    assert structure.size > DENSE
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
    found = ModeSolver(structure).lowest(3, reach)
    assert found.omega[-1] >= reach
    np.testing.assert_allclose(found.omega, omega[: len(found.omega)], rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("n", [(8, 3, 3), (10, 2, 2)])
def test_no_mode_of_a_pair_is_missed(n):
    """What is found is the lowest part of the spectrum, wherever the search ends."""
    structure = bar(True, n)
    omega = dense(structure)
    for count in (10, 14, 15, 20, 25, 30):
        found = ModeSolver(structure).lowest(count).omega
        np.testing.assert_allclose(found, omega[: len(found)], rtol=1e-8)


@pytest.mark.parametrize("most", [eigenmodes.DENSE_MANY, 0])
def test_shapes_that_the_library_takes_for_converged_are_found_again(monkeypatch, most):
    """As SLEPc gives them where equal parts end its Krylov space: by LAPACK, or beside others."""
    structure, spoilt, usual = bar(), [], eigenmodes.lowest
    monkeypatch.setattr(eigenmodes, "DENSE_MANY", most)

    def spoiling(search):
        values, shapes = usual(search)
        if not spoilt:
            lowest = np.argsort(values)
            shapes[:, lowest[1]] += 1e-2 * shapes[:, lowest[4]]
            spoilt.append(shapes)
        return values, shapes

    monkeypatch.setattr(eigenmodes, "lowest", spoiling)
    found = ModeSolver(structure).lowest(5)
    np.testing.assert_allclose(found.omega[:5], dense(structure)[:5], rtol=1e-8)
    assert eigenmodes.residuals(structure, found).max() < 1e-6
    assert spoilt
