"""Compliance of sharp edges and corners with a radius, as far as the mesh does not contain it.

Under mesh refinement the compliance of a point load on a corner grows without bound; the radius of
the corner bounds it. Meshes of parts seldom resolve that radius. The compliance of the patch is
therefore that of the mesh, plus the difference to a mesh whose cells at the corner are a share of
the radius.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import without_warnings

if TYPE_CHECKING:
    from antiosc import Mesh, Site, Structure
    from antiosc.fem.structure.meshed import MeshedStructure
    from antiosc.reduce.site import Functional

#: Edge length of the cells at a corner over its radius: the impact force of a plastic block changes
#: by 1.2 % from 1 to 0.5, and by 0.3 % from 0.5 to 0.25.
FINE = 0.5
#: Vertices around the sides of a hexahedron, whose vertices are numbered along x, then y, then z.
SIDES = np.array(
    [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
)
#: Number of corners that share a refined mesh.
TOGETHER = 8


class Corners:
    """Missing compliances at the corners of one body's parts; each part is factorized once."""

    def __init__(self) -> None:
        self._known: dict[MeshedStructure, tuple[Mesh, Structure]] = {}

    def missing(self, part: MeshedStructure, sites: list[Site]) -> Array | None:
        """Compliances (n, 3, 3) [m/N] that a part's mesh lacks at sites with a patch.

        The rows are along and across each site's direction, in the order of `Functional`. None for
        meshes of other cells than tetrahedra and hexahedra.
        """
        if part.mesh.cell not in ("tetrahedron", "hexahedron"):
            return None
        simplices, coarse = self._of(part)
        compliances = []
        for first in range(0, len(sites), TOGETHER):
            group = sites[first : first + TOGETHER]
            coarse_compliance = _compliance(coarse, group)
            fine = _free(part, _finer(simplices, group))
            fine.matrices.first_shift = coarse.shift  # a first one that is far off costs a factor
            compliances.append(_compliance(fine, group) - coarse_compliance)
        return np.concatenate(compliances)

    def _of(self, part: MeshedStructure) -> tuple[Mesh, Structure]:
        """(the part's mesh as straight tetrahedra, the free part on its own mesh with straight
        edges).
        """
        if part not in self._known:
            if part.mesh.cell == "tetrahedron":
                coarse = simplices = straightened(part.mesh)
            else:
                coarse = part.mesh
                simplices = tetrahedra(part.mesh)
            self._known[part] = simplices, _free(part, coarse)
        return self._known[part]


def tetrahedra(mesh: Mesh) -> Mesh:
    """A mesh of hexahedra, each divided into 24 straight tetrahedra, with its groups of cells."""
    from antiosc.extension import distributed, gathered
    from antiosc.io.neutral import KINDS, RawMesh
    from antiosc.io.reading import compact

    pieces = gathered(mesh, np.zeros(mesh.n_cells))
    assert pieces is not None  # there is one rank
    corners = pieces.cells[:, :8]
    sides = corners[:, SIDES].reshape(-1, 4)
    side = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)[1].reshape(
        len(corners), 6
    )
    first = len(pieces.points)
    at_sides = np.zeros((side.max() + 1, 3))
    at_sides[side.ravel()] = pieces.points[sides].mean(axis=1)
    middles = pieces.points[corners].mean(axis=1)
    points = np.concatenate((pieces.points, at_sides, middles))
    edges = np.stack((corners[:, SIDES], np.roll(corners[:, SIDES], -1, axis=2)), axis=3)
    top = np.broadcast_to((first + side)[:, :, None, None], (*edges.shape[:3], 1))
    centre_nodes = (first + len(at_sides) + np.arange(len(corners)))[:, None, None, None]
    cells = np.concatenate((edges, top, np.broadcast_to(centre_nodes, top.shape)), axis=3)
    cells = cells.reshape(len(corners), 24, 4)
    number = {tuple(row): k for k, row in enumerate(np.sort(corners, axis=1).tolist())}
    groups: Any = {}
    for name, parts in pieces.groups.items():
        rows = [number[tuple(row)] for row in parts.get(3, np.zeros((0, 8), dtype=int)).tolist()]
        if rows:
            groups[name] = {3: cells[rows].reshape(-1, 4)}
    raw = RawMesh(points, cells.reshape(-1, 4), KINDS["tetra"], "gmsh", groups)
    return distributed(compact(raw), mesh.name, mesh.comm)


def straightened(mesh: Mesh) -> Mesh:
    """The mesh with straight edges."""
    from antiosc.extension import distributed, gathered
    from antiosc.io.neutral import KINDS, RawMesh
    from antiosc.io.reading import compact

    if mesh.order == 1:
        return mesh
    pieces = gathered(mesh, np.zeros(mesh.n_cells))
    assert pieces is not None  # there is one rank
    cells: Any = pieces.cells[:, :4]
    groups: Any = pieces.groups
    raw = RawMesh(pieces.points, cells, KINDS["tetra"], "gmsh", groups)
    return distributed(compact(raw), mesh.name, mesh.comm)


def _finer(mesh: Mesh, sites: list[Site]) -> Mesh:
    """The mesh refined at the sites to a share of their radii."""
    from antiosc.extension import OfMesh

    refine: list[Any] = [(site.point, FINE * float(site.radius or 0.0)) for site in sites]
    return OfMesh(mesh).first(np.inf, refine)


def _free(part: MeshedStructure, mesh: Mesh) -> Structure:
    """The part without supports on another mesh."""
    from antiosc import Structure

    structure = object.__new__(Structure)
    with without_warnings():
        structure._hold(part.again(mesh, ()), time.perf_counter())
    return structure


def _compliance(structure: Structure, sites: list[Site]) -> Array:
    """Elastic compliances (n, 3, 3) [m/N] of a free part at sites."""
    from antiosc.reduce.site import functionals

    with without_warnings():
        loads = functionals(structure, sites)
    B = np.column_stack([columns(load) for load in loads])
    Y = structure.factorize(np.inf).solve_block(B)
    compliance = []
    for n in range(len(loads)):
        rows = slice(3 * n, 3 * n + 3)
        rigid = B[:, rows].T @ structure.rigid_modes
        compliance.append(B[:, rows].T @ Y[:, rows] - rigid @ rigid.T / structure.shift)
    return np.array(compliance)


def columns(site: Functional) -> Array:
    """Loads (rows, 3) along a site's direction and across it."""
    return np.column_stack([site.b, *(side.b for side in site.across)])
