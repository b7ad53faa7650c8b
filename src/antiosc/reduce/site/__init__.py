"""`Site`: point and direction of an impact; its load vector b; points by their names.

bᵀu is the displacement of the structure at the site along the direction of impact, and b contains
the nodal forces of a unit force there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from antiosc.base.errors import InputError
from antiosc.fem.assembly import with_parts
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import NOT_KNOWN
from antiosc.reduce.site.names import motions_without_mesh, point_of
from antiosc.reduce.site.on_matrices import algebraic, functional_on_nodes
from antiosc.reduce.site.site import Functional, Site

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
        given = [functional_on_nodes(structure, site) for site in sites]
        pairs = zip(given, sites, strict=True)
        return [one or algebraic(structure.matrices, site) for one, site in pairs]
    meshed = structure.matrices.meshed or structure.matrices.assembled

    def at_point(site: Site) -> bool:
        return site.point is not None or (meshed and site.node is not None and site.dof is None)

    at_points = [site for site in sites if at_point(site)]
    found: Iterator[Functional] = iter(())
    if at_points:
        matrices = with_parts(
            structure, "matrices have no points: use Site(dof=i) or Site(vector=b)."
        )
        from antiosc.reduce.site.at_points import functionals_at  # needs dolfinx

        found = iter(functionals_at(matrices, at_points))
    return [
        next(found) if at_point(site) else algebraic(structure.matrices, site) for site in sites
    ]


def surfaces(
    structure: Structure, sites: Mapping[str, Functional], lengths: bool = True
) -> dict[str, dict[str, object]] | None:
    """`ModelInfo.surfaces` of sites, from which laws of contact follow; None for matrices.

    Without `lengths` for balls alone: see `surface_at`.
    """
    if not (structure.matrices.meshed or structure.matrices.assembled):
        return None
    from antiosc.reduce.site.surface import surface_at  # given matrices do without meshes

    found: dict[str, dict[str, object]] = {}
    for name, one in sites.items():
        place = one.point, one.direction, one.radius, lengths, one.part
        try:
            found[name] = surface_at(structure, *place).as_dict()
        except InputError as error:
            found[name] = {NOT_KNOWN: str(error)}
    return found
