"""Motions of an assembly without strain: of the whole as a rigid body, and of parts by themselves.

The rigid motions of all connected pieces of the parts span the motions without strain before the
parts are joined. Those that satisfy all constraints and stretch no spring are the null vectors of
K: the rigid motions of the whole, and the mechanisms that the joints leave.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse
from mpi4py import MPI

from antiosc.base._types import Array, BoolArray, IntArray, Matrix
from antiosc.base.errors import AccuracyError, InputError, warn
from antiosc.fem.assembly.joint import Eliminated
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.superelement import MOVE, TURN
from antiosc.fem.linalg.algebra import force_ratios, multiply
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.meshed import Member
from antiosc.fem.structure.null_space import SHIFT, orthonormal
from antiosc.fem.structure.placement import skew
from antiosc.fem.structure.rigid_body_modes import on_dofs, polynomials

#: Residual of the constraints over the sizes of their terms below which a motion satisfies them.
SATISFIES = 1e-9
#: Entries of a dense matrix that are worked on at a time.
ENTRIES_AT_ONCE = 10_000_000
#: Share of a motion below which a part of it is rounding.
STILL = 1e-7


@dataclass(frozen=True, eq=False)
class Loose:
    """A piece of a part, or a reference point, that moves by itself before it is joined."""

    name: str  # for messages
    rows: IntArray  # its dofs in u
    centre: Array  # (3,) [m]
    size: float  # half of its extent [m]
    motions: Array  # (rows, 6) unit translations and rotations (about the centre, by 1/size)


def rigid_motions(layout: Layout, point: Array) -> Array:
    """The six rigid motions (n, 6) of u: translations along x, y, z, rotations about `point`."""
    result = np.zeros((layout.count, 6))
    for member in layout.members.values():
        result[member.rows] = member.rigid(point)
    for one in layout.condensed.values():
        result[one.rows] = one.motions(point)
    for name, x in layout.points.items():
        six = np.eye(6)
        six[:3, 3:] = -skew(x - point)
        result[layout.of_point(name)] = six
    if layout.plane:
        result[:, [2, 3, 4]] = 0.0
    return result


def pieces(layout: Layout) -> Iterator[Loose]:
    """What moves by itself before it is joined."""
    for member in layout.members.values():
        labels = member.pieces
        for label in range(int(labels.max()) + 1):
            nodes = np.flatnonzero(labels == label)
            centre, size = _around(member.nodes[nodes], layout)
            rows = (member.block * nodes[:, None] + np.arange(member.block)).ravel()
            motions = member.rigid(centre)[rows]
            yield _loose(layout, member.name, member.first + rows, centre, size, motions)
    for one in layout.condensed.values():
        centre, size = _around(one.points, layout)
        rows = np.arange(one.first, one.first + one.size)
        yield _loose(layout, one.name, rows, centre, size, one.motions(centre))
    for name, x in layout.points.items():
        size = layout.size / 2
        yield _loose(layout, name, layout.of_point(name), x, size, np.eye(6))


def _around(x: Array, layout: Layout) -> tuple[Array, float]:
    """Centre (3,) and half of the extent of points x (n, 3) [m]."""
    size = float(np.linalg.norm(np.ptp(x, axis=0))) / 2
    return (x.min(axis=0) + x.max(axis=0)) / 2, max(size, 1e-9 * layout.size)


def whole(layout: Layout, point: Array) -> Loose:
    """The whole assembly as one piece that moves about `point`."""
    rows = np.arange(layout.count)
    return _loose(layout, "all", rows, point, layout.size / 2, rigid_motions(layout, point))


def _loose(
    layout: Layout, name: str, rows: IntArray, centre: Array, size: float, motions: Array
) -> Loose:
    motions = motions.copy()
    motions[:, 3:] /= size
    if layout.plane:
        motions[:, [2, 3, 4]] = 0.0
    return Loose(name, rows, centre, size, motions)


def free_motions(
    layout: Layout, constraints: Sparse, fixed: BoolArray, scale: Array
) -> tuple[Array, Array, list[Loose]]:
    """Motions without strain that satisfy the constraints and leave fixed dofs at zero.

    Returns (rigid motions of the whole (n, r), mechanisms (n, m), the pieces that move in them).
    """
    point = (layout.low + layout.high) / 2
    together = whole(layout, point).motions
    together = together[:, np.abs(together).max(axis=0) > 0]
    rows = _rows(constraints, fixed, scale)
    rigid = together @ _null(rows @ together)
    loose = list(pieces(layout))
    if len(loose) == 1:
        return rigid, np.zeros((layout.count, 0)), []
    N = _side_by_side(layout, loose)
    found = N @ _null(rows @ N)
    mechanisms = _beside(found, rigid)
    moving = [
        one for one in loose if mechanisms.shape[1] and np.abs(mechanisms[one.rows]).max() > STILL
    ]
    return rigid, mechanisms, moving


def _side_by_side(layout: Layout, loose: Sequence[Loose]) -> Sparse:
    """The motions of all pieces as columns of u."""
    rows, columns, values, count = [], [], [], 0
    for one in loose:
        own = one.motions[:, np.abs(one.motions).max(axis=0) > 0]
        rows.append(np.repeat(one.rows, own.shape[1]))
        columns.append(np.tile(count + np.arange(own.shape[1]), len(own)))
        values.append(own.ravel())
        count += own.shape[1]
    where = np.concatenate(rows), np.concatenate(columns)
    shape = layout.count, count
    return scipy.sparse.csr_matrix((np.concatenate(values), where), shape=shape)


def _rows(constraints: Sparse, fixed: BoolArray, scale: Array) -> Sparse:
    """Constraints of unit size, and the fixed dofs."""
    size = np.asarray(abs(constraints) @ scale).ravel()
    keep = size > 0
    units = scipy.sparse.identity(len(fixed), format="csr")[np.flatnonzero(fixed)]
    units = scipy.sparse.diags(1 / scale[fixed]) @ units
    return scipy.sparse.vstack(
        [scipy.sparse.diags(1 / size[keep]) @ constraints[keep], units]
    ).tocsr()


def _null(E: Array | Sparse) -> Array:
    """An orthonormal basis (k, r) of the columns' combinations that vanish in E (m, k)."""
    k = E.shape[1]
    if not E.shape[0]:
        return np.eye(k)
    R = np.zeros((0, k))
    for some in np.array_split(np.arange(E.shape[0]), 1 + E.shape[0] * k // ENTRIES_AT_ONCE):
        own = E[some].toarray() if scipy.sparse.issparse(E) else E[some]
        R = scipy.linalg.qr(np.vstack([R, own]), mode="r")[0][:k]
    _, values, right = np.linalg.svd(R)
    values = np.concatenate([values, np.zeros(k - len(values))])
    return np.asarray(right[values <= SATISFIES * max(1.0, values[0])].T)


def _beside(found: Array, rigid: Array) -> Array:
    """The motions among `found` that are orthogonal to `rigid`, orthonormal."""
    if not found.shape[1]:
        return found
    basis = np.linalg.qr(rigid)[0] if rigid.shape[1] else rigid
    left = found - basis @ (basis.T @ found)
    left -= basis @ (basis.T @ left)
    U, values, _ = np.linalg.svd(left, full_matrices=False)
    count = found.shape[1] - rigid.shape[1]
    return np.asarray(U[:, :count] * values[:count])


def described(one: Loose, motions: Array) -> str:
    """The motions (rows of u, m) of a piece in words."""
    coefficients = np.linalg.lstsq(one.motions, motions[one.rows], rcond=1e-9)[0]
    size = np.linalg.norm(coefficients, axis=0)
    return rigid_body_modes.of_body(
        coefficients[:, size > STILL] / size[size > STILL], one.centre, one.size
    )


def fields(layout: Layout) -> Array:
    """Quadratic polynomial displacement fields (n, k) of the whole; the rigid ones come first."""
    centre, size = (layout.low + layout.high) / 2, float((layout.high - layout.low).max())
    columns = []
    for _, field in polynomials(2 if layout.plane else 3):
        column = np.zeros(layout.count)
        for member in layout.members.values():
            column[member.rows] = on_dofs(member.part.form, field, centre, size, member.at)
        for one in layout.condensed.values():
            move, turn = field((one.positions - centre) / size)
            kind, axes = one.part.kind, one.axes.T
            column[one.rows] = (kind == MOVE) * (axes * move).sum(axis=0) + (
                (kind == TURN) * (axes * turn).sum(axis=0) / size
            )
        for name, x in layout.points.items():
            move, turn = field(((x - centre) / size)[None])
            column[layout.of_point(name)] = np.concatenate([move[:, 0], turn[:, 0] / size])
        columns.append(column)
    return np.column_stack(columns)


#: Share of the largest motion below which a part is at rest, but for rounding.
AT_REST = 1e-6
#: Share of the largest mass of a motion below which it has none.
IDLE_MASS = 1e-12
#: Force of a motion without strain over that of the entries of K; rounding leaves about 1e-15.
STRAINLESS = 1e-9


def modes_of(
    layout: Layout,
    K: Matrix,
    M: Matrix,
    eliminated: Eliminated,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[Loose],
) -> tuple[Array, float]:
    """(M-orthonormal motions without strain, first shift)."""
    found = eliminated.coordinates(np.hstack([rigid, mechanisms]))
    comm = MPI.COMM_SELF
    modes = orthonormal(comm, M, found)
    if modes.shape[1] < found.shape[1]:
        weight = found.T @ multiply(M, found)
        values, turn = np.linalg.eigh(weight)
        idle = eliminated.T @ found @ turn[:, values <= IDLE_MASS * values[-1]]
        points = [one for one in moving if np.abs(idle[one.rows]).max() > STILL]
        raise InputError(
            "a reference point moves without resistance and without mass: "
            f"{_in_words(idle, points)}; join it, support it, or give it a mass."
        )
    if not modes.shape[1]:
        return modes, 0.0
    u = eliminated.T @ modes
    least = AT_REST * np.abs(u).max()
    left = max(_force_ratio(m, u[m.rows], least) for m in layout.members.values())
    if left > STRAINLESS:
        raise AccuracyError(
            f"a motion that no joint resists strains the assembly (‖K r‖/(‖K‖‖r‖) = {left:.1e}, "
            f"limit {STRAINLESS:.0e}): parts or their distances differ too much in size for double "
            "precision."
        )
    if modes.shape[1] == np.count_nonzero(~eliminated.dependent):
        return modes, 1.0  # any will do
    polynomial = eliminated.coordinates(fields(layout))
    return modes, SHIFT * rigid_body_modes.first_elastic(comm, K, M, polynomial, modes)


def _force_ratio(member: Member, u: Array, least: float) -> float:
    """Largest force of motions (rows, k) of a part over that of the entries of its K.

    Motions below `least` are rounding.
    """
    moving = u[:, np.abs(u).max(axis=0) > least]
    if not moving.size:
        return 0.0
    K = member.part.K
    return float(force_ratios(K, moving, multiply(K, moving)).max())


def tell_motions(
    layout: Layout,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[Loose],
    *,
    supported: bool,
) -> None:
    """Warn of mechanisms, and of rigid motions that supports leave."""
    if mechanisms.shape[1]:
        warn(
            "the joints leave parts free to move without strain: "
            f"{_in_words(mechanisms, moving)}; join or hold them unless it is intended.",
        )
    if supported and rigid.shape[1]:
        together = whole(layout, (layout.low + layout.high) / 2)
        warn(
            "the supports leave the assembly free to move as a rigid body: "
            f"{described(together, rigid)}; hold that too unless it is intended.",
        )


def _in_words(mechanisms: Array, moving: Sequence[Loose]) -> str:
    """The motion of each piece in mechanisms."""
    names: dict[str, str] = {}
    for one in moving:
        names.setdefault(one.name, described(one, mechanisms))
    return "; ".join(f"{name!r}: {words}" for name, words in names.items())
