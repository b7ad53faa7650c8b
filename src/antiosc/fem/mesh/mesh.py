"""`Mesh`: a dolfinx mesh with named groups of entities, on all ranks that share it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import dolfinx
import numpy as np
from mpi4py import MPI

from antiosc.base._types import Array, IntArray
from antiosc.base.brief import Brief
from antiosc.base.checks import (
    instance,
    shown,
)
from antiosc.base.errors import InputError, known
from antiosc.fem.mesh.cell_geometry import CellGeometry
from antiosc.fem.platform import compat
from antiosc.fem.platform.mpi import bounds
from antiosc.io.neutral import RawMesh
from antiosc.io.selection import keys


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Brief):
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
        compat.name_coordinates(self.dolfinx)

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
            groups = known(name, self.groups, "its groups")
            raise InputError(f"{self.name} has no group {shown(name)}; {groups}.")
        return self.groups[name]

    def _facts(self) -> list[tuple[str, str]]:
        cells = f"{self.n_cells} of kind {self.cell}, order {self.order}"
        facts = [("cells", cells), ("name", self.name)]
        return [*facts, ("groups", ", ".join(self.groups))] if self.groups else facts


def distributed(raw: RawMesh, name: str, comm: MPI.Comm) -> Mesh:
    """The dolfinx mesh of arrays that every rank holds (their groups too)."""
    kind = raw.kind
    cells, points = raw.cells, raw.points
    if comm.rank > 0:
        cells, points = cells[:0], points[:0]
    cells = cells[:, compat.node_order(kind.shape, kind.nodes, raw.convention)]
    mesh = compat.create_mesh(comm, np.ascontiguousarray(cells), points, kind.shape, kind.order)
    return Mesh(mesh, local_groups(mesh, raw.groups), name)


def local_groups(
    mesh: dolfinx.mesh.Mesh, wanted: Mapping[str, Mapping[int, IntArray]]
) -> dict[str, dict[int, IntArray]]:
    """The entities of this rank in each group, given by the vertices of each (input numbers).

    One sort for all groups of a dimension: there may be thousands.
    """
    groups: dict[str, dict[int, IntArray]] = {name: {} for name in wanted}
    numbers = np.asarray(mesh.geometry.input_global_indices)
    for dim in sorted({dim for parts in wanted.values() for dim in parts}):
        names = [name for name, parts in wanted.items() if dim in parts]
        rows = [wanted[name][dim] for name in names]
        mine = numbers[compat.entity_vertices(mesh, dim)]
        code = keys(mine)
        order = np.argsort(code)
        asked = keys(np.vstack(rows))
        position = np.minimum(np.searchsorted(code[order], asked), max(len(mine) - 1, 0))
        here = code[order][position] == asked if len(mine) else np.zeros(len(asked), dtype=bool)
        ends = np.cumsum([len(r) for r in rows])
        for name, end, part in zip(names, ends, rows, strict=True):
            some = slice(end - len(part), end)
            found = order[position[some][here[some]]]
            groups[name][dim] = np.unique(found).astype(np.int32)
    return groups
