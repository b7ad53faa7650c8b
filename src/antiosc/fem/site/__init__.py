"""`Site`: point and direction of an impact; its load vector b; points by their names.

bᵀu is the displacement of the structure at the site along the direction of impact, and b contains
the nodal forces of a unit force there.

On nodes of given matrices a patch has Hertz's pressure √(1 − r²/a²) over the circle of radius a
across the direction of impact; each node takes the load of the points that are next to it. Nodes
below the surface do not count: those that another node covers against the direction of impact.

A named group is the point next to the centroid of its entities.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from numbers import Real
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from antiosc.base import checks
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import (
    array,
    flag,
    is_rigid,
    point_text,
    positive,
    read_only,
    store,
    text,
    whole,
)
from antiosc.base.errors import InputError, name_list
from antiosc.base.texts import FieldsRepr
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.structure import NodalMatrices, StructureMatrices, in_space
from antiosc.fem.structure.structure import Structure
from antiosc.io.dof_map import component_of

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices
    from antiosc.fem.assembly.joint import Motion
    from antiosc.fem.structure.meshed import Member


#: A site with less than this share of its load on free dofs is fixed by the supports.
LEAST_FREE_SHARE = 1e-9
#: Without a length a point is moved by at most this share of the part's size, or by one element.
SNAP_SHARE = 0.02


@dataclass(frozen=True)
class Site(FieldsRepr):
    """Point and direction of an impact on a structure.

    Parameters
    ----------
    point : sequence of 2 or 3 floats, or str
        Coordinates in m; any point of the structure, on or off the nodes. A text names a group (of
        an assembly "part:group"): its point, or the point next to the centroid of its entities. Of
        an assembly it may also be a reference point, or "part:site" of a superelement.
    face : str, optional
        In place of a point: a group of faces ("face 12", "hole 6 mm (1)", of an assembly
        "part:face 12"). The site is its point next to its centroid, and the direction is by default
        that into the part.
    direction : sequence of 2 or 3 floats
        The direction in which the impactor pushes; need not be a unit vector.
    radius : float, optional
        Radius in m of a patch with Hertz's pressure √(1 − r²/a²) on the surface around the
        point; force and displacement are both weighted by it. None: a point on a beam and on a
        solid (on a solid the compliance of a point then diverges with mesh refinement), and on a
        shell a patch with the thickness as radius. With this radius the shell has the compliance of
        a solid without the half-space compliance of the patch.
    snap : bool or float
        Move a point that is off the structure to the nearest point of the structure: True by at
        most 2 % of the part's size or one element, a number by at most this length in m.
    dof : int or str
        For matrices, instead of point and direction: the number of the dof at the site. With
        `node`: "x", "y", "z", "rx", "ry", "rz" or the number of the dof at the node.
    node : int
        The number of a node in the file of a mesh or a deck, with `direction`. For matrices with a
        map of their nodes and dofs, with `dof` or `direction`.
    vector : array_like (n,)
        For matrices: any load vector b.
    part : str, optional
        For assemblies: the part that is struck. By default the nearest one, and of parts that touch
        the one whose surface faces the impactor.
    tangential : bool
        Of a named site (`extract(part, {name: Site})`): the model knows its displacements across
        `direction` too, two of them (one in a plane structure), as a contact with friction needs.
        They are weighted over the patch as the normal one; its compliance remains in them.
    """

    point: Sequence[float] | str | None = None
    direction: Sequence[float] | None = None
    radius: float | None = None
    snap: bool | float = False
    dof: int | str | None = None
    vector: ArrayLike | None = None
    part: str | None = None
    tangential: bool = False
    node: int | None = None
    face: str | None = None

    def __post_init__(self) -> None:
        if self.face is not None:
            if self.point is not None:
                raise InputError("a Site takes a point or a face; got both.")
            store(self, face=text("face", self.face), point=self.face)
        given = [self.point is not None, self.dof is not None, self.vector is not None]
        at_node = self.node is not None
        if (given[0] or given[2]) if at_node else sum(given) != 1:
            raise InputError("a Site needs one of: point with direction, dof, vector, or node.")
        if at_node:
            store(self, node=whole("node", self.node))
            if given[1] == (self.direction is not None):
                raise InputError("a Site at a node needs one of: dof, as dof='z', or direction.")
        if self.radius is not None:
            store(self, radius=positive("radius", self.radius, "m"))
        if isinstance(self.snap, bool) or not isinstance(self.snap, Real):
            store(self, snap=flag("snap", self.snap))
        else:
            store(self, snap=inf if is_rigid(self.snap) else positive("snap", self.snap, "m"))
        store(self, tangential=flag("tangential", self.tangential))
        if self.tangential and self.direction is None and self.face is None:
            raise InputError("tangential directions need a Site with a direction.")
        if at_node and self.dof is not None:
            store(self, dof=component_of(self.dof))
        elif self.dof is not None:
            store(self, dof=whole("dof", self.dof, least=0))
        if self.vector is not None:
            store(self, vector=read_only(array("vector", self.vector, (None,))))
        if self.part is not None:
            store(self, part=text("part", self.part))
            if self.point is None:
                raise InputError("part= names the part of an assembly on which a point lies.")
        if self.point is None and not (at_node and self.direction is not None):
            return
        if self.direction is None and self.face is not None:
            return
        if self.direction is None:
            raise InputError(
                "a Site at a point needs the direction of impact, as direction=(0, 0, -1)."
            )
        direction = array("direction", self.direction, (None,))
        named = isinstance(self.point, str) or at_node
        point = direction if named else array("point", self.point, (None,))
        if len(point) not in (2, 3) or len(point) != len(direction):
            raise InputError(
                f"point and direction must both have 2 or 3 coordinates; got {len(point)} and "
                f"{len(direction)}."
            )
        if not np.linalg.norm(direction):
            raise InputError(
                "direction must not be the zero vector: it is the direction in which the impactor "
                "pushes."
            )
        store(self, direction=tuple(direction.tolist()))
        if not at_node:
            store(self, point=text("point", self.point) if named else tuple(point.tolist()))


@dataclass(frozen=True)
class Functional:
    """The load vector of a site, and the data of its patch."""

    #: b on the rows of this rank, zero on fixed dofs
    b: Array
    #: radius of the patch, m; None for a point
    radius: float | None = None
    #: half-space compliance of the patch, m/N (0 for a point)
    local_compliance: float = 0.0
    #: actual point (3,), m, and unit vector of the direction of impact
    point: Array | None = None
    direction: Array | None = None
    #: the same along the directions across it, if asked for
    across: tuple[Functional, ...] = ()
    #: the cell and the waves at the site (`ModelInfo.cells`), where there is a mesh
    cell: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Reach:
    """How far a given point may lie from the structure, onto which it is moved.

    Attributes
    ----------
    what : the point in words.
    snap : largest distance [m]; None: `SNAP_SHARE` of the part's size, or one element.
    remedy : what the caller can do.
    """

    what: str
    snap: float | None = None
    remedy: str = "give a point on it, or the length that it may be moved as snap="

    def check(
        self, point: Array, nearest: Array, size: float, element: Callable[[], float]
    ) -> None:
        """InputError for a point (3,) whose nearest point (3,) of the structure is too far [m].

        `size`, `element`: of the part, and of its element there [m].
        """
        distance = float(np.linalg.norm(point - nearest))
        most = SNAP_SHARE * size if self.snap is None else self.snap
        if distance > most and self.snap is None:
            most = max(most, element())
        if distance <= most:
            return
        rule = "2 % of the part's size, or one element" if self.snap is None else "the length given"
        units = f"; coordinates are in metres, and the part measures {size:.3g} m"
        raise InputError(
            f"{self.what} {point_text(point)} is {distance:.3g} m off the structure, whose nearest "
            f"point is {point_text(nearest)}: farther than {most:.3g} m, {rule}"
            f"{units if distance > size else ''}; {self.remedy}."
        )


def tangents(directions: Array, plane: bool) -> list[Array]:
    """Unit vectors (P, 3) across the directions (P, 3): two of each, in a plane structure one."""
    if plane:
        return [np.cross([0.0, 0.0, 1.0], directions)]
    # between axes that are equally oblique rounding must not decide
    least = np.argmin(np.abs(directions).round(6), axis=1)
    first = np.cross(np.eye(3)[least], directions)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return [first, np.cross(directions, first)]


def constrained(label: str) -> str:
    """Message for a site that cannot move."""
    return (
        f"{label} is fixed by supports along the direction of impact: it cannot move; choose "
        "another point."
    )


def functional(structure: Structure, site: Site) -> Functional:
    """The vector b of `site` on `structure`; see `functionals`."""
    return functionals(structure, [site])[0]


def functionals(structure: Structure, sites: Sequence[Site]) -> list[Functional]:
    """The vectors b of sites on `structure`.

    Raises
    ------
    InputError
        A point off the structure, a direction out of the plane of a plane structure, a patch
        without a surface, a site that is fixed by supports.
    """
    if structure.matrices.nodal:
        given = [functional_on_nodes(structure, site) for site in sites]
        pairs = zip(given, sites, strict=True)
        return [one or algebraic(structure.matrices, site) for one, site in pairs]
    meshed = structure.matrices.meshed or structure.matrices.assembled

    def at_point(site: Site) -> bool:
        return site.point is not None or (meshed and site.node is not None and site.dof is None)

    at_points = [site for site in sites if at_point(site)]
    found: Iterator[Functional] = iter(())
    if at_points:
        matrices = with_parts(
            structure, "matrices have no points: use Site(dof=i) or Site(vector=b)."
        )
        from antiosc.fem.site.at_points import functionals_at  # needs dolfinx

        found = iter(functionals_at(matrices, at_points))
    return [
        next(found) if at_point(site) else algebraic(structure.matrices, site) for site in sites
    ]


def algebraic(structure: StructureMatrices, site: Site) -> Functional:
    """b of a site that is given by a dof or a vector."""
    first, last = algebra.row_range(structure.K)
    n, comm = algebra.size(structure.K), algebra.communicator(structure.K)
    if site.node is not None:
        raise InputError(
            "the nodes of this structure have no numbers: Site(node=…) needs a mesh of a file that "
            "numbers them, with direction=, or matrices with a map, Structure.from_files(K, M, "
            "map=…)."
        )
    if site.radius is not None:
        raise InputError("radius needs a mesh; a site given by dof or vector has none.")
    if site.vector is not None:
        b = array("vector", site.vector, (n,))[first:last].copy()
    else:
        if not isinstance(site.dof, int) or not 0 <= site.dof < n:
            raise InputError(f"dof must be a number from 0 to {n - 1}; got {site.dof!r}.")
        b = np.zeros(last - first)
        if first <= site.dof < last:
            b[site.dof - first] = 1.0
    whole = norm(comm, b)
    b[structure.fixed[structure.fixed < len(b)]] = 0.0
    if norm(comm, b) <= LEAST_FREE_SHARE * whole:
        raise InputError(constrained("the site"))
    return Functional(b)


#: A point is a node up to this share of the part's size.
AT_NODE = 1e-6
#: Nodes around a patch that may take load of its edge, over its radius.
NEIGHBOURHOOD = 2.0
#: Points of the circle of a patch: rings, and points on each.
CIRCLE_RINGS, SPOKES = 64, 128
#: Cosine of the angle to the direction from which a node covers those behind it.
COVERS = 0.75


def functional_on_nodes(structure: Structure, site: Site) -> Functional | None:
    """b of a site at a node or a point; None for one that is given by a row or a vector.

    Raises
    ------
    InputError
        A node or dof that the map does not have, a point that is no node, a patch without nodes, a
        site whose dofs are fixed.
    """
    matrices = cast(NodalMatrices, structure.matrices)
    if site.node is not None and site.direction is None:
        b = np.zeros(structure.size)
        component = cast(int, site.dof)
        row = matrices.map.row(site.node, component)
        b[row] = 1.0
        direction = np.eye(3)[component - 1] if 1 <= component <= 3 else None
        return _checked(structure, b, f"node {site.node}", _position(matrices, row), direction)
    if site.direction is None:
        return None
    direction = in_space(site.direction)
    direction /= np.linalg.norm(direction)
    if site.node is not None:
        rows = np.flatnonzero(matrices.map.node == site.node)
        if not len(rows):
            raise InputError(f"node {site.node} is not in the matrices' map of nodes and dofs.")
        nodes, weights, at = np.array([site.node]), np.ones(1), _position(matrices, rows[0])
        label = f"node {site.node}"
        if site.radius is not None:
            raise InputError("a patch needs a point: Site(point=…, direction=…, radius=…).")
    else:
        nodes, weights, at = _at_point(matrices, site, direction)
        label = f"the site at ({', '.join(f'{c:.6g}' for c in at)}) m"
    own = _checked(
        structure, _load(matrices, nodes, weights, direction), label, at, direction, site.radius
    )
    if not site.tangential:
        return own
    sides = []
    for (side,) in tangents(direction[None], not (matrices.map.component == 3).any()):
        b = _load(matrices, nodes, weights, side)
        whole = float(np.linalg.norm(b))
        b[structure.fixed] = 0.0
        if float(np.linalg.norm(b)) <= LEAST_FREE_SHARE * whole:
            b[:] = 0.0  # the supports hold the site along it
        sides.append(Functional(b, point=at, direction=side))
    return replace(own, across=tuple(sides))


def _load(matrices: NodalMatrices, nodes: IntArray, weights: Array, direction: Array) -> Array:
    """b of weighted nodes along a direction, fixed dofs included."""
    b = np.zeros(len(matrices.map.node))
    order = np.argsort(nodes)
    index = np.searchsorted(nodes[order], matrices.map.node).clip(max=len(nodes) - 1)
    found = nodes[order][index] == matrices.map.node
    axis = matrices.map.component - 1
    moving = found & (axis >= 0) & (axis < 3)
    b[moving] = weights[order][index[moving]] * direction[axis[moving]]
    return b


def _checked(
    structure: Structure,
    b: Array,
    label: str,
    at: Array | None,
    direction: Array | None,
    radius: float | None = None,
) -> Functional:
    whole = float(np.linalg.norm(b))
    b[structure.fixed] = 0.0
    if float(np.linalg.norm(b)) <= LEAST_FREE_SHARE * whole or not whole:
        raise InputError(constrained(label))
    return Functional(b, radius, 0.0, at, direction)


def _position(matrices: NodalMatrices, row: int) -> Array | None:
    """The point of the node of a row, where it is known."""
    point = matrices.map.points[row]
    return point if np.isfinite(point).all() else None


def _at_point(
    matrices: NodalMatrices, site: Site, direction: Array
) -> tuple[IntArray, Array, Array]:
    """(nodes, weights of sum 1, point) of a point of the matrices' nodes."""
    if not matrices.located:
        raise InputError(
            "the coordinates of the nodes are not known: give them in the map, or use "
            "Site(node=…, dof=…)."
        )
    if isinstance(site.point, str):
        raise InputError("matrices have no groups: give the point's coordinates.")
    points, _ = matrices.nodes()
    known = np.isfinite(matrices.map.points).all(axis=1)
    numbers = np.unique(matrices.map.node[known])
    point = in_space(site.point or ())
    tree = cKDTree(points)
    if site.radius is None:
        distance, nearest = tree.query(point)
        size = float(np.ptp(points, axis=0).max())
        if site.snap:
            snap = None if site.snap is True else site.snap
            check_reach(Reach("the point of the site", snap), point, points, int(nearest))
        elif distance > AT_NODE * size:
            raise InputError(
                f"the point is no node: the nearest is node {numbers[nearest]}, {distance:.3g} m "
                "away; use that, Site(..., snap=True), or a patch with radius=."
            )
        return numbers[[nearest]], np.ones(1), points[nearest]
    around = np.array(tree.query_ball_point(point, NEIGHBOURHOOD * site.radius), dtype=int)
    if len(around):
        around = around[~_covered(points[around], direction, site.radius)]
    inside = np.zeros(0, dtype=bool)
    if len(around):
        inside = np.linalg.norm(points[around] - point, axis=1) < site.radius
    if not inside.any():
        distance, nearest = tree.query(point)
        raise InputError(
            f"the patch of radius {site.radius:g} m has no node on the surface: the nearest node, "
            f"{numbers[nearest]}, is {distance:.3g} m away; increase the radius or refine the mesh."
        )
    across = points[around] - point
    across = across - np.outer(across @ direction, direction)
    next_to = cKDTree(across).query(_hertz(site.radius, direction))[1]
    weights = np.bincount(next_to, minlength=len(around)) / len(next_to)
    chosen = weights > 0
    return numbers[around[chosen]], weights[chosen], point


