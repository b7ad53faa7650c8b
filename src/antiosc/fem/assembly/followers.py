"""Points and groups that follow one another: rigid groups, and points at the mean of a group."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.assembly.ends import (
    COLLINEAR,
    END,
    End,
    EndMotion,
    end_text,
    group_end,
    mean,
    motion,
)
from antiosc.fem.assembly.joint import NAME, Constraints, Joint, Rows, following
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.structure.meshed import Member
from antiosc.io.matrices import DISPLACEMENTS, ROTATIONS


@dataclass(frozen=True)
class Rigid(Joint):
    """All nodes of a group follow the motion of a point as a rigid body (RBE2).

    Parameters
    ----------
    group : str
        "part:group".
    point : end, optional
        The point that is followed: the name of a reference point, ("part", (x, y, z)) of a beam
        or shell, or a group of one point. None: the group is rigid and follows nothing else.
    name : str, optional
        Name of the joint in messages.
    """

    group: str = field(metadata=END)
    point: End | None = field(default=None, metadata=END)
    name: str | None = field(default=None, metadata=NAME)

    def prepare(self, layout: Layout, label: str) -> None:
        """Add a reference point to the layout if the group follows no point of the user."""
        if self.point is None:
            member, group = group_end(layout, "group", self.group)
            nodes = member.nodes_of(group)
            if len(nodes) < 2:
                raise InputError(f"{label}: {self.group!r} is a single point, which is rigid.")
            layout.points[label] = member.nodes[nodes].mean(axis=0)

    def constraints(self, layout: Layout, held: Constraints, label: str) -> list[Rows]:
        """Every dof of the group equals the rigid motion of the point."""
        member, group = group_end(layout, "group", self.group)
        nodes = member.nodes_of(group)
        if self.point is None:
            leader = motion(layout, label)
            rows = _as_rigid_body(layout, member, nodes, leader, label)
            return [rows, *_undetermined(member, nodes, leader)]
        leader = motion(layout, self.point)
        columns = np.unique(leader.six.indices)
        block = (columns - member.first) // member.block
        in_member = (columns >= member.rows.start) & (columns < member.rows.stop)
        nodes = nodes[~np.isin(nodes, block[in_member])]  # the point itself may be in the group
        if not leader.turns(layout.rotations):
            raise InputError(
                f"{label}: the point {end_text(self.point)} does not rotate, so that nothing can "
                "follow its rotation: take a reference point (points={...}), or a point of a beam "
                "or a shell."
            )
        if not len(nodes):
            raise InputError(f"{label}: {self.group!r} holds nothing but the point it follows.")
        return [_as_rigid_body(layout, member, nodes, leader, label)]


@dataclass(frozen=True)
class Mean(Joint):
    """A point follows the mean motion of a group (RBE3); its loads are distributed over the group.

    The group is not stiffened. Faces, edges and cells count with their areas and lengths, points
    equally.

    Parameters
    ----------
    group : str
        "part:group".
    point : end
        The point that follows: the name of a reference point, ("part", (x, y, z)), or a group of
        one point, for instance the end of a beam.
    name : str, optional
        Name of the joint in messages.
    """

    group: str = field(metadata=END)
    point: End = field(metadata=END)
    name: str | None = field(default=None, metadata=NAME)

    def constraints(self, layout: Layout, held: Constraints, label: str) -> list[Rows]:
        """Displacement and rotation of the point equal the mean ones of the group."""
        member, group = group_end(layout, "group", self.group)
        nodes = member.nodes_of(group)
        follower = motion(layout, self.point)
        if len(nodes) == 1:
            raise InputError(
                f"{label}: {self.group!r} is a single point; a Mean needs several (use Weld)."
            )
        leader = mean(layout, member, member.points_of(group))
        if set(leader.displacements.indices) & set(follower.displacements.indices):
            raise InputError(
                f"{label}: the point {end_text(self.point)} is one of the group {self.group!r} "
                "whose mean it should follow; take a group without it."
            )
        leader_motion = leader.at(follower.point)
        common_rotations = leader.space[3:, 3:] @ follower.space[3:, 3:]
        directions = scipy.linalg.block_diag(np.eye(3), _rows_of(common_rotations))
        rows = (scipy.sparse.csr_matrix(directions) @ (follower.six - leader_motion.six)).tocsr()
        rows.eliminate_zeros()
        return [Rows(rows, _solved_dofs(follower, rows.shape[0]), label)]


def _as_rigid_body(
    layout: Layout, member: Member, nodes: IntArray, leader: EndMotion, label: str
) -> Rows:
    """The constraints by which nodes of a part follow the rigid motion of a point."""
    rotations = scipy.sparse.vstack([leader.rotations] * len(nodes)).tocsr()
    leader_motion = leader.displacements_at(member.nodes[nodes])
    return following(
        layout, member, nodes, [(DISPLACEMENTS, leader_motion), (ROTATIONS, rotations)], label
    )


def _undetermined(member: Member, nodes: IntArray, leader: EndMotion) -> list[Rows]:
    """Rows that fix the rotations of a leading point that would move none of its followers."""
    if member.has_rotations:
        return []
    arm = member.nodes[nodes] - leader.point
    J = np.einsum("pi,pi->", arm, arm) * np.eye(3) - arm.T @ arm
    values, axes = np.linalg.eigh(J)
    free_axes = axes[:, values <= COLLINEAR * values[-1]].T
    return [Rows.free((scipy.sparse.csr_matrix(free_axes) @ leader.rotations).tocsr(), "")]


def _rows_of(projection: Array) -> Array:
    """Orthonormal rows (k, 3) that span the image of a projection."""
    spanned = np.flatnonzero(np.abs(np.diag(projection) - 1) < 1e-9)
    if len(spanned) == round(float(np.trace(projection))):
        return np.eye(3)[spanned]
    values, vectors = np.linalg.eigh(projection)
    return np.asarray(vectors[:, values > 0.5].T)


def _solved_dofs(follower: EndMotion, count: int) -> IntArray:
    """The dof (count,) for which each row of a follower is solved: its only dof, or -1 if it has
    several."""
    pivots = np.full(count, -1)
    single_rows = np.flatnonzero(np.diff(follower.displacements.indptr) == 1)
    pivots[single_rows] = follower.displacements.indices[follower.displacements.indptr[single_rows]]
    if count == 6 and (np.diff(follower.rotations.indptr) == 1).all():
        pivots[3:] = follower.rotations.indices
    return pivots
