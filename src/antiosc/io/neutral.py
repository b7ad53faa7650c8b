"""The neutral model that every file reader returns: points, cells by kind, and groups by name.

The nodes of cells are in VTK's order: corners, then middle nodes of edges. Straight and
second-order cells of all shapes are known, including wedges and pyramids, which are divided into
tetrahedra. A `UnitSystem` is a unit of length and a unit of force, with seconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, NotRequired, TypeAlias, TypedDict

import numpy as np
from numpy.typing import NDArray

from antiosc.base.checks import positive, shown
from antiosc.base.errors import InputError
from antiosc.base.plausible import GRAVITY

#: Names of the flat sides of a mesh in its bounding box, where no group has them.
BOX_SIDES = ("-x", "+x", "-y", "+y", "-z", "+z")
#: By meshio's names: shape, nodes, number in gmsh.
CELL_TYPES = {
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
#: Shape -> (dimension, corners, name of dolfinx for those that a mesh carries).
SHAPES = {
    "point": (0, 1, "point"),
    "line": (1, 2, "interval"),
    "triangle": (2, 3, "triangle"),
    "quad": (2, 4, "quadrilateral"),
    "tetra": (3, 4, "tetrahedron"),
    "pyramid": (3, 5, ""),
    "wedge": (3, 6, ""),
    "hexahedron": (3, 8, "hexahedron"),
}
DIMENSION = {shape: dim for shape, (dim, _, _) in SHAPES.items()}
CORNERS = {shape: corners for shape, (_, corners, _) in SHAPES.items()}
DOLFINX_SHAPES = {shape: name for shape, (_, _, name) in SHAPES.items() if name}
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
#: Corners of the faces, around each, seen from outside.
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": (
        *((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4)),
        *((3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    ),
}


def quadrilateral_faces(shape: str) -> list[tuple[int, ...]]:
    """Local corners of each quadrilateral face of a cell; a quadrilateral is its own face."""
    faces = FACES.get(shape, ((0, 1, 2, 3),) if shape == "quad" else ())
    return [face for face in faces if len(face) == 4]


IntArray = NDArray[np.int64]
#: (dimension, tag) -> names
EntityNames = dict[tuple[int, int], list[str]]
#: values as JSON holds them, by name
Json: TypeAlias = dict[str, Any]
#: A motion: (node, or -1 - k of the k-th point of no element; motion 0 to 5; coefficient).
MotionTerm = tuple[int, int, float]


class Joints(TypedDict):
    """Constraints, springs, dampers and masses between nodes, on sums of `MotionTerm`; SI units."""

    #: sums that are zero, the dependent motion first; each of terms (node, or -1 - k for
    #: `points[k]`; motion, 0 to 5 for x, y, z, rx, ry, rz; coefficient)
    equations: list[list[MotionTerm]]
    springs: list[tuple[list[MotionTerm], float]]  # N/m
    dampers: list[tuple[list[MotionTerm], float]]  # N s/m
    #: (motions, their mass matrix, kg, what it adds to the total mass, kg)
    masses: list[tuple[list[list[MotionTerm]], list[list[float]], float]]
    points: list[list[float]]  # coordinates of the points of no element, m
    #: (node added in a face or a halved cell, [(node of the deck, weight in its position)])
    among: NotRequired[list[tuple[int, list[tuple[int, float]]]]]


class Model(TypedDict):
    """Materials, sections, supports, masses and joints of a deck as JSON values, SI units."""

    #: (group of elements, class of antiosc, its arguments, the place in the deck)
    families: list[tuple[str, str, Json, str]]
    supports: list[tuple[str, list[str]]]  # (group, fixed motions, "x" to "rz")
    fixed_points: list[tuple[int, list[str]]]  # (-1 - k for point k of `joints`, fixed motions)
    masses: list[tuple[list[float], float, list[float]]]  # (place, kg, moments of inertia)
    springs: list[tuple[list[float], dict[str, float]]]  # (place, stiffness by components)
    joints: Joints
    ignored: list[str]  # sentences on what is left out
    gdim: int  # dimension of space, 2 or 3
    halve: bool  # whether each line with a middle node is halved
    joined: bool  # whether the structure is an assembly
    mixed: bool  # whether its triangles stay apart from its quadrilaterals
    apart: list[int]  # nodes that are not merged with others at the same point
    pieces: int  # number of pieces that nothing joins
    held: bool  # whether there are several pieces, each held by supports


@dataclass(frozen=True)
class CellKind:
    """A cell shape of one geometric order; the first `vertices` of its `nodes` are corners."""

    shape: str  # dolfinx's name
    dim: int
    order: int
    vertices: int
    nodes: int


#: By meshio's names.
CELL_KINDS = {
    label: CellKind(
        DOLFINX_SHAPES[shape], DIMENSION[shape], 1 + (nodes > CORNERS[shape]), CORNERS[shape], nodes
    )
    for label, (shape, nodes, _) in CELL_TYPES.items()
    if shape in DOLFINX_SHAPES and label not in ("quad8", "hexahedron20")
}
FACETS: dict[str, Sequence[tuple[int, ...]]] = {
    "interval": ((0,), (1,)),
    "triangle": EDGES["triangle"],
    "quadrilateral": EDGES["quad"],
    "tetrahedron": FACES["tetra"],
    "hexahedron": FACES["hexahedron"],
}
EDGES_OF_KIND = {DOLFINX_SHAPES[shape]: EDGES[shape] for shape in ("tetra", "hexahedron")}


class Piece(NamedTuple):
    """A connected piece of a part: its name ("": none), lowest and highest corner of its box."""

    name: str
    low: NDArray[np.float64]  # (3,), in the unit of the nodes
    high: NDArray[np.float64]

    def scaled(self, factor: float) -> Piece:
        """The piece with its box scaled by `factor`, to another unit of length."""
        return Piece(self.name, factor * self.low, factor * self.high)


@dataclass
class FileMesh:
    """Nodes, cells of all kinds and groups of a file; `selected_mesh` selects a mesh of them."""

    points: NDArray[np.float64]  # (n, 3) node coordinates, m; of a reader, in the file's unit
    cells: dict[str, IntArray]  # kind (in CELL_KINDS) -> (cells, nodes of one), vertices first
    #: group name -> {kind: rows of `cells[kind]`}
    groups: dict[str, dict[str, IntArray]] = field(default_factory=dict)
    #: name of a set of nodes -> rows of `points`
    node_sets: dict[str, IntArray] = field(default_factory=dict)
    of_gmsh: bool = False  # whether gmsh made it; it then has cells on curves and faces too
    #: once a group holds cells of the highest dimension, cells in no group are construction aids
    has_construction_aids: bool = False
    #: entities that supports fix: name of the group for them -> {dimension: their vertices}
    fixed: dict[str, dict[int, IntArray]] = field(default_factory=dict)
    #: warnings about the file for the caller, one sentence each
    remarks: list[str] = field(default_factory=list)
    #: materials, sections, supports and masses as values for JSON, if a model was requested
    model: Model | None = None
    #: numbers in the file of the first nodes, -1 for nodes without one; empty: no numbers
    labels: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    #: pieces that can be read alone, by rank; empty: there is one piece, or they are not known
    pieces: list[Piece] = field(default_factory=list)


@dataclass
class RawMesh:
    """Nodes, cells of one kind, and groups; remarks, model, labels and pieces as in `FileMesh`."""

    points: NDArray[np.float64]  # (n, 3) node coordinates, m
    #: (cells, nodes per cell), vertices first
    cells: IntArray
    kind: CellKind
    #: name -> {dimension: (entities, vertices of one)}
    groups: dict[str, dict[int, IntArray]] = field(default_factory=dict)
    #: index of each node among the nodes of the `FileMesh`
    numbers: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    remarks: list[str] = field(default_factory=list)
    model: Model | None = None
    #: number of each node in the file; empty: no numbers
    labels: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    pieces: list[Piece] = field(default_factory=list)


def joined_groups(parts: Iterable[tuple[str, str, IntArray]]) -> dict[str, dict[str, IntArray]]:
    """Groups name -> {kind: rows} from parts (name, kind, rows) of groups."""
    groups: dict[str, dict[str, list[IntArray]]] = {}
    for name, kind, rows in parts:
        groups.setdefault(name, {}).setdefault(kind, []).append(rows)

    return {
        name: {kind: np.concatenate(rows) for kind, rows in kinds.items()}
        for name, kinds in groups.items()
    }


def fixed_group_name(name: str, label: str) -> str:
    """Name of the group of fixed cells of the kind `label`, if there are several kinds."""
    return f"{name}@{label}"


#: Fields of a `FileMesh` that are values of JSON.
_JSON_FIELDS = ("of_gmsh", "has_construction_aids", "remarks", "model")


def packed(mesh: FileMesh) -> tuple[Json, list[NDArray[Any]]]:
    """The mesh as (JSON values, arrays); the rows of all groups are in the first array."""
    node_sets = {name: {"": nodes} for name, nodes in mesh.node_sets.items()}
    tables: Json = {"groups": mesh.groups, "fixed": mesh.fixed, "node_sets": node_sets}
    header = {name: getattr(mesh, name) for name in _JSON_FIELDS}
    header["cells"] = list(mesh.cells)
    header["sets"] = {
        field_name: [(name, [(key, e.shape) for key, e in of.items()]) for name, of in sets.items()]
        for field_name, sets in tables.items()
    }
    header["pieces"] = [(name, list(low), list(high)) for name, low, high in mesh.pieces]
    rows = [e.ravel() for sets in tables.values() for of in sets.values() for e in of.values()]
    every_row = np.concatenate([np.zeros(0, dtype=np.int64), *rows])
    return header, [every_row, mesh.points, mesh.labels, *mesh.cells.values()]


def unpacked(head: Json, arrays: list[NDArray[Any]]) -> FileMesh:
    """The inverse of `packed`; ValueError if sizes, kinds and indices are inconsistent."""
    rows, points, labels, *blocks = arrays
    cells = dict(zip(head["cells"], blocks, strict=True))
    if points.dtype != float or points.ndim != 2 or points.shape[1] != 3:
        raise ValueError("points must be of shape (n, 3)")
    if labels.dtype != np.int64 or labels.ndim != 1 or len(labels) > len(points):
        raise ValueError(f"{len(labels)} numbers of {len(points)} nodes")

    for label, block in cells.items():
        if block.ndim != 2 or block.shape[1] != CELL_KINDS[label].nodes:
            raise ValueError(f"{label} cells of shape {block.shape}")
        _check_indices(block, len(points), f"the {label} cells name nodes")

    sets: Json = {}
    for field_name, of_field in head["sets"].items():
        sets[field_name] = {name: {} for name, _ in of_field}
        for name, key, shape in ((n, key, shape) for n, of in of_field for key, shape in of):
            part, rows = np.split(rows, [int(np.prod(shape))])
            most = len(cells[key]) if field_name == "groups" else len(points)
            _check_indices(part, most, f"{name!r} names nodes or cells")
            sets[field_name][name][key] = part.reshape(shape)

    sets["node_sets"] = {name: of[""] for name, of in sets["node_sets"].items()}
    pieces = [Piece(str(name), *np.array(box, float)) for name, *box in head["pieces"]]
    plain = {name: head[name] for name in _JSON_FIELDS}
    return FileMesh(points, cells, labels=labels, pieces=pieces, **plain, **sets)


def _check_indices(rows: IntArray, most: int, what: str) -> None:
    """ValueError unless all `rows` are between 0 and most - 1."""
    if rows.dtype != np.int64:
        raise ValueError(f"{what} by {rows.dtype}")
    if rows.size and not (rows.min() >= 0 and rows.max() < most):
        raise ValueError(f"{what} that the file does not hold")


#: Name -> (m, N). "mm" is mm, N, t, MPa; "mm-kg" is mm, mN, kg, kPa; "mm-kgf" is mm, kgf,
#: kgf/mm²; "in" is inch, pound-force, psi, lbf s²/in; "ft" is foot, pound-force, lbf/ft², slug.
UNIT_SYSTEMS = {
    **{"m": (1.0, 1.0), "mm": (1e-3, 1.0), "mm-kg": (1e-3, 1e-3), "cm": (1e-2, 1.0)},
    "mm-kgf": (1e-3, GRAVITY),
    "in": (0.0254, 4.4482216152605),
    "ft": (0.3048, 4.4482216152605),
}


@dataclass(frozen=True)
class UnitSystem:
    """Units of length and force in SI; the unit of mass follows from force = mass × length / s²."""

    length: float = 1.0  # m
    force: float = 1.0  # N

    @classmethod
    def of(cls, unit: str | float) -> UnitSystem:
        """The unit system named `unit`; for a number, `unit` metres per unit of length, and N."""
        if not isinstance(unit, str):
            return cls(positive("unit", unit, "m"))
        if unit in UNIT_SYSTEMS:
            return cls(*UNIT_SYSTEMS[unit])

        names = ", ".join(map(repr, UNIT_SYSTEMS))
        raise InputError(f"unit must be one of {names}, or metres per unit; got {shown(unit)}.")

    @property
    def mass(self) -> float:
        """Unit of mass, kg."""
        return self.force / self.length

    @property
    def stress(self) -> float:
        """Unit of stress, Pa."""
        return self.force / self.length**2

    @property
    def density(self) -> float:
        """Unit of density, kg/m³."""
        return self.mass / self.length**3


def row_hashes(rows: NDArray[Any]) -> NDArray[np.uint64]:
    """Hash (n,) of each row, independent of the order in it; odds of a collision: 1e-19."""
    mixed = np.zeros(len(rows), dtype=np.uint64)

    with np.errstate(over="ignore"):
        for column in np.sort(rows, axis=1).T:
            mixed = (mixed ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
            mixed *= np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= mixed >> np.uint64(32)

    return mixed


def outer_facets(cells: NDArray[Any], sides: Sequence[Sequence[int]]) -> NDArray[Any]:
    """Facets (n, vertices) that belong to one cell only; `sides`: local corners of facets."""
    facets = np.vstack([cells[:, list(side)] for side in sides])
    _, first, count = np.unique(row_hashes(facets), return_index=True, return_counts=True)
    return facets[first[count == 1]]


def connected_pieces(tables: Iterable[IntArray], count: int) -> IntArray:
    """Number (count,) of the connected piece of each node. The nodes in a row of `tables` (n, k)
    are connected; negative numbers are ignored."""
    from scipy.sparse import coo_matrix  # few files need it, and it loads slowly
    from scipy.sparse.csgraph import connected_components

    links = [np.stack([np.repeat(t[:, 0], t.shape[1]), t.ravel()]) for t in tables]
    ends = np.hstack([np.zeros((2, 0), dtype=np.int64), *links])
    ends = ends[:, ends[1] >= 0]
    graph = coo_matrix((np.ones(ends.shape[1], dtype=np.int8), tuple(ends)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])
