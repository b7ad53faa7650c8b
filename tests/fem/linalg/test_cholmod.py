"""CHOLMOD called directly: memory that lasts, failures in words, deflections of many loads."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg

import antiosc as ao
import parts
from antiosc.fem.linalg import cholmod, deflections, solver_choice
from antiosc.fem.linalg.algebra import sum_of
from antiosc.fem.linalg.cholmod import Cholesky
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.reduce.extraction.eigenmodes import ModeSolver
from antiosc_app import info
from marks import BY_CHOLMOD

pytestmark = BY_CHOLMOD


def chain(n: int) -> scipy.sparse.csr_matrix:
    """Springs in a row, the first and the last on the ground."""
    diagonals = [-1.0, 2.1, -1.0]
    return scipy.sparse.diags(diagonals, [-1, 0, 1], shape=(n, n)).tocsr()


@pytest.fixture
def forgotten():
    """Nothing that was found of the library before, nor afterwards."""
    yield cholmod.loaded_cholmod.cache_clear(), cholmod.refusal.cache_clear()
    cholmod.loaded_cholmod.cache_clear()
    cholmod.refusal.cache_clear()


@pytest.mark.slow
def test_arrays_of_the_factor_last_as_long_as_they_are_used():
    factor = Cholesky(chain(2000), 1).factorized()
    memory = weakref.ref(factor._memory)
    values, permutation = factor.supernodes.values[10:], factor.permutation
    before = values.copy()
    del factor
    gc.collect()
    others = [np.full(len(values), 1e5) for _ in range(20)]
    np.testing.assert_array_equal(values, before)
    assert sorted(permutation) == list(range(2000))
    assert memory() is not None
    del values, permutation, others
    assert memory() is None  # at once, without the garbage collector


def results():
    """(class of the factor, numbers of a model and of a map) of a small block."""
    site = ao.Site((0.1, 0.017, 0.04), (0, 0, -1), radius=0.02)  # on no plane of symmetry
    part = ao.Structure(parts.box((8, 4, 3)), ao.Solid(**parts.STEEL), [ao.Support("left")])
    model = ao.extract(part, site, n=6)
    grid = ao.impact_map(part, [site.point], direction=(0, 0, -1), radius=0.02, n=4, modes=5)
    numbers = [model.k0, model.m_st, *model.omega[:3], *model.m[:3], *grid.models.k0]
    return type(part.factorize()), [*numbers, *grid.models.omega[0, :1]]


@pytest.fixture(scope="module")
def called_directly():
    assert "called directly" in info.info_text()
    return results()


@pytest.mark.slow
def test_instead_of_a_library_that_factors_wrongly_mumps_factors(
    called_directly, monkeypatch, forgotten
):
    """The same models as with the direct calls, and `antiosc info` says why."""
    kind, direct = called_directly
    assert kind is solver_choice.CholmodFactor
    monkeypatch.setattr(Cholesky, "solve", lambda _self, B: 1.001 * B)
    kind, through = results()
    assert kind is solver_choice.MumpsFactor
    np.testing.assert_allclose(through, direct, rtol=1e-7)
    assert "factors wrongly" in cholmod.refusal()
    assert "factors wrongly" in info.info_text()


def grid(n: int, block: int = 1) -> scipy.sparse.csr_matrix:
    """A shifted Laplacian of an n³ grid, `block` unknowns a node that hang together."""
    line = scipy.sparse.diags([-1.0, 2.1, -1.0], [-1, 0, 1], shape=(n, n))
    eye = scipy.sparse.identity(n)
    space = scipy.sparse.kron(scipy.sparse.kron(line, eye), eye)
    space = space + scipy.sparse.kron(scipy.sparse.kron(eye, line), eye)
    space = space + scipy.sparse.kron(scipy.sparse.kron(eye, eye), line)
    coupling = np.eye(block) + 0.2 * np.ones((block, block))
    return scipy.sparse.kron(space, coupling).tocsr()


def many_loads(size: int, count: int, entries: int = 5) -> scipy.sparse.csr_matrix:
    rng = np.random.default_rng(1)
    rows = rng.integers(0, size, (count, entries))
    values = rng.standard_normal((count, entries))
    at = np.repeat(np.arange(count), entries)
    return scipy.sparse.csr_matrix((values.ravel(), (rows.ravel(), at)), shape=(size, count))


@pytest.mark.parametrize("block", [1, 3])
def test_solves_and_factor(block):
    A = grid(8, block)
    factor = Cholesky(A, block).factorized()
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


@pytest.mark.parametrize("count", [1, 5, 600])
def test_compliances_are_those_of_solves(monkeypatch, count):
    """The last are three blocks, which threads share."""
    monkeypatch.setattr(deflections, "free_threads", lambda: 3)
    A = grid(9, 2)
    B = many_loads(A.shape[0], count)
    B = (B @ scipy.sparse.diags((np.arange(count) != count // 2) * 1.0)).tocsr()  # one sees nothing
    Y = scipy.sparse.linalg.splu(A.tocsc()).solve(B.toarray())
    exact = np.sum(B.toarray() * Y, axis=0)
    found = deflections.compliances(Cholesky(A, 2).factorized(), B)
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("supported", [True, False])
@pytest.mark.parametrize("count", [0, 12])
def test_deflections_are_those_of_solves(supported, count):
    """The inertia too, with and without known modes; a free body about its shift."""
    supports = [ao.Support("left")] if supported else []
    part = ao.Structure(parts.box((6, 3, 2)), ao.Solid(**parts.STEEL), supports)
    B = many_loads(part.K.getSize()[0], 40, 9)
    B = scipy.sparse.diags((~np.isin(np.arange(B.shape[0]), part.fixed)).astype(float)) @ B
    modes = ModeSolver(part).lowest(max(count, 1))
    omega = np.concatenate([np.zeros(part.rigid_modes.shape[1]), modes.omega[: max(count, 1)]])
    phi = np.column_stack([part.rigid_modes, modes.phi[:, : max(count, 1)]])
    C, G = deflections.deflections(part, B.tocsr(), omega, B.T @ phi)
    A = csr(sum_of(part.K, part.shift, part.M))
    Y = scipy.sparse.linalg.splu(A.tocsc()).solve(B.toarray())
    np.testing.assert_allclose(C, np.sum(B.toarray() * Y, axis=0), rtol=1e-8)
    np.testing.assert_allclose(
        G, np.sum(Y * (csr(part.M) @ Y), axis=0), rtol=2 * deflections.SHIFT_STEP
    )


def test_a_petsc_without_cholmod_is_refused(monkeypatch):
    cholmod.loaded_cholmod.cache_clear()
    monkeypatch.setattr(cholmod.ctypes, "CDLL", lambda *_: object())
    with pytest.raises(ao.MissingDependencyError, match="built without CHOLMOD"):
        Cholesky(grid(2))
    cholmod.loaded_cholmod.cache_clear()
