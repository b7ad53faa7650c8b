"""`antiosc new`: what a part is, seen from its mesh, and the commented scene written for it.

Family, unit, where the part is held and where it is struck: the scene runs as it stands.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, combinations, islice
from math import floor, log10, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from antiosc import Sphere, impact_band
from antiosc.base import checks, files, materials, progress
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError, InputError, warnings_to
from antiosc.extension import coarse_at
from antiosc_app import pieces
from antiosc_app.foreign import DECK_ENDINGS, STEEL, Read, foreign_part
from antiosc_app.report import rendered
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import read
from antiosc_app.scene_file.outline import Outline, check_size
from antiosc_app.scene_file.run import results

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.extension import Faces
    from antiosc.io.reading import Piece

T = TypeVar("T")

#: Words in the names of groups that hold a part, the likeliest first.
SUPPORT_WORDS = (
    *("clamp", "fix", "held", "hold", "support", "encastre", "mount", "bolt", "feet", "foot"),
    *("base", "ground", "root", "rim", "ends", "left", "bottom", "edges"),
)
#: Words in the names of groups that are struck.
SITE_WORDS = ("impact", "struck", "strike", "hit", "eye", "tip", "nose", "top", "front", "middle")
#: Cosine between neighbouring faces of one side of a part.
SAME_SIDE_COSINE = np.cos(np.radians(15.0))
#: Share of the nodes of a part that lie at most on a plane that holds it.
LARGEST_PLANE = 0.6
#: Share of the distance to the edge of its side that the radius of a site has, and the share of the
#: longest side of the part, at most.
RADIUS, LARGEST_RADIUS = 0.4, 0.02
#: The material of a part for which none is asked.
MATERIAL = "steel S235"
#: Radius of the ball of a new scene [m], and over that of the patch at most: a ball of steel at
#: 1 m/s touches steel over 0.05 of its radius, plastics over 0.11, and the patch must be 1.7 times
#: as wide. Of a deck the material may be any.
LARGEST_BALL, BALL_OVER_PATCH = 0.01, {False: 10.0, True: 5.0}
#: Over the longest side of a sheet or a bar, at most.
BALL_OVER_LENGTH = 0.1
#: Hollow curvature over that of the ball from which a surface is no place for a contact at a point.
HOLLOW = 0.5
#: Which way is up, for a sheet in any plane.
UP = np.array([0.1, 0.2, 1.0])
#: Distance from the edge of a side, over the size of the part, from which more room is no merit.
ROOM = 0.1
#: Sites that are tried, first and then among all others; what warns of a patch held partly.
MOST_TRIED, PARTLY_HELD = 40, "supports fix"
#: Distance over the size of the part within which nodes lie on a plane.
ON_PLANE = 1e-6
#: Thickness of a sheet, and diameter of a bar, over the longest side of the part: guesses.
THICKNESS_RATIO, DIAMETER_RATIO = 0.005, 0.03
#: Anti-oscillators of a new scene, by family.
COUNTS = {"Beam": 20, "Shell": 150, "Solid": 20}
#: Most nodes of a part that is struck for a moment [s] before its scene is written.
MOST_NODES, MOMENT = 4000, 2e-4
#: Least dofs for each anti-oscillator.
DOFS_FOR_EACH = 4
#: Longest run of a new scene, in periods of the highest frequency of its impact: stresses are
#: looked at 40 000 times, 13 a period. 2 s of a sheet of 6 m left 297 % of the largest open.
LONGEST_RUN = 3000
#: Lowest frequency of a plate of length L that is held at one end, over √(D/ρh)/L².
LOWEST_FREQUENCY = 0.56


@dataclass(frozen=True)
class Inspection:
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
    count : number of anti-oscillators, at most a quarter of that of the dofs.
    cell : largest cell at the site [m], of what is meshed here; None where `size` will do.
    material : by name; not of a deck.
    bars : whether its models have error bars of mesh and truncation.
    points, faces, held : nodes (P, 3), corners (F, k), and which nodes are held, to be drawn.
    of_deck : whether supports and materials are those of a deck.
    notes : what was decided while reading, one sentence each.
    flat : modulus [Pa] and Poisson's ratio of a flat face in place of a surface that is not known.
    pieces : of a part that falls apart, the largest first.
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
    count: int
    points: Array = field(repr=False)
    faces: IntArray = field(repr=False)
    held: BoolArray = field(repr=False)
    of_deck: bool = False
    notes: tuple[str, ...] = ()
    flat: tuple[float, float] | None = None
    pieces: Sequence[Piece] = ()
    cell: float | None = None
    material: str = MATERIAL
    bars: bool = True

    @property
    def length(self) -> float:
        """The longest side of the box."""
        return float((self.high - self.low).max())

    @property
    def finest(self) -> float | None:
        """Size of the cells at the site of what is meshed here; None: as anywhere."""
        return (self.radius or self.cell) if "size" in self.read else None

    @property
    def thickness(self) -> float:
        """A guess of a sheet's thickness, or of a bar's diameter."""
        return float(
            f"{(DIAMETER_RATIO if self.family == 'Beam' else THICKNESS_RATIO) * self.length:.1g}"
        )

    @property
    def ball(self) -> float:
        """Radius [m] of the ball that strikes: small enough for the patch to carry its force."""
        if self.radius is None:
            most = BALL_OVER_LENGTH * self.length
        else:
            most = BALL_OVER_PATCH[self.of_deck] * self.radius
        return min(LARGEST_BALL, float(f"{most:.1g}"))

    @property
    def stiffness(self) -> float | None:
        """Hertz's [N/m^1.5] of the ball on a flat face; None where the surface is known."""
        if self.flat is None:
            return None
        ball = Sphere(radius=self.ball, **STEEL, velocity=1.0)
        return float(f"{ball.hertz(*self.flat).stiffness:.3g}")

    @property
    def duration(self) -> float:
        """Three half periods [s] of a sheet's lowest bending vibration, as if held at one end.

        At most `LONGEST_RUN` periods of the impact.
        """
        E, nu, rho = STEEL["E"], STEEL["nu"], STEEL["rho"]
        bending = self.thickness * sqrt(E / (12 * (1 - nu**2) * rho))
        periods = 1.5 * self.length**2 / (LOWEST_FREQUENCY * bending)
        return float(f"{min(periods, LONGEST_RUN / _band(self.ball)):.1g}")

    def sentences(self, name: str, drop: bool = False) -> list[str]:
        """What was found, for the terminal; of a part that is dropped not how it is struck."""
        side = " × ".join(f"{1e3 * c:.4g}" for c in self.high - self.low)
        kind = "as its deck says" if self.of_deck else f"taken as {self.family}"
        outline = Outline(name, self.groups, self.low, self.high, 0.0)
        sentences = [f"{name}: {self.cells}, {side} mm; {kind}."]
        sentences += [*self.notes, f"it reaches {outline.text()}.", "taken, and what changes it:"]
        return [*sentences, *aligned(self.taken(drop))]

    def taken(self, drop: bool) -> list[tuple[str, str, str]]:
        """What was guessed: (what, its value, the key of the scene that changes it)."""
        section = "[deck]" if self.of_deck else "[geometry]"
        rows = []
        if "unit" in self.read:
            rows.append(("unit of the file", str(self.read["unit"]), f"{section} unit"))
        if "size" in self.read:
            finer = f", {self.finest:g} m at the site" if self.finest and not drop else ""
            key = f"{section} size, refine" if finer else f"{section} size"
            rows.append(("elements", f"{self.read['size']:g} m{finer}", key))
        if "density" in self.read:
            rho = f"{self.read['density']:g} kg/m³, for the deck has none"
            rows.append(("density", rho, f"{section} density"))
        if not self.of_deck:
            rows.append(("material", self.material, "[material] name"))
        if self.family == "Shell" and not self.of_deck:
            rows.append(("thickness", f"{self.thickness:g} m", "[material] thickness"))
        elif self.family == "Beam" and not self.of_deck:
            rows.append(("section", f"a bar of {self.thickness:g} m", "[material] section"))
        if drop:
            fall = "from 1 m, without supports, z up"
            return [*rows, ("fall", fall, "[drop] height, tilt")]
        rows.append(("held", self._held(), "[[supports]]"))
        site = f"{_rounded(self.point)} m along {self.direction}"
        rows.append(("struck", site, "[sites.tip] point, direction"))
        if self.radius is not None:
            rows.append(("patch", f"radius {self.radius:g} m", "[sites.tip] radius"))
        ball = f"steel ball, radius {1e3 * self.ball:g} mm, 1 m/s"
        rows.append(("striker", ball, "[impactor]"))
        if self.flat is not None:
            rows.append(("contact", "as on a flat face: nothing is known of it", "[contact]"))
        return rows

    def _held(self) -> str:
        """What holds the part, in words."""
        if self.of_deck:
            return "as in the deck"
        if self.where:
            return f"at the group {self.where!r}"
        if self.plane:
            return f"at the nodes on the plane through {_rounded(self.plane[0])} m"
        return "nowhere: it is free"


