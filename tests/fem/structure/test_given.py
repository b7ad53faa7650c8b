"""Matrices of other codes: penalties as supports, and what is no stiffness or mass."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from petsc4py import PETSc

import antiosc as ao
import parts
from antiosc import fem
from mpi import run_ranks

N, STIFF = 8, 1e4


@pytest.fixture(params=["petsc", "scipy"], autouse=True)
def backend(request, monkeypatch):
    """Every test runs on both back-ends: without the packages "auto" is SciPy's."""
    if request.param == "scipy":
        monkeypatch.setattr(fem, "missing", "dolfinx")


def chain(n: int = N, free: bool = False) -> np.ndarray:
    """Springs between n masses and, unless it is free, from the first and last to the ground."""
    K = STIFF * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    if free:
        K[0, 0] = K[-1, -1] = STIFF
    return K


def refused(text: str):
    return pytest.raises(ao.InputError, match=text)


def exact(K: np.ndarray, M: np.ndarray) -> tuple[float, np.ndarray]:
    """(static stiffness, antiresonances) at the last dof, without any of our code."""
    poles = scipy.linalg.eigh(K[:-1, :-1], M[:-1, :-1], eigvals_only=True)
    return 1 / np.linalg.inv(K)[-1, -1], np.sqrt(poles)


def check(model: ao.AntiOscillators, K: np.ndarray, tol: float) -> None:
    k0, omega = exact(K, np.eye(len(K)))
    assert model.k0 == pytest.approx(k0, rel=tol)
    np.testing.assert_allclose(model.omega[:3], omega[:3], rtol=tol)


@pytest.mark.parametrize("method", ["krylov", "modes"])
@pytest.mark.parametrize("n", [2, 4, 12, 150, 700])
@pytest.mark.parametrize("penalty", [1e14, 1e18, 1e24, 1e30])
def test_a_penalty_is_a_support(penalty, n, method):
    K = chain(n + 1)
    K[-1, -1] = STIFF
    inner = K[1:, 1:].copy()
    K[0, 0] = penalty
    structure = ao.Structure.from_matrices(scipy.sparse.csr_matrix(K), scipy.sparse.identity(n + 1))
    assert structure.rigid_modes.shape[1] == 0
    model = ao.extract(structure, ao.Site(dof=n), method=method)
    check(model, inner, 10 * STIFF / penalty + 1e-9)
    if penalty >= 1e24:
        with refused("fixed by supports"):
            ao.extract(structure, ao.Site(dof=0))


@pytest.mark.sample(-1)
@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("penalty", [1e8, 1e10, 1e18, 1e24, 1e30])
def test_a_coupling_by_penalty_is_right_or_refused(penalty, free):
    """(u_3 - u_4)² times the penalty: from 1e12 of the stiffness on it drowns what it couples."""
    K = chain(free=free)
    K[3:5, 3:5] += penalty * np.array([[1, -1], [-1, 1]])
    if penalty > 1e16:
        with refused("couples dofs 3 and 4 by a penalty"):
            ao.Structure.from_matrices(K, np.eye(N))
        return
    structure = ao.Structure.from_matrices(K, np.eye(N))
    assert structure.rigid_modes.shape[1] == free
    model = ao.extract(structure, ao.Site(dof=N - 1))
    merge = np.delete(np.eye(N), 4, axis=1)  # u_4 is u_3
    merge[4, 3] = 1
    k, m = merge.T @ chain(free=free) @ merge, merge.T @ merge
    np.testing.assert_allclose(model.omega[:3], exact(k + 1e-9 * m, m)[1][:3], rtol=1e-3)
    if not free:
        assert model.k0 == pytest.approx(exact(k, m)[0], rel=1e-3)


