"""Load vectors of points of a mesh, or of the parts of an assembly, and of released supports."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, sqrt

import numpy as np
from mpi4py import MPI

from antiosc.base import plausible
from antiosc.base._types import Array, IntArray
from antiosc.base.checks import point_text as text
from antiosc.base.errors import InputError, without_warnings
from antiosc.fem.assembly import MeshedParts
from antiosc.fem.assembly.assemble import eliminate
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.joint import Motion
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import dot, multiply, norm
from antiosc.fem.mesh import Mesh
from antiosc.fem.mesh.surface import ClosestPoint, Faces, closest_many, corners_at, size_at
from antiosc.fem.reach import Reach
from antiosc.fem.structure import Dissipation, in_space
from antiosc.fem.structure.meshed import Member, MeshedStructure
from antiosc.fem.structure.support import Support, fixed_dofs
from antiosc.reduce.site.names import at_node, middle_of, motion_of, on_face
from antiosc.reduce.site.on_matrices import algebraic
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
    return replace(found, b=b, point=x, direction=along, across=across)


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


#: Force of an element in a rigid motion over that of its terms, below which it is rounding.
INTERNAL = 1e-9


@dataclass(frozen=True, eq=False)
class Element:
    """A grounded spring, or a term of the damping, on some rows of u.

    `name` and `point` (3,) [m]: of what acts on the ground; "" of others.
    """

    name: str
    point: Array | None
    rows: slice
    term: Dissipation

    def forces(self, comm: MPI.Comm, u: Array) -> Array:
        """c G u (j, k) of motions (rows of this rank, k) of all parts."""
        return np.asarray(self.term.c @ comm.allreduce(np.asarray(self.term.G @ u[self.rows])))

    def loads(self, comm: MPI.Comm, u: Array) -> Array:
        """Gᵀ c G u (rows of this rank, k)."""
        found = np.zeros(u.shape)
        found[self.rows] = (
            self.term.G.T @ self.forces(comm, u)
            if self.term.matrix is None
            else self.term.factor * multiply(self.term.matrix, u[self.rows])
        )
        return found

    def if_to_ground(self, comm: MPI.Comm, rigid: Array) -> Element:
        """The element; without its name if rigid motions do not strain it."""
        moved = np.abs(self.forces(comm, rigid)).max(initial=0.0)
        assert self.term.c is not None
        terms = np.abs(self.term.c) @ (abs(self.term.G) @ np.abs(rigid))
        named = moved > INTERNAL * terms.max(initial=0.0)
        return self if named else replace(self, name="")


class Released:
    """The reactions of supports and grounded springs, from motions in which one of them is
    released.

    The supports of the structure and of its parts are released one after the other, then the ground
    ends of springs. Each element on the ground has the name of a support; dampers alone carry no
    static force.

    Where a joint and supports hold the same motion, the constraints of the joint that follow from
    the supports carry no force, as in the assembly itself, which omits them.

    Attributes
    ----------
    centres : support -> (3,) mean of its nodes, m.
    pulled : (rows of this rank, 6 S) forces on the dofs that follow unit rigid motions of each
        support.
    """

    def __init__(self, matrices: MeshedParts, supports: Sequence[Support]) -> None:
        self._of = matrices
        self._assembly = matrices if isinstance(matrices, AssembledMatrices) else None
        for name in self._assembly.layout.condensed if self._assembly else ():
            raise InputError(
                "reactions of an assembly with superelements are not known: the supports and the "
                f"inertia inside of the part {name!r} are not."
            )
        self._parts: dict[int, MeshedStructure] = {}
        self._motions = np.zeros((0, 0))
        self._springs: list[Element] = []
        self._damping: list[Element] = []
        self.centres, pulled = matrices.decided(lambda: self._released(supports))
        self.pulled: Array = matrices.own(pulled)

    def inertia(self, following: Array, rigid: Array) -> tuple[Array, Array]:
        """(M g, M r), rows of this rank, for the motions g of the supports and rigid motions r.

        `following` (rows of this rank, 6 S) are the motions of the free dofs that follow them;
        `rigid` as in `applied`.
        """
        moved = self._of.expanded(following)

        def work() -> tuple[Array, Array]:
            self._motions = self._motions + moved
            return self._forces("M", self._motions), self._forces("M", rigid)

        both = self._of.decided(work)
        return self._of.own(both[0]), self._of.own(both[1])

    @property
    def motions(self) -> Array:
        """The motions g (dofs, 6 S) on one rank; call `inertia` first."""
        return self._motions

    def rigid(self) -> Array:
        """Unit translations (dofs of all parts before joining, 3) of the whole structure."""
        return self._of.places.rigid_motions(np.zeros(3))[:, :3]

    def applied(self, sites: Sequence[Site], rigid: Array) -> tuple[Array, Array]:
        """(bᵀg (P, 6 S), bᵀr (P, 3)) for the load vectors b of the sites along their contacts."""

        def work() -> tuple[Array, Array]:
            with without_warnings():  # they were told of when the model was extracted
                found = [self._functional(site) for site in sites]
            b = np.column_stack([each.b for one in found for each in (one, *one.across)])
            return dot(self._of.workers, b, self._motions), dot(self._of.workers, b, rigid)

        return self._of.decided(work)

    def damping(self, shapes: Array) -> list[tuple[float | None, Array]]:
        """(relaxation time, reactions (6 S, B) by motions of the shapes (rows of this rank, B)).

        Of the terms of the damping, in the order of the structure's; to be called after `inertia`.
        """
        u = self._of.expanded(shapes)

        def work() -> list[tuple[float | None, Array]]:
            return [(one.term.tau, self._by_damping(one, u)) for one in self._damping]

        return self._of.decided(work)

    def _by_damping(self, one: Element, u: Array) -> Array:
        comm = self._of.workers
        loads = one.loads(comm, u)
        found = dot(comm, self._motions, loads)
        if one.name:
            rigid = self._of.places.rigid_motions(self.centres[one.name])
            column = 6 * list(self.centres).index(one.name)
            found[column : column + 6] -= dot(comm, rigid, loads)
        return found

    def _elements(self) -> tuple[list[Element], list[Element]]:
        """The grounded springs, and all terms of the damping in the order of the structure."""
        springs: list[Element] = []
        terms: list[Element] = []
        comm, rigid = self._of.workers, self._of.places.rigid_motions(np.zeros(3))
        if self._assembly:
            added = self._assembly.added
            for kind, found in ((springs, added.springs()), (terms, added.dissipation(on_u=True))):
                every = [Element(term.name, term.point, slice(None), term) for term in found]
                kind += [element.if_to_ground(comm, rigid) for element in every]
        for member in self._of.members():
            part, prefix = self._part(member), f"{member.name}:" if member.name else ""
            for kind, found in ((springs, [*part.springs]), (terms, part.dissipation())):
                for term in found:
                    at = None if term.point is None else member.at.placed(term.point[None])[0]
                    kind.append(Element(term.name and prefix + term.name, at, member.rows, term))
        springs = [one for one in springs if one.name]
        return springs, sorted(terms, key=lambda one: one.term.matrix is not None)

    def _functional(self, site: Site) -> Functional:
        if site.point is not None:
            return before_joining(self._of, [site], self._part)[0]
        if self._assembly:
            raise InputError("reactions of an assembly take sites at points, not dofs.")
        return algebraic(self._part(self._of.members()[0]), site)

    def _released(self, supports: Sequence[Support]) -> tuple[dict[str, Array], Array]:
        """(centres, forces on the supports) of the motions in which each support is released."""
        centres: dict[str, Array] = {}
        places = self._of.places
        held: list[tuple[str, IntArray, Array]] = []  # name, dofs, their motions
        for member in self._of.members():
            prefix = f"{member.name}:" if member.name else ""
            for name, dofs in held_dofs(member.part).items():
                centres[prefix + name] = centre = _centre(member, dofs)
                moved = member.places.rigid_motions(centre, dofs)
                held.append((prefix + name, member.first + dofs, moved))
        constraints = self._assembly.constraints if self._assembly else None
        names = names_of(supports, centres) if constraints else []
        rows = constraints.rows if constraints else []
        if constraints and self._assembly:
            points = places.points
            for name, one in zip(names, rows, strict=False):
                centres[name] = points[np.unique(one.matrix.indices)].mean(axis=0)
        self._springs, self._damping = self._elements()
        grounds = [element for element in (*self._springs, *self._damping) if element.name]
        for element in grounds:
            own = [other.point for other in grounds if other.name == element.name]
            known = [x for x in own if x is not None]
            centre = np.mean(known or places.points[element.term.G.indices], axis=0)
            centres.setdefault(element.name, centre)
        if not centres:
            raise InputError(
                "the structure has no supports, springs or dampers to the ground: it has no"
                " reactions."
            )
        column = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(centres)}
        motions = np.zeros((len(places.kind), 6 * len(centres)))
        for name, dofs, moved in held:
            motions[dofs, column[name]] = moved
        if constraints:
            prescribed = [np.asarray(-one.matrix @ motions) for one in rows]
            for name, one, values in zip(names, rows, prescribed, strict=False):
                values[:, column[name]] += one.matrix @ places.rigid_motions(centres[name])
            found = eliminate(
                rows,
                constraints.fixed,
                constraints.scale,
                constraints.basis,
                np.vstack([np.zeros((0, motions.shape[1])), *prescribed]),
            )
            assert found.particular is not None
            motions = motions + found.particular
        self._motions = motions
        pulled = -self._forces("K", motions)
        for spring in self._springs:
            rigid = places.rigid_motions(centres[spring.name])
            pulled[:, column[spring.name]] += self._on_free(spring.loads(self._of.workers, rigid))
        return centres, pulled

    def _part(self, member: Member) -> MeshedStructure:
        """A part without its supports and its prestress."""
        part = member.part.unloaded or member.part
        if not part.supports:
            return part
        if id(part) not in self._parts:
            self._parts[id(part)] = part.unsupported()
        return self._parts[id(part)]

    def _forces(self, which: str, motions: Array) -> Array:
        """K u or M u on the free dofs, for motions u of the parts' dofs."""
        forces = np.zeros(motions.shape)
        for member in self._of.members():
            matrix = getattr(self._part(member), which)
            forces[member.rows] = multiply(matrix, motions[member.rows])
        if which == "K" and self._of.preload is not None:
            forces += self._of.preload.added(motions)
        free = self._on_free(forces)
        if self._assembly is None:
            return free
        added = self._assembly.added
        more = added.forces(motions) if which == "K" else added.inertial_loads(motions)[0]
        return np.asarray(free + more)

    def _on_free(self, forces: Array) -> Array:
        """Forces on u (rows of this rank, k) transferred to the free dofs."""
        if self._assembly is not None:
            return np.asarray(self._of.joined(forces))
        forces[self._of.fixed[self._of.fixed < len(forces)]] = 0.0
        return forces


