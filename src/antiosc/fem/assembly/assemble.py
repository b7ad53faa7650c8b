"""`assemble`: one structure of several parts; constraints C u = 0 make their dofs u = T q.

As long as a row contains a dof that occurs in no other row, it is solved for that dof (a triangular
elimination, which keeps T sparse). The remaining rows, which overlap or form cycles, are solved in
connected blocks by a pivoted QR factorization, which also detects dependent rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.csgraph

from antiosc.base._types import Array, BoolArray, IntArray, SolverChoice
from antiosc.base.checks import list_of, point_text, shown
from antiosc.base.clock import clock
from antiosc.base.errors import AccuracyError, InputError, warn
from antiosc.fem.assembly import assembled
from antiosc.fem.assembly.assembled import (
    AddedTerms,
    AssembledMatrices,
    RigidDofs,
    as_petsc,
    body_names,
    modes_and_shift,
    moving_bodies,
    reduced_matrices,
    stacked,
)
from antiosc.fem.assembly.joint import Constraints, Eliminated, Joint, Rows, motion_of_end
from antiosc.fem.assembly.layout import (
    Layout,
    Sparse,
    Superelement,
    checked_parts,
    checked_places,
    checked_points,
    row_maxima,
    row_numbers,
)
from antiosc.fem.linalg.solver import checked_choice
from antiosc.fem.mesh.surface import largest_entities as largest_piece
from antiosc.fem.platform import collective
from antiosc.fem.structure import TURN, Placement, in_space
from antiosc.fem.structure.attachments import Attachment, ElasticTerm, attachments_of, terms_of
from antiosc.fem.structure.loads import PointMotion
from antiosc.fem.structure.meshed import Member
from antiosc.fem.structure.place import places_at
from antiosc.fem.structure.structure import Structure, structure_with
from antiosc.fem.structure.support import NumberedNodes, Support
from antiosc.io.matrices import COMPONENTS, DISPLACEMENTS, ROTATIONS
from antiosc.models.anti_oscillators import AntiOscillators

#: A row depends on earlier rows if less than this share of it is orthogonal to them: decks round
#: coordinates, and so the weights of ties, to 7 digits or more.
DEPENDENT_SHARE = 1e-6
#: Coefficients below this share of the row's largest are rounding.
LEAST_COEFFICIENT = 1e-14
#: Least share of a row's largest coefficient for whose dof it is solved: few grow tenfold.
LEAST_PIVOT = 0.1
#: Largest coefficient of T: half of the 16 digits are then left.
LARGEST_COEFFICIENT = 1e8
#: Largest error of C T over the sizes of its terms: that of a dependent row, and ten times more.
CONSTRAINT_ERROR = 1e-5
#: Most rows of a block of coupled rows, which is solved as a dense matrix: 0.3 GB if it is square.
LARGEST_BLOCK = 6000
#: Most dofs that one functional may couple: K gets a full block of them, of 0.3 GB.
MOST_COUPLED_DOFS = 5000
#: A joint of more rows has one for each node of its group (Tie, Rigid), with few dofs each.
MOST_POINT_ROWS = 24


@dataclass(frozen=True, eq=False)
class _System:
    """Constraint rows C (m, n + k): n dofs, k prescribed values. A row is solved for its `pivot`
    dof (-1: any); `owner` is the index of its label in `labels`."""

    C: Sparse
    pivot: IntArray  # (m,)
    owner: IntArray  # (m,)
    #: name of each owner; empty for supports
    labels: Sequence[str]
    #: (n + k,) typical size of each dof; 0 for columns of prescribed values, which are never pivots
    scale: Array

    def names(self, rows: IntArray) -> str:
        """Names of the joints to which some rows belong, for messages."""
        return ", ".join(dict.fromkeys(self.labels[k] or "the supports" for k in self.owner[rows]))


def eliminate(
    rows: Sequence[Rows], fixed: BoolArray, scale: Array, prescribed: Array | None = None
) -> Eliminated:
    """Motions u = T q that satisfy the constraints `rows` (supports first) and are zero at `fixed`
    dofs. `fixed` (n,): mask; `scale` (n,): typical sizes of dofs; `prescribed` (m, k): k sets of
    right-hand sides, for which `Eliminated.particular` is computed.

    InputError if too many rows overlap; AccuracyError if rows are nearly dependent.
    """
    n = len(fixed)
    C = scipy.sparse.vstack([Sparse((0, n)), *(r.matrix for r in rows)]).tocsr()
    pivot = np.concatenate([np.zeros(0, dtype=int), *(r.pivot for r in rows)])
    C = _significant_entries(C, fixed, scale)

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
    _check_satisfied(system, transformation)

    free = ~fixed
    free[involved] = False
    count = len(involved)
    block = transformation[:count, :count].tocoo()
    diagonal = np.flatnonzero(free)
    values_of_T = np.append(block.data, np.ones(len(diagonal)))
    indices = [np.append(involved[of_block], diagonal) for of_block in (block.row, block.col)]
    T = scipy.sparse.csr_matrix((values_of_T, indices), shape=(n, n))

    is_fixed = fixed.copy()
    is_fixed[involved[dependent]] = True
    particular = None
    if prescribed is not None:
        particular = np.zeros((n, values.shape[1]))
        particular[involved] = transformation[:count, count:].toarray()
    return Eliminated(T, is_fixed, redundant, particular)


def _significant_entries(C: Sparse, fixed: BoolArray, scale: Array) -> Sparse:
    """C without the entries of fixed dofs, and without coefficients that are rounding errors."""
    C.sum_duplicates()
    size = np.where(fixed[C.indices], 0.0, np.abs(C.data) * scale[C.indices])
    row = row_numbers(C)
    largest = row_maxima(size, row, C.shape[0])[row]
    C.data = np.where(size > LEAST_COEFFICIENT * largest, C.data, 0.0)
    C.eliminate_zeros()
    return C


def _solved(system: _System) -> tuple[Sparse, IntArray, Counter[str]]:
    """(T of the dofs in the constraints, the dependent dofs, number of redundant rows by joint)."""
    T = scipy.sparse.identity(len(system.scale), format="csr")
    rounds, remaining = _triangular_rounds(system)
    redundant = Counter[str]()
    dependent = [np.zeros(0, dtype=int)]

    if len(remaining):
        solved, pivots, redundant = _solved_blocks(system, remaining)
        T = _substituted(T, solved, pivots)
        dependent.append(pivots)

    for solved_rows, pivots in reversed(rounds):
        T = _substituted(T, _solved_for_pivots(system.C[solved_rows], pivots), pivots)
        dependent.append(pivots)
    return T, np.concatenate(dependent), redundant


def _triangular_rounds(system: _System) -> tuple[list[tuple[IntArray, IntArray]], IntArray]:
    """([(rows, pivot dofs)] of each round of triangular elimination, remaining rows). Rows of later
    rounds do not contain the pivot dofs of earlier ones."""
    rounds: list[tuple[IntArray, IntArray]] = []
    remaining = np.arange(system.C.shape[0])
    while len(remaining):
        C = system.C[remaining]
        row = row_numbers(C)
        size = np.abs(C.data) * system.scale[C.indices]
        preferred = system.pivot[remaining][row]
        large = size >= LEAST_PIVOT * row_maxima(size, row, len(remaining))[row]
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


def _solved_for_pivots(C: Sparse, pivots: IntArray) -> Sparse:
    """Rows of C solved for their pivots: each row gives its pivot dof in terms of other dofs."""
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


def _solved_blocks(system: _System, remaining: IntArray) -> tuple[Sparse, IntArray, Counter[str]]:
    """(solved rows, pivot dofs, number of redundant rows by joint) of `remaining` coupled rows."""
    pattern = abs(system.C[remaining][:, system.scale > 0])
    count, block = scipy.sparse.csgraph.connected_components(pattern @ pattern.T, directed=False)
    order = np.argsort(block, kind="stable")
    ends = np.searchsorted(block[order], np.arange(count + 1))

    parts, pivots = [], []
    redundant = Counter[str]()
    for k in range(count):
        rows = remaining[order[ends[k] : ends[k + 1]]]
        solved, pivot_dofs, dependent = _solved_block(system, rows)
        parts.append(solved)
        pivots.append(pivot_dofs)
        if len({system.labels[owner] for owner in system.owner[rows]} - {""}) > 1:
            redundant.update(system.labels[owner] for owner in system.owner[dependent])

    del redundant[""]
    return scipy.sparse.vstack(parts).tocsr(), np.concatenate(pivots), redundant


def _solved_block(system: _System, rows: IntArray) -> tuple[Sparse, IntArray, IntArray]:
    """Solve one block of coupled rows: (solved rows, their pivot dofs, redundant rows)."""
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

    independent = _independent_rows(A)
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


def _independent_rows(A: Array) -> IntArray:
    """Numbers of rows of A that do not depend on earlier ones."""
    R = scipy.linalg.qr(A.T, mode="r")[0]
    basis = np.zeros((R.shape[0], len(A)), order="F")
    independent: list[int] = []
    for k, column in enumerate(R.T):
        space = basis[:, : len(independent)]
        for _ in range(2):  # twice is enough (Kahan)
            column = column - space @ (space.T @ column)
        size = np.linalg.norm(column)
        if size > DEPENDENT_SHARE:
            basis[:, len(independent)] = column / size
            independent.append(k)

    return np.array(independent, dtype=int)


def _check_satisfied(system: _System, T: Sparse) -> None:
    """AccuracyError if u = T q does not satisfy the constraints."""
    if not system.C.shape[0]:
        return
    scale = scipy.sparse.diags(system.scale)
    residual = abs(system.C @ T @ scale).max(axis=1).toarray().ravel()
    size = (abs(system.C) @ abs(T) @ scale).max(axis=1).toarray().ravel()
    error = residual / np.maximum(size, np.finfo(float).tiny)
    worst = int(np.argmax(error))
    if error[worst] > CONSTRAINT_ERROR:
        raise AccuracyError(
            f"the constraints of {system.names(np.array([worst]))}, nearly dependent on others, "
            f"have an error of {error[worst]:.1e} (limit {CONSTRAINT_ERROR:.0e}): remove one."
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
        Structure may have several names. A part may also be a superelement: a model of several
        sites (`extract(structure, {name: Site, ...})`), joined at its sites "part:name"; or
        `Structure.from_matrices(K, M, map=...)` with coordinates, joined at nodes "part:number".
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
        lines, faces or cells they act on its mean motion.
    solver : "auto", "direct" or "iterative"
        As for `Structure`.

    Returns
    -------
    Structure
        For `extract`, `probe`, `write_series` and `full`. Sites and probes are at points; where
        parts touch, `Site(..., part=...)` names the struck part.

    Raises
    ------
    InputError
        Unknown parts, groups and points; a joint that joins nothing; parts that remain loose, have
        a prestress or are spread over several ranks.
    AccuracyError
        Constraints that are nearly linearly dependent.

    Warns
    -----
    AntioscWarning
        Redundant (linearly dependent) constraints; motions that the joints leave free.
    """
    start_time = clock()
    joints = list_of("joints", joints, Joint, "joints such as Tie and Hinge")
    solver = checked_choice(solver)

    members = checked_parts(parts)
    layout = Layout(members, checked_places(members, at), checked_points(members, points))
    joined = _joined(layout, joints, supports, attachments_of(attached))
    eliminated = joined.eliminated
    K, M = reduced_matrices(layout, eliminated, joined.added)
    modes, shift = modes_and_shift(layout, K, M, eliminated, joined.motions, joined.bodies)
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
    self = structure_with(matrices, start_time)
    self.supports = (supports,) if isinstance(supports, Support) else tuple(supports)
    return self


