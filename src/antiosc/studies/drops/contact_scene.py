"""The scene of a body and the floor under the points that may touch."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.models.motion import Inertia, ModalState
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.history import SceneHistory
from antiosc.simulation.impactors import Obstacle
from antiosc.simulation.refinement import check_range, exactly, start as begin
from antiosc.simulation.scene import Scene
from antiosc.simulation.scene_parts import Contact
from antiosc.simulation.scene_states import forces, located
from antiosc.simulation.verdict import COMPLETED, STOPPED
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor, law_of
from antiosc.studies.drops.rotation import turned

BODY, FLOOR = "part", "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]
#: Most contacts and steps of a scene.
LIMITS = 10_000, 1_000_000
#: Times of a run, and of each contact, at which the lever arms are looked at.
LOOKS = 33
#: Times that an orientation is put right by the spin that it has.
SWEEPS = 3
#: A gap [m] that is rounding error.
ROUNDING = 1e-18


def arms_of(body: FreeBody, state: State, which: IntArray) -> Array:
    """Arms (n, 3) [m] of the lowest points of the balls at points from the centre of mass."""
    arms = body.points[which] @ state.R.T
    arms[:, 2] -= body.balls[which]
    return arms


def scene_of(
    body: FreeBody,
    start: State,
    bent: Array,
    which: IntArray,
    gaps: Array,
    floor: Floor,
    gravity: float,
) -> Scene:
    """The scene of body and floor from a state; `gaps` (n,): heights of the points [m].

    bent : (J,) modal displacements that give the points their lever arms.
    """
    modes, shapes = _posed(body, start, bent, which)
    spin = start.spin(body)
    moments, axes = body.principal
    # displacements are measured from the state without vibration, lowered so that all gaps are >= 0
    lifted = gaps - shapes[:, 0] @ start.q if start.q.size else gaps
    bodies: dict[str, object] = {BODY: modes, FLOOR: Obstacle()}
    motion = {}
    if floor.ground is not None:
        bodies[FLOOR] = floor.ground.body
        lifted = lifted - np.sum(floor.ground.shape * start.floor)
        motion[FLOOR] = floor.ground.start(start.floor)
    lower = min(float(lifted.min()), 0.0)
    q = np.concatenate(([0.0, 0.0, lower * np.sqrt(body.mass), 0.0, 0.0, 0.0], start.q))
    turning = np.sqrt(moments) * (axes @ start.R.T @ spin)
    v = np.concatenate((start.velocity * np.sqrt(body.mass), turning, start.p))
    motion[BODY] = ModalState(q, v)
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            law_of(floor, tuple(body.radii[i].tolist()), body.materials[i]),
            gap=float(lifted[k] - lower) if lifted[k] - lower > ROUNDING else 0.0,
            friction=floor.friction,
        )
        for k, i in enumerate(which.tolist())
    ]
    return Scene(bodies, contacts, gravity=(0.0, 0.0, -gravity), motion=motion)


def run(scene: Scene, duration: float, tol: float) -> SceneHistory:
    """The scene over a duration [s] as `Scene.run` does, without its advice."""
    assembly = assemble(scene, duration)
    begin(assembly)
    return integrated(assembly, duration, tol)


def integrated(assembly: Assembly, duration: float, tol: float) -> SceneHistory:
    """The history of an assembled scene; its status is 2 if it stopped before its end.

    AccuracyError where a force leaves the range of its law.
    """
    found, _ = exactly(assembly, duration, tol, None, *LIMITS)
    history = SceneHistory(assembly, found.run, {}, STOPPED if found.run.answer else COMPLETED, "")
    check_range(history)
    return history


def turning(
    body: FreeBody, start: State, posed: State, which: IntArray, history: SceneHistory, end: float
) -> Assembly:
    """The scene with the lever arms that its points had in a run up to a time `end` [s].

    What the forces of the run do in addition, on these arms, becomes given loads, and what the
    points move in addition a part of the gaps: both are of the order of the turn, what is then left
    out of that of its square.
    """
    a = history.assembly
    t = [np.linspace(0.0, end, LOOKS)]
    t += [np.linspace(*span, LOOKS) for c in history.contact_histories for span in c.contacts]
    times = np.unique(np.clip(np.concatenate(t), 0.0, end))
    q, v = (each[:, a.spans[BODY]] for each in history.states(times))
    beta, moved = a.system.beta[:, a.spans[BODY]], q - q[0]
    roots = np.sqrt(body.principal[0])
    axes = body.principal[1] @ posed.R.T
    R = orientations(body, start, posed, times, q, v)
    shapes = body.shapes[which]
    arms = body.points[which] + np.einsum("kjd,nj->nkd", shapes, q[:, 6:])
    arms = arms @ np.swapaxes(R, 1, 2) - body.balls[which, None] * AXES[0]
    ways = arms - arms[0] + moved[:, None, :3] / np.sqrt(body.mass)
    acting = forces(history.run, *located(history.run, times))
    pushes, offsets = np.zeros_like(arms), np.repeat(a.system.offsets[:1], len(times), axis=0)
    for k, (first, count) in enumerate(a.system.tangents.tolist()):
        for row, axis in ((k, 2), *((first + i, i) for i in range(count))):
            pushes[:, k, axis] = acting[:, row]
            offsets[:, row] += moved @ beta[row] + ways[:, k, axis]
    loads = np.repeat(a.system.loads[:1], len(times), axis=0)
    own = loads[:, a.spans[BODY]]
    own += acting @ beta
    own[:, :3] += pushes.sum(axis=1) / np.sqrt(body.mass)
    own[:, 3:6] += np.cross(arms, pushes).sum(axis=1) @ axes.T / roots
    own[:, 6:] += np.einsum("nkd,kjd->nj", pushes @ R, shapes)
    return replace(a, system=replace(a.system, breaks=times, loads=loads, offsets=offsets))


def orientations(
    body: FreeBody, start: State, posed: State, times: Array, q: Array, v: Array
) -> Array:
    """R (n, 3, 3) of the body at times (n,) of a run, with modal states (n, 6 + J) there.

    The angular momentum of the scene turns the body with the spin that it has as it then lies.
    """
    roots = np.sqrt(body.principal[0])
    axes = body.principal[1] @ posed.R.T
    L, frozen = (v[:, 3:6] * roots) @ axes, (v[:, 3:6] / roots) @ axes
    half, turns = np.diff(times)[:, None] / 2, np.diff(q[:, 3:6] / roots @ axes, axis=0)
    R = np.broadcast_to(start.R, (len(times), 3, 3))
    for _ in range(SWEEPS):
        more = np.einsum("nab,nb->na", R @ body.inverse @ np.swapaxes(R, 1, 2), L) - frozen
        each = turned(turns + half * (more[:-1] + more[1:]))
        R = np.array([*accumulate(each, lambda R, turn: turn @ R, initial=start.R)])
    return R


def _posed(body: FreeBody, start: State, bent: Array, which: IntArray) -> tuple[SiteModes, Array]:
    """The body in the axes of the floor; elastic shapes (n, 3, J) of its sites."""
    moments, axes = body.principal
    axes = axes @ start.R.T
    phi, r = body.sites(which)
    arms = arms_of(body, start, which) + np.einsum("njb,j->nb", phi, bent) @ start.R.T
    size = body.omega.size
    shapes = np.einsum("ab,njb->naj", AXES @ start.R, phi) if size else np.zeros((len(which), 3, 0))
    turning = np.cross(axes[None], arms[:, None]) / np.sqrt(moments)[:, None]  # (n, 3 axes, 3)
    rigid = np.concatenate(
        (np.broadcast_to(AXES.T / np.sqrt(body.mass), (len(which), 3, 3)), turning @ AXES.T), axis=1
    )
    B = np.concatenate((rigid, shapes.transpose(0, 2, 1)), axis=1)
    residual = np.zeros((3 * len(which), 3 * len(which)))
    turn = AXES @ start.R
    for k in range(len(which)):
        own = slice(3 * k, 3 * k + 3)
        residual[own, own] = turn @ r[k] @ turn.T
    matrix, momentum = np.zeros((6, 6)), np.zeros((6 + size, 6))
    matrix[:3, :3] = body.mass * np.eye(3)
    matrix[3:, 3:] = (axes.T * moments) @ axes
    momentum[:3, :3] = np.sqrt(body.mass) * np.eye(3)
    momentum[3:6, 3:] = np.sqrt(moments)[:, None] * axes
    elastic = {}
    if body.basis is not None:
        elastic = {"basis": (body.basis,), "shape": np.eye(6 + size)[6:]}
    modes = SiteModes(
        np.concatenate((np.zeros(6), body.omega)),
        B.transpose(1, 0, 2).reshape(6 + size, -1),
        {f"{k}": (3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(which))},
        r=(residual + residual.T) / 2,
        directions=np.tile(AXES, (len(which), 1)),
        decay=np.concatenate((np.zeros(6), body.decay)),
        inertia=Inertia(np.zeros(3), (matrix + matrix.T) / 2, momentum),
        **elastic,  # type: ignore[arg-type]
    )
    return modes, shapes
