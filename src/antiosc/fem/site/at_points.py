"""Load vectors of sites that are points of a mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf

import numpy as np

from antiosc import plausible
from antiosc._types import Array
from antiosc.checks import in_words as text
from antiosc.errors import InputError
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.mesh import closest_point
from antiosc.fem.mesh.entities import centre
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.site.patches import loads
from antiosc.fem.site.site import (
    LEAST_FREE_SHARE,
    Functional,
    Reach,
    Site,
    constrained,
    tangents,
)
from antiosc.fem.site.sites import Sites, located, on_free_dofs, sums, tell
from antiosc.fem.structure.meshed import MeshedStructure

#: A point counts as on the structure up to this share of the structure's size.
ON_STRUCTURE = 1e-6


def functionals_at(
    structure: MeshedStructure,
    sites: Sequence[Site],
    placed: Callable[[Array], Array] = np.asarray,
) -> list[Functional]:
    """b of sites at points of a mesh, all at once; errors as in `functionals`.

    `placed` moves points (n, 3) of the mesh to where an assembly has them: errors name these.
    """
    sites = [_placed(structure, site) for site in sites]
    mesh = structure.mesh
    given = [_in_space(mesh, structure.form, site) for site in sites]
    points, directions = (np.array(each) for each in zip(*given, strict=True))
    nearest = closest_point.closest_many(mesh, points)
    extent = mesh.extent()
    for i, site in enumerate(sites):
        _check_distance(mesh, extent, site, placed(np.array([points[i], nearest[i].x])), nearest[i])
    radii = np.array([np.nan if site.radius is None else site.radius for site in sites])
    plausible.tell(
        plausible.of_patch(site.radius, extent) for site in sites if site.radius is not None
    )
    found = located(structure, nearest.x, directions, radii, nearest)
    _check(found, placed)
    tell(structure, found)
    columns = found.loads.toarray().T
    sides = _across(structure, sites, found)
    return [
        Functional(
            np.ascontiguousarray(columns[i]),
            None if np.isnan(found.radii[i]) else float(found.radii[i]),
            float(found.local[i]),
            found.points[i],
            found.directions[i],
            sides[i],
        )
        for i in range(len(sites))
    ]


def _across(
    structure: MeshedStructure, sites: Sequence[Site], found: Sites
) -> list[tuple[Functional, ...]]:
    """Of each site the loads across its direction, where they are asked for."""
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


def _placed(structure: MeshedStructure, site: Site) -> Site:
    """A site whose point is given by coordinates."""
    if site.part is not None:
        raise InputError(
            f"part={site.part!r} names a part of an assembly; {structure.mesh.name} is one."
        )
    if not isinstance(site.point, str):
        return site
    assert site.direction is not None  # Site has seen to that
    x = centre(structure.mesh, site.point)[: len(site.direction)]
    return replace(site, point=tuple(x.tolist()), snap=inf)


def _check(found: Sites, placed: Callable[[Array], Array]) -> None:
    """InputError for the first site without a surface under its patch, or that cannot move."""
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
    point, direction = np.zeros(3), np.zeros(3)
    point[: len(at)] = at
    direction[: len(along)] = along
    direction /= np.linalg.norm(direction)
    if "z" not in form.components and abs(direction[2]) > 1e-12:
        raise InputError(f"direction {tuple(along)} leaves the plane of {mesh.name}, which is 2-D.")
    return point, direction


def _check_distance(
    mesh: Mesh, extent: float, site: Site, points: Array, nearest: closest_point.ClosestPoint
) -> None:
    """InputError for a site too far off; `points` (2, 3): the site and the nearest to it."""
    on = ON_STRUCTURE * extent
    if site.snap is False:
        if nearest.distance > on:
            raise InputError(
                f"the point {text(points[0, : mesh.gdim])} is {nearest.distance:.3g} m off "
                f"the structure; its nearest point is {text(points[1])}: use that, or "
                "Site(..., snap=True)."
            )
        return
    reach = Reach("the point of the site", None if site.snap is True else max(site.snap, on))
    reach.check(points[0], points[1], extent, partial(closest_point.size_at, mesh, nearest))
