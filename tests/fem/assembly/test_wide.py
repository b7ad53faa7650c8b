"""Means of large groups by a nested basis: the structure of an elimination, with a sparse K."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.assembly import wide
from antiosc.fem.assembly.motions import rigid_motions
from assemblies import NU, SOLID, E, box, eigenfrequencies, line
from marks import FREE_ON_PURPOSE

pytestmark = [pytest.mark.fem, FREE_ON_PURPOSE]

POST = ao.Beam(E, NU, 2700.0, ao.Section.circle(0.2))


def table(supports: list[ao.Support]) -> ao.Structure:
    """A block that carries a post on a Mean, a bolt to a second block, and a mass on a spider."""
    n = 6
    block = ao.Structure(box((0, 0, 0), (1, 1, 0.3), (n, n, 1)), SOLID, supports, order=1)
    cap = ao.Structure(box((0, 0, 0), (1, 1, 0.2), (5, 5, 1), "tetrahedron"), SOLID, order=1)
    post = ao.Structure(line((0.5, 0.5, 0.3), (0.5, 0.5, 1), 3), POST)
    return ao.assemble(
        {"block": block, "post": post, "cap": cap},
        [
            ao.Mean("block:z1", "post:start"),
            ao.Bolt("block:x1", "cap:x0", POST),
            ao.Mean("cap:x1", "hub"),
        ],
        {"cap": (1.4, 0, 0)},
        points={"hub": (2.6, 0.5, 0.1)},
        attached=[ao.PointMass("hub", 100.0, 5.0)],
    )


@pytest.mark.slow
@pytest.mark.parametrize("supports", [[], [ao.Support("z0")]])
def test_it_is_the_same_structure(monkeypatch, supports):
    dense = table(supports)
    monkeypatch.setattr(wide, "WIDE", 60)
    sparse = table(supports)
    assert sparse.eliminated.basis is not None
    assert dense.eliminated.basis is None
    assert sparse.dofs == dense.dofs
    assert sparse.mass == dense.mass
    assert sparse.rigid_modes.shape == dense.rigid_modes.shape
    ours, theirs = (eigenfrequencies(s, 12) for s in (sparse, dense))
    assert ours == pytest.approx(theirs, rel=1e-8, abs=1e-4 * theirs[-1])
    site = ao.Site((0.5, 0.5, 1.0), (1, 0.2, -0.3), part="post")
    first, second = ao.extract(sparse, site, n=5), ao.extract(dense, site, n=5)
    assert first.k0 == pytest.approx(second.k0, rel=1e-9)
    assert first.m_st == pytest.approx(second.m_st, rel=1e-9)
    if not supports:
        own, same = sparse.rigid_inertia[0], dense.rigid_inertia[0]
        assert own.matrix == pytest.approx(same.matrix, rel=1e-9, abs=1e-9 * same.matrix.max())
        direction = np.array([0.3, 0.5, 0.8])
        moving = rigid_motions(sparse.layout, np.zeros(3))[:, :3] @ direction
        momentum = sparse.uniform_inertia(direction) @ sparse.eliminated.coordinates(moving)
        assert momentum == pytest.approx(sparse.mass * direction @ direction, rel=1e-12)


def test_the_basis_of_many_dofs(monkeypatch):
    monkeypatch.setattr(wide, "WIDE", 100)
    rng = np.random.default_rng(1)
    places = rng.random((900, 3))
    values = np.where(np.arange(900) < 850, rng.standard_normal((6, 900)), 0.0)
    held = np.arange(900) % 50 == 0
    W = wide.nested_basis(scipy.sparse.csr_matrix(values), held, places)
    assert abs(W.T @ W - scipy.sparse.identity(900)).max() < 1e-13
    kept = wide.rounded(scipy.sparse.csr_matrix(values * ~held) @ W)
    assert np.diff(kept.indptr).max() <= 6
    assert (W[np.flatnonzero(held)] != scipy.sparse.identity(900, format="csr")[held]).nnz == 0


@pytest.mark.slow
def test_parts_with_different_nodes_do_not_fill_the_factor():
    """A flat sheet on a block: the factor is as sparse as those of both by themselves."""
    sheet = ao.Structure(
        box((0, 0), (0.2, 0.2), (14, 14), "triangle"), ao.Shell(E, NU, 2700.0, 2e-3),
        [ao.Support("x0")],
    )  # fmt: skip
    block = ao.Structure(box((0, 0, 0), (0.02, 0.02, 0.02), (2, 2, 2)), SOLID, [ao.Support("z0")])
    joined = ao.assemble(
        {"sheet": sheet, "block": block},
        [ao.Weld(("sheet", (0.1, 0.1, 0.0)), "block:z1")],
        {"block": (0.09, 0.09, -0.02)},
    )
    alone = sum(part.factorize().entries for part in (sheet, block))
    assert joined.factorize().entries < 1.3 * alone
