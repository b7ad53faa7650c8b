"""`contact_between`: the contact law of a part and another body with a known surface."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import ContactLaw, Site, Structure
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact.choice import choose_law
from antiosc.engine.contact.curvature import CURVED, SHARP_KINDS
from antiosc.engine.contact.surfaces import RIGID_MATTER, Surface, matter_of
from antiosc.models.body import Body
from antiosc.reduce.site import functional
from antiosc_studies.drops.floor import Floor, contact_law


@checks.within_range
def contact_between(
    part: Structure | Body,
    other: Any = None,
    *,
    at: Site | ArrayLike | None = None,
    radius: float | None = None,
) -> ContactLaw:
    """The law that `contact="auto"` chooses between a part and another body.

    Parameters
    ----------
    part : Structure, or a model with its surface
    other : Sphere, RigidMass, a model, a material or its name, Floor or Structure, optional
        The body that touches the part. A material means the flat face of a half-space, a structure
        its surface nearest to the point. None: a rigid plane.
    at : Site or array_like (3,)
        Point [m] of contact on a Structure.
    radius : float, optional
        Radius of the part there [m], instead of its curvature; needed at edges and corners.

    Returns
    -------
    ContactLaw
        `antiosc.engine.contact.choice` has the table of laws and their sources.

    Raises
    ------
    InputError
        Surfaces that are unknown, that fit into each other, or that are both rigid.
    """
    surface = _surface_of(part, at)

    if radius is not None:
        curvature = 1 / checks.positive("radius", radius, "m")
        surface = replace(
            surface, curvatures=(curvature, curvature), error=0.0, kind=CURVED, along=None
        )
    elif surface.kind in SHARP_KINDS:
        point = checks.point_text(np.asarray(getattr(at, "point", at)))
        raise InputError(f"the part has a sharp {surface.kind} at {point}: give a radius.")

    if not isinstance(other, Floor):
        return choose_law(surface, _surface_of_other(other, at)).law
    return contact_law(other, surface)


def _surface_of_other(other: Any, at: object) -> Surface:
    """The surface of the other body."""
    if other is None:
        return Surface(RIGID_MATTER)
    if isinstance(other, Structure | Body):
        return _surface_of(other, at)
    matter = matter_of(other)
    assert matter is not None
    return Surface(matter)


def _surface_of(body: Structure | Body, at: object) -> Surface:
    """The surface of a structure at a point, or of an impactor."""
    if isinstance(body, Structure):
        from antiosc.reduce.site.surface import surface_at  # needs the finite elements

        return surface_at(body, *_site_on_part(body, at))
    kinds = "a Structure, a Sphere, a RigidMass with a tip, or a model"
    surface = checks.instance("part", body, Body, kinds).surface()
    if surface is None:
        raise InputError(
            f"the material and the curvature of {checks.shown(body)} are not known there: give the "
            "law of the contact."
        )

    return surface


def _site_on_part(part: Structure, at: object) -> tuple[Array, Array | None, float | None]:
    """Point, direction and patch radius of `at` on a structure."""
    if isinstance(at, Site):
        load = functional(part, at)
        if load.point is None:
            raise InputError("at= needs a Site with a point; a dof or a vector has no surface.")
        return load.point, load.direction, load.radius
    if at is None:
        raise InputError("at= says where the part is touched: a Site, or a point in m.")
    return checks.floats("at", at, (3,)), None, None
