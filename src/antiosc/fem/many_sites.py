"""Many sites at once: where they lie, how they are struck, and their loads as sparse columns.

The vertices of a surface get theirs from one quadrature, and so do given points of a sheet
(`antiosc.fem.surface`); other points are found one by one, with all the checks of `Site`.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from antiosc.checks import array, coordinates, positive
from antiosc.errors import AccuracyWarning, InputError, warn
from antiosc.fem.algebra import Array
from antiosc.fem.compat import IntArray
from antiosc.fem.site import PARTLY, SHEET_RADIUS, Site, functional
from antiosc.fem.structure import Structure
from antiosc.fem.surface import (
    Surface,
    patch_loads,
    point_loads,
    points_on_sheet,
    sheet_loads,
    surface,
)

#: A site with less than this share of its load on dofs that can move is held by the supports.
HELD = 0.05


@dataclass(frozen=True, eq=False)
class Sites:
    """Sites with their loads; all but `loads` on every rank alike."""

    #: (P, 3) m, unit normals of the surface there (0 where unknown), unit directions of impact
    points: Array
    normals: Array
    directions: Array
    #: (T, 3) triangles between the points, or (T, 2) segments
    elements: IntArray
    #: b of all sites as columns, the rows of this rank
    loads: scipy.sparse.csr_matrix
    #: (P,) half-space compliances of the patches, m/N, and their radii, m; None for points
    local: Array
    radius: Array | None
    #: how many were asked for
    total: int

    def only(self, keep: Array) -> Sites:
        """Some of the sites, with the elements that lie between them."""
        number = np.cumsum(keep) - 1
        elements = self.elements
        if len(elements):
            elements = number[elements[keep[elements].all(axis=1)]]
        return Sites(
            self.points[keep],
            self.normals[keep],
            self.directions[keep],
            elements,
            self.loads[:, np.flatnonzero(keep)],
            self.local[keep],
            None if self.radius is None else self.radius[keep],
            self.total,
        )


def sites_of(
    structure: Structure, where: Any, direction: Sequence[float] | None, radius: float | None
) -> Sites:
    """The sites that `impact_map` is asked for, without those that the supports hold."""
    if structure.mesh is None:
        raise InputError("a map needs a mesh: matrices have no points.")
    along = None
    if direction is not None:
        along = np.zeros(3)
        given = coordinates("direction", direction, "")
        along[: len(given)] = given
        if not np.linalg.norm(along):
            raise InputError("direction must not be the zero vector.")
        along /= np.linalg.norm(along)
    if where is None or isinstance(where, str):
        found = _on_surface(structure, surface(structure, where), along, radius)
    else:
        at = _given(where, along)
        if structure.form is not None and structure.form.patch == "cells":
            found = _on_surface(structure, points_on_sheet(structure, at), along, radius)
        else:
            found = _one_by_one(structure, at, along, radius)
    weight = structure.comm.allreduce(np.asarray(abs(found.loads).sum(axis=0)).ravel())
    # a unit force along d is spread over |d_x| + |d_y| + |d_z| of load, negative parts apart
    share = weight / np.abs(found.directions).sum(axis=1)
    moving = share > HELD
    if not moving.any():
        raise InputError(
            "no site of the map can move: the supports hold the whole surface, or no face carries "
            "the patch; name another group."
        )
    partly = int(np.sum(moving & (share < 1 - PARTLY) & (found.local > 0)))
    if partly and structure.comm.rank == 0:
        warn(
            f"supports hold a part of the patch at {partly} of {len(share)} sites (more than "
            f"{PARTLY:.0%} of its load): its half-space compliance does not hold there.",
            AccuracyWarning,
        )
    return found if moving.all() else found.only(moving)


def _on_surface(
    structure: Structure, ground: Surface, along: Array | None, radius: float | None
) -> Sites:
    assert structure.form is not None
    if along is None and structure.form.patch != "facets":
        raise InputError(
            "shells and beams have no outside: give the direction of impact, direction=(0, 0, -1)."
        )
    points, normals = ground.points, ground.normals
    directions = -normals if along is None else np.tile(along, (len(points), 1))
    patch, materials = structure.form.patch, [material for material, _ in structure.parts]
    if radius is not None:
        positive("radius", radius, "m")
    if patch is None and radius is not None:
        return _one_by_one(structure, points, along, radius, ground)
    if radius is None and patch != "cells":
        loads, share = point_loads(structure, points, directions), np.ones(len(points))
        if patch and structure.comm.rank == 0:
            warn(
                "the compliance under a point load on a solid grows without limit as the mesh is "
                "refined: give the map a radius.",
                AccuracyWarning,
            )
        return Sites(
            points, normals, directions, ground.elements, loads, 0 * share, None, len(points)
        )
    if patch == "cells":
        radii = np.full(len(points), radius or 0.0)
        if radius is None:
            radii = SHEET_RADIUS * np.array([one.thickness for one in materials])[ground.part]
        loads, share = _by_radius(structure, points, normals, directions, radii)
    else:
        assert radius is not None
        radii = np.full(len(points), radius)
        loads, share = patch_loads(structure, points, normals, directions, radius)
    cosine = np.einsum("ij,ij->i", directions, normals)
    local = np.array(
        [
            materials[part].half_space_compliance(float(c))
            for part, c in zip(ground.part, cosine, strict=True)
        ]
    )
    local = local / radii
    cut = int(np.sum(share < 0.9))
    if cut and structure.comm.rank == 0:
        warn(
            f"an edge cuts the patch at {cut} of {len(share)} sites (less than 90 % of its "
            "load lies on the surface): its half-space compliance does not hold there.",
            AccuracyWarning,
        )
    return Sites(points, normals, directions, ground.elements, loads, local, radii, len(points))


def _by_radius(
    structure: Structure, points: Array, normals: Array, directions: Array, radii: Array
) -> tuple[scipy.sparse.csr_matrix, Array]:
    """`sheet_loads` of discs whose radii follow the thickness."""
    loads, share = [], np.zeros(len(points))
    order = np.argsort(radii, kind="stable")
    for radius in np.unique(radii):
        at = order[radii[order] == radius]
        own, share[at] = sheet_loads(structure, points[at], normals[at], directions[at], radius)
        loads.append(own)
    return scipy.sparse.hstack(loads).tocsr()[:, np.argsort(order)], share


def _given(points: Any, along: Array | None) -> Array:
    """Points (P, 3) that the caller gave."""
    if along is None:
        raise InputError("points need the direction of impact, as direction=(0, 0, -1).")
    at = array("where, if no group's name, the points,", points, None)
    if not at.size:
        raise InputError("a map needs at least one point.")
    if at.ndim != 2 or at.shape[1] not in (2, 3):
        raise InputError(f"where must list points of 2 or 3 coordinates; got shape {at.shape}.")
    return np.pad(at, ((0, 0), (0, 3 - at.shape[1])))


def _one_by_one(
    structure: Structure,
    at: Array,
    along: Array | None,
    radius: float | None,
    ground: Surface | None = None,
) -> Sites:
    """Sites with all the checks of `Site`."""
    assert along is not None
    columns, x, local, radii = [], np.zeros_like(at), np.zeros(len(at)), np.zeros(len(at))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for i, point in enumerate(at):
            place = functional(structure, Site(tuple(point), tuple(along), radius))
            columns.append(scipy.sparse.csc_matrix(place.b[:, None]))
            x[i], local[i], radii[i] = place.point, place.local_compliance, place.radius or 0.0
    if said and structure.comm.rank == 0:
        warn(
            f"{said[0].message} (the first of {len(said)} such warnings)",
            said[0].category,
        )
    return Sites(
        x,
        np.zeros_like(x) if ground is None else ground.normals,
        np.tile(along, (len(x), 1)),
        np.zeros((0, 3), dtype=int) if ground is None else ground.elements,
        scipy.sparse.hstack(columns).tocsr(),
        local,
        radii if radii.any() else None,
        len(x),
    )
