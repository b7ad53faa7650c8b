"""Runs of the march share what depends on the bodies alone, and nothing else."""

from __future__ import annotations

import signal
from dataclasses import dataclass

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import march
from antiosc.impact.assembly import assemble_scene
from antiosc.impact.states import contact_forces as forces_at, steps_at
from scenes import HERTZ, case_two

LAW = ao.Hertz(HERTZ)
MODEL = case_two(6)[0]


def blow(speed: float, law: ao.ContactLaw = LAW, mass: float = 0.24) -> ao.Scene:
    bodies = {"beam": MODEL, "mass": ao.RigidMass(mass, speed)}
    return ao.Scene(bodies, [ao.Contact("beam", "mass", law)])


def forces(scene: ao.Scene, duration: float = 1e-3) -> np.ndarray:
    return scene.run(duration, tol=1e-2)["beam", "mass"].force


@pytest.mark.parametrize(
    "law",
    [
        LAW,
        ao.Linear(1e7),
        ao.Power(1e9, 2.2),
        ao.Gonthier(1e10, 0.4),
        ao.Hertz(1e10, 1e-9),
        ao.Thornton(1e10, 1e-6),
    ],
    ids=lambda law: type(law).__name__,
)
def test_one_contact_has_the_forces_that_sweeps_find(law: ao.ContactLaw) -> None:
    """Beside another that never touches the forces are found by sweeps."""
    alone = assemble_scene(blow(0.1, law), 5e-4)
    bodies = {**alone.scene.bodies, "far": ao.RigidMass(1.0, -1.0)}
    pair = [*alone.scene.contacts, ao.Contact("far", "beam", ao.Linear(1.0), gap=1.0)]
    other = assemble_scene(ao.Scene(bodies, pair), 5e-4)
    runs = [
        march.run(made.system, 5e-4, 1e-2, fine=alone.contact_time_estimate / 200)
        for made in (alone, other)
    ]
    one, two = (each.force[:, 0] for each in runs)
    assert one.max() > 0
    at = np.linspace(0, 5e-4, 50)
    one, two = (forces_at(each, *steps_at(each, at))[:, 0] for each in runs)
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-9 * one.max())


@dataclass(frozen=True)
class Fails(ao.ContactLaw):
    """A spring that fails beyond an indentation, at its first step for 0, or is NaN below 0."""

    most: float

    def advance(self, delta: float, rate: float, state: ao.contact.State) -> ao.contact.State:
        if self.most == 0.0:
            raise KeyError("advance")
        return ()

    def force(self, delta: float, rate: float, state: ao.contact.State) -> float:
        if delta > self.most > 0.0:
            raise ZeroDivisionError("deep")
        if self.most < 0.0:
            return float("nan")
        return 1e7 * max(delta, 0.0)

    def tangent(self, delta: float, rate: float, state: ao.contact.State) -> tuple[float, float]:
        return (1e7 if delta > 0 else 0.0, 0.0)

    def energy(self, delta: float, state: ao.contact.State) -> float:
        return 0.5e7 * max(delta, 0.0) ** 2


@pytest.mark.parametrize(
    ("most", "error"), [(1e-6, ZeroDivisionError), (0.0, KeyError), (-1.0, ValueError)]
)
def test_the_error_of_ones_own_law_is_the_cause_of_what_is_told(
    most: float, error: type[Exception]
) -> None:
    with pytest.raises(ao.InputError, match="Fails: ") as caught:
        blow(0.1, Fails(most)).run(1e-3)
    assert type(caught.value.__cause__) is error
    assert forces(blow(0.1, Fails(1.0))).max() > 0  # the space serves again


def test_an_interrupt_stops_a_long_run(monkeypatch) -> None:
    """The march returns now and then: within a run of millions of steps an alarm is heard."""

    def late(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    pushed = {"beam": MODEL, "mass": ao.RigidMass(0.24, 0.1)}
    scene = ao.Scene(pushed, [ao.Contact("beam", "mass", LAW)], gravity=1e4)
    system = assemble_scene(scene, 1e3).system
    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(KeyboardInterrupt):
            march.run(system, 1e3, 1e-3, fine=1e-6, step=1e-7, max_steps=10**9)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_the_march_refuses_what_is_not_finite() -> None:
    system = assemble_scene(blow(0.1), 1e-3).system
    system.v[0] = np.nan
    with pytest.raises(ao.InputError, match="AOM_BAD_MODES"):
        march.run(system, 1e-3, 1e-2, fine=1e-6)


@pytest.mark.parametrize("m0", [0.02, 0.0], ids=["mass", "massless"])
def test_contacts_of_one_site_share_their_coupling(m0):
    """Balls of unlike speeds on one site, by sums over the group and by another integrator."""
    part = ao.AntiOscillators(m0=m0, k0=1e6, m=[0.1, 0.05], omega=[2000.0, 9000.0])
    balls = {f"ball {i}": ao.RigidMass(0.02, 1.0 + 0.2 * i) for i in range(3)}
    contacts = [ao.Contact("part", name, ao.Hertz(1e9), gap=1e-6 * len(name)) for name in balls]
    scene = ao.Scene({"part": part, **balls}, contacts)
    hit, other = scene.run(1e-4, tol=1e-5), scene.run(1e-4, tol=1e-3, method="DOP853")
    for contact in contacts:
        one, two = hit[contact.a, contact.b], other[contact.a, contact.b]
        assert one.peak_force == pytest.approx(two.peak_force, rel=2e-3)
        assert one.impulse == pytest.approx(two.impulse, rel=2e-3)
    run, system = hit.run, hit.assembly.system
    moved = run.states[:, 0] @ system.beta.T - run.force[::2] @ system.R - system.offsets[0]
    np.testing.assert_allclose(run.depth[::2], moved, rtol=0, atol=1e-9 * np.abs(moved).max())
