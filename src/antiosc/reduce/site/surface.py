"""The surface of a structure at a site: material and curvature, for the contact law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, inf, isclose
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact.curvature import LINE, PLANE, SHARP, Curvature
from antiosc.engine.contact.surfaces import Matter, Surface, matter_of
from antiosc.fem.assembly import MeshedParts, with_parts
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.shell import Laminate
from antiosc.fem.mesh.closest import closest
from antiosc.fem.mesh.curvature import curvature, largest_ball
from antiosc.fem.structure import in_space
from antiosc.fem.structure.structure import Structure
from antiosc.models.body import Body
from antiosc.reduce.site.site import Place, place_at

NO_SURFACE = "matrices have no surface: give the law of the contact."
NO_POINT = "the site is no point of a surface."
#: Default radius [m] of an edge or a corner, at most a quarter of the least dimension.
CORNER = 1e-3
#: Indentation from which graphite and epoxy are damaged [m]; Yang and Sun (1982).
CRITICAL = 8.03e-5


def surface_at(
    structure: Structure,
    point: Array | None,
    direction: Array | None = None,
    radius: float | None = None,
) -> Surface:
    """The surface of a structure at its point nearest to `point` (3,), as `surface_of`."""
    if point is None:
        raise InputError(NO_POINT)
    place = place_at(with_parts(structure, NO_SURFACE), point, direction)
    return surface_of(structure, place, radius)


def surface_of(structure: Structure, place: Place, radius: float | None) -> Surface:
    """The surface of a structure at a place, under a patch of this radius [m]; None: a point.

    Raises
    ------
    InputError
        The surface is unknown: plane parts, anisotropic materials, too few nodes.
    """
    material = material_of(place)
    matter = _contact_material(material)
    if matter is None:
        raise InputError("a plane part has no surface in space.")
    if isinstance(material, Beam):
        return _bar_surface(material, matter, radius)
    curved = _curvature(place)
    surface = placed(curved, matter, corner_radius(structure), radius)
    if curved.kind in SHARP:
        return surface
    ball_radius, second_contact = _room(with_parts(structure), curved, radius or 0.0)
    return replace(surface, largest_ball=ball_radius, meets=second_contact)


def _room(
    matrices: MeshedParts, curved: Curvature, near: float
) -> tuple[float, tuple[float, float, float] | None]:
    """Radius of the largest ball that touches the part only there, and the point that a larger one
    meets.

    `near`: radius of the patch [m].
    """
    best = inf
    second_contact = None
    for member in matrices.members():
        if member.part.mesh.tdim < 2:
            continue
        point = member.at.own(curved.point[None])[0]
        normal = curved.normal @ member.at.rotation
        radius, touched = largest_ball(member.part.faces, point, normal, near)
        if radius < best:
            best = radius
            x, y, z = member.at.placed(touched[None])[0].tolist()
            second_contact = (x, y, z)
    return best, second_contact


def curvature_at(
    structure: Structure, point: ArrayLike, direction: Sequence[float] | None = None
) -> Curvature:
    """Principal curvatures of the outer surface of a structure at its point nearest to `point` [m].

    A shell is struck on the face opposite to `direction`, half a thickness outside its middle.
    """
    along = None if direction is None else in_space(direction)
    return _curvature(place_at(with_parts(structure, NO_SURFACE), in_space(point), along))


def material_at(structure: Structure, point: Array, direction: Array | None = None) -> Any:
    """The material of a meshed structure at its point nearest to `point` [m]."""
    return material_of(place_at(with_parts(structure, NO_SURFACE), point, direction))


def material_of(place: Place) -> Any:
    """The material of the part at the place."""
    part = place.member.part
    return part.material_at(closest(part.mesh, place.point))


def _curvature(place: Place) -> Curvature:
    """Curvature of the outer surface, in the axes of the structure; see `curvature_at`."""
    part = place.member.part
    at = place.member.at
    along = place.direction if place.direction.any() else None
    if part.kind.sheet and part.mesh.gdim == 2:
        curved = _flat(place.point, along)
    else:
        curved = curvature(part.mesh, part.faces, place.point, along)
    if part.kind.sheet:
        curved = curved.beyond(material_of(place).section.thickness / 2)
    return curved.placed(at.rotation, at.placed(np.zeros((1, 3)))[0])


def _flat(point: Array, along: Array | None) -> Curvature:
    """The flat face of a sheet in the plane z = 0 on the side of the impactor."""
    normal = np.array([0.0, 0.0, -1.0 if along is not None and along[2] > 0 else 1.0])
    on_sheet = point * [1.0, 1.0, 0.0]
    return Curvature(PLANE, np.zeros(2), 0.0, np.eye(3)[:2], on_sheet, normal)


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
    matter = _contact_material(member.part.parts[0][0])
    if matter is None:
        return None
    return Surface(matter)


def corner_radius(structure: Structure) -> float:
    """The radius that is assumed for sharp edges of a structure [m]."""
    return float(min(CORNER, structure.dimensions[2] / 4))


def placed(curvature: Curvature, matter: Matter, corner: float, radius: float | None) -> Surface:
    """A `Surface` of this curvature and material; `corner`: radius assumed for sharp edges [m]."""
    if curvature.kind in SHARP:
        return Surface(matter, (1 / corner, 1 / corner), kind=curvature.kind, radius=radius)
    low, high = curvature.values.tolist()
    x, y, z = curvature.directions[0].tolist()
    return Surface(
        matter,
        (low, high),
        float(curvature.error),
        curvature.kind,
        along=(x, y, z),
        radius=radius,
    )


def _contact_material(material: Any) -> Matter | None:
    """The material properties that a contact needs; None for anisotropic and plane materials."""
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


def _bar_surface(bar: Beam, matter: Matter, radius: float | None) -> Surface:
    """The surface of a bar struck from the side: a cylinder for round sections, otherwise flat."""
    section = bar.section
    if not section.isotropic or len(section.outline) <= 4:
        return Surface(matter, radius=radius)
    return Surface(matter, (0.0, 1 / hypot(*section.outline[0])), kind=LINE, radius=radius)
