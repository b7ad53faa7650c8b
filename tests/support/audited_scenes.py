"""Scenes of every law and of several contacts whose runs are audited step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import ClassVar

import numpy as np

import antiosc as ao
from antiosc.engine.contact import State
from direct import chain, free_modes
from march_audit import Audit, audited
from scene_cases import LAWS, ball, plate, rod_between_walls, stops

BODY = ao.SiteModes([0.0, 2e3, 9e3], [[1.5], [3.0], [4.0]], ["tip"], decay=[5.0, 30.0, 0.0])


@dataclass(frozen=True)
class Own(ao.ContactLaw):
    """A law of one's own: k delta^2 (1 + 0.3 rate/v0), v0 the closing speed."""

    k: float
    rate_dependent: ClassVar[bool] = True

    def touch(self, speed: float, state: State | None = None) -> State:
        return (0.3 / speed,)

    def force(self, delta: float, rate: float, state: State) -> float:
        return max(self.k * delta**2 * (1 + state[0] * rate), 0.0) if delta > 0 else 0.0

    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        grip = 1 + state[0] * rate
        if delta <= 0 or grip <= 0:
            return 0.0, 0.0
        return 2 * self.k * delta * grip, self.k * delta**2 * state[0]

    def energy(self, delta: float, state: State) -> float:
        return self.k * max(delta, 0.0) ** 3 / 3


def blow(law: ao.ContactLaw) -> ao.Scene:
    """A mass strikes a body that is free, vibrates, and is damped."""
    bodies = {"a": BODY, "b": ao.RigidMass(0.3, 2.0)}
    return ao.Scene(bodies, [ao.Contact("a", "b", law, gap=1e-5)])


def loaded(preload: bool) -> ao.Scene:
    """Two chains with soft sites and a floor: gravity, loads in time, the motion of the ground."""
    rng, n = np.random.default_rng(4), 5
    K, M = chain(n, 3e5, rng.uniform(0.05, 0.2, n), held=True)
    omega, b = free_modes(K, M, np.eye(n)[:, [1, 3, 4]])
    a = rng.normal(size=(3, 3))
    common = {
        "sites": ["x", "y", "z"],
        "weight": free_modes(K, M, M.diagonal()[:, None])[1] * [0, 0, 1.0],
        "directions": [(0, 0, 1.0)] * 3,
    }
    bodies = {
        "one": ao.SiteModes(omega, b, r=a @ a.T * 2e-8, decay=0.02 * omega, **common),
        "two": ao.SiteModes(1.3 * omega, b, r=a @ a.T * 1e-8, **common),
        "floor": ao.Obstacle(),
    }
    contacts = [
        ao.Contact("two:x", "one:x", ao.Hertz(2e8)),
        ao.Contact("two:y", "one:y", ao.Hertz(2e8), gap=2e-5),
        ao.Contact("one:z", "floor", ao.Power(1e8, 1.3), gap=1e-5),
    ]
    loads = [
        ao.Load("one:y", [0, 4e-4, 9e-4], [40.0, -90.0, 60.0]),
        ao.Load("two:z", [1e-4, 5e-4], [0, -80.0]),
    ]
    base = None if preload else ao.Base([0, 3e-4, 8e-4], [0.0, 300.0, -200.0])
    return ao.Scene(bodies, contacts, gravity=-9.81, loads=loads, base=base, preload=preload)


def stiff_site() -> ao.Scene:
    """A heavy mass on a soft structure whose light residual mass vibrates far above the rest."""
    model = ao.AntiOscillators(m0=2e-4, k0=7e6, m=[0.18, 0.01, 0.001], omega=[1.5e4, 6e4, 2.5e5])
    bodies = {"a": model, "b": ao.RigidMass(10.0, 0.3)}
    return ao.Scene(bodies, [ao.Contact("a", "b", ao.Hertz(1.2e10))])


#: What makes each scene, and its duration [s].
SCENES: dict[str, tuple[Callable[[], ao.Scene], float]] = {
    **{f"{type(law).__name__}{i}": (partial(blow, law), 1.2e-3) for i, law in enumerate(LAWS)},
    "own": (lambda: blow(Own(1e12)), 1e-3),
    "plate": (lambda: plate(ao.Hertz(1e8), 1e-3)[0], 2e-3),
    "damped plate": (lambda: plate(ao.HuntCrossley(1e8, 0.5), 1e-3)[0], 2e-3),
    "plastic plate": (lambda: plate(ao.Thornton(1e8, 1e-4), 1e-3)[0], 2e-3),
    "rod": (lambda: rod_between_walls(1.5)[0], 1e-3),
    "stops": (lambda: stops()[0], 1e-3),
    "slips": (lambda: ball(5.0, 0.2, ao.Hertz(1e9)), 1e-3),
    "sticks": (lambda: ball(0.3, 0.5, ao.Hertz(1e9)), 1e-3),
    "loaded": (lambda: loaded(preload=False), 1.2e-3),
    "given step": (stiff_site, 2e-4),
    "preloaded": (lambda: loaded(preload=True), 1.2e-3),
}
#: Steps [s] that are given; error of the others.
GIVEN = {"given step": 4e-6}
SHARE = 1e-3


@cache
def checked(name: str) -> Audit:
    """The run of a scene, after its audit."""
    scene, duration = SCENES[name]
    step = GIVEN.get(name)
    found = audited(scene(), duration, 0.05 if step else SHARE, step)
    assert found.run.touches > 0 or found.made.system.start_forces.any()
    return found
