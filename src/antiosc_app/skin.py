"""The skin of a part for the page that opens it, and the faces that can be fixed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from antiosc import Mesh, Structure
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import InputError
from antiosc.fem.mesh.surface import Faces
from antiosc.fem.structure.structure import with_parts
from antiosc.io.neutral import BOX_SIDES
from antiosc.recovery import source
from antiosc_app.guessed import PLANE_TOLERANCE, sides_of
from antiosc_app.inspection import Inspection
from antiosc_app.live import Data
from antiosc_app.live_meshes import MAX_INTEGER, drawn_surface, geometry_data, surface_of_cells

#: What the sides along z are called besides.
SIDE_WORDS = {"-z": ", below", "+z": ", on top"}
#: The table of a support.
SupportTable: TypeAlias = Mapping[str, Any]


class PageSkin(NamedTuple):
    """Surface of a part, and its faces that can be fixed.

    `data` has points and triangles; `tags` (T,): number (from 1) of each triangle's face, or 0;
    `sets`: triangles of each face; `nodes`: points of each edge of a sheet.
    """

    data: Data
    faces: dict[str, SupportTable]  # name -> support that fixes it
    held_faces: list[str]  # names of the faces that a new scene fixes


def page_skin(structure: Structure, inspected: Inspection) -> PageSkin:
    """The surface of a structure and its faces; `inspected`: the inspection of its part."""
    members = with_parts(structure).members()
    mesh = members[0].part.mesh
    if len(members) > 1 or mesh.tdim == 1:
        points, cells, _ = source(structure).at_nodes(structure, np.zeros((structure.rows, 0)))
        page_surface = surface_of_cells(points, cells)
        shape, _ = drawn_surface(page_surface)
        shape["tags"] = np.zeros(len(page_surface.faces), dtype=np.uint32)
        all_faces, held_first = (
            ({}, [])
            if inspected.is_deck
            else _with_guessed_support(_group_supports(mesh), inspected)
        )
        shape["sets"] = shape["nodes"] = [np.zeros(0, dtype=np.uint32) for _ in all_faces]
        return PageSkin(shape, all_faces, held_first)
    outer = Faces(mesh, mesh.tdim < 3)
    groups = _group_supports(mesh)
    owner = np.zeros(len(outer), dtype=int)
    masks = {name: np.isin(outer.facets, mesh.groups[name].get(outer.dim, [])) for name in groups}
    for number, mask in enumerate(masks.values(), start=1):
        owner[mask] = number
    if outer.sheet:
        groups |= {
            f"edges at {side}": {"where": side}
            for side in BOX_SIDES
            if _has_unnamed_side(mesh, side)
        }
        masks = {
            name: _cells_touching(outer, mesh.group(held["where"])) for name, held in groups.items()
        }
        masks = {name: mask for name, mask in masks.items() if not mask.all()}
        groups = {name: groups[name] for name in masks}
    else:
        sides = _flat_sides(mesh, outer, owner, len(groups))
        masks |= {name: owner == k for k, name in enumerate(sides, start=len(groups) + 1)}
        groups |= sides
    corners = outer.vertices
    doubled = corners.shape[1] == 4
    if doubled:  # in tensor order: 0 1 / 2 3
        corners = np.vstack([corners[:, [0, 1, 2]], corners[:, [1, 3, 2]]])
        owner = np.tile(owner, 2)
    used_points, faces = np.unique(corners, return_inverse=True)
    shape = geometry_data(mesh.dolfinx.geometry.x[used_points], faces.reshape(-1, 3))
    on_plane = _faces_on(outer, inspected.held_plane, mesh.extent())
    numbers = np.unique(owner[on_plane][owner[on_plane] > 0])
    has_others = np.isin(np.delete(owner[: len(outer)], on_plane), numbers).any()
    names = [name for number, name in enumerate(groups, start=1) if number in numbers]
    # a face that goes on beyond the plane would hold more, perhaps the site
    all_faces, held_first = (
        _with_guessed_support(groups, inspected) if has_others or not names else (groups, names)
    )
    if inspected.held_plane is not None:
        masks[_plane_name(inspected)] = np.isin(np.arange(len(outer)), on_plane)
    shape["tags"] = owner.astype(np.uint32)
    sets = (np.tile(masks[name], 2) if doubled else masks[name] for name in all_faces)
    shape["sets"] = [np.flatnonzero(mask).astype(np.uint32) for mask in sets]
    lines = [_line_nodes(mesh, held) for held in all_faces.values() if outer.sheet]
    nodes = lines or [used_points[:0]] * len(all_faces)
    shape["nodes"] = [np.flatnonzero(np.isin(used_points, own)).astype(np.uint32) for own in nodes]
    return PageSkin(shape, all_faces, held_first)


def face_places(shape: Data, names: Sequence[str]) -> dict[str, str]:
    """Places of faces by name: "x = 95 mm" if normal to an axis, else the middle [mm].

    `shape`: data of the skin; `names`: names of its faces, in order.
    """
    size = 1e3 * shape["half"]
    step = size / MAX_INTEGER
    corners = shape["points"].reshape(-1, 3) * step + 1e3 * np.array(shape["middle"])
    told = {}
    for name, triangles in zip(names, shape["sets"], strict=True):
        if not len(triangles):
            continue
        points = corners[np.unique(shape["faces"].reshape(-1, 3)[triangles])]
        low, high = points.min(axis=0), points.max(axis=0)
        middle = np.round((low + high) / 2, 3 - int(np.floor(np.log10(size)))) + 0.0
        across = np.flatnonzero(high - low <= 2 * step)
        told[name] = ", ".join(f"{x:g}" for x in middle)
        if len(across) == 1:
            told[name] = f"{'xyz'[across[0]]} = {middle[across[0]]:g} mm"
    return told


def _line_nodes(mesh: Mesh, held: SupportTable) -> IntArray:
    """Nodes of a sheet on the edges or points that a support fixes; none if it fixes cells."""
    from antiosc.fem.platform import compat

    parts = mesh.group(held["where"]) if "where" in held else {}
    dim = max((dim for dim in parts if dim < mesh.tdim), default=mesh.tdim)
    if mesh.tdim in parts or dim == mesh.tdim:
        return np.zeros(0, dtype=int)
    return np.unique(compat.vertex_nodes(mesh.dolfinx, dim)[parts[dim]])


def _group_supports(mesh: Mesh) -> dict[str, SupportTable]:
    """Supports by name, for each group of faces, edges or points, the largest first."""
    size = {
        name: sum(len(entities) for dim, entities in parts.items() if dim == max(parts))
        for name, parts in mesh.groups.items()
        if min(parts, default=mesh.tdim) < mesh.tdim
    }
    return {name: {"where": name} for name in sorted(size, key=lambda group: -size[group])}


def _has_unnamed_side(mesh: Mesh, name: str) -> bool:
    """Whether a sheet has edges at the side `name` of its box, and no group of this name."""
    try:
        return name not in mesh.groups and bool(len(mesh.group(name)[mesh.tdim - 1]))
    except InputError:
        return False


def _cells_touching(outer: Faces, parts: Mapping[int, IntArray]) -> BoolArray:
    """Mask of the cells of a sheet that belong to a group or touch it.

    `parts`: dimension -> entities of the group.
    """
    from antiosc.fem.platform import compat

    mesh = outer.mesh
    dim = max((dim for dim in parts if dim < mesh.tdim), default=mesh.tdim)
    nodes = np.unique(compat.vertex_nodes(mesh.dolfinx, dim)[parts.get(dim, [])])
    shared = np.isin(outer.vertices, nodes).sum(axis=1)
    return np.isin(outer.facets, parts.get(mesh.tdim, [])) | np.asarray(shared > min(dim, 1))


def _with_guessed_support(
    faces: dict[str, SupportTable], inspected: Inspection
) -> tuple[dict[str, SupportTable], list[str]]:
    """(`faces` with the guessed supporting plane, names of the faces that a new scene fixes)."""
    if inspected.is_deck:  # which has supports of its own
        return faces, []
    if inspected.held_groups:
        return faces, list(inspected.held_groups)
    if inspected.held_plane is None:
        return faces, []
    name = _plane_name(inspected)
    return {**faces, name: {"plane": inspected.held_plane}}, [name]


def _plane_name(inspected: Inspection) -> str:
    """Name of the guessed supporting plane, as "side -z of the box, below"."""
    point, normal = np.array(inspected.held_plane)
    axis = int(np.abs(normal).argmax())
    is_low = point[axis] < (inspected.box_low[axis] + inspected.box_high[axis]) / 2
    side = BOX_SIDES[2 * axis + (not is_low)]
    return f"side {side} of the box{SIDE_WORDS.get(side, '')}"


def _faces_on(outer: Faces, plane: Sequence[Sequence[float]] | None, size: float) -> IntArray:
    """Indices of the faces on a plane [point, normal]; none if it is None."""
    if plane is None:
        return np.zeros(0, dtype=int)
    point, normal = np.array(plane)
    return np.flatnonzero(_is_on_plane(outer.corners, point, normal, size))


def _flat_sides(mesh: Mesh, outer: Faces, owner: IntArray, names: int) -> dict[str, SupportTable]:
    """Name -> support of each flat side among the faces without a name.

    It sets `owner`, the number of each face's group, to `names` (the number of groups) + 1, ….
    """
    x = mesh.dolfinx.geometry.x
    size = mesh.extent()
    sides: dict[str, SupportTable] = {}
    side = sides_of(x, outer)
    for number in np.unique(side[owner == 0]):
        members = np.flatnonzero((side == number) & (owner == 0))
        if not len(members):
            continue
        point = outer.corners[members[0], 0]
        normal = outer.normals[members[0]]
        if not _is_on_plane(outer.corners[members], point, normal, size).all():
            continue
        sides[f"flat side {len(sides) + 1}"] = {"plane": [point.tolist(), normal.tolist()]}
        owner[(owner == 0) & _is_on_plane(outer.corners, point, normal, size)] = names + len(sides)
    return sides


def _is_on_plane(corners: Array, point: Array, normal: Array, size: float) -> BoolArray:
    """Mask (F,) of the faces with corners (F, v, 3) on a plane; `size` [m]: that of the part."""
    distance = np.abs((corners - point) @ normal).max(axis=1)
    return np.asarray(distance < PLANE_TOLERANCE * size)