@pytest.mark.parametrize(
    ("K", "text"),
    [
        (chain().astype(bool), "must hold real numbers; got entries of type bool"),
        (np.array([["1"]]), "must hold real numbers; got entries of type <U1"),
        (np.array([[2.0, None], [None, 2.0]]), "must hold real numbers; got entries of type obj"),
        (np.ma.masked_less(chain(), 0), "must be given without masked entries"),
        (1e-320 * np.eye(N), r"has no entry above 9.99\d+e-321"),
        (1e300 * np.eye(N), r"has an entry of 1e\+300; none may exceed 1e\+60"),
        (np.ones(3), r"must be square; got an array of shape \(3,\)"),
        (None, "must be a SciPy sparse, dense or PETSc matrix; got NoneType"),
        ([[1, 2], [3]], "must be a SciPy sparse, dense or PETSc matrix; got list"),
        (scipy.sparse.csr_matrix((0, 0)), "must be square; got 0 rows"),
        (PETSc.Mat(), "is an empty PETSc matrix, or one that was destroyed"),
        (PETSc.Mat().create(), r"is not assembled: call [KM].assemble\(\) first"),
        (PETSc.Mat().createAIJ((N, N)), "is not assembled"),
    ],
)  # fmt: skip
def test_what_is_no_matrix(K, text):
    with refused("K " + text):
        ao.Structure.from_matrices(K, np.eye(N))
    with refused("M " + text):
        ao.Structure.from_matrices(chain(), K)


def petsc(A: np.ndarray, kind: str = "aij") -> PETSc.Mat:
    matrix = PETSc.Mat().create(PETSc.COMM_SELF)
    matrix.setSizes(A.shape)
    matrix.setType(kind)
    matrix.setUp()
    for i, j in zip(*np.nonzero(A), strict=True):
        if kind != "sbaij" or j >= i:
            matrix.setValue(int(i), int(j), A[i, j])
    matrix.assemble()
    return matrix


@pytest.mark.parametrize("method", ["krylov", "modes"])
def test_dofs_without_mass(method):
    """They follow without inertia: as if condensed, also where the site is one of them."""
    massive = np.arange(N) % 2 == 0
    K, M = chain(), np.diag(massive.astype(float))
    structure = ao.Structure.from_matrices(K, M)
    model = ao.extract(structure, ao.Site(dof=N - 1), method=method)
    omega = np.array([17.0, 60.0, 130.0]) * (1 + 0.01j)
    np.testing.assert_allclose(
        model.dynamic_stiffness(omega),
        parts.direct_stiffness(K, M, np.eye(N)[-1], omega), rtol=1e-9,
    )  # fmt: skip


def test_dofs_without_stiffness_or_mass():
    K, M = chain(), np.eye(N)
    K[2] = K[:, 2] = 0
    assert ao.Structure.from_matrices(K, M).rigid_modes.shape[1] == 1  # a mass that floats
    M[2, 2] = 0
    with refused("1 dofs have neither stiffness nor mass, as dof 2"):
        ao.Structure.from_matrices(K, M)


@pytest.mark.mpi
def test_matrices_over_ranks():
    """A penalty on one rank, an asymmetry on the other, and ranges that differ."""
    script = """
        import numpy as np, antiosc as ao
        from petsc4py import PETSc
        def spread(A, rows=None):
            m = PETSc.Mat().createAIJ(((rows, 8), (rows, 8)) if rows is not None else (8, 8))
            m.setUp()
            for i in range(*m.getOwnershipRange()):
                for j in np.flatnonzero(A[i]): m.setValue(i, int(j), A[i, j])
            m.assemble()
            return m
        K = 1e4 * (2 * np.eye(8) - np.eye(8, k=1) - np.eye(8, k=-1))
        K[0, 0], K[-1, -1] = 1e30, 1e4
        M = spread(np.eye(8))
        part = ao.Structure.from_matrices(spread(K), M)
        print(part.dofs, round(ao.extract(part, ao.Site(dof=7), n=3).k0, 6))
        K[6, 5] *= 1.01
        for k, m in ((spread(K), M), (spread(K, 3 + 2 * M.comm.rank), M), (PETSc.Mat(), M)):
            try: ao.Structure.from_matrices(k, m)
            except ao.InputError as error: print(str(error)[:40])
    """
    expected = [
        "7 1428.571429", "K must be symmetric (to 1e-09 of √(a_ii ",
        "K and M must be distributed alike",
        "K is an empty PETSc matrix",
    ]  # fmt: skip
    for lines in run_ranks(2, script):
        found = lines.splitlines()
        assert len(found) == len(expected)
        assert all(a.startswith(b) for a, b in zip(found, expected, strict=True))