@dataclass(frozen=True, eq=False)
class _Joined:
    """Constraints, terms of K and M, and free motions of joined parts, before their assembly."""

    constraints: Constraints
    eliminated: Eliminated
    added: AddedTerms  # of joints, attachments and superelements
    motions: Array  # (n, k) of u, without strain, that satisfy the constraints
    bodies: Sequence[RigidDofs]  # before they are joined


def _joined(
    layout: Layout,
    joints: Sequence[Joint],
    supports: Sequence[Support],
    attached: Sequence[Attachment],
) -> _Joined:
    """The constraints and the terms of all joints, supports and attachments of an assembly."""
    labels = [joint.label(k + 1) for k, joint in enumerate(joints)]
    for joint, label in zip(joints, labels, strict=True):
        joint.prepare(layout, label)
    fixed = _fixed_mask(layout)
    places = layout.places
    scale = np.where(places.kind == TURN, 1 / layout.size, 1.0)  # of displacements and rotations
    checked_supports = list_of("supports", supports, Support, "Support(where, fix)")
    rows = [Rows.free(support_rows(layout, support), "") for support in checked_supports]
    elastic: list[ElasticTerm] = []
    for joint, label in sorted(zip(joints, labels, strict=True), key=lambda pair: pair[0].late):
        rows += joint.constraints(layout, Constraints(rows, fixed, scale), label)
        elastic += [replace(support, name=label) for support in joint.elastic(layout, label)]

    for one in attached:
        elastic += terms_of(one, layout.plane, partial(_point_motions, layout))
    elastic += [superelement(layout, part) for part in layout.condensed.values()]
    for r in rows:
        _check_dense(r.label or "a support", r.matrix)
    for term in elastic:
        _check_dense(term.name or "an attachment", term.G)

    eliminated = eliminate(rows, fixed, scale)
    constraints = Constraints(rows, fixed, scale)
    for label, count in eliminated.redundant.items():
        warn(
            f"{count} constraint{'s' * (count > 1)} of {label} follow{'s' * (count == 1)} from "
            "those of joints that overlap with it: remove the repeated ones."
        )

    if eliminated.dependent.all():
        raise InputError("supports and joints hold every dof of the assembly: nothing moves.")
    added = AddedTerms(elastic, eliminated.T)
    stretches = [scipy.sparse.csr_matrix(support.strains) @ support.G for support in elastic]
    C = stacked([*(r.matrix for r in rows), *stretches], layout.count)
    bodies = assembled.unjoined_bodies(layout)
    motions, rigid = assembled.free_motions(layout, bodies, C, fixed, scale)
    movable = moving_bodies(bodies, motions) if motions.size else []
    _check_joined(layout, bodies, movable, rows, elastic)

    if mechanisms := motions.shape[1] - rigid:
        warn(
            f"the joints leave parts free to move without strain ({mechanisms} motions, of "
            f"{body_names(movable)}): join or hold them unless it is intended."
        )

    if rigid and (supports or any(len(m.part.fixed) for m in layout.members.values())):
        warn(
            f"the supports leave the assembly free to move as a rigid body ({rigid} motions): hold "
            "that too unless it is intended."
        )

    return _Joined(constraints, eliminated, added, motions, bodies)