def check_reach(reach: Reach, point: Array, points: Array, nearest: int) -> None:
    """`Reach.check` of nodes (P, 3); an element is the distance from one to the next."""
    x = points[nearest]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    reach.check(
        point, x, size, lambda: float(np.sort(np.linalg.norm(points - x, axis=1))[:2].max())
    )


def _covered(points: Array, direction: Array, radius: float) -> BoolArray:
    """Whether each point lies behind another one, seen against the direction of impact."""
    covered = np.zeros(len(points), dtype=bool)
    for k, point in enumerate(points):
        to = points - point
        distance = np.linalg.norm(to, axis=1)
        before = (-(to @ direction) > COVERS * distance) & (distance > AT_NODE * radius)
        covered[k] = before.any()
    return covered


def _hertz(radius: float, direction: Array) -> Array:
    """Points (n, 3) across `direction` on which equal forces make Hertz's pressure."""
    basis = np.linalg.svd(direction[None, :])[2][1:]
    # the load within r is 1 - (1 - r²/a²)^(3/2) of the whole
    share = (np.arange(CIRCLE_RINGS) + 0.5) / CIRCLE_RINGS
    r = radius * np.sqrt(1 - (1 - share) ** (2 / 3))
    angle = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray((r[:, None, None] * circle).reshape(-1, 2) @ basis)


