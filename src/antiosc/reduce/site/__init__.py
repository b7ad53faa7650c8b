"""Load vectors b of sites, and the surfaces there.

bᵀu is the displacement of the structure at the site along the direction of impact, and b contains
the nodal forces of a unit force there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from antiosc.base.errors import InputError
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.structure import NodalMatrices
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import UNKNOWN_SURFACE
from antiosc.reduce.site.site import Functional, Site, functional_on_nodes, functional_on_rows


def functional(structure: Structure, site: Site) -> Functional:
    """The load vector b of `site` on `structure`; see `functionals`."""
    return functionals(structure, [site])[0]


def functionals(structure: Structure, sites: Sequence[Site]) -> list[Functional]:
    """The load vectors of `sites`, in order.

    InputError for a site off the structure or its plane, without a surface under its patch, or
    fixed.
    """
    if structure.matrices.nodal:
        nodal = cast(NodalMatrices, structure.matrices)
        return [
            functional_on_rows(nodal, site)
            if site.node is None and site.direction is None
            else functional_on_nodes(nodal, site)
            for site in sites
        ]
    meshed = structure.matrices.meshed or structure.matrices.assembled
    at_points = [
        k
        for k, site in enumerate(sites)
        if site.point is not None or (meshed and site.node is not None and site.dof is None)
    ]
    found: dict[int, Functional] = {}
    if at_points:
        matrices = with_parts(
            structure, "matrices have no points: give the site a dof or a vector."
        )
        from antiosc.reduce.site.at_points import functionals_at  # needs dolfinx

        on_mesh = functionals_at(matrices, [sites[k] for k in at_points])
        found = dict(zip(at_points, on_mesh, strict=True))

    return [
        found[k] if k in found else functional_on_rows(structure.matrices, site)
        for k, site in enumerate(sites)
    ]


def surfaces(
    structure: Structure, sites: Mapping[str, Functional]
) -> dict[str, dict[str, object]] | None:
    """Surfaces of sites as in `ModelInfo.surfaces`, for contact laws; None of matrices."""
    if not (structure.matrices.meshed or structure.matrices.assembled):
        return None
    from antiosc.reduce.site.surface import NO_POINT, surface_of  # given matrices have no mesh

    matrices = cast(MeshedParts, structure.matrices)
    surfaces_found: dict[str, dict[str, object]] = {}
    for name, functional in sites.items():
        if functional.place is None:
            surfaces_found[name] = {UNKNOWN_SURFACE: NO_POINT}
            continue
        try:
            surface = surface_of(matrices, functional.place, functional.radius)
            surfaces_found[name] = surface.as_dict()
        except InputError as error:
            surfaces_found[name] = {UNKNOWN_SURFACE: str(error)}

    return surfaces_found
