"""`Place`: a point of a part, found once from what a user gives: coordinates, a group or a node."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError, name_list
from antiosc.fem.assembly import MeshedParts
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.joint import group_end, motion_without_mesh
from antiosc.fem.mesh.surface import ClosestPoint, centre, size_at
from antiosc.fem.structure import in_space
from antiosc.fem.structure.loads import PointMotion
from antiosc.fem.structure.meshed import Member

#: Parts count as equally near if their distances differ by less than this share of the largest
#: part's size.
AS_NEAR = 1e-9


@dataclass(frozen=True, eq=False)
class Place:
    """A point of a part and the direction (3,) of an impact there, in the axes of the part."""

    member: Member
    nearest: ClosestPoint  # its cell, and the point there nearest to the given one
    direction: Array  # zero: none is given

    @property
    def point(self) -> Array:
        """Coordinates (3,) in the axes of the part [m]."""
        return self.nearest.x

    @property
    def placed(self) -> Array:
        """Coordinates (3,) in the axes of the structure [m]."""
        return self.member.at.placed(self.point[None])[0]

    @property
    def cell_size(self) -> float:
        """Largest distance [m] between corners of the cell."""
        return size_at(self.member.part.mesh, self.nearest)

    @property
    def material(self) -> Any:
        """The material of the cell."""
        return self.member.part.material_at(self.nearest)


def places_at(members: Sequence[Member], points: Array, directions: Array) -> list[Place]:
    """The nearest places of some parts to points (P, 3), struck along directions (P, 3).

    Where parts touch, it is the one whose surface faces the impactor most.
    """
    nearest = [member.closest(points) for member in members]
    distance = np.array([found.distance for found in nearest])
    size = max(member.part.mesh.extent() for member in members)
    is_near = distance <= distance.min(axis=0) + AS_NEAR * size

    places = []
    for k, direction in enumerate(directions):
        near = [
            Place(member, found[k], direction @ member.at.rotation)
            for member, found, one in zip(members, nearest, is_near[:, k], strict=True)
            if one
        ]
        places.append(near[0] if len(near) == 1 else min(near, key=_facing))
    return places


def place_at(matrices: MeshedParts, point: Array, direction: Array | None = None) -> Place:
    """The place of the structure nearest to a point (3,), struck along a direction (3,)."""
    along = np.zeros(3) if direction is None else direction
    return places_at(matrices.members(), point[None], along[None])[0]


def _facing(place: Place) -> float:
    """Cosine between the direction of impact and the outward normal of the part.

    0 for parts without an outside.
    """
    part = place.member.part
    if not part.kind.outside:
        return 0.0
    contact = part.surface_below(place.point[None], place.direction[None], np.full(1, np.nan))
    return float(contact.normals[0] @ place.direction)


def group_of(matrices: MeshedParts, name: str, what: str = "point") -> tuple[Member, str]:
    """(part, group) for the name of a group of one mesh, or "part:group"."""
    if isinstance(matrices, AssembledMatrices):
        return group_end(matrices.layout, what, name)
    return matrices.members()[0], name


def point_of(
    matrices: MeshedParts, point: Sequence[float] | str | None, part: str | None, node: int | None
) -> tuple[Array, str | None, PointMotion | None]:
    """(coordinates (3,) [m], part or None, motion of a point without a mesh or None).

    `point`: coordinates, or the name of a group ("part:group" of an assembly), of a reference point
    or of a superelement's site; `node`: in its place, the number of a node in the file.
    """
    if node is not None:
        for member in matrices.members(part):
            mesh = member.part.mesh
            x = mesh.node(node) if len(mesh.labels) or not matrices.assembled else None
            if x is not None:
                return member.at.placed(x[None])[0], member.name or None, None
        raise InputError(f"the structure has no node {node}, by its number in the file.")
    if not isinstance(point, str):
        return in_space(point or ()), part, None
    if part is not None:
        matrices.members(part)
        raise InputError(
            f'the point {point!r} is a name and tells the part ("part:group"): leave the part '
            f"{part!r} out."
        )

    if isinstance(matrices, AssembledMatrices):
        end = motion_without_mesh(matrices.layout, point)
        if end is not None:
            return end.point, None, end
        if ":" not in point:
            points = name_list(point, matrices.layout.points, "the reference points")
            raise InputError(
                f'a name on an assembly is "part:group"; got {point!r}, which is no reference '
                f"point either; {points}."
            )
    member, group = group_of(matrices, point)
    x = centre(member.part.mesh, group)  # the point next to it is taken
    return member.at.placed(x[None])[0], member.name or None, None
