"""Inspection of the file of a part: family, unit, supports and site are guessed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base import progress
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.process import free_memory, require
from antiosc_app.foreign import STEEL, Read, foreign_part, is_deck, usual_size, way_of, way_of_piece
from antiosc_app.guessed_sites import (
    SITE_WORDS,
    clear_of_edges,
    face_areas,
    far_from,
    in_sight,
    movable_sites,
    nodes_around,
    on_faces,
    on_lines,
    on_rim,
    outside_hollows,
    radius_of_patch,
    room_at,
    spread_out,
    with_room,
)
from antiosc_app.guessed_supports import (
    SUPPORT_WORDS,
    equal_holes,
    groups_on,
    groups_with,
    held_nodes,
    nodes_of,
    supporting_plane,
)
from antiosc_app.headline import without_bars
from antiosc_app.inspection import DIMENSIONS, Inspection, largest_ball_on, rounded_to
from antiosc_app.scene_file.outline import check_size

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.extension import Faces
    from antiosc.io.neutral import Piece

#: Largest radius of a site over the longest side of the part. A solid's mean thickness is another
#: limit: on a plate of 4.76 mm, patches of 27, 13 and 3 mm gave 1029, 895 and 835 N.
LARGEST_RADIUS = 0.02
#: Distance over the longest side of the part below which a face before a site is the site's own.
GRAZING = 1e-3
#: Sites nearer to held nodes than this share of the longest side are tried last.
AWAY = 0.2
#: Anti-oscillators of a new scene, by family.
COUNTS = {"Beam": 20, "Shell": 150, "Solid": 20}
#: A solid has as many as a shell if its longest side exceeds its mean thickness by this factor. A
#: plate of 599 x 639 x 4.76 mm (134) under a ball of 10 mm at 2 m/s: 1.95 kN +- 160 % with 20, and
#: 1.81 kN +- 24 % with 150; a bracket (12) needs no more than 20.
LIKE_A_PLATE = 40.0
#: Number of other sites that are tried where the first is in a hollow or supported.
OTHERS = 3
#: Each other site is so many places further on in the list, because the next ones lie beside the
#: first.
APART = 12
#: Least number of dofs for one anti-oscillator.
DOFS_FOR_EACH = 4
#: Remedy for a part whose model does not fit into the free memory.
TOO_LARGE = (
    "give larger elements (size), a mesh of fewer cells, or a closed surface, which is filled as a "
    "solid; or use a machine with more memory"
)


def inspect_part(
    path: Path,
    free: bool = False,
    unit: str | None = None,
    timeout: float | None = None,
    size: float | None = None,
    piece: int | None = None,
    contact: str | None = None,
    whole: Inspection | None = None,
) -> Inspection:
    """Read or mesh the file of a part and inspect it, or one of its pieces.

    `free`: whether to ignore the supports of a deck; `unit`: unit of the file, if known;
    `timeout` [s]: limit of each reading; None: by kind and size of the file; `size` [m]: largest
    cell, if it is asked for; `piece`: rank among those of the inspection without it, which is
    `whole`, if it was made; `contact`: what becomes of the contact of a deck, if that is asked for.

    Raises
    ------
    AntioscError
        It cannot be read or meshed, has no such piece, or is too large to be looked at, or a model
        of it needs more than the free memory.
    """
    check_size(path)
    options = free, unit, timeout, size, contact
    if piece is None:
        part = foreign_part(path, *options)
    elif whole is None and is_deck(path):  # one reading of it lists all pieces
        part = foreign_part(path, *options, alone={"piece": piece})
        _require_piece(path, piece, part.pieces)
    else:
        first = whole or foreign_part(path, *options)
        _require_piece(path, piece, first.pieces)
        part = foreign_part(path, *options, alone=way_of_piece(first.read, piece))
        part = replace(part, pieces=first.pieces)
    inspection = _inspect_mesh(part.mesh, part.read, part.structure, part.meshed)
    if size is not None:
        inspection = _struck_as_usual(inspection, path, (free, unit, timeout), size)
    forecast = inspection.forecast()
    what = f"a model of {path.name} on {inspection.cells}, some {forecast.dofs:.2g} dofs,"
    require(forecast.bytes, what, TOO_LARGE, free_memory())
    return replace(
        inspection,
        notes=tuple(part.notes),
        pieces=part.pieces,
        inferred=part.inferred,
        modulus=part.modulus,
        kept=part.kept,
        divided=part.divided,
    )


#: What a place and its ball are of an inspection.
OF_SITE = ("point", "direction", "radius", "room", "others", "flat")


def _struck_as_usual(
    inspection: Inspection,
    path: Path,
    options: tuple[bool, str | None, float | None],
    size: float,
) -> Inspection:
    """The inspection of a part in cells of a size [m], struck as in those of the usual size.

    `of_size` where these are no fewer, or cannot be made, and of decks, which take long to read.
    `options` of `foreign_part` before the size.
    """
    of_size = replace(inspection, of_size=True)
    if inspection.of_deck or (inspection.meshed and size >= usual_size(inspection.length)):
        return of_size
    try:
        with progress.doing(f"looking where to strike {path.name}"):
            part = foreign_part(path, *options, alone=way_of(inspection.read))
        usual = _inspect_mesh(part.mesh, part.read, None, part.meshed)
    except AntioscError:
        return of_size
    return replace(inspection, **{name: getattr(usual, name) for name in OF_SITE})


def _require_piece(path: Path, piece: int, pieces: Sequence[Piece]) -> None:
    """InputError unless a file has a piece of this rank."""
    if not 0 < piece <= len(pieces):
        raise InputError(f"{path.name} has {_pieces_text(pieces)}: no piece {piece}.")


def _pieces_text(pieces: Sequence[Piece]) -> str:
    """The number of pieces in words."""
    return f"{len(pieces)} pieces" if pieces else "one piece alone"


def inspect_structure(part: Structure) -> Inspection:
    """Inspect the largest mesh of a structure."""
    from antiosc.extension import with_parts

    meshes = [member.part.mesh for member in with_parts(part).members()]
    return _inspect_mesh(max(meshes, key=lambda mesh: (mesh.tdim, mesh.n_cells)), {}, part)


def _inspect_mesh(
    mesh: Mesh, read: Read, structure: Structure | None, meshed: bool = False
) -> Inspection:
    """Inspect a mesh; `structure`: that of a deck with its supports; `meshed`: of a geometry."""
    from antiosc.extension import Faces, longest_cell, measure
    from antiosc.fem.platform import compat

    x = np.array(mesh.dolfinx.geometry.x)
    nodes = compat.geometry_nodes(mesh.dolfinx)
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    low, high = (np.array(rounded_to(corner, size)) for corner in (x.min(axis=0), x.max(axis=0)))
    outer = Faces(mesh, mesh.tdim < 3)
    faces = nodes_around(outer)
    where = () if structure is not None else groups_with(mesh, SUPPORT_WORDS)[:1]
    site_nodes = nodes_of(mesh, groups_with(mesh, SITE_WORDS)[:1])
    supported = np.zeros(len(x), dtype=bool)
    plane = None
    foot = False
    if where:
        supported[nodes_of(mesh, where)] = True
    elif structure is None:
        outer_faces = faces if mesh.tdim == 3 else None
        supported, plane, foot = supporting_plane(x, low, high, size, outer_faces)
        holes = equal_holes(mesh) if plane is None or foot else ()
        if holes:
            where, plane, foot = holes, None, False
            supported = np.zeros(len(x), dtype=bool)
            supported[nodes_of(mesh, where)] = True
    else:
        supported = held_nodes(structure, x, size)
    family = next(name for name, dim in DIMENSIONS.items() if dim == mesh.tdim)
    longest = float((high - low).max())
    thickness = _mean_thickness(x[faces], outer.normals) if family == "Solid" else 0.0
    sites: Iterator[tuple[Array, Array, float | None]]
    if family == "Beam":
        sites = on_lines(x, nodes, supported, site_nodes)
    elif mesh.gdim == 2:
        sites = on_rim(x, faces, supported)
    else:
        candidates = on_faces(x, faces, outer, supported, site_nodes, size)
        largest = LARGEST_RADIUS * longest
        if family == "Solid":
            largest = min(largest, thickness)
        sites = (
            (point, direction, radius_of_patch(edge_distance, edge, largest, meshed))
            for point, direction, edge_distance, edge in candidates
        )
    sites = spread_out(sites)
    if not len(site_nodes):
        sites = far_from(x[supported], AWAY * float(np.ptp(x, axis=0).max()), sites)
    if family == "Solid":
        sites = outside_hollows(mesh, outer, sites, largest_ball_on(longest))
        if not len(site_nodes):
            sites = clear_of_edges(outer, x, faces, sites, meshed)
    if family != "Beam" and mesh.gdim == 3:
        sites = with_room(outer, sites, largest_ball_on(longest))
        if not len(site_nodes):
            sites = in_sight(x[faces], sites, GRAZING * longest)
    with progress.doing("looking for a place where a ball can strike it"):
        point, direction, radius = next(sites)
    radius = radius if family == "Solid" or mesh.gdim == 2 else None
    if structure is not None:
        point, direction, radius = movable_sites(structure, (point, direction, radius), sites)
    flat = _flat(mesh, outer, structure, (point, direction, radius))
    other_sites = []
    if mesh.tdim > 1 and structure is None:
        spaced_sites = islice(sites, APART - 1, OTHERS * APART, APART)
        other_sites = [
            (rounded_to(p, size), rounded_to(d), patch, room_at(outer, (p, d, patch)))
            for p, d, patch in spaced_sites
        ]
    # each node that is not held has three dofs or more
    dofs = 3 * int((~supported).sum()) if structure is None else structure.dofs
    plate = family == "Solid" and longest > LIKE_A_PLATE * thickness
    kinds, n_cells = ({}, mesh.n_cells) if structure is None else _cells_of(structure, mesh.tdim)
    count = min(COUNTS["Shell" if plate else family], dofs // DOFS_FOR_EACH)
    return Inspection(
        family,
        read,
        low,
        high,
        list(mesh.groups),
        mesh.cell,
        n_cells,
        where,
        plane,
        rounded_to(point, size),
        rounded_to(direction),
        radius,
        count,
        x,
        faces,
        supported,
        measure=compat.integrate(1 * measure(mesh, None), mesh.dolfinx),
        of_deck=structure is not None,
        structure=structure,
        on_plane=groups_on(mesh, supported) if plane else (),
        foot=foot,
        flat=flat,
        room=room_at(outer, (point, direction, radius)),
        others=other_sites,
        plate=plate,
        bars=_has_bars(structure),
        meshed=meshed,
        largest=longest_cell(x[nodes[:, : len(mesh.geometry.corners)]]),
        dofs=_counted(mesh) if structure is None else structure.dofs,
        kinds=kinds,
    )


def _cells_of(structure: Structure, dim: int) -> tuple[dict[str, int], int]:
    """(shape -> number of its cells in all parts, the most first; number of those of dimension
    `dim`).
    """
    from antiosc.extension import with_parts

    meshes = [member.part.mesh for member in with_parts(structure).members()]
    counts: Counter[str] = Counter()
    for mesh in meshes:
        counts[mesh.cell] += mesh.n_cells
    of_dim = sum(mesh.n_cells for mesh in meshes if mesh.tdim == dim)
    return dict(counts.most_common()), of_dim


def _counted(mesh: Mesh) -> int:
    """Number of dofs of solids that are no tetrahedra, of which few lie through a thickness often;
    0 for others.
    """
    from antiosc.fem.platform import compat

    if mesh.tdim < 3 or mesh.cell == "tetrahedron":
        return 0
    space = compat.lagrange(mesh.dolfinx, 2, 0)
    return 3 * int(space.dofmap.index_map.size_global)


def _mean_thickness(corners: Array, normals: Array) -> float:
    """Twice the volume over the surface of a solid with these faces (n, k, 3), m."""
    area = np.linalg.norm(face_areas(corners), axis=1) * (0.5 if corners.shape[1] == 3 else 1.0)
    heights = np.einsum("ij,ij->i", normals, corners.mean(axis=1))
    return float(2 / 3 * abs(area @ heights) / area.sum())


def _has_bars(structure: Structure | None) -> bool:
    """Whether `extract(…, error="estimate")` accepts the part, as it does any mesh."""
    return structure is None or not without_bars(structure)


def _flat(
    mesh: Mesh, outer: Faces, structure: Structure | None, site: tuple[Array, Array, float | None]
) -> tuple[float, float] | None:
    """(modulus [Pa], Poisson's ratio) of a flat face if the surface at a site is unknown; else
    None.
    """
    from antiosc.extension import curvature
    from antiosc.reduce.site.surface import material_at, surface_at

    point, direction, radius = site
    try:
        if structure is not None:
            surface_at(structure, point, direction, radius, lengths=False)
        elif mesh.tdim > 1:
            curvature(mesh, outer, point, direction, lengths=False)
    except InputError:
        material = None if structure is None else material_at(structure, point, direction)
        E, nu = (getattr(material, name, None) for name in ("E", "nu"))
        if isinstance(E, float) and isinstance(nu, float):
            return E, nu
        return STEEL["E"], STEEL["nu"]
    return None


def of_mesh(inspection: Inspection, mesh: Mesh) -> Inspection:
    """The inspection with the skin of another mesh of the part."""
    from antiosc.extension import Faces

    points = np.array(mesh.dolfinx.geometry.x)
    return replace(inspection, points=points, faces=nodes_around(Faces(mesh, mesh.tdim < 3)))
