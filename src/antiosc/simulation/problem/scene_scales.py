"""What is expected of the contacts of a scene, and the tangential stiffness of their friction."""

from __future__ import annotations

from math import sqrt

import numpy as np

from antiosc.base._types import Array
from antiosc.contact import ContactLaw, State
from antiosc.simulation.problem.expected import deepest, stiffness_at
from antiosc.simulation.problem.scene_parts import SceneParts

MINDLIN = 2 * (1 - 0.3) / (2 - 0.3)  # tangential over normal stiffness for nu = 0.3
DEPTH_ERROR = 1e-9  # relative, of the depth that friction's stiffness is taken at
STIFFEST = 0.1  # share of a tangential compliance that is left to the slider's spring, at least


def scales(
    scene: SceneParts,
    laws: list[ContactLaw],
    mass: Array,
    beta: Array,
    v: Array,
    loads: Array,
    gaps: Array,
    local: Array,
    duration: float,
) -> tuple[Array, Array, Array, float]:
    """Depth and speed (p,) that are expected, friction's (p, 2), the shortest contact time [s]."""
    p = len(laws)
    push, speed = np.zeros(p), _felt(beta[:p], v[None])
    if loads.any():
        # what is at rest is set in motion by the others, at their speed, or by the loads
        push = _felt(beta[:p], loads)
        falling = np.sqrt(2 * push * np.maximum(gaps, 1e-3 * duration**2 * push))
        speed = np.maximum(speed, np.minimum(falling, push * duration))
    most = float(speed.max())
    if most == 0.0:
        return np.full(p, 1e-300), np.full(p, 1e-300), np.zeros((p, 2)), duration / 16
    speed = np.where(speed > 1e-6 * most, speed, most)
    depth, slip, lasting = np.zeros(p), np.zeros((p, 2)), duration / 2
    for c, law in enumerate(laws):
        state = law.touch(float(speed[c]))
        energy = 0.5 * mass[c] * speed[c] ** 2
        far = float(speed[c] * duration + push[c] * duration**2)
        depth[c] = deepest(law, float(speed[c]), float(energy), float(push[c] * mass[c]), far)
        pace = speed[c] + sqrt(2 * push[c] * depth[c])
        lasting = min(lasting, 3 * depth[c] / pace)
        contact = scene.contacts[c]
        if contact.friction > 0:
            stiffness, patches = contact.tangential_stiffness, local[c]
            if stiffness is None:
                whole, pull = contact.law, float(push[c] * mass[c])
                most = deepest(whole, float(speed[c]), float(energy), pull, far, close=DEPTH_ERROR)
                stiffness = MINDLIN * _mean_stiffness(whole, most, state)
                if law is whole:  # the patches give way besides, normally and so sideways
                    patches = 0.0
            slip[c] = contact.friction, _beside_patches(stiffness, patches)
    return depth, speed, slip, lasting


def _beside_patches(stiffness: float, local: float) -> float:
    """What is left of a contact's tangential stiffness beside the patches of the bodies.

    By Cerruti's solution a patch whose pressure has the symmetry of a circle gives way sideways
    1/MINDLIN times as much as normally, whatever the pressure.
    """
    patches = stiffness * local / MINDLIN  # their share of the contact's compliance
    return stiffness / max(1.0 - patches, STIFFEST)


def _mean_stiffness(law: ContactLaw, most: float, state: State) -> float:
    """Mean stiffness [N/m] over a contact whose indentation is half a sine in time."""
    phases = (np.arange(16) + 0.5) / 16 * (np.pi / 2)
    return float(np.mean([stiffness_at(law, most * s, state) for s in np.sin(phases)]))


def mass_behind(beta: Array, omega: Array) -> float:
    """Inertia [kg] that the slowest motions put behind a contact, roughly."""
    rigid = omega == 0
    b = beta[rigid]
    mobility = float(b @ b)
    b = beta[~rigid]
    way = b / omega[~rigid] ** 2
    inertia = float(way @ way)
    if inertia > 0:
        mobility += float(b @ way) ** 2 / inertia
    return 1 / mobility if mobility > 0 else 1.0


def _felt(beta: Array, modal: Array) -> Array:
    """Largest |beta modal| (p,) over the rows of `modal` (K, J); what is rounding, by its parts.

    A force or motion far from a contact reaches it later.
    """
    direct, parts = abs(modal @ beta.T), abs(modal) @ abs(beta).T
    if len(modal) > 1:
        direct, parts = direct.max(axis=0), parts.max(axis=0)
    else:
        direct, parts = direct[0], parts[0]
    return np.where(direct > 1e-9 * parts, direct, 0.1 * parts)
