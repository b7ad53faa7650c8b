"""`Mesh`: a dolfinx mesh with named groups, and the map of its cells from reference coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import basix
import dolfinx
import numpy as np
from mpi4py import MPI

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import flag, instance, shown
from antiosc.base.errors import InputError, name_list
from antiosc.base.texts import ReprMixin
from antiosc.fem.platform import bounds, compat
from antiosc.io.neutral import BOX_SIDES, RawMesh
from antiosc.io.reading import row_positions

#: Cells whose reference shape is a simplex; the others are products of intervals.
SIMPLICES = ("interval", "triangle", "tetrahedron")


#: Distance of a node from where it stands in a straight cell, over the size of the cell.
STRAIGHTNESS = 1e-9


class CellGeometry:
    """Nodes (cells, k, 3) [m] and shape functions of cells, all of one shape and order (1 or 2)."""

    def __init__(self, nodes: Array, cell: str, order: int) -> None:
        kind = getattr(basix.CellType, cell)
        self.nodes = nodes
        self.simplex = cell in SIMPLICES
        #: (corners, tdim) reference coordinates of a cell's corners, its first nodes
        self.corners = np.asarray(basix.geometry(kind))
        self._topology = basix.topology(kind)
        self._element = basix.create_element(basix.ElementFamily.P, kind, order)

    @property
    def reference_nodes(self) -> Array:
        """Reference coordinates (k, tdim) of a cell's k nodes, in dolfinx's order."""
        return np.asarray(self._element.points)

    def at(self, cell: IntArray, X: Array) -> tuple[Array, Array]:
        """(points x (n, 3) [m], dx/dX (n, 3, tdim)) at reference points X (n, tdim) of cells."""
        if not len(X):  # Basix 0.5 aborts
            return np.zeros((0, 3)), np.zeros((0, 3, len(self.corners[0])))
        tables = self._element.tabulate(1, X)[..., 0]
        nodes = self.nodes[cell]
        products = np.swapaxes(tables, 0, 1) @ nodes  # (n, 1 + tdim, 3)
        return products[:, 0], np.swapaxes(products[:, 1:], 1, 2)

    def slopes(self, X: Array) -> Array:
        """Derivatives (n, nodes, tdim) of the shape functions at reference points (n, tdim)."""
        tables = self._element.tabulate(1, X)[1:, :, :, 0]
        return np.asarray(np.moveaxis(tables, 0, 2))

    def centre(self) -> Array:
        """Reference coordinates (tdim,) of the middle of a cell."""
        return np.asarray(self.corners.mean(axis=0))

    @property
    def edges(self) -> IntArray:
        """Local corners (edges, 2) at the ends of a cell's edges."""
        return np.array(self._topology[1])

    @cached_property
    def bulge(self) -> Array:
        """Largest distance (cells,) [m] of a node from its position in a straight cell."""
        linear = basix.create_element(basix.ElementFamily.P, self._element.cell_type, 1)
        weights = linear.tabulate(0, self.reference_nodes)[0, :, :, 0]
        off = self.nodes - weights @ self.nodes[:, : len(self.corners)]
        return np.asarray(np.linalg.norm(off, axis=2).max(axis=1, initial=0.0))

    @cached_property
    def straight(self) -> BoolArray:
        """Mask (cells,) of the cells with straight edges and flat faces."""
        corners = self.nodes[:, : len(self.corners)]
        size = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
        return np.asarray(self.bulge <= STRAIGHTNESS * size)

    @cached_property
    def affine(self) -> BoolArray:
        """Mask (cells,) of the cells whose map x(X) is affine, such as parallelograms."""
        first = self.nodes[:, :1]
        axes = self.nodes[:, self._neighbours[: self.corners.shape[1]]] - first
        off = self.nodes - first - self.reference_nodes @ axes
        size = np.linalg.norm(axes, axis=2).max(axis=1)
        return np.asarray(np.linalg.norm(off, axis=2).max(axis=1) <= STRAIGHTNESS * size)

    @property
    def _neighbours(self) -> list[int]:
        """Numbers of the corners that are next to a cell's first corner along its axes."""
        return [1, 2, 3] if self.simplex else [1, 2, 4]

    def entities(self, dim: int) -> tuple[Array, Array]:
        """(origins (n, tdim), axes (n, tdim, dim)) of entities X = origin + axes ξ of a cell."""
        vertices = np.array(self._topology[dim])
        origin = self.corners[vertices[:, 0]]
        axes = self.corners[vertices[:, self._neighbours[:dim]]] - origin[:, None]
        return origin, np.swapaxes(axes, 1, 2)


