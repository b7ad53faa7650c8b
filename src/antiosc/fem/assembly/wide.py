"""Functionals of many dofs, such as the mean motion of a group, without a dense block in K.

If k functionals act on c dofs, elimination would couple all c of them. Instead these dofs get a
basis of their own that is orthonormal and nested (multiwavelets; Alpert, *SIAM J. Math. Anal.* 24
(1993)): in each half of the group, and in each half of it, all but k vectors are chosen so that the
functionals vanish on them. Of the whole group k vectors remain on which the functionals act. A dof
takes part in k vectors for each of log(c) levels, so that K stays sparse.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.csgraph

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.fem.assembly.layout import Sparse, largest, row_numbers

#: A functional of more dofs is wide; of fewer a dense block is as good. With 5000 dofs K has a
#: third of the entries and is made in a fifth of the time; with 1300 the factor is 1.5 times as
#: large.
WIDE = 1500
#: Most functionals that share their dofs, for instance six of each of two means of one group.
MOST_SHARING = 24
#: Dofs of a piece of a group that is not halved any more.
SMALLEST_PIECE = 48
#: Share of the largest coefficient below which one is rounding.
ROUNDED_COEFFICIENT = 1e-13


def nested_basis(functionals: Sparse, fixed: BoolArray, positions: Array) -> Sparse | None:
    """W (n, n), orthogonal, with which wide functionals f W of u = W q act on few q; None: none.

    Parameters
    ----------
    functionals : (m, n) all constraints and functionals of springs and masses.
    fixed : (n,) dofs that are zero.
    positions : (n, 3) where each dof is [m].
    """
    free = scipy.sparse.diags((~fixed).astype(float))
    own = (functionals @ free).tocsr()
    own.eliminate_zeros()
    count = np.diff(own.indptr)
    wide = np.flatnonzero(count > WIDE)
    if not len(wide):
        return None
    narrow = np.zeros(own.shape[1], dtype=bool)
    narrow[own[count <= WIDE].indices] = True
    pattern = abs(own[wide])
    shared = pattern @ pattern.T
    _, label = scipy.sparse.csgraph.connected_components(shared, directed=False)
    entries: list[tuple[IntArray, IntArray, Array]] = []
    changed = np.zeros(own.shape[1], dtype=bool)
    for k in np.unique(label):
        rows = own[wide[label == k]]
        columns = np.unique(rows.indices)
        if rows.shape[0] > MOST_SHARING or narrow[columns].any():
            # those of its dofs that others act on keep their places; few of them do no harm
            columns = columns[~narrow[columns]]
        if rows.shape[0] > MOST_SHARING or len(columns) <= WIDE:
            continue
        changed[columns] = True
        entries.append(_basis(rows[:, columns].toarray(), columns, positions[columns]))
    if not entries:
        return None
    rest = np.flatnonzero(~changed)
    row, column, value = (np.concatenate(each) for each in zip(*entries, strict=True))
    value = np.concatenate([value, np.ones(len(rest))])
    where = np.concatenate([row, rest]), np.concatenate([column, rest])
    return scipy.sparse.csr_matrix((value, where), shape=(own.shape[1],) * 2)


def rounded(matrix: Sparse) -> Sparse:
    """Without coefficients that are rounding beside others of their row."""
    matrix = matrix.tocsr()
    size, row = np.abs(matrix.data), row_numbers(matrix)
    matrix.data[size < ROUNDED_COEFFICIENT * largest(size, row, matrix.shape[0])[row]] = 0.0
    matrix.eliminate_zeros()
    return matrix


def _basis(A: Array, columns: IntArray, positions: Array) -> tuple[IntArray, IntArray, Array]:
    """Entries (row, column, value) of the basis of the dofs `columns` for functionals A (k, c)."""
    A = A / np.linalg.norm(A, axis=1, keepdims=True)
    blocks: list[tuple[IntArray, Array]] = []
    every, last, _ = _halved(A, positions, np.arange(len(columns)), blocks)
    blocks.append((every, last))
    rows, cols, values, first = [], [], [], 0
    for some, vectors in blocks:
        width = vectors.shape[1]
        rows.append(np.repeat(columns[some], width))
        cols.append(np.tile(columns[first : first + width], len(some)))
        values.append(vectors.ravel())
        first += width
    return np.concatenate(rows), np.concatenate(cols), np.concatenate(values)


def _halved(
    A: Array, positions: Array, some: IntArray, blocks: list[tuple[IntArray, Array]]
) -> tuple[IntArray, Array, Array]:
    """(dofs, vectors on which the functionals act, their values there) of a part of the group.

    The vectors on which they vanish are added to `blocks`.
    """
    if len(some) <= SMALLEST_PIECE:
        vectors, values = np.eye(len(some)), A[:, some]
        order = some
    else:
        x = positions[some]
        axis = int(np.argmax(np.ptp(x, axis=0)))
        sorted_ones = some[np.argsort(x[:, axis], kind="stable")]
        half = len(some) // 2
        parts: Sequence[IntArray] = (sorted_ones[:half], sorted_ones[half:])
        found = [_halved(A, positions, part, blocks) for part in parts]
        order = np.concatenate([part for part, _, _ in found])
        vectors = scipy.linalg.block_diag(*(v for _, v, _ in found))
        values = np.hstack([value for _, _, value in found])
    Q, R = scipy.linalg.qr(values.T)
    kept = min(values.shape)
    blocks.append((order, vectors @ Q[:, kept:]))
    return order, vectors @ Q[:, :kept], R[:kept].T
