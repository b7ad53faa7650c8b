"""Places found once from what a user gives: coordinates, a group, a node or a reference point."""

from __future__ import annotations

from collections.abc import Sequence

from antiosc.base._types import Array
from antiosc.base.errors import InputError, name_list
from antiosc.fem.assembly import MeshedParts
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.joint import group_end, motion_without_mesh
from antiosc.fem.mesh.surface import centre
from antiosc.fem.structure import in_space
from antiosc.fem.structure.loads import PointMotion
from antiosc.fem.structure.meshed import Member
from antiosc.fem.structure.place import Place, places_at


def place_at(matrices: MeshedParts, point: Array, direction: Array | None = None) -> Place:
    """The place of the structure nearest to a point (3,), struck along a direction (3,)."""
    directions = None if direction is None else direction[None]
    return places_at(matrices.members(), point[None], directions)[0]


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
