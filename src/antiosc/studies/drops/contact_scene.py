"""The scene of a body and the floor under the points that may touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import without_warnings
from antiosc.models.motion import Inertia, ModalState
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.bodies.impactors import Obstacle
from antiosc.simulation.histories.history import SceneHistory
from antiosc.simulation.histories.verdict import COMPLETED, STOPPED
from antiosc.simulation.problem.assembly import Assembly, assemble
from antiosc.simulation.problem.scene_parts import Contact
from antiosc.simulation.scene import Scene, check_range, exactly, start as begin
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor, law_of

BODY, FLOOR = "part", "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]
#: Most contacts and steps of a scene.
LIMITS = 10_000, 1_000_000
#: Share of a run over which springs of friction are drawn out that go on from a run before.
DRAWN = 1e-5
#: A gap [m] that is rounding error.
ROUNDING = 1e-18


def arms_of(body: FreeBody, state: State, which: IntArray) -> Array:
    """Arms (n, 3) [m] of the lowest points of the balls at points from the centre of mass."""
    arms = body.points[which] @ state.R.T
    arms[:, 2] -= body.balls[which]
    return arms


class Held(NamedTuple):
    """A contact that goes on from an episode before.

    Its height [m] without force, forces of friction (0 or 2,) [N], tangential stiffness [N/m].
    """

    height: float
    friction: Array
    stiffness: float


def scene_of(
    body: FreeBody,
    start: State,
    posed: State,
    bent: Array,
    which: IntArray,
    heights: Array,
    held: dict[int, Held],
    floor: Floor,
    gravity: float,
    duration: float,
) -> Assembly:
    """The scene of body and floor from a state, ready to run over a duration [s].

    posed : the state that the scene is linear about.
    bent : (J,) modal displacements that give the points their lever arms.
    heights : (V,) of all points over the floor [m].
    """
    modes, shapes = _posed(body, posed, bent, which)
    moments, axes = body.principal
    on = [held.get(int(i)) for i in which]
    gaps = np.array(
        [max(h, 0.0) if o is None else o.height for h, o in zip(heights[which], on, strict=True)]
    )
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
    turning = (axes @ posed.R.T @ start.momentum) / np.sqrt(moments)
    v = np.concatenate((start.velocity * np.sqrt(body.mass), turning, start.p))
    motion[BODY] = ModalState(q, v)
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            law_of(floor, tuple(body.radii[i].tolist()), body.materials[i]),
            gap=float(lifted[k] - lower) if lifted[k] - lower > ROUNDING else 0.0,
            friction=floor.friction,
            tangential_stiffness=o.stiffness if o is not None and floor.friction else None,
        )
        for k, (i, o) in enumerate(zip(which.tolist(), on, strict=True))
    ]
    scene = Scene(bodies, contacts, gravity=(0.0, 0.0, -gravity), motion=motion)
    assembly = assemble(scene, duration)
    begin(assembly)
    return _rubbing(assembly, on, DRAWN * duration) if floor.friction and held else assembly


def _rubbing(assembly: Assembly, on: Sequence[Held | None], span: float) -> Assembly:
    """The scene with the friction of contacts that go on.

    Its springs begin unstrained, and are drawn out over a span [s].
    """
    system = assembly.system
    force, drawn = np.zeros((2, len(system.beta)))
    for o, (first, count), (_, stiffness) in zip(on, system.tangents, system.slip, strict=True):
        if o is not None:
            force[first : first + count] = o.friction
            drawn[first : first + count] = o.friction / stiffness
    offsets = system.offsets[:1] - [np.zeros(len(drawn)), drawn + system.R @ force]
    breaks, loads = np.array([0.0, span]), np.repeat(system.loads[:1], 2, axis=0)
    system = replace(system, breaks=breaks, loads=loads, offsets=offsets)
    return replace(assembly, system=system)


def run(assembly: Assembly, duration: float, tol: float) -> SceneHistory:
    """The history of a scene; its status is 2 if it stopped before its end.

    AccuracyError where a force leaves the range of its law.
    """
    with without_warnings():
        found, _ = exactly(assembly, duration, tol, None, *LIMITS)
    history = SceneHistory(assembly, found.run, {}, STOPPED if found.run.answer else COMPLETED, "")
    check_range(history)
    return history


def _posed(body: FreeBody, posed: State, bent: Array, which: IntArray) -> tuple[SiteModes, Array]:
    """The body in the axes of the floor; elastic shapes (n, 3, J) of its sites."""
    moments, axes = body.principal
    axes, turn, size = axes @ posed.R.T, AXES @ posed.R, body.omega.size
    phi, r = body.sites(which)
    arms = arms_of(body, posed, which) + np.einsum("njb,j->nb", phi, bent) @ posed.R.T
    shapes = np.einsum("ab,njb->naj", turn, phi)
    turning = np.cross(axes[None], arms[:, None]) / np.sqrt(moments)[:, None]  # (n, 3 axes, 3)
    rigid = np.broadcast_to(AXES.T / np.sqrt(body.mass), (len(which), 3, 3))
    B = np.concatenate((rigid, turning @ AXES.T, shapes.transpose(0, 2, 1)), axis=1)
    residual = turn @ r @ turn.T
    matrix, momentum = np.zeros((6, 6)), np.zeros((6 + size, 6))
    matrix[:3, :3] = body.mass * np.eye(3)
    matrix[3:, 3:] = (axes.T * moments) @ axes
    momentum[:3, :3] = np.sqrt(body.mass) * np.eye(3)
    momentum[3:6, 3:] = np.sqrt(moments)[:, None] * axes
    elastic: Any = {}
    if body.basis is not None:
        elastic = {"basis": (body.basis,), "shape": np.eye(6 + size)[6:]}
    modes = SiteModes(
        np.concatenate((np.zeros(6), body.omega)),
        B.transpose(1, 0, 2).reshape(6 + size, -1),
        {f"{k}": (3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(which))},
        r=block_diag(*(residual + residual.transpose(0, 2, 1)) / 2),
        directions=np.tile(AXES, (len(which), 1)),
        decay=np.concatenate((np.zeros(6), body.decay)),
        inertia=Inertia(np.zeros(3), (matrix + matrix.T) / 2, momentum),
        **elastic,
    )
    return modes, shapes
