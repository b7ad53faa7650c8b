"""How the contacts of a scene see the motion of its bodies: ends, directions, rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.simulation.bodies.bodies import PARALLEL, Placed
from antiosc.simulation.bodies.impactors import Obstacle
from antiosc.simulation.problem.scene_parts import Contact, SceneParts

End = tuple[Placed, str]  # a body and the name of its site


def find(end: str, bodies: dict[str, Placed]) -> tuple[Placed, str]:
    """The body of an end and the name of its site."""
    name, _, site = end.partition(":")
    if name not in bodies:
        raise InputError(f"there is no body {name!r} in the scene; it has {', '.join(bodies)}.")
    body = bodies[name]
    if isinstance(body.body, Obstacle):
        return body, ""
    if not site and len(body.sites) == 1:
        site = next(iter(body.sites))
    if site in body.sites:
        return body, site
    if body.sites == {"": (0,)}:  # one site: its name is free
        return body, ""
    listed = ", ".join(f"{name}:{s}" for s in body.sites)
    raise InputError(f"{end!r} names no site of the body {name!r}; it has {listed}.")


def give_axes(
    scene: SceneParts, ends: Sequence[tuple[End, End]], bodies: Mapping[str, Placed]
) -> None:
    """Give the sites without a direction (`Placed.axes`) that of their contacts.

    Sites without directions that touch each other move along one axis, in the same sense; it is
    the direction of the first contact of any of them that has one.
    """
    open_ends = [
        [(body.name, at) for body, at in pair if body.columns_of(at) and body.directions is None]
        for pair in ends
    ]
    links = [pair for pair in open_ends if len(pair) == 2]
    for pair, reached in zip(ends, open_ends, strict=True):
        direction = direction_of(pair)
        while direction is not None and reached:
            name, at = reached.pop()
            if at not in bodies[name].axes:
                bodies[name].axes[at] = direction
                reached += [other for link in links if (name, at) in link for other in link]


def along(body: Placed, site: str, direction: Array | None, end: str) -> Array:
    """Coefficients (P,) of the body's columns that give a site's displacement along a direction."""
    row = np.zeros(body.B.shape[1])
    columns = list(body.columns_of(site))
    if not columns:
        return row
    known = body.known(site)
    if direction is None or known is None or (len(known) == 1 and (known[0] == direction).all()):
        row[columns[0]] = 1.0
        return row
    parts, *_ = np.linalg.lstsq(known.T, direction, rcond=None)
    found = known.T @ parts
    if np.linalg.norm(found) < PARALLEL or found @ direction < PARALLEL * np.linalg.norm(found):
        remedy = (
            "which is that of another contact of this body of one coordinate; use a RigidBody"
            if body.directions is None
            else "as the model has it; extract it along the contact"
        )
        raise InputError(
            f"the contact at {end!r} is along {np.round(direction, 4).tolist()}, but this end moves"
            f" only along {np.round(known, 4).tolist()}, {remedy}."
        )
    row[columns[: len(known)]] = parts
    return row


def direction_of(ends: tuple[End, End]) -> Array | None:
    """Direction (3,) of a contact in space, where one of its ends knows it."""
    (a, at), (b, bt) = ends
    return a.pushes.get(at, b.pushes.get(bt))


def row_of(
    contact: Contact, ends: tuple[End, End], columns: dict[str, slice], size: int
) -> tuple[Array, Array | None]:
    """Row (P,) of the indentation, and the contact's direction in space, where known."""
    (a, at), (b, bt) = ends
    if isinstance(a.body, Obstacle) and isinstance(b.body, Obstacle):
        raise InputError(f"both ends of the contact {contact.a!r}, {contact.b!r} are obstacles.")
    direction = direction_of(ends)
    row = np.zeros(size)
    row[columns[b.name]] += along(b, bt, direction, contact.b)
    row[columns[a.name]] -= along(a, at, direction, contact.a)
    return row, direction


def order_notes(scene: SceneParts, ends: list[tuple[End, End]]) -> list[str]:
    """Notes on contacts that push the second end against its site's direction."""
    notes = []
    for contact, ((a, at), (b, bt)) in zip(scene.contacts, ends, strict=True):
        push, other = a.pushes.get(at), b.pushes.get(bt)
        if other is not None and (push is None or push @ other > 0):
            notes.append(
                f"The contact {contact.a!r}, {contact.b!r} pushes {contact.b!r} against the"
                f" direction of its site, as it is named second; name it first if it should be"
                f" pushed along it."
            )
    return notes


def tangents_of(
    contact: Contact,
    direction: Array | None,
    bodies: dict[str, Placed],
    columns: dict[str, slice],
    size: int,
) -> list[Array]:
    """Rows of the tangential displacement of b against a, one or two."""
    ends = [find(contact.a, bodies), find(contact.b, bodies)]
    moving = [(body, site) for body, site in ends if body.columns_of(site)]
    if direction is None or any(body.directions is None for body, _ in moving):
        raise InputError(
            f"friction between {contact.a!r} and {contact.b!r} needs ends that move along the"
            f" surface too: a RigidBody, or a model with Site(..., tangential=True)."
        )
    across: list[Array] = []
    for body, site in moving:
        known = body.directions
        assert known is not None
        for i in body.sites[site]:
            side = known[i] - (known[i] @ direction) * direction
            for other in across:
                side = side - (side @ other) * other
            if np.linalg.norm(side) > 0.5:
                across.append(side / np.linalg.norm(side))
    rows = []
    for side in across[:2]:
        row = np.zeros(size)
        for (body, site), sign, end in zip(ends, (-1, 1), (contact.a, contact.b), strict=True):
            row[columns[body.name]] += sign * along(body, site, side, end)
        rows.append(row)
    if not rows:
        raise InputError(
            f"friction between {contact.a!r} and {contact.b!r} needs a site with tangential"
            f" directions: extract it with Site(..., tangential=True)."
        )
    return rows
