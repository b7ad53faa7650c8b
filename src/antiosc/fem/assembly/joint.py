"""Ends of joints, and their motion as six functionals of u.

An end is "part:group", ("part", point), ("part", point, radius), or the name of a reference point.
Its motion at a point is a set of linear functionals of u: the motion of a single node, or the mean
displacement and mean rotation of several nodes or of the surface within the radius. Means
distribute a force without stiffening the part. The mean rotation is the rotation of the rigid
motion closest to the motion of the group.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import Checked, checked_by, floats, point_text, positive, shown
from antiosc.base.errors import InputError, name_list
from antiosc.fem.assembly.layout import End, Layout, Sparse, end_text
from antiosc.fem.mesh.surface import WeightedPoints, quadrature
from antiosc.fem.structure import in_space, skew
from antiosc.fem.structure.attachments import ElasticTerm
from antiosc.fem.structure.loads import (
    SNAP_SHARE,
    PointMotion,
    component_projection,
    motion_at,
    stacked_rows,
)
from antiosc.fem.structure.meshed import Member
from antiosc.fem.structure.place import Place, places_at
from antiosc.io.matrices import DISPLACEMENTS, ROTATIONS

#: Fraction of the largest second moment of a group below which it determines no rotation.
COLLINEAR_MOMENT = 1e-12

#: Degree of the rule on faces that the ball of an end cuts, and its least number of points in it.
CUT_DEGREE, CUT_POINTS = 16, 12


def checked_end(name: str, end: object) -> End:
    """The checked end of a joint; InputError if it is invalid."""
    if isinstance(end, str) and end:
        return end

    if isinstance(end, tuple | list) and len(end) in (2, 3) and isinstance(end[0], str) and end[0]:
        point = floats(f"the point of {name}", end[1], None)
        if point.shape in ((2,), (3,)):
            part_and_point = end[0], tuple(point.tolist())
            if len(end) == 2:
                return part_and_point
            return (*part_and_point, positive(f"the radius of {name}", end[2], "m"))

    raise InputError(
        f'{name} must be "part:group", ("part", point), ("part", point, radius) or the name of a '
        f"reference point; got {shown(end)}."
    )


END_CHECK = checked_by(checked_end)


def motion_of_end(layout: Layout, end: End) -> PointMotion:
    """The motion of an end, as functionals of u, at its point or at its group's centroid.
    InputError if there is no such part, group or reference point, or the point is off the part."""
    end_motion = layout.motion_without_mesh(end)
    if end_motion is not None:
        return end_motion
    if not isinstance(end, str):
        return _point_motion(layout, *end)
    if ":" not in end:
        points = name_list(end, layout.points, "the reference points")
        hint = ' (of a part give a group, "part:group", or a pair ("part", point))'
        raise InputError(
            f"there is no reference point {end!r}; {points}{hint if end in layout.members else ''}."
        )

    member, group = layout.group_end("an end", end)
    nodes = member.nodes_of(group)
    if len(nodes) != 1:
        return mean_motion(layout, member, member.points_of(group))
    of_node = (layout.at_nodes(member, nodes, kind) for kind in (DISPLACEMENTS, ROTATIONS))
    rows = stacked_rows(*of_node)
    return PointMotion(rows, component_projection(member.part.form), member.nodes[nodes[0]])


def _point_motion(
    layout: Layout, part: str, point: tuple[float, ...], radius: float | None = None
) -> PointMotion:
    """The motion of a part at a point, or the mean motion of its surface within `radius` [m]."""
    end = (part, point)
    member = layout.member(part, f"{end_text(end)}: ")
    (place,) = places_at([member], in_space(point)[None])
    distance = place.nearest.distance
    if distance > SNAP_SHARE * member.part.mesh.extent():
        raise InputError(
            f"the point {end_text(end)} is {distance:.3g} m off the part; its nearest point is "
            f"{point_text(place.placed)}."
        )
    if radius is not None:
        return mean_motion(layout, member, _points_around(place, end, radius)).at(place.placed)

    own = motion_at(member.part.comm, member.part.form, place.nearest)
    return layout.on_u(own.placed(member.at), member.first)


def _points_around(place: Place, end: End, radius: float) -> WeightedPoints:
    """Quadrature points within `radius` [m] of a place on the faces, sheets or lines of its part.
    InputError if they are fewer than `CUT_POINTS`; `end`: for its message."""
    member = place.member
    faces = member.part.faces
    near = np.linalg.norm(faces.centres - place.point, axis=1) <= faces.radii + radius
    points = quadrature(member.part.mesh, faces.dim, faces.facets[near], CUT_DEGREE)
    in_radius = np.flatnonzero(np.linalg.norm(points.x - place.point, axis=1) <= radius)
    if len(in_radius) < CUT_POINTS:
        raise InputError(
            f"the elements at {end_text(end)} are too large for this radius, up to "
            f"{2 * faces.radii[near].max(initial=0.0):.3g} m: refine them, or enlarge it."
        )

    selected = WeightedPoints(*(getattr(points, f.name)[in_radius] for f in fields(WeightedPoints)))
    return replace(selected, x=member.at.placed(selected.x))


def mean_motion(layout: Layout, member: Member, points: WeightedPoints) -> PointMotion:
    """Weighted mean motion of points at their centroid, J θ = Σ w r × u with J = Σ w (r² 1 − r rᵀ).
    If all points lie on one axis, the rotation about it is the mean of the rotations at the points.
    `points`: of the part, with x in the axes of the assembly."""
    w = points.weight / points.weight.sum()
    x = points.x
    centre = w @ x
    r = x - centre

    U = layout.at_points(member, points.cell, points.X, DISPLACEMENTS)
    average = scipy.sparse.csr_matrix(np.kron(w, np.eye(3)))
    displacements = (average @ U).tocsr()

    moment = np.einsum("p,pij->ipj", w, skew(r)).reshape(3, -1)
    J = np.einsum("p,pi,pi->", w, r, r) * np.eye(3) - (w * r.T) @ r
    values, axes = np.linalg.eigh(layout.rotations @ J @ layout.rotations)
    is_regular = values > COLLINEAR_MOMENT * max(values[-1], np.finfo(float).tiny)
    inverse = axes[:, is_regular] @ np.diag(1 / values[is_regular]) @ axes[:, is_regular].T
    rotations = (scipy.sparse.csr_matrix(inverse @ moment) @ U).tocsr()
    projection = axes[:, is_regular] @ axes[:, is_regular].T

    of_nodes = component_projection(member.part.form)
    undetermined = of_nodes[3:, 3:] @ (np.eye(3) - projection)
    if np.abs(undetermined).max() > 1e-9:
        turned = average @ layout.at_points(member, points.cell, points.X, ROTATIONS)
        rotations = (rotations + scipy.sparse.csr_matrix(undetermined) @ turned).tocsr()
        projection = projection + undetermined

    space = scipy.linalg.block_diag(of_nodes[:3, :3], projection)
    return PointMotion(stacked_rows(displacements, rotations), space, centre)


# -- joints: rows of constraints C u = 0, and terms Gᵀ k G of springs and masses


@dataclass(frozen=True, eq=False)
class Rows:
    """Homogeneous linear constraints of one joint."""

    matrix: Sparse  # (m, n), each row a functional of u that is zero
    pivot: IntArray  # (m,) the dof for which each row is solved if possible; -1: any
    label: str  # the joint's name for messages; empty for supports

    @classmethod
    def free(cls, matrix: Sparse, label: str) -> Rows:
        """Rows without a preferred pivot: each may be solved for any of its dofs."""
        return cls(matrix, np.full(matrix.shape[0], -1), label)


def following_rows(
    layout: Layout,
    member: Member,
    nodes: IntArray,
    motions: Sequence[tuple[tuple[str, ...], Sparse]],
    label: str,
) -> Rows:
    """Constraints that make P nodes of a part follow `motions` [(components, matrix (3P, n))];
    components: the three displacements or rotations. Each row's pivot is the node's dof."""
    rows, pivots = [], []
    for names, motion in motions:
        for name, of_component in layout.of_components(member, names, motion):
            pivots.append(layout.dofs(member, nodes, name))
            rows.append(layout.units(pivots[-1]) - of_component)
    matrix = scipy.sparse.vstack(rows).tocsr()
    matrix.eliminate_zeros()
    return Rows(matrix, np.concatenate(pivots), label)


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints of an assembly; the attributes are arguments of `eliminate`."""

    rows: Sequence[Rows]  # of the supports first, then of the joints
    fixed: BoolArray  # (n,) dofs that are zero
    scale: Array  # (n,) typical size of each dof: 1; of rotations 1/size of the assembly [1/m]


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Motions u = T q that satisfy all constraints."""

    T: Sparse  # (n, n), u = T q; the columns of dependent dofs are empty
    dependent: BoolArray  # (n,) which dofs are not in q, those that are fixed included
    redundant: Mapping[str, int]  # joint -> number of its rows that follow from others
    #: (n, k) motions that satisfy the constraints with k sets of prescribed values; None: no values
    particular: Array | None = None

    def coordinates(self, u: Array) -> Array:
        """q (n, k), zero at dependent dofs, of admissible motions u (n, k)."""
        q = np.array(u)
        q[self.dependent] = 0.0
        return q


class Joint(Checked):
    """A joint between parts: linear constraints, springs and masses; messages use its name."""

    name: str | None  # None: messages name its class and its number
    #: whether its constraints are made after those of other joints
    late: ClassVar[bool] = False

    def prepare(self, layout: Layout, label: str) -> None:
        """Add the reference points of the joint, if it has any, to the layout under `label`."""

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """The linear constraints C u = 0 of the joint; `earlier`: constraints of other joints."""
        return []

    def elastic(self, layout: Layout, label: str) -> list[ElasticTerm]:
        """The springs and masses of the joint."""
        return []

    def label(self, number: int) -> str:
        """The joint's name, or its class and its number in the list of joints."""
        if self.name:
            return repr(self.name)
        return f"joint {number} ({type(self).__name__})"


@dataclass(frozen=True)
class TwoEnds(Joint):
    """Base of joints between two ends."""

    a: End = field(metadata=END_CHECK)
    b: End = field(metadata=END_CHECK)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.a == self.b:
            raise InputError(f"a {type(self).__name__} joins {end_text(self.a)} to itself.")
