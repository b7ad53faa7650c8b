"""Cells of decks and files, in VTK's order: corners, then middle nodes of edges.

Straight and second-order cells of all shapes, including those (wedges, pyramids) that are divided
into others.
"""

from __future__ import annotations

#: By meshio's names: shape, nodes, number in gmsh.
CELLS = {
    "vertex": ("point", 1, 15),
    "line": ("line", 2, 1),
    "line3": ("line", 3, 8),
    "triangle": ("triangle", 3, 2),
    "triangle6": ("triangle", 6, 9),
    "quad": ("quad", 4, 3),
    "quad8": ("quad", 8, 16),
    "quad9": ("quad", 9, 10),
    "tetra": ("tetra", 4, 4),
    "tetra10": ("tetra", 10, 11),
    "pyramid": ("pyramid", 5, 7),
    "pyramid13": ("pyramid", 13, 19),
    "pyramid14": ("pyramid", 14, 14),
    "wedge": ("wedge", 6, 6),
    "wedge15": ("wedge", 15, 18),
    "wedge18": ("wedge", 18, 13),
    "hexahedron": ("hexahedron", 8, 5),
    "hexahedron20": ("hexahedron", 20, 17),
    "hexahedron27": ("hexahedron", 27, 12),
}
CORNERS = {
    "point": 1,
    "line": 2,
    "triangle": 3,
    "quad": 4,
    "tetra": 4,
    "pyramid": 5,
    "wedge": 6,
    "hexahedron": 8,
}
DIMENSION = {
    "point": 0,
    "line": 1,
    "triangle": 2,
    "quad": 2,
    "tetra": 3,
    "pyramid": 3,
    "wedge": 3,
    "hexahedron": 3,
}
#: Corners of the edges, in the order of their middle nodes.
EDGES: dict[str, tuple[tuple[int, int], ...]] = {
    "point": (),
    "line": ((0, 1),),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
}
#: Corners of the faces, around each.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)),
    "pyramid": ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": (
        *((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4)),
        *((3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)),
    ),
}


def rectangles(shape: str) -> list[tuple[int, ...]]:
    """Corners of the faces with four corners; a quadrilateral is its own face."""
    faces = FACES.get(shape, ((0, 1, 2, 3),) if shape == "quad" else ())
    return [face for face in faces if len(face) == 4]
