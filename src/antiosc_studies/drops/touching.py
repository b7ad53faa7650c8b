"""The scene of the body and the floor from a touch.

The points that may touch are sites with a normal and two tangential directions. The scene is linear
about the orientation at the touch; `path` corrects it for the rotation.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from antiosc import (
    Contact,
    ContactLaw,
    Inertia,
    ModalState,
    Obstacle,
    Scene,
    SiteModes,
)
from antiosc.base._types import Array, IntArray
from antiosc.engine.equilibrium import continue_contacts
from antiosc.engine.system import ContactState
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc_studies.drops.floor import Setting, touch_law
from antiosc_studies.drops.free_body import FreeBody, State

BODY = "part"
FLOOR = "floor"
#: Directions of the columns of a site: normal to the floor, and along it.
SITE_AXES = np.eye(3)[[2, 0, 1]]
#: Duration over which friction springs of an ongoing contact are extended, over the contact time.
EXTENSION_TIME = 1e-5
#: Replaces 0 in denominators.
TINY = float(np.finfo(float).tiny)


class Touch(NamedTuple):
    """The body at the start of an episode, with its rigid modes (6, 6) and their momenta there."""

    body: FreeBody
    start: State
    modes: Array
    momenta: Array

    @classmethod
    def of(cls, body: FreeBody, start: State) -> Touch:
        """The body in a state."""
        return cls(body, start, *body.rigid_modes(start.R))


class OngoingContact(NamedTuple):
    """A contact that continues from the previous episode."""

    height: float  # at zero force [m]
    force: Array  # of its rows: normal, friction [N]
    tangential_stiffness: float  # tangential [N/m]
    state: ContactState
    law: ContactLaw


def scene_of(
    touch: Touch, setting: Setting, indices: IntArray, ongoing: dict[int, OngoingContact]
) -> Assembly:
    """The scene of the body at a touch and the floor, ready to run.

    indices : of the points that may touch; ongoing : index of a point -> contact that continues.
    """
    body, start, modes, _ = touch
    floor = setting.floor
    sites = body.patches(indices)
    arms = start.positions(body, indices)
    bodies: dict[str, Any] = {BODY: _body_in_scene(touch, sites, arms), FLOOR: Obstacle()}
    rigid = modes @ np.append(body.mass * start.velocity, start.angular_momentum)
    motion = {BODY: ModalState(np.append(np.zeros(6), start.q), np.append(rigid, start.p))}
    previous = [ongoing.get(i) for i in indices.tolist()]
    contacts = [
        Contact(
            f"{BODY}:{k}",
            FLOOR,
            touch_law(body, start, floor, i, arm) if one is None else one.law,
            gap=0.0,
            friction=floor.friction,
            tangential_stiffness=one.tangential_stiffness if one and floor.friction else None,
        )
        for k, (i, arm, one) in enumerate(zip(indices.tolist(), arms, previous, strict=True))
    ]
    gravity = (0.0, 0.0, -setting.gravity)
    time_scale = float(np.sqrt(body.extent / setting.gravity))
    assembly = assemble_scene(Scene(bodies, contacts, gravity=gravity, motion=motion), time_scale)
    system = assembly.system
    p = len(indices)
    gaps = [
        max(height, 0.0) if one is None else one.height
        for height, one in zip(start.centre[2] + arms[:, 2], previous, strict=True)
    ]
    system.offsets[:, :p] = system.beta[:p] @ system.q + gaps

    force, extension = np.zeros((2, len(system.beta)))
    for k, (one, sides) in enumerate(zip(previous, system.friction_rows, strict=True)):
        if one is not None:
            force[k] = one.force[0]
            force[sides] = one.force[1:]
            extension[sides] = one.force[1:] / one.tangential_stiffness

    # friction springs start unstrained: the displacement by their forces is added to the offsets
    extension += system.R @ force - system.R[:, :p] @ force[:p]
    extension[p:] += system.R[p:, :p] @ force[:p]
    system.offsets[:, :p] += extension[:p]
    if ongoing:
        states = [None if one is None else one.state for one in previous]
        continue_contacts(system, states, force[:p])

    if extension.any():
        system = replace(
            system,
            breaks=np.array([0.0, EXTENSION_TIME * assembly.contact_time_estimate]),
            loads=np.repeat(system.loads[:1], 2, axis=0),
            offsets=system.offsets[:1] - [np.zeros(len(extension)), extension],
        )

    return replace(assembly, system=system)


def _body_in_scene(touch: Touch, patches: tuple[Array, Array], positions: Array) -> SiteModes:
    """The modes of the body in the floor's axes, with sites at positions (n, 3) from the centre."""
    body, start, W, momentum = touch
    phi, r = patches
    rotation = SITE_AXES @ start.R
    size = body.omega.size
    rigid = (W[:, None, :3] + np.cross(W[:, None, 3:], positions)) @ SITE_AXES.T
    B = np.concatenate((rigid, np.einsum("ab,njb->jna", rotation, phi)))
    residual = rotation @ r @ rotation.T
    elastic: Any = {}
    if body.basis is not None:
        elastic = {"basis": (body.basis,), "shape": np.eye(6 + size)[6:]}

    inertia = np.concatenate((momentum, np.zeros((size, 6))))

    return SiteModes(
        np.append(np.zeros(6), body.omega),
        B.reshape(6 + size, -1),
        {f"{k}": (3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(positions))},
        r=block_diag(*(residual + residual.transpose(0, 2, 1)) / 2),
        directions=np.tile(SITE_AXES, (len(positions), 1)),
        decay=np.append(np.zeros(6), body.decay),
        inertia=Inertia(np.zeros(3), momentum.T @ momentum, inertia),
        **elastic,
    )
