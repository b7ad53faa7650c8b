"""CHOLMOD's factor called directly, and the static deflections of many loads from it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg

import antiosc as ao
import parts
from antiosc.fem.extraction.eigenmodes import ModeSolver
from antiosc.fem.linalg import cholmod, compliance
from antiosc.fem.linalg.algebra import sum_of
from antiosc.fem.linalg.cholmod import Cholesky
from antiosc.fem.linalg.petsc_algebra import csr


def grid(n: int, block: int = 1) -> scipy.sparse.csr_matrix:
    """A shifted Laplacian of an n³ grid, `block` unknowns a node that hang together."""
    line = scipy.sparse.diags([-1.0, 2.1, -1.0], [-1, 0, 1], shape=(n, n))
    eye = scipy.sparse.identity(n)
    space = scipy.sparse.kron(scipy.sparse.kron(line, eye), eye)
    space = space + scipy.sparse.kron(scipy.sparse.kron(eye, line), eye)
    space = space + scipy.sparse.kron(scipy.sparse.kron(eye, eye), line)
    coupling = np.eye(block) + 0.2 * np.ones((block, block))
    return scipy.sparse.kron(space, coupling).tocsr()


def loads(size: int, count: int, entries: int = 5) -> scipy.sparse.csr_matrix:
    rng = np.random.default_rng(1)
    rows = rng.integers(0, size, (count, entries))
    values = rng.standard_normal((count, entries))
    at = np.repeat(np.arange(count), entries)
    return scipy.sparse.csr_matrix((values.ravel(), (rows.ravel(), at)), shape=(size, count))


@pytest.mark.sample
@pytest.mark.parametrize("block", [1, 3])
def test_solves_and_factor(block):
    A = grid(8, block)
    factor = Cholesky(A, block)
    x = np.random.default_rng(0).standard_normal((A.shape[0], 7))
    np.testing.assert_allclose(factor.solve(A @ x), x, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(factor.solve(A @ x[:, 0]), x[:, 0], rtol=1e-10, atol=1e-12)
    L, p = factor.supernodes, factor.permutation
    whole = np.zeros(A.shape)
    for s in range(len(L.start) - 1):
        rows = L.rows[L.row[s] : L.row[s + 1]]
        width = L.start[s + 1] - L.start[s]
        values = L.values[L.value[s] : L.value[s] + len(rows) * width].reshape(width, len(rows)).T
        whole[np.ix_(rows, np.arange(L.start[s], L.start[s + 1]))] = values
    whole = np.tril(whole)
    np.testing.assert_allclose(whole @ whole.T, A.toarray()[np.ix_(p, p)], atol=1e-12)


@pytest.mark.parametrize("count", [1, 5, 200])
def test_compliances_are_those_of_solves(count):
    A = grid(9, 2)
    B = loads(A.shape[0], count)
    B = (B @ scipy.sparse.diags((np.arange(count) != count // 2) * 1.0)).tocsr()  # one sees nothing
    Y = scipy.sparse.linalg.splu(A.tocsc()).solve(B.toarray())
    exact = np.sum(B.toarray() * Y, axis=0)
    found = compliance.compliances(Cholesky(A, 2), B)
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-14)


@pytest.mark.sample
@pytest.mark.parametrize("supported", [True, False])
@pytest.mark.parametrize("count", [0, 12])
def test_deflections_are_those_of_solves(supported, count):
    """The inertia too, with and without known modes; a free body about its shift."""
    supports = [ao.Support("left")] if supported else []
    part = ao.Structure(parts.box((6, 3, 2)), ao.Solid(**parts.STEEL), supports)
    B = loads(part.K.getSize()[0], 40, 9)
    B = scipy.sparse.diags((~np.isin(np.arange(B.shape[0]), part.fixed)).astype(float)) @ B
    modes = ModeSolver(part).lowest(max(count, 1))
    omega = np.concatenate([np.zeros(part.rigid_modes.shape[1]), modes.omega[: max(count, 1)]])
    phi = np.column_stack([part.rigid_modes, modes.phi[:, : max(count, 1)]])
    C, G = compliance.deflections(part, B.tocsr(), omega, B.T @ phi)
    A = csr(sum_of(part.K, part.shift, part.M))
    Y = scipy.sparse.linalg.splu(A.tocsc()).solve(B.toarray())
    np.testing.assert_allclose(C, np.sum(B.toarray() * Y, axis=0), rtol=1e-8)
    np.testing.assert_allclose(
        G, np.sum(Y * (csr(part.M) @ Y), axis=0), rtol=2 * compliance.SHIFT_STEP
    )


def test_without_room_for_a_second_factor_all_is_solved_for(monkeypatch):
    part = ao.Structure(parts.box((4, 2, 2)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    free = np.ones(part.K.getSize()[0])
    free[part.fixed] = 0.0
    B = (scipy.sparse.diags(free) @ loads(len(free), 5)).tocsr()
    modes = ModeSolver(part).lowest(5)
    b = B.T @ modes.phi
    expected = compliance.deflections(part, B, modes.omega, b)
    entries = part.factorize().entries
    assert entries == part.factorize().cholesky.supernodes.values.size
    monkeypatch.setattr(compliance.process, "free_memory", lambda: 8 * entries)
    monkeypatch.setattr(compliance, "compliances", None)  # is not asked
    with pytest.warns(ao.AntioscWarning, match="every site is solved separately"):
        found = compliance.deflections(part, B, modes.omega, b)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-9)
    np.testing.assert_allclose(found[1], expected[1], rtol=2 * compliance.SHIFT_STEP)


def test_a_petsc_without_cholmod_is_refused(monkeypatch):
    cholmod.library.cache_clear()
    monkeypatch.setattr(cholmod.ctypes, "CDLL", lambda *_: object())
    with pytest.raises(ao.MissingDependencyError, match="built without CHOLMOD"):
        Cholesky(grid(2))
    cholmod.library.cache_clear()
