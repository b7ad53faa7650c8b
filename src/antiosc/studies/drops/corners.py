"""What a mesh lacks of the compliance of sharp edges and corners with a radius.

A load on a corner has no limit in the mesh, for a point of a cone gives way without bound. The
radius of the corner bounds it. Meshes of parts seldom resolve it: the compliance of the patch is
that of the mesh, and what a mesh with cells of a share of the radius at the corner adds to it.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import without_warnings

if TYPE_CHECKING:
    from antiosc.fem.mesh import Mesh
    from antiosc.fem.site import Functional, Site
    from antiosc.fem.structure.meshed import MeshedStructure

#: Edges of the cells at a corner over its radius: the force of a plastic block changes by 1.2 %
#: from 1 to 0.5, and by 0.3 % from 0.5 to 0.25.
FINE = 0.5
#: Corners that are looked at together.
TOGETHER = 8


def missing(part: MeshedStructure, sites: list[Site]) -> Array | None:
    """Compliance (n, 3, 3) that the mesh of a part lacks at sites with a radius [m/N].

    Along the direction of each and across it, in the order of `Functional`. None for meshes of
    other cells than tetrahedra.
    """
    if part.mesh.cell != "tetrahedron":
        return None
    found = []
    for first in range(0, len(sites), TOGETHER):
        some = sites[first : first + TOGETHER]
        coarse = straightened(part.mesh)
        found.append(
            _compliance(part, _finer(coarse, some), some) - _compliance(part, coarse, some)
        )
    return np.concatenate(found)


def straightened(mesh: Mesh) -> Mesh:
    """The mesh with straight edges."""
    from antiosc.fem.error.bisection import gathered
    from antiosc.fem.mesh import distributed
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
    from antiosc.fem.error.remeshing import OfMesh

    refine: list[Any] = [(site.point, FINE * float(site.radius or 0.0)) for site in sites]
    return OfMesh(mesh).first(np.inf, refine)


def _compliance(part: MeshedStructure, mesh: Mesh, sites: list[Site]) -> Array:
    """Elastic compliance (n, 3, 3) of the free part on a mesh."""
    from antiosc.fem.site import functionals
    from antiosc.fem.structure.structure import Structure

    structure = object.__new__(Structure)
    with without_warnings():
        structure._hold(part.again(mesh, ()), time.perf_counter())
        found = functionals(structure, sites)
    B = np.column_stack([columns(one) for one in found])
    Y = structure.factorize().solve_block(B)
    compliance = []
    for n in range(len(found)):
        own = slice(3 * n, 3 * n + 3)
        rigid = B[:, own].T @ structure.rigid_modes
        compliance.append(B[:, own].T @ Y[:, own] - rigid @ rigid.T / structure.shift)
    return np.array(compliance)


def columns(site: Functional) -> Array:
    """b along the direction of a site and across it (rows, 3)."""
    return np.column_stack([site.b, *(side.b for side in site.across)])
