"""Load vectors of points of a mesh, or of the parts of an assembly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf, sqrt

import numpy as np

from antiosc.base import plausible
from antiosc.base._types import Array
from antiosc.base.checks import point_text as text
from antiosc.base.errors import InputError
from antiosc.fem.assembly import MeshedParts
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.joint import Motion
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.closest import ClosestPoint, closest_many, corners_at, size_at
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.reach import Reach
from antiosc.fem.structure import in_space
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.reduce.site.names import at_node, middle_of, motion_of, on_face
from antiosc.reduce.site.site import LEAST_FREE_SHARE, Functional, Site, constrained, tangents
from antiosc.reduce.site.sites import (
    Sites,
    loads,
    located,
    on_free_dofs,
    patches,
    sums,
    warn_of_doubts,
)

#: A point counts as on the structure up to this share of the structure's size.
ON_STRUCTURE = 1e-6
#: A patch is whole with this share of its load on a part less than 1.
ROUNDED_SHARE = 1e-9
#: Parts this share of the size of the assembly farther off than the nearest one are as near.
AS_NEAR = 1e-9


def functionals_at(structure: MeshedParts, sites: Sequence[Site]) -> list[Functional]:
    """Load vectors of sites at points, computed in one pass; errors as in `functionals`."""

    def work() -> list[Functional]:
        found = before_joining(structure, sites, lambda member: member.part)
        return [_joined(structure, *pair) for pair in zip(sites, found, strict=True)]

    return [_each(structure.own, found) for found in structure.decided(work)]


def _each(change: Callable[[Array], Array], found: Functional) -> Functional:
    """The site with `change` applied to its load vectors along and across the direction."""
    across = tuple(_each(change, side) for side in found.across)
    return replace(found, b=change(found.b), across=across)


def _joined(structure: MeshedParts, site: Site, found: Functional) -> Functional:
    """The load vector on q from that on u; InputError if joints and supports hold the site."""
    joined, comm = _each(structure.joined, found), structure.workers
    if norm(comm, joined.b) <= LEAST_FREE_SHARE * norm(comm, found.b):
        assert found.point is not None
        named = repr(site.point) if isinstance(site.point, str) else f"at {text(found.point)}"
        raise InputError(constrained(f"the site {named}"))
    return joined


def before_joining(
    structure: MeshedParts, sites: Sequence[Site], part_of: Callable[[Member], MeshedStructure]
) -> list[Functional]:
    """Load vectors of sites on the dofs of all parts before joining.

    `part_of` gives the structure of a part: as it is, or without its supports.
    """
    found: dict[int, Functional] = {}
    struck: dict[str, tuple[Member, dict[int, Site]]] = {}
    for k, given in enumerate(sites):
        site = given if given.face is None else on_face(structure, given)
        site = site if site.node is None else at_node(structure, site)
        assert site.direction is not None  # Site has seen to that
        direction = in_space(site.direction)
        end = motion_of(structure, site.point) if isinstance(site.point, str) else None
        if end is not None and isinstance(structure, AssembledMatrices) and site.part is None:
            found[k] = _without_mesh(structure, site, end, direction / np.linalg.norm(direction))
            continue
        member, aim = _in_part(structure, site, direction)
        struck.setdefault(member.name, (member, {}))[1][k] = aim
    for member, there in struck.values():
        part = part_of(member)
        laid = _on_mesh(part, list(there.values()), member.at.placed)
        beyond = _beyond_seams(structure, member, laid, part_of)
        whole = laid.share + sum(share for _, share, _ in beyond)
        warn_of_doubts(part, replace(laid, share=np.minimum(whole, 1.0)))
        for i, one in enumerate(_of_sites(part, list(there.values()), laid)):
            own = _placed(structure, member, one)
            if beyond and whole[i] > laid.share[i]:
                own.b[:] *= laid.share[i] / whole[i]
                for other, share, b in beyond:
                    own.b[other.rows] += share[i] / whole[i] * b[i]
            found[list(there)[i]] = own
    return [found[k] for k in range(len(sites))]


def _in_part(structure: MeshedParts, site: Site, direction: Array) -> tuple[Member, Site]:
    """The struck part, and the site in the axes of this part."""
    snap = site.snap
    if isinstance(site.point, str):
        if site.part is not None and structure.assembled:
            raise InputError(
                f'Site(point={site.point!r}) is a name and tells the part ("part:group"): leave '
                f"part={site.part!r} out."
            )
        structure.members(site.part)
        member, own = middle_of(structure, site.point)
        snap = inf
    else:
        assert site.point is not None
        x = in_space(site.point)[None]
        if site.part is not None:
            (member,) = structure.members(site.part)
        else:
            (member,) = nearest_parts(structure, x, direction)
        own = member.at.own(x)[0]
    along = direction @ member.at.rotation
    at, towards = tuple(own.tolist()), tuple(along.tolist())
    return member, replace(site, point=at, direction=towards, snap=snap, part=None)


def _placed(structure: MeshedParts, member: Member, found: Functional) -> Functional:
    """A site of a part as a site of the structure, on all of its dofs."""
    assert found.point is not None
    assert found.direction is not None
    b = found.b
    if structure.assembled:
        b = np.zeros(algebra.size(structure.K))  # u and q have as many dofs
        b[member.rows] = found.b
    x, along = member.at.placed(found.point[None])[0], member.at.rotation @ found.direction
    across = tuple(_placed(structure, member, side) for side in found.across)
    name = member.name or None
    return replace(found, b=b, point=x, direction=along, across=across, part=name)


def _without_mesh(
    structure: AssembledMatrices, site: Site, end: Motion, direction: Array
) -> Functional:
    """Load vector on u of a site of a superelement, or of a reference point."""
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
    if not end.has(np.append(direction, np.zeros(3))):
        raise InputError(
            f"the site {site.point!r} of a superelement does not move along the direction of "
            "impact: extract its model with Site(..., tangential=True)."
        )
    b = np.asarray(end.displacements.T @ direction)
    if not name:
        return Functional(b, point=end.point, direction=direction)
    own = layout.condensed[part].part.ends[name]
    return Functional(b, own.radius, own.local_compliance, end.point, direction)


def nearest_parts(structure: MeshedParts, points: Array, direction: Array) -> list[Member]:
    """The part that is struck at each of the points (P, 3): the nearest one.

    Where parts touch, it is the one whose surface faces the impactor most.
    """
    members = structure.members()
    if not isinstance(structure, AssembledMatrices) or len(members) == 1:
        return members * len(points)
    distance = np.array([m.closest(points).distance for m in members])
    near = distance <= distance.min(axis=0) + AS_NEAR * structure.layout.size
    found = []
    for point, which in zip(points, near.T, strict=True):
        some = [m for m, one in zip(members, which, strict=True) if one]
        facing = partial(_facing, point=point, direction=direction)
        found.append(some[0] if len(some) == 1 else min(some, key=facing))
    return found


def _facing(member: Member, point: Array, direction: Array) -> float:
    """Cosine between the direction of impact and the outward normal of a part at a point.

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


