"""The load vectors b of sites: on or off nodes, for points and patches with Hertz's pressure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from antiosc.base.checks import array
from antiosc.base.errors import InputError
from antiosc.fem.assembly import with_parts
from antiosc.fem.linalg import algebra
from antiosc.fem.linalg.algebra import norm
from antiosc.fem.site.on_nodes import functional_on_nodes
from antiosc.fem.site.site import LEAST_FREE_SHARE, Functional, Site, constrained
from antiosc.fem.structure.matrices import StructureMatrices
from antiosc.fem.structure.structure import Structure


def functional(structure: Structure, site: Site) -> Functional:
    """The vector b of `site` on `structure`; see `functionals`."""
    return functionals(structure, [site])[0]


def functionals(structure: Structure, sites: Sequence[Site]) -> list[Functional]:
    """The vectors b of sites on `structure`.

    Raises
    ------
    InputError
        A point off the structure, a direction out of the plane of a plane structure, a patch
        without a surface, a site that is fixed by supports.
    """
    if structure.matrices.nodal:
        given = [functional_on_nodes(structure, site) for site in sites]
        pairs = zip(given, sites, strict=True)
        return [one or algebraic(structure.matrices, site) for one, site in pairs]
    at_points = [site for site in sites if site.point is not None]
    found: Iterator[Functional] = iter(())
    if at_points:
        matrices = with_parts(
            structure, "matrices have no points: use Site(dof=i) or Site(vector=b)."
        )
        from antiosc.fem.site.at_points import functionals_at  # needs dolfinx

        found = iter(functionals_at(matrices, at_points))
    return [
        algebraic(structure.matrices, site) if site.point is None else next(found) for site in sites
    ]


def algebraic(structure: StructureMatrices, site: Site) -> Functional:
    """b of a site that is given by a dof or a vector."""
    first, last = algebra.row_range(structure.K)
    n, comm = algebra.size(structure.K), algebra.communicator(structure.K)
    if site.node is not None:
        raise InputError(
            "the nodes of this structure have no numbers: Site(node=…) needs matrices with a map, "
            "Structure.from_files(K, M, map=…)."
        )
    if site.radius is not None:
        raise InputError("radius needs a mesh; a site given by dof or vector has none.")
    if site.vector is not None:
        b = array("vector", site.vector, (n,))[first:last].copy()
    else:
        if not isinstance(site.dof, int) or not 0 <= site.dof < n:
            raise InputError(f"dof must be a number from 0 to {n - 1}; got {site.dof!r}.")
        b = np.zeros(last - first)
        if first <= site.dof < last:
            b[site.dof - first] = 1.0
    whole = norm(comm, b)
    b[structure.fixed[structure.fixed < len(b)]] = 0.0
    if norm(comm, b) <= LEAST_FREE_SHARE * whole:
        raise InputError(constrained("the site"))
    return Functional(b)
