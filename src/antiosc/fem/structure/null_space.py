"""Null vectors of K, and the shift that makes a singular K factorable, from the matrices alone.

Inverse iteration finds both: the null vectors as the motions without strain, and the shift from the
lowest elastic ω² beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array, Matrix
from antiosc.base.errors import AccuracyError, AntioscError, InputError, NotConvergedError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import (
    by_strains,
    communicator,
    dot,
    frequency,
    multiply,
    norm,
    norms,
    roots,
    softness,
    sum_of,
)
from antiosc.fem.linalg.solver import Solver, solver_for

if TYPE_CHECKING:
    from mpi4py import MPI

#: Force or energy of r over that of the entries (`antiosc.fem.linalg.algebra`) below which r counts
#: as a rigid-body mode; rounding leaves about 1e-16.
RIGID_FORCE = 1e-11
#: Shift over the estimate of the first elastic ω²: modes converge fast, A stays well conditioned.
SHIFT = 0.1
#: Share of a vector outside the span of others, below which it adds nothing; rounding: 1e-16.
SPANNED = 1e-12
#: Message for matrices that cannot belong to a structure.
INDEFINITE = (
    "K must be positive semidefinite, and no massless dof may move freely: {}; check the supports "
    "and the signs, that no penalty exceeds 1e8 times the usual entries, and that the load in K "
    "is below buckling."
)
#: Steps of iterative refinement of K's null vectors, each a tenth of the error; inverse iteration
#: alone stops at the rounding of its solves, 10² to 10⁶ times the rounding of Kr.
REFINEMENTS = 4
#: A first shift that is more than this too high is replaced: Krylov spaces then converge slowly.
FAR = 0.1


def of_matrices(K: Matrix, M: Matrix, given: Array | None) -> tuple[Array, float, Solver | None]:
    """(M-orthonormal null vectors of K (rows of this rank, r), shift in rad²/s², solver of K).

    The solver is None for a singular K. `given` is a basis of K's null space, if known.
    """
    comm, n = communicator(K), algebra.rows(K)
    regular = _regular(comm, K) if given is None else None
    if regular is not None:
        return np.zeros((n, 0)), 0.0, regular
    # Block inverse iteration, first far below the top of the spectrum; then again from the
    # elastic value that it finds, so that the shift sits where the modes are.
    shift = 1e-7 * frequency(K, M)
    rng = np.random.default_rng(comm.rank)
    block = (
        rng.standard_normal((n, 12))
        if given is None
        else np.hstack([given, rng.standard_normal((n, 6))])
    )
    values = np.zeros(0)
    for _ in range(2):
        factor = _positive(K, shift, M)
        for _ in range(8):
            block = orthonormal(comm, M, block)
            block = np.column_stack([factor.solve(c) for c in multiply(M, block).T])
        block = orthonormal(comm, M, block)
        values, turn = np.linalg.eigh(dot(comm, block, multiply(K, block)))
        block = block @ turn
        zero = np.abs(softness(K, block, multiply(K, block))) < _rigid(K)
        if zero.all():
            raise InputError(
                f"K has {len(values)} or more null vectors: the matrices hold several loose bodies."
            )
        lowest = float(values[~zero].min())
        if lowest <= np.finfo(float).eps * values[-1]:
            raise InputError(INDEFINITE.format(f"xᵀK x/xᵀM x = {lowest:.1e} rad²/s² for some x"))
        shift = SHIFT * lowest
    found = block[:, zero]
    if given is not None and given.shape[1] != found.shape[1]:
        raise InputError(
            f"rigid_modes has {given.shape[1]} columns but K has {found.shape[1]} null vectors."
        )
    for _ in range(REFINEMENTS):
        found = found - factor.solve_block(multiply(K, found))
    return orthonormal(comm, M, found), shift, None


def _regular(comm: MPI.Comm, K: Matrix) -> Solver | None:
    """A solver of K; None for a null vector: K does not factor, or a solve blows up along it."""
    n = algebra.rows(K)
    try:
        factor = _solver(K)
        x = np.random.default_rng(comm.rank).standard_normal(n)
        for _ in range(3):
            x = factor.solve_checked(x / norm(comm, x))
    except AntioscError:
        return None
    X = x[:, None]
    return None if softness(K, X, multiply(K, X))[0] < _rigid(K) * 1e-3 else factor


def _rigid(K: Matrix) -> float:
    """Share of the entries' energy below which a motion is rigid; by strains it is a square."""
    return RIGID_FORCE**2 if by_strains(K) else RIGID_FORCE


def _positive(K: Matrix, shift: float, M: Matrix) -> Solver:
    """A solver of K + shift M; InputError where that is not positive definite."""
    try:
        return _solver(sum_of(K, shift, M))
    except NotConvergedError as error:
        raise InputError(
            INDEFINITE.format(f"K + {shift:.1e} M rad²/s² has no Cholesky factor")
        ) from error


def _solver(A: Matrix) -> Solver:
    return solver_for(A, "auto", lambda: np.zeros((algebra.rows(A), 0)))


def orthonormal(comm: MPI.Comm, M: Matrix, block: Array) -> Array:
    """An M-orthonormal basis of the columns, those that others span dropped (Gram–Schmidt)."""
    loads = multiply(M, block)
    before = np.sqrt(dot(comm, block, loads).diagonal())
    basis = np.empty(block.shape, order="F")
    products = np.empty(block.shape, order="F")
    count = 0
    for column, load, size in zip(block.T, loads.T, before, strict=True):
        for _ in range(2):  # twice is enough (Kahan)
            share = dot(comm, products[:, :count], column)
            column = column - basis[:, :count] @ share
        if count:
            load = multiply(M, column)
        left = np.sqrt(max(float(dot(comm, column, load)), 0.0))
        if left > SPANNED * size:
            basis[:, count], products[:, count] = column / left, load / left
            count += 1
    return basis[:, :count]


def closer_shift(factor: Solver, K: Matrix, M: Matrix, motions: Array) -> float:
    """The shift again, from block inverse iteration with a first one.

    The polynomial fields of the first shift do not represent slender members, whose frequencies may
    be ten times lower.
    """
    comm = factor.comm
    x = np.random.default_rng(comm.rank).standard_normal((len(motions), 3))
    blocks = []
    for _ in range(4):
        x = factor.solve_block(multiply(M, x))
        x = orthonormal(comm, M, x - motions @ dot(comm, motions, multiply(M, x)))
        blocks.append(x)
    # a small structure exhausts the blocks: what rounding leaves of them must not be rigid
    basis = orthonormal(comm, M, np.hstack([motions, *blocks]))[:, motions.shape[1] :]
    if not basis.shape[1]:  # all motions are rigid
        return float("inf")
    values, turn = np.linalg.eigh(dot(comm, basis, multiply(K, basis)))
    # xᵀK x is a sum of terms of the size of xᵀD x, known to ε of that.
    softest = basis @ turn[:, :1]
    cancelled = 0.0 if by_strains(K) else norms(comm, roots(K)[:, None] * softest)[0] ** 2
    rounding = np.finfo(float).eps * (cancelled + values[-1])
    if values[0] <= rounding:
        raise AccuracyError(
            f"the lowest elastic frequency is hidden by rounding, ω² = {values[0]:.1e} ± "
            f"{rounding:.1e} rad²/s²: some part is attached by a hinge, a single common point or "
            "line (join it along a face), or is too slender for double precision (use fewer "
            "elements)."
        )
    return SHIFT * float(values[0])
