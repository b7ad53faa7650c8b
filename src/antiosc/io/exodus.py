"""Exodus files (`.e`, `.exo`, `.ex2`, `.g`): classic netCDF by SciPy, netCDF 4 by h5py.

Blocks of elements, node sets and side sets are groups by their names, or as "block 1",
"node set 1" and "side set 1". G. D. Sjaardema et al., *EXODUS II: A Finite Element Data Model*,
SAND92-2137.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError, MissingDependencyError
from antiosc.io.conversion import as_mesh
from antiosc.io.deck import Block, Deck
from antiosc.io.neutral import CORNERS, EDGES, FileMesh, IntArray
from antiosc.io.request import Request

ENDINGS = (".e", ".exo", ".ex2", ".g")
#: First bytes of an HDF5 file.
HDF5 = b"\x89HDF\r\n\x1a\n"
#: Beginnings of the names of elements -> shapes.
SHAPES = {
    **dict.fromkeys(("BAR", "BEAM", "TRUSS", "EDGE", "ROD"), "line"),
    **dict.fromkeys(("TRI", "TRISHELL", "SHELL3"), "triangle"),
    **dict.fromkeys(("QUAD", "SHELL"), "quad"),
    **dict.fromkeys(("TET",), "tetra"),
    **dict.fromkeys(("PYR",), "pyramid"),
    **dict.fromkeys(("WEDGE",), "wedge"),
    **dict.fromkeys(("HEX",), "hexahedron"),
}
#: Shape -> positions of our mid-side nodes in the file, if the order differs.
MIDDLES = {
    "hexahedron": (8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15),
    "wedge": (6, 7, 8, 12, 13, 14, 9, 10, 11),
}
#: Corners of the sides of each shape, in the order of Exodus' numbers of sides.
SIDES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 2, 3), (0, 1, 2)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 3, 4), (0, 1, 2, 3)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 2, 5, 3), (0, 1, 2), (3, 4, 5)),
    "hexahedron": (
        *((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6)),
        *((0, 3, 7, 4), (0, 1, 2, 3), (4, 5, 6, 7)),
    ),
}
FACE = {2: "line", 3: "triangle", 4: "quad"}


def read(ask: Request) -> FileMesh:
    """The mesh of an Exodus file."""
    ask.allow(30 + 1e-5 * Path(ask.path).stat().st_size)
    variables, kinds = _variables(Path(ask.path), ask.name)
    deck = Deck(ask.name, _points(variables, ask.name))
    consecutive = np.arange(1, len(deck.points) + 1)
    deck.labels = _whole(variables.get("node_num_map", consecutive))
    names = _names(variables, "eb", "block")
    for k, number in enumerate(_numbers(variables, "eb"), 1):
        table = variables.get(f"connect{k}")
        if table is not None:
            _add_block(deck, names[k - 1], kinds[k], _whole(table) - 1, number)
    count = deck.n_elements
    numbers = _whole(variables.get("elem_num_map", np.arange(1, count + 1)))
    deck.name_elements(ask.elements, numbers[:count])
    shapes = [(block, row) for block in deck.blocks for row in range(len(block))]
    for k, name in enumerate(_names(variables, "ns", "node set"), 1):
        rows = _whole(variables.get(f"node_ns{k}", np.zeros(0))) - 1
        deck.node_sets[name] = np.unique(_within(rows, len(deck.points), name, ask.name))
    for k, name in enumerate(_names(variables, "ss", "side set"), 1):
        cells = _whole(variables.get(f"elem_ss{k}", np.zeros(0))) - 1
        side = _whole(variables.get(f"side_ss{k}", np.zeros(0))) - 1
        _within(cells, count, name, ask.name)
        _add_sides(deck, name, [shapes[cell] for cell in cells], side.tolist())
    if not count:
        raise MeshError(f"{ask.name} holds no elements that are cells of a mesh.")
    return as_mesh(deck)


def _variables(path: Path, name: str) -> tuple[Mapping[str, Any], dict[int, str]]:
    """(variables of the file, element type of each block by its number)."""
    with path.open("rb") as file:
        beginning = file.read(8)
    if beginning == HDF5:
        try:
            import h5py
        except ImportError as error:
            raise MissingDependencyError(
                f"{name} needs h5py, which is not installed: sudo apt install python3-h5py"
            ) from error
        variables = {}
        types = {}
        with h5py.File(path, "r") as file:
            for key, value in file.items():
                if isinstance(value, h5py.Dataset) and value.shape is not None:
                    variables[key] = value[()]
                    types[key] = value.attrs.get("elem_type", b"")
    elif beginning[:3] == b"CDF" and beginning[3:4] in (b"\x01", b"\x02"):
        from scipy.io import netcdf_file

        with netcdf_file(str(path), mmap=False) as file:
            variables = {key: value[()] for key, value in file.variables.items()}
            types = {k: getattr(v, "elem_type", b"") for k, v in file.variables.items()}
    else:
        raise MeshError(f"{name} does not begin as netCDF: it is no Exodus file, or of netCDF 5.")
    kinds = {}
    for key, kind in types.items():
        if key.startswith("connect") and key[7:].isdigit():
            text = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
            kinds[int(key[7:])] = text.strip("\0 ").upper()
    return variables, kinds


def _points(variables: Mapping[str, Any], name: str) -> Array:
    """Coordinates of the nodes."""
    if "coord" in variables:
        rows = np.atleast_2d(variables["coord"])
    else:
        rows = np.array([variables[f"coord{c}"] for c in "xyz" if f"coord{c}" in variables])
    if not rows.size:
        raise MeshError(f"{name} has no nodes (coordx, coordy, coordz).")
    points = np.zeros((rows.shape[1], 3))
    points[:, : len(rows)] = rows.T
    return points


def _whole(values: Any) -> IntArray:
    """Values as 64-bit integers."""
    return np.asarray(values, dtype=np.int64)


def _numbers(variables: Mapping[str, Any], kind: str) -> list[int]:
    """Numbers of blocks (eb), node sets (ns) or side sets (ss)."""
    return [int(number) for number in np.ravel(variables.get(f"{kind}_prop1", []))]


def _names(variables: Mapping[str, Any], kind: str, what: str) -> list[str]:
    """The names of blocks or sets; unnamed ones get their kind and number."""
    numbers = _numbers(variables, kind)
    rows = np.asarray(variables.get(f"{kind}_names", np.zeros((0, 0), dtype="S1")))
    names = []
    for k, number in enumerate(numbers):
        letters = rows[k].astype("S1").tobytes() if k < len(rows) else b""
        names.append(letters.split(b"\0")[0].decode("latin-1").strip() or f"{what} {number}")
    return names


def _within(rows: IntArray, most: int, what: str, name: str) -> IntArray:
    """The rows; MeshError unless all are from 0 to `most` − 1."""
    if rows.size and not (rows.min() >= 0 and rows.max() < most):
        raise MeshError(f"{what} of {name} names an entity that the file does not hold.")
    return rows


def _add_block(deck: Deck, name: str, kind: str, table: IntArray, number: int) -> None:
    """Add a block of elements, also as a group; elements that are not cells are counted."""
    shape = next(
        (SHAPES[start] for start in sorted(SHAPES, key=len)[::-1] if kind.startswith(start)), ""
    )
    width = table.shape[1] if table.ndim == 2 else 0
    if shape == "quad" and width in (3, 6):
        shape = "triangle"
    if not shape or width < CORNERS[shape]:
        deck.left[kind or f"block {number}"] += len(table)
        return
    _within(table, len(deck.points), f"block {number}", deck.name)
    corners = CORNERS[shape]
    edges = len(EDGES[shape])
    mids = table[:, :0]
    if width >= corners + edges:
        mids = table[:, MIDDLES.get(shape, tuple(range(corners, corners + edges)))]
    start = deck.n_elements
    deck.blocks.append(Block(shape, kind, table[:, :corners], mids, table[:, :0]))
    deck.element_sets[name] = np.arange(start, deck.n_elements)


def _add_sides(deck: Deck, name: str, cells: list[tuple[Block, int]], sides: list[int]) -> None:
    """Sides of elements as elements of lower dimension, in a group."""
    by_width: dict[int, list[IntArray]] = {}
    for corners in _corners(deck.name, name, cells, sides):
        by_width.setdefault(len(corners), []).append(corners)
    rows = []
    for width, members in by_width.items():
        table = np.array(members)
        start = deck.n_elements
        no_middles = table[:, :0]
        deck.blocks.append(Block(FACE[width], "side", table, no_middles, no_middles))
        rows.append(np.arange(start, deck.n_elements))
    if rows:
        deck.element_sets[name] = np.concatenate(rows)


def _corners(
    file: str, name: str, cells: list[tuple[Block, int]], sides: list[int]
) -> Iterator[IntArray]:
    """Yield the corners of element sides; the first two sides of a shell are the element itself."""
    for (block, row), side in zip(cells, sides, strict=True):
        shell = "SHELL" in block.type
        if shell and side < 2:
            yield block.corners[row]
            continue
        if block.shape == "line":  # ends of lines are nodes, of which no side is made
            continue
        side_nodes = SIDES.get(block.shape, ())
        number = side - 2 * shell
        if not 0 <= number < len(side_nodes):
            raise MeshError(f"{name} of {file} names side {side + 1} of a {block.type}.")
        yield block.corners[row][list(side_nodes[number])]
