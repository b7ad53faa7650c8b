"""Reading files with meshes and geometries into plain arrays.

`read` reads one file in a separate process (`isolation`, `child`), and selects the cells of one
kind and of the highest dimension as the mesh. Cells of lower dimension may be faces, edges and
points of the mesh; a remark reports their number. Cells that are not on the mesh may be beams and
shells: the file is then refused unless the caller selects the cells.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from antiosc.base.errors import InputError, MeshError, PiecesError, UnmeshableError
from antiosc.base.texts import piece_text, printable
from antiosc.io.by_gmsh import (
    CAD_ENDINGS,
    ENDINGS_WITH_UNIT,
    GEOMETRY_ENDINGS,
    SCRIPT_ENDINGS,
    SizeField,
)
from antiosc.io.facets import FTETWILD_PHRASE, SURFACE_ENDINGS
from antiosc.io.isolation import RETRY_ELEMENTS_PER_TURN, Refinement, read_isolated
from antiosc.io.mesh_files import deck_endings, is_deck
from antiosc.io.neutral import (
    CELL_KINDS,
    EDGES_OF_KIND,
    FACETS,
    FileMesh,
    IntArray,
    Joints,
    Model,
    MotionTerm,
    Piece,
    RawMesh,
    UnitSystem,
    connected_pieces,
    outer_facets,
    row_hashes,
)

#: Dimension, group or groups whose cells make the mesh.
CellSelection = int | str | Sequence[str] | None
RowsByKind = dict[str, IntArray]

_NOUNS = {1: "lines", 2: "faces", 3: "volumes"}
#: Words of what is told of elements that are not those of the mesh.
READ_AS_SIDES_PHRASE, LEFT_OUT_PHRASE = "are read as sides, not as elements", "are left out"
#: Words of remarks on how a mesh was made that has the shape of its file.
CURVATURE_PHRASE = "is meshed with elements that follow the curvature"
REMESHING_PHRASES = CURVATURE_PHRASE, FTETWILD_PHRASE
#: Share of the largest piece by which the volumes of two must differ to rank them.
DISTINCT_VOLUME = 0.01
#: Largest coordinate of a part: squares and volumes of it are numbers still.
LARGEST_COORDINATE = 1e30


def selected_mesh(mesh: FileMesh, wanted: CellSelection, order: int | None, name: str) -> RawMesh:
    """The `wanted` cells of a file as a mesh; default: the cells of the highest dimension."""
    dims = {label: CELL_KINDS[label].dim for label, block in mesh.cells.items() if len(block)}
    if not any(dims.values()):
        found = ", ".join(sorted(dims)) or "none"
        raise MeshError(f"{name} contains no cells: no lines, faces or volumes (found: {found}).")

    # the rows of the cells
    rows = _all_rows(mesh) if wanted is None else _selected_rows(mesh, wanted, name)
    top = max(dims[label] for label in rows)
    grouped = _rows_in_groups(mesh, [label for label in dims if dims[label] == top])
    aids = wanted is None and mesh.has_construction_aids and bool(grouped)
    if aids:  # as gmsh itself writes files
        rows = grouped
    rows = {label: r for label, r in rows.items() if dims[label] == top and len(r)}
    if len(rows) > 1:
        counts = ", ".join(f"{len(r)} {label}" for label, r in sorted(rows.items()))
        raise MeshError(f"{name} mixes cell kinds ({counts}), of which a mesh has one.")
    ((label, cell_rows),) = rows.items()

    # the mesh
    raw = RawMesh(mesh.points, mesh.cells[label][cell_rows], CELL_KINDS[label])
    raw.model, raw.pieces = mesh.model, mesh.pieces
    if len(mesh.labels):
        without = np.full(len(mesh.points) - len(mesh.labels), -1, dtype=np.int64)
        raw.labels = np.concatenate([mesh.labels, without])
    others = _remarks_on_unused_elements(mesh, raw, aids, name) if wanted is None else ()
    raw.remarks = [*mesh.remarks, *others]

    # its groups
    for group, parts in mesh.groups.items():
        for kind in (kind for kind in parts if dims[kind] <= top):
            corners = mesh.cells[kind][parts[kind], : CELL_KINDS[kind].vertices]
            _add_to_group(raw, group, dims[kind], corners)
    if mesh.node_sets:
        _add_node_sets(raw, mesh.node_sets)
    raw.groups.update(mesh.fixed)

    if order == 1 and raw.kind.order == 2:  # without the mid-side nodes
        linear = next(k for k in CELL_KINDS.values() if k.shape == raw.kind.shape and k.order == 1)
        raw = replace(raw, cells=raw.cells[:, : linear.nodes], kind=linear)
    return without_unused_nodes(raw)


def _all_rows(mesh: FileMesh) -> RowsByKind:
    """Rows of all cells by kind."""
    return {label: np.arange(len(block)) for label, block in mesh.cells.items() if len(block)}


def _selected_rows(mesh: FileMesh, wanted: CellSelection, name: str) -> RowsByKind:
    """Rows, by kind, of the cells that the argument `cells` of `read_mesh` selects."""
    if isinstance(wanted, int):
        rows = {k: r for k, r in _all_rows(mesh).items() if CELL_KINDS[k].dim == wanted}
        if not rows:
            raise InputError(f"{name} contains no cells of dimension {wanted}.")
        return rows

    names = [wanted] if isinstance(wanted, str) else list(wanted or ())
    of_cells = sorted(
        group
        for group, parts in mesh.groups.items()
        if any(CELL_KINDS[k].dim for k, rows in parts.items() if len(rows))
    )
    for group in names:
        if group not in of_cells:
            known = ", ".join(map(repr, of_cells[:20])) or "none"
            raise InputError(f"{name} has no group of cells {group!r}; it has: {known}.")
    return _union([mesh.groups[group] for group in names])


def _rows_in_groups(mesh: FileMesh, labels: Sequence[str]) -> RowsByKind:
    """Rows by kind of cells of the kinds `labels` that belong to at least one group."""
    parts = [{k: r for k, r in g.items() if k in labels} for g in mesh.groups.values()]
    return _union(parts)


def _union(parts: Sequence[RowsByKind]) -> RowsByKind:
    """Union of several selections of rows by kind."""
    labels = dict.fromkeys(label for part in parts for label, rows in part.items() if len(rows))
    return {k: np.unique(np.concatenate([p[k] for p in parts if k in p])) for k in labels}


def _remarks_on_unused_elements(
    mesh: FileMesh, raw: RawMesh, aids: bool, name: str
) -> Iterator[str]:
    """Yield remarks on elements outside the mesh; MeshError if they may belong to the part."""
    made_here = mesh.of_gmsh and not name.lower().endswith(".msh")
    top = raw.kind.dim
    grouped = _rows_in_groups(mesh, list(mesh.cells))

    if aids and not made_here:
        counts = {label: len(block) for label, block in mesh.cells.items() if CELL_KINDS[label].dim}
        ungrouped = {label: n - len(grouped.get(label, ())) for label, n in counts.items()}
        if any(ungrouped.values()):
            counted = _counts_text(ungrouped)
            yield f"{name}: {counted} in no group {LEFT_OUT_PHRASE}, as gmsh's construction aids."

    loose: dict[str, int] = {}
    on_sides: dict[str, int] = {}
    for label, block in mesh.cells.items():
        kind = CELL_KINDS[label]
        if not 0 < kind.dim < top or not len(block):
            continue
        in_group = np.isin(np.arange(len(block)), grouped.get(label, []))
        sides = (FACETS if kind.dim == top - 1 else EDGES_OF_KIND)[raw.kind.shape]
        corners = np.vstack([raw.cells[:, list(side)] for side in sides])
        on_mesh = np.isin(row_hashes(block[:, : kind.vertices]), row_hashes(corners))

        taken = in_group | (not aids)
        loose[label] = int((taken & ~on_mesh).sum())
        told = taken & on_mesh & ~(in_group & mesh.of_gmsh)  # gmsh's groups hold sides by nature
        on_sides[label] = int(told.sum())

    if any(loose.values()) and name.lower().endswith(CAD_ENDINGS):
        yield (
            f"{name}: {_counts_text(loose)} that are not on its {_NOUNS[top]} {LEFT_OUT_PHRASE}, "
            "as sketches, axes or construction planes."
        )
    elif any(loose.values()):
        raise MeshError(
            f"{name} holds {len(raw.cells)} {_NOUNS[top]} and besides {_counts_text(loose)} that "
            f"are not sides of them: say which elements make the mesh by cells, as {top} (their "
            "dimension) or the name of a group; read_model reads a deck with all of them."
        )

    if any(on_sides.values()) and not made_here and raw.model is None:
        yield (
            f"{name}: {_counts_text(on_sides)} on the sides of its {_NOUNS[top]} "
            f"{READ_AS_SIDES_PHRASE}."
        )


def _counts_text(counts: Mapping[str, int]) -> str:
    """Numbers of elements by kind as text."""
    return " and ".join(f"{n} {_NOUNS[CELL_KINDS[k].dim]} ({k})" for k, n in counts.items() if n)


def row_positions(rows: NDArray[Any], among: NDArray[Any]) -> IntArray:
    """Index (n,) of each row in `among`, independent of the order of its entries; -1 if absent."""
    if not len(among):
        return np.full(len(rows), -1)
    code, row_keys = row_hashes(among), row_hashes(rows)
    order = np.argsort(code)
    position = np.minimum(np.searchsorted(code[order], row_keys), len(code) - 1)
    return np.where(code[order][position] == row_keys, order[position], -1)


def _add_to_group(raw: RawMesh, group: str, dim: int, entities: IntArray) -> None:
    """Add entities (n, vertices) of dimension `dim` to a group."""
    parts = raw.groups.setdefault(group, {})
    parts[dim] = np.vstack([parts[dim], entities]) if dim in parts else entities


def _add_node_sets(raw: RawMesh, node_sets: RowsByKind) -> None:
    """Add node sets as groups: facets with all nodes in the set, and remaining vertices."""
    outer = raw.cells[:0]
    if raw.kind.dim > 1:
        outer = outer_facets(raw.cells, FACETS[raw.kind.shape])
    is_vertex = np.zeros(len(raw.points), dtype=bool)
    is_vertex[raw.cells[:, : raw.kind.vertices]] = True
    for group, nodes in node_sets.items():
        in_set = np.zeros(len(raw.points), dtype=bool)
        in_set[nodes] = True
        spanned = outer[in_set[outer].all(axis=1)]
        if len(spanned):
            _add_to_group(raw, group, raw.kind.dim - 1, spanned)
        in_set[spanned] = False
        loose = np.flatnonzero(in_set & is_vertex)
        if len(loose):
            _add_to_group(raw, group, 0, loose[:, None])


def without_unused_nodes(raw: RawMesh) -> RawMesh:
    """The mesh without unused nodes and empty groups."""
    used_nodes = np.unique(raw.cells)
    points = raw.points[used_nodes]
    if not np.isfinite(points).all():
        raise MeshError("some node coordinates of the mesh are not finite.")
    new = np.full(len(raw.points), -1, dtype=np.int64)
    new[used_nodes] = np.arange(len(used_nodes))
    groups: dict[str, dict[int, IntArray]] = {name: {} for name in raw.groups}
    for name, parts in raw.groups.items():
        for dim, entities in parts.items():
            rows = new[entities]
            if (rows >= 0).all(axis=1).any():
                groups[name][dim] = rows[(rows >= 0).all(axis=1)]
    numbers = raw.numbers[used_nodes] if len(raw.numbers) else used_nodes
    labels = raw.labels[used_nodes] if len(raw.labels) else raw.labels
    cells = new[raw.cells]
    return replace(raw, points=points, cells=cells, groups=groups, numbers=numbers, labels=labels)


def read(
    path: Path,
    size: float | None = None,
    order: int | None = None,
    refine: Sequence[Refinement] = (),
    *,
    cells: CellSelection = None,
    piece: int | None = None,
    timeout: float | None = None,
    unit: UnitSystem | None = None,
    merge: float | None = None,
    sizes: SizeField | None = None,
    sound: Callable[[RawMesh], RawMesh] = lambda raw: raw,
    **options: Any,
) -> RawMesh:
    """Read or mesh a file (`antiosc.read_mesh`); if gmsh cannot mesh it, try a second way."""
    name = printable(path.name)
    suffix = path.suffix.lower()
    solid = bool(options.get("solid"))
    by_reader = (suffix in CAD_ENDINGS or solid) and not options.get("fragments")
    options |= {
        "piece": piece if by_reader else None,
        "size": None if size is None else float(size),
        "order": order,
        "refine": [([float(c) for c in x], *map(float, sizes)) for x, *sizes in refine],
        "sizes": None if sizes is None else vars(sizes),
    }

    def attempt(**how: Any) -> RawMesh:
        """Read with the further options `how` of the request."""
        content = file_content(path, timeout, unit, merge, **options, **how)
        raw = selected_mesh(content, cells, order, name)
        if piece is not None and not (by_reader and raw.kind.dim == 3):
            raw = one_piece(raw, piece, name)
        return sound(raw)

    try:
        return attempt()
    except UnmeshableError as error:
        if not (suffix in GEOMETRY_ENDINGS or solid) or merge is not None:
            raise
        fault = str(error).rstrip(".")

    remedy = f"repair {name} in the program that wrote it, or mesh it there and give the mesh"
    if solid and not find_spec("pytetwild"):
        raise UnmeshableError(
            f'{fault}: {remedy}; pytetwild fills it here (pip install "pytetwild<0.3").'
        )

    try:
        raw = attempt(**({"by_ftetwild": True} if solid else {"around": RETRY_ELEMENTS_PER_TURN}))
    except UnmeshableError as error:
        raise UnmeshableError(
            f"{fault}; a second way failed too: {remedy}, or give another size."
        ) from error
    how = "" if solid else f"{name} {CURVATURE_PHRASE}, since it cannot be meshed otherwise: "
    raw.remarks = [*raw.remarks, f"{how}{fault}."]
    return raw


# --- Pieces ---------------------------------------------------------------------------------------


def piece_of_cells(raw: RawMesh) -> IntArray:
    """Number (cells,) of the connected piece of each cell; 0 is the largest piece."""
    label = connected_pieces([raw.cells], len(raw.points))[raw.cells[:, 0]]
    pieces, piece_index = np.unique(label, return_inverse=True)
    piece_index = piece_index.ravel()
    if len(pieces) == 1:
        return piece_index

    # length, area or volume of cells up to a common factor, by the corners' covariance
    x = raw.points[raw.cells[:, : raw.kind.vertices]]
    x = x - x.mean(axis=1, keepdims=True)
    squares = np.linalg.eigvalsh(x.transpose(0, 2, 1) @ x)[:, -raw.kind.dim :]
    size = np.bincount(piece_index, np.sqrt(np.maximum(squares, 0.0)).prod(axis=1))
    steps = np.rint(size / (DISTINCT_VOLUME * size.max()))
    rank = np.empty(len(pieces), dtype=np.int64)
    rank[np.argsort(-steps, kind="stable")] = np.arange(len(pieces))
    return rank[piece_index]


def one_piece(raw: RawMesh, piece: int, name: str) -> RawMesh:
    """The mesh of the `piece`-th largest connected piece, from 1."""
    label = piece_of_cells(raw)
    count = int(label.max()) + 1
    if piece > count:
        raise MeshError(f"{name} has {count} pieces that share no node; there is no piece {piece}.")
    of_piece = label == piece - 1
    raw = without_unused_nodes(replace(raw, cells=raw.cells[of_piece]))
    raw.groups = {name: parts for name, parts in raw.groups.items() if parts}
    if count > 1:
        raw.remarks = [*raw.remarks, piece_text(name, piece, count)]
    return raw


def pieces_of(raw: RawMesh) -> list[Piece]:
    """The connected pieces, by descending size."""
    label = piece_of_cells(raw)
    _, first = np.unique(label, return_index=True)
    corners = raw.cells[first, : raw.kind.vertices]
    names: dict[int, str] = {}
    for name, parts in raw.groups.items():
        inside = row_positions(corners, parts.get(raw.kind.dim, first[:0]))
        if (inside >= 0).sum() == 1:  # others are of several pieces
            names.setdefault(int(inside.argmax()), name)

    order = np.argsort(label, kind="stable")
    cells = np.split(raw.cells[order], np.cumsum(np.bincount(label))[:-1])
    nodes = enumerate(raw.points[part].reshape(-1, raw.points.shape[1]) for part in cells)
    return [Piece(names.get(k, ""), x.min(axis=0), x.max(axis=0)) for k, x in nodes]


def described_pieces(pieces: Sequence[Piece], most: int = 6) -> str:
    """Rank, name and box size of the first `most` pieces as text."""
    words = []
    for k, piece in enumerate(pieces[:most], 1):
        size = " × ".join(f"{1e3 * c:.3g}" for c in piece.high - piece.low)
        words.append(f"{k}{f' {piece.name!r}' if piece.name else ''}: {size} mm")
    return "; ".join(words) + "; …" * (len(pieces) > most)


def pieces_error(raw: RawMesh, what: str, remedy: str) -> PiecesError:
    """The error for a mesh of several connected pieces, with `what` and `remedy` in words."""
    pieces = pieces_of(raw)
    error = PiecesError(f"{what} ({described_pieces(pieces)}): {remedy}")
    error.pieces = pieces
    return error


# --- Contents -------------------------------------------------------------------------------------


def read_outline(path: Path, **options: Any) -> FileMesh:
    """Groups of a geometry and, as lines, the diagonals of its bounding boxes; without meshing."""
    return file_content(path, None, None, None, outline=True, **options)


def file_content(
    path: Path, timeout: float | None, unit: UnitSystem | None, merge: float | None, **options: Any
) -> FileMesh:
    """A file's content [m], nodes within `merge` [m] merged; `options`: fields of `Request`."""
    name, suffix = path.name, path.suffix.lower()
    solid = options.get("solid", False)
    geometry = suffix in GEOMETRY_ENDINGS or solid

    def refuse(fault: object, text: str) -> None:
        """MeshError with the file's name and `text`, if `fault` is true."""
        if fault:
            raise MeshError(f"{name} {text}.")

    no_surface, no_cad = suffix not in SURFACE_ENDINGS, suffix not in CAD_ENDINGS
    refuse(solid and no_surface, "is no surface of triangles (.stl, .obj, .ply), as solid fills")
    joined = options.get("fragments") and no_cad
    refuse(joined, "is no file of CAD (.step, .brep, .iges), whose solids fragments joins")
    meshed = geometry and suffix not in SCRIPT_ENDINGS and not options.get("outline")
    no_size = meshed and options.get("size") is None
    refuse(no_size, "is a geometry, not a mesh: give the element size in metres, as 5e-3")
    stated = unit is not None and suffix in ENDINGS_WITH_UNIT
    refuse(stated, "states its own unit of length: leave unit out")
    unmerged = merge is not None and geometry and no_cad
    refuse(unmerged, "is a geometry: merge applies to finished meshes and decks")
    if options.get("model") is not None and not is_deck(path):
        endings = ", ".join(deck_endings())
        refuse(True, f"is no deck ({endings}) for read_model: use read_mesh and Structure")

    unit = unit or UnitSystem()
    options["unit"] = [unit.length, unit.force]
    timeout = None if timeout is None else float(timeout)  # for JSON, as the size
    content = read_isolated(path, geometry=geometry, options=options, timeout=timeout)
    farthest = float(np.abs(content.points).max(initial=0.0))
    too_far = f"has coordinates up to {farthest:.3g}, more than {LARGEST_COORDINATE:g}"
    damaged = f"{too_far}: it is damaged; write it anew in the program that made it"
    refuse(not farthest < LARGEST_COORDINATE, damaged)

    content.points = content.points * unit.length
    content.pieces = [piece.scaled(unit.length) for piece in content.pieces]
    return content if merge is None else with_merged_nodes(content, merge)


