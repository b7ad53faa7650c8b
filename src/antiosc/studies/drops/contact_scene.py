"""The scene of a body and the floor under the points that may touch, and the path of the body.

A scene is linear about the orientation at its start, and its axes stand still while it runs. The
angular momentum turns the body along a path. What the forces do on this path beyond the scene, on
lever arms and at gaps that change, becomes loads and gaps of the next run (`on_path`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import AccuracyError, without_warnings
from antiosc.models.motion import Inertia, ModalState
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.bodies.impactors import Obstacle
from antiosc.simulation.histories.history import SceneHistory
from antiosc.simulation.histories.verdict import COMPLETED, STOPPED
from antiosc.simulation.march.system import Kept
from antiosc.simulation.problem.assembly import Assembly, assemble
from antiosc.simulation.problem.scene_parts import Contact
from antiosc.simulation.problem.scene_states import between, forces, located, marched_states
from antiosc.simulation.scene import Scene, check_range, exactly, start as begin
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Setting, law_of
from antiosc.studies.drops.rotation import turned

BODY, FLOOR = "part", "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]
#: Most contacts and steps of a scene.
LIMITS = 10_000, 50_000
#: Share of a contact time over which springs of friction are drawn out that go on.
DRAWN = 1e-5
#: Times that an orientation is put right by the spin that it has.
SWEEPS = 5
#: In place of 0 where it divides.
TINY = float(np.finfo(float).tiny)


class Held(NamedTuple):
    """A contact that goes on from an episode before.

    Its height [m] without force, the forces of its rows (normal, friction) [N], its tangential
    stiffness [N/m], and what its law remembers.
    """

    height: float
    force: Array
    stiffness: float
    kept: Kept


class Path(NamedTuple):
    """Modal states q, v (n, 6 + J) and orientations R (n, 3, 3) of the body at times (n,).

    `turns` (n, 3): the sum of its rotations so far [rad].
    """

    times: Array
    q: Array
    v: Array
    R: Array
    turns: Array


def scene_of(
    body: FreeBody,
    start: State,
    setting: Setting,
    which: IntArray,
    held: dict[int, Held],
) -> Assembly:
    """The scene of body and floor from a state, ready to run."""
    floor, slow = setting.floor, float(np.sqrt(body.extent / setting.gravity))
    bodies: dict[str, Any] = {BODY: _standing(body, start, which), FLOOR: Obstacle()}
    rigid = body.rigid_modes(start.R)[0] @ np.append(body.mass * start.velocity, start.momentum)
    motion = {BODY: ModalState(np.append(np.zeros(6), start.q), np.append(rigid, start.p))}
    if floor.ground is not None:
        bodies[FLOOR], motion[FLOOR] = floor.ground.body, floor.ground.start(start.floor)
    on = [held.get(int(i)) for i in which]
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            law_of(floor, tuple(body.radii[i].tolist()), body.materials[i]),
            gap=0.0,
            friction=floor.friction,
            tangential_stiffness=one.stiffness if one is not None and floor.friction else None,
        )
        for k, (i, one) in enumerate(zip(which.tolist(), on, strict=True))
    ]
    gravity = (0.0, 0.0, -setting.gravity)
    assembly = assemble(Scene(bodies, contacts, gravity=gravity, motion=motion), slow)
    system, p, heights = assembly.system, len(which), start.heights(body, floor.ground, which)
    gaps = [max(h, 0.0) if o is None else o.height for h, o in zip(heights, on, strict=True)]
    system.offsets[:, :p] = system.beta[:p] @ system.q + gaps
    force, drawn = np.zeros((2, len(system.beta)))
    for k, (one, (first, count)) in enumerate(zip(on, system.tangents.tolist(), strict=True)):
        if one is not None:
            force[k], sides = one.force[0], slice(first, first + count)
            force[sides] = one.force[1:]
            drawn[sides] = one.force[1:] / one.stiffness
    # springs of friction begin unstrained: what they press is added with them
    drawn += system.R @ force - system.R[:, :p] @ force[:p]
    drawn[p:] += system.R[p:, :p] @ force[:p]
    system.offsets[:, :p] += drawn[:p]
    kept = [None if one is None else one.kept for one in on]
    begin(assembly, (kept, force[:p]) if held else None)
    if drawn.any():
        offsets = system.offsets[:1] - [np.zeros(len(drawn)), drawn]
        breaks, loads = (
            np.array([0.0, DRAWN * assembly.lasting]),
            np.repeat(system.loads[:1], 2, axis=0),
        )
        system = replace(system, breaks=breaks, loads=loads, offsets=offsets)
    return replace(assembly, system=system)


def _standing(body: FreeBody, start: State, which: IntArray) -> SiteModes:
    """The body in the axes of the floor, as it stands at the start."""
    (W, momentum), (phi, r) = body.rigid_modes(start.R), body.sites(which)
    turn, size = AXES @ start.R, body.omega.size
    rigid = (W[:, None, :3] + np.cross(W[:, None, 3:], start.arms(body, which))) @ AXES.T
    B = np.concatenate((rigid, np.einsum("ab,njb->jna", turn, phi)))
    residual = turn @ r @ turn.T
    elastic: Any = {}
    if body.basis is not None:
        elastic = {"basis": (body.basis,), "shape": np.eye(6 + size)[6:]}
    S = momentum.T @ momentum
    return SiteModes(
        np.append(np.zeros(6), body.omega),
        B.reshape(6 + size, -1),
        {f"{k}": (3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(which))},
        r=block_diag(*(residual + residual.transpose(0, 2, 1)) / 2),
        directions=np.tile(AXES, (len(which), 1)),
        decay=np.append(np.zeros(6), body.decay),
        inertia=Inertia(np.zeros(3), S, np.concatenate((momentum, np.zeros((size, 6))))),
        **elastic,
    )


def run(assembly: Assembly, duration: float, tol: float) -> SceneHistory:
    """The history of a scene; its status is 2 if it stopped before its end.

    AccuracyError where a force leaves the range of its law, or where none fits at the start.
    """
    with without_warnings():
        found, _ = exactly(assembly, duration, tol, None, *LIMITS)
    if found.run.time[-1] == 0.0:
        raise AccuracyError(
            "friction jams a point at its contact: the compliance of the modes that are left out "
            "permits no contact forces there; take more modes (modes=) or less friction."
        )
    error = {"force": found.force, "peak": found.peak}
    status = STOPPED if found.run.answer else COMPLETED
    history = SceneHistory(assembly, found.run, error, status, "")
    check_range(history)
    return history


def path_of(body: FreeBody, start: State, history: SceneHistory, t: Array) -> Path:
    """The path of the body at times (n,) of a run, whose first is 0.

    Between two of them the spin changes evenly.
    """
    q, v = (each[:, history.assembly.spans[BODY]] for each in history.states(t))
    W, momentum = body.rigid_modes(start.R)
    L, frozen = v[:, :6] @ momentum[:, 3:], v[:, :6] @ W[:, 3:]
    half, linear = np.diff(t)[:, None] / 2, np.diff(q[:, :6] @ W[:, 3:], axis=0)
    R = np.broadcast_to(start.R, (len(t), 3, 3))
    for _ in range(SWEEPS):
        more = np.einsum("nab,nb->na", R @ body.inverse @ np.swapaxes(R, 1, 2), L) - frozen
        turns = linear + half * (more[:-1] + more[1:])
        R = np.concatenate((start.R[None], turned(turns)))
        span = 1
        while span < len(R):  # products of the last 1, 2, 4, ... rotations
            R[span:] = R[span:] @ R[:-span]
            span *= 2
    return Path(t, q, v, R, np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0))))


def on_path(
    body: FreeBody, start: State, which: IntArray, base: Assembly, history: SceneHistory, path: Path
) -> tuple[Assembly, float]:
    """The scene `base` on the lever arms that its points have on a path, and what that changes.

    What the forces of the run do in addition, on these arms, becomes given loads, and what the
    points move in addition a part of the gaps. The change is that against the scene that has run:
    of gaps over the largest depth, of loads over the largest ones of the contacts.
    """
    old, ran, own = base.system, history.assembly.system, base.spans[BODY]
    R, moved, beta = path.R, path.q - path.q[0], old.beta[:, own]
    W, shapes, balls = body.rigid_modes(start.R)[0], body.shapes[which], body.balls[which, None]
    arms = body.points[which] + np.einsum("kjd,nj->nkd", shapes, path.q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) - balls * AXES[0]
    ways = arms - arms[0] + (moved[:, :6] @ W[:, :3])[:, None]
    ways -= np.cross(path.turns[:, None], balls * AXES[0])  # a ball rolls
    acting = forces(history.run, *located(history.run, path.times))
    pushes, linear = np.zeros_like(arms), acting @ beta
    offsets = between(path.times, old.breaks, old.offsets).copy()
    for k, (first, count) in enumerate(old.tangents.tolist()):
        for row, axis in ((k, 2), *((first + i, i) for i in range(count))):
            pushes[:, k, axis] = acting[:, row]
            offsets[:, row] += moved @ beta[row] + ways[:, k, axis]
    total = np.append(pushes.sum(axis=1), np.cross(arms, pushes).sum(axis=1), axis=1)
    bending = np.einsum("nkd,kjd->nj", pushes @ R, shapes)
    loads = between(path.times, old.breaks, old.loads).copy()
    loads[:, own] += linear + np.append(total @ W.T, bending, axis=1)
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
    body: FreeBody, start: State, history: SceneHistory, path: Path, which: IntArray
) -> tuple[State, dict[int, Held]]:
    """The state at the end of a path, and the contacts of the points (n,) that go on.

    The centre and the orientation are those of the path; momentum, angular momentum and the modes
    are those of the scene: the energy is that of the path.
    """
    a, run, t = history.assembly, history.run, float(path.times[-1])
    W, momentum = body.rigid_modes(start.R)
    moved, P = (path.q[-1] - path.q[0])[:6] @ W, path.v[-1, :6] @ momentum
    whole = np.array(marched_states(run, a.system, *located(run, path.times[-1:])))[:, 0]
    state = State(
        start.time + t,
        start.centre + moved[:3],
        P[:3] / body.mass,
        path.R[-1],
        P[3:],
        path.q[-1, 6:],
        path.v[-1, 6:],
        whole[:, a.spans[BODY].stop :],
    )
    node = int(np.argmin(np.abs(run.time - t)))
    force, kept = run.force[node], run.kept(a.system, t)
    heights = -(run.depth[node] + a.system.R @ force)
    each = zip(which, kept, a.system.tangents, strict=True)
    held = {
        int(i): Held(
            float(heights[k]),
            force[[k, *range(first, first + count)]],
            float(a.system.slip[k, 1]),
            one._replace(closed=True),
        )
        for k, (i, one, (first, count)) in enumerate(each)
        if force[k] > 0 and one is not None
    }
    return state, held
