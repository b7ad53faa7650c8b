"""The scene of a body and the floor under the points that may touch."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.models.motion import Inertia, ModalState
from antiosc.models.site_modes import SiteModes
from antiosc.simulation.assembly import assemble
from antiosc.simulation.history import SceneHistory
from antiosc.simulation.impactors import Obstacle
from antiosc.simulation.refinement import check_range, exactly, start
from antiosc.simulation.scene import Scene
from antiosc.simulation.scene_parts import Contact
from antiosc.simulation.verdict import COMPLETED, STOPPED
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.flight import State
from antiosc.studies.drops.floor import Floor, law_of

BODY, FLOOR = "part", "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
AXES = np.eye(3)[[2, 0, 1]]
#: Most contacts and steps of a scene.
LIMITS = 10_000, 1_000_000
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
    """The scene over a duration [s] as `Scene.run` does, without its advice; status 2: it stopped.

    AccuracyError where a force leaves the range of its law.
    """
    assembly = assemble(scene, duration)
    start(assembly)
    found, _ = exactly(assembly, duration, tol, None, *LIMITS)
    history = SceneHistory(assembly, found.run, {}, STOPPED if found.run.answer else COMPLETED, "")
    check_range(history)
    return history


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
