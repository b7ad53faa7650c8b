"""Mesh files into plain arrays: Gmsh's own files through gmsh, all others through meshio.

A `RawMesh` is what both deliver: nodes, cells of one kind and named groups of entities, each
entity given by its vertices. `antiosc.fem.mesh` makes the dolfinx mesh of it.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc.errors import MeshError, MissingDependencyError

IntArray = NDArray[np.int64]
Refinement = tuple[Sequence[float], float]

GEOMETRY = (".geo", ".geo_unrolled", ".step", ".stp", ".brep", ".iges", ".igs")
#: Sizes grow away from a refined point by this much per unit of distance.
GROWTH = 0.35
#: The refined size reaches this many sizes around the point before it grows.
REACH = 2.0
#: What gmsh is asked for instead of 1: the edges of its tetrahedra come out up to 1.9 times longer.
SHORTER = 0.5


@dataclass(frozen=True)
class CellKind:
    """A cell shape with its geometric order; `vertices` of its `nodes` come first."""

    shape: str
    dim: int
    order: int
    vertices: int
    nodes: int


KINDS = {
    "vertex": CellKind("point", 0, 1, 1, 1),
    "line": CellKind("interval", 1, 1, 2, 2),
    "line3": CellKind("interval", 1, 2, 2, 3),
    "triangle": CellKind("triangle", 2, 1, 3, 3),
    "triangle6": CellKind("triangle", 2, 2, 3, 6),
    "quad": CellKind("quadrilateral", 2, 1, 4, 4),
    "quad9": CellKind("quadrilateral", 2, 2, 4, 9),
    "tetra": CellKind("tetrahedron", 3, 1, 4, 4),
    "tetra10": CellKind("tetrahedron", 3, 2, 4, 10),
    "hexahedron": CellKind("hexahedron", 3, 1, 8, 8),
    "hexahedron27": CellKind("hexahedron", 3, 2, 8, 27),
}
#: Kinds that are only read as the boundary of others, or whose mid-side nodes can be dropped.
SERENDIPITY = {
    "quad8": CellKind("quadrilateral", 2, 2, 4, 8),
    "hexahedron20": CellKind("hexahedron", 3, 2, 8, 20),
}
GMSH_KINDS = {
    15: "vertex",
    1: "line",
    8: "line3",
    2: "triangle",
    9: "triangle6",
    3: "quad",
    10: "quad9",
    16: "quad8",
    4: "tetra",
    11: "tetra10",
    5: "hexahedron",
    12: "hexahedron27",
    17: "hexahedron20",
}
FACETS: dict[str, list[tuple[int, ...]]] = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quadrilateral": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetrahedron": [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)],
    "hexahedron": [
        (0, 1, 2, 3),
        (4, 5, 6, 7),
        (0, 1, 5, 4),
        (1, 2, 6, 5),
        (2, 3, 7, 6),
        (3, 0, 4, 7),
    ],
}


@dataclass
class RawMesh:
    """Nodes, cells of one kind, and groups, as arrays."""

    #: (n, 3) node coordinates
    points: NDArray[np.float64]
    #: (cells, nodes per cell), vertices first
    cells: IntArray
    kind: CellKind
    #: node order within a cell: "gmsh" or "vtk"
    convention: str
    #: name -> {dimension: (entities, vertices of one)}
    groups: dict[str, dict[int, IntArray]] = field(default_factory=dict)


def read(
    path: Path, size: float | None, order: int | None, refine: Sequence[Refinement]
) -> RawMesh:
    """Read or mesh the file `path`; see `antiosc.read_mesh`."""
    if not os.path.isfile(path):  # False too for a name that is too long
        raise MeshError(
            f"there is no mesh file {str(path)!r}; check the path (working folder: {Path.cwd()})."
        )
    suffix = path.suffix.lower()
    geometry = suffix in GEOMETRY
    if geometry and size is None and suffix not in (".geo", ".geo_unrolled"):
        raise MeshError(
            f"{path.name} is a geometry, not a mesh: give the element size in metres, "
            "as in read_mesh(path, size=5e-3)."
        )
    if not geometry and (size is not None or refine):
        raise MeshError(
            f"{path.name} is a finished mesh: size= and refine= apply to geometry files only "
            f"({', '.join(GEOMETRY)})."
        )
    raw = (
        _through_gmsh(path, size, order, refine)
        if geometry or suffix == ".msh"
        else _through_meshio(path)
    )
    if order == 1 and raw.kind.order == 2:
        raw = _straightened(raw)
    return _connected(_compact(raw), path.name)


# --- gmsh -------------------------------------------------------------------------------------


@contextlib.contextmanager
def _gmsh_session() -> Iterator[Any]:
    """gmsh, left as it was found: a caller's own session and models stay alive."""
    try:
        import gmsh
    except ImportError as error:
        raise MissingDependencyError(
            "gmsh is not installed: sudo apt install python3-gmsh"
        ) from error
    started = not _running(gmsh)
    if started:
        gmsh.initialize(["antiosc"], readConfigFiles=False, **_no_signal_handler(gmsh))
    current = gmsh.model.getCurrent()
    names = ("General.Terminal", "Mesh.MeshSizeMax", "Mesh.MeshSizeMin", "Mesh.ElementOrder")
    kept = {name: gmsh.option.getNumber(name) for name in names}
    unit = gmsh.option.getString("Geometry.OCCTargetUnit")
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    try:
        yield gmsh
    finally:
        if started:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            gmsh.option.setString("Geometry.OCCTargetUnit", unit)
            for name, value in kept.items():
                gmsh.option.setNumber(name, value)


