"""Load vectors b of sites, and the surfaces at the sites.

bᵀu is the displacement of the structure at the site along the direction of impact, and b contains
the nodal forces of a unit force there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, cast

from antiosc.base.errors import InputError
from antiosc.fem.structure import NodalMatrices, StructureMatrices
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import UNKNOWN_SURFACE
from antiosc.reduce.site.site import Functional, Site, functional_on_nodes, functional_on_rows

if TYPE_CHECKING:
    from antiosc.fem.structure.meshed import PartsMatrices


def functional(structure: Structure, site: Site) -> Functional:
    """The load vector b of `site` on `structure`; see `functionals`."""
    return functionals(structure.matrices, [site])[0]


def functionals(matrices: StructureMatrices, sites: Sequence[Site]) -> list[Functional]:
    """Load vectors of `sites`; InputError for a site off the structure, fixed or off a surface."""
    if matrices.nodal:
        nodal = cast(NodalMatrices, matrices)
        return [
            functional_on_rows(nodal, site)
            if site.node is None and site.direction is None
            else functional_on_nodes(nodal, site)
            for site in sites
        ]
    if matrices.meshed:
        from antiosc.reduce.site.at_points import functionals_at  # needs dolfinx

        return functionals_at(cast("PartsMatrices", matrices), sites)
    if any(site.point is not None for site in sites):
        raise InputError("matrices have no points: give the site a dof or a vector.")
    return [functional_on_rows(matrices, site) for site in sites]


def surfaces(
    matrices: StructureMatrices, sites: Mapping[str, Functional]
) -> dict[str, dict[str, object]] | None:
    """Surface at each site as in `ModelInfo.surfaces`, for contact laws; None without a mesh."""
    if not matrices.meshed:
        return None
    from antiosc.reduce.site.surface import NO_POINT, surface_of  # given matrices have no mesh

    parts = cast("PartsMatrices", matrices)
    surfaces_found: dict[str, dict[str, object]] = {}
    for name, functional in sites.items():
        if functional.place is None:
            surfaces_found[name] = {UNKNOWN_SURFACE: NO_POINT}
            continue
        try:
            surface = surface_of(parts, functional.place, functional.radius)
            surfaces_found[name] = surface.as_dict()
        except InputError as error:
            surfaces_found[name] = {UNKNOWN_SURFACE: str(error)}

    return surfaces_found
