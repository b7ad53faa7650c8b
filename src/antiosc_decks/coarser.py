"""Plane meshes of axisymmetric decks, made coarser where the solids revolved from them need less.

The boundary of each region of one material is followed in fewer, longer edges, and gmsh fills it
with quadrilaterals; the middle nodes of these edges stay on the boundary of the file. Ends of
supports, corners and curves are kept.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import ModuleType

import numpy as np

from antiosc.base._types import Array, BoolArray
from antiosc.io.by_gmsh import session
from antiosc.io.deck import Block, IntArray
from antiosc.io.neutral import connected

#: Boundary nodes are corners from this turn on.
CORNER = np.radians(20.0)
#: Largest distance of the boundary from an edge, before its middle is moved to the boundary, over
#: the length of the edge.
DEVIATION = 0.05
#: Largest length of a boundary edge over the distance to the boundary on the other side.
OVER_WALL = 2.0
#: Least factor on the size after a mesh of too many cells, and number of further meshes.
LARGER, TRIES = 1.15, 8
#: Number of triangles of the file, nearest to a point, among which the one around it is sought.
NEAREST = 24
#: Number of corners of gmsh's plane elements -> its number of their kind.
KINDS = {3: 2, 4: 3}


@dataclass(frozen=True)
class CoarsePlane:
    """A coarse mesh of quadrilaterals in the plane.

    Attributes
    ----------
    points : (n, 2); cells : (c, 4).
    between : (n, 4) nodes of the file between which each node lies.
    within : (c,) element of the file that holds the middle of each cell.
    """

    points: Array
    cells: IntArray
    between: IntArray
    within: IntArray

    def nodes(self, members: BoolArray) -> IntArray:
        """The nodes between members, of a mask of the nodes of the file, alone."""
        return np.flatnonzero(members[self.between].all(axis=1))

    def moment(self) -> float:
        """Integral of the radius over the area."""
        return _moment(self.points, _halves(self.cells))


@dataclass(frozen=True)
class Plane:
    """The plane mesh of a file.

    Attributes
    ----------
    points : (n, 2).
    cells : (c, 4) corners, anticlockwise; a triangle has one of them twice.
    regions : (c,) number of the region of one material of each cell.
    marks : (n, s) whether a node is in each of the sets whose ends are kept.
    """

    points: Array
    cells: IntArray
    regions: IntArray
    marks: BoolArray

    @classmethod
    def of(cls, blocks: Sequence[Block], points: Array, kinds: IntArray, marks: BoolArray) -> Plane:
        """The plane mesh of blocks of a deck; `kinds`: (c,) number of each element's material."""
        cells = np.vstack([block.corners[:, [0, 1, 2, -1]] for block in blocks])
        clockwise = _areas(points[:, :2], _halves(cells)).reshape(2, -1).sum(axis=0) < 0
        cells[clockwise] = cells[clockwise][:, [0, 3, 2, 1]]
        return cls(points[:, :2], cells, _regions(cells, kinds, len(points)), marks)

    def area(self) -> float:
        """The area."""
        return float(_areas(self.points, _halves(self.cells)).sum())

    def moment(self) -> float:
        """Integral of the radius over the area."""
        return _moment(self.points, _halves(self.cells))

    def boundary(self) -> tuple[IntArray, IntArray]:
        """Edges (e, 2) with their region on the left, and the region (e,) of each."""
        edges = np.vstack([self.cells[:, [k, (k + 1) % 4]] for k in range(4)])
        regions = np.tile(self.regions, 4)
        inner = edges[:, 0] == edges[:, 1]
        edges, regions = edges[~inner], regions[~inner]
        _, which, uses = np.unique(
            np.column_stack([np.sort(edges, axis=1), regions]),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        single = uses[which.ravel()] == 1
        return edges[single], regions[single]

    def coarser(self, size: float, most: int) -> CoarsePlane:
        """A mesh of cells of the `size`, or of larger ones if these are more than `most`."""
        outline = Outline(self, *self.boundary())
        mesh = outline.filled(size)
        for _ in range(TRIES):
            if len(mesh.cells) <= most:
                break
            size *= max(LARGER, np.sqrt(len(mesh.cells) / most))
            mesh = outline.filled(size)
        return mesh


class Outline:
    """The boundaries of the regions of a plane mesh, in pieces between kept nodes."""

    def __init__(self, plane: Plane, edges: IntArray, regions: IntArray) -> None:
        self.plane = plane
        self._edges, self._regions = edges, regions
        self._walls = self._wall_of_nodes()
        self._paths = list(self._between_corners())

    def filled(self, size: float) -> CoarsePlane:
        """A mesh whose cells have the `size`, and less where walls are thin."""
        gmsh = session()
        try:
            return self._by_gmsh(gmsh, self._pieces(2 * size))
        finally:
            gmsh.finalize()

    # --- Edges ------------------------------------------------------------------------------------

    def _wall_of_nodes(self) -> Array:
        """Distance of each node from a boundary that faces its own; inf inside and without one."""
        x = self.plane.points
        a, b = x[self._edges].transpose(1, 0, 2)
        middle, along = (a + b) / 2, b - a
        inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        walls = np.full(len(x), np.inf)
        for k, edge in enumerate(self._edges):
            away = middle - middle[k]
            distance = np.linalg.norm(away, axis=1)
            facing = (inward @ inward[k] < -0.5) & (away @ inward[k] > 0.8 * distance)
            wall = distance[facing].min(initial=np.inf)
            walls[edge] = np.minimum(walls[edge], wall)
        return walls

    def _between_corners(self) -> Iterator[IntArray]:
        """Sequences of boundary nodes between corners; a closed one ends with its first node."""
        edges = np.unique(np.sort(self._edges, axis=1), axis=0)
        beside: dict[int, list[int]] = {}
        for a, b in edges.tolist():
            beside.setdefault(a, []).append(b)
            beside.setdefault(b, []).append(a)
        corners = {node for node, ends in beside.items() if self._is_corner(node, ends)}
        left = {(a, b) for a, ends in beside.items() for b in ends}
        for start in [*sorted(corners), *sorted(beside)]:
            for following in beside[start]:
                if (start, following) in left:
                    path = [start, following]
                    while path[-1] not in corners and path[-1] != start:
                        path += [node for node in beside[path[-1]] if node != path[-2]][:1]
                    left -= {pair for a, b in pairwise(path) for pair in ((a, b), (b, a))}
                    yield np.array(path)

    def _is_corner(self, node: int, ends: list[int]) -> bool:
        """Whether a boundary node with these neighbours is kept."""
        if len(ends) != 2:
            return True
        x, marks = self.plane.points, self.plane.marks
        before, after = x[node] - x[ends[0]], x[ends[1]] - x[node]
        turn = np.arccos(np.clip(before @ after / _length(before) / _length(after), -1, 1))
        on_edges = [marks[node] & marks[end] for end in ends]
        return bool(turn > CORNER or any((marks[node] != edge).any() for edge in on_edges))

    def _pieces(self, longest: float) -> dict[tuple[int, int], IntArray]:
        """Kept ends of each coarse edge -> the nodes of the file along it, in both directions."""
        pieces = {}
        for path in self._paths:
            for piece in self._divided(path, longest):
                pieces[int(piece[0]), int(piece[-1])] = piece
                pieces[int(piece[-1]), int(piece[0])] = piece[::-1]
        return pieces

    def _divided(self, path: IntArray, longest: float) -> Iterator[IntArray]:
        """The parts of a path that coarse edges replace."""
        x = self.plane.points[path]
        s = np.concatenate([[0.0], np.linalg.norm(np.diff(x, axis=0), axis=1).cumsum()])
        finest = min(longest, OVER_WALL * float(self._walls[path].min()))
        count = max(int(np.ceil(s[-1] / finest - 1e-6)), 3 if path[0] == path[-1] else 1)
        kept = np.unique(np.abs(s[:, None] - s[-1] * np.arange(count + 1) / count).argmin(axis=0))
        todo = list(pairwise(kept.tolist()))[::-1]
        while todo:
            first, last = todo.pop()
            off = _off_chord(x[first : last + 1])
            if off.max(initial=0.0) > DEVIATION * _length(x[last] - x[first]):
                middle = first + int(off.argmax())
                todo += [(middle, last), (first, middle)]
            else:
                yield path[first : last + 1]

    # --- Cells ------------------------------------------------------------------------------------

    def _by_gmsh(self, gmsh: ModuleType, pieces: dict[tuple[int, int], IntArray]) -> CoarsePlane:
        """The regions within the coarse edges, filled."""
        x = self.plane.points
        geo = gmsh.model.geo
        tags = {node: geo.addPoint(*x[node], 0.0) for node in {a for a, _ in pieces}}
        lines: dict[tuple[int, int], int] = {}
        for a, b in pieces:
            lines[a, b] = -lines[b, a] if (b, a) in lines else geo.addLine(tags[a], tags[b])
        surfaces = {}
        for region in np.unique(self._regions):
            loops = self._loops(self._edges[self._regions == region], tags.keys())
            curves = [geo.addCurveLoop([lines[pair] for pair in pairwise(loop)]) for loop in loops]
            surfaces[geo.addPlaneSurface(curves)] = int(region)
        geo.synchronize()
        for line in {abs(tag) for tag in lines.values()}:
            gmsh.model.mesh.setTransfiniteCurve(line, 2)
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.model.mesh.generate(2)
        node_of = {self._node_at(gmsh, tag): node for node, tag in tags.items()}
        return self._quartered(gmsh, surfaces, node_of, pieces)

    def _node_at(self, gmsh: ModuleType, point: int) -> int:
        """Gmsh's node at one of its points."""
        return int(gmsh.model.mesh.getNodes(0, point)[0][0])

    def _loops(self, edges: IntArray, kept: Container[int]) -> list[list[int]]:
        """The kept nodes along each closed boundary of a region, the outer one first."""
        x = self.plane.points
        outgoing: dict[int, list[int]] = {}
        for a, b in edges.tolist():
            outgoing.setdefault(a, []).append(b)
        loops = []
        while outgoing:
            loop = [next(iter(outgoing))]
            while len(loop) < 2 or loop[-1] != loop[0]:
                ends = outgoing[loop[-1]]
                if len(ends) > 1 and len(loop) > 1:  # the next one clockwise bounds the same cells
                    back, *ahead = x[[loop[-2], *ends]] - x[loop[-1]]
                    turns = [_clockwise(back, out) for out in ahead]
                    ends.insert(0, ends.pop(int(np.argmin(turns))))
                loop.append(ends.pop(0))
                if not ends:
                    del outgoing[loop[-2]]
            loops.append([node for node in loop if node in kept])
        loops = [loop if loop[0] == loop[-1] else [*loop, loop[0]] for loop in loops]
        return sorted(loops, key=lambda loop: -float(np.ptp(x[loop], axis=0).max()))

    def _quartered(
        self,
        gmsh: ModuleType,
        surfaces: dict[int, int],
        node_of: dict[int, int],
        pieces: dict[tuple[int, int], IntArray],
    ) -> CoarsePlane:
        """Quadrilaterals: gmsh's elements, divided at their middles and those of their edges."""
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        points = [*np.reshape(coordinates, (-1, 3))[:, :2]]
        index = {int(tag): k for k, tag in enumerate(tags)}
        kept = {index[tag]: node for tag, node in node_of.items()}
        between = {k: np.full(4, node) for k, node in kept.items()}
        middles: dict[tuple[int, int], int] = {}
        cells, regions = [], []

        def middle(a: int, b: int) -> int:
            pair = (min(a, b), max(a, b))
            if pair not in middles:
                middles[pair] = len(points)
                piece = pieces.get((kept.get(a, -1), kept.get(b, -1)))
                if piece is None:
                    points.append((points[a] + points[b]) / 2)
                else:
                    place, ends = _halfway(self.plane.points, piece)
                    between[len(points)] = np.repeat(ends, 2)
                    points.append(place)
            return middles[pair]

        for surface, region in surfaces.items():
            for corners, kind in KINDS.items():
                _, nodes = gmsh.model.mesh.getElementsByType(kind, surface)
                for cell in np.reshape(nodes, (-1, corners)):
                    ring = [index[int(tag)] for tag in cell]
                    centre = len(points)
                    points.append(np.mean([points[k] for k in ring], axis=0))
                    sides = [middle(a, b) for a, b in pairwise([*ring, ring[0]])]
                    cells += [[ring[k], sides[k], centre, sides[k - 1]] for k in range(corners)]
                    regions += corners * [region]
        return self._located(np.array(points), np.array(cells), np.array(regions), between)

    def _located(
        self, points: Array, cells: IntArray, regions: IntArray, between: dict[int, IntArray]
    ) -> CoarsePlane:
        """The mesh, with the places of its nodes and cells in the file."""
        used, cells = np.unique(cells, return_inverse=True)
        cells = cells.reshape(-1, 4)
        within = np.zeros(len(cells), dtype=np.int64)
        nodes = np.zeros((len(used), 4), dtype=np.int64)
        for region in np.unique(regions):
            those = np.flatnonzero(regions == region)
            within[those] = self._holding(region, points[used][cells[those]].mean(axis=1))
            inside = np.unique(cells[those])
            nodes[inside] = self.plane.cells[self._holding(region, points[used][inside])]
        for row, old in enumerate(used.tolist()):
            if old in between:
                nodes[row] = between[old]
        return CoarsePlane(points[used], cells, nodes, within)

    def _holding(self, region: int, places: Array) -> IntArray:
        """The element of the file in a region that holds each place, or is nearest to it."""
        from scipy.spatial import cKDTree  # the reading process loads it for coarser planes alone

        plane = self.plane
        halves = _halves(plane.cells)
        of_region = np.flatnonzero(np.tile(plane.regions, 2) == region)
        of_region = of_region[_areas(plane.points, halves[of_region]) > 0]
        corners = plane.points[halves[of_region]]
        near = cKDTree(corners.mean(axis=1)).query(places, k=min(NEAREST, len(of_region)))[1]
        near = near.reshape(len(places), -1)
        a, b, c = corners[near].transpose(2, 0, 1, 3)
        p = places[:, None]
        shares = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)])
        best = (shares / shares.sum(axis=0)).min(axis=0).argmax(axis=1)
        return of_region[near[np.arange(len(places)), best]] % len(plane.cells)