# -- the dofs


def _fixed_mask(layout: Layout) -> BoolArray:
    """Mask (n,) of the parts' fixed dofs and, if parts are plane, of points' out-of-plane dofs."""
    fixed = np.zeros(layout.count, dtype=bool)
    for member in layout.members.values():
        fixed[member.first + member.part.fixed] = True
    for part in layout.condensed.values():
        fixed[part.rows] = part.fixed

    for name in layout.points:
        if layout.plane:
            fixed[layout.point_dofs(name)[[2, 3, 4]]] = True
    return fixed


def _check_dense(label: str, functionals: Sparse) -> None:
    """InputError for functionals (m, n) of the joint `label` that would couple too many dofs."""
    count = int(np.diff(functionals.indptr).max(initial=0))
    if functionals.shape[0] <= MOST_POINT_ROWS and count > MOST_COUPLED_DOFS:
        raise InputError(
            f"{label} couples {count} dofs of a group with one another, more than "
            f"{MOST_COUPLED_DOFS}: "
            'give a smaller group, or the surface near a point, ("part", point, radius).'
        )


def _check_joined(
    layout: Layout,
    bodies: Sequence[RigidDofs],
    movable: Sequence[RigidDofs],
    rows: Sequence[Rows],
    elastic: Sequence[ElasticTerm],
) -> None:
    """InputError if nothing joins one of the `movable` bodies to the largest group of bodies."""
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
        if body_k not in movable:
            continue
        if body_k.name in layout.points:
            raise InputError(f"the reference point {body_k.name!r} is joined to nothing.")
        has_pieces = sum(body.name == body_k.name for body in bodies) > 1
        piece = f"a piece at {point_text(body_k.centre)} of " if has_pieces else ""
        raise InputError(
            f"{piece}the part {body_k.name!r} is joined to nothing else: join it, or leave it out."
        )


