"""Surfaces of triangles that gmsh cannot fill, made anew by fTetWild.

fTetWild (Hu et al., ACM Trans. Graph. 39 (2020) 117) fills any triangles with tetrahedra whose
boundary lies within an envelope around them. That boundary is closed and does not pierce itself,
so that gmsh can fill it. Of three printed parts by others (10 000 to 35 000 triangles) that gmsh
cannot mesh, it needs 30, 40 and 190 s of processor time.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from antiosc.base._types import Array
from antiosc.io import facets
from antiosc.io.facets import FacetSkin, cleaned, edges_of, oriented, volumes
from antiosc.io.neutral import FACETS, FileMesh, IntArray
from antiosc.io.request import Request

#: Distance of the new surface from the triangles, over the diagonal of their box. The volumes of
#: three parts changed by 0.1, 0.2 and 0.7 %.
ENVELOPE = 1e-3
#: Energy at which the tetrahedra are good enough: only their boundary is used. One part took 68 s
#: on a busy machine, and 137 s with the default, 10.
ENERGY = 50.0
#: Share of that distance within which triangles lie on a side of the box.
ON_SIDE = 1e-2
#: Share of its volume that a tetrahedron keeps.
LEAST_LEFT = 0.1
#: Volume of a closed surface, over that of the largest, up to which it is no part of the solid:
#: those of MINI-y-plate-rear.stl are below 1.9e-3, and gmsh did not fill it with them.
CRUMB = 3e-3
#: Turns of the surfaces around a place from which on it is inside.
INSIDE = 0.5
#: Processor time that it may take, s.
TIME = 600.0
#: Words of what is told of such a surface, and the group of its triangles.
ANEW = "made anew"
#: What is told where it is not installed.
MISSING = "pip install pytetwild==0.2.3 lets antiosc make the surface anew"


def installed() -> bool:
    """Whether fTetWild is at hand."""
    return importlib.util.find_spec("pytetwild") is not None


def read(ask: Request) -> FileMesh:
    """Read a surface as a sheet, made anew if that is asked for."""
    if not ask.remade:
        return facets.read(ask)
    ask.allow(TIME)
    skin = facets.skin_of(ask)
    return with_faces(made_anew(skin, ask.name), skin, facets.by_side(facets.sides(skin)))


def with_faces(anew: FacetSkin, skin: FacetSkin, faces: Mapping[str, IntArray]) -> FileMesh:
    """A surface that was made anew, the group ANEW, and that of the file, whose faces name those
    of its mesh.
    """
    count = len(anew.triangles)
    groups = {name: {"triangle": count + rows} for name, rows in faces.items()}
    groups[ANEW] = {"triangle": np.arange(count)}
    triangles = np.vstack([anew.triangles, len(anew.points) + skin.triangles])
    points = np.vstack([anew.points, skin.points])
    return FileMesh(points, {"triangle": triangles}, "vtk", groups, remarks=anew.remarks)


def of_file(surface: FileMesh, factor: float) -> tuple[FacetSkin, dict[str, IntArray]]:
    """The surface of the file beside one that was made anew, times a factor, and its faces."""
    count = len(surface.groups[ANEW]["triangle"])
    triangles = surface.cells["triangle"][count:]
    skin = FacetSkin(factor * surface.points, triangles, np.zeros_like(triangles[:, 0]))
    faces = {n: parts["triangle"] - count for n, parts in surface.groups.items() if n != ANEW}
    return skin, faces


def made_anew(
    skin: FacetSkin, name: str, volume: float | None = None, several: bool = False
) -> FacetSkin:
    """The boundary of tetrahedra that fill a surface, which encloses a `volume`, if it is known.

    `several`: of the surfaces of several solids that touch or overlap: fTetWild, which drops what
    they have in common, fills the whole box, and the tetrahedra outside of all are left out here.

    fTetWild writes a file into the working folder, which is that of this reader alone.
    """
    import pytetwild

    points, cells = pytetwild.tetrahedralize(
        skin.points,
        skin.triangles.astype(np.int32),
        epsilon=ENVELOPE,
        stop_energy=ENERGY,
        num_threads=1,
        disable_filtering=several,
    )
    if several:
        turns = winding(points[cells].mean(axis=1), skin.points[skin.triangles])
        cells = cells[turns > INSIDE]
    distance = ENVELOPE * float(np.linalg.norm(np.ptp(skin.points[skin.triangles], axis=(0, 1))))
    points = _unfolded(points, flattened(points, skin, distance), cells)
    cells = without_pinches(points, cells.astype(np.int64))
    anew = cleaned(points, without_crumbs(points, boundary(cells)), name)
    change = _volume(anew) / (volume or _volume(skin)) - 1
    sense = "less" if change < 0 else "more"
    told = (
        f"the surface of {name} is {ANEW} by fTetWild, within {100 * ENVELOPE:g} % of the "
        f"diagonal of its box; it encloses {100 * abs(change):.2g} % {sense}."
    )
    return replace(anew, remarks=[*skin.remarks, told])


def winding(places: Array, corners: Array) -> Array:
    """How often triangles (t, 3, 3) with normals outward wind around places (n, 3).

    By the solid angles under which they are seen (A. van Oosterom, J. Strackee, IEEE Trans. Biomed.
    Eng. 30 (1983) 125); 0 outside of all closed surfaces.
    """
    turns = np.zeros(len(places))
    vertices = np.ascontiguousarray(corners.transpose(1, 2, 0))
    for k, place in enumerate(places):  # in the cache: 25 000 triangles at once
        a, b, c = vertices - place[:, None]
        la, lb, lc = (np.sqrt((side * side).sum(axis=0)) for side in (a, b, c))
        triple = (a * _across(b, c)).sum(axis=0)
        ab, bc, ca = ((one * other).sum(axis=0) for one, other in ((a, b), (b, c), (c, a)))
        angles = np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb)
        turns[k] = angles.sum() / (2 * np.pi)
    return turns


def _across(a: Array, b: Array) -> Array:
    """Cross products of columns (3, t); `np.cross` takes four times as long."""
    return a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]]


def flattened(points: Array, skin: FacetSkin, distance: float) -> Array:
    """Points within a distance of flat sides of the surface in its box moved onto these.

    A part is held at the nodes of such a side, which fTetWild leaves within the envelope alone.
    """
    moved = points.copy()
    corners = skin.points[skin.triangles]
    for axis in range(3):
        heights = corners[..., axis]
        for side in (heights.min(), heights.max()):
            if (np.abs(heights - side) < ON_SIDE * distance).all(axis=1).any():
                moved[np.abs(points[:, axis] - side) <= distance, axis] = side
    return moved


def _unfolded(points: Array, moved: Array, cells: IntArray) -> Array:
    """The moved points, without those whose motion turns over or flattens a tetrahedron: then the
    boundary of the tetrahedra does not pierce itself.
    """
    before = _volumes_of(points, cells)
    result = moved.copy()
    while True:
        bad = _volumes_of(result, cells) / before < LEAST_LEFT
        nodes = np.unique(cells[bad])
        nodes = nodes[(result[nodes] != points[nodes]).any(axis=1)]
        if not len(nodes):
            return result
        result[nodes] = points[nodes]


def _volumes_of(points: Array, cells: IntArray) -> Array:
    """Six times the volumes of tetrahedra, and not 0."""
    sides = points[cells[:, 1:]] - points[cells[:, :1]]
    volumes = np.linalg.det(sides)
    return np.where(volumes == 0, np.finfo(float).tiny, volumes)


def without_pinches(points: Array, cells: IntArray) -> IntArray:
    """The tetrahedra whose boundary has two triangles at each edge.

    Where tetrahedra of a wall that is thinner than the envelope touch others along an edge alone,
    the smaller ones at that edge are left out.
    """
    while True:
        ends, edge, uses = edges_of(boundary(cells))
        pinched = np.unique(np.sort(ends[uses[edge] > 2], axis=1), axis=0)
        sizes = np.abs(_volumes_of(points, cells))
        smaller = [_smaller_fans(cells, sizes, pair) for pair in pinched]
        out = np.concatenate([np.zeros(0, dtype=np.int64), *smaller])
        if not len(out):
            return cells
        cells = np.delete(cells, out, axis=0)


def without_crumbs(points: Array, triangles: IntArray) -> IntArray:
    """The closed surfaces whose volumes are not far below that of the largest.

    fTetWild leaves pieces and hollows where walls are thinner than the envelope, which touch the
    rest at points, so that gmsh does not fill it.
    """
    turned, piece = oriented(points, triangles)
    volume = np.abs(np.bincount(piece, volumes(points, turned)))
    return np.asarray(triangles[volume[piece] > CRUMB * volume.max()])


def _smaller_fans(cells: IntArray, sizes: Array, edge: IntArray) -> IntArray:
    """Tetrahedra at an edge that share no face there with the largest of those that do."""
    from scipy.sparse import coo_array  # the reading process loads it for these alone
    from scipy.sparse.csgraph import connected_components

    around = np.flatnonzero(np.isin(cells, edge).sum(axis=1) == 2)
    opposite = cells[around][~np.isin(cells[around], edge)].reshape(-1, 2)
    nodes, ends = np.unique(opposite, return_inverse=True)
    a, b = ends.reshape(-1, 2).T
    links = coo_array((np.ones(len(a)), (a, b)), shape=(len(nodes), len(nodes)))
    fan = connected_components(links, directed=False)[1][a]
    return np.asarray(around[fan != np.bincount(fan, sizes[around]).argmax()])


def boundary(cells: IntArray) -> IntArray:
    """Triangles (t, 3) that belong to one tetrahedron (n, 4) alone."""
    sides = np.vstack([cells[:, list(side)] for side in FACETS["tetrahedron"]])
    _, first, uses = np.unique(
        np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(sides[first[uses == 1]])


def _volume(skin: FacetSkin) -> float:
    return float(abs(volumes(skin.points, skin.triangles).sum()))


@contextmanager
def as_file(mesh: FileMesh, stem: str) -> Iterator[Path]:
    """A file of a surface that was made anew, for the time of the context."""
    import meshio

    with tempfile.TemporaryDirectory(prefix="antiosc-") as folder:
        path = Path(folder) / f"{stem}.stl"
        triangles = [("triangle", mesh.cells["triangle"][mesh.groups[ANEW]["triangle"]])]
        meshio.write(path, meshio.Mesh(mesh.points, triangles), binary=True)
        yield path
