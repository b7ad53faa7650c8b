"""Given matrices on NumPy and SciPy alone; these tests run without the finite-element packages."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import antiosc as ao
from chains import loose_chains, receptance


def chain(n: int, free: bool = False) -> list[scipy.sparse.csr_matrix]:
    """K and M of uneven masses in a row, from the ends to the ground unless it is free."""
    pair = loose_chains((n,), int(not free), np.random.default_rng(n))
    return [scipy.sparse.csr_matrix(A) for A in pair]


def scipy_structure(K, M, **more) -> ao.Structure:
    return ao.Structure.from_matrices(K, M, backend="scipy", **more)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("method", ["krylov", "modes"])
def test_all_anti_oscillators_give_the_driving_point(free, method):
    """Z of all of them is 1/(bᵀ(K - ω²M)⁻¹b)."""
    K, M = chain(24, free)
    b = np.zeros(24)
    b[7] = 1.0
    structure = scipy_structure(K, M)
    assert structure.rigid_modes.shape[1] == free
    model = ao.extract(structure, ao.Site(dof=7), n=23, method=method, tol=1e-14)
    omega = np.array([11.3, 47.1, 90.7, 133.9])
    wanted = 1 / receptance(K.toarray(), M.toarray(), b, omega)
    np.testing.assert_allclose(model.dynamic_stiffness(omega), wanted, rtol=1e-8)
    whole = ao.full(structure, ao.Site(dof=7))
    np.testing.assert_allclose(
        (whole.b**2 @ (1 / (whole.omega[:, None] ** 2 - omega**2))) * wanted, 1.0, rtol=1e-8
    )


@pytest.mark.parametrize("free", [False, True])
def test_sparse_modes_are_those_of_lapack(free):
    """Beyond the size that LAPACK takes, ARPACK's antiresonances of the pinned chain."""
    n, at = 900, 333
    K, M = chain(n, free)
    structure = scipy_structure(K, M)
    model = ao.extract(structure, ao.Site(dof=at), n=8, method="modes", tol=1e-12)
    keep = np.delete(np.arange(n), at)
    x = scipy.linalg.eigh(
        K.toarray()[np.ix_(keep, keep)], M.toarray()[np.ix_(keep, keep)], eigvals_only=True
    )
    np.testing.assert_allclose(model.omega, np.sqrt(x[:8]), rtol=1e-8)
    natural = ao.superposition(structure, ao.Site(dof=at), 6)
    free_x = np.sqrt(np.maximum(scipy.linalg.eigh(K.toarray(), M.toarray(), eigvals_only=True), 0))
    for omega in natural.omega[natural.omega > 0]:
        assert np.abs(free_x / omega - 1).min() < 1e-8
    pair = ao.extract(structure, [ao.Site(dof=at), ao.Site(dof=3)], n=8)
    assert pair[0].k0 == pytest.approx(model.k0, rel=1e-10)


ALONE = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"dolfinx", "gmsh", "petsc4py", "slepc4py", "mpi4py", "ufl",
                                  "basix", "ffcx", "matplotlib", "meshio", "threadpoolctl"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocked())
import os
for name in ("sched_getaffinity", "fchown", "fchmod", "O_CLOEXEC"):  # as on Windows
    delattr(os, name)
import numpy as np
import antiosc as ao
from antiosc.base import process
n = 30
K = 1e4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
part = ao.Structure.from_matrices(K, np.eye(n))
model = ao.extract(part, ao.Site(dof=20), n=20)
hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 5e-3)
assert hit.peak_force > 0
for wanted in (lambda: ao.Structure(None, None), lambda: ao.read_mesh,
               lambda: ao.Structure.from_matrices(K, np.eye(n), backend="petsc")):
    try:
        wanted()
    except ao.MissingDependencyError as error:
        assert "antiosc info" in str(error), error
    else:
        raise SystemExit("no error")
print(model.k0)
"""


@pytest.mark.slow
def test_extraction_without_the_packages():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", ALONE],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    K = 1e4 * (2 * np.eye(30) - np.eye(30, k=1) - np.eye(30, k=-1))
    assert float(done.stdout) == pytest.approx(1 / np.linalg.inv(K)[20, 20], rel=1e-12)


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("supported", [True, False])
def test_both_back_ends_agree(supported):
    """Parameters of a plate by both, to 1e-10; the upper Ritz pairs are not settled by either."""
    import parts

    box = parts.box((6, 3, 2))
    meshed = ao.Structure(box, ao.Solid(**parts.STEEL), [ao.Support("left")] if supported else [])
    rng = np.random.default_rng(0)
    b = rng.standard_normal(meshed.size)
    b[meshed.fixed] = 0.0
    found = []
    for backend in ("petsc", "scipy"):
        part = ao.Structure.from_matrices(meshed.K, meshed.M, backend=backend)
        site = ao.Site(vector=b)
        found.append(
            [
                ao.extract(part, site, n=12),
                ao.extract(part, site, n=6, method="modes"),
                ao.superposition(part, site, 6),
            ]
        )
        assert scipy.sparse.issparse(part.K) == (backend == "scipy")
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one.omega[:4], other.omega[:4], rtol=1e-10)
    for one, other in zip(found[0][:2], found[1][:2], strict=True):
        assert one.k0 == pytest.approx(other.k0, rel=1e-10)
        assert one.m_st == pytest.approx(other.m_st, rel=1e-10)
        omega = np.linspace(0.1, 0.9, 5) * one.omega[0]
        np.testing.assert_allclose(
            one.dynamic_stiffness(omega), other.dynamic_stiffness(omega), rtol=1e-10
        )
