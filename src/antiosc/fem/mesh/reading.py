"""`read_mesh`, `box_mesh`: the mesh of a file, of a geometry, of dolfinx, or of given lengths.

All cells of a file are checked; for instance a repeated cell would double its mass.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import dolfinx
import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from antiosc.base import errors, plausible
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import (
    choice,
    flag,
    floats,
    instance,
    path as checked_path,
    point_text,
    positive,
    shown,
    text,
    whole,
)
from antiosc.base.errors import (
    AntioscWarning,
    ChoiceWarning,
    InputError,
    MeshError,
    UnmeshableError,
    without_warnings,
)
from antiosc.base.texts import engineering, printable, rounded_up
from antiosc.fem.mesh import Mesh, distributed
from antiosc.fem.mesh.finer import halved_to_size, refined_near
from antiosc.fem.mesh.surface import mean_thickness
from antiosc.fem.platform import collective, compat, on_root, raise_on_all, warn
from antiosc.io.by_gmsh import ENDINGS_WITH_UNIT, GEOMETRY_ENDINGS, SCRIPT_ENDINGS
from antiosc.io.isolation import Refinement
from antiosc.io.neutral import EDGES, FACETS, CellKind, RawMesh, UnitSystem
from antiosc.io.reading import (
    REMESHING_PHRASES,
    CellSelection,
    piece_of_cells,
    pieces_error,
    read,
    read_outline,
    row_hashes,
)

if TYPE_CHECKING:
    from dolfinx.mesh import MeshTags  # the oldest dolfinx has no such name

#: Cells along the longest side of a geometry, and most of them, by default.
CELLS_ALONG_SIDE, MOST_DEFAULT_CELLS = 20, 30_000
#: Remedies of a message: arguments that choose one piece of a mesh.
PIECE_REMEDY = "piece 1 is the largest; or cells, its group"


def misfit_cells(cells: IntArray, kind: CellKind) -> tuple[IntArray, IntArray]:
    """(cells with two or more sides in common with another cell, cells with a side in common with
    two others), as indices of `cells` (n, corners)."""
    sides = FACETS[kind.shape]
    facets = np.vstack([cells[:, list(side)] for side in sides])
    owner = np.tile(np.arange(len(cells)), len(sides))
    _, label, count = np.unique(row_hashes(facets), return_inverse=True, return_counts=True)
    label = label.ravel()

    incidence = csr_matrix((np.ones(len(owner), dtype=np.int32), (owner, label)))
    common = (incidence @ incidence.T).tocoo()
    twice = (common.data > 1) & (common.row != common.col)
    return np.unique(common.row[twice]), np.unique(owner[count[label] > 2])


def sound(
    raw: RawMesh, name: str, made_here: bool, pieces: bool = False, by: str = 'cells="its group"'
) -> RawMesh:
    """The checked mesh.

    If gmsh made the mesh here (`made_here`), folded cells are straightened; else there is a
    warning. `name`: name of the file; `pieces`: whether unconnected pieces are allowed, since
    constraints join them; `by`: arguments that choose a piece, for the message.

    Raises
    ------
    MeshError
        Repeated cells, two cells with two common sides, cells without length, area or volume,
        cells that cross themselves, unconnected pieces.
    """
    kind = raw.kind
    cells = raw.cells[:, compat.node_order(kind.shape, kind.nodes, "vtk")]

    def message(bad: IntArray, what: str, remedy: str) -> str:
        place = point_text(raw.points[raw.cells[bad[0]]].mean(axis=0))
        return f"{len(bad)} of {len(cells)} cells of {name} {what}, one at {place}: {remedy}."

    def refuse(bad: IntArray, what: str, remedy: str) -> None:
        if len(bad):
            raise (UnmeshableError if made_here else MeshError)(message(bad, what, remedy))

    ordered = np.sort(raw.cells, axis=1)
    refuse(
        np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1)),
        "use a node twice",
        "write them as cells of fewer nodes, or mesh it anew",
    )
    doubles, crowded = misfit_cells(raw.cells[:, : kind.vertices], kind)
    refuse(
        doubles,
        "repeat another one, or share two sides with it",
        "delete the copies, or make one cell of both",
    )

    if kind.dim == raw.points.shape[1]:
        refuse(
            crowded,
            "share a side with more than one other",
            "they overlap; delete the superfluous ones",
        )

    refuse(
        collapsed_cells(raw.points, cells, kind.shape, kind.order),
        f"have no {('length', 'area', 'volume')[kind.dim - 1]}",
        "merge the nodes that coincide, or mesh it anew",
    )

    # gmsh bends a few curved cells too far where a mesh is coarse for its curves
    if not (made_here and kind.order > 1):
        refuse(
            crossed_cells(raw.points, cells, kind.shape, kind.order),
            "cross themselves, as a bowtie does",
            "give their nodes in order around each side, or mesh it anew",
        )

    if not pieces and (count := int(piece_of_cells(raw).max()) + 1) > 1:
        raise pieces_error(
            raw,
            f"{name} falls into {count} pieces that share no node",
            "join them (nodes that coincide: merge; solids of a CAD file: fragments; in gmsh: "
            f"BooleanFragments) or read the piece of interest ({by}).",
        )
    if made_here and kind.order == 2 and kind.shape in SIMPLEX_EDGES:
        return replace(raw, points=straightened(raw.points, raw.cells, kind.shape))

    if kind.dim > 1:
        bad = folded_cells(raw.points, cells, kind.shape, kind.order)
        if len(bad):
            remedy = (
                "what is computed there is wrong; optimise the mesh (in gmsh: "
                "Mesh.HighOrderOptimize = 2) or read it with order 1"
            )
            errors.warn(message(bad, "fold over themselves", remedy))

    return raw


# -- Folded and collapsed cells have a bad Jacobian; they are straightened if gmsh made them.
#
# A curved cell at a tight fillet may have a negative Jacobian at a corner. Integrals over it are
# wrong without any other symptom, and a point in it has two sets of reference coordinates.


#: Cells whose Jacobians are computed at a time.
CELLS_AT_ONCE = 20_000
#: Least ratio of the smallest to the largest Jacobian determinant of a sound cell.
LEAST_JACOBIAN_RATIO = 0.02
#: A cell has collapsed if its measure over its size to the power of its dimension is below this.
LEAST_MEASURE = 1e-7
#: A cell is a point if its size over that of the mesh is below this.
POINT_SIZE = 1e-12
#: Corners of the edges of second-order simplices, in the order of their middle nodes.
SIMPLEX_EDGES = {"triangle": EDGES["triangle"], "tetrahedron": EDGES["tetra"]}


def _cells_where(
    points: Array, cells: IntArray, shape: str, order: int, fails: Callable[[Array], BoolArray]
) -> IntArray:
    """Indices of `cells` (n, nodes in dolfinx's order) whose Jacobian determinants satisfy `fails`.
    `fails` is given (n, q) determinants at q points, of positive sum in each cell."""
    slopes = compat.lattice_gradients(shape, order, 3 if order > 1 else 1)
    failed = [np.zeros(0, dtype=bool)]
    for start in range(0, len(cells), CELLS_AT_ONCE):
        x = points[cells[start : start + CELLS_AT_ONCE]]
        J = np.einsum("dqn,cni->cqdi", slopes, x, optimize=True)
        det = np.linalg.det(J) if J.shape[2] == J.shape[3] else _along_mean_normal(J)
        failed.append(fails(det * np.sign(det.sum(axis=1))[:, None]))
    return np.flatnonzero(np.concatenate(failed))


def folded_cells(
    points: Array, cells: IntArray, shape: str, order: int, least: float = 0.0
) -> IntArray:
    """Numbers of cells (nodes in dolfinx's order) whose smallest Jacobian determinant is at most
    `least` times the largest."""
    return _cells_where(
        points, cells, shape, order, lambda det: det.min(axis=1) <= least * det.max(axis=1)
    )


def _along_mean_normal(J: Array) -> Array:
    """Jacobian determinants (cells, q) of faces along their mean normal, < 0 where one folds back;
    `J` (cells, q, 2, 3)."""
    normals = np.cross(J[:, :, 0], J[:, :, 1])
    mean = normals.sum(axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.einsum("cqi,ci->cq", normals, mean / np.where(size > 0, size, 1.0))


def collapsed_cells(points: Array, cells: IntArray, shape: str, order: int) -> IntArray:
    """Numbers of cells (nodes in dolfinx's order) without length, area or volume."""
    slopes = compat.lattice_gradients(shape, order, order)
    J = np.einsum("dqn,cni->cqdi", slopes, points[cells], optimize=True)
    measure = np.sqrt(np.abs(np.linalg.det(J @ J.swapaxes(2, 3)))).max(axis=1)
    size = np.abs(J).max(axis=(1, 2, 3))
    is_point = size <= POINT_SIZE * np.ptp(points, axis=0).max()
    return np.flatnonzero(is_point | (measure <= LEAST_MEASURE * size ** slopes.shape[0]))


#: Least signed over unsigned area or volume: bowties have 0 to 0.4, a corner beyond a diagonal 0.6.
CROSSED_RATIO = 0.5


def crossed_cells(points: Array, cells: IntArray, shape: str, order: int) -> IntArray:
    """Numbers of cells (nodes in dolfinx's order) whose sides cross, as in a bowtie."""
    return _cells_where(
        points,
        cells if shape != "interval" else cells[:0],
        shape,
        order,
        lambda det: det.sum(axis=1) <= CROSSED_RATIO * np.abs(det).sum(axis=1),
    )


def refuse_degenerate(mesh: Mesh) -> None:
    """MeshError on all ranks if a cell has no area or volume or intersects itself."""
    owned_cells = compat.cell_index_map(mesh.dolfinx).size_local
    nodes = compat.geometry_nodes(mesh.dolfinx)[:owned_cells].astype(np.int64)
    points = mesh.dolfinx.geometry.x[:, : mesh.gdim]

    size = ("length", "area", "volume")[mesh.tdim - 1]
    for check, fault in ((collapsed_cells, f"have no {size}"), (crossed_cells, "cross themselves")):
        bad = check(points, nodes, mesh.cell, mesh.order) if owned_cells else nodes[:0, 0]
        total = mesh.comm.allreduce(len(bad))
        error = None
        if len(bad):
            error = MeshError(
                f"{total} of {mesh.n_cells} {mesh.cell} cells {fault}, one at "
                f"{point_text(points[nodes[bad[0]]].mean(axis=0))}: mesh the part anew, or remove "
                "these cells."
            )
        raise_on_all(mesh.comm, error)


def straightened(points: Array, cells: IntArray, shape: str) -> Array:
    """`points` with the mid-side nodes of folded cells moved to the middle of their sides; cells
    that this folds are straightened too. `cells`: second-order simplices, nodes in VTK's order.
    UnmeshableError if a straight cell has no volume."""
    points = points.copy()
    edges = np.array(SIMPLEX_EDGES[shape])
    first = int(edges.max()) + 1
    reordered = cells[:, compat.node_order(shape, cells.shape[1], "vtk")]
    bad = folded_cells(points, reordered, shape, 2, LEAST_JACOBIAN_RATIO)

    straight = np.zeros(len(cells), dtype=bool)
    while len(bad):
        if straight[bad].all():
            raise UnmeshableError(f"gmsh made {len(bad)} cells without volume: change the size.")
        straight[bad] = True
        middles = cells[straight][:, first : first + len(edges)]
        points[middles] = points[cells[straight][:, edges]].mean(axis=2)
        suspects = np.flatnonzero(np.isin(cells, middles).any(axis=1))
        bad = suspects[folded_cells(points, reordered[suspects], shape, 2, LEAST_JACOBIAN_RATIO)]

    return points


@collective()
def read_mesh(
    source: str | Path | dolfinx.mesh.Mesh,
    size: float | None = None,
    gdim: int | None = None,
    *,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    groups: Mapping[str, tuple[MeshTags, int]] | None = None,
    cells: CellSelection = None,
    parts: Sequence[str] | None = None,
    unit: str | float | None = None,
    merge: float | None = None,
    solid: bool = False,
    fragments: bool = False,
    piece: int | None = None,
    trust: bool = False,
    timeout: float | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Mesh:
    """Read a mesh, or mesh a geometry.

    A separate process with limits on time and memory reads the file; it executes no commands.

    Parameters
    ----------
    source
        A Gmsh mesh (`.msh`), a geometry that gmsh meshes (`.geo`, `.step`, `.brep`, `.iges`), a
        deck of Abaqus, CalculiX (`.inp`) or Nastran (`.bdf`, `.nas`, `.fem`), a surface of
        triangles (`.stl`, `.obj`, `.ply`, `.off`), any other file that meshio reads, or a dolfinx
        mesh. Wedges, pyramids and mixed volumes are cut into tetrahedra, quadrilaterals of a mesh
        with triangles into triangles, and cells with 8 and 20 nodes get the missing nodes.
    size
        Largest element size in m. For a geometry the default is `default_size`, unless a `.geo`
        sets its own. All cells of a finished mesh are halved until none is longer, and its groups
        are kept.
    gdim
        2 or 3. By default a plane mesh of triangles or quadrilaterals is 2-D; lines and curved
        faces are in space. `gdim=2` makes a plane frame of lines, `gdim=3` a flat shell of faces.
    order
        Geometric order, 1 or 2. Default: the file's order; geometries get curved (order 2) faces
        and volumes, straight where they would fold over, and straight lines. 1 drops mid-side
        nodes.
    refine
        Pairs (point, size): elements of that size around the point, growing away from it by 0.35
        of the distance, or by another growth: (point, size, growth). Straight triangles and
        tetrahedra of a finished mesh are bisected there. A site with a radius needs elements no
        larger than the radius.
    groups
        For a dolfinx mesh: name -> (MeshTags, value). Files have their own groups: physical groups,
        element sets, node sets with the facets that they span, and tags named by their number.
    cells
        Cells of the file that make the mesh: a dimension (1, 2 or 3), a group or a list of groups.
        Default: the cells of the highest dimension. A warning names cells on their faces or
        edges; a file with further cells, possibly shells and beams, is refused.
    parts
        Names of parts, instances, solids or groups, instead of `cells`: only they are read.
    unit
        Unit of the coordinates in the file: "m", "mm", "cm", "in", "ft", or metres per unit;
        default: m. STEP and IGES files state their own.
    merge
        Nodes of a finished mesh or deck at most this far apart, m, become one node.
    solid
        Fill the closed surface of an STL, OBJ, PLY or OFF file with tetrahedra; default: the
        triangles are a sheet.
    fragments
        Cut the solids of a CAD assembly at each other, so that they share nodes where they touch.
    piece
        Number of the piece to read from a mesh of pieces without a common node: 1 for the largest.
    trust
        Let a `.geo` include other files, run programs and write files; read the options (`.opt`)
        beside a file. Only for files whose author you know.
    timeout
        Seconds after which reading ends with an error; the default depends on the file's size.
    comm
        The MPI communicator that shares the mesh.

    Groups of a CAD file or a filled surface are its solids by their labels, its outer faces ("face
    1", "face 2", …, and labels) and its holes by their diameter ("hole 6 mm (1)"). If gmsh cannot
    mesh a geometry, it tries again with elements that follow the curvature; a surface of triangles
    is filled by fTetWild (pytetwild). A warning reports this.

    Raises
    ------
    MeshError
        Missing, unreadable or damaged file, no usable cells, repeated cells, pieces that share no
        node, a size larger than the part or one that would take more than 10 million cells, a
        script that does more than describe a geometry.

    Warns
    -----
    AntioscWarning
        Folded cells; elements that are not cells of the mesh; a volume that differs from the CAD
        volume by more than 0.5 %.
    """
    for name, value, of in (("size", size, "m"), ("merge", merge, "m"), ("timeout", timeout, "s")):
        if value is not None:
            positive(name, value, of)
    for name, argument, options in (("gdim", gdim, (2, 3)), ("order", order, (1, 2))):
        if argument is not None:
            choice(name, argument, options)
    for name, either in (("trust", trust), ("solid", solid), ("fragments", fragments)):
        flag(name, either)
    if piece is not None:
        piece = whole("piece", piece, least=1)
    check_refinements(refine)
    if parts is not None and cells is not None:
        raise InputError("give cells or parts, which both select cells; got both.")
    if isinstance(parts, str):
        raise InputError(f"parts must be a list of names; got {shown(parts)}.")
    cells = parts if cells is None else cells
    if isinstance(cells, str):
        text("cells", cells)
    elif not isinstance(cells, list | tuple):
        whole("cells", 1 if cells is None else cells, 1, 3)
    elif not cells or not all(isinstance(c, str) and c for c in cells):
        raise InputError(f"cells must be a dimension or names of groups; got {shown(cells)}.")
    units = None if unit is None else UnitSystem.of(unit)
    instance("comm", comm, MPI.Comm, "an MPI communicator (mpi4py)")
    if groups is not None:
        instance("groups", groups, Mapping, "a dict: name -> (MeshTags, value)")
    if isinstance(source, dolfinx.mesh.Mesh):
        if unit is not None or merge is not None:
            raise InputError("unit and merge apply to files; a dolfinx mesh is in metres.")
        return _mesh_of_dolfinx(source, groups or {})
    if groups:
        raise InputError("groups names the tags of a dolfinx mesh; a file brings its own groups.")
    if not isinstance(source, str | Path):
        raise InputError(f"read_mesh takes a file or a dolfinx mesh; got {shown(source)}.")

    file = checked_path("source", source)
    name = printable(file.name)
    suffix = file.suffix.lower()
    made_here = suffix in GEOMETRY_ENDINGS or solid
    kept: dict[str, Any] = {"solid": solid, "fragments": fragments, "piece": piece}

    if size is None and made_here and suffix not in SCRIPT_ENDINGS:
        metres = 1.0 if units is None else units.length
        box = metres * on_root(comm, lambda: read_outline(file, **kept).points)
        kept |= {"gdim": gdim, "order": order, "refine": refine, "cells": cells, "unit": unit}
        kept |= {"trust": trust, "timeout": timeout, "comm": comm}
        with without_warnings():
            first = read_mesh(file, usual_size(box), **kept)
        size = default_size(first, usual_size(box))
        warn(comm, f"the cells of {name} are {engineering(size, 'm')} long (size).", ChoiceWarning)
        return read_mesh(file, size, **kept)

    def checked(raw: RawMesh) -> RawMesh:
        if size is not None:
            plausible.refuse_size(size, raw.points, name)
        mesh = sound(flattened(raw, gdim, name), name, made_here, by=PIECE_REMEDY)
        return mesh if made_here or size is None else halved_to_size(size, mesh, name)

    kept |= {"cells": cells, "trust": trust, "timeout": timeout, "unit": units, "merge": merge}
    if made_here:
        kept |= {"size": size, "refine": refine}
    raw = on_root(comm, lambda: read(file, order=order, sound=checked, **kept))
    for sentence in raw.remarks:
        made = any(words in sentence for words in REMESHING_PHRASES)
        warn(comm, sentence, ChoiceWarning if made else AntioscWarning)
    unit_stated = unit is not None or file.suffix.lower() in ENDINGS_WITH_UNIT
    mesh = distributed(raw, name, comm)
    return replace(mesh if made_here else refined_near(mesh, refine), stated=unit_stated)


def usual_size(points: Array) -> float:
    """Cell size [m] with `CELLS_ALONG_SIDE` cells along the longest side of points (n, 3) [m]."""
    return float(f"{np.ptp(points, axis=0).max() / CELLS_ALONG_SIDE:.1g}")


def default_size(mesh: Mesh, size: float) -> float:
    """Default cell size [m] of a geometry, from its mesh with cells of `size` [m].

    There are 20 cells along its longest side. In a solid, cells are at most as long as twice the
    mean thickness of its walls, unless that takes more than 30 000 cells (150 000 dofs).
    """
    wanted = usual_size(mesh.dolfinx.geometry.x)
    if mesh.tdim == 3:
        wanted = min(wanted, float(f"{2 * mean_thickness(mesh):.1g}"))
    least = rounded_up(size * (mesh.n_cells / MOST_DEFAULT_CELLS) ** (1 / mesh.tdim))
    return max(wanted, least)


def check_refinements(refine: Sequence[Refinement]) -> None:
    """InputError unless `refine` is a sequence of (point, size) or (point, size, growth)."""
    if not isinstance(refine, Sequence) or isinstance(refine, str):
        raise InputError(f"refine must be a list of pairs (point, size); got {shown(refine)}.")

    for refinement in refine:
        try:
            point, local, growth = refinement if len(refinement) == 3 else (*refinement, 1.0)
            shape = (len(point),)
        except (TypeError, ValueError) as error:
            pairs = "refine lists (point, size) or (point, size, growth), as [((0, 0, 0.1), 2e-3)]"
            raise InputError(f"{pairs}; got {shown(refinement)}.") from error

        floats("a point of refine", point, shape)
        positive("a size of refine", local, "m")
        positive("a growth of refine", growth)


def flattened(raw: RawMesh, gdim: int | None, name: str) -> RawMesh:
    """The mesh with points (n, gdim). With `gdim` None a plane mesh of faces gets 2, others 3."""
    *_, depth = spans = np.ptp(raw.points, axis=0)
    flat = depth <= 1e-9 * spans.max()
    if gdim is None:
        gdim = 2 if raw.kind.dim == 2 and flat else 3
    if gdim == 2 and raw.kind.dim == 3:
        raise MeshError(f"{name} is a mesh of volumes: it cannot be read with gdim 2.")
    if gdim == 2 and not flat:
        remedy = "read it with gdim 3, or give it one z"
        raise MeshError(f"{name} is not plane (z spans {depth:g} m): {remedy}.")
    return replace(raw, points=np.ascontiguousarray(raw.points[:, :gdim]))


def _mesh_of_dolfinx(mesh: dolfinx.mesh.Mesh, groups: Mapping[str, tuple[MeshTags, int]]) -> Mesh:
    """A dolfinx mesh as `Mesh`; `groups`: name -> (tags, value) of its entities."""
    named: dict[str, dict[int, IntArray]] = {}
    for name, pair in groups.items():
        if not isinstance(pair, tuple | list) or len(pair) != 2 or not hasattr(pair[0], "indices"):
            raise InputError(f"group {shown(name)} must be (MeshTags, value); got {shown(pair)}.")
        tags, value = pair
        entities = np.asarray(tags.indices)[np.asarray(tags.values) == value]
        if not compat.communicator(mesh).allreduce(len(entities)):
            raise InputError(f"group {name!r}: no entity of the mesh tags has the value {value}.")
        named[name] = {int(tags.dim): entities.astype(np.int32)}

    if compat.coordinate_map(mesh).degree > 2:
        raise MeshError("cells of geometric order above 2 are not supported: use order 1 or 2.")
    adopted = Mesh(mesh, named, "the dolfinx mesh")
    refuse_degenerate(adopted)
    return adopted


#: number of lengths -> (name, gmsh script, {group: entities of the side})
BOX_SCRIPTS = {
    1: ("bar", "Point(1) = {{0, 0, 0}}; Point(2) = {{{0!r}, 0, 0}}; Line(1) = {{1, 2}};",
        {"-x": "1", "+x": "2"}),
    2: ("plate", "Rectangle(1) = {{0, 0, 0, {0!r}, {1!r}}};",
        {"-x": "4", "+x": "2", "-y": "1", "+y": "3", "rim": "1, 2, 3, 4"}),
    3: ("block", "Box(1) = {{0, 0, 0, {0!r}, {1!r}, {2!r}}};",
        {"-x": "1", "+x": "2", "-y": "3", "+y": "4", "-z": "5", "+z": "6"}),
}  # fmt: skip
GMSH_GROUP_TYPES = ("Point", "Curve", "Surface", "Volume")


def box_mesh(
    lengths: Sequence[float],
    size: float,
    *,
    refine: Sequence[Refinement] = (),
    gdim: int = 3,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Mesh:
    """Mesh a bar, a plate or a block, with a corner at the origin and its sides along the axes.

    Parameters
    ----------
    lengths : one, two or three floats
        Lengths along x, y and z, m. One gives lines (for `Beam`), two triangles (for `Shell`),
        three tetrahedra (for `Solid`).
    size : float
        Largest element size, m.
    refine : sequence of (point, size)
        As for `read_mesh`.
    gdim : 3 or 2
        2 makes a bar or a plate two-dimensional, for plane frames and plane stress.
    comm : MPI communicator that shares the mesh

    Returns
    -------
    Mesh
        Its sides are the groups "-x", "+x", "-y", …; all edges of a plate are "rim".
    """
    sides = floats("lengths", lengths, None)
    if sides.ndim != 1 or len(sides) not in BOX_SCRIPTS:
        raise InputError(f"lengths must be one to three, as (0.2, 0.1); got {shown(lengths)}.")
    choice("gdim", gdim, (2, 3))
    instance("comm", comm, MPI.Comm, "an MPI communicator (mpi4py)")
    name, body, groups = BOX_SCRIPTS[len(sides)]
    whole_body = body.format(*(positive("a length", float(side), "m") for side in sides))
    kind, last = GMSH_GROUP_TYPES[len(sides) - 1 : len(sides) + 1]
    lines = ['SetFactory("OpenCASCADE");', whole_body, f'Physical {last}("{name}") = {{1}};']
    lines += [f'Physical {kind}("{side}") = {{{tags}}};' for side, tags in groups.items()]

    with TemporaryDirectory() as folder:
        script = Path(folder, f"{name}.geo")
        script.write_text("\n".join(lines) + "\n", encoding="ascii")
        script = comm.bcast(script)  # every rank has a folder of its own, and all read the first
        mesh = read_mesh(script, size, gdim, order=1, refine=refine, comm=comm)
        comm.barrier()
    return replace(mesh, name=name)