def _centre(member: Member, dofs: IntArray) -> Array:
    """Mean coordinates (3,) of dofs of a part, over all of its ranks."""
    there = member.nodes[dofs // member.block]
    comm = member.part.comm
    total, count = comm.allreduce(there.sum(axis=0)), comm.allreduce(len(there))
    return np.asarray(total / max(count, 1))


def names_of(supports: Sequence[Support], taken: Container[str] = ()) -> list[str]:
    """Names of supports: their groups, or "support 1", "support 2", …."""
    names: list[str] = []
    for number, support in enumerate(supports, start=1):
        name = support.where if isinstance(support.where, str) else f"support {number}"
        names.append(f"{name} ({number})" if name in taken or name in names else name)
    return names


def held_dofs(part: MeshedStructure) -> dict[str, IntArray]:
    """Support of a part -> dofs of this rank that it fixes and no earlier support does."""
    rows, result = len(part.attached_inertia), {}
    taken = np.zeros(0, dtype=int)
    for name, support in zip(names_of(part.supports), part.supports, strict=True):
        paths = fixed_dofs(part.mesh, part.form, [support])
        dofs = np.unique(np.concatenate([taken[:0], *paths.values()]))
        result[name] = np.setdiff1d(dofs[dofs < rows], taken)
        taken = np.union1d(taken, result[name])
    return result
