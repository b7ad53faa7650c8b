"""How the contacts of a scene see the motion of its bodies: ends, directions, rows."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array
from antiosc.errors import InputError
from antiosc.simulation.bodies import PARALLEL, Placed
from antiosc.simulation.impactors import Obstacle
from antiosc.simulation.scene_parts import Contact, SceneParts

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


def along(body: Placed, site: str, direction: Array | None, end: str) -> Array:
    """Coefficients (P,) of the body's columns that give a site's displacement along a direction."""
    row = np.zeros(body.B.shape[1])
    if isinstance(body.body, Obstacle):
        return row
    columns = list(body.sites[site])
    if direction is None or body.directions is None:
        row[columns[0]] = 1.0
        return row
    known = body.directions[columns]
    if len(columns) == 1 and (known[0] == direction).all():
        row[columns[0]] = 1.0
        return row
    parts, *_ = np.linalg.lstsq(known.T, direction, rcond=None)
    found = known.T @ parts
    if np.linalg.norm(found) < PARALLEL or found @ direction < PARALLEL * np.linalg.norm(found):
        raise InputError(
            f"the contact at {end!r} is along {np.round(direction, 4).tolist()}, but the model"
            f" knows that site only along {np.round(known, 4).tolist()}; extract it along the"
            f" contact."
        )
    row[columns] = parts
    return row


def row_of(
    contact: Contact, ends: tuple[End, End], columns: dict[str, slice], size: int
) -> tuple[Array, Array | None]:
    """Row (P,) of the indentation, and the contact's direction in space, where known."""
    (a, at), (b, bt) = ends
    if isinstance(a.body, Obstacle) and isinstance(b.body, Obstacle):
        raise InputError(f"both ends of the contact {contact.a!r}, {contact.b!r} are obstacles.")
    direction = a.pushes.get(at)
    if direction is None:
        direction = b.pushes.get(bt)
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
    moving = [(body, site) for body, site in ends if not isinstance(body.body, Obstacle)]
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
