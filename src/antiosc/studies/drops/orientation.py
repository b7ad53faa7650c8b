"""How a part hangs before it is dropped: which face, edge or corner is lowest, and how it tilts.

Faces are named by the direction of their outward normals in the axes of the mesh ("-z" is the face
at the lowest z), edges by the two faces that meet there ("-x-z"), corners by three ("+x-y-z"): the
extreme ones of the box around the part. A part that falls on an edge or a corner has its centre of
mass above it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.motion import unit_vector
from antiosc.studies.drops.body import FreeBody

#: Number of faces that an edge and a corner belong to.
FACES = {"face": 1, "edge": 2, "corner": 3}
DOWN = np.array([0.0, 0.0, -1.0])


def orientation(
    body: FreeBody,
    tilt: Sequence[float],
    face: str | None,
    edge: str | None,
    corner: str | None,
    toward: Sequence[float] | None,
) -> Array:
    """R (3, 3) from the axes of the mesh to those of the floor; see `drop`."""
    given = {"face": face, "edge": edge, "corner": corner, "toward": toward}
    asked = {name: value for name, value in given.items() if value is not None}
    if len(asked) > 1:
        raise InputError(f"give one of face, edge, corner and toward; got {', '.join(asked)}.")
    R = np.eye(3)
    for name, value in asked.items():
        down = unit_vector(name, value) if name == "toward" else _named(body, name, value)
        R = onto(down, DOWN)
    angles = checks.array("tilt", tilt, None)
    if angles.shape != (3,):
        shown = checks.shown(tilt)
        raise InputError(f"tilt must be three angles in degrees, about x, y and z; got {shown}.")
    return tilted(angles) @ R


def tilted(angles: Array) -> Array:
    """Rotation (3, 3) by angles (3,) [degree] about fixed x, then y, then z."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("xyz", angles, degrees=True).as_matrix())


def onto(direction: Array, other: Array) -> Array:
    """The smallest rotation (3, 3) of one unit vector onto another."""
    middle = direction + other
    if middle @ middle < 1e-12:  # half a turn about an axis across
        axis = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        return np.asarray(2 * np.outer(axis, axis) / (axis @ axis) - np.eye(3))
    turn = 2 * np.outer(other, direction) - np.outer(middle, middle) / (1 + direction @ other)
    return np.asarray(np.eye(3) + turn)


def _named(body: FreeBody, kind: str, name: Any) -> Array:
    """The unit direction in the body that points down where a face, edge or corner is lowest."""
    checks.text(kind, name)
    found = {axis: float(f"{sign}1") for sign, axis in re.findall(r"([+-])([xyz])", name)}
    if not len(name) / 2 == len(found) == FACES[kind]:
        if kind == "face" and body.structure is not None:
            return _group(body, name)
        example = {"face": "-z", "edge": "-x-z", "corner": "+x-y-z"}[kind]
        raise InputError(f"{kind} names its faces, as {example!r}; got {name!r}.")
    signs = np.array([found.get(axis, 0.0) for axis in "xyz"])
    if kind == "face":
        return signs
    # next to the corner of the box may be none of the part: the point that lies farthest along it
    at = body.points[np.argmax(body.points @ signs)]
    if kind == "edge":
        low, high = body.points.min(axis=0), body.points.max(axis=0)
        at = np.where(signs > 0, high, low) * (signs != 0)
    return np.asarray(at / np.linalg.norm(at))


def _group(body: FreeBody, name: str) -> Array:
    """The mean outward normal of a group of faces."""
    from antiosc.fem.site.map_sites import surface
    from antiosc.fem.structure.structure import on_mesh

    assert body.structure is not None
    part = on_mesh(body.structure, 'an assembly has no groups of its own: name a face as "-z".')
    normal = surface(part, name).normals.sum(axis=0)
    size = float(np.linalg.norm(normal))
    if size < 1e-9:
        raise InputError(f"the normals of the faces {name!r} have no mean: give toward=(...).")
    return np.asarray(normal / size)