#: What a point without a mesh has.
MOTIONS = ("displacement", "velocity", "acceleration", "rotation")


def point_of(
    structure: Structure, point: object, part: str | None, node: int | None = None
) -> tuple[Array, str | None, Motion | None]:
    """(coordinates (3,) [m], the part on which it lies or None, its motion if it has no mesh).

    `point`: coordinates; a text is a group ("part:group" of an assembly), a reference point of an
    assembly, or "part:site" of a superelement.
    """
    if part is not None:
        checks.text("part", part)
    if node is not None:
        member, own = node_of(with_parts(structure), whole("node", node), part)
        return member.at.placed(own[None])[0], member.name or None, None
    if not isinstance(point, str):
        return in_space(checks.coordinates("point", point)), part, None
    checks.text("point", point)
    if part is not None:
        raise InputError(
            f'point={point!r} is a name and tells the part ("part:group"): leave part={part!r} out.'
        )
    if structure.matrices.located:
        raise InputError("matrices have no groups: give the point's coordinates.")
    matrices = with_parts(structure)
    without_mesh = motion_of(matrices, point)
    if without_mesh is not None:
        return without_mesh.point, None, without_mesh

    def work() -> tuple[Array, str | None]:
        member, own = middle_of(matrices, point)
        return member.at.placed(own[None])[0], member.name or None

    return *matrices.decided(work), None