def aligned(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """Rows of a table as lines."""
    first, second = (max(len(row[k]) for row in rows) for k in (0, 1))
    return [f"  {a:<{first}}  {b:<{second}}  {c}" for a, b, c in rows]


def inspect_part(path: Path, free: bool = False, unit: str | None = None) -> Inspection:
    """Read or mesh the file of a part and look at it.

    `free`: a deck without its supports; `unit`: of the file, where it is known.

    Raises
    ------
    AntioscError
        It cannot be read or meshed, or is too large to be looked at.
    """
    check_size(path)
    part = foreign_part(path, free, unit)
    found = _inspect_mesh(part.mesh, part.read, part.structure)
    return replace(found, notes=tuple(part.notes), pieces=part.pieces)


def inspect_structure(part: Structure) -> Inspection:
    """Look at the largest of the meshes of a structure."""
    from antiosc.extension import with_parts

    meshes = [member.part.mesh for member in with_parts(part).members()]
    return _inspect_mesh(max(meshes, key=lambda mesh: (mesh.tdim, mesh.n_cells)), {}, part)


def _inspect_mesh(mesh: Mesh, read: Read, structure: Structure | None) -> Inspection:
    """Look at a mesh; `structure`: that of a deck, which has its own supports."""
    from antiosc.extension import Faces
    from antiosc.fem.platform import compat

    x = np.array(mesh.dolfinx.geometry.x)
    nodes = compat.geometry_nodes(mesh.dolfinx)
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    low, high = (np.array(_rounded(ends, size)) for ends in (x.min(axis=0), x.max(axis=0)))
    where = None if structure is not None else _group(mesh, SUPPORT_WORDS)
    struck = _nodes_of(mesh, _group(mesh, SITE_WORDS))
    held, plane = np.zeros(len(x), dtype=bool), None
    if where is not None:
        held[_nodes_of(mesh, where)] = True
    elif structure is None:
        held, plane = _plane(x, low, high, size)
    family = {1: "Beam", 2: "Shell", 3: "Solid"}[mesh.tdim]
    outer = Faces(mesh, mesh.tdim < 3)
    faces = _around(outer)
    longest = float((high - low).max())
    sites: Iterator[tuple[Array, Array, float | None]]
    if family == "Beam":
        sites = _on_lines(x, nodes, held, struck)
    elif mesh.gdim == 2:
        sites = _on_rim(x, faces, held)
    else:
        there = _on_faces(x, faces, outer, held, struck, size)
        meshed = "size" in read
        sites = (
            (point, direction, _radius(inside, edge, longest, meshed))
            for point, direction, inside, edge in there
        )
    sites = _spread(sites)
    if family == "Solid":
        sites = _outside_hollows(mesh, outer, sites)
    point, direction, radius = next(sites)
    radius = radius if family == "Solid" or mesh.gdim == 2 else None
    if structure is not None:
        point, direction, radius = _movable(structure, (point, direction, radius), sites)
    flat = _flat(mesh, outer, structure, (point, direction, radius))
    # each node that is not held has three dofs or more
    dofs = 3 * int((~held).sum()) if structure is None else structure.dofs
    count = min(COUNTS[family], dofs // DOFS_FOR_EACH)
    cells = f"{mesh.n_cells} cells of kind {mesh.cell}"
    return Inspection(
        family, read, low, high, list(mesh.groups), cells, where, plane,
        _rounded(point, size), _rounded(direction), radius, count, x, faces, held,
        of_deck=structure is not None, flat=flat, bars=_has_bars(mesh, structure),
    )  # fmt: skip


def _has_bars(mesh: Mesh, structure: Structure | None) -> bool:
    """Whether `extract(…, error="estimate")` takes a part."""
    from antiosc.extension import ModelErrors, refuse_dampers

    if structure is None:
        return mesh.tdim != 2 or mesh.gdim == 2 or mesh.cell == "triangle"
    try:
        refuse_dampers(structure, "an error bar")
        ModelErrors(structure)
    except InputError:
        return False
    return True


def _flat(
    mesh: Mesh, outer: Faces, structure: Structure | None, site: tuple[Array, Array, float | None]
) -> tuple[float, float] | None:
    """Modulus [Pa] and ratio of a flat face where nothing is known of the surface at a site."""
    from antiosc.extension import curvature
    from antiosc.reduce.site.surface import material_at, surface_at

    point, direction, radius = site
    try:
        if structure is not None:
            surface_at(structure, point, direction, radius, lengths=False)
        elif mesh.tdim > 1:
            curvature(mesh, outer, point, direction, lengths=False)
    except InputError:
        of_deck = None if structure is None else material_at(structure, point, direction)
        E, nu = (getattr(of_deck, name, None) for name in ("E", "nu"))
        if isinstance(E, float) and isinstance(nu, float):
            return E, nu
        return STEEL["E"], STEEL["nu"]
    return None


def _outside_hollows(
    mesh: Mesh, outer: Faces, sites: Iterator[tuple[Array, Array, float | None]]
) -> Iterator[tuple[Array, Array, float | None]]:
    """Sites of a solid; those in hollows into which the ball does not fit come last."""
    from antiosc.extension import curvature

    hollow = []
    for site in sites:
        try:
            bend = float(np.min(curvature(mesh, outer, *site[:2], lengths=False).values))
        except InputError:  # not known
            bend = 0.0
        if bend < -HOLLOW / LARGEST_BALL:  # nan of edges is not
            hollow.append(site)
        else:
            yield site
    yield from hollow


def _movable(
    structure: Structure,
    first: tuple[Array, Array, float | None],
    others: Iterator[tuple[Array, Array, float | None]],
) -> tuple[Array, Array, float | None]:
    """The first site that supports leave free, else one that they hold in part; with a patch."""
    from antiosc import Site
    from antiosc.reduce.site import functional

    partly = None
    for point, usual, radius in chain([first], others):
        ways = [(usual, radius), (usual, None), *((-axis, None) for axis in np.eye(3)[::-1])]
        for direction, own in ways:
            told: list[str] = []
            with contextlib.suppress(InputError), warnings_to(told.append):
                functional(structure, Site(point.tolist(), direction.tolist(), own, snap=True))
                if not any(PARTLY_HELD in one for one in told):
                    return point, direction, own
                partly = partly or (point, direction, own)
    return partly or first


def _spread(sites: Iterator[T]) -> Iterator[T]:
    """The first sites, then some of all others."""
    yield from islice(sites, MOST_TRIED)
    others = list(sites)
    yield from others[:: 1 + len(others) // MOST_TRIED]


def _group(mesh: Mesh, words: Sequence[str]) -> str | None:
    """The group of facets, edges or nodes that has the first of these words in its name."""
    lower = {
        n: n.lower()
        for n, parts in mesh.groups.items()
        if min(parts, default=mesh.tdim) < mesh.tdim
    }
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
    """Mask of the nodes on one side of the box, and a plane through it; none, None for a free
    part.
    """
    sides = [(2, low), (0, low), (1, low), (0, high), (1, high)]
    for axis, corner in sides:
        on = np.abs(x[:, axis] - corner[axis]) < ON_PLANE * size
        if min(3, len(x) // 4) <= on.sum() <= max(1.0, LARGEST_PLANE * len(x)):
            return on, [_rounded(corner, size), np.eye(3)[axis].tolist()]
    return np.zeros(len(x), dtype=bool), None


def _on_faces(
    x: Array, faces: IntArray, outer: Faces, held: BoolArray, struck: IntArray, size: float
) -> Iterator[tuple[Array, Array, float, float]]:
    """Point, direction into the part, distance from the edge of its side, length of its edges.

    The middle of the largest side, those far from the supports and above being preferred; then
    others of the part, the roomiest first.
    """
    corners = x[faces]
    middle = corners.mean(axis=1)
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area, normal = np.linalg.norm(sides, axis=1), outer.normals
    if outer.sheet:
        normal = _outward(x, faces, normal)
    side, edge_points = _sides(x, faces, normal)
    far = _from_supports(x, held, middle)
    total = np.bincount(side, area)
    away = np.bincount(side, area * (far + 0.2 * size)) / total
    above = np.bincount(side, area * normal[:, 2]) / total
    worth = total * away * (1.5 + above)
    chosen = side == np.argmax(worth)
    if len(struck):
        there = np.isin(faces, struck).all(axis=1)
        chosen = there if there.any() else chosen
    inside = np.full(len(faces), size)
    for number in np.unique(side[chosen]):
        if len(edge_points[number]):
            own = side == number
            inside[own] = cKDTree(edge_points[number]).query(middle[own])[0]
    room = (np.minimum(inside, ROOM * size) + ROOM * inside) * (far + ROOM * size)
    room[held[faces].any(axis=1)] = 0.0
    for best in np.lexsort((-room, -worth[side], ~chosen)):
        if not chosen[best] and len(edge_points[side[best]]):
            inside[best] = cKDTree(edge_points[side[best]]).query(middle[best])[0]
        ends = corners[best] - np.roll(corners[best], 1, axis=0)
        longest = float(np.linalg.norm(ends, axis=1).max())
        yield middle[best], -normal[best], float(inside[best]), longest


def _outward(x: Array, faces: IntArray, normal: Array) -> Array:
    """Normals of a sheet: outward if it is closed, else upward."""
    from antiosc.io.facets import SIDES, oriented

    triangles = faces[:, :3]
    ends = np.sort(np.concatenate([triangles[:, list(side)] for side in SIDES]), axis=1)
    closed = (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
    if faces.shape[1] == 3 and closed:
        a, b, c = x[oriented(x, faces)[0]].transpose(1, 0, 2)
        along = np.einsum("ni,ni->n", np.cross(b - a, c - a), normal)
    else:
        along = normal @ UP
    return np.asarray(normal * np.where(along < 0, -1.0, 1.0)[:, None])


def _from_supports(x: Array, held: BoolArray, points: Array) -> Array:
    """Distances of points (n, 3) from the next node that is held; equal ones of a free part."""
    if not held.any():
        return np.ones(len(points))
    return np.asarray(cKDTree(x[held]).query(points)[0])


def _around(outer: Faces) -> IntArray:
    """Corners of faces in order around each."""
    return outer.vertices[:, [0, 1, 3, 2] if outer.vertices.shape[1] == 4 else slice(None)]


def sides_of(x: Array, outer: Faces) -> IntArray:
    """Number of the side of the part on which each outer face lies."""
    return _sides(x, _around(outer), outer.normals)[0]


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
    both = both[np.abs(np.einsum("ij,ij->i", normal[a], normal[b])) > SAME_SIDE_COSINE]
    links = coo_matrix((np.ones(len(both)), owner[both].T), shape=(len(faces),) * 2)
    side = connected_components(links, directed=False)[1]
    at_edge = np.ones(len(owner), dtype=bool)
    at_edge[both.ravel()] = False
    points = np.concatenate([x[ends[:, 0]], x[ends].mean(axis=1), x[ends[:, 1]]])
    of_side = np.tile(np.where(at_edge, side[owner], -1), 3)
    return side, {int(s): points[of_side == s] for s in np.unique(side)}


def _on_lines(
    x: Array, nodes: IntArray, held: BoolArray, struck: IntArray
) -> Iterator[tuple[Array, Array, None]]:
    """Nodes of the group that is struck, or far from the supports; directions across the line."""
    own = struck if len(struck) else np.unique(nodes)
    for best in own[np.argsort(-_from_supports(x, held, x[own]), kind="stable")]:
        rows = nodes[(nodes == best).any(axis=1)]
        along = np.abs(x[rows[:, 1]] - x[rows[:, 0]]).sum(axis=0)
        axis = int(np.argmin(along[::-1]))  # z before y before x
        yield x[best], -np.eye(3)[2 - axis], None


def _on_rim(x: Array, faces: IntArray, held: BoolArray) -> Iterator[tuple[Array, Array, float]]:
    """Outer edges of a plane part, farthest from its supports first: middle, inward direction,
    radius."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), faces.shape[1])
    edge, count = np.unique(np.sort(ends), axis=0, return_inverse=True, return_counts=True)[1:]
    outer = count[edge.ravel()] == 1
    a, b = x[ends[outer].T]
    middle, length = (a + b) / 2, np.linalg.norm(b - a, axis=1)
    across = np.cross([0.0, 0.0, 1.0], b - a) / length[:, None]
    inward = x[faces[owner[outer]]].mean(axis=1) - middle
    across *= np.sign(np.einsum("ni,ni->n", across, inward))[:, None]
    far = _from_supports(x, held, middle)
    aside = np.abs(middle[:, 0] - x[:, 0].mean())
    for best in np.lexsort((aside, -np.round(middle[:, 1], 9), -far)):
        yield middle[best], across[best], float(f"{1.05 * length[best]:.2g}")


def _radius(inscribed: float, edge: float, length: float, meshed: bool) -> float:
    """Radius of the patch: within its side, and of the size of the faces of a finished mesh."""
    radius = min(RADIUS * inscribed, LARGEST_RADIUS * length)
    if not meshed:
        radius = min(max(radius, 1.05 * edge), 0.9 * inscribed)
    return float(f"{radius:.2g}")


def _rounded(values: Sequence[float] | Array, size: float = 1.0) -> list[float]:
    """Numbers to a hundred-thousandth of a size."""
    return [float(c) + 0.0 for c in np.round(values, 5 - floor(log10(size)))]


def draw(found: Inspection, path: Path, *, drop: bool = False) -> None:
    """A picture of the part: its outer faces; if not dropped, what holds it and the impact."""
    from antiosc.plot.charts import save_figure
    from antiosc.plot.surfaces import Deformed, deformed_figure

    height = 1e3 * (found.points[:, 2] - found.points[:, 2].min())
    shade = height if drop else found.held.astype(float)
    label = "height over its lowest point (mm)" if drop else "1: held"
    most = max(float(shade.max()), 1.0)
    part = Deformed(found.points, found.points, found.faces, shade, label, most)
    arrow = None if drop else (np.array(found.point), np.array(found.direction))
    save_figure(deformed_figure(part, arrow=arrow, whole_scale=True), path, dpi=100)


#: The geometry of a scene for which no part is given.
PLATE = """\
// A plate of 300 x 200 mm, held at one end; its size of elements is that of the scene.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("plate") = {1};
Physical Curve("clamp") = {4};
"""


def text(name: str, source: str, found: Inspection | None, drop: bool = False) -> str:
    """The scene as a text; `source` is the file of the part as the scene names it.

    `found`: what is known of the part. `drop`: it falls.
    """
    ending = Path(source).suffix.lower()
    deck = ending in DECK_ENDINGS if found is None else found.of_deck
    keys = (
        "unit",
        "size",
        "gdim",
        "merge",
        "density",
        "piece",
        "fragments",
        "solid",
        "cells",
        "order",
    )
    return rendered(
        Path(__file__).with_name("page") / "scene.toml",
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        deck=deck,
        closed=ending == ".stl",
        look=found,
        read=dict.fromkeys((*keys, "free", "order")) | dict(found.read if found else {}),
        family="Solid" if found is None else found.family,
        count=COUNTS["Solid"] if found is None else found.count,
        material=MATERIAL if found is None else found.material,
        point=[0.0, 0.0, 0.1] if found is None else found.point,
        direction=[0.0, 0.0, -1.0] if found is None else found.direction,
        band=_band(LARGEST_BALL if found is None else found.ball),
        ball=LARGEST_BALL if found is None else found.ball,
        drop=drop,
        json=json.dumps,
    )


def _band(radius: float) -> float:
    """Highest frequency [Hz] that the impact of the scene excites, two digits."""
    ball = Sphere(radius=radius, **STEEL, velocity=1.0)
    return float(f"{impact_band(ball, ball.hertz(STEEL['E'], STEEL['nu'])):.1e}")


def _picture(path: Path, about: str, draw_it: Callable[[Path], object]) -> list[str]:
    """The sentence that names a picture, which is drawn unless it exists."""
    if path.exists():
        return []
    try:
        draw_it(path)
    except AntioscError as error:
        return [f"{path.name} is not drawn: {error}"]
    return [f"{about}: {path}"]


def write_scene(
    path: str | os.PathLike[str],
    part: str | None = None,
    drop: bool = False,
    material: str | None = None,
    unit: str | None = None,
) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; its path, and sentences on the part.

    `material`: by name, of a part that is no deck; `unit`: of the file.

    Raises
    ------
    AntioscError
        It exists, the part cannot be read, or the material is not known: nothing is written.
    """
    chosen = materials.record(MATERIAL if material is None else material)
    if chosen.G is not None:
        raise InputError(
            f"{chosen.name} is not isotropic: write the scene with another material, then give "
            "its orientation with the name in [material]."
        )
    target = checks.new_file("the scene file", path)
    _absent(target)
    sentences: list[str] = []
    source = target.with_suffix(".geo") if part is None else Path(part)
    if part is None:
        _absent(source)
        files.write_text(source, PLATE, "the geometry")
        sentences.append(f"{source} is a plate to begin with; put your own part in its place.")
    else:
        checks.path("the file of the part", part)
    part = os.path.relpath(source, target.parent)
    if not f"{target.name}{part or ''}".isprintable():
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    try:
        with progress.doing(f"looking at {source.name}"):
            found = inspect_part(source, drop, unit)
    except OSError as error:
        raise InputError(f"{source.name} could not be looked at: {error.strerror}.") from None
    if not found.of_deck:
        flat = None if found.flat is None else (chosen.E, chosen.nu)
        found = replace(found, material=chosen.name, flat=flat)
    elif material is not None:
        raise InputError(
            f"{source.name} is a deck with materials of its own: leave --material away."
        )
    content = text(target.name, part, found, drop)
    temporary = files.part_name(target, ".toml")
    try:
        with temporary.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            if len(found.points) <= MOST_NODES:
                found = _tried(temporary, target.name, part, found, drop)
                temporary.write_text(text(target.name, part, found, drop), encoding="utf-8")
            os.link(temporary, target)  # fails if the target exists; a rename would replace it
        finally:
            temporary.unlink()
        files.clear_parts(target)
    except FileExistsError:
        _absent(target)
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    sentences += found.sentences(source.name, drop)
    pictures: dict[str, tuple[str, Callable[[Path], object]]] = {
        ".png": ("a picture of it", partial(draw, found, drop=drop))
    }
    if found.pieces:
        boxes = partial(pieces.draw, found.pieces, chosen=found.read.get("piece"))
        pictures[pieces.ENDING] = ("its pieces, of which piece = 2 is the second", boxes)
    for ending, (about, draw_it) in pictures.items():
        sentences += _picture(target.with_suffix(ending), about, draw_it)
    return target, sentences


def _tried(scene: Path, name: str, part: str, found: Inspection, drop: bool) -> Inspection:
    """The part as it can be struck: without error bars if need be; InputError if not even so."""
    reason: InputError | None = None
    for bars in (True, False)[not found.bars :]:
        one = replace(found, bars=bars)
        scene.write_text(text(name, part, one, drop), encoding="utf-8")
        try:
            one = replace(one, cell=_try(scene, name))
        except InputError as error:
            reason = reason or error
            continue
        if reason is None:
            return one
        message = f"it is struck without error bars, for otherwise {reason}"
        return replace(one, notes=(*one.notes, message))
    raise InputError(f"the part can be read, but not struck as it is: {reason}")


def _try(scene: Path, name: str) -> float | None:
    """Strike the part for a moment, or drop it once: InputError if that is refused.

    Returns the largest cell [m] that the impact allows at the site, where those there are larger.
    """
    calls = compiled(read(scene))
    brief: dict[str, dict[str, object]] = {
        "history": {"duration": MOMENT},
        "fall": {"until": 1},
        "model": {"error": None},  # which tells the size of the cells; the history's has the bars
    }
    for what, own in brief.items():
        call = getattr(calls, what)
        if call is not None:
            setattr(calls, what, replace(call, arguments={**call.arguments, **own}))
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            struck = results(
                calls, ("structure", "model", "impactor", "contact", "history", "fall")
            )
    except AntioscError as error:
        told = str(error).replace(str(scene), name)
        raise InputError(told) from None
    hit = struck.history
    cell = hit and coarse_at(struck.model, "", hit.assembly.contact_time_estimate)
    return float(f"{cell.allowed:.1g}") if cell else None


def _absent(target: Path) -> None:
    """InputError for a file that exists."""
    if os.path.lexists(target):  # `exists` raises for a name that no system takes
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        )
