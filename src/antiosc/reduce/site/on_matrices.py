"""Load vectors of sites on matrices: at a dof, by a vector, or at a node of a map."""

from __future__ import annotations

from typing import cast

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import floats
from antiosc.base.errors import InputError, SiteError
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.structure import NodalMatrices, StructureMatrices, in_space
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.site.place import Functional
from antiosc.reduce.site.site import LEAST_FREE_SHARE, Site, constrained, tangents

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
    return Functional(b[:, None])


def functional_on_nodes(structure: Structure, site: Site) -> Functional | None:
    """The load vectors of a site at a node; None for a site given by a row or a vector.

    Raises
    ------
    InputError
        A node or dof that is not in the map, a point, a site whose dofs are fixed.
    """
    matrices = cast(NodalMatrices, structure.matrices)
    node, component = site.node, site.dof
    if node is None and site.direction is None:
        return None
    if site.radius is not None:
        raise InputError(PATCH)
    if node is None:
        raise InputError("matrices have no surface: give the number of the node, Site(node=…).")

    # one row of a node, or its displacement along directions
    rows = np.flatnonzero(matrices.map.node == node)
    directions: Array | None = None
    if isinstance(component, int):
        rows = np.array([matrices.map.row(node, component)])
        if 1 <= component <= 3:
            directions = np.eye(3)[[component - 1]]
        B = np.zeros((structure.size, 1))
        B[rows] = 1.0
    else:
        if not len(rows):
            raise InputError(f"node {node} is not in the matrices' map of nodes and dofs.")
        along = in_space(site.direction or ())[None]
        directions = along / np.linalg.norm(along)
        if site.tangential:
            plane = not (matrices.map.component == 3).any()
            directions = np.vstack([directions, *tangents(directions, plane)])
        axis = matrices.map.component[rows] - 1
        loaded = (axis >= 0) & (axis < 3)
        B = np.zeros((structure.size, len(directions)))
        B[rows[loaded]] = directions[:, axis[loaded]].T

    # supports
    size = np.linalg.norm(B, axis=0)
    B[structure.fixed] = 0.0
    B[:, np.linalg.norm(B, axis=0) <= LEAST_FREE_SHARE * size] = 0.0
    if not B[:, 0].any():
        raise SiteError(constrained(f"node {node}"))
    point = matrices.map.points[rows[0]]
    return Functional(B, point=point if np.isfinite(point).all() else None, directions=directions)
