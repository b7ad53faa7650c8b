"""From a scene back to a flight, and the other way: what is kept.

Momentum, angular momentum and the modes are those of the scene. Its axes stand still while it runs;
the body has turned by the spin that its angular momentum gave it (`orientations`). The centre takes
the height at which the lowest point lies as in the scene.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.simulation.history import SceneHistory
from antiosc.simulation.scene_states import located, marched_states
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import BODY, orientations
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor
from antiosc.studies.drops.rotation import turned

#: Times of an episode between which the spin of the body changes evenly.
LOOKS = 9


def handed_over(
    body: FreeBody,
    start: State,
    posed: State,
    history: SceneHistory,
    t: float,
    which: IntArray,
    own_floor: Floor,
) -> tuple[State, Array]:
    """The state at a time of the scene, and the heights (n,) of its contacts."""
    a, times = history.assembly, np.linspace(0.0, t, LOOKS)
    own = a.spans[BODY]  # the first of the modes, those of the floor follow
    looks = located(history.run, times)
    displacements, velocities = marched_states(history.run, a.system, a.load, *looks)
    q, v = displacements[:, own], velocities[:, own]
    root, roots = np.sqrt(body.mass), np.sqrt(body.principal[0])
    centre, velocity = start.centre + (q[-1] - q[0])[:3] / root, v[-1, :3] / root
    L = (v[-1, 3:6] * roots) @ body.principal[1] @ posed.R.T
    R = orientations(body, start, posed, times, q, v)[-1]
    node = int(np.argmin(np.abs(history.time - t)))
    heights = -history.run.depth[node, : len(which)]
    floor = np.array([displacements[-1, own.stop :], velocities[-1, own.stop :]])
    state = State(start.time + t, centre, velocity, R, L, q[-1, 6:], v[-1, 6:], floor)
    return _fitted(body, state, which, heights, own_floor), heights


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
