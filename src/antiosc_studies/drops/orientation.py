"""The orientation of a part at the start of its fall."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.motion import unit_vector
from antiosc_studies.drops.free_body import FreeBody

#: Number of faces that an edge and a corner belong to.
FACE_COUNTS = {"face": 1, "edge": 2, "corner": 3}
DOWN = np.array([0.0, 0.0, -1.0])


def orientation(
    body: FreeBody,
    tilt: Sequence[float],
    face: str | None,
    edge: str | None,
    corner: str | None,
    toward: Sequence[float] | None,
) -> Array:
    """Rotation (3, 3) from the axes of the mesh to those of the floor; see `drop`."""
    options = {"face": face, "edge": edge, "corner": corner, "toward": toward}
    given_options = {name: value for name, value in options.items() if value is not None}
    if len(given_options) > 1:
        raise InputError(
            f"give one of face, edge, corner and toward; got {', '.join(given_options)}."
        )

    R = np.eye(3)
    for name, value in given_options.items():
        down = unit_vector(name, value) if name == "toward" else _downward(body, name, value)
        R = smallest_rotation(down, DOWN)
    angles = checks.floats("tilt", tilt, None)
    if angles.shape != (3,):
        tilt_text = checks.shown(tilt)
        raise InputError(
            f"tilt must be three angles in degrees, about x, y and z; got {tilt_text}."
        )

    return tilt_rotation(angles) @ R


def tilt_rotation(angles: Array) -> Array:
    """Rotation (3, 3) by angles (3,) [degree] about fixed x, then y, then z."""
    return np.asarray(Rotation.from_euler("xyz", angles, degrees=True).as_matrix())


def smallest_rotation(direction: Array, target: Array) -> Array:
    """The smallest rotation (3, 3) that turns the unit vector `direction` into `target`."""
    middle = direction + target
    if middle @ middle < 1e-12:  # half a turn about an axis across
        axis = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        return np.asarray(2 * np.outer(axis, axis) / (axis @ axis) - np.eye(3))
    rotation = 2 * np.outer(target, direction) - np.outer(middle, middle) / (1 + direction @ target)
    return np.asarray(np.eye(3) + rotation)


def _downward(body: FreeBody, kind: str, value: object) -> Array:
    """Unit vector (3,) in the axes of the body toward the named face, edge or corner."""
    name = checks.text(kind, value)
    components = {axis: float(f"{sign}1") for sign, axis in re.findall(r"([+-])([xyz])", name)}
    if not len(name) / 2 == len(components) == FACE_COUNTS[kind]:
        if kind == "face" and body.structure is not None:
            return _group_normal(body, name)
        example = {"face": "-z", "edge": "-x-z", "corner": "+x-y-z"}[kind]
        raise InputError(f"{kind} names its faces, as {example!r}; got {name!r}.")

    signs = np.array([components.get(axis, 0.0) for axis in "xyz"])
    if kind == "face":
        return signs

    # the part may have no corner near that of the box: take its farthest point in that direction
    extreme = body.points[np.argmax(body.points @ signs)]
    if kind == "edge":
        low = body.points.min(axis=0)
        high = body.points.max(axis=0)
        extreme = np.where(signs > 0, high, low) * (signs != 0)
    return np.asarray(extreme / np.linalg.norm(extreme))


def _group_normal(body: FreeBody, name: str) -> Array:
    """Mean outward unit normal (3,) of a group of faces."""
    from antiosc.fem.structure.structure import on_mesh
    from antiosc.reduce.site.map_sites import surface_sample

    assert body.structure is not None
    part = on_mesh(body.structure, 'an assembly has no groups of its own: name a face as "-z".')
    normal = surface_sample(part, name).normals.sum(axis=0)
    size = float(np.linalg.norm(normal))
    if size < 1e-9:
        raise InputError(
            f"the normals of the faces {name!r} have no mean: give the direction toward the floor."
        )
    return np.asarray(normal / size)
