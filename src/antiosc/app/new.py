"""`antiosc new`: what a part is, seen from its mesh, and the commented scene written for it.

Family, unit, where the part is held and where it is struck: the scene runs as it stands.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import floor, log10, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

import antiosc
from antiosc.app.report import rendered
from antiosc.app.scene_file.outline import GEOMETRIES, LARGEST
from antiosc.base import checks, files, progress
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import point_text
from antiosc.base.errors import (
    AntioscError,
    InputError,
    MeshError,
    finite_element_packages,
    warnings_to,
    without_warnings,
)
from antiosc.simulation.bodies import Sphere
from antiosc.simulation.two_bodies import impact_band

if TYPE_CHECKING:
    from antiosc.fem.mesh import Mesh
    from antiosc.fem.mesh.surface import Faces


#: Arguments of `read_mesh` besides the file.
Read: TypeAlias = dict[str, Any]
#: A file without a unit whose longest side is this or more is taken as one in millimetres.
LONGEST_IN_METRES = 3.0
#: Elements along the longest side of a geometry that is meshed.
ELEMENTS = 20
#: Words in the names of groups that hold a part, the likeliest first.
HOLDS = (
    *("clamp", "fix", "held", "hold", "support", "encastre", "mount", "bolt", "feet", "foot"),
    *("base", "ground", "root", "rim", "ends", "left", "bottom", "edges"),
)
#: Words in the names of groups that are struck.
STRUCK = ("impact", "struck", "strike", "hit", "eye", "tip", "nose", "top", "front", "middle")
#: Cosine between neighbouring faces of one side of a part.
ONE_SIDE = np.cos(np.radians(15.0))
#: Share of the nodes of a part that lie at most on a plane that holds it.
AT_PLANE = 0.6
#: Share of the distance to the edge of its side that the radius of a site has, and the share of the
#: longest side of the part, at most.
RADIUS, LARGEST_RADIUS = 0.4, 0.02
#: Which way is up, for a sheet in any plane.
UP = np.array([0.1, 0.2, 1.0])
#: Distance from the edge of a side, over the size of the part, from which more room is no merit.
ROOM = 0.1
#: Distance [m] of nodes that are joined, where a mesh falls into pieces.
MERGED = 1e-6
#: Distance over the size of the part within which nodes lie on a plane.
ON_PLANE = 1e-6
#: The material of a new scene, of the part and of the ball.
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Thickness of a sheet, and diameter of a bar, over the longest side of the part: guesses.
THIN, SLENDER = 0.005, 0.03
#: Lowest frequency of a plate of length L that is held at one end, over √(D/ρh)/L².
LOWEST = 0.56


@dataclass(frozen=True)
class Look:
    """What was found; lengths in m.

    Attributes
    ----------
    family : "Solid", "Shell" or "Beam".
    read : arguments of `read_mesh` besides the file.
    low, high : (3,) corners of its box.
    groups : names of its groups.
    cells : their number and kind in words.
    where : group that holds it; plane : (point, normal) of nodes that do; neither: it is free.
    point, direction : of the site; radius : of its patch, None for beams and sheets.
    points, faces, held : nodes (P, 3), corners (F, k), and which nodes are held, to be drawn.
    of_deck : whether supports and materials are those of a deck.
    """

    family: str
    read: Read
    low: Array
    high: Array
    groups: list[str]
    cells: str
    where: str | None
    plane: list[list[float]] | None
    point: list[float]
    direction: list[float]
    radius: float | None
    points: Array = field(repr=False)
    faces: IntArray = field(repr=False)
    held: BoolArray = field(repr=False)
    of_deck: bool = False

    @property
    def length(self) -> float:
        """The longest side of the box."""
        return float((self.high - self.low).max())

    @property
    def thickness(self) -> float:
        """A guess of a sheet's thickness, or of a bar's diameter."""
        return float(f"{(SLENDER if self.family == 'Beam' else THIN) * self.length:.1g}")

    @property
    def duration(self) -> float:
        """Three half periods [s] of a sheet's lowest bending vibration, as if held at one end."""
        E, nu, rho = STEEL["E"], STEEL["nu"], STEEL["rho"]
        bending = self.thickness * sqrt(E / (12 * (1 - nu**2) * rho))
        return float(f"{1.5 * self.length**2 / (LOWEST * bending):.1g}")

    def sentences(self, name: str, drop: bool = False) -> list[str]:
        """What was found, for the terminal; of a part that is dropped not how it is struck."""
        side = " × ".join(f"{1e3 * c:.4g}" for c in self.high - self.low)
        unit = self.read.get("unit")
        told = [f"{name}: {self.cells}, {side} mm; taken as {self.family}."]
        if unit:
            told.append(f'its coordinates are taken as millimetres (unit = "{unit}"): look at it.')
        if "merge" in self.read:
            told.append("its pieces are joined at nodes that coincide (merge).")
        held = f"held at the group {self.where!r}" if self.where else "free: it has no supports"
        if self.of_deck:
            held = "supports and materials are those of the deck"
        if self.plane:
            held = f"held at the nodes on the plane through {_rounded(self.plane[0])} m"
        groups = ", ".join(self.groups) or "none"
        told.append(
            f"it reaches from {point_text(self.low)} to {point_text(self.high)}; groups: {groups}."
        )
        if drop:
            point = _rounded(self.point)
            how = "dropped without supports, z up, as [drop] says"
            return [*told, f"{how}; an accelerometer is at {point} m."]
        return [*told, f"struck at {_rounded(self.point)} m along {self.direction}; {held}."]


