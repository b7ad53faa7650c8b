"""The volume of a mesh beside that of its solids in CAD, and meshes that follow tight bends.

A second-order cell that folds over at a bend tighter than the elements is straightened, and then
cuts the bend off: a heat sink by others got 3.2 % more mass. Elements by the curvature prevent it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MeshError
from antiosc.base.texts import percent
from antiosc.io.neutral import CellKind, IntArray, RawMesh, Solid

#: Share of the volume in CAD by which a mesh may differ without a word.
TOLD = 5e-3
#: Elements around a full turn that follow bends, in the order of trial: with 6 the heat sink is off
#: by 0.2 % at 1.7 times as many cells; walls between holes that are thinner than these need 8, and
#: thin walls that are bent 10.
AROUND = (6.0, 8.0, 10.0)
#: Times as many cells a mesh that follows bends may have.
MOST_TIMES = 4.0
#: Processor time [s] of such a mesh.
MOST_TIME = 40.0
#: Words of the sentences on volumes.
FOLLOW, CUT = "elements follow its curvature", "elements cut off bends and holes"
#: Cells whose volumes are computed at once.
_BLOCK = 50_000
#: Units of volumes: least value [m³], of 1 m³ in it, name.
UNITS = ((0.1, 1.0, "m³"), (1e-7, 1e6, "cm³"), (0.0, 1e9, "mm³"))
#: Barycentric coordinates of points in a tetrahedron and their weights: cubics are exact.
_POINTS = np.vstack([np.full((1, 4), 1 / 4), np.full((4, 4), 1 / 6) + np.eye(4) / 3])
_WEIGHTS = np.array([-4 / 5, 9 / 20, 9 / 20, 9 / 20, 9 / 20]) / 6
#: Ends of the sides of second-order tetrahedra in gmsh's order.
_FIRST, _SECOND = np.array([(0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)]).T


def scaled(solids: Sequence[Solid], factor: float) -> list[Solid]:
    """The solids with all lengths multiplied by a factor."""
    return [(first, end, factor**3 * volume) for first, end, volume in solids]


def shares(solids: Sequence[Solid], rows: IntArray, kind: CellKind) -> Array:
    """`RawMesh.shares` of the cells `rows` of a file; none if the volume of any is unknown."""
    if kind.shape != "tetrahedron" or not solids:
        return np.zeros(0)
    of_row = np.full(max(int(rows.max(initial=-1)) + 1, *(end for _, end, _ in solids)), np.nan)
    for first, end, volume in solids:
        of_row[first:end] = volume / (end - first)
    of_cells = of_row[rows]
    return of_cells if np.isfinite(of_cells).all() else np.zeros(0)


def of_mesh(points: Array, cells: IntArray) -> float:
    """Volume of tetrahedra in gmsh's order, with 4 or 10 nodes [m³]."""
    slopes = _slopes(cells.shape[1])
    total = 0.0
    for start in range(0, len(cells), _BLOCK):
        x = points[cells[start : start + _BLOCK]]
        a, b, c = np.moveaxis(slopes @ x[:, None], 2, 0)
        det = np.einsum("cqi,cqi->cq", a, np.cross(b, c))
        total += float(np.abs(det @ _WEIGHTS).sum())
    return total


def _slopes(nodes: int) -> Array:
    """Derivatives (points, 3, nodes) of the shape functions of a tetrahedron at `_POINTS`."""
    of_corners = np.vstack([-np.ones((1, 3)), np.eye(3)]).T
    if nodes == 4:
        return np.repeat(of_corners[None], len(_POINTS), axis=0)
    at = _POINTS[:, None]
    corners = (4 * at - 1) * of_corners
    sides = at[..., _FIRST] * of_corners[:, _SECOND] + at[..., _SECOND] * of_corners[:, _FIRST]
    return np.concatenate([corners, 4 * sides], axis=2)


def excess(raw: RawMesh) -> float:
    """By which share the volume of a mesh is larger than in CAD; 0 if that is unknown."""
    mesh, cad = raw.volumes
    return mesh / cad - 1 if cad > 0 else 0.0


def told(raw: RawMesh, name: str, straight: bool = False) -> list[str]:
    """A sentence (in a list) on a mesh whose volume differs from that in CAD.

    `straight`: order 1 was asked for, whose faces are known to be flat: none.
    """
    if straight or abs(excess(raw)) <= TOLD:
        return []
    factor, unit = next((f, unit) for least, f, unit in UNITS if raw.volumes[1] >= least)
    mesh, cad = (f"{factor * volume:.4g} {unit}" for volume in raw.volumes)
    return [
        f"{name}: the mesh has {mesh}, the part in CAD {cad}: its mass is {_differs(raw)}, as "
        f"{CUT}; a smaller size follows them."
    ]


def _differs(raw: RawMesh) -> str:
    """The difference in words, as "3.2 % too large"."""
    change = excess(raw)
    return f"{percent(abs(change))} too {'large' if change > 0 else 'small'}"


class Following(NamedTuple):
    """How a file is meshed with elements by its curvature; `around` 0: they do not help."""

    around: float
    sentence: str = ""


#: By file and size, for the next reading of that file, with other elements at a site.
_known: dict[Hashable, Following] = {}


def followed(
    plain: Callable[[], RawMesh],
    following: Callable[[float], RawMesh],
    key: Hashable,
    name: str,
    least: float = 0.0,
) -> RawMesh:
    """The mesh `plain`; or `following` the curvature, if the volume of the former is off.

    `following`: the mesh with so many elements around a full turn; `key`: file and size; `least`:
    how many the mesh `plain` has.
    """
    known = _known.get(key)
    if known and known.around:
        raw = _attempted(following, known.around)
        if raw is not None and abs(excess(raw)) <= TOLD:
            return _with_remark(raw, known.sentence)
    first = plain()
    if abs(excess(first)) <= TOLD or first.kind.order == 1 or known == Following(0.0):
        return first
    around, best = _nearest(first, following, least)
    if not around:
        _known[key] = Following(0.0)
        return first
    turn = f"{around:g} around a full turn"
    sentence = f"{name}: {FOLLOW}, {turn}, since its mass was {_differs(first)} without."
    _known[key] = Following(around, sentence)
    return _with_remark(best, sentence)


def _nearest(
    first: RawMesh, following: Callable[[float], RawMesh], least: float
) -> tuple[float, RawMesh]:
    """(elements around a full turn, mesh): the fewest above `least` with which the volume is right,
    or the nearest to that; 0 and the first mesh if none is nearer.
    """
    best = 0.0, first
    for around in (number for number in AROUND if number > least):
        raw = _attempted(following, around)
        if raw is None or len(raw.cells) > MOST_TIMES * len(first.cells):
            break
        if abs(excess(raw)) < abs(excess(best[1])):
            best = around, raw
        if abs(excess(raw)) <= TOLD:
            break
    return best


def _with_remark(raw: RawMesh, sentence: str) -> RawMesh:
    """The mesh with one remark more."""
    return replace(raw, remarks=[*raw.remarks, sentence])


def _attempted(following: Callable[[float], RawMesh], around: float) -> RawMesh | None:
    """The mesh with so many elements around a full turn; None if it cannot be made."""
    try:
        return following(around)
    except MeshError:
        return None
