"""What acts on the bodies of a scene in time: loads, gravity, the motion of the ground."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.simulation.bodies.bodies import Placed
from antiosc.simulation.bodies.impactors import Obstacle
from antiosc.simulation.problem.contact_rows import along, find
from antiosc.simulation.problem.scene_parts import SceneParts


def axes_of(bodies: dict[str, Placed]) -> dict[str, Array | None]:
    """Direction in space of the one coordinate of each body that moves along one."""
    axes: dict[str, Array | None] = {}
    for name, body in bodies.items():
        if body.directions is not None and len(body.directions):
            axes[name] = body.directions[0] if body.inertia is None else None
        else:
            axes[name] = next(iter(body.axes.values()), None)
    return axes


def acting(
    scene: SceneParts,
    bodies: dict[str, Placed],
    spans: dict[str, slice],
    columns: dict[str, slice],
    axes: dict[str, Array | None],
    B: Array,
    r: Array,
    G: Array,
    gaps: Array,
    duration: float,
) -> tuple[Array, Array, Array]:
    """Times (K,), modal loads (K, J) and offsets (K, m) of all that acts on the scene."""
    if not scene.loads and scene.base is None and not np.any(scene.gravity):
        return np.zeros(1), np.zeros((1, B.shape[0])), gaps[None]
    series = [load.times for load in scene.loads]
    if scene.base is not None:
        series.append(scene.base.times)
    inside = [t[(t > 0) & (t < duration)] for t in series]
    breaks = np.unique(np.concatenate([np.zeros(1), *inside]))
    if len(series) and any(t[-1] >= duration for t in series):
        breaks = np.append(breaks, duration)
    loads, forces = np.zeros((breaks.size, B.shape[0])), np.zeros((breaks.size, B.shape[1]))
    for load in scene.loads:
        body, site = find(load.end, bodies)
        if isinstance(body.body, Obstacle):
            raise InputError(f"the load on {load.end!r} acts on an obstacle, which does not move.")
        row = along(body, site, body.pushes.get(site), load.end)
        forces[:, columns[body.name]] += np.interp(breaks, load.times, load.forces)[:, None] * row
    loads += forces @ B.T
    gravity = np.asarray(scene.gravity)
    vector = gravity.ndim == 1 or (scene.base is not None and scene.base.accelerations.ndim == 2)
    if np.any(gravity):
        for name, body in bodies.items():
            if not np.any(body.omega == 0):
                continue
            if gravity.ndim == 1:
                pull = _weights(body, axes[name], True) @ gravity
            else:
                pull = _weights(body, axes[name], False)[:, 0] * float(gravity)
            if body.supported:
                pull = np.where(body.omega == 0, pull, 0.0)
            loads[:, spans[name]] += pull
    if scene.base is not None:
        if not any(body.grounded for body in bodies.values()):
            raise InputError(
                "base moves the ground, and no body of the scene stands on it: all are free; leave"
                " base out, or add a support or an Obstacle."
            )
        given = scene.base.accelerations
        given = given if given.ndim == 2 else given[:, None]
        moved = np.stack(
            [np.interp(breaks, scene.base.times, given[:, i]) for i in range(given.shape[1])], 1
        )
        for name, body in bodies.items():
            weights = _weights(body, axes[name], vector and given.shape[1] == 3)
            if weights.size:
                loads[:, spans[name]] -= moved @ weights.T
    return breaks, loads, gaps - forces @ r @ G.T


def _weights(body: Placed, axis: Array | None, vector: bool) -> Array:
    """Modal forces (J, 3) of unit accelerations along the axes, or (J, 1) along the coordinate."""
    if isinstance(body.body, Obstacle):
        return np.zeros((0, 3 if vector else 1))
    if vector and body.inertia is not None:
        return body.inertia.momentum[:, :3]
    if body.weight is not None and body.weight.ndim == 2:
        if vector:
            return body.weight
        pushes = np.unique(np.round(list(body.pushes.values()), 9), axis=0)
        if len(pushes) == 1:
            return np.asarray(body.weight @ pushes[0])[:, None]
        raise InputError(
            f"{body.name!r} is pushed along several directions: give gravity, or the motion of the "
            "ground, as a vector."
        )
    if body.weight is None:
        raise InputError(
            f"gravity or the ground's motion on {body.name!r} needs what its motion carries:"
            f" extract the model anew, give participation= or inertia="
            + (", or a vector where the body moves in space." if body.inertia is not None else ".")
        )
    if not vector:
        return body.weight[:, None]
    if axis is None:
        raise InputError(
            f"gravity as a vector needs the direction of {body.name!r}: its contacts must have one"
            f" (an extracted model, a RigidBody); else give gravity as a number."
        )
    return body.weight[:, None] * axis
