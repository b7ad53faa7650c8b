"""`Site`: point and direction of an impact, and its load vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.checks import flag, floats, is_rigid, positive, read_only, store, text, whole
from antiosc.base.errors import InputError, SiteError
from antiosc.base.texts import FieldsRepr
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.structure import NodalMatrices, StructureMatrices, in_space
from antiosc.fem.structure.structure import Structure, with_parts
from antiosc.io.matrices import DISPLACEMENTS, ROTATIONS, component_number

if TYPE_CHECKING:
    from antiosc.fem.assembly.assembled import AssembledMatrices
    from antiosc.fem.structure.loads import PointMotion
    from antiosc.fem.structure.place import Place


#: The supports fix a site if less than this share of its load is on free dofs.
LEAST_FREE_SHARE = 1e-9
#: Largest distance of a point from the node that it denotes, over the part's size.
NODE_TOLERANCE = 1e-6
NO_PATCH = (
    "matrices have no surface for a patch: leave radius out, and the site is a node or a row."
)


@dataclass(frozen=True)
class Site(FieldsRepr):
    """Point and direction of an impact on a structure.

    Parameters
    ----------
    point : sequence of 2 or 3 floats, or str
        Coordinates in m; any point of the structure, on or off the nodes. A text names a group (in
        an assembly "part:group"): the site is its point, or the point of its entities nearest to
        their centroid. In an assembly a text may also name a reference point, or "part:site" of a
        superelement.
    face : str, optional
        Instead of a point: a group of faces ("face 12", "hole 6 mm (1)", in an assembly "part:face
        12"). The site is the point of the faces nearest to their centroid; the default direction
        is into the part.
    direction : sequence of 2 or 3 floats
        Direction in which the impactor pushes; it need not be a unit vector.
    radius : float, optional
        Radius a in m of a patch with Hertz's pressure √(1 − r²/a²) on the surface around the
        point; the pressure weights both force and displacement. Default: a point on beams and
        solids (on a solid its compliance diverges with mesh refinement), and on shells a patch of
        the thickness as radius. With this radius the shell has the compliance of a solid minus the
        half-space compliance of the patch.
    snap : bool or float
        Move a point that is off the structure to the nearest point of the structure: True by at
        most 2 % of the part's size or one element, a number by at most this length in m. A patch
        in a solid moves to its surface.
    dof : int or str
        For matrices, instead of point and direction: the number of the dof at the site. With
        `node`: "x", "y", "z", "rx", "ry", "rz" or the number of the dof at the node.
    node : int
        The number of a node in the file of a mesh or a deck, with `direction`. For matrices with a
        map of their nodes and dofs, with `dof` or `direction`.
    vector : array_like (n,)
        For matrices: any load vector b.
    part : str, optional
        For assemblies: the part that is struck. Default: the nearest part; where parts touch, the
        part whose surface faces the impactor.
    tangential : bool
        For a named site (`extract(part, {name: Site})`): the model also contains the displacements
        across `direction`, two of them (one in a plane structure), for a contact with friction.
        The pressure weights them too; the compliance of the patch is not subtracted from them.
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
        places_given = [self.point is not None, self.dof is not None, self.vector is not None]
        at_node = self.node is not None
        if (places_given[0] or places_given[2]) if at_node else sum(places_given) != 1:
            raise InputError("a Site needs one of: point with direction, dof, vector, or node.")

        if at_node:
            store(self, node=whole("node", self.node))
            if places_given[1] == (self.direction is not None):
                raise InputError("a Site at a node needs one of: dof, as 'z', or direction.")

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
            store(self, dof=component_number(self.dof))
        elif self.dof is not None:
            store(self, dof=whole("dof", self.dof, least=0))
        if self.vector is not None:
            store(self, vector=read_only(floats("vector", self.vector, (None,))))
        if self.part is not None:
            store(self, part=text("part", self.part))
            if self.point is None:
                raise InputError("part names the part of an assembly on which a point lies.")
        if self.point is None and not (at_node and self.direction is not None):
            return
        if self.direction is None and self.face is not None:
            return
        if self.direction is None:
            raise InputError("a Site at a point needs the direction of impact, as (0, 0, -1).")
        direction = floats("direction", self.direction, (None,))
        is_named = isinstance(self.point, str) or at_node
        point = direction if is_named else floats("point", self.point, (None,))
        if len(point) not in (2, 3) or len(point) != len(direction):
            raise InputError(
                f"point and direction need 2 or 3 numbers; got {len(point)} and {len(direction)}."
            )
        if not np.linalg.norm(direction):
            raise InputError("direction must not be the zero vector: the impactor pushes along it.")
        store(self, direction=tuple(direction.tolist()))
        if not at_node:
            store(self, point=text("point", self.point) if is_named else tuple(point.tolist()))


def tangents(directions: Array, plane: bool) -> list[Array]:
    """Unit vectors perpendicular to `directions` (P, 3): two arrays (P, 3); one if `plane`."""
    if plane:
        return [np.cross([0.0, 0.0, 1.0], directions)]

    # rounded, so that rounding errors do not decide between equally oblique axes
    helper_axis = np.argmin(np.abs(directions).round(6), axis=1)
    first = np.cross(np.eye(3)[helper_axis], directions)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return [first, np.cross(directions, first)]


def constrained_message(label: str) -> str:
    """Error message: the supports fix the site `label`."""
    return (
        f"{label} is fixed by supports along the direction of impact: it cannot move; choose "
        "another point."
    )


#: Quantities available at a point without a mesh.
MOTION_QUANTITIES = ("displacement", "velocity", "acceleration", "rotation")


@dataclass(frozen=True)
class Functional:
    """Load vectors of one site, and data of its patch."""

    #: load vectors (rows of this rank, p), zero on fixed dofs: along the impact, then across it
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
    #: where it acts on a mesh; None for dofs and vectors of matrices
    place: Place | None = None

    @property
    def b(self) -> Array:
        """The load vector along the direction of impact."""
        return self.B[:, 0]

    @property
    def direction(self) -> Array | None:
        """Unit vector of the direction of impact."""
        return None if self.directions is None else self.directions[0]


def located_point(
    structure: Structure, point: object, part: str | None, node: int | None = None
) -> tuple[Array, str | None, PointMotion | None]:
    """(coordinates (3,) [m], part or None, motion if the point has no mesh, else None)."""
    if part is not None:
        checks.text("part", part)
    if (point is None) == (node is None):
        raise InputError("a probe takes a point or the number of a node.")
    if node is None and not isinstance(point, str):
        return in_space(checks.coordinates("point", point)), part, None
    if structure.matrices.located:
        raise InputError("matrices have no groups: give the point's coordinates.")
    from antiosc.fem.assembly import assembled  # needs dolfinx

    if node is not None:
        node = checks.whole("node", node)
    return assembled.point_on_parts(with_parts(structure), cast("str | None", point), part, node)


def motions_without_mesh(
    structure: Structure, shapes: Array, name: str, end: PointMotion, quantity: str
) -> Array:
    """Displacement or rotation (gdim, columns) of `shapes` at a point without a mesh."""
    if quantity not in MOTION_QUANTITIES:
        raise InputError(
            f"{name!r} has no mesh and no {quantity}: ask for its {', '.join(MOTION_QUANTITIES)}."
        )

    from antiosc.fem.structure.loads import UNIT_MOTIONS  # needs dolfinx

    matrices = cast("AssembledMatrices", structure.matrices)
    plane = matrices.layout.plane
    names = ROTATIONS[2 * plane :] if quantity == "rotation" else DISPLACEMENTS[: 3 - plane]
    if not all(end.has(UNIT_MOTIONS[name]) for name in names):
        raise InputError(
            f"the {quantity} of {name!r} is not known along all axes: a site of a superelement has "
            "displacements alone, across the impact if it was extracted with tangential."
        )

    return np.asarray(end.components(names) @ matrices.expanded(shapes))


def functional_on_rows(structure: StructureMatrices, site: Site) -> Functional:
    """Load vector of a site given by a dof or a vector."""
    first, last = algebra.row_range(structure.K)
    n = algebra.size(structure.K)
    if site.node is not None:
        raise InputError(
            "the nodes have no numbers: Site(node=…) needs a mesh of a file that numbers them, or "
            "matrices with a map, Structure.from_files(K, M, map=…)."
        )
    if site.radius is not None:
        raise InputError(NO_PATCH)

    if site.vector is not None:
        b = floats("vector", site.vector, (n,))[first:last].copy()
    else:
        if not isinstance(site.dof, int) or not 0 <= site.dof < n:
            raise InputError(f"dof must be a number from 0 to {n - 1}; got {site.dof!r}.")
        b = (np.arange(first, last) == site.dof).astype(float)

    return Functional(_on_free_rows(structure, b[:, None], "the site"))


def _on_free_rows(structure: StructureMatrices, B: Array, label: str) -> Array:
    """B with zeros on fixed dofs and in columns that cannot move; SiteError if column 0 cannot."""
    comm = algebra.communicator(structure.K)
    size = [norm(comm, b) for b in B.T]
    B[structure.fixed[structure.fixed < len(B)]] = 0.0
    B[:, [norm(comm, b) <= LEAST_FREE_SHARE * s for b, s in zip(B.T, size, strict=True)]] = 0.0
    if not norm(comm, B[:, 0]):
        raise SiteError(constrained_message(label))
    return B


def functional_on_nodes(matrices: NodalMatrices, site: Site) -> Functional:
    """Load vectors of a site at a node; InputError if the node is unknown or fixed."""
    if site.radius is not None:
        raise InputError(NO_PATCH)
    node = _node_at(matrices, site) if site.node is None else site.node
    rows = matrices.map.rows(node)
    directions: Array | None = None

    if isinstance(site.dof, int):  # one row of the node
        rows = np.array([matrices.map.row(node, site.dof)])
        if 1 <= site.dof <= 3:
            directions = np.eye(3)[[site.dof - 1]]
        loads = np.ones((1, 1))
    else:  # its displacement along directions
        along = in_space(site.direction or ())[None]
        directions = along / np.linalg.norm(along)
        if site.tangential:
            plane = not (matrices.map.component == 3).any()
            directions = np.vstack([directions, *tangents(directions, plane)])
        axis = matrices.map.component[rows] - 1
        rows, axis = rows[(axis >= 0) & (axis < 3)], axis[(axis >= 0) & (axis < 3)]
        loads = directions[:, axis].T

    B = np.zeros((algebra.size(matrices.K), loads.shape[1]))
    B[rows] = loads
    point = matrices.map.points[rows[0]]

    return Functional(
        _on_free_rows(matrices, B, f"node {node}"),
        point=point if np.isfinite(point).all() else None,
        directions=directions,
    )


def _node_at(matrices: NodalMatrices, site: Site) -> int:
    """The number of the node at the point of a site."""
    if isinstance(site.point, str) or not matrices.located:
        raise InputError("matrices have no surface: give the number of the node, Site(node=…).")
    located = np.isfinite(matrices.map.points).all(axis=1)
    points = matrices.map.points[located]
    distances = np.linalg.norm(points - in_space(site.point or ()), axis=1)
    nearest = int(np.argmin(distances))
    node = int(matrices.map.node[located][nearest])
    if distances[nearest] > NODE_TOLERANCE * float(np.ptp(points, axis=0).max()):
        raise InputError(f"the point is no node: take node {node}, {distances[nearest]:.3g} m off.")

    return node