# -- supports and attachments as rows and terms of functionals of u


def support_rows(layout: Layout, support: Support) -> Sparse:
    """The functionals (m, n) of u that a support fixes at zero."""
    names = support.components(["x", "y", "rz"] if layout.plane else COMPONENTS)

    if isinstance(support.where, str) and (
        support.where in layout.points or support.where.split(":", 1)[0] in layout.condensed
    ):
        point = motion_of_end(layout, support.where)
        if support.fix == "all":
            return point.functionals[np.flatnonzero(np.diff(point.functionals.indptr))]
        if absent := point.lacking(names):
            raise InputError(f"the support {support.label} fixes {', '.join(absent)}, absent here.")
        return point.components(names)

    rows_of_support = []
    for member, nodes in _supported_nodes(layout, support):
        for kind in (DISPLACEMENTS, ROTATIONS):
            axes = [kind.index(name) for name in names if name in kind]
            motions = layout.at_nodes(member, nodes, kind)
            rows = (3 * np.arange(len(nodes))[:, None] + axes).ravel().astype(int)
            rows_of_support.append(motions[rows])

    result = scipy.sparse.vstack([layout.zeros(0), *rows_of_support]).tocsr()
    if not result.nnz:
        raise InputError(
            f"the support {support.label} fixes nothing: no node of the assembly that can "
            f"move along {', '.join(names)} lies there."
        )

    return result


