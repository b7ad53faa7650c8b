"""A run that is cut within a contact and goes on as another one, against the run in one piece."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.simulation.assembly import Assembly, assemble
from antiosc.simulation.march.engine import Run
from antiosc.simulation.reference import Settings
from antiosc.simulation.scene import exactly, solved, start
from antiosc.simulation.states import forces, located, states

Array = NDArray[np.float64]
TOL, DURATION = 1e-5, 3e-3


@dataclass(frozen=True)
class Sticky(ao.ContactLaw):
    """A law of the user's own that remembers its closing speed: Hunt and Crossley's."""

    stiffness: float
    restitution: float
    rate_dependent = True

    def touch(self, speed: float, state: Any = None) -> tuple[float, ...]:
        return (1.5 * (1 - self.restitution) / speed if speed > 0 else 0.0,)

    def force(self, delta: float, rate: float, state: Any) -> float:
        return max(self.stiffness * max(delta, 0.0) ** 1.5 * (1 + state[0] * rate), 0.0)

    def tangent(self, delta: float, rate: float, state: Any) -> tuple[float, float]:
        grip, d = 1 + state[0] * rate, max(delta, 0.0)
        if grip <= 0:
            return 0.0, 0.0
        return 1.5 * self.stiffness * d**0.5 * grip, self.stiffness * d**1.5 * state[0]

    def energy(self, delta: float, state: Any) -> float:
        return 0.4 * self.stiffness * max(delta, 0.0) ** 2.5


@dataclass(frozen=True)
class Denting(ao.ContactLaw):
    """A law of the user's own that remembers its deepest indentation: all above it springs back."""

    stiffness: float
    has_memory = True

    def touch(self, speed: float, state: Any = None) -> tuple[float, ...]:
        return (0.0,) if state is None else tuple(state)

    def advance(self, delta: float, rate: float, state: Any) -> tuple[float, ...]:
        return (max(delta, state[0]),)

    def origin(self, state: Any) -> float:
        return 0.6 * float(state[0])

    def force(self, delta: float, rate: float, state: Any) -> float:
        low = self.origin(state)
        if delta >= state[0]:
            return self.stiffness * max(delta, 0.0)
        return max(self.stiffness * state[0] * (delta - low) / (state[0] - low), 0.0)

    def tangent(self, delta: float, rate: float, state: Any) -> tuple[float, float]:
        return self.stiffness * (1.0 if delta >= state[0] else 2.5), 0.0

    def energy(self, delta: float, state: Any) -> float:
        low = self.origin(self.advance(delta, 0.0, state))
        return 0.5 * self.force(delta, 0.0, state) * max(delta - low, 0.0)

    def lost(self, state: Any) -> float:
        return 0.3 * self.stiffness * float(state[0]) ** 2


LAWS = {
    "Hunt-Crossley": ao.HuntCrossley(1e8, 0.6),
    "Lankarani": ao.LankaraniNikravesh(1e8, 0.6),
    "Flores": ao.Flores(1e8, 0.4),
    "Gonthier": ao.Gonthier(1e8, 0.3, 1.0),
    "user": Sticky(1e8, 0.6),
    "Thornton": ao.Thornton(1e8, 1e-5),
    "Stronge": ao.Stronge(1e8, 1e-5),
    "Yang-Sun": ao.YangSun(1e8, 2e-5),
    "Tan-Sun": ao.TanSun(1e8, 2e-5, 0.3),
    "dented user": Denting(1e6),
}


def scene(law: ao.ContactLaw, compliance: float = 0.0) -> Assembly:
    """An elastic part that strikes a stop at 1.5 m/s."""
    body = ao.SiteModes([0.0, 2e4, 6e4], [[2.0], [1.0], [-0.7]], ["tip"], r=[[compliance]])
    motion = {"part": ao.ModalState(np.zeros(3), np.array([-0.75, 0.0, 0.0]))}
    contact = ao.Contact("part:tip", "stop", law)
    made = assemble(
        ao.Scene({"part": body, "stop": ao.Obstacle()}, [contact], motion=motion), DURATION
    )
    start(made)
    return made


def solve(made: Assembly, duration: float) -> Run:
    return exactly(made, duration, TOL, None, 100, 100_000)[0].run


def at(made: Assembly, run: Run, t: Array) -> tuple[Array, Array]:
    return states(run, made.system, *located(run, t))


def cut(made: Assembly, whole: Run, share: float) -> tuple[float, Assembly]:
    """When so much of the first contact has passed, and the scene that goes on from there."""
    begin, end = whole.events[:2, 0]
    t = begin + share * (end - begin)
    (q,), (v,) = at(made, whole, np.array([t]))
    rest = replace(made, system=replace(made.system, q=q, v=v))
    force = forces(whole, *located(whole, np.array([t])))[0, :1]
    start(rest, (whole.kept(made.system, t), force))
    return t, rest


@pytest.mark.parametrize("share", [0.15, 0.5, 0.97])
@pytest.mark.parametrize("compliance", [0.0, 2e-7])
@pytest.mark.parametrize("name", LAWS)
def test_a_cut_contact_keeps_its_state(name: str, compliance: float, share: float) -> None:
    made = scene(LAWS[name], compliance)
    whole = solve(made, DURATION)
    t, rest = cut(made, whole, share)
    second = solve(rest, DURATION - t)
    assert second.touches == whole.touches - 1
    times = np.linspace(0.0, DURATION - t, 200)
    one, other = at(made, whole, t + times)[1], at(rest, second, times)[1]
    np.testing.assert_allclose(other, one, atol=1e-4 * np.abs(one).max())
    assert ao.SceneHistory(rest, second, {}, 0, "Completed.").energy.drift < 1e-3


def test_a_cut_contact_keeps_its_damping_by_other_methods() -> None:
    made = scene(LAWS["Hunt-Crossley"])
    whole = solve(made, DURATION)
    t, rest = cut(made, whole, 0.5)
    settings = Settings(1e-3, "newmark", 2e-7, 100, 100_000)
    hit, _ = solved(ao.SceneHistory, rest, DURATION - t, settings)
    parted = at(made, whole, np.array([DURATION]))[1]
    np.testing.assert_allclose(hit.run.states[-1, 1], parted[0], atol=2e-3 * abs(parted).max())
