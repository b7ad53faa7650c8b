"""The factors that serve several ranks, on one: MUMPS's, and substructures with a chosen interface.

`tests/fem/linalg/test_large.py` has them on real ranks.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

pytest.importorskip("dolfinx")

import antiosc as ao
import parts
from antiosc.base.errors import NotConvergedError
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.fem.linalg.substructures import Substructures, _cover, _cut, interface

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


def test_a_cover_is_as_small_as_a_matching():
    """Kőnig: rows and columns that touch every entry, as few as entries in distinct ones."""
    rng = np.random.default_rng(2)
    for _ in range(40):
        adjacent = rng.random((6, 7)) < 0.25
        edges = np.argwhere(adjacent)
        if not len(edges):
            continue
        cover = set(_cover(edges + np.array([0, 100])).tolist())
        assert all(i in cover or j + 100 in cover for i, j in edges)
        matching = maximum_bipartite_matching(csr_matrix(adjacent), perm_type="column")
        assert len(cover) == (matching >= 0).sum()


def test_a_cut_separates_every_two_ranks():
    """Nodes 0 to 3, 4 to 7 and 8 to 11 on three ranks."""
    pairs = np.array([(3, 4), (3, 5), (3, 8), (7, 8), (7, 9), (2, 4)])
    nodes = set(_cut(pairs, np.array([0, 4, 8])).tolist())
    assert all(a in nodes or b in nodes for a, b in pairs)
    assert len(nodes) <= 4
