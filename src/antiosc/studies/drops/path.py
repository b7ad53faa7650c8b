"""How the body moves in a run of its scene, and the state in which it flies on.

The axes of a scene stand still while it runs. Its angular momentum turns the body along a path,
from which follow the lever arms and the ways of the points that touch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.simulation.histories.history import SceneHistory
from antiosc.simulation.problem.assembly import Assembly
from antiosc.simulation.problem.scene_states import between, forces, located, marched_states
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.contact_scene import AXES, BODY, Held
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor
from antiosc.studies.drops.rotation import turned

#: Times that an orientation is put right by the spin that it has.
SWEEPS = 5
#: In place of 0 where it divides.
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Path:
    """Modal states q, v (n, 6 + J) and orientations R (n, 3, 3) of the body at times (n,).

    `turns` (n, 3): the sum of its rotations so far [rad].
    """

    times: Array
    q: Array
    v: Array
    R: Array
    turns: Array

    @property
    def angles(self) -> Array:
        """Angles (n,) [rad] by which the body has turned, roughly."""
        return np.linalg.norm(self.turns, axis=1)


def path_of(body: FreeBody, start: State, posed: State, history: SceneHistory, t: Array) -> Path:
    """The path of the body at times (n,) of a run, whose first is 0.

    Between two of them the spin changes evenly.
    """
    q, v = (each[:, history.assembly.spans[BODY]] for each in history.states(t))
    roots = np.sqrt(body.principal[0])
    axes = body.principal[1] @ posed.R.T
    L, frozen = (v[:, 3:6] * roots) @ axes, (v[:, 3:6] / roots) @ axes
    half, linear = np.diff(t)[:, None] / 2, np.diff(q[:, 3:6] / roots @ axes, axis=0)
    R = np.broadcast_to(start.R, (len(t), 3, 3))
    for _ in range(SWEEPS):
        more = np.einsum("nab,nb->na", R @ body.inverse @ np.swapaxes(R, 1, 2), L) - frozen
        turns = linear + half * (more[:-1] + more[1:])
        R = np.array([*accumulate(turned(turns), lambda R, turn: turn @ R, initial=start.R)])
    return Path(t, q, v, R, np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0))))


def bent_back(
    body: FreeBody, posed: State, which: IntArray, base: Assembly, history: SceneHistory, path: Path
) -> tuple[Assembly, float]:
    """The scene `base` on the lever arms that its points have on a path, and what that changes.

    What the forces of the run do in addition, on these arms, becomes given loads, and what the
    points move in addition a part of the gaps. The change is that against the scene that has run:
    of gaps over the largest depth, of loads over the largest ones of the contacts.
    """
    old, ran, own = base.system, history.assembly.system, base.spans[BODY]
    q, R, moved = path.q, path.R, path.q - path.q[0]
    beta, axes = old.beta[:, own], body.principal[1] @ posed.R.T
    shapes, balls = body.shapes[which], -body.balls[which, None] * AXES[0]
    arms = body.points[which] + np.einsum("kjd,nj->nkd", shapes, q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) + balls
    ways = arms - arms[0] + moved[:, None, :3] / np.sqrt(body.mass)
    ways += np.cross(path.turns[:, None], balls)  # a ball rolls
    acting = forces(history.run, *located(history.run, path.times))
    pushes, linear = np.zeros_like(arms), acting @ beta
    offsets = between(path.times, old.breaks, old.offsets).copy()
    for k, (first, count) in enumerate(old.tangents.tolist()):
        for row, axis in ((k, 2), *((first + i, i) for i in range(count))):
            pushes[:, k, axis] = acting[:, row]
            offsets[:, row] += moved @ beta[row] + ways[:, k, axis]
    loads = between(path.times, old.breaks, old.loads).copy()
    loads[:, own] += linear + np.concatenate(
        (
            pushes.sum(axis=1) / np.sqrt(body.mass),
            np.cross(arms, pushes).sum(axis=1) @ axes.T / np.sqrt(body.principal[0]),
            np.einsum("nkd,kjd->nj", pushes @ R, shapes),
        ),
        axis=1,
    )
    change = 0.0
    for new, last, size in (
        (offsets, ran.offsets, history.run.depth[:, : len(which)]),
        (loads, ran.loads, linear),
    ):
        off = float(np.abs(new - between(path.times, ran.breaks, last)).max())
        change = max(change, off / max(float(np.abs(size).max()), TINY))
    return replace(
        base, system=replace(old, breaks=path.times, loads=loads, offsets=offsets)
    ), change


def handed_over(
    body: FreeBody,
    start: State,
    posed: State,
    history: SceneHistory,
    path: Path,
    which: IntArray,
    floor: Floor,
) -> tuple[State, dict[int, Held]]:
    """The state at the end of a path, and the points (n,) below the floor.

    Momentum, angular momentum and the modes are those of the scene. The lowest point takes the
    height that it has there: what is left of the error of the path is in the height.
    """
    a, run, t = history.assembly, history.run, float(path.times[-1])
    q, v, last = path.q[-1] - path.q[0], path.v[-1], located(run, path.times[-1:])
    axes, roots = body.principal[1] @ posed.R.T, np.sqrt(body.principal[0])
    whole = np.array(marched_states(run, a.system, a.load, *last))[:, 0]
    state = State(
        start.time + t,
        start.centre + q[:3] / np.sqrt(body.mass),
        v[:3] / np.sqrt(body.mass),
        path.R[-1],
        (v[3:6] * roots) @ axes,
        path.q[-1, 6:],
        v[6:],
        whole[:, a.spans[BODY].stop :],
    )
    node = int(np.argmin(np.abs(run.time - t)))
    force = run.force[node]
    heights = -(run.depth[node] + a.system.R @ force)[: len(which)]
    lowest = int(np.argmin(heights))
    rise = heights[lowest] - state.heights(body, floor.ground, which)[lowest]
    held = {
        int(i): Held(float(heights[k]), force[first : first + count], float(a.system.slip[k, 1]))
        for k, (i, (first, count)) in enumerate(zip(which, a.system.tangents, strict=True))
        if heights[k] < 0
    }
    return replace(state, centre=state.centre + rise * AXES[0]), held
