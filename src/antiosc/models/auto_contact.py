"""`contact="auto"`: the contact law that follows from the surfaces of both bodies."""

from __future__ import annotations

from typing import Literal, TypeAlias, TypeGuard

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.base.texts import engineering, point_text
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.choice import Choice, choose
from antiosc.engine.contact.curvature import CURVED
from antiosc.engine.contact.surfaces import Surface
from antiosc.models.body import Body, checked_body, info_of

#: The value of `contact` for which the law is chosen.
AUTO: Literal["auto"] = "auto"
#: A law, or "auto".
AnyLaw: TypeAlias = ContactLaw | Literal["auto"]
LAW = 'a ContactLaw such as Hertz(stiffness), or "auto"'


def is_auto(contact: object) -> TypeGuard[Literal["auto"]]:
    """Whether the law is "auto"; an array, whose comparison has no truth value, is not."""
    return isinstance(contact, str) and contact == AUTO


def choice_at_sites(first: object, second: object, sites: tuple[str, str] = ("", "")) -> Choice:
    """The law for the contact of two bodies at their sites, with the reason.

    InputError if the material or the shape of a body is unknown.
    """
    return choose(_surface(first, sites[0]), _surface(second, sites[1]))


def piercing(first: object, second: object, sites: tuple[str, str] = ("", "")) -> str:
    """Sentence on a round striker that meets a part beside its site; "" if it does not.

    Of the two bodies one is a model of a part, the other a ball or a mass with a round tip.
    """
    bodies = first, second
    surfaces = [
        body.surface(site) if isinstance(body, Body) else None
        for body, site in zip(bodies, sites, strict=True)
    ]
    for k in (0, 1):
        part, striker = surfaces[k], surfaces[1 - k]
        if part is None or striker is None or info_of(bodies[1 - k]).surfaces is not None:
            continue
        touched = second_contact_of(part, striker)
        if touched:
            return (
                f"The striker, round with a radius of {engineering(1 / striker.curvatures[0], 'm')}"
                f", pierces the part at {point_text(touched)} as it touches the site: the largest"
                f" that touches there alone has {engineering(part.largest_ball, 'm')}; take a"
                " smaller radius or another site."
            )
    return ""


def second_contact_of(part: Surface, striker: Surface) -> tuple[float, float, float] | None:
    """The point of a part that a round striker pierces as it touches a site; None if none."""
    low, high = striker.curvatures
    round_tip = striker.kind == CURVED and low == high and low > 0
    if round_tip and 1 / low > part.largest_ball:
        return part.meets
    return None


def _surface(body: object, site: str) -> Surface:
    """The surface of a body at a site; InputError if it is unknown."""
    linear_body = body if isinstance(body, Body) else checked_body("a body in contact", body)
    surface = linear_body.surface(site)
    if surface is None:
        reason = info_of(linear_body).unknown_surface(site)
        if reason:
            raise InputError(
                'the contact "auto" finds no law, give one, such as Hertz: nothing is known of '
                f"the surface of the {type(body).__name__}, for {reason}"
            )
        raise InputError(
            f'the contact "auto" needs the material and the curvature of both surfaces, and '
            f"those of the {type(body).__name__} are not known: extract it from a mesh, give "
            "the model its material (with_surface, or [surface] of a scene), the striker a"
            " material and a tip_radius, or give the law, such as Hertz."
        )
    return surface


def law_of(contact: object, first: object, second: object) -> ContactLaw:
    """The given law, or for "auto" the law that the surfaces of two bodies require."""
    if is_auto(contact):
        return choice_at_sites(first, second).law
    return checks.instance("contact", contact, ContactLaw, LAW)


def choice_of(law: ContactLaw, first: object, second: object) -> Choice | None:
    """The choice that led to this law; None for a law that the user gave."""
    try:
        choice = choice_at_sites(first, second)
    except InputError:
        return None
    return choice if choice.law == law else None