def middle_of(matrices: MeshedParts, name: str) -> tuple[Member, Array]:
    """(part, centroid (3,) of a group in the axes of the part [m]).

    `name`: the group of one mesh, or "part:group".
    """
    from antiosc.fem.mesh.surface import centre  # needs dolfinx

    member, group = _group_of(matrices, name)
    return member, centre(member.part.mesh, group)


def on_face(matrices: MeshedParts, site: Site) -> Site:
    """A site on a face as one at a point of it, with its direction."""
    from antiosc.fem.mesh.surface import struck_point  # needs dolfinx

    assert site.face is not None
    member, group = _group_of(matrices, site.face)
    own, inward = struck_point(member.part.mesh, group)
    point, along = member.at.placed(own[None])[0], member.at.rotation @ inward
    direction = along.tolist() if site.direction is None else site.direction
    part = member.name if matrices.assembled else None
    point = point[: len(direction)]
    return replace(site, point=point.tolist(), direction=direction, face=None, snap=True, part=part)


def at_node(matrices: MeshedParts, site: Site) -> Site:
    """A site at a numbered node as one at a point."""
    assert site.node is not None
    member, own = node_of(matrices, site.node, site.part)
    point = member.at.placed(own[None])[0][: len(site.direction or (0, 0, 0))]
    part = member.name if matrices.assembled else None
    return replace(site, point=point.tolist(), node=None, snap=True, part=part)