def _regions(cells: IntArray, kinds: IntArray, count: int) -> IntArray:
    """(c,) number of the connected cells of one material that each cell belongs to."""
    edges = np.vstack([np.sort(cells[:, [k, (k + 1) % 4]], axis=1) for k in range(4)])
    owners = np.tile(np.arange(len(cells)), 4)
    proper = edges[:, 0] != edges[:, 1]
    keys = np.column_stack([edges, kinds[owners]])[proper]
    _, numbers = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(numbers.ravel(), kind="stable")
    sorted_numbers, sorted_owners = numbers.ravel()[order], owners[proper][order]
    same = sorted_numbers[1:] == sorted_numbers[:-1]
    pairs = np.stack([sorted_owners[1:][same], sorted_owners[:-1][same]], axis=1)
    return connected([pairs], len(cells))


def _halves(cells: IntArray) -> IntArray:
    """(2 c, 3): the two triangles of each cell, the first of all cells first."""
    return np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _areas(points: Array, triangles: IntArray) -> Array:
    """Areas of triangles, negative for clockwise ones."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    return _cross(b - a, c - a) / 2


def _moment(points: Array, triangles: IntArray) -> float:
    return float(_areas(points, triangles) @ points[triangles, 0].mean(axis=1))


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _clockwise(start: Array, end: Array) -> float:
    """Angle from `start` clockwise to `end`, above 0 and up to a full turn."""
    angle = np.arctan2(-_cross(start, end), start @ end) % (2 * np.pi)
    return float(angle) or 2 * np.pi


def _off_chord(x: Array) -> Array:
    """Distances of points from the line through the first and the last."""
    chord = x[-1] - x[0]
    length = _length(chord)
    if length == 0:
        return np.linalg.norm(x - x[0], axis=1)
    return np.abs(_cross(x - x[0], chord)) / length


def _halfway(points: Array, piece: IntArray) -> tuple[Array, IntArray]:
    """The middle along a sequence of nodes, and the two nodes beside it."""
    x = points[piece]
    s = np.concatenate([[0.0], np.linalg.norm(np.diff(x, axis=0), axis=1).cumsum()])
    k = int(np.clip(np.searchsorted(s, s[-1] / 2) - 1, 0, len(piece) - 2))
    share = (s[-1] / 2 - s[k]) / (s[k + 1] - s[k])
    return x[k] + share * (x[k + 1] - x[k]), piece[k : k + 2]
