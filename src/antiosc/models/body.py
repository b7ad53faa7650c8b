"""What a simulation asks of a body besides its free modes, and the door for bodies of others.

`LinearBody` is all that a foreign body must have, `Body` is what is read: the bodies of this
package are `Body`s and answer by themselves, a foreign one is given the defaults where it says
nothing (`checked_body`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.models.modal import ModalBody
from antiosc.models.model_info import info_of
from antiosc.models.motion import Motion


@runtime_checkable
class LinearBody(Protocol):
    """The one protocol of bodies in an impact: models, impactors and foreign models alike.

    The `basis` of its `ModalBody` makes the fields of a history. A body may also have `velocity`,
    `gap`, `local_compliance` and `radius` of its patch; they mean what they do in `Body`.
    """

    def modal(self) -> ModalBody:
        """The body in free modes, seen from its contact point."""
        ...


class Body:
    """A linear body as the simulations read it; the defaults are those of a structure at rest."""

    #: of an impactor, m/s, > 0 toward the structure; or how it moves in space
    velocity: float | Motion = 0.0
    #: distance that the body keeps from the structure at the start, m
    gap: float = 0.0
    #: half-space compliance of its patch, m/N, which its model contains
    local_compliance: float = 0.0
    #: names of several contact points, which a scene takes alone; () for one
    sites: tuple[str, ...] = ()

    @property
    def patch_radius(self) -> float | None:
        """Radius (m) of the patch over which the contact point's displacement is averaged."""
        return None

    def modal(self) -> ModalBody:
        """The body in free modes, seen from its contact point."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class InModes(Body):
    """A body that is given by its free modes."""

    modes: ModalBody
    local_compliance: float = 0.0
    radius: float | None = None

    @property
    def patch_radius(self) -> float | None:
        return self.radius

    def modal(self) -> ModalBody:
        return self.modes


class _Foreign(Body):
    """A foreign body: what it says of itself, checked, and the defaults for the rest."""

    def __init__(self, name: str, body: LinearBody) -> None:
        self._body = body
        self.velocity = getattr(body, "velocity", Body.velocity)
        if not isinstance(self.velocity, Motion):
            self.velocity = checks.number(f"the velocity of {name}", self.velocity, "m/s")
        self.gap = checks.nonnegative(f"the gap of {name}", getattr(body, "gap", Body.gap), "m")
        self.local_compliance = checks.nonnegative(
            f"the local_compliance of {name}",
            getattr(body, "local_compliance", Body.local_compliance),
            "m/N",
        )
        self._radius: float | None = getattr(body, "radius", None)
        if self._radius is not None:
            self._radius = checks.positive(f"the radius of {name}", self._radius, "m")

    @property
    def patch_radius(self) -> float | None:
        return self._radius

    def modal(self) -> ModalBody:
        return self._body.modal()


def checked_body(name: str, body: object) -> Body:
    """`body` as a `Body` of one contact point, a foreign one with the defaults.

    InputError for one without a modal() method, and for one with several contact points.
    """
    if isinstance(body, Body):
        if body.sites:
            raise InputError(several_contact_points(name, body.sites))
        return body
    if isinstance(body, LinearBody) and not isinstance(body, type) and callable(body.modal):
        return _Foreign(name, body)
    raise InputError(
        f"{name} must have a modal() method, as the model that extract(part, site) makes, a "
        f"RigidMass and a Sphere have; got {checks.shown(body)}."
    )


def places_of(body: object) -> dict[str, tuple[float, ...]]:
    """Where the sites of an extracted body lie [m], by name; "" is the name of a single one."""
    info = info_of(body)
    named = {"": info.point} if info.points is None else info.points
    return {
        str(name): tuple(point)
        for name, point in named.items()
        if isinstance(point, list | tuple) and all(isinstance(c, int | float) for c in point)
    }


def several_contact_points(name: str, sites: tuple[str, ...]) -> str:
    """Message for a body of several sites where one is needed."""
    return (
        f"{name} has the sites {', '.join(sites)}: pose its impact as a Scene, with ends such as "
        f'"part:{sites[0]}", or extract a model of one site.'
    )