def node_of(matrices: MeshedParts, number: int, part: str | None = None) -> tuple[Member, Array]:
    """(part, coordinates (3,) in its axes [m]) of a numbered node, in the first part that has it.

    InputError if there is none.
    """
    for member in matrices.members(part):
        mesh = member.part.mesh
        x = mesh.node(number) if len(mesh.labels) or not matrices.assembled else None
        if x is not None:
            return member, x
    raise InputError(f"the structure has no node {number}, by its number in the file.")


def _group_of(matrices: MeshedParts, name: str) -> tuple[Member, str]:
    """(part, group in it) of the group of one mesh, or "part:group"."""
    (member, *_), group = matrices.members(), name
    if matrices.assembled:
        from antiosc.fem.assembly.joint import group_end

        layout = cast("AssembledMatrices", matrices).layout
        member, group = group_end(layout, "point", name)
    return member, group


def motion_of(matrices: MeshedParts, name: str) -> Motion | None:
    """The motion of a reference point or of a site of a superelement; None for "part:group".

    InputError for a name without a colon that is no reference point.
    """
    if not matrices.assembled:
        return None
    from antiosc.fem.assembly.joint import motion

    layout = cast("AssembledMatrices", matrices).layout
    part, colon, _ = name.partition(":")
    if not colon and name not in layout.points:
        points = name_list(name, layout.points, "the reference points")
        raise InputError(
            f'a name on an assembly is "part:group"; got {name!r}, which is no reference point '
            f"either; {points}."
        )
    return None if colon and part not in layout.condensed else motion(layout, name, partly=True)


def motions_without_mesh(
    structure: Structure, shapes: Array, name: str, end: Motion, quantity: str
) -> Array:
    """Displacement or rotation (gdim, columns) of a point that no cell has, for all shapes."""
    if quantity not in MOTIONS:
        raise InputError(
            f"{name!r} is a point without a mesh and has no {quantity}: ask for its "
            f"{', '.join(MOTIONS)}."
        )
    matrices = cast("AssembledMatrices", structure.matrices)
    plane = matrices.layout.plane
    rotated = quantity == "rotation"
    wanted = np.eye(3)[2:] if plane and rotated else np.eye(3)[: 3 - plane]
    space = end.rotation_space if rotated else end.displacement_space
    if not all(end.along(space, axis) for axis in wanted):
        raise InputError(
            f"the {quantity} of {name!r} is not known"
            + (
                ": a site of a superelement has displacements alone."
                if rotated
                else " along all axes: extract its model with Site(..., tangential=True)."
            )
        )
    functionals = end.rotations if rotated else end.displacements
    return np.asarray(wanted @ (functionals @ matrices.expanded(shapes)))
