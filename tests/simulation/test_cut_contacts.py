"""A run that is cut within a contact and goes on as another one, against the run in one piece."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import antiosc as ao
from antiosc.engine.equilibrium import continue_contacts, set_initial_forces
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.scene import integrate_exact
from antiosc.impact.states import contact_forces, modal_states, steps_at
from audited_scenes import Own

Array = NDArray[np.float64]
TOL, DURATION = 1e-5, 3e-3


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
    "user": Own(1e12),
    "Thornton": ao.Thornton(1e8, 1e-5),
    "Yang-Sun": ao.YangSun(1e8, 2e-5),
    "dented table": ao.Tabulated(
        X := np.linspace(0.0, 2e-4, 9),
        1e8 * X**1.5,
        ([3e-5, 1e-4, 2e-4], [0.0, 20.0, 1e8 * 2e-4**1.5]),
    ),
    "dented user": Denting(1e6),
}


def scene(law: ao.ContactLaw, compliance: float = 0.0, bounces: bool = False) -> Assembly:
    """An elastic part that strikes a stop at 1.5 m/s; a slower one `bounces` under a load."""
    omega = [0.0, 3e3, 1.1e4] if bounces else [0.0, 2e4, 6e4]
    body = ao.SiteModes(omega, [[2.0], [1.0], [-0.7]], ["tip"], r=[[compliance]])
    motion = {"part": ao.ModalState(np.zeros(3), np.array([-0.75, 0.0, 0.0]))}
    contact = ao.Contact("part:tip", "stop", law)
    made = assemble_scene(
        ao.Scene({"part": body, "stop": ao.Obstacle()}, [contact], motion=motion), DURATION
    )
    made.system.loads[:, 0] = -1500.0 * bounces
    set_initial_forces(made.system, made.scene.preload)
    return made


def solve(made: Assembly, duration: float) -> Run:
    return integrate_exact(made, duration, TOL, None, 100, 100_000).run


def at(made: Assembly, run: Run, t: Array) -> tuple[Array, Array]:
    return modal_states(run, made.system, *steps_at(run, t))


def cut(made: Assembly, whole: Run, t: float) -> Assembly:
    """The scene that goes on from a time."""
    (q,), (v,) = at(made, whole, np.array([t]))
    rest = replace(made, system=replace(made.system, q=q, v=v))
    force = contact_forces(whole, *steps_at(whole, np.array([t])))[0, :1]
    continue_contacts(rest.system, whole.contact_states(made.system, t), force)
    return rest


def within(whole: Run, share: float) -> float:
    """When so much of the first contact has passed."""
    begin, end = whole.events[:2, 0]
    return float(begin + share * (end - begin))


def goes_on(made: Assembly, whole: Run, t: float, duration: float) -> Run:
    """The run after a cut, compared with that in one piece."""
    rest = cut(made, whole, t)
    second = solve(rest, duration - t)
    times = np.linspace(0.0, duration - t, 200)
    one, other = at(made, whole, t + times)[1], at(rest, second, times)[1]
    np.testing.assert_allclose(other, one, atol=1e-4 * np.abs(one).max())
    assert ao.SceneHistory(rest, second, {}, 0, "Completed.").energy.drift < 1e-3
    return second


@pytest.mark.parametrize("share", [0.15, 0.5, 0.97])
@pytest.mark.parametrize("compliance", [0.0, 2e-7])
@pytest.mark.parametrize("name", LAWS)
def test_a_cut_contact_keeps_its_state(name: str, compliance: float, share: float) -> None:
    made = scene(LAWS[name], compliance)
    whole = solve(made, DURATION)
    second = goes_on(made, whole, within(whole, share), DURATION)
    assert second.touches == whole.touches - 1


DENTS = ["Yang-Sun", "Thornton", "dented table"]


@pytest.mark.slow
@pytest.mark.parametrize("compliance", [0.0, 2e-7])
@pytest.mark.parametrize("name", DENTS)
def test_a_dent_lasts_over_cuts_at_any_time(name: str, compliance: float) -> None:
    """At touches and releases and beside them, in flight, while it is pressed in once more."""
    made = scene(LAWS[name], compliance, bounces=True)
    whole, duration = solve(made, 6e-3), 6e-3
    events = whole.events[:, 0]
    times = [
        *events,
        *events * (1 + 1e-9),
        *whole.time[2:20:2],
        *np.random.default_rng(1).uniform(0, 6e-3, 30),
    ]
    for t in times:
        if 0 < t < 0.98 * duration:
            goes_on(made, whole, float(t), duration)
