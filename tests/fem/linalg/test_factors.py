"""Factors: MUMPS over ranks, CHOLMOD on one; what is done where memory is short."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.petsc_algebra import csr
from marks import BY_CHOLMOD
from mpi import START, run_ranks


@pytest.fixture(scope="module")
def part() -> ao.Structure:
    return ao.Structure(parts.box((5, 3, 2)), ao.Solid(**parts.STEEL), [ao.Support("left")])


@pytest.fixture(scope="module")
def loads(part) -> np.ndarray:
    R = np.random.default_rng(4).normal(size=(part.K.getSize()[0], 5))
    R[part.fixed] = 0.0
    return R


def check(solver, part, R) -> None:
    K = csr(part.K)
    for block in (R, R[:, :1]):
        X = solver.solve_block(block)
        assert np.abs(K @ X - block).max() < 1e-9 * np.abs(block).max()
    np.testing.assert_allclose(solver.solve_checked(R[:, 0]), solver.solve_block(R)[:, 0])


@BY_CHOLMOD
def test_mumps_and_its_forecast(part, loads):
    factor = solver_choice.MumpsFactor(part.K)
    check(factor, part, loads)
    direct = solver_choice.CholmodFactor(part.K)
    assert 0.5 * direct.entries < factor.entries < 3 * direct.entries
    assert 0.3 * factor.entries < solver_choice.entries_by_mumps(part.K) < 3 * factor.entries


def test_an_indefinite_matrix_is_refused(part):
    A = part.K.copy()
    A.scale(-1.0)
    with pytest.raises(ao.NotConvergedError, match="cannot be factored"):
        solver_choice.factorize(A)


# --- What is done about memory: forecasts of a factor, the choice of a solver, solving without


SITE = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.024)


def block(solver="auto", supports=("left",), n=(8, 4, 3)) -> ao.Structure:
    held = [ao.Support(name) for name in supports]
    return ao.Structure(parts.box(n), ao.Solid(**parts.STEEL), held, solver=solver)


@pytest.mark.slow
def test_forecast_against_the_factor_itself():
    part = block(n=(12, 8, 6))
    # CHOLMOD's, with an ordering of its own, and supernodes that are held as full rectangles
    entries = part.factorize().cholesky.supernodes.values.size
    assert 0.7 < solver_choice.entries_by_mumps(part.K) / entries < 2.0
    assert entries < solver_choice.COMPACT_FILL * part.K.getSize()[0] ** (4 / 3)


@pytest.mark.slow
@pytest.mark.parametrize("supports", [("left",), ()])
def test_iterative_and_direct_agree(supports):
    direct, iterative = (block(one, supports, (6, 3, 2)) for one in ("direct", "iterative"))
    assert isinstance(iterative.factorize(), solver_choice.Multigrid)
    site = replace(SITE, radius=0.032)
    a, b = (ao.extract(part, site, n=6) for part in (direct, iterative))
    assert b.k0 == pytest.approx(a.k0, rel=1e-8)
    assert b.m_st == pytest.approx(a.m_st, rel=1e-8)
    np.testing.assert_allclose(b.omega[:3], a.omega[:3], rtol=1e-7)
    a, b = (ao.extract(part, site, n=4, method="modes") for part in (direct, iterative))
    np.testing.assert_allclose(b.omega, a.omega, rtol=1e-7)


def test_unknown_solver():
    with pytest.raises(ao.InputError, match="solver must be 'auto', 'direct' or 'iterative'"):
        block("umfpack")


SOLVES = """
from antiosc.base.errors import AntioscError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg import solver_choice

warnings.simplefilter("ignore")
part = ao.Structure(parts.box((8, 4, 3)), ao.Solid(**parts.STEEL), [ao.Support("left")])
A, comm = part.K, part.comm
first, last = A.getOwnershipRange()
R = np.random.default_rng(0).standard_normal((A.getSize()[0], 5))[first:last]
factor = solver_choice.factorize(A)
found = {"kind": type(factor).__name__}
X = factor.solve_block(R)
left = algebra.multiply(A, X) - R
found["left"] = algebra.norm(comm, left.ravel()) / algebra.norm(comm, R.ravel())
x = factor.solve(R[:, 0])
found["vector"] = float(np.abs(x - X[:, 0]).max() / np.abs(X[:, 0]).max())
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
def test_over_ranks():
    for text in run_ranks(3, START + SOLVES):
        found = json.loads(text)
        assert found["kind"] == "MumpsFactor"
        assert found["left"] < 1e-9
        assert found["vector"] < 1e-12
        said = "NotConvergedError: the stiffness matrix cannot be factored"
        assert all(error.startswith(said[:44]) for error in found["errors"]), found["errors"]