# -- on one mesh


def _on_mesh(
    structure: MeshedStructure, sites: Sequence[Site], placed: Callable[[Array], Array]
) -> Sites:
    """Sites at points of a mesh; `placed` maps points (n, 3) to the assembly, for messages."""
    mesh = structure.mesh
    given = [_in_space(mesh, structure.form, site) for site in sites]
    points, directions = (np.array(each) for each in zip(*given, strict=True))
    nearest = closest_many(mesh, points)
    extent = mesh.extent()
    for i, site in enumerate(sites):
        _check_distance(mesh, extent, site, placed(np.array([points[i], nearest[i].x])), nearest[i])
    radii = np.array([np.nan if site.radius is None else site.radius for site in sites])
    plausible.warn_each(
        plausible.of_patch(site.radius, extent) for site in sites if site.radius is not None
    )
    found = located(structure, nearest.x, directions, radii, nearest)
    _check(found, placed)
    return found


def _beyond_seams(
    structure: MeshedParts,
    member: Member,
    laid: Sites,
    part_of: Callable[[Member], MeshedStructure],
) -> list[tuple[Member, Array, Array]]:
    """[(neighbouring sheet, share of each patch on it (P,), load vectors on its dofs (P, rows))].

    Triangles beside quadrilaterals are a part of their own; a patch may lie on both.
    """
    cut = np.flatnonzero(laid.share < 1 - ROUNDED_SHARE)
    if laid.contact is None or not member.part.kind.sheet or not len(cut):
        return []
    x = member.at.placed(laid.points[cut])
    found = []
    taken = [member.part.faces]
    for other in structure.members():
        if other is member or not other.part.kind.sheet or other.at != member.at:
            continue
        near = cut[other.closest(x).distance < laid.radii[cut]]
        if not len(near):
            continue
        part, own = part_of(other), (laid.points[near], laid.radii[near], laid.contact.of(near))
        weighted, share = patches(part.faces, *own, taken)
        taken.append(part.faces)
        every, b = np.zeros(len(laid)), np.zeros((len(laid), other.size))
        every[near] = share
        columns = on_free_dofs(part, loads(part, weighted, laid.directions[near]))
        b[near] = columns.toarray().T
        found.append((other, every, b))
    return found