class CellEntities:
    """n entities of one dimension, each in a cell at reference coordinates X = origin + axes ξ.
    `cells` (n,): number of the cell in `geometry`; `origin` (n, tdim); `axes` (n, tdim, dim)."""

    def __init__(self, geometry: CellGeometry, cells: IntArray, origin: Array, axes: Array) -> None:
        dim = axes.shape[2]
        self.geometry = geometry
        self.cells = cells
        self._origin = origin
        self._axes = axes
        self.simplex = geometry.simplex or dim < 2
        self.affine = geometry.affine[cells]
        #: (n, dim) coordinates ξ of the middles
        self.middle = np.full((len(cells), dim), 1 / (dim + 1) if self.simplex else 0.5)

    def __len__(self) -> int:
        return len(self.cells)

    def reference(self, entity: IntArray, xi: Array) -> Array:
        """Reference coordinates (k, tdim) in the cells, of points ξ (k, dim) on entities (k,)."""
        return np.asarray(self._origin[entity] + np.einsum("ntd,nd->nt", self._axes[entity], xi))

    def at(self, entity: IntArray, xi: Array) -> tuple[Array, Array]:
        """(points x (k, 3) [m], dx/dξ (k, 3, dim)) at ξ (k, dim) on entities (k,)."""
        x, J = self.geometry.at(self.cells[entity], self.reference(entity, xi))
        return x, J @ self._axes[entity]