def look_at_part(path: Path) -> Look:
    """Read or mesh the file of a part and look at it.

    Raises
    ------
    AntioscError
        It cannot be read or meshed, or is too large to be looked at.
    """
    if path.stat().st_size > LARGEST:
        raise AntioscError(f"the file is larger than {LARGEST / 1e6:g} MB")
    with finite_element_packages():
        from antiosc.io.reading import STATES_UNIT, outline
    read: Read = {}
    states_unit = path.suffix.lower() in STATES_UNIT
    with without_warnings():
        if path.suffix.lower() in GEOMETRIES:
            length = float(np.ptp(outline(path).points, axis=0).max())
            if length >= LONGEST_IN_METRES and not states_unit:
                read["unit"], length = "mm", 1e-3 * length
            read["size"] = _one_digit(length / ELEMENTS)
        try:
            mesh = antiosc.read_mesh(str(path), **read)
        except MeshError:  # of pieces that share no nodes
            read["merge"] = MERGED
            mesh = antiosc.read_mesh(str(path), **read)
        if mesh.tdim < 3 and mesh.gdim == 2:  # a plate, struck on its face
            read["gdim"] = 3
        length = float(np.ptp(mesh.dolfinx.geometry.x, axis=0).max())
        if length >= LONGEST_IN_METRES and not states_unit:
            read["unit"] = "mm"
        mesh = antiosc.read_mesh(str(path), **read)
    return _seen(mesh, read)


def look_at_deck(path: Path) -> Look:
    """What a deck has: the largest of its meshes, with its own supports and materials.

    Raises
    ------
    AntioscError
        It cannot be read, or is too large to be looked at.
    """
    if path.stat().st_size > LARGEST:
        raise AntioscError(f"the file is larger than {LARGEST / 1e6:g} MB")
    with finite_element_packages():
        from antiosc.fem.assembly import with_parts
    for unit in ("mm", "m"):
        told: list[str] = []
        with warnings_to(told.append):
            part = antiosc.read_model(str(path), unit=unit)
        if not any("wave speed" in sentence for sentence in told):
            break
    members = [m for m, _ in with_parts(part).fields(np.zeros((part.rows, 0)), None)]
    mesh = max((m.part.mesh for m in members), key=lambda mesh: (mesh.tdim, mesh.n_cells))
    found = _seen(mesh, {"unit": unit})
    free = np.zeros(len(found.points), dtype=bool)
    return replace(found, where=None, plane=None, held=free, of_deck=True)


