"""Load vectors of sites on matrices: at a dof, by a vector, or at the nodes of a map.

On nodes a patch has Hertz's pressure √(1 − r²/a²) over the circle of radius a across the direction
of impact; each node takes the load of the points that are next to it. Nodes below the surface do
not count: those that another node covers against the direction of impact.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import (
    floats,
)
from antiosc.base.errors import InputError, SiteError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.reach import Reach, check_reach
from antiosc.fem.structure import NodalMatrices, StructureMatrices, in_space
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.site.site import LEAST_FREE_SHARE, Functional, Site, constrained, tangents


def algebraic(structure: StructureMatrices, site: Site) -> Functional:
    """The functional of a site that is given by a dof or by a vector."""
    first, last = algebra.row_range(structure.K)
    n = algebra.size(structure.K)
    comm = algebra.communicator(structure.K)
    if site.node is not None:
        raise InputError(
            "the nodes of this structure have no numbers: Site(node=…) needs a mesh of a file that "
            "numbers them, with direction=, or matrices with a map, Structure.from_files(K, M, "
            "map=…)."
        )
    if site.radius is not None:
        raise InputError("radius needs a mesh; a site given by dof or vector has none.")
    if site.vector is not None:
        b = floats("vector", site.vector, (n,))[first:last].copy()
    else:
        if not isinstance(site.dof, int) or not 0 <= site.dof < n:
            raise InputError(f"dof must be a number from 0 to {n - 1}; got {site.dof!r}.")
        b = np.zeros(last - first)
        if first <= site.dof < last:
            b[site.dof - first] = 1.0
    size = norm(comm, b)
    b[structure.fixed[structure.fixed < len(b)]] = 0.0
    if norm(comm, b) <= LEAST_FREE_SHARE * size:
        raise SiteError(constrained("the site"))
    return Functional(b)


#: Largest distance of a point from the node that it denotes, over the part's size.
AT_NODE = 1e-6
#: Radius, over that of the patch, within which nodes may take load from its edge.
NEIGHBOURHOOD = 2.0
#: Rings of points on the circle of a patch.
CIRCLE_RINGS = 64
#: Points per ring.
SPOKES = 128
#: A node covers another if the cosine between their connection and the direction exceeds this.
COVERS = 0.75


def functional_on_nodes(structure: Structure, site: Site) -> Functional | None:
    """The load vector of a site at a node or point; None for a site given by a row or a vector.

    Raises
    ------
    InputError
        A node or dof that is not in the map, a point that is no node, a patch without nodes, a
        site whose dofs are fixed.
    """
    matrices = cast(NodalMatrices, structure.matrices)
    if site.node is not None and site.direction is None:
        b = np.zeros(structure.size)
        component = cast(int, site.dof)
        row = matrices.map.row(site.node, component)
        b[row] = 1.0
        direction = np.eye(3)[component - 1] if 1 <= component <= 3 else None
        return _checked_load(structure, b, f"node {site.node}", _position(matrices, row), direction)
    if site.direction is None:
        return None
    direction = in_space(site.direction)
    direction /= np.linalg.norm(direction)
    if site.node is not None:
        rows = np.flatnonzero(matrices.map.node == site.node)
        if not len(rows):
            raise InputError(f"node {site.node} is not in the matrices' map of nodes and dofs.")
        nodes = np.array([site.node])
        weights = np.ones(1)
        point = _position(matrices, rows[0])
        label = f"node {site.node}"
        if site.radius is not None:
            raise InputError("a patch needs a point: Site(point=…, direction=…, radius=…).")
    else:
        nodes, weights, point = _at_point(matrices, site, direction)
        label = f"the site at ({', '.join(f'{c:.6g}' for c in point)}) m"
    checked_load = _checked_load(
        structure, _load(matrices, nodes, weights, direction), label, point, direction, site.radius
    )
    if not site.tangential:
        return checked_load
    sides = []
    for (side,) in tangents(direction[None], not (matrices.map.component == 3).any()):
        b = _load(matrices, nodes, weights, side)
        size = float(np.linalg.norm(b))
        b[structure.fixed] = 0.0
        if float(np.linalg.norm(b)) <= LEAST_FREE_SHARE * size:
            b[:] = 0.0  # the supports hold the site along it
        sides.append(Functional(b, point=point, direction=side))
    return replace(checked_load, across=tuple(sides))


def _load(matrices: NodalMatrices, nodes: IntArray, weights: Array, direction: Array) -> Array:
    """Load vector of a force along `direction` on weighted nodes, fixed dofs included."""
    b = np.zeros(len(matrices.map.node))
    order = np.argsort(nodes)
    index = np.searchsorted(nodes[order], matrices.map.node).clip(max=len(nodes) - 1)
    is_mapped = nodes[order][index] == matrices.map.node
    axis = matrices.map.component - 1
    is_displacement = is_mapped & (axis >= 0) & (axis < 3)
    b[is_displacement] = weights[order][index[is_displacement]] * direction[axis[is_displacement]]
    return b


def _checked_load(
    structure: Structure,
    b: Array,
    label: str,
    at: Array | None,
    direction: Array | None,
    radius: float | None = None,
) -> Functional:
    """The functional with b on free dofs; InputError if the site cannot move."""
    size = float(np.linalg.norm(b))
    b[structure.fixed] = 0.0
    if float(np.linalg.norm(b)) <= LEAST_FREE_SHARE * size or not size:
        raise SiteError(constrained(label))
    return Functional(b, radius, 0.0, at, direction)


def _position(matrices: NodalMatrices, row: int) -> Array | None:
    """Coordinates of the node of a row; None if unknown."""
    point = matrices.map.points[row]
    if np.isfinite(point).all():
        return point
    return None


def _at_point(
    matrices: NodalMatrices, site: Site, direction: Array
) -> tuple[IntArray, Array, Array]:
    """(nodes, weights with sum 1, point) of a point among the nodes of the matrices."""
    if not matrices.located:
        raise InputError(
            "the coordinates of the nodes are not known: give them in the map, or use "
            "Site(node=…, dof=…)."
        )
    if isinstance(site.point, str):
        raise InputError("matrices have no groups: give the point's coordinates.")
    points, _ = matrices.nodes()
    located = np.isfinite(matrices.map.points).all(axis=1)
    numbers = np.unique(matrices.map.node[located])
    point = in_space(site.point or ())
    tree = cKDTree(points)
    if site.radius is None:
        distance, nearest = tree.query(point)
        size = float(np.ptp(points, axis=0).max())
        if site.snap:
            snap = None if site.snap is True else site.snap
            check_reach(Reach("the point of the site", snap), point, points, int(nearest))
        elif distance > AT_NODE * size:
            raise InputError(
                f"the point is no node: the nearest is node {numbers[nearest]}, {distance:.3g} m "
                "away; use that, Site(..., snap=True), or a patch with radius=."
            )
        return numbers[[nearest]], np.ones(1), points[nearest]
    candidates = np.array(tree.query_ball_point(point, NEIGHBOURHOOD * site.radius), dtype=int)
    if len(candidates):
        candidates = candidates[~_covered(points[candidates], direction, site.radius)]
    is_loaded = np.zeros(0, dtype=bool)
    if len(candidates):
        is_loaded = np.linalg.norm(points[candidates] - point, axis=1) < site.radius
    if not is_loaded.any():
        distance, nearest = tree.query(point)
        raise InputError(
            f"the patch of radius {site.radius:g} m has no node on the surface: the nearest node, "
            f"{numbers[nearest]}, is {distance:.3g} m away; increase the radius or refine the mesh."
        )
    offsets = points[candidates] - point
    offsets = offsets - np.outer(offsets @ direction, direction)
    next_to = cKDTree(offsets).query(_hertz(site.radius, direction))[1]
    weights = np.bincount(next_to, minlength=len(candidates)) / len(next_to)
    loaded = weights > 0
    return numbers[candidates[loaded]], weights[loaded], point


def _covered(points: Array, direction: Array, radius: float) -> BoolArray:
    """Mask of the points that lie behind another point, seen along the direction of impact."""
    covered = np.zeros(len(points), dtype=bool)
    for k, point in enumerate(points):
        offsets = points - point
        distance = np.linalg.norm(offsets, axis=1)
        in_front = (-(offsets @ direction) > COVERS * distance) & (distance > AT_NODE * radius)
        covered[k] = in_front.any()
    return covered


def _hertz(radius: float, direction: Array) -> Array:
    """Points (n, 3) perpendicular to `direction` at which equal forces approximate Hertz's
    pressure.
    """
    basis = np.linalg.svd(direction[None, :])[2][1:]
    # the load within r is 1 - (1 - r²/a²)^(3/2) of the whole
    share = (np.arange(CIRCLE_RINGS) + 0.5) / CIRCLE_RINGS
    r = radius * np.sqrt(1 - (1 - share) ** (2 / 3))
    angle = 2 * np.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray((r[:, None, None] * circle).reshape(-1, 2) @ basis)
