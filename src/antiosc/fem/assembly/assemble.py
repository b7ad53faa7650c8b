"""`assemble`: one structure of several parts."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
from petsc4py import PETSc

from antiosc.base._types import Array, BoolArray
from antiosc.base.checks import in_words, several
from antiosc.base.errors import InputError, warn
from antiosc.fem.assembly import motions
from antiosc.fem.assembly.assembled import (
    Added,
    AssembledMatrices,
    block_of,
    reduced,
    stacked,
    take_by_strains,
)
from antiosc.fem.assembly.elimination import eliminate
from antiosc.fem.assembly.joint import (
    Constraints,
    Eliminated,
    Held,
    Joint,
    Redundant,
    Rows,
    Stiffness,
    attachment,
    superelement,
    support_rows,
)
from antiosc.fem.assembly.layout import Layout, Sparse, row_numbers
from antiosc.fem.assembly.motions import modes_of, tell_motions
from antiosc.fem.assembly.parts import (
    Share,
    checked_parts,
    checked_places,
    checked_points,
    communicator,
    on_every_rank,
)
from antiosc.fem.assembly.superelement import TURN
from antiosc.fem.assembly.wide import nested_basis
from antiosc.fem.linalg.petsc_algebra import from_csr
from antiosc.fem.linalg.solver import Choice, checked_choice
from antiosc.fem.platform.mpi import collective, on_root
from antiosc.fem.structure.attachments import Attachment, Damper, PointMass, Spring, attachments_of
from antiosc.fem.structure.meshed import ROTATIONS
from antiosc.fem.structure.placement import Placement
from antiosc.fem.structure.structure import Structure
from antiosc.fem.structure.support import Support
from antiosc.models.anti_oscillators import AntiOscillators


@collective()
def assemble(
    parts: Mapping[str, Structure | AntiOscillators],
    joints: Sequence[Joint] = (),
    at: Mapping[str, Placement | Sequence[float]] | None = None,
    *,
    points: Mapping[str, Sequence[float]] | None = None,
    supports: Sequence[Support] = (),
    attached: Sequence[Attachment] = (),
    solver: Choice = "auto",
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
        Name -> `Placement`, or a translation (x, y, z) in m. Parts that are not named stand where
        their mesh is. Supports of a part move with it.
    points : dict, optional
        Name -> coordinates in m of reference points: points with six dofs that belong to no part.
        Joints, supports, masses and springs act on them by name.
    supports : sequence of Support
        `where` is "part:group", the name of a reference point, or a function of coordinates of all
        parts; `fix` names components in the axes of the assembly.
    attached : sequence of PointMass, Spring, Damper and Footing
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
    return put_together(
        parts,
        several("joints", joints, Joint, "joints such as Tie and Hinge"),
        at,
        points=points,
        supports=supports,
        attached=attached,
        solver=solver,
    )


def put_together(
    parts: Mapping[str, Structure | AntiOscillators],
    joints: Sequence[Joint],
    at: Mapping[str, Placement | Sequence[float]] | None = None,
    *,
    points: Mapping[str, Sequence[float]] | None = None,
    supports: Sequence[Support] = (),
    attached: Sequence[Attachment] = (),
    solver: Choice = "auto",
    apart: bool = False,
) -> Structure:
    """`assemble` with checked joints; `apart`: parts may be joined to nothing, for each is held."""
    started = time.perf_counter()
    solver = checked_choice(solver)
    given = checked_parts(parts)
    comm = communicator(given)
    members = on_every_rank(given, comm)
    layout = Layout(members, checked_places(members, at), checked_points(members, points))
    kept: list[tuple[Constraints, PETSc.Mat, PETSc.Mat]] = []  # what rank 0 does not send to others

    def work() -> _Joined:
        made, *rest = _joined(layout, joints, supports, attachments_of(attached), apart)
        kept.append(tuple(rest))
        return made

    made = on_root(comm, work)
    layout.points = made.points
    block = block_of(layout)
    share = Share.of(comm, layout.count, block)
    constraints, *whole = kept[0] if kept else (None, None, None)
    K, M = (share.matrix(one, block) for one in whole)
    if comm.size > 1 and not made.rigid:
        take_by_strains(K, layout, made.eliminated, made.added, share)
    self = object.__new__(Structure)
    matrices = AssembledMatrices(
        K,
        M,
        np.flatnonzero(share.own(made.eliminated.dependent)),
        share.own(made.modes),
        made.shift,
        solver,
        layout=layout,
        eliminated=made.eliminated,
        added=made.added,
        share=share,
        constraints=constraints,
    )
    self._hold(matrices, started)
    self.supports = (supports,) if isinstance(supports, Support) else tuple(supports)
    return self


@dataclass(frozen=True, eq=False)
class _Joined:
    """What rank 0 finds of an assembly."""

    points: dict[str, Array]  # all reference points, those that joints bring included
    eliminated: Eliminated
    added: Added
    modes: Array  # M-orthonormal motions without strain (n, r)
    shift: float  # first shift, rad²/s²
    rigid: bool  # whether nothing but a rigid body is left


def _joined(
    layout: Layout,
    joints: Sequence[Joint],
    supports: Sequence[Support],
    attached: Sequence[PointMass | Spring | Damper],
    apart: bool,
) -> tuple[_Joined, Constraints, PETSc.Mat, PETSc.Mat]:
    """(what is found, of which constraints, K, M) of parts that this rank has whole."""
    labels = [joint.label(k + 1) for k, joint in enumerate(joints)]
    for joint, label in zip(joints, labels, strict=True):
        joint.prepare(layout, label)
    fixed = _fixed(layout)
    scale = _scale(layout)
    held = several("supports", supports, Support, "Support(where, fix)")
    rows = [Rows.free(support_rows(layout, one), "") for one in held]
    elastic: list[Stiffness] = []
    for joint, label in sorted(zip(joints, labels, strict=True), key=lambda pair: pair[0].late):
        rows += joint.constraints(layout, Held(rows, fixed), label)
        elastic += joint.elastic(layout, label)
    for one in attached:
        elastic += attachment(layout, one)
    elastic += [superelement(layout, one) for one in layout.condensed.values()]
    if not apart:
        _check_joined(layout, rows, elastic)
    everything = stacked([*(r.matrix for r in rows), *(e.G for e in elastic)], layout.count)
    basis = nested_basis(everything, fixed, layout.positions)
    eliminated = eliminate(rows, fixed, scale, basis)
    constraints = Constraints(rows, fixed, scale, basis)
    _tell_redundant(eliminated.redundant)
    free = int(np.count_nonzero(~eliminated.dependent))
    if not free:
        raise InputError("supports and joints hold every dof of the assembly: nothing moves.")
    added = Added(elastic, eliminated.T)
    K, M = reduced(layout, eliminated, added)
    stretches = [scipy.sparse.csr_matrix(one.strains) @ one.G for one in elastic]
    C = stacked([*(r.matrix for r in rows), *stretches], layout.count)
    strainless = motions.free_motions(layout, C, fixed, scale)
    supported = bool(supports) or any(len(m.part.fixed) for m in layout.members.values())
    tell_motions(layout, *strainless, supported=supported)
    modes, shift = modes_of(layout, K, M, eliminated, *strainless)
    rigid = modes.shape[1] == free  # its K is rounding, but for the dependent dofs
    if rigid:
        K = from_csr("K", scipy.sparse.diags(eliminated.dependent.astype(float)).tocsr())
    return _Joined(layout.points, eliminated, added, modes, shift, rigid), constraints, K, M


# -- the dofs


def _fixed(layout: Layout) -> BoolArray:
    """Dofs that supports of the parts hold, and those that a plane's reference points lack."""
    fixed = np.zeros(layout.count, dtype=bool)
    for member in layout.members.values():
        fixed[member.first + member.part.fixed] = True
    for one in layout.condensed.values():
        fixed[one.rows] = one.part.fixed
    for name in layout.points:
        if layout.plane:
            fixed[layout.of_point(name)[[2, 3, 4]]] = True
    return fixed