#: Largest distance of a facet from a side of the bounding box on which it lies, over the extent.
SIDE_DISTANCE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(ReprMixin):
    """A dolfinx mesh whose entities have names. Coordinates in metres."""

    #: the dolfinx mesh
    dolfinx: dolfinx.mesh.Mesh
    #: name -> {dimension: entities of this rank, ghosts included}; every rank knows every name
    groups: Mapping[str, Mapping[int, IntArray]] = field(default_factory=dict)
    #: its origin, such as the file name, for messages
    name: str = "mesh"
    #: whether the unit of length was given by the user or by the file
    stated: bool = False
    #: numbers in the file of all nodes, in the order in which dolfinx received them; -1: none;
    #: empty: the file has no numbers
    labels: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        instance("dolfinx", self.dolfinx, dolfinx.mesh.Mesh, "a dolfinx mesh (see read_mesh)")
        instance("groups", self.groups, Mapping, "a dict: name -> {dimension: entities}")
        instance("name", self.name, str, "a text")
        instance("labels", self.labels, np.ndarray, "an array of numbers of nodes")
        flag("stated", self.stated)
        compat.set_coordinate_element(self.dolfinx)

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator that shares the mesh."""
        return compat.communicator(self.dolfinx)

    @property
    def tdim(self) -> int:
        """Dimension of the cells: 1 lines, 2 faces, 3 volumes."""
        return int(self.dolfinx.topology.dim)

    @property
    def gdim(self) -> int:
        """Dimension of the space of the coordinates: 2 or 3."""
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
        return int(compat.cell_index_map(self.dolfinx).size_global)

    @cached_property
    def geometry(self) -> CellGeometry:
        """Map from reference coordinates to space in the cells of this rank, ghosts included."""
        nodes = compat.geometry_nodes(self.dolfinx)
        return CellGeometry(self.dolfinx.geometry.x[nodes], self.cell, self.order)

    @cached_property
    def boxes(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates (cells, 3) of the cells that this rank owns, m."""
        x = self.geometry.nodes[: compat.cell_index_map(self.dolfinx).size_local]
        low = x.min(axis=1)
        high = x.max(axis=1)
        if self.order > 1:  # a curved side may bulge out of the box of its nodes
            low, high = low - 0.2 * (high - low), high + 0.2 * (high - low)

        return low, high

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates (3,) of the whole mesh [m]."""
        return bounds(self.comm, self.dolfinx.geometry.x)

    def extent(self) -> float:
        """Diagonal of the bounding box, in m."""
        low, high = self.box
        return float(np.linalg.norm(high - low))

    def numbered(self, nodes: Sequence[int]) -> BoolArray:
        """Mask (geometry nodes of this rank,) of nodes with these numbers in the file. InputError
        for a mesh without numbers."""
        if not np.any(self.labels >= 0):
            raise InputError(f"the nodes of {self.name} have no numbers: give a point or a group.")
        node_numbers = self.labels[np.asarray(self.dolfinx.geometry.input_global_indices)]
        return np.asarray(np.isin(node_numbers, np.asarray(nodes, dtype=np.int64)))

    def node(self, number: int) -> Array | None:
        """Coordinates (3,) [m] of the node with this number in the file; None without one.

        InputError if several nodes have the number.
        """
        coordinates = np.array(self.dolfinx.geometry.x)[self.numbered([number])]
        x = np.unique(np.vstack(self.comm.allgather(coordinates)), axis=0)
        if len(x) > 1:
            several = f"{len(x)} nodes of {self.name} have the number {number}"
            raise InputError(f"{several}: give the point.")
        return x[0] if len(x) else None

    def group(self, name: str) -> Mapping[int, IntArray]:
        """{dimension: local entities} of a group or box side ("-z"); InputError if unknown."""
        if isinstance(name, str) and name in self.groups:
            return self.groups[name]
        if isinstance(name, str) and name in BOX_SIDES:
            return self._side(name)
        groups = name_list(name, self.groups, "its groups")
        raise InputError(f"{self.name} has no group {shown(name)}; {groups}.")

    def _side(self, name: str) -> Mapping[int, IntArray]:
        """{tdim − 1: facets of this rank} on the side `name` ("-x", "+z", …) of the bounding box.
        InputError if there are none, or the mesh is flat along this axis."""
        axis = "xyz".index(name[1])
        low, high = self.box
        end = (low if name[0] == "-" else high)[axis]
        dim = self.tdim - 1
        tolerance = SIDE_DISTANCE * self.extent()
        nodes = compat.vertex_nodes(self.dolfinx, dim)
        x = np.asarray(self.dolfinx.geometry.x)[:, axis]
        facets = np.flatnonzero((np.abs(x[nodes] - end) < tolerance).all(axis=1)).astype(np.int32)
        flat = high[axis] - low[axis] < tolerance
        if flat or not self.comm.allreduce(len(facets)):
            reason = "it is flat" if flat else f"none lies at {name[1]} = {end:g} m"
            raise InputError(
                f"{self.name} has neither a group {name!r} nor faces on that side: {reason}; give"
                " a group, or a function of the coordinates."
            )

        return {dim: facets}

    def _facts(self) -> list[tuple[str, str]]:
        cells = f"{self.n_cells} of kind {self.cell}, order {self.order}"
        groups = [("groups", ", ".join(self.groups))] if self.groups else []
        return [("cells", cells), ("name", self.name), *groups]


def distributed(raw: RawMesh, name: str, comm: MPI.Comm) -> Mesh:
    """Distribute a mesh, which every rank holds whole as `raw`, over the ranks of `comm`."""
    kind = raw.kind
    here = slice(None if comm.rank == 0 else 0)
    cells = raw.cells[here, compat.node_order(kind.shape, kind.nodes, "vtk")]
    cells, points = np.ascontiguousarray(cells), raw.points[here]
    mesh = compat.create_mesh(comm, cells, points, kind.shape, kind.order)
    return Mesh(mesh, local_groups(mesh, raw.groups), name, labels=raw.labels)


def local_groups(
    mesh: dolfinx.mesh.Mesh, wanted: Mapping[str, Mapping[int, IntArray]]
) -> dict[str, dict[int, IntArray]]:
    """{group: {dimension: entities of this rank}}; `wanted`: {group: {dimension: vertices (n, v)}},
    in numbers of the nodes that dolfinx received."""
    groups: dict[str, dict[int, IntArray]] = {name: {} for name in wanted}
    numbers = np.asarray(mesh.geometry.input_global_indices)
    for dim in sorted({dim for parts in wanted.values() for dim in parts}):
        names = [name for name, parts in wanted.items() if dim in parts]
        rows = [wanted[name][dim] for name in names]
        at = row_positions(np.vstack(rows), numbers[compat.vertex_nodes(mesh, dim)])
        parts = np.split(at, np.cumsum([len(part) for part in rows])[:-1])
        for name, entities in zip(names, parts, strict=True):
            groups[name][dim] = np.unique(entities[entities >= 0]).astype(np.int32)

    return groups