def _of_sites(structure: MeshedStructure, sites: Sequence[Site], found: Sites) -> list[Functional]:
    """The data of each site."""
    columns = found.loads.toarray().T
    sides = _across(structure, sites, found)
    nearest = closest_many(structure.mesh, found.points)
    # here, for all ranks take part in it
    low, high = structure.mesh.box
    thickness = structure.dimensions[2]
    return [
        Functional(
            np.ascontiguousarray(columns[i]),
            None if np.isnan(found.radii[i]) else float(found.radii[i]),
            float(found.local[i]),
            found.points[i],
            found.directions[i],
            sides[i],
            cell_and_waves(structure, nearest[i], found.directions[i], high - low, thickness),
        )
        for i in range(len(sites))
    ]


#: Cosine of a blow and the normal of a sheet, or the thin side of a block, up to which it does not
#: bend it.
ALONG = 0.3


def cell_and_waves(
    structure: MeshedStructure,
    nearest: ClosestPoint,
    direction: Array,
    sides: Array,
    thickness: float,
) -> tuple[float, float, float]:
    """Longest edge [m] of a cell, speed times radius of gyration [m²/s] of bending, speed [m/s].

    `sides` (3,) [m] of the box around the part; `thickness` of a sheet, a beam, or that box.
    """
    mesh = structure.mesh
    x = corners_at(mesh, nearest)
    edges = x[:, None] - x[None]
    size = float(np.linalg.norm(edges, axis=2).max())
    if mesh.tdim == mesh.gdim:
        thin = np.eye(3)[int(np.argmin(sides[: mesh.gdim]))]
        bends = abs(float(direction @ thin))
    else:  # how far it points out of the cell's tangents
        tangents = np.linalg.svd(edges.reshape(-1, 3), full_matrices=False)[2][: mesh.tdim]
        bends = float(np.linalg.norm(direction - (direction @ tangents.T) @ tangents))
    speed = max(material.bar_speed() for material, _ in structure.parts)
    gyration = thickness / sqrt(12) if bends > ALONG else 0.0
    return size, speed * gyration, speed


def _across(
    structure: MeshedStructure, sites: Sequence[Site], found: Sites
) -> list[tuple[Functional, ...]]:
    """The tangential load vectors of each site; () for sites without tangential directions."""
    sides: list[list[Functional]] = [[] for _ in sites]
    asked = [i for i, site in enumerate(sites) if site.tangential]
    if not asked or found.weighted is None:
        return [()] * len(sites)
    for across in tangents(found.directions, "z" not in structure.form.components):
        whole = loads(structure, found.weighted, across)
        free = on_free_dofs(structure, whole)
        moving = sums(structure, free) > LEAST_FREE_SHARE * sums(structure, whole)
        columns = free.toarray().T * moving[:, None]
        for i in asked:
            b = np.ascontiguousarray(columns[i])
            sides[i].append(Functional(b, point=found.points[i], direction=across[i]))
    return [tuple(each) for each in sides]


def _check(found: Sites, placed: Callable[[Array], Array]) -> None:
    """InputError for the first site that cannot move, or has no surface under its patch."""
    points = placed(found.points)
    for i, radius in enumerate(found.radii):
        if found.depth[i] > radius:
            raise InputError(
                f"the site at {text(points[i])} lies about {found.depth[i]:.2g} m inside "
                f"the part, deeper than its radius {radius:g} m: a patch needs a surface; give a "
                "point on it."
            )
        if found.share[i] <= 0:
            raise InputError(
                f"the patch of radius {radius:g} m at {text(points[i])} finds no surface: "
                f"the facets there measure {found.size[i]:.3g} m; refine around the site, "
                f"refine=[(point, {radius:g})]."
            )
        if found.moving[i] <= LEAST_FREE_SHARE:
            raise InputError(constrained(f"the site at {text(points[i])}"))


def _in_space(mesh: Mesh, form: WeakForm, site: Site) -> tuple[Array, Array]:
    """Point and unit direction with three coordinates."""
    at, along = site.point, site.direction
    assert not isinstance(at, str)
    assert at is not None
    assert along is not None  # Site has seen to that
    point, direction = in_space(at), in_space(along)
    direction /= np.linalg.norm(direction)
    if "z" not in form.components and abs(direction[2]) > 1e-12:
        raise InputError(f"direction {tuple(along)} leaves the plane of {mesh.name}, which is 2-D.")
    return point, direction


def _check_distance(
    mesh: Mesh, extent: float, site: Site, points: Array, nearest: ClosestPoint
) -> None:
    """InputError for a site far from the mesh; `points` (2, 3): the site, the nearest point."""
    on = ON_STRUCTURE * extent
    if site.snap is False and nearest.distance <= on:
        return
    free = isinstance(site.snap, bool)
    reach = Reach("the point of the site", None if free else max(site.snap, on))
    reach.check(points[0], points[1], extent, partial(size_at, mesh, nearest))
    if site.snap is False:
        raise InputError(
            f"the point {text(points[0, : mesh.gdim])} is {nearest.distance:.3g} m off the "
            f"structure; its nearest point is {text(points[1])}: use that, or Site(..., snap=True)."
        )
