"""`Site`: point and direction of an impact, and its load vector b.

bᵀu is the displacement of the structure at the site along the direction of impact, and b contains
the nodal forces of a unit force there. `functionals` computes it, on or off the nodes, for points
and for patches with Hertz's pressure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc._types import Array
from antiosc.checks import array, flag, kept, positive, store, whole
from antiosc.errors import InputError
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg.solvers import norm
from antiosc.fem.mesh import closest_point
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.site.sites import Sites, located, tell
from antiosc.fem.structure.meshed import MeshedStructure, on_mesh
from antiosc.fem.structure.structure import Structure

#: A point counts as on the structure up to this share of the structure's size.
ON_STRUCTURE = 1e-6
#: A site with less than this share of its load on free dofs is fixed by the supports.
LEAST_FREE_SHARE = 1e-9


@dataclass(frozen=True)
class Site:
    """Point and direction of an impact on a structure.

    Parameters
    ----------
    point : sequence of 2 or 3 floats
        Coordinates in m; any point of the structure, on or off the nodes.
    direction : sequence of 2 or 3 floats
        The direction in which the impactor pushes; need not be a unit vector.
    radius : float, optional
        Radius in m of a patch with Hertz's pressure √(1 − r²/a²) on the surface around the
        point; force and displacement are both weighted by it. None: a point on a beam and on a
        solid (on a solid the compliance of a point then diverges with mesh refinement), and on a
        shell a patch with the thickness as radius. With this radius the shell has the compliance of
        a solid without the half-space compliance of the patch.
    snap : bool
        Move a point that is off the structure to the nearest point of the structure.
    dof : int
        For matrices, instead of point and direction: the number of the dof at the site.
    vector : array_like (n,)
        For matrices: any load vector b.
    """

    point: Sequence[float] | None = None
    direction: Sequence[float] | None = None
    radius: float | None = None
    snap: bool = False
    dof: int | None = None
    vector: ArrayLike | None = None

    def __post_init__(self) -> None:
        given = [self.point is not None, self.dof is not None, self.vector is not None]
        if sum(given) != 1:
            raise InputError("a Site needs one of: point with direction, dof, or vector.")
        if self.radius is not None:
            store(self, radius=positive("radius", self.radius, "m"))
        store(self, snap=flag("snap", self.snap))
        if self.dof is not None:
            store(self, dof=whole("dof", self.dof, least=0))
        if self.vector is not None:
            store(self, vector=kept(array("vector", self.vector, (None,))))
        if self.point is None:
            return
        if self.direction is None:
            raise InputError(
                "a Site at a point needs the direction of impact, as direction=(0, 0, -1)."
            )
        point = array("point", self.point, (None,))
        direction = array("direction", self.direction, (None,))
        if len(point) not in (2, 3) or len(point) != len(direction):
            raise InputError(
                f"point and direction must both have 2 or 3 coordinates; got {len(point)} and "
                f"{len(direction)}."
            )
        if not direction.any():
            raise InputError(
                "direction must not be the zero vector: it is the direction in which the impactor "
                "pushes."
            )
        store(self, point=tuple(point.tolist()), direction=tuple(direction.tolist()))


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
    at_points = [site for site in sites if site.point is not None]
    found: Iterator[Functional] = iter(())
    if at_points:
        meshed = on_mesh(structure, "matrices have no points: use Site(dof=i) or Site(vector=b).")
        found = iter(_at_points(meshed, at_points))
    return [_algebraic(structure, site) if site.point is None else next(found) for site in sites]


def _algebraic(structure: Structure, site: Site) -> Functional:
    first, last = structure.K.getOwnershipRange()
    n = structure.K.getSize()[0]
    if site.radius is not None:
        raise InputError("radius needs a mesh; a site given by dof or vector has none.")
    if site.vector is not None:
        b = array("vector", site.vector, (n,))[first:last].copy()
    else:
        if site.dof is None or not 0 <= site.dof < n:
            raise InputError(f"dof must be a number from 0 to {n - 1}; got {site.dof!r}.")
        b = np.zeros(last - first)
        if first <= site.dof < last:
            b[site.dof - first] = 1.0
    whole = norm(structure.comm, b)
    b[structure.fixed[structure.fixed < len(b)]] = 0.0
    if norm(structure.comm, b) <= LEAST_FREE_SHARE * whole:
        raise InputError(_constrained("the site"))
    return Functional(b)


def _at_points(structure: MeshedStructure, sites: Sequence[Site]) -> list[Functional]:
    """b of sites at points, all at once."""
    mesh = structure.mesh
    given = [_in_space(mesh, structure.form, site) for site in sites]
    points, directions = (np.array(each) for each in zip(*given, strict=True))
    nearest = closest_point.closest_many(mesh, points)
    extent = mesh.extent()
    for i, site in enumerate(sites):
        _check_distance(extent, site, nearest[i])
    radii = np.array([np.nan if site.radius is None else site.radius for site in sites])
    found = located(structure, nearest.x, directions, radii, nearest)
    _check(found)
    tell(structure, found)
    columns = found.loads.toarray().T
    return [
        Functional(
            np.ascontiguousarray(columns[i]),
            None if np.isnan(found.radii[i]) else float(found.radii[i]),
            float(found.local[i]),
            found.points[i],
            found.directions[i],
        )
        for i in range(len(sites))
    ]


def _check(found: Sites) -> None:
    """InputError for the first site without a surface under its patch, or that cannot move."""
    for i, radius in enumerate(found.radii):
        if found.depth[i] > radius:
            raise InputError(
                f"the site at {_text(found.points[i])} lies about {found.depth[i]:.2g} m inside "
                f"the part, deeper than its radius {radius:g} m: a patch needs a surface; give a "
                "point on it."
            )
        if found.share[i] <= 0:
            raise InputError(
                f"the patch of radius {radius:g} m at {_text(found.points[i])} finds no surface: "
                f"the facets there measure {found.size[i]:.3g} m; refine around the site, "
                f"refine=[(point, {radius:g})]."
            )
        if found.moving[i] <= LEAST_FREE_SHARE:
            raise InputError(_constrained(f"the site at {_text(found.points[i])}"))


def _constrained(label: str) -> str:
    return (
        f"{label} is fixed by supports along the direction of impact: it cannot move; choose "
        "another point."
    )


def _in_space(mesh: Mesh, form: WeakForm, site: Site) -> tuple[Array, Array]:
    """Point and unit direction with three coordinates."""
    at, along = site.point, site.direction
    assert at is not None
    assert along is not None  # Site has seen to that
    point, direction = np.zeros(3), np.zeros(3)
    point[: len(at)] = at
    direction[: len(along)] = along
    direction /= np.linalg.norm(direction)
    if "z" not in form.components and abs(direction[2]) > 1e-12:
        raise InputError(f"direction {tuple(along)} leaves the plane of {mesh.name}, which is 2-D.")
    return point, direction


def _check_distance(extent: float, site: Site, nearest: closest_point.ClosestPoint) -> None:
    if nearest.distance > ON_STRUCTURE * extent and not site.snap:
        raise InputError(
            f"the point {_text(site.point)} is {nearest.distance:.3g} m off the structure; its "
            f"nearest point is {_text(nearest.x)}: use that, or Site(..., snap=True)."
        )


def _text(point: Any) -> str:
    return "(" + ", ".join(f"{c:.6g}" for c in point) + ") m"
