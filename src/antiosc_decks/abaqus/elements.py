"""Element types of Abaqus and CalculiX: shapes, families and order of nodes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from antiosc.fem.readers.shapes import CORNERS, EDGES

Role = Literal["solid", "shell", "beam", "plane stress", "plane strain", "rod", "other"]

#: Nodes of a solid -> its shape.
VOLUMES = {
    4: "tetra",
    5: "pyramid",
    6: "wedge",
    8: "hexahedron",
    10: "tetra",
    13: "pyramid",
    15: "wedge",
    18: "wedge",
    20: "hexahedron",
    27: "hexahedron",
}
SHEET_SHAPES = {3: "triangle", 4: "quad", 6: "triangle", 8: "quad", 9: "quad"}
#: Places of the nodes of a type where they are not corners, then middles of edges in VTK's order.
MIDDLE_SECOND = (0, 2, 1)
#: Inner nodes of C3D27: Abaqus gives the centre, then bottom, top and the four sides.
INNER_27 = (26, 24, 23, 25, 21, 22, 20)

_SOLID = re.compile(r"(?:C|DC|AC|F)3D(\d+)[A-Z]*$")
_SHELL = re.compile(r"(?:S|DS|STRI)(65|[34689])(?:R5|R?S?W?T?)$")
_PLANE = re.compile(r"(CPS|CPE|CPEG|CAX|CGAX|DC2D|DCAX|AC2D|ACAX)([3468])[A-Z]*$")
_BEAM = re.compile(r"(?:B|PIPE)([23])([123])[A-Z]*$")
#: Types with the shape of a cell but without a family here: rigid, membranes, trusses, surfaces.
_OTHERS = (
    (re.compile(r"(?:R3D|M3D|SFM3D)(3|4|6|8)[A-Z]*$"), "face"),
    (re.compile(r"SC(6|8)[A-Z]*$"), "volume"),
    (re.compile(r"T[23]D(2|3)[A-Z]*$"), "line"),
)


@dataclass(frozen=True)
class ElementType:
    """How one element type is read."""

    #: a key of `CORNERS`
    shape: str
    role: Role
    nodes: int
    #: places of the corners and of the middles of the edges in the deck's order
    corners: tuple[int, ...]
    mids: tuple[int, ...]
    inner: tuple[int, ...] = ()


def element_type(name: str) -> ElementType | None:
    """The type named `name` (upper case); None if it is not a cell of a mesh."""
    if match := _SOLID.match(name):
        nodes = int(match[1])
        if nodes not in VOLUMES:
            return None
        role: Role = "solid" if name.startswith("C3D") else "other"
        return _plain(VOLUMES[nodes], role, nodes)
    if match := _SHELL.match(name):
        nodes = 6 if match[1] == "65" else int(match[1])
        return _plain(SHEET_SHAPES[nodes], "other" if name.startswith("DS") else "shell", nodes)
    if match := _PLANE.match(name):
        roles: dict[str, Role] = {"CPS": "plane stress", "CPE": "plane strain"}
        return _plain(SHEET_SHAPES[int(match[2])], roles.get(match[1], "other"), int(match[2]))
    if match := _BEAM.match(name):
        return _line(3 if match[2] == "2" else 2, "beam")
    for pattern, kind in _OTHERS:
        if match := pattern.match(name):
            nodes = int(match[1])
            if kind == "line":
                return _line(nodes, "rod" if name.startswith(("T2D2", "T3D2")) else "other")
            return _plain((SHEET_SHAPES if kind == "face" else VOLUMES)[nodes], "other", nodes)
    return None


def _plain(shape: str, role: Role, nodes: int) -> ElementType:
    corners = CORNERS[shape]
    mids = range(corners, corners + len(EDGES[shape])) if nodes > corners else range(0)
    inner = tuple(range(corners + len(mids), nodes))
    if shape == "hexahedron" and nodes == 27:
        inner = INNER_27
    elif shape != "quad":
        inner = ()
    return ElementType(shape, role, nodes, tuple(range(corners)), tuple(mids), inner)


def _line(nodes: int, role: Role) -> ElementType:
    if nodes == 2:
        return ElementType("line", role, 2, (0, 1), ())
    return ElementType("line", role, 3, MIDDLE_SECOND[:2], MIDDLE_SECOND[2:])


#: Numbers of nodes of types that are not cells, to separate their elements.
ONE_NODE = re.compile(r"(?:MASS|ROTARYI|SPRING1|DASHPOT1|DCOUP3D|DCOUP2D|HEATCAP)$")
TWO_NODES = re.compile(r"(?:SPRINGA|SPRING2|DASHPOTA|DASHPOT2|GAPUNI|GAPCYL|GAPSPHER|CONN[23]D2)$")


def nodes_of_other(name: str) -> int | None:
    """Number of nodes of an element that is not a cell; None if it is not known."""
    if ONE_NODE.match(name):
        return 1
    if TWO_NODES.match(name):
        return 2
    return 3 if name == "D" else None
