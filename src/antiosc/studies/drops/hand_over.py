"""From a scene back to a flight, and the other way: what is kept.

Momentum, angular momentum, kinetic and strain energy are those of the scene. While it runs its axes
stand still though the body turns a little; that rotation, applied afterwards, would change the
energy of the spin: a small turn about the vertical, which moves no height, restores it. The centre
takes the height at which the lowest point lies as in the scene.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, sin
from typing import Any

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.simulation.history import SceneHistory
from antiosc.simulation.scene_states import located, marched_states
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import BODY
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor
from antiosc.studies.drops.rotation import turned

#: Largest turn [rad] that restores the energy of a spin, and samples of its search on each side.
FARTHEST, SAMPLES = 0.25, 64


def handed_over(
    body: FreeBody,
    start: State,
    posed: State,
    history: SceneHistory,
    t: float,
    which: IntArray,
    own_floor: Floor,
) -> tuple[State, Array, float]:
    """The state at a time of the scene, the heights (n,) of its contacts, and the correction."""
    moments, axes = body.principal
    axes = axes @ posed.R.T
    a, at = history.assembly, located(history.run, np.array([0.0, t]))
    own = a.spans[BODY]  # the first of the modes, those of the floor follow
    displacements, velocities = marched_states(history.run, a.system, a.load, *at)
    (q0, q), v = displacements[:, own], velocities[1, own]
    moved = (q - q0)[:3] / np.sqrt(body.mass)
    angle = ((q - q0)[3:6] / np.sqrt(moments)) @ axes
    spin = (v[3:6] / np.sqrt(moments)) @ axes
    L = posed.R @ (body.tensor @ (posed.R.T @ spin))
    node = int(np.argmin(np.abs(history.time - t)))
    heights = -history.run.depth[node, : len(which)]
    R, corrected = of_equal_energy(body, posed.R, turned(angle) @ start.R, L)
    floor = np.array([displacements[1, own.stop :], velocities[1, own.stop :]])
    state = State(
        start.time + t, start.centre + moved, v[:3] / np.sqrt(body.mass), R, L, q[6:], v[6:], floor
    )
    return _fitted(body, state, which, heights, own_floor), heights, corrected


def _fitted(body: FreeBody, state: State, which: IntArray, heights: Array, floor: Floor) -> State:
    """The state moved so that points have the heights (n,) that they have in the scene.

    Their difference is of the second order in the rotation during the episode. Points in contact
    (heights < 0) are fitted by a small rotation too; the lowest one takes its height exactly.
    """
    R, z = state.R, state.centre[2]

    def off(R: Array, z: float) -> Array:
        own = replace(state, R=R, centre=np.array([*state.centre[:2], z]))
        return heights - own.heights(body, floor.ground, which)

    held = heights < 0
    if held.sum() > 1:
        arms = body.points[which[held]] @ R.T
        rows = np.column_stack((np.full(len(arms), body.extent), arms[:, 1], -arms[:, 0]))
        found = np.linalg.lstsq(rows, off(R, z)[held], rcond=1e-6)[0]
        R = turned(np.array([found[1], found[2], 0.0])) @ R
    z = z + float(off(R, z)[np.argmin(heights)])
    return replace(state, R=R, centre=np.array([*state.centre[:2], z]))


def of_equal_energy(body: FreeBody, before: Array, after: Array, L: Array) -> tuple[Array, float]:
    """`after`, turned about the vertical so that the angular momentum L has the energy it had.

    That is its energy in the orientation `before`, of the scene. The turn, by the smallest angle
    that does it, leaves all heights; torques on a horizontal floor are horizontal, and the energy
    of a spin about a horizontal axis depends on it to first order. Where no angle gives the energy,
    the one that comes closest is taken.
    """
    from scipy.optimize import brentq

    wanted = float(L @ before @ body.inverse @ before.T @ L)
    if wanted == 0.0:
        return after, 0.0
    own = after @ body.inverse @ after.T

    (xx, xy, xz), (_, yy, yz), (_, _, zz) = (own / wanted).tolist()
    x0, y0, z = L.tolist()

    def excess(c: Any, s: Any) -> Any:
        # the momentum turned the other way has the same energy as the turned body
        x, y = c * x0 + s * y0, c * y0 - s * x0
        return xx * x * x + yy * y * y + 2 * (xy * x * y + (xz * x + yz * y) * z) + zz * z * z - 1

    angles = np.linspace(-FARTHEST, FARTHEST, 2 * SAMPLES + 1)
    values = excess(np.cos(angles), np.sin(angles))
    crossing = np.flatnonzero(values[:-1] * values[1:] <= 0)
    if len(crossing):
        k = crossing[np.argmin(np.abs(angles[crossing] + angles[crossing + 1]))]
        angle = float(
            brentq(lambda a: excess(cos(a), sin(a)), angles[k], angles[k + 1], xtol=1e-15)
        )
    else:
        angle = float(angles[np.argmin(np.abs(values))])
    return turned(np.array([0.0, 0.0, angle])) @ after, abs(angle)
