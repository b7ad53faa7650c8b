"""`assemble`: one structure of several parts."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from antiosc._types import Array, BoolArray, IntArray
from antiosc.checks import array, shown
from antiosc.errors import AccuracyError, InputError
from antiosc.fem.assembly import motions
from antiosc.fem.assembly.assembled import (
    Added,
    AssembledMatrices,
    reduced,
    stacked,
    without_stiffness,
)
from antiosc.fem.assembly.attached import attachment
from antiosc.fem.assembly.elimination import Eliminated, Redundant, Rows, eliminate
from antiosc.fem.assembly.joint import Joint, Stiffness
from antiosc.fem.assembly.layout import TURNS, Layout, Member, Sparse
from antiosc.fem.assembly.placement import Placement, placement
from antiosc.fem.assembly.shared_nodes import SharedNodes
from antiosc.fem.assembly.supports import support_rows
from antiosc.fem.assembly.wide import nested_basis
from antiosc.fem.linalg.algebra import communicator, multiply
from antiosc.fem.linalg.scaling import force_ratios
from antiosc.fem.linalg.solver import Choice, checked_choice
from antiosc.fem.mpi import collective, warn
from antiosc.fem.structure import rigid_body_modes
from antiosc.fem.structure.attachments import PointMass, Spring
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.null_space import SHIFT, orthonormal
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.fem.structure.support import Support

#: Share of the largest motion below which a part is at rest, but for rounding.
AT_REST = 1e-6
#: Share of the largest mass of a motion below which it has none.
IDLE_MASS = 1e-12
#: Force of a motion without strain over that of the entries of K; rounding leaves about 1e-15.
STRAINLESS = 1e-9


@collective()
def assemble(
    parts: Mapping[str, Structure],
    joints: Sequence[Joint] = (),
    at: Mapping[str, Any] | None = None,
    *,
    points: Mapping[str, Sequence[float]] | None = None,
    supports: Sequence[Support] = (),
    attached: Sequence[PointMass | Spring] = (),
    solver: Choice = "auto",
) -> Structure:
    """One structure of several parts, joined by linear constraints u = T q.

    Parameters
    ----------
    parts : dict
        Name -> Structure of a mesh, of any family, order and material, with its own supports. One
        Structure may stand under several names.
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
    attached : sequence of PointMass and Spring
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
        _joints(joints),
        at,
        points=points,
        supports=supports,
        attached=attached,
        solver=solver,
    )


def joined_at_nodes(
    parts: Mapping[str, Structure], node_ids: Mapping[str, IntArray], **options: Any
) -> Structure:
    """One structure of meshes that share nodes, such as a deck with several kinds of cells.

    Parameters
    ----------
    parts : name -> Structure of a mesh; all in the same axes.
    node_ids : name -> number of each node of the part's mesh, in the order of the points of which
        the mesh was made (`RawMesh.points`). Nodes with the same number are one node.
    options : further arguments of `put_together`, which are those of `assemble`.
    """
    return put_together(parts, [SharedNodes(node_ids), *options.pop("joints", ())], **options)


def put_together(
    parts: Mapping[str, Structure],
    joints: Sequence[Joint],
    at: Mapping[str, Any] | None = None,
    *,
    points: Mapping[str, Sequence[float]] | None = None,
    supports: Sequence[Support] = (),
    attached: Sequence[PointMass | Spring] = (),
    solver: Choice = "auto",
) -> Structure:
    """`assemble` with checked joints."""
    started = time.perf_counter()
    solver = checked_choice(solver)
    members = _parts(parts)
    places = _places(members, at)
    layout = Layout(members, places, _points(members, points))
    labels = [joint.label(k + 1) for k, joint in enumerate(joints)]
    for joint, label in zip(joints, labels, strict=True):
        joint.prepare(layout, label)
    held = _held(layout)
    scale = _scale(layout)
    rows = [Rows.free(one, "") for one in support_rows(layout, supports)]
    elastic: list[Stiffness] = []
    for joint, label in sorted(zip(joints, labels, strict=True), key=lambda pair: pair[0].late):
        rows += joint.constraints(layout, rows, held, label)
        elastic += joint.elastic(layout, label)
    for one in _attachments(attached):
        elastic += attachment(layout, one)
    _check_joined(layout, rows, elastic)
    everything = stacked([*(r.matrix for r in rows), *(e.G for e in elastic)], layout.count)
    basis = nested_basis(everything, held, layout.places)
    eliminated = eliminate(rows, held, scale, basis)
    _tell_redundant(layout, eliminated.redundant)
    fixed = np.flatnonzero(eliminated.dependent)
    if len(fixed) == layout.count:
        raise InputError("supports and joints hold every dof of the assembly: nothing moves.")
    added = Added(elastic, eliminated.T)
    K, M = reduced(layout, eliminated, added)
    stretches = [scipy.sparse.csr_matrix(one.strains) @ one.G for one in elastic]
    C = stacked([*(r.matrix for r in rows), *stretches], layout.count)
    strainless = motions.free_motions(layout, C, held, scale)
    _tell_motions(layout, *strainless, supported=bool(held.any() or supports))
    modes, shift = _modes(layout, K, M, eliminated, *strainless)
    if modes.shape[1] == layout.count - len(fixed):  # a rigid body: its K is rounding
        K = without_stiffness(eliminated)
    self = object.__new__(Structure)
    matrices = AssembledMatrices(
        K, M, fixed, modes, shift, solver, layout=layout, eliminated=eliminated, added=added
    )
    self._hold(matrices, started)
    return self