def _running(gmsh: Any) -> bool:
    """Whether a session is under way."""
    if hasattr(gmsh, "isInitialized"):
        return bool(gmsh.isInitialized())
    try:  # gmsh 4.8 only knows its version while it runs, and complains when it does not
        with _stderr_closed():
            return bool(gmsh.option.getString("General.Version"))
    except Exception:
        return False


@contextlib.contextmanager
def _stderr_closed() -> Iterator[None]:
    """Nothing on stderr, not even from C++."""
    kept = os.dup(2)
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _no_signal_handler(gmsh: Any) -> dict[str, bool]:
    """Keep Ctrl-C with Python: newer gmsh installs a handler of its own unless told not to."""
    import inspect

    known = inspect.signature(gmsh.initialize).parameters
    return {"interruptible": False} if "interruptible" in known else {}


def _through_gmsh(
    path: Path, size: float | None, order: int | None, refine: Sequence[Refinement]
) -> RawMesh:
    with _gmsh_session() as gmsh:
        try:
            gmsh.open(str(path))
            if path.suffix.lower() != ".msh":
                _generate(gmsh, size, order, refine)
            return _gmsh_arrays(gmsh, path.name)
        except MeshError:
            raise
        except Exception as error:
            raise MeshError(
                f"gmsh cannot read or mesh {path.name}: {_plain(str(error))}."
            ) from error


def _generate(
    gmsh: Any, size: float | None, order: int | None, refine: Sequence[Refinement]
) -> None:
    dim = gmsh.model.getDimension()
    if size is not None:
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    if refine:
        fields = [_graded_field(gmsh, point, local, size) for point, local in refine]
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)
    gmsh.model.mesh.generate(dim)
    wanted = order if order is not None else (1 if dim == 1 else 2)
    gmsh.model.mesh.setOrder(wanted)


def _graded_field(gmsh: Any, point: Sequence[float], local: float, size: float | None) -> int:
    """A size field: edges of at most `local` around the point, growing to `size` away from it."""
    x, y, z = (float(c) for c in (*point, 0.0)[:3])
    far = 1e22 if size is None else float(size)
    local = float(local)
    tag = gmsh.model.mesh.field.add("MathEval")
    distance = f"Sqrt((x-({x!r}))^2+(y-({y!r}))^2+(z-({z!r}))^2)"
    grown = f"{SHORTER * local!r}+{GROWTH!r}*Max(0,{distance}-{REACH * local!r})"
    gmsh.model.mesh.field.setString(tag, "F", f"Min({far!r},{grown})")
    return int(tag)


