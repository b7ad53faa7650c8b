"""Load vectors of points on a mesh or on the parts of an assembly, and support reactions."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import replace
from math import sqrt
from typing import cast

import numpy as np
import scipy.sparse

from antiosc.base import plausible
from antiosc.base._types import Array, IntArray
from antiosc.base.checks import point_text as text
from antiosc.base.errors import ChoiceWarning, InputError, SiteError, without_warnings
from antiosc.base.texts import engineering, point_text
from antiosc.fem.assembly.assemble import eliminate
from antiosc.fem.assembly.assembled import AssembledMatrices, group_of, point_on_parts
from antiosc.fem.assembly.layout import Layout
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import dot, multiply, norm
from antiosc.fem.mesh.surface import (
    ClosestPoint,
    ClosestPoints,
    closest,
    corners_at,
    struck_point,
)
from antiosc.fem.platform import warn
from antiosc.fem.structure import in_space
from antiosc.fem.structure.loads import PointMotion, loads
from antiosc.fem.structure.meshed import Member, MeshedStructure, PartsMatrices
from antiosc.fem.structure.place import Place, places_at
from antiosc.fem.structure.support import Support, fixed_dofs
from antiosc.recovery.place import SNAP_SHARE, Reach
from antiosc.reduce.site.site import (
    LEAST_FREE_SHARE,
    Functional,
    Site,
    constrained_message,
    functional_on_rows,
    tangents,
)
from antiosc.reduce.site.sites import (
    SURFACE_COSINE,
    Sites,
    load_sums,
    located_sites,
    warn_of_doubts,
)

#: Largest distance of a point that counts as on the structure, over the structure's size.
STRUCTURE_TOLERANCE = 1e-6


def functionals_at(structure: PartsMatrices, sites: Sequence[Site]) -> list[Functional]:
    """Load vectors of sites; all points are located together. Errors as for `functionals`."""
    by_rows = [site.point is None and (site.node is None or site.dof is not None) for site in sites]
    at_points = [site for site, by_row in zip(sites, by_rows, strict=True) if not by_row]
    loads = functionals_on_u(structure, at_points, lambda member: member.part)
    on_q = (_on_q(structure, *pair) for pair in zip(at_points, loads, strict=True))
    return [
        functional_on_rows(structure, site) if by_row else next(on_q)
        for site, by_row in zip(sites, by_rows, strict=True)
    ]


def _on_q(structure: PartsMatrices, site: Site, functional: Functional) -> Functional:
    """The functional with loads on the reduced dofs q, not u; SiteError for a fixed site."""
    B = structure.joined(functional.B)
    comm = structure.comm
    if norm(comm, B[:, 0]) <= LEAST_FREE_SHARE * norm(comm, functional.b):
        assert functional.point is not None
        place = repr(site.point) if isinstance(site.point, str) else f"at {text(functional.point)}"
        raise SiteError(constrained_message(f"the site {place}"))

    return replace(functional, B=B)


def functionals_on_u(
    structure: PartsMatrices, sites: Sequence[Site], part_of: Callable[[Member], MeshedStructure]
) -> list[Functional]:
    """Load vectors of sites on the dofs u of all parts, before the parts are joined; `part_of(m)`
    is the part of the member m."""
    by_site: dict[int, Functional] = {}
    by_part: dict[str, dict[int, Place]] = {}
    for k, (place, end) in enumerate(places_of(structure, sites)):
        if end is None:
            by_part.setdefault(place.member.name, {})[k] = place
        else:
            layout = cast(AssembledMatrices, structure).layout
            by_site[k] = _functional_without_mesh(layout, sites[k], place, end)

    for of_part in by_part.values():
        places = list(of_part.values())
        part = part_of(places[0].member)
        struck = [sites[k] for k in of_part]
        found = _sites_on_mesh(part, struck, places)
        warn_of_doubts(part, found)
        functionals = _site_functionals(structure, part, struck, places, found)
        by_site.update(zip(of_part, functionals, strict=True))

    return [by_site[k] for k in range(len(sites))]


def places_of(
    matrices: PartsMatrices, sites: Sequence[Site]
) -> list[tuple[Place, PointMotion | None]]:
    """(place, motion if the point has no mesh, else None) of sites at a point, group or node."""
    found: dict[int, tuple[Place, PointMotion | None]] = {}
    ends: list[PointMotion | None] = []
    by_part: dict[str | None, list[tuple[int, Array, Array]]] = {}
    for k, site in enumerate(sites):
        direction = None if site.direction is None else in_space(site.direction)
        end = None
        if site.face is None:
            x, part, end = point_on_parts(matrices, site.point, site.part, site.node)
        else:
            member, group = group_of(matrices, site.face)
            own, along = struck_point(member.part.faces, group)
            x, part = member.at.placed(own[None])[0], member.name or None
            direction = member.at.rotation @ along if direction is None else direction

        assert direction is not None
        ends.append(end)
        by_part.setdefault(part, []).append((k, x, direction))

    for part, aimed in by_part.items():
        numbers, points, directions = zip(*aimed, strict=True)
        places = places_at(matrices.members(part), np.array(points), np.array(directions))
        for k, place in zip(numbers, places, strict=True):
            found[k] = _on_surface(sites[k], place), ends[k]

    return [found[k] for k in range(len(sites))]


def _on_surface(site: Site, place: Place) -> Place:
    """The place of a site; with snap, a patch inside a solid is moved to the side struck."""
    part = place.member.part
    if not site.snap or site.radius is None or not part.kind.outside:
        return place

    extent = part.mesh.extent()
    reach = SNAP_SHARE * extent if site.snap is True else site.snap
    depth, foot = part.faces.foot(place.point, place.direction, reach)
    is_inside = STRUCTURE_TOLERANCE * extent < depth <= reach
    return replace(place, nearest=closest(part.mesh, foot)) if is_inside else place


def _functional_without_mesh(
    layout: Layout, site: Site, place: Place, end: PointMotion
) -> Functional:
    """The site as a functional of the dofs u, at a superelement's site or a reference point; `end`:
    the motion of this point as functionals of u."""
    part, _, name = str(site.point).partition(":")
    direction = in_space(site.direction or ())
    direction = direction / np.linalg.norm(direction)
    if layout.plane and direction[2]:
        raise InputError(f"direction {site.direction} leaves the plane of the assembly.")

    if site.radius is not None or site.tangential:
        raise InputError(f"{site.point!r} has no surface: leave radius and tangential out.")
    if not end.has(np.append(direction, np.zeros(3))):
        raise InputError(
            f"the site {site.point!r} of a superelement does not move along the direction of "
            "impact: extract its model with a tangential site."
        )

    b = np.asarray(end.displacements.T @ direction)
    functional = Functional(b[:, None], point=end.point, directions=direction[None], place=place)
    if not name:
        return functional
    radius, compliance = layout.condensed[part].patches[name]
    return replace(functional, radius=radius, local_compliance=compliance)


# -- on one mesh


def _sites_on_mesh(
    structure: MeshedStructure, sites: Sequence[Site], places: Sequence[Place]
) -> Sites:
    """The sites as arrays, at their `places` on a mesh."""
    mesh = structure.mesh
    placed = places[0].member.at.placed
    nearest = ClosestPoints.of([place.nearest for place in places])
    directions = np.array([place.direction for place in places])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if "z" not in structure.form.components and np.any(np.abs(directions[:, 2]) > 1e-12):
        raise InputError(f"a direction of impact leaves the plane of {mesh.name}, which is 2-D.")

    extent = mesh.extent()
    for site, place in zip(sites, places, strict=True):
        if site.node is None and not isinstance(site.point, str):
            _check_distance(site, place)
    radii = np.array([np.nan if site.radius is None else site.radius for site in sites])
    plausible.warn_each(
        plausible.patch_doubt(site.radius, extent) for site in sites if site.radius is not None
    )

    if structure.kind.outside:
        contact = structure.surface_below(nearest.x, directions, radii)
        cosines = np.einsum("pd,pd->p", directions, contact.normals)
        leaving = np.isfinite(contact.depth) & (cosines > SURFACE_COSINE)
        directions[leaving] *= -1.0
        for x in placed(nearest.x[leaving]):
            warn(structure.comm, TURNED_WARNING.format(point_text(x)), ChoiceWarning)

    sites_found = located_sites(structure, nearest.x, directions, radii, nearest)
    _check_sites(sites_found, placed)
    return sites_found


#: Warning for a direction that points out of the material, as a contact can only push.
TURNED_WARNING = "the direction of the site at {} leaves the material there: it is turned into it."


def _site_functionals(
    matrices: PartsMatrices,
    part: MeshedStructure,
    sites: Sequence[Site],
    places: Sequence[Place],
    found: Sites,
) -> list[Functional]:
    """Load vectors on all dofs and patch data of sites on one part; `found`: the sites there."""
    columns, axes = [found.loads], [found.directions]

    if found.weighted is not None and any(site.tangential for site in sites):
        for across in tangents(found.directions, "z" not in part.form.components):
            B = loads(part.comm, part.form, found.weighted, across)
            free = part.joined(B)
            is_movable = load_sums(part, free) > LEAST_FREE_SHARE * load_sums(part, B)
            columns.append((free @ scipy.sparse.diags(is_movable.astype(float))).tocsr())
            axes.append(across)

    # computed here, since all ranks must take part
    low, high = part.mesh.box
    thickness = part.dimensions[2]
    functionals = []
    for i, (site, place) in enumerate(zip(sites, places, strict=True)):
        count = len(columns) if site.tangential else 1
        directions = np.array([of_sites[i] for of_sites in axes[:count]])
        B = np.hstack([column[:, [i]].toarray() for column in columns[:count]])
        if matrices.assembled:
            of_part, B = B, np.zeros((algebra.size(matrices.K), count))  # of q, as many as of u
            B[place.member.rows] = of_part
        functionals.append(
            Functional(
                B,
                None if np.isnan(found.radii[i]) else float(found.radii[i]),
                float(found.local[i]),
                place.placed,
                directions @ place.member.at.rotation.T,
                cell_and_waves(part, place.nearest, directions[0], high - low, thickness),
                replace(place, direction=directions[0]),
            )
        )

    return functionals


#: An impact does not bend a sheet or a thin block if its cosine with the normal is below this.
BENDING_COSINE = 0.3


def cell_and_waves(
    structure: MeshedStructure,
    nearest: ClosestPoint,
    direction: Array,
    sides: Array,
    thickness: float,
) -> tuple[float, float, float]:
    """(longest edge of the cell [m], wave speed × radius of gyration [m²/s], wave speed [m/s])."""
    material = structure.material_at(nearest)
    if structure.kind.sheet:
        thickness = material.section.thickness
    mesh = structure.mesh
    x = corners_at(mesh, nearest)
    edges = x[:, None] - x[None]
    size = float(np.linalg.norm(edges, axis=2).max())

    if structure.kind.outside:
        thin = np.eye(3)[int(np.argmin(sides[: mesh.gdim]))]
        bending_share = abs(float(direction @ thin))
    else:  # how far it points out of the cell's tangents
        tangents = np.linalg.svd(edges.reshape(-1, 3), full_matrices=False)[2][: mesh.tdim]
        bending_share = float(np.linalg.norm(direction - (direction @ tangents.T) @ tangents))

    speed = material.bar_speed()
    gyration = thickness / sqrt(12) if bending_share > BENDING_COSINE else 0.0
    return size, speed * gyration, speed


def _check_sites(sites_found: Sites, placed: Callable[[Array], Array]) -> None:
    """InputError for the first site that cannot move or has no surface under its patch."""
    points = placed(sites_found.points)
    for i, radius in enumerate(sites_found.radii):
        if sites_found.depth[i] > radius:
            raise InputError(
                f"the site at {text(points[i])} lies about {sites_found.depth[i]:.2g} m inside the "
                f"part, deeper than its radius {radius:g} m: give a point on a surface, or snap."
            )
        if sites_found.share[i] <= 0:
            least, facets = (engineering(x, "m") for x in (radius, sites_found.size[i]))
            raise InputError(
                f"the patch of radius {least} at {point_text(points[i])} finds no surface: the "
                f"facets there measure {facets}; refine around the site to {least}."
            )
        if sites_found.moving[i] <= LEAST_FREE_SHARE:
            raise SiteError(constrained_message(f"the site at {text(points[i])}"))


def _check_distance(site: Site, place: Place) -> None:
    """InputError for a site whose point is too far from its place on the structure."""
    assert site.point is not None
    point, nearest = in_space(site.point), place.nearest  # type: ignore[arg-type]
    mesh = place.member.part.mesh
    tolerance = STRUCTURE_TOLERANCE * mesh.extent()
    if site.snap is False and nearest.distance <= tolerance:
        return
    free = isinstance(site.snap, bool)
    reach = Reach("the point of the site", None if free else max(site.snap, tolerance))
    reach.check_at(point, place)
    if site.snap is False:
        raise InputError(
            f"the point {text(point[: mesh.gdim])} is {nearest.distance:.3g} m off the "
            f"structure; its nearest point is {text(place.placed)}: use that, or a site with snap."
        )


class ReleasedSupports:
    """Reactions of S supports, as virtual work on unit rigid motions of one support at a time.
    `centres`: points [m] by name; `pulled` (rows, 6 S): forces of the motions on the free dofs."""

    def __init__(self, matrices: PartsMatrices, supports: Sequence[Support]) -> None:
        self._of = matrices
        self._assembly = matrices if isinstance(matrices, AssembledMatrices) else None
        for name in self._assembly.layout.condensed if self._assembly else ():
            raise InputError(
                "reactions of an assembly with superelements are not known: the supports and the "
                f"inertia inside of the part {name!r} are not."
            )

        self._parts: dict[int, MeshedStructure] = {}
        self._motions = np.zeros((0, 0))
        self.centres, self.pulled = self._released(supports)

        #: unit translations (dofs of all parts before joining, 3) of the structure
        self._rigid = matrices.places.rigid_motions(np.zeros(3))[:, :3]

    def inertia(self, following: Array) -> tuple[Array, Array]:
        """(M g, M r): g (dofs, 6 S): unit motions of the S supports with the response `following`
        (rows, 6 S) of the free dofs, r (dofs, 3): unit translations of the structure."""
        self._motions = self._motions + self._of.expanded(following)
        return self._forces("M", self._motions), self._forces("M", self._rigid)

    def applied(self, sites: Sequence[Site]) -> tuple[Array, Array]:
        """(bᵀg (P, 6 S), bᵀr (P, 3)): work of unit site forces on g and r of `inertia`."""
        columns = []
        with without_warnings():  # they were told of when the model was extracted
            for site in sites:
                if site.point is not None:
                    (functional,) = functionals_on_u(self._of, [site], self._part)
                elif self._assembly:
                    raise InputError("reactions of an assembly take sites at points, not dofs.")
                else:
                    functional = functional_on_rows(self._part(self._of.members()[0]), site)
                columns.append(functional.B)

        b = np.hstack(columns)
        return dot(self._of.comm, b, self._motions), dot(self._of.comm, b, self._rigid)

    def damping(self, shapes: Array) -> list[tuple[float | None, Array]]:
        """(relaxation time [s] or None, reactions (6 S, k) to k `shapes`) of each damping term."""
        comm, u = self._of.comm, self._of.expanded(shapes)
        own = self._assembly.added.dissipation(on_u=True) if self._assembly else []
        terms = [(slice(None), term) for term in own]
        for member in self._of.members():
            terms += [(member.rows, term) for term in self._part(member).dissipation()]
        terms.sort(key=lambda pair: pair[1].matrix is not None)

        reactions: list[tuple[float | None, Array]] = []
        for rows, term in terms:
            if term.matrix is not None:
                loads = term.factor * multiply(term.matrix, u[rows])
            else:
                loads = term.G.T @ (term.c @ comm.allreduce(np.asarray(term.G @ u[rows])))
            of_term = dot(comm, self._motions[rows], np.asarray(loads))
            reactions.append((term.tau, np.asarray(of_term)))
        return reactions

    def _released(self, supports: Sequence[Support]) -> tuple[dict[str, Array], Array]:
        """(centre of each support, forces (rows, 6 S) on the free dofs for its 6 unit motions)."""
        centres: dict[str, Array] = {}
        places = self._of.places

        moved: dict[str, tuple[IntArray, Array]] = {}  # dofs of a support, their motions
        for member in self._of.members():
            prefix = f"{member.name}:" if member.name else ""
            for name, dofs in dofs_by_support(member.part).items():
                x, comm = member.nodes[dofs // member.block], member.part.comm
                count = comm.allreduce(len(x))
                centre = np.asarray(comm.allreduce(x.sum(axis=0)) / max(count, 1))
                centres[prefix + name] = centre
                motions_of_dofs = member.places.rigid_motions(centre, dofs)
                moved[prefix + name] = member.first + dofs, motions_of_dofs

        # supports of the assembly are constraints between dofs
        constraints = self._assembly.constraints if self._assembly else None
        rows = constraints.rows if constraints else []
        names = support_names(supports, centres) if constraints else []
        for name, row in zip(names, rows, strict=False):
            centres[name] = places.points[np.unique(row.matrix.indices)].mean(axis=0)

        if not centres:
            raise InputError(
                "the structure has no supports: it has no reactions; the force of a spring to the"
                " ground is its stiffness times the displacement of its point (`probe`)."
            )

        column = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(centres)}
        motions = np.zeros((len(places.kind), 6 * len(centres)))
        for name, (dofs, motions_of_dofs) in moved.items():
            motions[dofs, column[name]] = motions_of_dofs

        if constraints:
            prescribed = [np.asarray(-row.matrix @ motions) for row in rows]
            for name, row, values in zip(names, rows, prescribed, strict=False):
                values[:, column[name]] += row.matrix @ places.rigid_motions(centres[name])
            all_values = np.vstack([np.zeros((0, motions.shape[1])), *prescribed])
            eliminated = eliminate(rows, constraints.fixed, constraints.scale, all_values)
            assert eliminated.particular is not None
            motions = motions + eliminated.particular

        self._motions = motions
        return centres, -self._forces("K", motions)

    def _part(self, member: Member) -> MeshedStructure:
        """The part of `member`, without its supports and prestress."""
        part = member.part.unloaded or member.part
        if not part.supports:
            return part
        if id(part) not in self._parts:
            self._parts[id(part)] = part.unsupported()
        return self._parts[id(part)]

    def _forces(self, which: str, motions: Array) -> Array:
        """K u or M u (`which`: "K" or "M") on the free dofs, for `motions` u of all parts' dofs."""
        forces = np.zeros(motions.shape)
        for member in self._of.members():
            matrix = getattr(self._part(member), which)
            forces[member.rows] = multiply(matrix, motions[member.rows])
        if which == "K" and self._of.preload is not None:
            forces += self._of.preload.added(motions)
        free = np.asarray(self._of.joined(forces))
        if self._assembly is None:
            return free
        attached = self._assembly.added
        extra = attached.forces(motions) if which == "K" else attached.inertial_loads(motions)[0]
        return np.asarray(free + extra)


def support_names(supports: Sequence[Support], used: Container[str] = ()) -> list[str]:
    """Name of each support: its group, or "support 1", …; numbered if in `used` or repeated."""
    names: list[str] = []
    for number, support in enumerate(supports, start=1):
        name = support.where if isinstance(support.where, str) else f"support {number}"
        names.append(f"{name} ({number})" if name in used or name in names else name)
    return names


def dofs_by_support(part: MeshedStructure) -> dict[str, IntArray]:
    """Dofs on this rank by the name of the support; a dof of several belongs to the first."""
    rows = len(part.attached_inertia)
    result = {}
    fixed = np.zeros(0, dtype=int)
    for name, support in zip(support_names(part.supports), part.supports, strict=True):
        paths = fixed_dofs(part.mesh, part.form, [support])
        dofs = np.unique(np.concatenate([fixed[:0], *paths.values()]))
        result[name] = np.setdiff1d(dofs[dofs < rows], fixed)
        fixed = np.union1d(fixed, result[name])

    return result
