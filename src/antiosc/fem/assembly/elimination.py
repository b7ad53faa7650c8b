"""u = T q from constraints C u = 0.

A row is solved for a dof that occurs in no other row, as long as there are such rows (a triangular
elimination, which keeps T sparse). The remaining rows, which overlap or form cycles, are solved in
connected blocks by a pivoted QR factorization, which also detects dependent rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.csgraph

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AccuracyError, InputError
from antiosc.fem.assembly.joint import Eliminated, Rows
from antiosc.fem.assembly.layout import Sparse, largest, row_numbers

#: A row depends on earlier rows if less than this share of it is orthogonal to them.
DEPENDENT = 1e-9
#: Coefficients below this share of the row's largest are rounding.
LEAST_COEFFICIENT = 1e-14
#: A row without a named dof is solved for one with at least this share of its largest coefficient,
#: so that no step of the elimination makes coefficients more than ten times as large.
PIVOT = 0.1
#: Largest coefficient of T: half of the 16 digits are then left.
LARGEST_COEFFICIENT = 1e8
#: Largest error of C T over the sizes of its terms; rounding leaves about 1e-15.
SATISFIED = 1e-9
#: Most rows of a block of coupled rows, which is solved as a dense matrix: 0.3 GB if it is square.
LARGEST_BLOCK = 6000


@dataclass(frozen=True, eq=False)
class _System:
    """Constraint rows C (m, n + k) of an elimination, with a `pivot` and an `owner` each."""

    C: Sparse
    pivot: IntArray
    owner: IntArray
    #: name of each owner; empty for supports
    labels: Sequence[str]
    #: typical size of each dof; 0 for prescribed values, for which no row is solved
    scale: Array

    def names(self, rows: IntArray) -> str:
        """Names of the joints to which some rows belong, for messages."""
        return ", ".join(dict.fromkeys(self.labels[k] or "the supports" for k in self.owner[rows]))


def eliminate(
    rows: Sequence[Rows], fixed: BoolArray, scale: Array, prescribed: Array | None = None
) -> Eliminated:
    """Solve the constraints for the dependent dofs; return T of u = T q.

    Parameters
    ----------
    rows : constraints of all joints, the supports first.
    fixed : (n,) dofs that are zero.
    scale : (n,) typical size of each dof: 1 for displacements, 1/length for rotations.
    prescribed : (m, k) values of the rows, for `particular`. Values of dependent rows are ignored.
    """
    n = len(fixed)
    C = scipy.sparse.vstack([Sparse((0, n)), *(r.matrix for r in rows)]).tocsr()
    pivot = np.concatenate([np.zeros(0, dtype=int), *(r.pivot for r in rows)])
    C = _without(C, fixed, scale)

    # the system of the dofs that occur in constraints
    nonempty_rows = np.flatnonzero(np.diff(C.indptr))
    involved = np.unique(C.indices)
    number = np.full(n + 1, -1)  # number[-1], of no dof, is -1
    number[involved] = np.arange(len(involved))
    owner = np.repeat(np.arange(len(rows)), [r.matrix.shape[0] for r in rows])[nonempty_rows]
    labels = [r.label for r in rows]
    values = Sparse((len(nonempty_rows), 0) if prescribed is None else -prescribed[nonempty_rows])
    system = _System(
        scipy.sparse.hstack([C[nonempty_rows][:, involved], values]).tocsr(),
        number[pivot[nonempty_rows]],
        owner,
        labels,
        np.append(scale[involved], np.zeros(values.shape[1])),
    )
    transformation, dependent, redundant = _solved(system)
    _check(system, transformation)

    free = ~fixed
    free[involved] = False
    count = len(involved)
    block = transformation[:count, :count].tocoo()
    diagonal = np.flatnonzero(free)
    T = scipy.sparse.csr_matrix(
        (
            np.concatenate([block.data, np.ones(len(diagonal))]),
            (
                np.concatenate([involved[block.row], diagonal]),
                np.concatenate([involved[block.col], diagonal]),
            ),
        ),
        shape=(n, n),
    )

    is_fixed = fixed.copy()
    is_fixed[involved[dependent]] = True
    particular = None
    if prescribed is not None:
        particular = np.zeros((n, values.shape[1]))
        particular[involved] = transformation[:count, count:].toarray()
    return Eliminated(T, is_fixed, redundant, particular)


def _without(C: Sparse, fixed: BoolArray, scale: Array) -> Sparse:
    """C without the entries of fixed dofs, and without coefficients that are rounding."""
    C.sum_duplicates()
    size = np.where(fixed[C.indices], 0.0, np.abs(C.data) * scale[C.indices])
    row = row_numbers(C)
    C.data = np.where(size > LEAST_COEFFICIENT * largest(size, row, C.shape[0])[row], C.data, 0.0)
    C.eliminate_zeros()
    return C


def _solved(system: _System) -> tuple[Sparse, IntArray, Counter[str]]:
    """(T of the dofs in the constraints, the dependent ones, redundant rows by joint)."""
    T = scipy.sparse.identity(len(system.scale), format="csr")
    rounds, remaining = _peeled(system)
    redundant = Counter[str]()
    dependent = [np.zeros(0, dtype=int)]
    if len(remaining):
        solved, pivots, redundant = _blocks(system, remaining)
        T = _substituted(T, solved, pivots)
        dependent.append(pivots)
    for solved_rows, pivots in reversed(rounds):
        T = _substituted(T, _for_pivots(system.C[solved_rows], pivots), pivots)
        dependent.append(pivots)
    return T, np.concatenate(dependent), redundant


def _peeled(system: _System) -> tuple[list[tuple[IntArray, IntArray]], IntArray]:
    """(rounds of (rows, dofs for which they are solved), remaining rows).

    A dof for which a row of one round is solved occurs in no other row of this round or of later
    ones.
    """
    rounds: list[tuple[IntArray, IntArray]] = []
    remaining = np.arange(system.C.shape[0])
    while len(remaining):
        C = system.C[remaining]
        row = row_numbers(C)
        size = np.abs(C.data) * system.scale[C.indices]
        preferred = system.pivot[remaining][row]
        large = size >= PIVOT * largest(size, row, len(remaining))[row]
        is_single = np.bincount(C.indices, minlength=C.shape[1])[C.indices] == 1
        fits = np.flatnonzero(is_single & np.where(preferred < 0, large, preferred == C.indices))
        if not len(fits):
            break
        fits = fits[np.argsort(size[fits], kind="stable")]  # the largest is written last
        pivot = np.full(len(remaining), -1)
        pivot[row[fits]] = C.indices[fits]
        solved = pivot >= 0
        rounds.append((remaining[solved], pivot[solved]))
        remaining = remaining[~solved]
    return rounds, remaining


def _for_pivots(C: Sparse, pivots: IntArray) -> Sparse:
    """Rows of C solved for their pivots: functionals of other dofs that equal them."""
    row = row_numbers(C)
    is_pivot = C.indices == pivots[row]
    pivot_values = np.zeros(C.shape[0])
    pivot_values[row[is_pivot]] = C.data[is_pivot]
    data = np.where(is_pivot, 0.0, -C.data / pivot_values[row])
    solved = scipy.sparse.csr_matrix((data, C.indices, C.indptr), shape=C.shape)
    solved.eliminate_zeros()
    return solved


def _substituted(T: Sparse, solved: Sparse, pivots: IntArray) -> Sparse:
    """T with the dofs `pivots` replaced by the functionals `solved` of other dofs."""
    new_rows = (solved @ T).tocoo()
    kept_dofs = np.ones(T.shape[0])
    kept_dofs[pivots] = 0.0
    kept_rows = scipy.sparse.diags(kept_dofs) @ T @ scipy.sparse.diags(kept_dofs)
    selection = scipy.sparse.csr_matrix(
        (new_rows.data, (pivots[new_rows.row], new_rows.col)), shape=T.shape
    )
    result = (kept_rows + selection).tocsr()
    result.eliminate_zeros()
    return result


def _blocks(system: _System, remaining: IntArray) -> tuple[Sparse, IntArray, Counter[str]]:
    """(solved rows, their dofs, redundant rows by joint) of rows that share dofs."""
    pattern = abs(system.C[remaining][:, system.scale > 0])
    count, block = scipy.sparse.csgraph.connected_components(pattern @ pattern.T, directed=False)
    order = np.argsort(block, kind="stable")
    ends = np.searchsorted(block[order], np.arange(count + 1))

    parts, pivots = [], []
    redundant = Counter[str]()
    for k in range(count):
        rows = remaining[order[ends[k] : ends[k + 1]]]
        solved, pivot_dofs, dependent = _block(system, rows)
        parts.append(solved)
        pivots.append(pivot_dofs)
        if len({system.labels[owner] for owner in system.owner[rows]} - {""}) > 1:
            redundant.update(system.labels[owner] for owner in system.owner[dependent])
    del redundant[""]
    return scipy.sparse.vstack(parts).tocsr(), np.concatenate(pivots), redundant


def _block(system: _System, rows: IntArray) -> tuple[Sparse, IntArray, IntArray]:
    """Solve one block of coupled rows: (solved rows, their dofs, redundant rows)."""
    C = system.C[rows]
    if C.shape[0] > LARGEST_BLOCK:
        raise InputError(
            f"{C.shape[0]} constraints of {system.names(rows)} overlap, more than "
            f"{LARGEST_BLOCK}: let the joints act on groups that do not share nodes."
        )

    columns = np.unique(C.indices)
    prescribed_columns = columns[system.scale[columns] == 0]  # the last ones
    columns = columns[: len(columns) - len(prescribed_columns)]
    scale = system.scale[columns]
    A = C[:, columns].toarray() * scale
    size = np.linalg.norm(A, axis=1, keepdims=True)
    A /= size

    independent = _independent(A)
    Q, R, order = scipy.linalg.qr(A[independent], mode="economic", pivoting=True)
    rank = len(independent)
    solved = -scipy.linalg.solve_triangular(R[:, :rank], R[:, rank:])
    solved[np.abs(solved) < LEAST_COEFFICIENT] = 0.0
    largest = np.abs(solved).max(initial=0.0)
    if largest > LARGEST_COEFFICIENT:
        raise AccuracyError(
            f"the constraints of {system.names(rows)} are nearly dependent: a coefficient of "
            f"their solution is {largest:.1e} (limit {LARGEST_COEFFICIENT:.0e}); move the joints "
            "apart, or remove one of them."
        )

    pivots = order[:rank]
    dependent = order[rank:]
    prescribed = Q.T @ (C[:, prescribed_columns].toarray() / size)[independent]
    solved = np.hstack(
        [solved / scale[dependent], -scipy.linalg.solve_triangular(R[:, :rank], prescribed)]
    )
    values = solved * scale[pivots][:, None]
    used_columns = np.append(columns[dependent], prescribed_columns)
    indices = np.repeat(np.arange(rank), len(used_columns)), np.tile(used_columns, rank)
    result = scipy.sparse.csr_matrix((values.ravel(), indices), shape=(rank, C.shape[1]))
    return result, columns[pivots], np.delete(rows, independent)


def _independent(A: Array) -> IntArray:
    """Numbers of rows of A that do not depend on earlier ones."""
    R = scipy.linalg.qr(A.T, mode="r")[0]
    basis = np.zeros((R.shape[0], len(A)), order="F")
    independent: list[int] = []
    for k, column in enumerate(R.T):
        space = basis[:, : len(independent)]
        for _ in range(2):  # twice is enough (Kahan)
            column = column - space @ (space.T @ column)
        size = np.linalg.norm(column)
        if size > DEPENDENT:
            basis[:, len(independent)] = column / size
            independent.append(k)
    return np.array(independent, dtype=int)


def _check(system: _System, T: Sparse) -> None:
    """AccuracyError if u = T q does not satisfy the constraints."""
    if not system.C.shape[0]:
        return
    scale = scipy.sparse.diags(system.scale)
    residual = abs(system.C @ T @ scale).max(axis=1).toarray().ravel()
    size = (abs(system.C) @ abs(T) @ scale).max(axis=1).toarray().ravel()
    error = residual / np.maximum(size, np.finfo(float).tiny)
    worst = int(np.argmax(error))
    if error[worst] > SATISFIED:
        raise AccuracyError(
            f"the constraints of {system.names(np.array([worst]))} are satisfied only to "
            f"{error[worst]:.1e} (limit {SATISFIED:.0e}): they are nearly dependent on others."
        )