def _seen(mesh: Mesh, read: Read) -> Look:
    from antiosc.fem.mesh.surface import Faces
    from antiosc.fem.platform import compat

    x = np.array(mesh.dolfinx.geometry.x)
    nodes = compat.geometry_nodes(mesh.dolfinx)
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    low, high = (np.array(_rounded(ends, size)) for ends in (x.min(axis=0), x.max(axis=0)))
    where = _group(mesh, HOLDS)
    struck = _nodes_of(mesh, _group(mesh, STRUCK))
    held, plane = np.zeros(len(x), dtype=bool), None
    if where is not None:
        held[_nodes_of(mesh, where)] = True
    else:
        held, plane = _plane(x, low, high, size)
    family = {1: "Beam", 2: "Shell", 3: "Solid"}[mesh.tdim]
    outer = Faces(mesh, mesh.tdim < 3)
    faces = outer.vertices[:, [0, 1, 3, 2] if outer.vertices.shape[1] == 4 else slice(None)]
    if family == "Beam":
        point, direction, radius = *_on_lines(x, nodes, held, struck), None
    else:
        point, direction, inscribed, edge = _on_faces(x, faces, outer, held, struck, size)
        radius = _radius(inscribed, edge, float((high - low).max()), "size" in read)
        radius = radius if family == "Solid" else None
    cells = f"{mesh.n_cells} cells of kind {mesh.cell}"
    return Look(
        family, read, low, high, list(mesh.groups), cells, where, plane,
        _rounded(point, size), _rounded(direction), radius, x, faces, held,
    )  # fmt: skip


def _group(mesh: Mesh, words: Sequence[str]) -> str | None:
    """The group of facets, edges or nodes that has the first of these words in its name."""
    lower = {n: n.lower() for n, parts in mesh.groups.items() if min(parts) < mesh.tdim}
    return next((n for word in words for n, low in lower.items() if word in low), None)


def _nodes_of(mesh: Mesh, group: str | None) -> IntArray:
    """Nodes of a group; none without one."""
    from antiosc.fem.platform import compat

    parts = mesh.groups[group].items() if group is not None else ()
    found = [compat.entity_vertices(mesh.dolfinx, dim)[own].ravel() for dim, own in parts]
    return np.unique(np.concatenate([np.zeros(0, dtype=int), *found]))


