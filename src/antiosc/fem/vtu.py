"""Frames of one mesh as `.vtu` files: the mesh is encoded once, a field in each frame.

VTK's XML format for unstructured grids, version 0.1: arrays in base64, each a row of blocks of zlib
with their sizes before them. The mesh is compressed; the digits of a field hardly shrink, so that
its blocks are stored as they are.
"""

from __future__ import annotations

import base64
import sys
import zlib
from collections.abc import Mapping, Sequence
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from antiosc._types import Array, IntArray

#: Bytes of an array that are compressed at once.
BYTES_AT_ONCE = 1 << 15
#: VTK's numbers of the kinds of cells, by meshio's names.
TYPES = {
    **{"vertex": 1, "line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12},
    **{"line3": 21, "triangle6": 22, "tetra10": 24, "quad9": 28, "hexahedron27": 29},
}
#: VTK's names of the types of numbers.
NUMBERS = {"float64": "Float64", "int64": "Int64", "uint8": "UInt8"}


class Frames:
    """Points (n, 3) in m and cells, in VTK's node order, with fields.

    `cells`: (kind, (m, nodes)) of each kind.
    """

    def __init__(self, points: Array, cells: Sequence[tuple[str, IntArray]]) -> None:
        order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
        nodes = np.concatenate([np.full(len(c), c.shape[1], dtype=np.int64) for _, c in cells])
        types = [np.full(len(c), TYPES[kind], dtype=np.uint8) for kind, c in cells]
        corners = np.concatenate([c.astype(np.int64).ravel() for _, c in cells])
        parts = [
            '<?xml version="1.0"?>\n'
            f'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="{order}" '
            'compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(nodes)}">\n<Points>\n',
            _element("Points", np.asarray(points, dtype=float)),
            "</Points>\n<Cells>\n",
            _element("connectivity", corners),
            _element("offsets", np.cumsum(nodes)),
            _element("types", np.concatenate(types)),
            "</Cells>\n<PointData>\n",
        ]
        self._before = "".join(parts).encode()

    def content(self, fields: Mapping[str, Array]) -> bytes:
        """A file of the mesh with fields, numbers (n,) or vectors (n, 3), at its points."""
        own = "".join(
            _element(escape(name, {'"': "&quot;"}), np.asarray(field, dtype=float), level=0)
            for name, field in fields.items()
        )
        end = "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
        return b"".join([self._before, own.encode(), end.encode()])


def _element(name: str, values: NDArray[Any], level: int = -1) -> str:
    """An array of numbers or of vectors as a `DataArray`, at a level of zlib's."""
    content = values.tobytes()
    blocks = [
        zlib.compress(content[start : start + BYTES_AT_ONCE], level)
        for start in range(0, len(content), BYTES_AT_ONCE)
    ]
    last = len(content) - BYTES_AT_ONCE * (len(blocks) - 1)
    head = np.array([len(blocks), BYTES_AT_ONCE, last, *map(len, blocks)], dtype=np.uint32)
    text = base64.b64encode(head.tobytes()) + base64.b64encode(b"".join(blocks))
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    return (
        f'<DataArray type="{NUMBERS[values.dtype.name]}" Name="{name}"{components} '
        f'format="binary">\n{text.decode()}\n</DataArray>\n'
    )
