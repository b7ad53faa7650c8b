"""`read_mesh`: a file, or a dolfinx mesh, into a mesh with named groups of entities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from antiosc.checks import array, choice, instance, positive, shown
from antiosc.checks import path as checked_path
from antiosc.errors import InputError, MeshError, warn
from antiosc.fem import compat, folds
from antiosc.fem.cell_geometry import CellGeometry
from antiosc.fem.compat import IntArray
from antiosc.fem.parallel import agree, bounds, collective, on_root
from antiosc.fem.readers import GEOMETRY, RawMesh, Refinement, read

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A dolfinx mesh whose entities have names. Coordinates in metres."""

    #: the dolfinx mesh
    dolfinx: dolfinx.mesh.Mesh
    #: name -> {dimension: entities of this rank, ghosts included}; every rank knows every name
    groups: Mapping[str, Mapping[int, IntArray]] = field(default_factory=dict)
    #: where it came from, for messages
    name: str = "mesh"

    def __post_init__(self) -> None:
        instance("dolfinx", self.dolfinx, dolfinx.mesh.Mesh, "a dolfinx mesh (see read_mesh)")
        instance("groups", self.groups, Mapping, "a dict: name -> {dimension: entities}")
        instance("name", self.name, str, "a text")

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the mesh."""
        return self.dolfinx.comm

    @property
    def tdim(self) -> int:
        """Dimension of the cells: 1 lines, 2 faces, 3 volumes."""
        return int(self.dolfinx.topology.dim)

    @property
    def gdim(self) -> int:
        """Dimension of the space the mesh lives in: 2 or 3."""
        return int(self.dolfinx.geometry.dim)

    @property
    def cell(self) -> str:
        """Shape of the cells, as dolfinx names it."""
        return compat.cell_name(self.dolfinx)

    @property
    def order(self) -> int:
        """Geometric order of the cells: 1 straight, 2 curved."""
        return int(compat.coordinate_map(self.dolfinx).degree)

    @property
    def n_cells(self) -> int:
        """Number of cells on all ranks."""
        return int(compat.cell_map(self.dolfinx).size_global)

    @cached_property
    def geometry(self) -> CellGeometry:
        """The map of the cells of this rank, ghosts included, from reference coordinates."""
        nodes = compat.geometry_nodes(self.dolfinx)
        return CellGeometry(self.dolfinx.geometry.x[nodes], self.cell, self.order)

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates (cells, 3) of the cells that this rank owns, m."""
        nodes = compat.geometry_nodes(self.dolfinx)[: compat.cell_map(self.dolfinx).size_local]
        x = self.dolfinx.geometry.x[nodes]
        low, high = x.min(axis=1), x.max(axis=1)
        if self.order > 1:  # a curved side may bulge out of the box of its nodes
            low, high = low - 0.2 * (high - low), high + 0.2 * (high - low)
        return low, high

    def extent(self) -> float:
        """Diagonal of the bounding box, in m."""
        low, high = bounds(self.comm, self.dolfinx.geometry.x)
        return float(np.linalg.norm(high - low))

    def group(self, name: str) -> Mapping[int, IntArray]:
        """{dimension: local entities} of the group `name`; InputError if there is none."""
        if not isinstance(name, str) or name not in self.groups:
            known = ", ".join(repr(n) for n in sorted(self.groups)) or "none"
            raise InputError(f"{self.name} has no group {shown(name)}; its groups are: {known}.")
        return self.groups[name]


