"""The factors that serve several ranks, on one: MUMPS's, and substructures with a chosen interface.

`tests/fem/linalg/test_large.py` has them on real ranks.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.base.errors import NotConvergedError
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.linalg.solver_choice import Substructures, interface

pytestmark = pytest.mark.fem


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