# -- what was given, checked


def _joints(joints: Any) -> Sequence[Joint]:
    items = [joints] if isinstance(joints, Joint) else joints
    if not isinstance(items, Sequence) or isinstance(items, str):
        raise InputError(f"joints must be a list of joints, as Tie or Hinge; got {shown(joints)}.")
    for one in items:
        if not isinstance(one, Joint):
            raise InputError(f"joints must hold joints, as Tie or Hinge; got {shown(one)}.")
    return items


def _parts(parts: Any) -> dict[str, MeshedStructure]:
    if not isinstance(parts, Mapping) or not parts:
        raise InputError(f"parts must be a dict: name -> Structure; got {shown(parts)}.")
    for name, part in parts.items():
        if not isinstance(name, str) or not name or ":" in name:
            raise InputError(f"a part's name must be a text without a colon; got {shown(name)}.")
        if not isinstance(part, Structure):
            raise InputError(f"the part {name!r} must be a Structure; got {shown(part)}.")
        if part.matrices.assembled:
            raise InputError(
                f"the part {name!r} is an assembly itself: give its parts and joints instead."
            )
        if part.comm.size > 1:
            raise InputError(
                f"an assembly runs on one MPI rank; the part {name!r} is shared by "
                f"{part.comm.size}: read its mesh with comm=MPI.COMM_SELF, or start one process."
            )
    text = "the part {!r} has no mesh: an assembly needs Structures of meshes."
    return {name: on_mesh(part, text.format(name)) for name, part in parts.items()}


def _places(members: Mapping[str, Any], at: Any) -> dict[str, Placement]:
    given = {} if at is None else at
    if not isinstance(given, Mapping):
        raise InputError(f"at must be a dict: name -> Placement or (x, y, z); got {shown(at)}.")
    for name in given:
        if not isinstance(name, str) or name not in members:
            raise InputError(
                f"at names {shown(name)}, which is no part; the parts are "
                f"{', '.join(map(repr, members))}."
            )
    return {name: placement(name, given.get(name)) for name in members}


def _points(members: Mapping[str, Any], points: Any) -> dict[str, Array]:
    given = {} if points is None else points
    if not isinstance(given, Mapping):
        raise InputError(f"points must be a dict: name -> coordinates; got {shown(points)}.")
    found = {}
    for name, x in given.items():
        if not isinstance(name, str) or not name or ":" in name:
            raise InputError(f"a point's name must be a text without a colon; got {shown(name)}.")
        if name in members:
            raise InputError(f"{name!r} names both a part and a reference point.")
        xs = array(f"points[{name!r}]", x, None)
        if xs.shape not in ((2,), (3,)):
            raise InputError(f"points[{name!r}] must be 2 or 3 numbers in m; got {shown(x)}.")
        found[name] = np.pad(xs, (0, 3 - len(xs)))
    return found


def _attachments(attached: Any) -> Sequence[PointMass | Spring]:
    items = [attached] if isinstance(attached, PointMass | Spring) else attached
    good = isinstance(items, Sequence) and all(isinstance(one, PointMass | Spring) for one in items)
    if not good:
        raise InputError(
            f"attached must be a list of PointMass and Spring objects; got {shown(attached)}."
        )
    return list(items)