def _scale(layout: Layout) -> Array:
    """1 for displacements, 1/size for rotations."""
    scale = np.ones(layout.count)
    for member in layout.members.values():
        nodes = np.arange(len(member.nodes))
        for name in member.part.form.components.keys() & set(ROTATIONS):
            scale[layout.dofs(member, nodes, name)] = 1 / layout.size
    for one in layout.condensed.values():
        scale[one.rows][one.part.kind == TURN] = 1 / layout.size
    for name in layout.points:
        scale[layout.of_point(name)[3:]] = 1 / layout.size
    return scale


def _tell_redundant(redundant: Sequence[Redundant]) -> None:
    for label in dict.fromkeys(label for label, _, _ in redundant):
        own = [(others, times) for name, others, times in redundant if name == label]
        count = sum(times for _, times in own)
        rest = list(dict.fromkeys(n for names, _ in own for n in names if n != label))
        if rest:
            warn(
                f"{count} constraint{'s' if count > 1 else ''} of {label} follow"
                f"{'' if count > 1 else 's'} from those of {' and '.join(rest)}: the joints "
                "overlap; remove the repeated ones.",
            )


def _check_joined(layout: Layout, rows: Sequence[Rows], elastic: Sequence[Stiffness]) -> None:
    """InputError for a part, a piece of one, or a reference point that is joined to nothing."""
    loose = list(motions.pieces(layout))
    piece = np.zeros(layout.count, dtype=int)
    for k, one in enumerate(loose):
        piece[one.rows] = k
    # all functionals of one spring belong together
    springs = [Sparse(np.asarray(abs(e.G).sum(axis=0))) for e in elastic]
    links = stacked([*(r.matrix for r in rows if r.label), *springs], layout.count)
    of_row = row_numbers(links)
    touched = scipy.sparse.csr_matrix(
        (np.ones(links.nnz), (piece[links.indices], of_row)), shape=(len(loose), links.shape[0])
    )
    label = scipy.sparse.csgraph.connected_components(touched @ touched.T, directed=False)[1]
    largest = np.bincount(label, [len(one.rows) for one in loose]).argmax()
    for k in np.flatnonzero(label != largest):
        one = loose[k]
        if one.name in layout.points:
            raise InputError(f"the reference point {one.name!r} is joined to nothing.")
        pieces = sum(other.name == one.name for other in loose)
        which = f"a piece at {in_words(one.centre)} of the part" if pieces > 1 else "the part"
        raise InputError(
            f"{which} {one.name!r} is joined to nothing else: add a joint, or leave it out."
        )