def _plane(
    x: Array, low: Array, high: Array, size: float
) -> tuple[BoolArray, list[list[float]] | None]:
    """Nodes on a side of the box, the lowest that has enough of them; none: the part is free."""
    sides = [(2, low), (0, low), (1, low), (0, high), (1, high)]
    for axis, corner in sides:
        on = np.abs(x[:, axis] - corner[axis]) < ON_PLANE * size
        if min(3, len(x) // 4) <= on.sum() <= max(1.0, AT_PLANE * len(x)):
            return on, [_rounded(corner, size), np.eye(3)[axis].tolist()]
    return np.zeros(len(x), dtype=bool), None


def _on_faces(
    x: Array, faces: IntArray, outer: Faces, held: BoolArray, struck: IntArray, size: float
) -> tuple[Array, Array, float, float]:
    """Point, direction into the part, distance from the edge of its side, length of its edges.

    The middle of the largest side, those far from the supports and above being preferred.
    """
    corners = x[faces]
    middle = corners.mean(axis=1)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area, normal = np.linalg.norm(sides, axis=1), outer.normals
    if outer.sheet:
        normal = normal * np.where(normal @ UP < 0, -1.0, 1.0)[:, None]
    side, edge_points = _sides(x, faces, normal)
    far = _from_supports(x, held, middle)
    total = np.bincount(side, area)
    away = np.bincount(side, area * (far + 0.2 * size)) / total
    above = np.bincount(side, area * normal[:, 2]) / total
    own = np.flatnonzero(side == np.argmax(total * away * (1.5 + above)))
    if len(struck):
        there = np.flatnonzero(np.isin(faces, struck).all(axis=1))
        own = there if len(there) else own
    ends = np.vstack([edge_points[number] for number in np.unique(side[own])])
    inside = np.full(len(own), size)
    if len(ends):
        inside = cKDTree(ends).query(middle[own])[0]
    room = (np.minimum(inside, ROOM * size) + ROOM * inside) * (far[own] + ROOM * size)
    best = own[int(np.argmax(room))]
    longest = float(np.linalg.norm(corners[best] - np.roll(corners[best], 1, axis=0), axis=1).max())
    return middle[best], -normal[best], float(inside[own == best][0]), longest


def _from_supports(x: Array, held: BoolArray, points: Array) -> Array:
    """Distances of points (n, 3) from the next node that is held; equal ones of a free part."""
    if not held.any():
        return np.ones(len(points))
    return np.asarray(cKDTree(x[held]).query(points)[0])


def _sides(x: Array, faces: IntArray, normal: Array) -> tuple[IntArray, dict[int, Array]]:
    """Number of the side of the part of each face, and points on the edges of each side."""
    k = faces.shape[1]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), k)
    _, edge, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    starts = np.cumsum(count) - count
    pairs = [np.zeros((0, 2), dtype=int)]
    for first, second in combinations(range(4), 2):  # sheets join where three or four meet
        at = starts[count > second]
        pairs.append(np.stack([order[at + first], order[at + second]], axis=1))
    both = np.vstack(pairs)
    a, b = owner[both].T
    both = both[np.abs(np.einsum("ij,ij->i", normal[a], normal[b])) > ONE_SIDE]
    links = coo_matrix((np.ones(len(both)), owner[both].T), shape=(len(faces),) * 2)
    side = connected_components(links, directed=False)[1]
    at_edge = np.ones(len(owner), dtype=bool)
    at_edge[both.ravel()] = False
    points = np.concatenate([x[ends[:, 0]], x[ends].mean(axis=1), x[ends[:, 1]]])
    of_side = np.tile(np.where(at_edge, side[owner], -1), 3)
    return side, {int(s): points[of_side == s] for s in np.unique(side)}


def _on_lines(x: Array, nodes: IntArray, held: BoolArray, struck: IntArray) -> tuple[Array, Array]:
    """A node of the group that is struck, or far from the supports; a direction across the line."""
    own = struck if len(struck) else np.unique(nodes)
    best = int(own[np.argmax(_from_supports(x, held, x[own]))])
    rows = nodes[(nodes == best).any(axis=1)]
    along = np.abs(x[rows[:, 1]] - x[rows[:, 0]]).sum(axis=0)
    axis = int(np.argmin(along[::-1]))  # z before y before x
    return x[best], -np.eye(3)[2 - axis]


def _radius(inscribed: float, edge: float, length: float, meshed: bool) -> float:
    """Radius of the patch: within its side, and of the size of the faces of a finished mesh."""
    radius = min(RADIUS * inscribed, LARGEST_RADIUS * length)
    if not meshed:
        radius = min(max(radius, 1.05 * edge), 0.9 * inscribed)
    return float(f"{radius:.2g}")


def _one_digit(value: float) -> float:
    return float(f"{value:.1g}")


def _rounded(values: Sequence[float] | Array, size: float = 1.0) -> list[float]:
    """Numbers to a hundred-thousandth of a size."""
    return [float(c) + 0.0 for c in np.round(values, 5 - floor(log10(size)))]


