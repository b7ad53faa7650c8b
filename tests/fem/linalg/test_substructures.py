"""The factor over several ranks: a least interface, S, failure that all ranks hear of."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
import scipy.sparse

from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.cholmod import Cholesky
from mpi import run_ranks

CHAIN = """
import json
import numpy as np
from petsc4py import PETSc
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg import solver_choice

comm = PETSc.COMM_WORLD
n = 40
A = PETSc.Mat().createAIJ(((PETSc.DECIDE, n), (PETSc.DECIDE, n)), nnz=3, comm=comm)
first, last = A.getOwnershipRange()
for i in range(first, last):
    for j, value in ((i - 1, -1.0), (i, 2.1), (i + 1, -1.0)):
        if 0 <= j < n:
            A[i, j] = value
A.assemble()
R = np.random.default_rng(0).standard_normal((n, 3))[first:last]
factor = solver_choice.factorize(A)
left = algebra.multiply(A, factor.solve_block(R)) - R
print(json.dumps([type(factor).__name__, float(np.abs(left).max(initial=0.0))]))
"""


@pytest.mark.sample
@pytest.mark.parametrize("seed", range(6))
def test_cover_is_the_least(seed):
    rng = np.random.default_rng(seed)
    pairs = np.argwhere(rng.random((6, 7)) < 0.3) * [3, 5] + [0, 100]
    found = solver_choice._cover(pairs)
    assert np.isin(pairs, found).any(axis=1).all()
    nodes = np.unique(pairs)
    for size in range(len(found)):
        for fewer in itertools.combinations(nodes, size):
            assert not np.isin(pairs, fewer).any(axis=1).all()


def test_cut_separates_four_ranks():
    rng = np.random.default_rng(1)
    pairs = np.sort(rng.integers(0, 40, (60, 2)), axis=1)
    starts = np.array([0, 10, 10, 25])  # one rank has nothing
    owners = np.searchsorted(starts, pairs, side="right")
    pairs = pairs[owners[:, 0] != owners[:, 1]]
    nodes = solver_choice._cut(pairs, starts)
    assert np.isin(pairs, nodes).any(axis=1).all()
    assert len(nodes) < len(np.unique(pairs))


@pytest.mark.parametrize(("n", "last", "block"), [(60, 7, 1), (300, 30, 3), (40, 40, 1)])
def test_corner_is_a_factor_of_the_schur_complement(n, last, block):
    rng = np.random.default_rng(n)
    A = scipy.sparse.random(n, n, 0.05, random_state=rng, format="csr")
    A = scipy.sparse.csr_matrix(A @ A.T + scipy.sparse.identity(n))
    factor = Cholesky(A, block, last=last)
    order, L = factor.corner(last)
    assert sorted(order) == list(range(last))
    dense = A.toarray()
    schur = np.linalg.inv(np.linalg.inv(dense)[:last, :last])
    np.testing.assert_allclose(L @ L.T, schur[np.ix_(order, order)], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(solver_choice._square(L), L @ L.T, rtol=1e-12, atol=1e-14)
    b = rng.standard_normal((n, 3))
    y = factor.forward(b[factor.permutation])
    x = np.empty_like(b)
    x[factor.permutation] = factor.backward(y)
    np.testing.assert_allclose(x, np.linalg.solve(dense, b), rtol=1e-9, atol=1e-12)


SOLVES = """
from antiosc.base.errors import AntioscError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.solver_choice import Substructures

warnings.simplefilter("ignore")
part = ao.Structure(parts.box((8, 4, 3)), ao.Solid(**parts.STEEL), [ao.Support("left")])
A, comm = part.K, part.comm
first, last = A.getOwnershipRange()
R = np.random.default_rng(0).standard_normal((A.getSize()[0], 5))[first:last]
spread = solver_choice.factorize(A)
found = {"spread": isinstance(spread, Substructures), "left": [], "same": []}
X = spread.solve_block(R)
left = algebra.multiply(A, X) - R
found["left"] = algebra.norm(comm, left.ravel()) / algebra.norm(comm, R.ravel())
solver_choice.INTERFACE = 0
mumps = solver_choice.factorize(A)
other = mumps.solve_block(R)
found["mumps"] = type(mumps).__name__
found["same"] = algebra.norm(comm, (other - X).ravel()) / algebra.norm(comm, X.ravel())
x = spread.solve(R[:, 0])
found["vector"] = float(np.abs(x - X[:, 0]).max() / np.abs(X[:, 0]).max())
solver_choice.INTERFACE = 10**6
found["errors"] = []
for sign in (-1.0, "one rank"):
    B = A.copy()
    if sign == -1.0:
        B.scale(-1.0)
    else:  # one row, deep in the last rank's part
        row = A.getSize()[0] - 2
        B.setValue(row, row, -1.0) if comm.rank == comm.size - 1 else None
        B.assemble()
    try:
        solver_choice.factorize(B)
        found["errors"].append("none")
    except AntioscError as error:
        found["errors"].append(f"{type(error).__name__}: {str(error)[:44]}")
print(json.dumps(found))
"""


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [2, 3])
def test_over_ranks(ranks):
    for text in run_ranks(ranks, START + SOLVES, alone=True):
        found = json.loads(text)
        assert found["spread"]
        assert found["mumps"] == "Distributed"
        assert found["left"] < 1e-9
        assert found["same"] < 1e-9
        assert found["vector"] < 1e-12
        said = "NotConvergedError: the stiffness matrix cannot be factored"
        assert all(error.startswith(said[:44]) for error in found["errors"]), found["errors"]


@pytest.mark.parametrize("order", "CF")
@pytest.mark.parametrize("n", [0, 1, 2, 9])
def test_square_leaves_the_triangle(n, order):
    """One row is contiguous either way round: a conversion alone is no copy of it."""
    L = np.array(np.tril(np.random.default_rng(n).standard_normal((n, n)) + 2), order=order)
    before = L.copy()
    np.testing.assert_allclose(solver_choice._square(L), before @ before.T, rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(L, before)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [2, 3])
def test_an_interface_of_one_row(ranks):
    for text in run_ranks(ranks, CHAIN):
        name, left = json.loads(text)
        assert name == "Substructures"
        assert left < 1e-13
