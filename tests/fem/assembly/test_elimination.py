"""u = T q against null spaces of constraints; means of large groups with a sparse K; curls."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

import antiosc as ao
from antiosc.fem.assembly.assemble import eliminate
from antiosc.fem.assembly.joint import Rows
from antiosc.fem.assembly.layout import Layout, checked_parts, checked_places
from antiosc.fem.structure import Placement
from assemblies import SOLID, box
from marks import FREE_ON_PURPOSE

pytestmark = FREE_ON_PURPOSE

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
    assert found.redundant["joint 4"] >= 1


@pytest.mark.parametrize("seed", range(6))
def test_rows_that_repeat_others_to_the_digits_of_a_deck_are_redundant(seed):
    rows, C, fixed, scale = random_rows(seed)
    matrix = rows[0].matrix.toarray()
    matrix *= 1 + 3e-8 * np.random.default_rng(seed).normal(size=matrix.shape)
    again = Rows.free(scipy.sparse.csr_matrix(matrix), "again")
    once, twice = eliminate(rows, fixed, scale), eliminate([*rows, again], fixed, scale)
    assert twice.dependent.sum() == once.dependent.sum()
    np.testing.assert_allclose(C @ twice.T.toarray(), 0.0, atol=1e-6 * np.abs(C).max())


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
    found = layout.half_curl(member, np.array([1, 0]), X) @ u.ravel()
    half = np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2
    np.testing.assert_allclose(found.reshape(2, 3), [half, half], atol=1e-11)