# --- Coincident nodes -----------------------------------------------------------------------------


def with_merged_nodes(mesh: FileMesh, distance: float) -> FileMesh:
    """The mesh with nodes merged that are at most `distance` [m] apart."""
    n = len(mesh.points)
    pairs = cKDTree(mesh.points).query_pairs(distance, output_type="ndarray")
    if mesh.model and mesh.model["apart"]:  # the released ends of beams
        pairs = pairs[~np.isin(pairs, mesh.model["apart"]).any(axis=1)]
    label = connected_pieces([pairs], n)
    _, first = np.unique(label, return_index=True)
    remaining = np.sort(first)  # in the file's order
    new = np.empty(len(first), dtype=np.int64)
    new[label[remaining]] = np.arange(len(remaining))
    row = new[label]

    return replace(
        mesh,
        model=mesh.model and _renumbered(mesh.model, row),
        points=mesh.points[remaining],
        labels=mesh.labels[remaining[remaining < len(mesh.labels)]],
        cells={kind: row[block] for kind, block in mesh.cells.items()},
        node_sets={name: np.unique(row[nodes]) for name, nodes in mesh.node_sets.items()},
        fixed={n: {d: row[e] for d, e in parts.items()} for n, parts in mesh.fixed.items()},
    )


def _renumbered(model: Model, row: IntArray) -> Model:
    """The model with node n renumbered to row[n]; negative numbers (free points) stay."""
    joints = model["joints"]

    def new(terms: list[MotionTerm]) -> list[MotionTerm]:
        """The terms with new node numbers."""
        return [(int(row[n]) if n >= 0 else n, motion, c) for n, motion, c in terms]

    renumbered: Joints = {
        "equations": [new(terms) for terms in joints["equations"]],
        "springs": [(new(terms), value) for terms, value in joints["springs"]],
        "dampers": [(new(terms), value) for terms, value in joints["dampers"]],
        "masses": [([*map(new, rows)], M, mass) for rows, M, mass in joints["masses"]],
        "points": joints["points"],
        "among": [
            (int(row[n]), [(int(row[m]), w) for m, w in weighted_nodes])
            for n, weighted_nodes in joints.get("among", [])
        ],
    }
    return {**model, "joints": renumbered}
