"""What is done about memory: forecasts of a factor, the choice of a solver, solving without one."""

from __future__ import annotations

import gc

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.base import process
from antiosc.base.errors import AntioscWarning
from antiosc.fem.linalg import cholmod, solver_choice

pytestmark = pytest.mark.fem

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
