"""u = T q against null spaces of constraints; means of large groups with a sparse K; curls."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import antiosc as ao
from antiosc.fem.assembly import layout
from antiosc.fem.assembly.assemble import eliminate
from antiosc.fem.assembly.joint import Rows
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.assembly.parts import checked_parts, checked_places
from antiosc.fem.structure import Placement
from assemblies import NU, SOLID, E, box, eigenfrequencies, line
from marks import FREE_ON_PURPOSE

pytestmark = FREE_ON_PURPOSE

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
    monkeypatch.setattr(layout, "DENSE_ROW", 60)
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
        moving = sparse.layout.places.rigid_motions(np.zeros(3))[:, :3] @ direction
        momentum = sparse.uniform_inertia(direction) @ sparse.eliminated.coordinates(moving)
        assert momentum == pytest.approx(sparse.mass * direction @ direction, rel=1e-12)


def test_the_basis_of_many_dofs(monkeypatch):
    monkeypatch.setattr(layout, "DENSE_ROW", 100)
    rng = np.random.default_rng(1)
    places = rng.random((900, 3))
    values = np.where(np.arange(900) < 850, rng.standard_normal((6, 900)), 0.0)
    held = np.arange(900) % 50 == 0
    W = layout.nested_basis(scipy.sparse.csr_matrix(values), held, places)
    assert abs(W.T @ W - scipy.sparse.identity(900)).max() < 1e-13
    kept = layout.rounded(scipy.sparse.csr_matrix(values * ~held) @ W)
    assert np.diff(kept.indptr).max() <= 6
    assert (W[np.flatnonzero(held)] != scipy.sparse.identity(900, format="csr")[held]).nnz == 0


N = 30


def random_rows(seed: int) -> tuple[list[Rows], np.ndarray, np.ndarray, np.ndarray]:
    """(joints, C, fixed, scale): sparse rows, with and without pivots, some of them repeated."""
    rng = np.random.default_rng(seed)
    joints, dense = [], []
    for k in range(6):
        count = int(rng.integers(1, 4))
        C = np.zeros((count, N))
        pivot = np.full(count, -1)
        for row in range(count):
            some = rng.choice(N, int(rng.integers(1, 6)), replace=False)
            C[row, some] = rng.uniform(0.5, 2.0, len(some)) * rng.choice([-1, 1], len(some))
            if k % 2:
                pivot[row] = some[0]
        if k == 4:
            C[0] = dense[0][0] - 2 * dense[1][0]
            pivot[0] = -1
        C *= 10.0 ** rng.integers(-3, 4)
        dense.append(C)
        joints.append(Rows(scipy.sparse.csr_matrix(C), pivot, f"joint {k}"))
    fixed = np.zeros(N, dtype=bool)
    fixed[rng.choice(N, 4, replace=False)] = True
    scale = np.where(rng.uniform(size=N) < 0.3, 1e-2, 1.0)
    return joints, np.vstack(dense), fixed, scale


def check(found, C, fixed):
    """T spans all motions that the constraints allow, once, and is 1 on the dofs that are kept."""
    T = found.T.toarray()
    held = np.vstack([C, np.eye(N)[fixed]])
    exact = scipy.linalg.null_space(held, rcond=1e-10)
    free = ~found.dependent
    assert free.sum() == exact.shape[1]
    assert np.linalg.matrix_rank(T, 1e-9) == exact.shape[1]
    assert not T[:, found.dependent].any()
    np.testing.assert_allclose(exact @ (exact.T @ T), T, atol=1e-9 * np.abs(T).max())
    return T, free


@pytest.mark.parametrize("seed", range(12))
def test_the_span_of_T_is_the_null_space_of_the_constraints(seed):
    rows, C, fixed, scale = random_rows(seed)
    found = eliminate(rows, fixed, scale)
    T, free = check(found, C, fixed)
    np.testing.assert_array_equal(T[free][:, free], np.eye(free.sum()))
    motions = T[:, free] @ np.random.default_rng(seed).normal(size=(free.sum(), 3))
    np.testing.assert_allclose(T @ found.coordinates(motions), motions, atol=1e-9)
    names = [name for name, _, _ in found.redundant]
    assert "joint 4" in names
    assert names == sorted(names)
    told = (np.abs(C[:, ~fixed]) > 0).any(axis=1)
    rank = np.linalg.matrix_rank(C[told][:, ~fixed] / np.abs(C[told]).max(axis=1)[:, None], 1e-9)
    assert sum(times for _, _, times in found.redundant) == told.sum() - rank
    # in another basis of the dofs that are not fixed
    W, rest = np.eye(N), np.flatnonzero(~fixed)
    mixed = np.random.default_rng(seed).normal(size=(len(rest),) * 2)
    W[np.ix_(rest, rest)] = scipy.linalg.qr(mixed)[0]
    turned = eliminate(rows, fixed, scale, basis=scipy.sparse.csr_matrix(W))
    S = check(turned, C, fixed)[0]
    np.testing.assert_allclose(S @ turned.coordinates(motions), motions, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
@pytest.mark.parametrize("order", [1, 2])
def test_the_rotation_of_a_solid_is_half_the_curl(cell, order):
    """Of an affine field, in a part that stands askew: exactly, at any point."""
    place = Placement((1, 2, 3), (0.3, 0.5, -0.8), 1.1)
    mesh = box((0, 0, 0), (1.0, 0.5, 0.4), (2, 1, 1), cell)
    mesh.dolfinx.geometry.x[:, 0] += 0.3 * mesh.dolfinx.geometry.x[:, 1]
    parts = checked_parts({"a": ao.Structure(mesh, SOLID, order=order)})
    layout = Layout(parts, checked_places(parts, {"a": place}), {})
    member, A = layout.members["a"], np.array([[1.0, 2, -1], [0.5, -1, 3], [2, 1, 1]])
    u = (member.nodes @ A.T) @ place.rotation  # in the axes of the part
    X = np.array([[0.2, 0.3, 0.1], [0.25, 0.25, 0.25]])
    found = layout.curl(member, np.array([1, 0]), X) @ u.ravel()
    half = np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2
    np.testing.assert_allclose(found.reshape(2, 3), [half, half], atol=1e-11)