@collective()
def read_mesh(
    source: str | Path | dolfinx.mesh.Mesh,
    size: float | None = None,
    gdim: int | None = None,
    *,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    groups: Mapping[str, tuple[Any, int]] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Mesh:
    """Read a mesh, or mesh a geometry.

    Parameters
    ----------
    source
        A Gmsh mesh (`.msh`), a geometry that gmsh meshes (`.geo`, `.step`, `.brep`, `.iges`;
        STEP's own length unit is converted to metres), any other file that meshio reads, or a
        dolfinx mesh. Coordinates are metres.
    size
        Largest element size in m; geometry files only (needed unless a `.geo` sets its own).
    gdim
        2 or 3. By default a plane mesh of triangles or quadrilaterals is 2-D; lines and curved
        faces live in space. `gdim=2` makes a plane frame of lines, `gdim=3` a flat shell of faces.
    order
        Geometric order, 1 or 2. By default what the file has; geometry files are meshed with
        curved (order 2) faces and volumes and straight lines; the few curved cells that fold over
        at a tight fillet are straightened. `order=1` drops mid-side nodes.
    refine
        Pairs (point, size): elements of that size around the point, growing away from it;
        geometry files only. A site with a radius needs elements no larger than the radius.
    groups
        For a dolfinx mesh: name -> (MeshTags, value). Files bring their own: physical groups,
        element sets, node sets (a node set also holds the facets that it spans), and tags
        without a name under their number.
    comm
        The MPI communicator that shares the mesh.

    Raises
    ------
    MeshError
        Missing or unreadable file, no usable cells, mixed cell kinds, pieces that share no node.
    """
    _check(size, gdim, order, refine)
    instance("comm", comm, MPI.Comm, "an MPI communicator (mpi4py)")
    if groups is not None:
        instance("groups", groups, Mapping, "a dict: name -> (MeshTags, value)")
    if isinstance(source, dolfinx.mesh.Mesh):
        return _adopted(source, groups or {})
    if groups:
        raise InputError("groups= names the tags of a dolfinx mesh; a file brings its own groups.")
    if not isinstance(source, str | Path):
        raise InputError(
            f"read_mesh takes a file or a dolfinx mesh; got {type(source).__name__} "
            f"{shown(source)}."
        )
    path = checked_path("source", source)
    raw = on_root(
        comm, lambda: _sound(_flattened(read(path, size, order, refine), gdim, path.name), path)
    )
    return _distributed(raw, path.name, comm)


def _check(
    size: float | None, gdim: int | None, order: int | None, refine: Sequence[Refinement]
) -> None:
    if size is not None:
        positive("size", size, "m")
    for name, value, options in (("gdim", gdim, (2, 3)), ("order", order, (1, 2))):
        if value is not None:
            choice(name, value, options)
    if not isinstance(refine, Sequence) or isinstance(refine, str):
        raise InputError(f"refine must be a list of pairs (point, size); got {shown(refine)}.")
    for one in refine:
        try:
            point, local = one
            dim = len(point)
        except (TypeError, ValueError) as error:
            raise InputError(
                "refine lists pairs (point, size), as in refine=[((0, 0, 0.1), 2e-3)]; "
                f"got {shown(one)}."
            ) from error
        array("a point of refine", point, (dim,))
        positive("a size of refine", local, "m")


def _flattened(raw: RawMesh, gdim: int | None, name: str) -> RawMesh:
    """`raw` with points of shape (n, gdim)."""
    z = raw.points[:, 2]
    size = float(np.ptp(raw.points, axis=0).max())
    flat = float(np.ptp(z)) <= 1e-9 * size
    if gdim is None:
        gdim = 2 if raw.kind.dim == 2 and flat else 3
    if gdim == 2 and raw.kind.dim == 3:
        raise MeshError(f"{name} is a mesh of volumes: it cannot be read with gdim=2.")
    if gdim == 2 and not flat:
        raise MeshError(
            f"{name} is not plane (z spans {np.ptp(z):g} m): read it with gdim=3, or give it one z."
        )
    return RawMesh(
        np.ascontiguousarray(raw.points[:, :gdim]), raw.cells, raw.kind, raw.convention, raw.groups
    )


def _sound(raw: RawMesh, path: Path) -> RawMesh:
    """`raw` without folded cells if gmsh made it here, with a warning if a file has them."""
    kind = raw.kind
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    flat = folds.collapsed(raw.points, cells, kind.shape, kind.order)
    if len(flat):
        measure = ("length", "area", "volume")[kind.dim - 1]
        raise MeshError(
            f"{len(flat)} of {len(cells)} cells of {path.name} have no {measure}, one at "
            f"({_centre(raw, flat[0])}) m: merge the nodes that coincide, or mesh it anew."
        )
    if kind.dim != raw.points.shape[1]:
        return raw
    if path.suffix.lower() in GEOMETRY and kind.order == 2 and kind.shape in folds.EDGES:
        points = folds.straightened(raw.points, raw.cells, kind.shape)
        return replace(raw, points=points)
    bad = folds.folded(raw.points, cells, kind.shape, kind.order)
    if len(bad):
        warn(
            f"{len(bad)} of {len(raw.cells)} cells of {path.name} fold over themselves, one at "
            f"({_centre(raw, bad[0])}) m: what is computed there is wrong; optimise the mesh (in "
            "gmsh: Mesh.HighOrderOptimize = 2) or read it with order=1.",
        )
    return raw


def _centre(raw: RawMesh, cell: int) -> str:
    return ", ".join(f"{c:.4g}" for c in raw.points[raw.cells[cell]].mean(axis=0))


def _distributed(raw: RawMesh, name: str, comm: MPI.Comm) -> Mesh:
    """The dolfinx mesh of arrays that every rank holds (their groups too)."""
    kind = raw.kind
    cells, points = raw.cells, raw.points
    if comm.rank > 0:
        cells, points = cells[:0], points[:0]
    cells = cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    mesh = compat.create_mesh(comm, np.ascontiguousarray(cells), points, kind.shape, kind.order)
    groups = {
        label: {dim: _local_entities(mesh, dim, rows) for dim, rows in parts.items()}
        for label, parts in raw.groups.items()
    }
    return Mesh(mesh, groups, name)


def _local_entities(mesh: dolfinx.mesh.Mesh, dim: int, wanted: IntArray) -> IntArray:
    """Entities of this rank whose vertices are one of the rows of `wanted` (input node numbers)."""
    nodes = compat.entity_vertices(mesh, dim)
    if not len(nodes):
        return np.zeros(0, dtype=np.int32)
    mine = np.sort(np.asarray(mesh.geometry.input_global_indices)[nodes], axis=1)
    both = np.vstack([np.sort(wanted, axis=1), mine])
    _, label = np.unique(both, axis=0, return_inverse=True)
    label = label.reshape(-1)
    return np.flatnonzero(np.isin(label[len(wanted) :], label[: len(wanted)])).astype(np.int32)


def _adopted(mesh: dolfinx.mesh.Mesh, groups: Mapping[str, tuple[Any, int]]) -> Mesh:
    """A dolfinx mesh with names given to its tags."""
    named: dict[str, dict[int, IntArray]] = {}
    for name, pair in groups.items():
        if not isinstance(pair, tuple | list) or len(pair) != 2 or not hasattr(pair[0], "indices"):
            raise InputError(
                f"group {shown(name)} must be a pair (MeshTags, value); got {shown(pair)}."
            )
        tags, value = pair
        entities = np.asarray(tags.indices)[np.asarray(tags.values) == value]
        found = mesh.comm.allreduce(len(entities))
        if not found:
            raise InputError(f"group {name!r}: no entity of the mesh tags has the value {value}.")
        named[name] = {int(tags.dim): entities.astype(np.int32)}
    error = None
    if compat.coordinate_map(mesh).degree > 2:
        error = MeshError("cells of geometric order above 2 are not supported: use order 1 or 2.")
    agree(mesh.comm, error)
    return Mesh(mesh, named, "the dolfinx mesh")
