"""Where a push or a probe acts: a part and a point of it.

It is given by coordinates, by a group or a face, by a node number or by a reference point of
joints. The point of a group is the one nearest to the centroid of its entities.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
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
#: Parts count as equally near if their distances differ by less than this share of the assembly's
#: size.
AS_NEAR = 1e-9
NAMED_PART = 'the point {!r} is a name and tells the part ("part:group"): leave the part {!r} out.'


@dataclass(frozen=True)
class Place:
    """A point (3,) [m] of a part and a direction (3,) there, in the axes of the part.

    `exact`: coordinates, which have to lie on the part; others are moved to it.
    """

    member: Member
    point: Array
    direction: Array
    exact: bool = False


@dataclass(frozen=True)
class Functional:
    """The load vectors of a site, and the properties of its patch."""

    #: load vectors on the rows of this rank, zero on fixed dofs: along the direction of impact, and
    #: across it if requested
    B: Array
    #: radius of the patch, m; None for a point
    radius: float | None = None
    #: half-space compliance of the patch, m/N (0 for a point)
    local_compliance: float = 0.0
    #: actual point (3,), m, and unit vectors of the directions (columns of B, 3)
    point: Array | None = None
    directions: Array | None = None
    #: cell size and wave speeds at the site (`ModelInfo.cells`); None without a mesh
    cell: tuple[float, float, float] | None = None
    #: where it acts on a mesh; None of rows and vectors
    place: Place | None = None

    @property
    def b(self) -> Array:
        """The load vector along the direction of impact."""
        return self.B[:, 0]

    @property
    def direction(self) -> Array | None:
        """Unit vector of the direction of impact."""
        return None if self.directions is None else self.directions[0]


def place_at(
    matrices: MeshedParts, point: Array, direction: Array | None = None, part: str | None = None
) -> Place:
    """The place of a point (3,) on the named part, or on the nearest one that is struck."""
    along = np.zeros(3) if direction is None else direction
    if part is None:
        (member,) = nearest_parts(matrices, point[None], along)
    else:
        (member,) = matrices.members(part if matrices.assembled else None)
    return Place(member, member.at.own(point[None])[0], along @ member.at.rotation, True)


def place_of(matrices: MeshedParts, site: Site) -> Place:
    """The place of a site at a point, a group, a face or a node."""
    from antiosc.fem.mesh.surface import struck_point  # needs dolfinx

    direction = None if site.direction is None else in_space(site.direction)
    if site.face is not None:
        member, group = _group_of(matrices, site.face)
        point, along = struck_point(member.part.mesh, group)
    elif site.node is not None:
        member, point = node_of(matrices, site.node, site.part)
    elif isinstance(site.point, str):
        if site.part is not None and matrices.assembled:
            raise InputError(NAMED_PART.format(site.point, site.part))
        matrices.members(site.part)
        member, point = _middle_of(matrices, site.point)
    else:
        assert site.point is not None
        if site.part is not None:
            matrices.members(site.part)
        return place_at(matrices, in_space(site.point), direction, site.part)
    if direction is not None:
        along = direction @ member.at.rotation
    return Place(member, point, along)


def nearest_parts(structure: MeshedParts, points: Array, direction: Array) -> list[Member]:
    """The part nearest to each of the points (P, 3).

    Where parts touch, it is the one whose surface faces the impactor most.
    """
    members = structure.members()
    if not structure.assembled or len(members) == 1:
        return list(members) * len(points)
    size = cast("AssembledMatrices", structure).layout.size
    distance = np.array([m.closest(points).distance for m in members])
    is_nearest = distance <= distance.min(axis=0) + AS_NEAR * size
    parts = []
    for point, is_nearest_part in zip(points, is_nearest.T, strict=True):
        candidates = [m for m, is_near in zip(members, is_nearest_part, strict=True) if is_near]
        facing = partial(_facing, point=point, direction=direction)
        parts.append(candidates[0] if len(candidates) == 1 else min(candidates, key=facing))
    return parts


def _facing(member: Member, point: Array, direction: Array) -> float:
    """Cosine between the direction of impact and the outward normal of a part at a point.

    0 for parts without an outside.
    """
    from antiosc.fem.mesh.surface import Faces  # needs dolfinx

    part = member.part
    if not part.kind.outside:
        return 0.0
    faces = Faces(part.mesh, sheet=False)
    direction_of_part = direction @ member.at.rotation
    contact = faces.contact(
        member.at.own(point[None]),
        direction_of_part[None],
        np.array([1e-6 * part.mesh.extent()]),
        np.zeros(len(faces.facets), dtype=int),
    )
    return float(contact.normals[0] @ direction_of_part)


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
        member, x = node_of(with_parts(structure), checks.whole("node", node), part)
        return member.at.placed(x[None])[0], member.name or None, None
    if not isinstance(point, str):
        return in_space(checks.coordinates("point", point)), part, None

    checks.text("point", point)
    if part is not None:
        raise InputError(NAMED_PART.format(point, part))
    if structure.matrices.located:
        raise InputError("matrices have no groups: give the point's coordinates.")
    matrices = with_parts(structure)
    without_mesh = motion_of(matrices, point)
    if without_mesh is not None:
        return without_mesh.point, None, without_mesh
    member, x = _middle_of(matrices, point)
    return member.at.placed(x[None])[0], member.name or None, None


def _middle_of(matrices: MeshedParts, name: str) -> tuple[Member, Array]:
    """(part, centroid (3,) of a group [m]) in the axes of the part.

    `name`: the group of one mesh, or "part:group".
    """
    from antiosc.fem.mesh.surface import centre  # needs dolfinx

    member, group = _group_of(matrices, name)
    return member, centre(member.part.mesh, group)


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
