"""Load vectors of sites on matrices: at a dof, by a vector, or at a node of a map."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
from scipy.spatial import cKDTree

from antiosc.base._types import Array
from antiosc.base.checks import floats
from antiosc.base.errors import InputError, SiteError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.reach import Reach, check_reach
from antiosc.fem.structure import NodalMatrices, StructureMatrices, in_space
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.site.place import Functional
from antiosc.reduce.site.site import LEAST_FREE_SHARE, Site, constrained, tangents

#: Largest distance of a point from the node that it denotes, over the part's size.
AT_NODE = 1e-6
PATCH = "matrices have no surface for a patch: leave radius out, and the site is a node or a row."


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
        raise InputError(PATCH)

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


def functional_on_nodes(structure: Structure, site: Site) -> Functional | None:
    """The load vector of a site at a node or point; None for a site given by a row or a vector.

    Raises
    ------
    InputError
        A node or dof that is not in the map, a point that is no node, a site whose dofs are fixed.
    """
    matrices = cast(NodalMatrices, structure.matrices)
    if site.node is None and site.direction is None:
        return None
    if site.radius is not None:
        raise InputError(PATCH)
    if site.direction is None:
        return _at_row(structure, matrices, site)

    direction = in_space(site.direction)
    direction /= np.linalg.norm(direction)
    node = _nearest_node(matrices, site) if site.node is None else site.node
    rows = np.flatnonzero(matrices.map.node == node)
    if not len(rows):
        raise InputError(f"node {node} is not in the matrices' map of nodes and dofs.")

    point = _position(matrices, rows[0])
    b = _freed(structure, _along(matrices, node, direction))
    if b is None:
        raise SiteError(constrained(f"node {node}"))
    functional = Functional(b, point=point, direction=direction)
    if not site.tangential:
        return functional

    sides = []
    for (side,) in tangents(direction[None], not (matrices.map.component == 3).any()):
        b = _freed(structure, _along(matrices, node, side))
        sides.append(Functional(np.zeros(structure.size) if b is None else b, None, 0, point, side))
    return replace(functional, across=tuple(sides))


def _at_row(structure: Structure, matrices: NodalMatrices, site: Site) -> Functional:
    """The functional of one dof of a node."""
    component = cast(int, site.dof)
    row = matrices.map.row(cast(int, site.node), component)
    b = np.zeros(structure.size)
    b[row] = 1.0
    freed = _freed(structure, b)
    if freed is None:
        raise SiteError(constrained(f"node {site.node}"))
    direction = np.eye(3)[component - 1] if 1 <= component <= 3 else None
    return Functional(freed, point=_position(matrices, row), direction=direction)


def _along(matrices: NodalMatrices, node: int, direction: Array) -> Array:
    """Load vector of a unit force along `direction` on a node, fixed dofs included."""
    b = np.zeros(len(matrices.map.node))
    axis = matrices.map.component - 1
    loaded = (matrices.map.node == node) & (axis >= 0) & (axis < 3)
    b[loaded] = direction[axis[loaded]]
    return b


def _freed(structure: Structure, b: Array) -> Array | None:
    """The load on free dofs; None if supports hold it."""
    size = float(np.linalg.norm(b))
    b[structure.fixed] = 0.0
    held = float(np.linalg.norm(b)) <= LEAST_FREE_SHARE * size
    return None if held or not size else b


def _position(matrices: NodalMatrices, row: int) -> Array | None:
    """Coordinates of the node of a row; None if unknown."""
    point = matrices.map.points[row]
    return point if np.isfinite(point).all() else None


def _nearest_node(matrices: NodalMatrices, site: Site) -> int:
    """The number of the node at the point of a site."""
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
    distance, nearest = cKDTree(points).query(point)
    if site.snap:
        snap = None if site.snap is True else site.snap
        check_reach(Reach("the point of the site", snap), point, points, int(nearest))
    elif distance > AT_NODE * float(np.ptp(points, axis=0).max()):
        raise InputError(
            f"the point is no node: the nearest is node {numbers[nearest]}, {distance:.3g} m "
            "away; use that, or Site(..., snap=True)."
        )
    return int(numbers[nearest])
