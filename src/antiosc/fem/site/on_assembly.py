"""Load vectors of sites on parts of an assembly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from antiosc._types import Array
from antiosc.checks import in_words as text
from antiosc.errors import InputError
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.ends import Motion
from antiosc.fem.assembly.layout import Member
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.mpi import on_root
from antiosc.fem.named_points import middle_of, motion_of
from antiosc.fem.site.at_points import functionals_at
from antiosc.fem.site.site import (
    LEAST_FREE_SHARE,
    Functional,
    Site,
    constrained,
)
from antiosc.fem.structure.meshed import MeshedStructure

#: Parts this share of the size of the assembly farther off than the nearest one are as near.
AS_NEAR = 1e-9


def functionals_on(structure: AssembledMatrices, sites: Sequence[Site]) -> list[Functional]:
    """b of sites at points of an assembly; errors as in `functionals`."""

    def work() -> list[Functional]:
        return [_whole(structure, site) for site in sites]

    return [_own(structure, found) for found in on_root(structure.comm, work)]


def _own(structure: AssembledMatrices, found: Functional) -> Functional:
    """The rows of this rank."""
    across = tuple(_own(structure, side) for side in found.across)
    return replace(found, b=structure.share.own(found.b), across=across)


def _whole(structure: AssembledMatrices, site: Site) -> Functional:
    """b of a site, whole, on this rank alone."""
    found = before_joining(structure, site, lambda member: member.part)
    b = _joined(structure, found.b)
    if np.linalg.norm(b) <= LEAST_FREE_SHARE * np.linalg.norm(found.b):
        assert found.point is not None
        named = repr(site.point) if isinstance(site.point, str) else f"at {text(found.point)}"
        raise InputError(constrained(f"the site {named}"))
    across = tuple(replace(side, b=_joined(structure, side.b)) for side in found.across)
    return replace(found, b=b, across=across)


def _joined(structure: AssembledMatrices, b: Array) -> Array:
    """The functional of q that a functional b of u is."""
    q = np.asarray(structure.T.T @ b)
    q[structure.eliminated.dependent] = 0.0
    return q


def before_joining(
    structure: AssembledMatrices, site: Site, part_of: Callable[[Member], MeshedStructure]
) -> Functional:
    """b of a site as functionals of u, the dofs of all parts before they are joined.

    `part_of` gives the structure of a part: as it is, or without its supports.
    """
    assert site.direction is not None  # Site has seen to that
    assert site.point is not None
    direction = np.pad(site.direction, (0, 3 - len(site.direction)))
    if isinstance(site.point, str):
        if site.part is not None:
            raise InputError(
                f'Site(point={site.point!r}) is a name and tells the part ("part:group"): leave '
                f"part={site.part!r} out."
            )
        end = motion_of(structure, site.point)
        if end is not None:
            return _without_mesh(structure, site, end, direction / np.linalg.norm(direction))
        member, own = middle_of(structure, site.point)
        site = replace(site, snap=inf)
    else:
        point = np.pad(site.point, (0, 3 - len(site.point)))
        member = struck(structure, point, direction, site.part)
        own = member.at.own(point[None])[0]
    along = direction @ member.at.rotation
    there = replace(site, point=tuple(own.tolist()), direction=tuple(along.tolist()), part=None)
    (found,) = functionals_at(part_of(member), [there], member.at.placed)
    assert found.point is not None

    def placed(one: Functional) -> Functional:
        assert one.direction is not None
        b = np.zeros(structure.layout.count)
        b[member.rows] = one.b
        return replace(one, b=b, point=x, direction=member.at.rotation @ one.direction)

    x = member.at.placed(found.point[None])[0]
    return replace(placed(found), across=tuple(placed(side) for side in found.across))


def _without_mesh(
    structure: AssembledMatrices, site: Site, end: Motion, direction: Array
) -> Functional:
    """b, of u, of a site of a superelement, or of a reference point."""
    layout = structure.layout
    part, _, name = str(site.point).partition(":")
    if layout.plane and direction[2]:
        raise InputError(
            f"direction {site.direction} leaves the plane in which the assembly moves."
        )
    if site.radius is not None or site.tangential:
        raise InputError(
            f"the site {site.point!r} of a superelement has the patch and the directions with "
            "which it was extracted: leave radius and tangential out."
            if name
            else f"the reference point {site.point!r} has no surface: leave radius and tangential "
            "out, or give each direction a site of its own."
        )
    if not end.along(end.displacement_space, direction):
        raise InputError(
            f"the site {site.point!r} of a superelement does not move along the direction of "
            "impact: extract its model with Site(..., tangential=True)."
        )
    b = np.asarray(end.displacements.T @ direction)
    if not name:
        return Functional(b, point=end.point, direction=direction)
    own = layout.condensed[part].part.ends[name]
    return Functional(b, own.radius, own.local_compliance, end.point, direction)


def struck(
    structure: AssembledMatrices, point: Array, direction: Array, name: str | None
) -> Member:
    """The part that an impactor strikes at a point: the one named, or the nearest.

    Where parts touch, it is the one whose surface faces the impactor most.
    """
    if name is not None:
        return structure.members(name)[0]
    return nearest_parts(structure, point[None], direction)[0]


def nearest_parts(structure: AssembledMatrices, points: Array, direction: Array) -> list[Member]:
    """The part that an impactor strikes at each of the points (P, 3); see `struck`."""
    members = structure.members()
    distance = np.array([m.closest(points).distance for m in members])
    near = distance <= distance.min(axis=0) + AS_NEAR * structure.layout.size
    found = []
    for point, which in zip(points, near.T, strict=True):
        candidates = [m for m, one in zip(members, which, strict=True) if one]
        alone = len(candidates) == 1
        found.append(
            candidates[0] if alone else min(candidates, key=lambda m: _facing(m, point, direction))
        )
    return found


def _facing(member: Member, point: Array, direction: Array) -> float:
    """Cosine between the direction of impact and the outward normal of the part at a point.

    0 for parts without an outside.
    """
    part = member.part
    if not part.kind.outside:
        return 0.0
    faces = Faces(part.mesh, sheet=False)
    along = direction @ member.at.rotation
    found = faces.contact(
        member.at.own(point[None]),
        along[None],
        np.array([1e-6 * part.mesh.extent()]),
        np.zeros(len(faces.facets), dtype=int),
    )
    return float(found.normals[0] @ along)
