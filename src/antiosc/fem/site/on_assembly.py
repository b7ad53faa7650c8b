"""Load vectors of sites on parts of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from antiosc._types import Array
from antiosc.errors import InputError
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.ends import Motion
from antiosc.fem.assembly.layout import Member
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.mpi import on_root
from antiosc.fem.named_points import middle_of, motion_of
from antiosc.fem.site.at_points import functionals_at, text
from antiosc.fem.site.site import LEAST_FREE_SHARE, Functional, Site, constrained

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
        site = replace(site, snap=True)
    else:
        point = np.pad(site.point, (0, 3 - len(site.point)))
        member = struck(structure, point, direction, site.part)
        own = member.at.own(point[None])[0]
    along = direction @ member.at.rotation
    there = replace(site, point=tuple(own.tolist()), direction=tuple(along.tolist()), part=None)
    (found,) = functionals_at(member.part, [there])
    assert found.point is not None
    assert found.direction is not None
    x = member.at.placed(found.point[None])[0]
    b = structure.functional(member, found.b)
    if np.linalg.norm(b) <= LEAST_FREE_SHARE * np.linalg.norm(found.b):
        raise InputError(constrained(f"the site at {text(x)}"))
    sides = []
    for side in found.across:
        assert side.direction is not None
        rotated = member.at.rotation @ side.direction
        load = structure.functional(member, side.b)
        sides.append(replace(side, b=load, point=x, direction=rotated))
    direction = member.at.rotation @ found.direction
    return replace(found, b=b, point=x, direction=direction, across=tuple(sides))


def _without_mesh(
    structure: AssembledMatrices, site: Site, end: Motion, direction: Array
) -> Functional:
    """b of a site of a superelement, or of a reference point."""
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
    if not end.along(end.moving, direction):
        raise InputError(
            f"the site {site.point!r} of a superelement does not move along the direction of "
            "impact: extract its model with Site(..., tangential=True)."
        )
    b = np.asarray(structure.T.T @ (end.moves.T @ direction))
    b[structure.eliminated.dependent] = 0.0
    if np.linalg.norm(b) <= LEAST_FREE_SHARE:
        raise InputError(constrained(f"the site {site.point!r}"))
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
