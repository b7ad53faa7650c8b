"""`Mesh`, a mesh with named groups of entities, and `read_mesh`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI

from antiosc._types import Array, IntArray
from antiosc.checks import (
    array,
    choice,
    flag,
    instance,
    path as checked_path,
    positive,
    shown,
    text,
    whole,
)
from antiosc.errors import InputError, MeshError
from antiosc.fem import compat
from antiosc.fem.mesh.cell_geometry import CellGeometry
from antiosc.fem.mesh.soundness import sound
from antiosc.fem.mpi import agree, bounds, collective, on_root, warn
from antiosc.fem.readers import GEOMETRY, RawMesh, Refinement, UnitSystem, Wanted, read
from antiosc.fem.readers.selection import keys
from antiosc.names import known


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


@collective()
def read_mesh(
    source: str | Path | dolfinx.mesh.Mesh,
    size: float | None = None,
    gdim: int | None = None,
    *,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    groups: Mapping[str, tuple[Any, int]] | None = None,
    cells: Wanted = None,
    parts: Sequence[str] | None = None,
    unit: str | float | None = None,
    merge: float | None = None,
    solid: bool = False,
    fragments: bool = False,
    trust: bool = False,
    timeout: float | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Mesh:
    """Read a mesh, or mesh a geometry.

    A file is treated as untrusted data: a separate process with limits on time and memory reads it,
    and no commands in it are executed.

    Parameters
    ----------
    source
        A Gmsh mesh (`.msh`), a geometry that gmsh meshes (`.geo`, `.step`, `.brep`, `.iges`;
        CAD files' own length unit is converted to metres), a deck of Abaqus, CalculiX (`.inp`) or
        Nastran (`.bdf`, `.nas`, `.fem`), a universal file (`.unv`), any other file that meshio
        reads, or a dolfinx mesh. Coordinates are metres (see `unit`). Wedges, pyramids and mixed
        volumes are cut into tetrahedra, quadrilaterals beside triangles into triangles, and cells
        with 8 and 20 nodes get the missing nodes.
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
    cells
        Which cells of a file make the mesh: a dimension (1, 2 or 3), a group or a list of groups.
        By default those of the highest dimension; if others (shells, beams) are no faces or edges
        of these, the file is refused.
    parts
        Names of parts, instances, solids or groups, in place of `cells`: only they are read.
    unit
        Of the coordinates in the file: "m", "mm", "cm", "in", or metres per unit. STEP and IGES
        files state their own; sizes in a `.geo` script are in the script's unit.
    merge
        Nodes of a finished mesh or deck that are no further apart than this, m, become one.
    solid
        Fill the closed surface of an STL file with tetrahedra (`size`, and `unit`, for STL has
        none). Without it the triangles are a sheet; `merge` joins their corners.
    fragments
        Cut the solids of a STEP or BREP assembly at each other, so that they share nodes where they
        touch. Solids are groups by their names.
    trust
        Let a `.geo` include other files, run programs and write files; read the options (`.opt`)
        beside a file. Only for files whose author you know.
    timeout
        Seconds after which reading ends with an error. Default: ten times or more of what a file of
        its size, or that number of cells, needs.
    comm
        The MPI communicator that shares the mesh.

    Raises
    ------
    MeshError
        Missing, unreadable or damaged file, no usable cells, mixed cell kinds, repeated cells,
        pieces that share no node, a size that would take more than 10 million cells, a script that
        does more than describe a geometry.

    Warns
    -----
    AntioscWarning
        Folded or overlapping cells, cracks and hanging nodes; elements of a deck that are no cells.
    """
    _check(size, gdim, order, refine)
    if parts is not None:
        if cells is not None:
            raise InputError("give cells= or parts=, which both select cells; got both.")
        if isinstance(parts, str):
            raise InputError(f"parts must be a list of names; got {shown(parts)}.")
        cells = list(parts) if isinstance(parts, list | tuple) else parts
    _check_choice(cells, trust, timeout)
    flag("solid", solid)
    flag("fragments", fragments)
    units = None if unit is None else UnitSystem.of(unit)
    if merge is not None:
        positive("merge", merge, "m")
    instance("comm", comm, MPI.Comm, "an MPI communicator (mpi4py)")
    if groups is not None:
        instance("groups", groups, Mapping, "a dict: name -> (MeshTags, value)")
    if isinstance(source, dolfinx.mesh.Mesh):
        if unit is not None or merge is not None:
            raise InputError("unit= and merge= apply to files; a dolfinx mesh is in metres.")
        return _adopted(source, groups or {})
    if groups:
        raise InputError("groups= names the tags of a dolfinx mesh; a file brings its own groups.")
    if not isinstance(source, str | Path):
        raise InputError(
            f"read_mesh takes a file or a dolfinx mesh; got {type(source).__name__} "
            f"{shown(source)}."
        )
    file = checked_path("source", source)

    def work() -> RawMesh:
        raw = read(
            file,
            size,
            order,
            refine,
            cells=cells,
            trust=trust,
            timeout=timeout,
            unit=units,
            merge=merge,
            solid=solid,
            fragments=fragments,
        )
        made_here = file.suffix.lower() in GEOMETRY or solid
        return sound(flattened(raw, gdim, file.name), file.name, made_here)

    raw = on_root(comm, work)
    for sentence in raw.told:
        warn(comm, sentence)
    return distributed(raw, file.name, comm)


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


def _check_choice(cells: Any, trust: Any, timeout: Any) -> None:
    if isinstance(cells, list | tuple):
        if not cells or not all(isinstance(c, str) and c for c in cells):
            raise InputError(f"cells must be a dimension or names of groups; got {shown(cells)}.")
    elif isinstance(cells, str):
        text("cells", cells)
    elif cells is not None:
        whole("cells", cells, 1, 3)
    flag("trust", trust)
    if timeout is not None:
        positive("timeout", timeout, "s")


def flattened(raw: RawMesh, gdim: int | None, name: str) -> RawMesh:
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
    return replace(raw, points=np.ascontiguousarray(raw.points[:, :gdim]))


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
        found = compat.communicator(mesh).allreduce(len(entities))
        if not found:
            raise InputError(f"group {name!r}: no entity of the mesh tags has the value {value}.")
        named[name] = {int(tags.dim): entities.astype(np.int32)}
    error = None
    if compat.coordinate_map(mesh).degree > 2:
        error = MeshError("cells of geometric order above 2 are not supported: use order 1 or 2.")
    agree(compat.communicator(mesh), error)
    return Mesh(mesh, named, "the dolfinx mesh")