def _gmsh_arrays(gmsh: Any, name: str) -> RawMesh:
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    by_tag = np.argsort(tags)
    sorted_tags = np.asarray(tags)[by_tag]
    points = np.asarray(coordinates, dtype=float).reshape(-1, 3)

    def indices(node_tags: Any, width: int) -> IntArray:
        return by_tag[np.searchsorted(sorted_tags, node_tags)].reshape(-1, width)

    blocks: dict[tuple[int, int], dict[str, IntArray]] = {}
    for dim, tag in gmsh.model.getEntities():
        kinds, _, nodes = gmsh.model.mesh.getElements(dim, tag)
        blocks[dim, tag] = {}
        for kind, block in zip(kinds, nodes, strict=True):
            label = _known(GMSH_KINDS.get(int(kind), f"gmsh type {kind}"), name)
            blocks[dim, tag][label] = indices(block, _kind(label).nodes)
    filled = [dim for (dim, _), block in blocks.items() if block]
    if not filled or max(filled) == 0:
        raise MeshError(f"{name} holds no cells (lines, faces or volumes).")
    top = max(filled)
    groups: dict[str, dict[int, IntArray]] = {}
    in_groups: list[tuple[int, int]] = []
    for dim, tag in gmsh.model.getPhysicalGroups():
        label = gmsh.model.getPhysicalName(dim, tag) or str(tag)
        members = [(dim, int(t)) for t in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)]
        vertices = [
            block[:, : _kind(kind).vertices]
            for member in members
            for kind, block in blocks.get(member, {}).items()
        ]
        if vertices:
            if dim in groups.setdefault(label, {}):
                raise MeshError(
                    f"{name} gives two groups of dimension {dim} the name {label!r}: name them "
                    "apart."
                )
            groups[label][dim] = np.vstack(vertices)
        if dim == top:
            in_groups += members
    # As gmsh itself writes files: once cells are in named groups, the others are construction aids.
    chosen = sorted(set(in_groups)) or [key for key in blocks if key[0] == top]
    cells: dict[str, list[IntArray]] = {}
    for member in chosen:
        for kind, block in blocks[member].items():
            cells.setdefault(kind, []).append(block)
    label, stacked = _one_kind({kind: np.vstack(parts) for kind, parts in cells.items()}, name)
    return RawMesh(points, stacked, _kind(label), "gmsh", groups)


# --- meshio -----------------------------------------------------------------------------------


def _through_meshio(path: Path) -> RawMesh:
    try:
        import meshio
    except ImportError as error:
        raise MissingDependencyError(
            "meshio is not installed: sudo apt install python3-meshio"
        ) from error
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:
        # meshio prints what is wrong and leaves by sys.exit
        reason = _plain(said.getvalue()) or _plain(str(error)) or type(error).__name__
        raise MeshError(f"meshio cannot read {path.name}: {reason}.") from error
    points = np.zeros((len(mesh.points), 3))
    if len(points):
        points[:, : mesh.points.shape[1]] = mesh.points
    top = max((_kind(b.type).dim for b in mesh.cells if _is_known(b.type)), default=0)
    if top == 0:
        kinds = sorted({b.type for b in mesh.cells}) or ["none"]
        raise MeshError(f"{path.name} holds no cells that can be used (found: {', '.join(kinds)}).")
    cells: dict[str, list[IntArray]] = {}
    for block in mesh.cells:
        if _kind(_known(block.type, path.name)).dim == top:
            cells.setdefault(block.type, []).append(np.asarray(block.data, dtype=np.int64))
    label, stacked = _one_kind({kind: np.vstack(parts) for kind, parts in cells.items()}, path.name)
    raw = RawMesh(points, stacked, _kind(label), "vtk")
    for name, block_index, rows in _meshio_sets(mesh):
        block = mesh.cells[block_index]
        kind = _kind(block.type)
        _add(raw.groups, name, kind.dim, np.asarray(block.data)[rows, : kind.vertices])
    for name, nodes in _meshio_point_sets(mesh):
        for dim, entities in _spanned(raw, nodes).items():
            _add(raw.groups, name, dim, entities)
    return raw


def _meshio_sets(mesh: Any) -> Iterator[tuple[str, int, IntArray]]:
    """(group name, block, rows) from every way in which meshio's formats carry cell groups."""
    physical = {(int(tag), int(dim)): name for name, (tag, dim) in mesh.field_data.items()}
    families = getattr(mesh, "cell_tags", {})  # MED: tag -> names
    for key, blocks in mesh.cell_data.items():
        for index, values in enumerate(blocks):
            values = np.asarray(values)
            if values.ndim != 1 or not np.issubdtype(values.dtype, np.integer):
                continue
            dim = _kind(mesh.cells[index].type).dim
            for value in np.unique(values):
                rows = np.flatnonzero(values == value)
                if key == "gmsh:physical":
                    yield physical.get((int(value), dim), str(value)), index, rows
                elif key == "cell_tags":
                    for name in families.get(int(value), []):
                        yield name, index, rows
                elif key in ("nastran:ref", "medit:ref"):
                    yield str(value), index, rows
                elif key != "gmsh:geometrical":
                    yield f"{key}={value}", index, rows
    for name, blocks in mesh.cell_sets.items():
        for index, rows in enumerate(blocks):
            if rows is not None and len(rows) and name not in mesh.cell_data:
                yield name, index, np.asarray(rows, dtype=np.int64)


def _meshio_point_sets(mesh: Any) -> Iterator[tuple[str, IntArray]]:
    for name, nodes in getattr(mesh, "point_sets", {}).items():
        yield name, np.asarray(nodes, dtype=np.int64)
    tags = mesh.point_data.get("point_tags")  # MED: tag -> names
    if tags is not None:
        for value, labels in getattr(mesh, "point_tags", {}).items():
            for name in labels:
                yield name, np.flatnonzero(np.asarray(tags) == value)


