"""Points by name: groups, faces, node numbers and reference points of joints.

The point of a group is the one nearest to the centroid of its entities.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.checks import (
    whole,
)
from antiosc.base.errors import InputError, name_list
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.structure import in_space
from antiosc.fem.structure.structure import Structure
from antiosc.io.dof_map import DISPLACEMENTS, ROTATIONS
from antiosc.reduce.site.site import Site

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices
    from antiosc.fem.assembly.ends import EndMotion
    from antiosc.fem.structure.meshed import Member


#: Quantities available at a point without a mesh.
MOTIONS = ("displacement", "velocity", "acceleration", "rotation")


def point_of(
    structure: Structure, point: object, part: str | None, node: int | None = None
) -> tuple[Array, str | None, EndMotion | None]:
    """(coordinates (3,) [m], part or None, motion of a point without a mesh or None) of a named
    point.

    `point`: coordinates, or the name of a group ("part:group" of an assembly), of a reference point
    of an assembly, or of a site of a superelement ("part:site").
    """
    if part is not None:
        checks.text("part", part)
    if (point is None) == (node is None):
        raise InputError("a probe takes a point or the number of a node.")
    if node is not None:
        member, point_in_part = node_of(with_parts(structure), whole("node", node), part)
        return member.at.placed(point_in_part[None])[0], member.name or None, None
    if not isinstance(point, str):
        return in_space(checks.coordinates("point", point)), part, None
    checks.text("point", point)
    if part is not None:
        raise InputError(
            f'the point {point!r} is a name and tells the part ("part:group"): leave the part '
            f"{part!r} out."
        )
    if structure.matrices.located:
        raise InputError("matrices have no groups: give the point's coordinates.")
    matrices = with_parts(structure)
    without_mesh = motion_of(matrices, point)
    if without_mesh is not None:
        return without_mesh.point, None, without_mesh
    member, point_in_part = middle_of(matrices, point)
    return member.at.placed(point_in_part[None])[0], member.name or None, None


def middle_of(matrices: MeshedParts, name: str) -> tuple[Member, Array]:
    """(part, centroid (3,) of a group [m]) in the axes of the part.

    `name`: the group of one mesh, or "part:group".
    """
    from antiosc.fem.mesh.surface import centre  # needs dolfinx

    member, group = _group_of(matrices, name)
    return member, centre(member.part.mesh, group)


def on_face(matrices: MeshedParts, site: Site) -> Site:
    """A site on a face as a site at a point of the face, with its direction."""
    from antiosc.fem.mesh.surface import struck_point  # needs dolfinx

    assert site.face is not None
    member, group = _group_of(matrices, site.face)
    point_in_part, inward = struck_point(member.part.mesh, group)
    point = member.at.placed(point_in_part[None])[0]
    along = member.at.rotation @ inward
    direction = along.tolist() if site.direction is None else site.direction
    part = member.name if matrices.assembled else None
    point = point[: len(direction)]
    return replace(site, point=point.tolist(), direction=direction, face=None, snap=True, part=part)


def at_node(matrices: MeshedParts, site: Site) -> Site:
    """A site at a node number as a site at a point."""
    assert site.node is not None
    member, point_in_part = node_of(matrices, site.node, site.part)
    point = member.at.placed(point_in_part[None])[0][: len(site.direction or (0, 0, 0))]
    part = member.name if matrices.assembled else None
    return replace(site, point=point.tolist(), node=None, snap=True, part=part)


def node_of(matrices: MeshedParts, number: int, part: str | None = None) -> tuple[Member, Array]:
    """(part, coordinates (3,) in its axes [m]) of a node number, in the first part with this node.

    InputError if there is none.
    """
    for member in matrices.members(part):
        mesh = member.part.mesh
        x = mesh.node(number) if len(mesh.labels) or not matrices.assembled else None
        if x is not None:
            return member, x
    raise InputError(f"the structure has no node {number}, by its number in the file.")


def _group_of(matrices: MeshedParts, name: str) -> tuple[Member, str]:
    """(part, group) for the name of a group of one mesh, or "part:group"."""
    member, *_ = matrices.members()
    group = name
    if matrices.assembled:
        from antiosc.fem.assembly.ends import group_end

        layout = cast("AssembledMatrices", matrices).layout
        member, group = group_end(layout, "point", name)
    return member, group


def motion_of(matrices: MeshedParts, name: str) -> EndMotion | None:
    """The motion of a named reference point or of a superelement's site; None for "part:group".

    InputError for a name without a colon that is no reference point.
    """
    if not matrices.assembled:
        return None
    from antiosc.fem.assembly.ends import motion_without_mesh

    layout = cast("AssembledMatrices", matrices).layout
    motion = motion_without_mesh(layout, name, allow_partial=True)
    if motion is None and ":" not in name:
        points = name_list(name, layout.points, "the reference points")
        raise InputError(
            f'a name on an assembly is "part:group"; got {name!r}, which is no reference point '
            f"either; {points}."
        )
    return motion


def motions_without_mesh(
    structure: Structure, shapes: Array, name: str, end: EndMotion, quantity: str
) -> Array:
    """Displacement or rotation (gdim, columns) of all shapes at an end without a mesh."""
    if quantity not in MOTIONS:
        raise InputError(
            f"{name!r} is a point without a mesh and has no {quantity}: ask for its "
            f"{', '.join(MOTIONS)}."
        )
    from antiosc.fem.assembly.ends import UNIT  # needs dolfinx

    matrices = cast("AssembledMatrices", structure.matrices)
    plane = matrices.layout.plane
    rotated = quantity == "rotation"
    names = ROTATIONS[2 * plane :] if rotated else DISPLACEMENTS[: 3 - plane]
    if not all(end.has(UNIT[name]) for name in names):
        raise InputError(
            f"the {quantity} of {name!r} is not known"
            + (
                ": a site of a superelement has displacements alone."
                if rotated
                else " along all axes: extract its model with a tangential site."
            )
        )
    return np.asarray(end.components(names) @ matrices.expanded(shapes))
