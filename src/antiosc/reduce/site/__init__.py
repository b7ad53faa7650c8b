"""`Site`: point and direction of an impact; its load vector b; points by their names.

bᵀu is the displacement of the structure at the site along the direction of impact, and b contains
the nodal forces of a unit force there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import cast

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import floats
from antiosc.base.errors import InputError, SiteError
from antiosc.fem.assembly import with_parts
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.structure import NodalMatrices, StructureMatrices, in_space
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import NOT_KNOWN
from antiosc.reduce.site.site import (
    LEAST_FREE_SHARE,
    Functional,
    Site,
    constrained,
    motions_without_mesh,
    point_of,
    tangents,
)

__all__ = [
    "Functional",
    "Site",
    "functional",
    "functionals",
    "motions_without_mesh",
    "point_of",
    "surfaces",
]


def functional(structure: Structure, site: Site) -> Functional:
    """The load vector b of `site` on `structure`; see `functionals`."""
    return functionals(structure, [site])[0]


def functionals(structure: Structure, sites: Sequence[Site]) -> list[Functional]:
    """The load vectors b of sites on `structure`.

    Raises
    ------
    InputError
        A point off the structure, a direction out of the plane of a plane structure, a patch
        without a surface, a site that is fixed by supports.
    """
    if structure.matrices.nodal:
        nodal = cast(NodalMatrices, structure.matrices)
        return [
            algebraic(nodal, site)
            if site.node is None and site.direction is None
            else functional_on_nodes(nodal, site)
            for site in sites
        ]
    meshed = structure.matrices.meshed or structure.matrices.assembled

    def at_point(site: Site) -> bool:
        """Whether the site is a point of a mesh."""
        return site.point is not None or (meshed and site.node is not None and site.dof is None)

    at_points = [site for site in sites if at_point(site)]
    functionals_found: Iterator[Functional] = iter(())
    if at_points:
        matrices = with_parts(
            structure, "matrices have no points: give the site a dof or a vector."
        )
        from antiosc.reduce.site.at_points import functionals_at  # needs dolfinx

        functionals_found = iter(functionals_at(matrices, at_points))
    return [
        next(functionals_found) if at_point(site) else algebraic(structure.matrices, site)
        for site in sites
    ]


def surfaces(
    structure: Structure, sites: Mapping[str, Functional]
) -> dict[str, dict[str, object]] | None:
    """`ModelInfo.surfaces` of sites, from which contact laws follow; None for matrices."""
    if not (structure.matrices.meshed or structure.matrices.assembled):
        return None
    from antiosc.reduce.site.surface import NO_POINT, surface_of  # given matrices have no mesh

    surfaces_found: dict[str, dict[str, object]] = {}
    for name, functional in sites.items():
        if functional.place is None:
            surfaces_found[name] = {NOT_KNOWN: NO_POINT}
            continue
        try:
            surface = surface_of(structure, functional.place, functional.radius)
            surfaces_found[name] = surface.as_dict()
        except InputError as error:
            surfaces_found[name] = {NOT_KNOWN: str(error)}
    return surfaces_found


PATCH = "matrices have no surface for a patch: leave radius out, and the site is a node or a row."


def algebraic(structure: StructureMatrices, site: Site) -> Functional:
    """The functional of a site that is given by a dof or by a vector."""
    first, last = algebra.row_range(structure.K)
    n = algebra.size(structure.K)
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
        b = (np.arange(first, last) == site.dof).astype(float)
    return Functional(_on_free_rows(structure, b[:, None], "the site"))


def _on_free_rows(structure: StructureMatrices, B: Array, label: str) -> Array:
    """Loads (rows of this rank, k) with zeros on fixed dofs, and in columns that cannot move.

    SiteError if the first one cannot.
    """
    comm = algebra.communicator(structure.K)
    size = [norm(comm, b) for b in B.T]
    B[structure.fixed[structure.fixed < len(B)]] = 0.0
    B[:, [norm(comm, b) <= LEAST_FREE_SHARE * s for b, s in zip(B.T, size, strict=True)]] = 0.0
    if not norm(comm, B[:, 0]):
        raise SiteError(constrained(label))
    return B


def functional_on_nodes(matrices: NodalMatrices, site: Site) -> Functional:
    """The load vectors of a site at a node.

    Raises
    ------
    InputError
        A node or dof that is not in the map, a point that is no node, a site whose dofs are fixed.
    """
    if site.radius is not None:
        raise InputError(PATCH)
    node = _node_at(matrices, site) if site.node is None else site.node
    rows = np.flatnonzero(matrices.map.node == node)
    directions: Array | None = None

    if isinstance(site.dof, int):  # one row of the node
        rows = np.array([matrices.map.row(node, site.dof)])
        if 1 <= site.dof <= 3:
            directions = np.eye(3)[[site.dof - 1]]
        loads = np.ones((1, 1))
    else:  # its displacement along directions
        if not len(rows):
            raise InputError(f"node {node} is not in the matrices' map of nodes and dofs.")
        along = in_space(site.direction or ())[None]
        directions = along / np.linalg.norm(along)
        if site.tangential:
            plane = not (matrices.map.component == 3).any()
            directions = np.vstack([directions, *tangents(directions, plane)])
        axis = matrices.map.component[rows] - 1
        rows, axis = rows[(axis >= 0) & (axis < 3)], axis[(axis >= 0) & (axis < 3)]
        loads = directions[:, axis].T

    B = np.zeros((algebra.size(matrices.K), loads.shape[1]))
    B[rows] = loads
    point = matrices.map.points[rows[0]]
    return Functional(
        _on_free_rows(matrices, B, f"node {node}"),
        point=point if np.isfinite(point).all() else None,
        directions=directions,
    )


#: Largest distance of a point from the node that it denotes, over the part's size.
AT_NODE = 1e-6


def _node_at(matrices: NodalMatrices, site: Site) -> int:
    """The number of the node at the point of a site."""
    if isinstance(site.point, str) or not matrices.located:
        raise InputError("matrices have no surface: give the number of the node, Site(node=…).")
    located = np.isfinite(matrices.map.points).all(axis=1)
    points = matrices.map.points[located]
    distances = np.linalg.norm(points - in_space(site.point or ()), axis=1)
    nearest = int(np.argmin(distances))
    node = int(matrices.map.node[located][nearest])
    if distances[nearest] > AT_NODE * float(np.ptp(points, axis=0).max()):
        raise InputError(
            f"the point is no node: the nearest is node {node}, {distances[nearest]:.3g} m away;"
            " use that."
        )
    return node