def _add(groups: dict[str, dict[int, IntArray]], name: str, dim: int, entities: IntArray) -> None:
    parts = groups.setdefault(name, {})
    parts[dim] = np.vstack([parts[dim], entities]) if dim in parts else np.asarray(entities)


def _spanned(raw: RawMesh, nodes: IntArray) -> dict[int, IntArray]:
    """A node set as what it spans: the boundary facets it holds whole, and the vertices left.

    A support on a node set must also hold the mid-side motions between its nodes.
    """
    marked = np.zeros(len(raw.points), dtype=bool)
    marked[nodes] = True
    vertices = np.unique(raw.cells[:, : raw.kind.vertices])
    left = marked.copy()
    result: dict[int, IntArray] = {}
    if raw.kind.dim > 1:
        facets = np.vstack([raw.cells[:, list(f)] for f in FACETS[raw.kind.shape]])
        ends = np.sort(facets, axis=1)
        first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)[1:]
        outer = facets[first[count == 1]]
        held = outer[marked[outer].all(axis=1)]
        if len(held):
            result[raw.kind.dim - 1] = held
            left[held.ravel()] = False
    alone = vertices[left[vertices]]
    if len(alone):
        result[0] = alone[:, None]
    return result


# --- Common -----------------------------------------------------------------------------------


def _plain(text: str) -> str:
    """A library's complaint as part of a sentence."""
    return " ".join(text.split()).rstrip(".")


def _is_known(label: str) -> bool:
    return label in KINDS or label in SERENDIPITY


def _kind(label: str) -> CellKind:
    return KINDS[label] if label in KINDS else SERENDIPITY[label]


def _known(label: str, name: str) -> str:
    if not _is_known(label):
        raise MeshError(
            f"{name} holds {label} cells, which no element here can carry; it must be of lines, "
            "triangles, quadrilaterals, tetrahedra or hexahedra of geometric order 1 or 2."
        )
    return label


def _one_kind(cells: dict[str, IntArray], name: str) -> tuple[str, IntArray]:
    if len(cells) > 1:
        counts = ", ".join(f"{len(block)} {kind}" for kind, block in sorted(cells.items()))
        raise MeshError(
            f"{name} mixes cell kinds ({counts}); one kind is needed: in gmsh recombine all "
            "surfaces or none (Mesh.RecombineAll)."
        )
    return next(iter(cells.items()))


def _straightened(raw: RawMesh) -> RawMesh:
    """The same mesh without its mid-side nodes."""
    linear = next(k for k in KINDS.values() if k.shape == raw.kind.shape and k.order == 1)
    cells = raw.cells[:, : linear.nodes]
    return RawMesh(raw.points, cells, linear, raw.convention, raw.groups)


def _compact(raw: RawMesh) -> RawMesh:
    """Without nodes that no cell uses, nor groups left empty by that."""
    if raw.kind in SERENDIPITY.values():
        raise MeshError(
            f"second-order {raw.kind.shape} cells of {raw.kind.nodes} nodes (serendipity) have no "
            "counterpart here: write the mesh with all mid-face nodes, or read it with order=1 "
            "(straight edges)."
        )
    if not np.isfinite(raw.points).all():
        raise MeshError("some node coordinates of the mesh are not finite.")
    used = np.unique(raw.cells)
    new = np.full(len(raw.points), -1, dtype=np.int64)
    new[used] = np.arange(len(used))
    groups = {
        name: {
            dim: kept
            for dim, entities in parts.items()
            if len(kept := (e := new[entities])[(e >= 0).all(axis=1)])
        }
        for name, parts in raw.groups.items()
    }
    return RawMesh(raw.points[used], new[raw.cells], raw.kind, raw.convention, groups)


def _connected(raw: RawMesh, name: str) -> RawMesh:
    """`raw` itself; MeshError where it falls into pieces that share no node."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(raw.points)
    first = np.repeat(raw.cells[:, :1], raw.cells.shape[1] - 1, axis=1)
    graph = coo_matrix(
        (np.ones(first.size, dtype=np.int8), (first.ravel(), raw.cells[:, 1:].ravel())),
        shape=(n, n),
    )
    count, label = connected_components(graph, directed=False)
    if count > 1:
        sizes = np.sort(np.bincount(label[raw.cells[:, 0]], minlength=count))[::-1]
        shown = ", ".join(str(s) for s in sizes[:4]) + (", …" if count > 4 else "")
        raise MeshError(
            f"{name} falls into {count} pieces that share no node ({shown} cells): join them "
            "(in gmsh: BooleanFragments or Coherence) or read the one that is struck."
        )
    return raw