def _supported_nodes(layout: Layout, support: Support) -> list[tuple[Member, IntArray]]:
    """[(part, its nodes)] that a support fixes."""
    if isinstance(support.where, str):
        member, group = layout.group_end("where", support.where)
        return [(member, member.nodes_of(group))]
    if isinstance(support.where, NumberedNodes):
        numbered = [member for member in layout.members.values() if len(member.part.mesh.labels)]
        return [(member, member.nodes_of(support.where)) for member in numbered]

    members = layout.members.values()
    return [(member, np.flatnonzero(support.selected(member.nodes))) for member in members]


def superelement(layout: Layout, part: Superelement) -> ElasticTerm:
    """K and M of a superelement as a term on its dofs in the assembly's vector u."""
    functionals = layout.units(np.arange(part.rows.start, part.rows.stop))
    return ElasticTerm(functionals, part.K, part.M, rigid=part.rigid)


def _point_motions(layout: Layout, where: str | Sequence[float]) -> list[PointMotion]:
    """Motions of the points at which an attachment acts: one, or those of a group of points."""
    if not isinstance(where, str):
        if len(where) < 3 and not layout.plane:
            raise InputError(f"{shown(where)} has {len(where)} coordinates: give x, y and z.")
        x = in_space(where)
        (place,) = places_at(layout.members.values(), x[None])
        return [motion_of_end(layout, (place.member.name, tuple(x)))]

    part, _, group = where.partition(":")
    if group and part in layout.members:
        member = layout.members[part]
        if group in member.part.mesh.groups and largest_piece(member.part.mesh, group)[0] == 0:
            return [
                motion_of_end(layout, (member.name, tuple(member.nodes[node])))
                for node in member.nodes_of(group)
            ]

    return [motion_of_end(layout, where)]