def draw(found: Look, path: Path, drop: bool = False) -> None:
    """A picture of the part: its outer faces; if not dropped, what holds it and the impact."""
    from antiosc.base.charts import save_figure
    from antiosc.base.surfaces import Deformed, deformed_figure

    height = 1e3 * (found.points[:, 2] - found.points[:, 2].min())
    shade = height if drop else found.held.astype(float)
    label = "height over its lowest point (mm)" if drop else "1: held"
    most = max(float(shade.max()), 1.0)
    part = Deformed(found.points, found.points, found.faces, shade, label, most)
    arrow = None if drop else (np.array(found.point), np.array(found.direction))
    save_figure(deformed_figure(part, arrow=arrow, whole_scale=True), path, dpi=100)


#: Endings of decks, which describe materials and supports themselves.
DECK_ENDINGS = {".inp", ".bdf", ".nas", ".fem", ".dat"}

#: The geometry of a scene for which no part is given.
PLATE = """\
// A plate of 300 x 200 mm, held at one end; its size of elements is that of the scene.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("plate") = {1};
Physical Curve("clamp") = {4};
"""


def text(name: str, source: str, found: Look | None, drop: bool = False) -> str:
    """The scene as a text; `source` is the file of the part as the scene names it.

    `found`: what is known of the part. `drop`: it falls.
    """
    ending = Path(source).suffix.lower()
    return rendered(
        Path(__file__).with_name("page") / "scene.toml",
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        deck=ending in DECK_ENDINGS,
        closed=ending == ".stl",
        look=found,
        read=dict.fromkeys(("unit", "size", "gdim", "merge")) | dict(found.read if found else {}),
        family="Solid" if found is None else found.family,
        point=[0.0, 0.0, 0.1] if found is None else found.point,
        direction=[0.0, 0.0, -1.0] if found is None else found.direction,
        band=_band(),
        drop=drop,
        json=json.dumps,
    )


def _band() -> float:
    """Highest circular frequency [rad/s] that the impact of the scene excites, two digits."""
    ball = Sphere(radius=0.01, **STEEL, velocity=1.0)
    return float(f"{impact_band(ball, ball.hertz(STEEL['E'], STEEL['nu'])):.1e}")


def _looked(part: Path, drop: bool) -> tuple[Look | None, list[str]]:
    """What is found in a file, and sentences that tell it or why it is not known."""
    deck = part.suffix.lower() in DECK_ENDINGS
    try:
        with progress.doing(f"looking at {part.name}"):
            found = look_at_deck(part) if deck else look_at_part(part)
    except (AntioscError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error).rstrip(".")
        return None, [f"{part.name} could not be looked at: {why}."]
    return found, found.sentences(part.name, drop)


def _pictured(found: Look, path: Path, drop: bool) -> list[str]:
    """A sentence on the picture; none where it cannot be drawn."""
    if path.exists():
        return []
    try:
        draw(found, path, drop)
    except AntioscError as error:
        return [f"{path.name} is not drawn: {error}"]
    return [f"a picture of it: {path}"]


def write_scene(
    path: str | os.PathLike[str], part: str | None = None, drop: bool = False
) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; its path, and what is told of the part.

    InputError if it exists.
    """
    target = checks.new_file("the scene file", path)
    _absent(target)
    told: list[str] = []
    source = target.with_suffix(".geo") if part is None else Path(part)
    if part is None:
        _absent(source)
        files.write_text(source, PLATE, "the geometry")
        told.append(f"{source} is a plate to begin with; put your own part in its place.")
    else:
        checks.path("the file of the part", part)
    part = os.path.relpath(source, target.parent)
    if not f"{target.name}{part or ''}".isprintable():
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    found, sentences = _looked(source, drop)
    told += sentences
    content = text(target.name, part, found, drop)
    beside = target.with_name(f".antiosc-{secrets.token_hex(6)}.toml")
    try:
        with beside.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            os.link(beside, target)  # fails if the target exists; a rename would replace it
        finally:
            beside.unlink()
    except FileExistsError:
        _absent(target)
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    picture = target.with_suffix(".png")
    return target, told + ([] if found is None else _pictured(found, picture, drop))


def _absent(target: Path) -> None:
    """InputError for a file that exists."""
    if target.exists():
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        )
