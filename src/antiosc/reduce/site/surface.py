"""The surface of a structure at a site: material and curvature, for the law of a contact."""

from __future__ import annotations

from math import hypot, isclose
from typing import Any

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact.curvature import LINE, SHARP, Curvature
from antiosc.engine.contact.surfaces import Matter, Surface, matter_of
from antiosc.fem.assembly import with_parts
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.shell import Laminate
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import Body
from antiosc.reduce.site.curvature import curvature_at, material_at

#: Radius [m] of an edge or a corner where none is given, at most a quarter of the least dimension.
CORNER = 1e-3
#: Indentation from which graphite and epoxy are damaged [m]; Yang and Sun (1982).
CRITICAL = 8.03e-5


def surface_at(
    structure: Structure,
    point: Array | None,
    direction: Array | None = None,
    radius: float | None = None,
    lengths: bool = True,
) -> Surface:
    """The surface of a structure at a point (3,), struck along a direction on a patch [m].

    Without `lengths` line contacts have infinite length: a ball does not need it.

    Raises
    ------
    InputError
        Nothing is known of it: matrices, plane parts, materials with directions, few nodes.
    """
    if point is None:
        raise InputError("the site is no point of a surface.")
    way = None if direction is None else direction.tolist()
    material = material_at(structure, point, way)
    matter = _matter(material)
    if matter is None:
        raise InputError("a plane part has no surface in space.")
    if isinstance(material, Beam):
        return _of_bar(material, matter, radius)
    found = curvature_at(structure, point, way, lengths)
    return placed(found, matter, corner_radius(structure), radius)


class PlaneOf(Body):
    """The surface that an impactor meets on a structure; by default a flat face of its material."""

    def __init__(self, structure: Structure, surface: Surface | None = None) -> None:
        self._surface = surface or flat_face(structure)

    def surface(self, site: str = "") -> Surface | None:
        return self._surface


def flat_face(structure: Structure) -> Surface | None:
    """A flat face of the first material of a structure; None if the material is unknown."""
    try:
        member = with_parts(structure, "matrices have no material.").members()[0]
    except InputError:
        return None
    matter = _matter(member.part.parts[0][0])
    return None if matter is None else Surface(matter)


def corner_radius(structure: Structure) -> float:
    """The radius that is assumed for sharp edges of a structure [m]."""
    return float(min(CORNER, structure.dimensions[2] / 4))


def placed(found: Curvature, matter: Matter, corner: float, radius: float | None) -> Surface:
    """The surface with this curvature and material; `corner`: radius of sharp edges [m]."""
    if found.kind in SHARP:
        return Surface(matter, (1 / corner, 1 / corner), kind=found.kind, radius=radius)
    low, high = found.values.tolist()
    x, y, z = found.directions[0].tolist()
    length = found.length if found.kind == LINE else float("inf")
    return Surface(matter, (low, high), float(found.error), found.kind, length, (x, y, z), radius)


def _matter(material: Any) -> Matter | None:
    """The properties of a material that a contact needs; None for anisotropic or plane ones."""
    if getattr(material, "plane", None) is not None:
        return None
    if isinstance(material, Laminate):
        outer = min((material.layers[0], material.layers[-1]), key=lambda layer: layer.E2)
        if isclose(outer.E1, outer.E2):
            return Matter(outer.E2, outer.nu12)
        return Matter(outer.E2, 0.0, critical=CRITICAL, name="laminate")
    try:
        return matter_of(material)
    except InputError:
        return None


def _of_bar(bar: Beam, matter: Matter, radius: float | None) -> Surface:
    """The surface of a bar struck from the side: a cylinder for round sections, otherwise flat."""
    section = bar.section
    if not section.isotropic or len(section.outline) <= 4:
        return Surface(matter, radius=radius)
    return Surface(matter, (0.0, 1 / hypot(*section.outline[0])), kind=LINE, radius=radius)
