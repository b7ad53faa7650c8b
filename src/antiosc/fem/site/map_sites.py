"""The sites of a map: the vertices of a surface, or given points, and their directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from antiosc._types import Array, BoolArray, IntArray
from antiosc.checks import array, coordinates, positive
from antiosc.errors import InputError
from antiosc.fem.mesh.closest_point import closest_many
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.site.at_points import ON_STRUCTURE
from antiosc.fem.site.sites import Sites, located, tell
from antiosc.fem.structure.meshed import MeshedStructure

#: A site with less than this share of its load on free dofs is fixed by the supports.
LEAST_FREE_SHARE_ON_MAP = 0.05


@dataclass(frozen=True, eq=False)
class Ground:
    """Points of a surface, equal on all ranks.

    Attributes
    ----------
    points : (P, 3) coordinates [m].
    normals : (P, 3) unit normals out of the body; zero on sheets and lines.
    elements : (T, 3) triangles between the points, (T, 2) segments of lines; (0, 3) for none.
    """

    points: Array
    normals: Array
    elements: IntArray


def sites_of(
    structure: MeshedStructure, where: Any, direction: Sequence[float] | None, radius: float | None
) -> tuple[Sites, IntArray, int]:
    """The sites of a map, without those that are fixed by supports.

    Returns (sites, elements between them, number of sites before that).
    """
    along = None if direction is None else _unit(direction)
    if radius is not None:
        positive("radius", radius, "m")
    ground = (
        surface(structure, where)
        if where is None or isinstance(where, str)
        else _given(structure, where, along)
    )
    count = len(ground.points)
    if along is None and not structure.kind.outside:
        raise InputError(
            "shells and beams have no outward normal: give the direction of impact, for instance "
            "direction=(0, 0, -1)."
        )
    directions = -ground.normals if along is None else np.tile(along, (count, 1))
    radii = np.full(count, np.nan if radius is None else radius)
    found = located(structure, ground.points, directions, radii)
    on_face = np.isnan(found.radii) | ((found.share > 0) & (found.depth <= found.radii))
    keep = on_face & (found.moving > LEAST_FREE_SHARE_ON_MAP)
    if not keep.any():
        raise InputError(
            "no site of the map can move: supports fix the whole surface, or there is no surface "
            "under the patches; give another group."
        )
    found, elements = only(found, ground.elements, keep)
    tell(structure, found)
    return found, elements, count


def surface(structure: MeshedStructure, group: str | None) -> Ground:
    """The vertices of a group of facets (of cells on shells and beams); None: all there are."""
    mesh, outside = structure.mesh, structure.kind.outside
    faces = Faces(mesh, not outside)
    own = np.ones(len(faces.facets), dtype=bool)
    if group is not None:
        own = np.isin(faces.facets, mesh.group(group).get(faces.dim, []))
    if not mesh.comm.allreduce(int(own.sum())):
        raise InputError(
            f"group {group!r} holds no outer faces of {mesh.name} (dimension {faces.dim}): a map "
            "needs a surface; name one, or leave it out for all."
        )
    numbers = np.asarray(mesh.dolfinx.geometry.input_global_indices)[faces.vertices[own]]
    normals = faces.normals[own] if outside else np.zeros((int(own.sum()), 3))
    mine = numbers, faces.corners[own], normals
    numbers, x, normals = (
        np.concatenate(each) for each in zip(*mesh.comm.allgather(mine), strict=True)
    )
    _, first, corner = np.unique(numbers.ravel(), return_index=True, return_inverse=True)
    corner = corner.reshape(numbers.shape)
    mean = np.zeros((len(first), 3))
    for column in corner.T:
        np.add.at(mean, column, normals)
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    mean = mean / np.where(length > 0, length, 1.0)
    if corner.shape[1] == 4:  # in tensor order: 0 1 / 2 3
        corner = np.vstack([corner[:, [0, 1, 2]], corner[:, [1, 3, 2]]])
    return Ground(x.reshape(-1, 3)[first], mean, corner)


def _unit(direction: Sequence[float]) -> Array:
    along = np.zeros(3)
    given = coordinates("direction", direction, "")
    along[: len(given)] = given
    if not np.linalg.norm(along):
        raise InputError("direction must not be the zero vector.")
    return along / np.linalg.norm(along)


def _given(structure: MeshedStructure, points: Any, along: Array | None) -> Ground:
    """Points of the structure that the caller gave."""
    if along is None:
        raise InputError("points need the direction of impact, as direction=(0, 0, -1).")
    at = array("where, if no group's name, the points,", points, None)
    if not at.size:
        raise InputError("a map needs at least one point.")
    if at.ndim != 2 or at.shape[1] not in (2, 3):
        raise InputError(f"where must list points of 2 or 3 coordinates; got shape {at.shape}.")
    at = np.pad(at, ((0, 0), (0, 3 - at.shape[1])))
    mesh = structure.mesh
    nearest = closest_many(mesh, at)
    off = np.flatnonzero(nearest.distance > ON_STRUCTURE * mesh.extent())
    if len(off):
        at_point = ", ".join(f"{c:.6g}" for c in at[off[0]])
        raise InputError(
            f"{len(off)} of {len(at)} points lie off the structure, one at ({at_point}) m by "
            f"{nearest.distance[off[0]]:.3g} m: give points on it, or the name of a group."
        )
    return Ground(nearest.x, np.zeros_like(at), np.zeros((0, 3), dtype=int))


def only(sites: Sites, elements: IntArray, keep: BoolArray) -> tuple[Sites, IntArray]:
    """Some of the sites, with the elements that lie between them."""
    number = np.cumsum(keep) - 1
    if len(elements):
        elements = number[elements[keep[elements].all(axis=1)]]
    of_all = ("loads", "weighted")
    rows = {name: value[keep] for name, value in vars(sites).items() if name not in of_all}
    selected = sites.loads[:, np.flatnonzero(keep)]
    return replace(sites, loads=selected, weighted=None, **rows), elements
