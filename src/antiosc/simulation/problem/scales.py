"""What is expected of contacts, roughly: depth, speed, duration and stiffness; their laws freed.

These estimates start the choice of the step; no result depends on them, but for the tangential
stiffness of friction that is not given, for which the depth is found accurately.
"""

from __future__ import annotations

from ctypes import byref
from math import isfinite, sqrt

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.contact import ContactLaw, Hertz, State
from antiosc.simulation.march.laws import packed, raise_error
from antiosc.simulation.problem.scene_parts import SceneParts

CLOSE = 0.1  # relative error of a depth


def expected_impact(
    law: ContactLaw,
    mass: float,
    beta: Array,
    v: Array,
    load: Array,
    gap: float,
    duration: float,
) -> tuple[float, float, float]:
    """Depth [m], speed [m/s] and contact time [s] that are expected of one contact.

    Parameters
    ----------
    mass : inertia [kg] behind the contact, of the slowest motion of each body.
    beta, v, load : (J,) displacement of the contact in the modes, their velocities and forces at
        the start.
    """
    kernel, own = packed(law)
    at = map(march.address, (beta, v, load))
    impact = march.Impact(
        beta.size, 0, None, None, *at, None, kernel, 0.0, gap, mass, duration, 0.0, 0, 0
    )
    found = march.library.aom_expect(byref(impact))
    raise_error(own)
    depth, speed, time = found.depth, found.speed, found.time
    if not isfinite(depth + speed + time):
        raise OverflowError("the depth of the contact")
    return depth, speed, time


def deepest(
    law: ContactLaw, speed: float, energy: float, push: float, high: float, close: float = CLOSE
) -> float:
    """Indentation [m], at most `high`, that absorbs an energy and the work of a force.

    Of a new contact that closes at a `speed`; `close`: relative error.
    """
    kernel, own = packed(law)
    found = march.library.aom_law_deepest(byref(kernel), speed, energy, push, high, close)
    raise_error(own)
    return float(found)


def stiffness_at(law: ContactLaw, delta: float, state: State) -> float:
    """Contact stiffness [N/m] at the deepest indentation: the larger of loading and unloading."""
    unloading = law.advance(delta, 0.0, state)
    slopes = law.tangent(delta, 0.0, state)[0], law.tangent((1 - 1e-9) * delta, 0.0, unloading)[0]
    steepest = float(max(slopes))
    return steepest if isfinite(steepest) else 0.0


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


def freed(law: ContactLaw, local: float, a: str, b: str) -> tuple[ContactLaw, list[str]]:
    """The law of a contact without the half-space compliance [m/N] of its patches; notes on it."""
    if local == 0.0:
        return law, []
    if not isinstance(law, Hertz):
        return law, [
            f"The half-space compliance {local:.4g} m/N of the patches stays in {a!r} - {b!r}:"
            f" {type(law).__name__} is not Hertz's law."
        ]
    if law.compliance > 0.0:
        return law, []
    return law.without(local), [
        f"The half-space compliance {local:.4g} m/N of the patches was subtracted from Hertz's law"
        f" of {a!r} - {b!r}, so that the indentation is counted once."
    ]
