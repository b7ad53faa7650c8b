"""`assemble`: one structure of several parts, u = T q eliminated from constraints C u = 0.

A row is solved for a dof that occurs in no other row, as long as there are such rows (a triangular
elimination, which keeps T sparse). The remaining rows, which overlap or form cycles, are solved in
connected blocks by a pivoted QR factorization, which also detects dependent rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.csgraph

from antiosc.base._types import Array, BoolArray, IntArray, SolverChoice
from antiosc.base.checks import list_of, point_text
from antiosc.base.clock import clock
from antiosc.base.errors import AccuracyError, InputError, warn
from antiosc.fem.assembly import assembled
from antiosc.fem.assembly.assembled import (
    Added,
    AssembledMatrices,
    RigidDofs,
    as_petsc,
    modes_of,
    reduced,
    stacked,
    warn_of_motions,
)
from antiosc.fem.assembly.joint import (
    Constraints,
    Eliminated,
    HeldDofs,
    Joint,
    Redundant,
    Rows,
    Stiffness,
    attachment,
    superelement,
    support_rows,
)
from antiosc.fem.assembly.layout import Layout, Sparse, largest, nested_basis, rounded, row_numbers
from antiosc.fem.assembly.parts import (
    checked_parts,
    checked_places,
    checked_points,
)
from antiosc.fem.linalg.solver import checked_choice
from antiosc.fem.platform import collective
from antiosc.fem.structure import TURN, Placement
from antiosc.fem.structure.attachments import Attachment, Damper, PointMass, Spring, attachments_of
from antiosc.fem.structure.structure import Structure, holding
from antiosc.fem.structure.support import Support
from antiosc.models.anti_oscillators import AntiOscillators

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
    """Constraint rows C (m, n + k) of an elimination; `pivot` and `owner` have one entry for each
    row."""

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
    rows: Sequence[Rows],
    fixed: BoolArray,
    scale: Array,
    basis: Sparse | None = None,
    prescribed: Array | None = None,
) -> Eliminated:
    """Solve the constraints for the dependent dofs; return T of u = T q.

    Parameters
    ----------
    rows : constraints of all joints, the supports first.
    fixed : (n,) dofs that are zero.
    scale : (n,) typical size of each dof: 1 for displacements, 1/length for rotations.
    basis : (n, n), orthogonal; then T = basis · T', and the constraints determine T'.
    prescribed : (m, k) values of the rows, for `particular`. Values of dependent rows are ignored.
    """
    n = len(fixed)
    C = scipy.sparse.vstack([Sparse((0, n)), *(r.matrix for r in rows)]).tocsr()
    pivot = np.concatenate([np.zeros(0, dtype=int), *(r.pivot for r in rows)])
    if basis is not None:
        C = rounded((C @ basis).tocsr())
        is_single = np.append(np.diff(basis.indptr) == 1, True)  # pivot[-1] stays
        pivot = np.where(is_single[pivot], pivot, -1)
    C = _without(C, fixed, scale)
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
    if basis is not None:
        T = (basis @ T).tocsr()
        particular = None if particular is None else basis @ particular
    return Eliminated(T, is_fixed, redundant, basis, particular)


def _without(C: Sparse, fixed: BoolArray, scale: Array) -> Sparse:
    """C without the entries of fixed dofs, and without coefficients that are rounding in
    their row.
    """
    C.sum_duplicates()
    size = np.where(fixed[C.indices], 0.0, np.abs(C.data) * scale[C.indices])
    row = row_numbers(C)
    C.data = np.where(size > LEAST_COEFFICIENT * largest(size, row, C.shape[0])[row], C.data, 0.0)
    C.eliminate_zeros()
    return C


def _solved(system: _System) -> tuple[Sparse, IntArray, list[Redundant]]:
    """(T of the dofs in the constraints, numbers of the dependent dofs, redundant joints)."""
    T = scipy.sparse.identity(len(system.scale), format="csr")
    rounds, remaining = _peeled(system)
    redundant: list[Redundant] = []
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
    """Rows of C, each solved for its pivot dof: functionals of the other dofs that equal the
    pivots."""
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


def _blocks(system: _System, remaining: IntArray) -> tuple[Sparse, IntArray, list[Redundant]]:
    """(solved rows, their dofs, redundant joints) of rows that share dofs, solved block by
    block.
    """
    pattern = abs(system.C[remaining][:, system.scale > 0])
    count, block = scipy.sparse.csgraph.connected_components(pattern @ pattern.T, directed=False)
    order = np.argsort(block, kind="stable")
    ends = np.searchsorted(block[order], np.arange(count + 1))
    parts, pivots = [], []
    by_joint: dict[int, tuple[set[int], int]] = {}
    for k in range(count):
        solved, pivot_dofs, redundant_rows = _block(system, remaining[order[ends[k] : ends[k + 1]]])
        parts.append(solved)
        pivots.append(pivot_dofs)
        for joint, spanning in redundant_rows:
            earlier, times = by_joint.get(joint, (set(), 0))
            by_joint[joint] = earlier | spanning, times + 1
    redundant = []
    for joint, (spanning, times) in sorted(by_joint.items()):
        names = [system.labels[k] for k in sorted(spanning) if system.labels[k]]
        if system.labels[joint]:
            redundant.append((system.labels[joint], names, times))
    return scipy.sparse.vstack(parts).tocsr(), np.concatenate(pivots), redundant


def _block(system: _System, rows: IntArray) -> tuple[Sparse, IntArray, list[tuple[int, set[int]]]]:
    """Solve one block of coupled rows: (solved rows, their dofs, redundant rows as (joint, other
    joints))."""
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
    independent_rows, dependent_rows = _independent(A, system.owner[rows])
    Q, R, order = scipy.linalg.qr(A[independent_rows], mode="economic", pivoting=True)
    rank = len(independent_rows)
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
    prescribed = Q.T @ (C[:, prescribed_columns].toarray() / size)[independent_rows]
    solved = np.hstack(
        [solved / scale[dependent], -scipy.linalg.solve_triangular(R[:, :rank], prescribed)]
    )
    values = solved * scale[pivots][:, None]
    used_columns = np.append(columns[dependent], prescribed_columns)
    indices = np.repeat(np.arange(rank), len(used_columns)), np.tile(used_columns, rank)
    result = scipy.sparse.csr_matrix((values.ravel(), indices), shape=(rank, C.shape[1]))
    return result, columns[pivots], dependent_rows


def _independent(A: Array, owner: IntArray) -> tuple[IntArray, list[tuple[int, set[int]]]]:
    """(numbers of linearly independent rows of A, (joint, joints that span its row) of the
    others).
    """
    R = scipy.linalg.qr(A.T, mode="r")[0]
    space = np.zeros((R.shape[0], len(A)), order="F")
    upper = np.zeros((min(R.shape), min(R.shape)))  # the rows kept = space · upper
    independent_rows: list[int] = []
    dependent_rows = []
    for k, column in enumerate(R.T):
        count = len(independent_rows)
        basis = space[:, :count]
        share = basis.T @ column
        remainder = column - basis @ share
        projection = basis.T @ remainder
        remainder -= basis @ projection  # twice is enough (Kahan)
        share += projection
        remainder_size = np.linalg.norm(remainder)
        if remainder_size > DEPENDENT:
            space[:, count] = remainder / remainder_size
            upper[: count + 1, count] = np.append(share, remainder_size)
            independent_rows.append(k)
            continue
        weights = scipy.linalg.solve_triangular(upper[:count, :count], share)
        owners = owner[np.array(independent_rows)[np.abs(weights) > DEPENDENT]]
        dependent_rows.append((int(owner[k]), {int(joint) for joint in owners}))
    return np.array(independent_rows, dtype=int), dependent_rows


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


@collective()
def assemble(
    parts: Mapping[str, Structure | AntiOscillators],
    joints: Sequence[Joint] = (),
    at: Mapping[str, Placement | Sequence[float]] | None = None,
    *,
    points: Mapping[str, Sequence[float]] | None = None,
    supports: Sequence[Support] = (),
    attached: Sequence[Attachment] = (),
    solver: SolverChoice = "auto",
) -> Structure:
    """One structure of several parts, joined by linear constraints u = T q.

    Parameters
    ----------
    parts : dict
        Name -> Structure of a mesh, of any family, order and material, with its own supports. One
        Structure may stand under several names. A part may also be a superelement: a model of
        several sites (`extract(structure, {name: Site, ...})`), whose sites "part:name" joints act
        on, or `Structure.from_matrices(K, M, map=...)` with coordinates, by "part:number" of nodes.
    joints : sequence of joints
        `Tie`, `Rigid`, `Mean`, `Weld`, `Hinge`, `Slider`, `Ball`, `Bolt`, `Bushing`, `Equation`.
    at : dict, optional
        Name -> `Placement`, or a translation (x, y, z) in m. Other parts stay where their mesh is.
        Supports of a part move with it.
    points : dict, optional
        Name -> coordinates in m of reference points: points with six dofs that belong to no part.
        Joints, supports, masses and springs act on them by name.
    supports : sequence of Support
        `where` is "part:group", the name of a reference point, or a function of coordinates of all
        parts; `fix` names components in the axes of the assembly.
    attached : sequence of PointMass, Spring and Damper
        At "part:group", a reference point, or coordinates (on the nearest part). On a group of
        more than points they act on its mean motion.
    solver : "auto", "direct" or "iterative"
        As for `Structure`.

    Returns
    -------
    Structure
        `extract`, `probe`, `write_series` and `full` take it. Sites and probes are
        at points; of parts that touch, `Site(..., part=...)` names the one that is struck.

    Raises
    ------
    InputError
        Unknown parts, groups and points; a joint that joins nothing; parts that remain loose.
    AccuracyError
        Constraints that nearly follow from others.

    Warns
    -----
    AntioscWarning
        Constraints that follow from others; motions that the joints leave free.
    """
    return assemble_checked(
        parts,
        list_of("joints", joints, Joint, "joints such as Tie and Hinge"),
        at,
        points=points,
        supports=supports,
        attached=attached,
        solver=solver,
    )


def assemble_checked(
    parts: Mapping[str, Structure | AntiOscillators],
    joints: Sequence[Joint],
    at: Mapping[str, Placement | Sequence[float]] | None = None,
    *,
    points: Mapping[str, Sequence[float]] | None = None,
    supports: Sequence[Support] = (),
    attached: Sequence[Attachment] = (),
    solver: SolverChoice = "auto",
    apart: bool = False,
) -> Structure:
    """`assemble` for checked joints; `apart` permits parts without a joint, if supports hold each
    part."""
    start_time = clock()
    solver = checked_choice(solver)
    members = checked_parts(parts)
    layout = Layout(members, checked_places(members, at), checked_points(members, points))
    joined = _joined(layout, joints, supports, attachments_of(attached), apart)
    eliminated = joined.eliminated
    K, M = reduced(layout, eliminated, joined.added)
    modes, shift = modes_of(layout, K, M, eliminated, *joined.motions)
    if modes.shape[1] == np.count_nonzero(~eliminated.dependent):  # a rigid body: K is rounding
        K = as_petsc("K", scipy.sparse.diags(eliminated.dependent.astype(float)).tocsr(), layout)

    matrices = AssembledMatrices(
        K,
        M,
        np.flatnonzero(eliminated.dependent),
        modes,
        shift,
        solver,
        layout=layout,
        eliminated=eliminated,
        added=joined.added,
        constraints=joined.constraints,
    )
    self = holding(matrices, start_time)
    self.supports = (supports,) if isinstance(supports, Support) else tuple(supports)
    return self


@dataclass(frozen=True, eq=False)
class _Joined:
    """Parts that are joined, before their matrices are."""

    constraints: Constraints
    eliminated: Eliminated
    added: Added
    #: rigid motions (n, r), mechanisms (n, m), the bodies that move in them
    motions: tuple[Array, Array, list[RigidDofs]]


def _joined(
    layout: Layout,
    joints: Sequence[Joint],
    supports: Sequence[Support],
    attached: Sequence[PointMass | Spring | Damper],
    allow_apart: bool,
) -> _Joined:
    """The constraints and terms of all joints, supports and attachments."""
    labels = [joint.label(k + 1) for k, joint in enumerate(joints)]
    for joint, label in zip(joints, labels, strict=True):
        joint.prepare(layout, label)
    fixed = _fixed(layout)
    places = layout.places
    scale = np.where(places.kind == TURN, 1 / layout.size, 1.0)  # of displacements and rotations
    checked_supports = list_of("supports", supports, Support, "Support(where, fix)")
    rows = [Rows.free(support_rows(layout, support), "") for support in checked_supports]
    elastic: list[Stiffness] = []
    for joint, label in sorted(zip(joints, labels, strict=True), key=lambda pair: pair[0].late):
        rows += joint.constraints(layout, HeldDofs(rows, fixed), label)
        elastic += [replace(support, name=label) for support in joint.elastic(layout, label)]
    for support in attached:
        elastic += attachment(layout, support)
    elastic += [superelement(layout, support) for support in layout.condensed.values()]
    if not allow_apart:
        _check_joined(layout, rows, elastic)
    everything = stacked([*(r.matrix for r in rows), *(e.G for e in elastic)], layout.count)
    basis = nested_basis(everything, fixed, places.points)
    eliminated = eliminate(rows, fixed, scale, basis)
    constraints = Constraints(rows, fixed, scale, basis)
    _warn_of_redundant(eliminated.redundant)
    if eliminated.dependent.all():
        raise InputError("supports and joints hold every dof of the assembly: nothing moves.")
    added = Added(elastic, eliminated.T)
    stretches = [scipy.sparse.csr_matrix(support.strains) @ support.G for support in elastic]
    C = stacked([*(r.matrix for r in rows), *stretches], layout.count)
    motions = assembled.free_motions(layout, C, fixed, scale)
    supported = bool(supports) or any(len(m.part.fixed) for m in layout.members.values())
    warn_of_motions(layout, *motions, supported=supported)
    return _Joined(constraints, eliminated, added, motions)


# -- the dofs


def _fixed(layout: Layout) -> BoolArray:
    """Mask of the fixed dofs: of supported parts, and of reference points out of the plane of plane
    parts."""
    fixed = np.zeros(layout.count, dtype=bool)
    for member in layout.members.values():
        fixed[member.first + member.part.fixed] = True
    for superelement_part in layout.condensed.values():
        fixed[superelement_part.rows] = superelement_part.part.fixed
    for name in layout.points:
        if layout.plane:
            fixed[layout.of_point(name)[[2, 3, 4]]] = True
    return fixed


def _warn_of_redundant(redundant: Sequence[Redundant]) -> None:
    """Warn of constraints that follow from those of other joints."""
    for label in dict.fromkeys(label for label, _, _ in redundant):
        redundant_rows = [(spanning, times) for name, spanning, times in redundant if name == label]
        count = sum(times for _, times in redundant_rows)
        leading = list(dict.fromkeys(n for names, _ in redundant_rows for n in names if n != label))
        if leading:
            warn(
                f"{count} constraint{'s' if count > 1 else ''} of {label} follow"
                f"{'' if count > 1 else 's'} from those of {' and '.join(leading)}: the joints "
                "overlap; remove the repeated ones.",
            )


def _check_joined(layout: Layout, rows: Sequence[Rows], elastic: Sequence[Stiffness]) -> None:
    """InputError for a part, a body of a part, or a reference point without any joint."""
    bodies = assembled.unjoined_bodies(layout)
    body = np.zeros(layout.count, dtype=int)
    for k, body_k in enumerate(bodies):
        body[body_k.rows] = k
    # all functionals of one spring belong together
    springs = [Sparse(np.asarray(abs(e.G).sum(axis=0))) for e in elastic]
    links = stacked([*(r.matrix for r in rows if r.label), *springs], layout.count)
    of_row = row_numbers(links)
    touched = scipy.sparse.csr_matrix(
        (np.ones(links.nnz), (body[links.indices], of_row)), shape=(len(bodies), links.shape[0])
    )
    label = scipy.sparse.csgraph.connected_components(touched @ touched.T, directed=False)[1]
    largest = np.bincount(label, [len(body_k.rows) for body_k in bodies]).argmax()
    for k in np.flatnonzero(label != largest):
        body_k = bodies[k]
        if body_k.name in layout.points:
            raise InputError(f"the reference point {body_k.name!r} is joined to nothing.")
        has_pieces = sum(body.name == body_k.name for body in bodies) > 1
        body_text = (
            f"a piece at {point_text(body_k.centre)} of the part" if has_pieces else "the part"
        )
        raise InputError(
            f"{body_text} {body_k.name!r} is joined to nothing else: add a joint, or leave it out."
        )
