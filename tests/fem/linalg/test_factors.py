"""The factors that serve several ranks, on one: MUMPS's, and substructures with a chosen interface.

`tests/fem/linalg/test_factors.py` has them on real ranks."""

from __future__ import annotations

import gc

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.base import process
from antiosc.base.errors import AntioscWarning, NotConvergedError
from antiosc.fem.linalg import cholmod, solver_choice
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.linalg.solver_choice import Substructures, interface


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


def test_mumps_and_its_forecast(part, loads):
    factor = solver_choice.Distributed(part.K)
    check(factor, part, loads)
    direct = solver_choice.OnOneRank(part.K)
    assert 0.5 * direct.entries < factor.entries < 3 * direct.entries
    assert 0.3 * factor.entries < solver_choice.forecast(part.K) < 3 * factor.entries


@pytest.mark.parametrize("kind", ["every seventh node", "none", "all"])
def test_any_nodes_may_be_the_interface(part, loads, kind):
    n = part.K.getSize()[0]
    chosen = {"every seventh node": slice(None, None, 7), "none": slice(0), "all": slice(None)}
    nodes = np.arange(n // 3)[chosen[kind]]
    rows = (3 * nodes[:, None] + np.arange(3)).ravel()
    factor = Substructures(part.K, rows)
    check(factor, part, loads)
    assert factor.entries >= len(rows) ** 2
    if kind == "none":
        assert factor.entries == solver_choice.OnOneRank(part.K).entries


def test_no_interface_between_one_rank_and_none(part):
    assert interface(part.K).size == 0


@pytest.mark.parametrize("rows", [9, 0])
def test_an_indefinite_matrix_is_refused(part, rows):
    A = part.K.copy()
    A.scale(-1.0)
    with pytest.raises(NotConvergedError, match="cannot be factored"):
        Substructures(A, np.arange(rows))


# --- What is done about memory: forecasts of a factor, the choice of a solver, solving without


SITE = ao.Site((0.15, 0.021, 0.04), (0.1, 0.2, -1), radius=0.024)


def block(solver="auto", supports=("left",), n=(8, 4, 3)) -> ao.Structure:
    held = [ao.Support(name) for name in supports]
    return ao.Structure(parts.box(n), ao.Solid(**parts.STEEL), held, solver=solver)


@pytest.mark.slow
def test_forecast_against_the_factor_itself():
    part = block(n=(16, 10, 8))
    # CHOLMOD's, with an ordering of its own, and supernodes that are held as full rectangles
    entries = part.factorize().cholesky.supernodes.values.size
    assert 0.7 < solver_choice.forecast(part.K) / entries < 2.0
    assert entries < solver_choice.COMPACT * part.K.getSize()[0] ** (4 / 3)


@pytest.mark.slow
@pytest.mark.parametrize("supports", [("left",), ()])
def test_iterative_and_direct_agree(supports):
    direct, iterative = block("direct", supports), block("iterative", supports)
    assert isinstance(iterative.factorize(), solver_choice.Multigrid)
    a, b = (ao.extract(part, SITE, n=6) for part in (direct, iterative))
    assert b.k0 == pytest.approx(a.k0, rel=1e-8)
    assert b.m_st == pytest.approx(a.m_st, rel=1e-8)
    np.testing.assert_allclose(b.omega[:3], a.omega[:3], rtol=1e-8)
    a, b = (ao.extract(part, SITE, n=4, method="modes") for part in (direct, iterative))
    np.testing.assert_allclose(b.omega, a.omega, rtol=1e-8)


@pytest.mark.slow
def test_no_memory_for_the_factor(monkeypatch):
    monkeypatch.setattr(process, "free_memory", lambda: 1e6)
    for name in ("ANALYSIS", "MULTIGRID"):
        monkeypatch.setattr(solver_choice, name, 1.0)
    made = solver_choice.Multigrid

    def multigrid(*given):
        gc.collect()
        assert not [each for each in gc.get_objects() if isinstance(each, cholmod.Analysis)]
        return made(*given)

    monkeypatch.setattr(solver_choice, "Multigrid", multigrid)
    with pytest.warns(AntioscWarning, match="GB are free: an iterative solver is used"):
        model = ao.extract(block(), SITE, n=3)
    assert model.k0 > 0
    with pytest.raises(ao.OutOfMemoryError, match=r"about 0\.0\d+ GB and 0\.001 GB are free"):
        ao.extract(block("direct"), SITE, n=3)


def test_the_free_memory_is_looked_up_after_the_analysis(monkeypatch):
    part = block()
    need = solver_choice.BYTES * solver_choice.forecast(part.K)
    free = iter([0.9 * need, 1e3])  # the factor does not fit; then too little for the multigrid
    monkeypatch.setattr(process, "free_memory", lambda: next(free))
    monkeypatch.setattr(solver_choice, "ANALYSIS", 0.0)
    with pytest.raises(ao.OutOfMemoryError, match="iterative solver"):
        part.factorize()


def test_unknown_solver():
    with pytest.raises(ao.InputError, match="solver must be 'auto', 'direct' or 'iterative'"):
        block("umfpack")