# -- the dofs


def _held(layout: Layout) -> BoolArray:
    """Dofs that supports of the parts hold, and those that a plane's reference points lack."""
    held = np.zeros(layout.count, dtype=bool)
    for member in layout.members.values():
        held[member.first + member.part.fixed] = True
    for name in layout.points:
        if layout.plane:
            held[layout.of_point(name)[[2, 3, 4]]] = True
    return held


def _scale(layout: Layout) -> Array:
    """1 for displacements, 1/size for rotations."""
    scale = np.ones(layout.count)
    for member in layout.members.values():
        for name in TURNS:
            if name in member.part.form.components:
                (component,) = member.part.form.components[name]
                scale[member.first + np.arange(component, member.size, member.block)] = (
                    1 / layout.size
                )
    for name in layout.points:
        scale[layout.of_point(name)[3:]] = 1 / layout.size
    return scale


def _tell_redundant(layout: Layout, redundant: Sequence[Redundant]) -> None:
    comm = _comm(layout)
    for label in dict.fromkeys(label for label, _, _ in redundant):
        own = [(others, count) for name, others, count in redundant if name == label]
        count = sum(times for _, times in own)
        rest = [name for name in dict.fromkeys(n for names, _ in own for n in names)
                if name != label]  # fmt: skip
        if rest:
            warn(
                comm,
                f"{count} constraint{'s' if count > 1 else ''} of {label} follow"
                f"{'' if count > 1 else 's'} from those of {' and '.join(rest)}: the joints "
                "overlap; remove what is said twice.",
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
    of_row = np.repeat(np.arange(links.shape[0]), np.diff(links.indptr))
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
        at = ", ".join(f"{c:.4g}" for c in one.centre)
        which = f"a piece at ({at}) m of the part" if pieces > 1 else "the part"
        raise InputError(
            f"{which} {one.name!r} is joined to nothing else: add a joint, or leave it out."
        )


# -- motions without strain


def _modes(
    layout: Layout,
    K: Any,
    M: Any,
    eliminated: Eliminated,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[motions.Loose],
) -> tuple[Array, float]:
    """(M-orthonormal motions without strain, first shift)."""
    found = eliminated.coordinates(np.hstack([rigid, mechanisms]))
    comm = communicator(K)
    modes = orthonormal(comm, M, found)
    if modes.shape[1] < found.shape[1]:
        weight = found.T @ multiply(M, found)
        values, turn = np.linalg.eigh(weight)
        idle = eliminated.T @ found @ turn[:, values <= IDLE_MASS * values[-1]]
        points = [one for one in moving if np.abs(idle[one.rows]).max() > motions.STILL]
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
    fields = eliminated.coordinates(motions.fields(layout))
    return modes, SHIFT * rigid_body_modes.first_elastic(comm, K, M, fields, modes)


def _force_ratio(member: Member, u: Array, least: float) -> float:
    """Largest force of motions (rows, k) of a part over that of the entries of its K.

    Motions below `least` are rounding.
    """
    moving = u[:, np.abs(u).max(axis=0) > least]
    if not moving.size:
        return 0.0
    K = member.part.K
    return float(force_ratios(K, moving, multiply(K, moving)).max())


def _tell_motions(
    layout: Layout,
    rigid: Array,
    mechanisms: Array,
    moving: Sequence[motions.Loose],
    *,
    supported: bool,
) -> None:
    """Warn of mechanisms, and of rigid motions that supports leave."""
    comm = _comm(layout)
    if mechanisms.shape[1]:
        warn(
            comm,
            "the joints leave parts free to move without strain: "
            f"{_in_words(mechanisms, moving)}; join or hold them if it is not meant.",
        )
    if supported and rigid.shape[1]:
        whole = motions.whole(layout, (layout.low + layout.high) / 2)
        warn(
            comm,
            "the supports leave the assembly free to move as a rigid body: "
            f"{motions.described(whole, rigid)}; hold that too if it is not meant.",
        )


def _in_words(mechanisms: Array, moving: Sequence[motions.Loose]) -> str:
    """The motion of each piece in mechanisms."""
    names: dict[str, str] = {}
    for one in moving:
        names.setdefault(one.name, motions.described(one, mechanisms))
    return "; ".join(f"{name!r}: {words}" for name, words in names.items())


def _comm(layout: Layout) -> Any:
    return next(iter(layout.members.values())).part.comm
