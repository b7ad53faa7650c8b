"""Joints between two ends, linear equations, and joints of a group with a point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeAlias

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import checked_by, coordinates, instance, number, positive, shown, store
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import (
    COLLINEAR_MOMENT,
    END_CHECK,
    Constraints,
    End,
    Joint,
    Rows,
    TwoEnds,
    checked_end,
    end_text,
    following_rows,
    mean_motion,
    motion_of_end,
)
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.elements.beam import Beam, height_directions
from antiosc.fem.structure import checked_axis, in_space, perpendiculars, skew
from antiosc.fem.structure.attachments import NAME_CHECK, ElasticTerm, checked_components
from antiosc.fem.structure.loads import UNIT_MOTIONS, PointMotion
from antiosc.fem.structure.meshed import Member
from antiosc.io.matrices import COMPONENTS, DISPLACEMENTS, ROTATIONS

#: Points this share of the size of the assembly apart are one; coefficients this share apart too.
COINCIDENT_SHARE = 1e-9
#: The motions of plane parts among the six of an end.
PLANE_MOTIONS = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
#: Gauss points for the mass matrix, whose integrands are products of two cubics.
GAUSS_POINT_COUNT = 5
#: Displacement, rotation and the sign of the rotation of bending along y, about z, and along z.
BENDING_PLANES = ((1, 5, 1.0), (2, 4, -1.0))


@dataclass(frozen=True)
class _PointJoint(TwoEnds):
    """Base of joints by which both ends have the same motion in some directions at `point`."""

    point: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    name: str | None = field(default=None, metadata=NAME_CHECK)

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """Equal displacements and rotations of both ends, in the constrained directions."""
        ends = [(end, motion_of_end(layout, end)) for end in (self.a, self.b)]
        directions = self._constrained()
        if layout.plane:
            directions = directions * PLANE_MOTIONS
            directions = directions[np.abs(directions).max(axis=1) > 1e-9]

        rows = relative_motion(label, directions, *motions_at(layout, label, ends, self.point))

        # without coefficients that are rounding errors
        sizes = abs(scipy.sparse.csr_matrix(directions)) @ sum(abs(m.functionals) for _, m in ends)
        rows = rows.multiply(abs(rows) > COINCIDENT_SHARE * sizes).tocsr()
        rows.eliminate_zeros()
        if not rows.nnz:
            raise InputError(f"{label} joins nothing: both of its ends are the same point.")

        return [Rows.free(rows, label)]

    def _constrained(self) -> Array:
        """Directions (k, 6), of displacement and rotation, in which both ends have equal motion."""
        raise NotImplementedError


@dataclass(frozen=True)
class Weld(_PointJoint):
    """Two ends that have the same displacement and rotation at a point.

    Parameters
    ----------
    a, b : ends
        "part:group" (of several nodes: its mean motion); ("part", (x, y, z)); ("part", (x, y, z),
        radius), the mean motion of the surface within the radius [m] of a point, as under a
        screw's head; or the name of a reference point.
    point : sequence of floats, optional
        Point of the joint, m; default: the point, or the centroid, of `a`. Ends that lie
        elsewhere are connected to it rigidly.
    name : name of the joint in messages, optional
    """

    def _constrained(self) -> Array:
        return np.eye(6)


@dataclass(frozen=True)
class Ball(_PointJoint):
    """Two ends that have the same displacement at a point and rotate freely.

    Parameters as for `Weld`.
    """

    def _constrained(self) -> Array:
        return np.eye(3, 6)


@dataclass(frozen=True)
class _AxisJoint(_PointJoint):
    """Base of joints that leave the rotation about `axis`, or the displacement along it, free."""

    axis: Sequence[float] = field(default=(0.0, 0.0, 1.0), metadata=checked_by(checked_axis))

    #: whether the axis is that of a rotation
    _turns_about_axis: ClassVar[bool] = True

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """Constraints of the joint; InputError if plane parts cannot turn or slide on its axis."""
        rotated = abs(self.axis[2]) / float(np.linalg.norm(self.axis))
        free_rotation = self._turns_about_axis
        if layout.plane and abs(rotated - free_rotation) > COINCIDENT_SHARE:
            raise InputError(
                f"{label}: plane parts turn about z, slide along x and y, not {tuple(self.axis)}."
            )

        return super().constraints(layout, earlier, label)

    def _across(self) -> Array:
        """Two unit vectors (2, 3) perpendicular to the axis."""
        return perpendiculars(np.array([self.axis]) / np.linalg.norm(self.axis))[0]


@dataclass(frozen=True)
class Hinge(_AxisJoint):
    """Two ends that can only rotate relative to each other about an axis through a point.

    Parameters as for `Weld`, and

    axis : sequence of 3 floats
        Direction of the axis in the assembly, default z.
    """

    def _constrained(self) -> Array:
        return scipy.linalg.block_diag(np.eye(3), self._across())


@dataclass(frozen=True)
class Slider(_AxisJoint):
    """Two ends that can only move relative to each other along an axis.

    Parameters as for `Hinge`.
    """

    _turns_about_axis: ClassVar[bool] = False

    def _constrained(self) -> Array:
        return scipy.linalg.block_diag(self._across(), np.eye(3))


#: An end of a joint and its motion.
EndMotion: TypeAlias = tuple[End, PointMotion]


def motions_at(
    layout: Layout, label: str, ends: Sequence[EndMotion], point: Sequence[float] | None
) -> list[EndMotion]:
    """[(end, motion at `point`)] by rigid arms from the ends; `point` None: that of the first end.
    InputError if an end away from the point has no rotations."""
    x = ends[0][1].point if point is None else in_space(point)
    result = []
    for end, end_motion in ends:
        arm = x - end_motion.point
        length = float(np.linalg.norm(arm))
        if length <= COINCIDENT_SHARE * layout.size:
            result.append((end, replace(end_motion, point=x)))
            continue
        across = np.eye(3) - np.outer(arm, arm) / length**2
        if not end_motion.has_rotations(layout.rotations if layout.plane else across):
            raise InputError(
                f"{label} lies {length:.3g} m away from {end_text(end)}, which has no rotation to "
                "carry it there: give a group of faces, or a point where the joint is."
            )
        result.append((end, end_motion.at(x)))

    return result


def relative_motion(label: str, directions: Array, a: EndMotion, b: EndMotion) -> Sparse:
    """Motion of b minus that of a (k, n), along `directions` (k, 6), as functionals of u.
    InputError if an end cannot move in one of the directions."""
    for end, end_motion in (a, b):
        for direction in directions:
            turns = direction[3:].any()
            unit = direction / np.linalg.norm(direction)
            if (turns or end_motion.displacements.nnz) and not end_motion.has(unit):
                names = ", ".join(COMPONENTS[k] for k in np.flatnonzero(direction))
                raise InputError(
                    f"{label} acts on {names}, a {'rotation' if turns else 'displacement'} that "
                    f"{end_text(end)} does not have: points of a solid, or a straight row of them, "
                    'do not rotate (give a group of faces, a radius, ("part", point, radius), or '
                    "a Ball), and a site of a model moves along its directions."
                )

    return (scipy.sparse.csr_matrix(directions) @ (b[1].functionals - a[1].functionals)).tocsr()


@dataclass(frozen=True)
class Equation(Joint):
    """The constraint Σ coefficient · component = 0 of displacements (m) and rotations (rad).

    Parameters
    ----------
    terms : sequence of (end, component, coefficient)
        `end` as for `Weld`; `component` is "x", "y", "z", "rx", "ry" or "rz" in the axes of the
        assembly.
    name : name of the equation in messages, optional
    """

    terms: Sequence[tuple[End, str, float]]
    name: str | None = field(default=None, metadata=NAME_CHECK)

    def __post_init__(self) -> None:
        if not isinstance(self.terms, Sequence) or isinstance(self.terms, str) or not self.terms:
            raise InputError(f"terms must list (end, component, number); got {shown(self.terms)}.")

        terms = tuple(_checked_term(term) for term in self.terms)
        if not any(coefficient for _, _, coefficient in terms):
            raise InputError("an Equation needs a coefficient that is not 0.")
        store(self, terms=terms)
        super().__post_init__()

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """The single row of the equation."""
        total = layout.zeros(1)
        for end, component, coefficient in self.terms:
            end_motion = motion_of_end(layout, end)
            row = end_motion.components([component])
            if end_motion.lacking([component]):
                raise InputError(
                    f"{label}: {end_text(end)} has no component {component!r}; points of solids "
                    "have no rotations."
                )
            total = total + coefficient * row

        total = total.tocsr()
        total.eliminate_zeros()
        if not total.nnz:
            raise InputError(f"{label} says 0 = 0: its terms cancel.")
        return [Rows.free(total, label)]


def _checked_term(term: object) -> tuple[End, str, float]:
    """The checked (end, component, coefficient) of an `Equation`; otherwise InputError."""
    if not isinstance(term, tuple | list) or len(term) != 3:
        raise InputError(
            f"a term must be (end, component, coefficient), as (('plate', (0, 0, 0)), 'z', 1.0); "
            f"got {shown(term)}."
        )

    end, component, coefficient = term
    if not isinstance(component, str) or component not in DISPLACEMENTS + ROTATIONS:
        raise InputError(
            f"a component is one of {', '.join(DISPLACEMENTS + ROTATIONS)}; got {shown(component)}."
        )

    return checked_end("end", end), component, number("a coefficient", coefficient)


AXES = (*COMPONENTS, "axial")
AXES_CHECK = checked_by(checked_components, "Bushing", AXES)


def _checked_branches(_: str, branches: object) -> tuple[tuple[dict[str, float], float], ...]:
    """Checked pairs (stiffness by component, relaxation time [s])."""
    if not isinstance(branches, list | tuple) or any(
        not isinstance(branch, list | tuple) or len(branch) != 2 for branch in branches
    ):
        raise InputError(
            f"branches must list pairs ({{'z': 1e6}}, relaxation time in s); got {shown(branches)}."
        )

    return tuple(
        (
            checked_components("stiffness of a branch", stiffness, "Bushing", AXES),
            positive("a relaxation time", tau, "s"),
        )
        for stiffness, tau in branches
    )


@dataclass(frozen=True)
class Bushing(TwoEnds):
    """Springs and dampers between two ends (CBUSH).

    Parameters
    ----------
    a, b : ends
        As for `Weld`.
    stiffness : dict
        Component -> stiffness. Components are "x", "y", "z" (N/m), "rx", "ry", "rz" (N m/rad) in
        the axes of the assembly, and "axial" (N/m) along the line between the ends. It may be empty
        if there are dampers.
    point : sequence of floats, optional
        Point of the springs of x … rz, m; default: at `a`. Ends that lie elsewhere are connected
        to it rigidly.
    name : name of the joint in messages, optional
    damping : dict, optional
        Component -> constant of a damper, N s/m or N m s/rad. Models contain it exactly, however
        strong it is.
    branches : sequence of (dict, float), optional
        Maxwell branches in parallel: (component -> stiffness, relaxation time τ, s). The complex
        stiffness at ω is k + iωc + Σ k_b iωτ/(1 + iωτ).
    """

    stiffness: Mapping[str, float] = field(default_factory=dict, metadata=AXES_CHECK)
    point: Sequence[float] | None = field(default=None, metadata=checked_by(coordinates))
    name: str | None = field(default=None, metadata=NAME_CHECK)
    damping: Mapping[str, float] = field(default_factory=dict, metadata=AXES_CHECK)
    branches: Sequence[tuple[Mapping[str, float], float]] = field(
        default=(), metadata=checked_by(_checked_branches)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.stiffness and not self.damping and not self.branches:
            raise InputError(
                f"a Bushing needs a stiffness, as {{'z': 1e6}}, or a damping; got "
                f"{shown(self.stiffness)}."
            )

    def elastic(self, layout: Layout, label: str) -> list[ElasticTerm]:
        """One term: springs, dampers and branches of all components."""
        ends = [(end, motion_of_end(layout, end)) for end in (self.a, self.b)]
        constants = [self.stiffness, self.damping, *(values for values, _ in self.branches)]
        names = list(dict.fromkeys(name for values in constants for name in values))
        names.sort(key=lambda name: name != "axial")  # it comes first

        functionals = []

        if "axial" in names:
            line = ends[1][1].point - ends[0][1].point
            length = float(np.linalg.norm(line))
            if length <= COINCIDENT_SHARE * layout.size:
                raise InputError(f"{label} has no length: an axial spring needs two places.")
            axial = np.append(line / length, np.zeros(3))
            functionals.append(relative_motion(label, axial[None], *ends))

        units = np.array([UNIT_MOTIONS[name] for name in names if name != "axial"])
        if len(units):
            at_point = motions_at(layout, label, ends, self.point)
            functionals.append(relative_motion(label, units, *at_point))
        G = scipy.sparse.vstack(functionals).tocsr()
        if not G.nnz:
            raise InputError(f"{label} joins nothing: none of its components can move.")

        k, c, *of_branches = (
            np.diag([values.get(name, 0.0) for name in names]) for values in constants
        )
        times = [tau for _, tau in self.branches]
        branches = list(zip(of_branches, times, strict=True))
        damping = c if self.damping else None

        return [ElasticTerm(G, k, np.zeros_like(k), c=damping, branches=branches)]


@dataclass(frozen=True)
class Rigid(Joint):
    """All nodes of a group follow the motion of a point as a rigid body (RBE2).

    Parameters
    ----------
    group : str
        "part:group".
    point : end, optional
        The point that the group follows: the name of a reference point, ("part", (x, y, z)) of a
        beam or shell, or a group of one point. None: the group is rigid and follows no point.
    name : name of the joint in messages, optional
    """

    group: str = field(metadata=END_CHECK)
    point: End | None = field(default=None, metadata=END_CHECK)
    name: str | None = field(default=None, metadata=NAME_CHECK)

    def prepare(self, layout: Layout, label: str) -> None:
        """Add a reference point to the layout if the user gave no point for the group to follow."""
        if self.point is None:
            member, group = layout.group_end("group", self.group)
            nodes = member.nodes_of(group)
            if len(nodes) < 2:
                raise InputError(f"{label}: {self.group!r} is a single point, which is rigid.")
            layout.points[label] = member.nodes[nodes].mean(axis=0)

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """Every dof of the group equals the rigid motion of the point."""
        member, group = layout.group_end("group", self.group)
        nodes = member.nodes_of(group)
        point = label if self.point is None else self.point
        leader = motion_of_end(layout, point)
        columns = np.unique(leader.functionals.indices)
        block = (columns - member.first) // member.block
        in_member = (columns >= member.rows.start) & (columns < member.rows.stop)
        nodes = nodes[~np.isin(nodes, block[in_member])]  # the point itself may be in the group
        if not leader.has_rotations(layout.rotations):
            raise InputError(
                f"{label}: the point {end_text(point)} does not rotate, so that nothing can follow "
                "it: take a reference point, or a point of a beam or a shell."
            )
        if not len(nodes):
            raise InputError(f"{label}: {self.group!r} holds nothing but the point it follows.")

        rotations = scipy.sparse.vstack([leader.rotations] * len(nodes)).tocsr()
        displacements = leader.displacements_at(member.nodes[nodes])
        motions = [(DISPLACEMENTS, displacements), (ROTATIONS, rotations)]
        rows = following_rows(layout, member, nodes, motions, label)
        return [rows, *(_fix_idle_rotations(member, nodes, leader) if self.point is None else [])]


@dataclass(frozen=True)
class Mean(Joint):
    """A point follows the mean motion of a group (RBE3); its loads are distributed over the group.

    The group is not stiffened. Faces, edges and cells are weighted by area, length and volume,
    points equally.

    Parameters
    ----------
    group : str
        "part:group".
    point : end
        The point that follows: the name of a reference point, ("part", (x, y, z)), or a group of
        one point, for instance the end of a beam.
    name : name of the joint in messages, optional
    """

    group: str = field(metadata=END_CHECK)
    point: End = field(metadata=END_CHECK)
    name: str | None = field(default=None, metadata=NAME_CHECK)

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """Constraints: the point's displacement and rotation equal the group's mean ones."""
        member, group = layout.group_end("group", self.group)
        nodes = member.nodes_of(group)
        follower = motion_of_end(layout, self.point)
        if len(nodes) == 1:
            raise InputError(
                f"{label}: {self.group!r} is a single point; a Mean needs several (use Weld)."
            )

        leader = mean_motion(layout, member, member.points_of(group))
        if set(leader.displacements.indices) & set(follower.displacements.indices):
            raise InputError(
                f"{label}: the point {end_text(self.point)} is one of the group {self.group!r} "
                "whose mean it should follow; take a group without it."
            )

        projection = leader.space @ follower.space
        spanned = np.flatnonzero(np.abs(np.diag(projection) - 1) < 1e-9)
        directions = np.eye(len(projection))[spanned]
        if len(spanned) < round(float(np.trace(projection))):
            values, vectors = np.linalg.eigh(projection)
            directions = vectors[:, values > 0.5].T

        rows = relative_motion(
            label, directions, (self.group, leader.at(follower.point)), (self.point, follower)
        )
        rows.eliminate_zeros()
        return [Rows.free(rows, label)]


def _fix_idle_rotations(member: Member, nodes: IntArray, leader: PointMotion) -> list[Rows]:
    """Rows that fix the rotations of `leader` about a line on which all its followers lie."""
    if member.has_rotations:
        return []

    arm = member.nodes[nodes] - leader.point
    J = np.einsum("pi,pi->", arm, arm) * np.eye(3) - arm.T @ arm
    values, axes = np.linalg.eigh(J)
    free_axes = axes[:, values <= COLLINEAR_MOMENT * values[-1]].T
    return [Rows.free((scipy.sparse.csr_matrix(free_axes) @ leader.rotations).tocsr(), "")]


@dataclass(frozen=True)
class Bolt(TwoEnds):
    """A straight beam between two ends; an end that is a group moves by its mean motion.

    The element has the exact static stiffness of a Timoshenko beam, and its consistent mass.

    Parameters
    ----------
    a, b : ends
        As for `Weld`; the beam connects the centroids of both.
    beam : Beam
        Material and section.
    name : name of the joint in messages, optional
    """

    beam: Beam = field(metadata=checked_by(instance, Beam, "a Beam"))
    name: str | None = field(default=None, metadata=NAME_CHECK)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.beam.offset:
            raise InputError("the beam of a Bolt has no offset: it goes from end to end.")

    def elastic(self, layout: Layout, label: str) -> list[ElasticTerm]:
        """Stiffness and mass of the beam, as one term."""
        ends = [motion_of_end(layout, end) for end in (self.a, self.b)]
        line = ends[1].point - ends[0].point
        length = float(np.linalg.norm(line))
        if length <= 1e-9 * layout.size:
            raise InputError(
                f"{label} has no length: {end_text(self.a)} and {end_text(self.b)} have the same "
                "centre; use a Weld."
            )

        for end, end_motion in zip((self.a, self.b), ends, strict=True):
            if not end_motion.has_rotations(layout.rotations):
                raise InputError(
                    f"{label}: {end_text(end)} has no rotation, and the end of a beam needs "
                    'one: give a group of faces, or a radius, ("part", point, radius).'
                )

        axis = line / length
        middle = (ends[0].point + ends[1].point) / 2
        height = np.array([-axis[1], axis[0], 0.0])  # in the plane of plane parts
        if not layout.plane:
            height = height_directions(self.beam, axis[None], middle[None])[0]
        y = height - (height @ axis) * axis
        y /= np.linalg.norm(y)
        R = np.vstack([axis, y, np.cross(axis, y)])
        k, m = beam_matrices(self.beam, length)
        rotation = scipy.sparse.block_diag([scipy.sparse.csr_matrix(R)] * 4, format="csr")
        G = (rotation @ scipy.sparse.vstack([end.functionals for end in ends])).tocsr()
        mass = self.beam.rho * self.beam.section.A * length
        return [ElasticTerm(G, k, m, mass)]


def beam_matrices(beam: Beam, length: float) -> tuple[Array, Array]:
    """(stiffness, mass), each (12, 12), of a beam of this `length` [m] along x with height along y.
    Dofs: x, y, z, rx, ry, rz of the first end, then of the second. The shapes are static ones."""
    section = beam.section
    inertia = np.diag([section.A * beam.rho] * 3 + [0.0] * 3)
    inertia[3, 3] = beam.rho * (section.I + section.side)
    inertia[4, 4] = beam.rotary_inertia(section.side)
    inertia[5, 5] = beam.rotary_inertia(section.I)

    m = np.zeros((12, 12))
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINT_COUNT)
    for share, weight in zip((1 + points) / 2, weights / 2, strict=True):
        left = _beam_stiffness(beam, share * length)
        right = _beam_stiffness(beam, (1 - share) * length)
        to_ends = np.hstack([left[6:, :6], right[:6, 6:]])
        shapes = -np.linalg.solve(left[6:, 6:] + right[:6, :6], to_ends)
        m += weight * length * shapes.T @ inertia @ shapes

    return _beam_stiffness(beam, length), m


def _beam_stiffness(beam: Beam, length: float) -> Array:
    """Stiffness (12, 12) of a Timoshenko beam, from the flexibility of its end (Przemieniecki,
    *Theory of Matrix Structural Analysis* (1968), chapter 5)."""
    section = beam.section
    flexibility = np.zeros((6, 6))
    flexibility[0, 0] = length / (beam.E * section.A)
    flexibility[3, 3] = length / (beam.G * section.torsion)

    for (move, turn, sign), (I, shear) in zip(BENDING_PLANES, section.planes, strict=True):  # noqa: E741
        bending = length / (beam.E * I)
        flexibility[turn, turn] = bending
        flexibility[move, turn] = flexibility[turn, move] = sign * bending * length / 2
        flexibility[move, move] = bending * length**2 / 3
        if beam.shear:
            flexibility[move, move] += length / (beam.G * section.A * shear)

    # a rigid motion of the first end moves the other one without strain
    rigid_motion = np.eye(6)
    rigid_motion[:3, 3:] = -skew(np.array([length, 0.0, 0.0]))
    strained = np.hstack([-rigid_motion, np.eye(6)])
    return np.asarray(strained.T @ np.linalg.inv(flexibility) @ strained)
