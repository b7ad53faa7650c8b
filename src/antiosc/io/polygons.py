"""Files of polygons by their points and faces alone: OBJ, OFF, ASCII STL and binary PLY.

meshio refuses OBJ files whose textures have other corners than their faces, as most have, OFF files
of polygons, and binary PLY files whose faces have colours.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError
from antiosc.io.deck import DeckPlace, real_number, whole_number
from antiosc.io.neutral import IntArray

#: Corner of a facet of an ASCII STL file.
VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
#: The word at the beginning of an OFF file, which the numbers may follow without a space.
OFF_HEADER = re.compile(r"^\s*(ST)?C?N?4?N?OFF", re.IGNORECASE)
#: Bytes in which an ASCII STL file names a facet.
BEGINNING = 4096
#: Scalar types of PLY files (G. Turk, "The PLY Polygon File Format", 1994) as NumPy's.
PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
#: Byte orders of binary PLY files; fields of the corners of a face.
PLY_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
SIZE = " size"
CORNERS = "vertex_indices"
#: Lists of a triangle -> their entries: its corners by either name, two coordinates in the picture
#: of its texture for each corner.
INDICES = ("vertex_indices", "vertex_index")
LENGTHS = {"": 3, **dict.fromkeys(INDICES, 3), "texcoord": 6}
#: Areas below this share of a polygon's are rounding errors.
ROUNDING = 1e-9


def triangles_of(content: bytes, name: str) -> tuple[Array, IntArray] | None:
    """(points (n, 3), triangles (t, 3)) of an OBJ, OFF or PLY file; None for other formats.

    Raises
    ------
    MeshError
        A line that is none of the format, or a corner that is not there.
    """
    if name.lower().endswith(".obj"):
        return _of_obj(content.decode("latin-1").splitlines(), name)
    if name.lower().endswith(".off"):
        return _of_off(content.decode("latin-1").splitlines(), name)
    if name.lower().endswith(".stl") and b"\0" not in content[:BEGINNING]:
        return _of_stl(content, name)
    if name.lower().endswith(".ply"):
        return _of_ply(content, name)
    return None


def _of_obj(lines: Sequence[str], name: str) -> tuple[Array, IntArray]:
    """Triangles of an OBJ file; a line that ends with a backslash continues on the next one."""
    points: list[list[float]] = []
    faces: list[list[int]] = []
    start = ""
    for number, line in enumerate(lines, 1):
        text = start + line.split("#")[0].rstrip()
        start = f"{text[:-1]} " if text.endswith("\\") else ""
        words = [] if start else text.split()
        place = DeckPlace(name, number)
        if words[:1] == ["v"]:
            place.needs(len(words) > 3, "a point (v) needs three coordinates.")
            points.append([real_number(word, place) for word in words[1:4]])
        elif words[:1] == ["f"]:
            numbers = [whole_number(word.split("/")[0], place) for word in words[1:]]
            faces.append([c - 1 if c > 0 else len(points) + c for c in numbers])
    return _divided(points, faces, name)


def _divided(
    points: Sequence[Sequence[float]], polygons: Sequence[Sequence[int]], name: str
) -> tuple[Array, IntArray]:
    """Points and triangles as arrays; polygons are divided from their first corner if they are
    convex there, else by ears.
    """
    fans = [[(p[0], b, c) for b, c in pairwise(p[1:])] for p in polygons]
    owner = np.repeat(np.arange(len(fans)), [len(fan) for fan in fans])
    x, triangles = _checked(points, [corners for fan in fans for corners in fan], name)
    a, b, c = x[triangles].transpose(1, 0, 2)
    area = np.cross(b - a, c - a)
    normal = np.stack([np.bincount(owner, part, len(fans)) for part in area.T], axis=1)
    reversed_triangles = np.einsum("ni,ni->n", area, normal[owner]) < 0
    for k in np.unique(owner[reversed_triangles]):
        triangles[owner == k] = _ears(x, polygons[k], normal[k])
    return x, triangles


def _ears(x: Array, polygon: Sequence[int], normal: Array) -> list[list[int]]:
    """Triangles of a polygon with re-entrant corners: corners are cut off one by one.

    A corner is cut off if its triangle has an area along `normal` and no other corner in it.
    """
    rest = list(polygon)
    ears = []
    while len(rest) > 3:
        turns = (rest[k:] + rest[:k] for k in range(len(rest)))
        first = next((turn for turn in turns if _is_ear(x[turn], normal)), rest)
        ears.append(first[:3])
        rest = [first[0], *first[2:]]
    return [*ears, rest]


def _is_ear(x: Array, normal: Array) -> bool:
    """Whether the first three of the corners x (n, 3) of a polygon are a triangle without others.

    A corner on a side of the triangle counts, one at the place of its corners does not.
    """
    a, b, c = x[:3]
    least = ROUNDING * (normal @ normal)
    if np.cross(b - a, c - a) @ normal <= least:
        return False
    others = x[3:][(x[3:, None] != x[:3]).any(axis=2).all(axis=1)]
    sides = ((a, b), (b, c), (c, a))
    heights = [np.cross(end - start, others - start) @ normal for start, end in sides]
    return not (np.array(heights) >= -least).all(axis=0).any()


def _checked(
    points: Sequence[Sequence[float]] | Array, faces: Sequence[Sequence[int]] | IntArray, name: str
) -> tuple[Array, IntArray]:
    """Points and triangles as arrays; MeshError for corners without a point."""
    table = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(table) and not 0 <= table.min() <= table.max() < len(points):
        raise MeshError(f"{name} has faces on points that it does not hold.")
    return np.array(points, dtype=float).reshape(-1, 3), table


def _of_off(lines: Sequence[str], name: str) -> tuple[Array, IntArray]:
    """Triangles of an OFF file: header, numbers of points and faces, points, faces with sizes."""
    rows: list[tuple[list[str], DeckPlace]] = []
    for number, line in enumerate(lines, 1):
        words = OFF_HEADER.sub("", line.split("#")[0]).split()
        if words:
            rows.append((words, DeckPlace(name, number)))
    if not rows or len(rows[0][0]) < 2:
        raise MeshError(f"{name} does not give its numbers of points and faces: it is no OFF file.")
    count, faces = (whole_number(word, rows[0][1]) for word in rows[0][0][:2])
    points = [[real_number(word, place) for word in words[:3]] for words, place in rows[1:][:count]]
    table = []
    for words, place in rows[1 + count :][:faces]:
        table.append([whole_number(word, place) for word in words[1 : 1 + int(words[0])]])
    return _divided(points, table, name)


def _of_stl(content: bytes, name: str) -> tuple[Array, IntArray]:
    corners = VERTEX.findall(content)
    try:
        points = np.array(corners, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"{name} has a corner (vertex) that is no number: {error}.") from error
    if len(points) % 3:
        raise MeshError(f"{name} has {len(points)} corners, not three a triangle: it is cut off.")
    return points, np.arange(len(points)).reshape(-1, 3)


def _of_ply(content: bytes, name: str) -> tuple[Array, IntArray] | None:
    """(points, triangles) of a PLY file with polygons in text or triangles in binary; None for
    others.
    """
    content = content.replace(b"end_header\r\n", b"end_header\n", 1)
    header_bytes, _, data = content.partition(b"end_header\n")
    header = [line.split() for line in header_bytes.decode("latin-1").splitlines()]
    if ["format", "ascii"] in [words[:2] for words in header]:
        return _of_ply_text(header, data.decode("latin-1").splitlines(), name)
    try:
        records = _ply_records(header)
        (first, (count, vertex)), (second, (number, face)) = list(records.items())[:2]
        points = np.frombuffer(data, vertex, count)
        faces = np.frombuffer(data, face, number, count * vertex.itemsize)
        x = np.stack([points[axis] for axis in "xyz"], axis=1).astype(float)
        sizes = {name: faces[name] for name in faces.dtype.names or () if name.endswith(SIZE)}
        corners = faces[CORNERS]
    except (IndexError, KeyError, ValueError):
        return None
    if (first, second) != ("vertex", "face"):
        return None
    if any((found != LENGTHS[name.removesuffix(SIZE)]).any() for name, found in sizes.items()):
        return None
    return _checked(x, corners.astype(np.int64), name)


def _of_ply_text(
    header: Sequence[Sequence[str]], lines: Sequence[str], name: str
) -> tuple[Array, IntArray] | None:
    """Polygons of a text file, a line for each point and face; None if other elements are first."""
    first_line = 1 + sum(words[:1] != ["end_header"] for words in header)
    rows = [
        (words, DeckPlace(name, number))
        for number, line in enumerate(lines, first_line + 1)
        if (words := line.split())
    ]
    elements = [(words[1], int(words[2])) for words in header if words[:1] == ["element"]]
    fields = [words[-1] for words in header if words[:1] == ["property"]]
    if [kind for kind, _ in elements[:2]] != ["vertex", "face"] or not {*"xyz"} <= {*fields}:
        return None
    columns = [fields.index(axis) for axis in "xyz"]
    count, faces = (number for _, number in elements[:2])
    points = []
    table = []
    for words, place in rows[:count]:
        place.needs(len(words) > max(columns), "a point needs three coordinates.")
        points.append([real_number(words[column], place) for column in columns])
    for words, place in rows[count : count + faces]:
        size = whole_number(words[0], place)
        place.needs(2 < size < len(words), f"a face of {size} corners has {len(words) - 1}.")
        table.append([whole_number(word, place) for word in words[1 : 1 + size]])
    if len(rows) < count + faces:
        raise MeshError(
            f"{name} has {len(rows)} lines of {count} points and {faces} faces: cut off."
        )
    return _divided(points, table, name)


def _ply_records(header: Sequence[Sequence[str]]) -> dict[str, tuple[int, np.dtype[np.void]]]:
    """Element -> (count, record layout) of a binary file of triangles, as `LENGTHS` says.

    Raises IndexError, KeyError or ValueError for other headers.
    """
    (order,) = (PLY_ORDERS[words[1]] for words in header if words[:1] == ["format"])
    counts: dict[str, int] = {}
    fields: dict[str, list[tuple[str, str] | tuple[str, str, int]]] = {}
    columns: list[tuple[str, str] | tuple[str, str, int]] = []
    for words in header:
        if words[:1] == ["element"]:
            columns = fields[words[1]] = []
            counts[words[1]] = int(words[2])
        elif words[:2] == ["property", "list"]:
            size, entries = (SIZE, CORNERS) if words[4] in INDICES else (words[4] + SIZE, words[4])
            columns.append((size, order + PLY_TYPES[words[2]]))
            columns.append((entries, order + PLY_TYPES[words[3]], LENGTHS[words[4]]))
        elif words[:1] == ["property"]:
            columns.append((words[2], order + PLY_TYPES[words[1]]))
    return {name: (counts[name], np.dtype(columns)) for name, columns in fields.items()}
