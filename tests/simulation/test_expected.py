"""What is expected of contacts before they are integrated, and how runs are refined."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc import march
from antiosc.simulation import convergence
from antiosc.simulation.assembly import assemble
from antiosc.simulation.convergence import FLOOR, MORE, MOST, NEAR, SECOND, converge, left
from antiosc.simulation.engine import Run
from antiosc.simulation.expected import deepest, pressed_depth, scaled, stiffness_at, stiffness_of
from antiosc.simulation.two_bodies import assemble as pose
from laws import laws

DEPTHS = (1e-7, 3e-6, 4e-5)


@laws
@pytest.mark.parametrize("push", [0.0, 30.0])
@pytest.mark.parametrize("soft", [0.0, 2e-7])
@pytest.mark.parametrize("close", [0.1, 1e-6])
def test_the_deepest_indentation_takes_up_energy_and_work(
    law: ao.ContactLaw, push: float, soft: float, close: float
) -> None:
    """At most so far above: the potential of contact and spring, less the work of the push."""
    state = law.touch(1.0)
    for wanted in DEPTHS:
        force = law.force(wanted, 0.0, state) if soft else 0.0
        stored = law.potential(wanted, state) + soft * force**2 / 2
        energy = stored - push * (wanted + soft * force)
        if energy < 0.0:
            continue
        found = deepest(law, state, energy, push, 1e-3, soft, close)
        assert wanted * (1 - 1e-9) <= found <= wanted * (1 + 1.01 * close)
        assert deepest(law, state, energy, push, wanted / 2, soft, close) == wanted / 2


@laws
def test_the_stiffness_of_a_contact_is_that_of_the_steeper_branch(law: ao.ContactLaw) -> None:
    for depth in DEPTHS:
        state, h = law.touch(1.0), 1e-5 * depth
        after = law.advance(depth, 0.0, state)
        rise = (law.force(depth + h, 0, state) - law.force(depth - h, 0, state)) / (2 * h)
        fall = (law.force(depth - h, 0, after) - law.force(depth - 3 * h, 0, after)) / (2 * h)
        assert stiffness_at(law, depth, state) == pytest.approx(max(rise, fall), rel=2e-3)


@pytest.mark.parametrize("law", [ao.Hertz(1e9), ao.Linear(3e6), ao.Thornton(1e9, 1e-6)])
@pytest.mark.parametrize(("gravity", "gap"), [(0.0, 1e-3), (9.81, 0.0), (500.0, 2e-3)])
def test_an_impact_is_expected_to_be_that_of_two_masses(
    law: ao.ContactLaw, gravity: float, gap: float
) -> None:
    """Free bodies 0.2 and 0.3 kg that close at 1.4 m/s; gravity speeds the gap up on one."""
    held = ao.AntiOscillators(m0=0.2, k0=0.0, m=[], omega=[], participation=[0.0])
    pair = held, ao.RigidMass(0.3, 1.5)
    problem, bodies = pose(*pair, law, initial_velocity=-0.1, gravity=gravity, gap=gap)
    found, scale = scaled(problem, bodies, 0.02)
    mass = 1 / (1 / 0.2 + 1 / 0.3)
    push, speed = mass * gravity, np.sqrt(1.4**2 + 2 * gravity * gap)
    assert found.mass == pytest.approx(mass)
    assert found.farthest == pytest.approx(speed * 0.02 + gravity * 0.02**2)
    state = law.touch(speed)
    excess = [
        law.potential(d, state) - mass * speed**2 / 2 - push * d
        for d in (found.depth / 1.1, found.depth)
    ]
    assert excess[0] <= 0 <= excess[1]
    assert found.speed == pytest.approx(speed + np.sqrt(2 * gravity * found.depth))
    assert scale == pytest.approx(3 * found.depth / found.speed)
    assert scaled(problem, bodies, scale)[1] == pytest.approx(scale / 2)


def test_what_does_not_move_is_expected_to_touch_some_time() -> None:
    still = ao.AntiOscillators(m0=0.2, k0=1e5, m=[], omega=[])
    problem, bodies = pose(still, ao.RigidMass(0.3), ao.Hertz(1e9))
    found, scale = scaled(problem, bodies, 0.32)
    assert scale == 0.02
    assert (found.depth, found.speed) == (1e-300, 1e-300)


def test_a_mass_on_a_soft_structure_goes_deeper_than_its_first_blow() -> None:
    """3 kg on the static compliance of a beam whose tip weighs 1 g; the stiffness is of both."""
    beam = ao.AntiOscillators(m0=1e-3, k0=2e4, m=[0.1], omega=[800.0])
    law = ao.Hertz(1e9)
    problem, bodies = pose(beam, ao.RigidMass(3.0, 1.5), law)
    found, _ = scaled(problem, bodies, 0.1)
    late = pressed_depth(found, found.mass, found.speed, (), found.farthest)
    force = law.force(late, 0.0, ())
    held = law.potential(late, ()) + force**2 / (2 * 2e4)
    assert held == pytest.approx(3.0 * 1.5**2 / 2, rel=0.3)
    assert held > 3.0 * 1.5**2 / 2
    assert stiffness_of(found) == pytest.approx(1.5e9 * np.sqrt(found.depth + late), rel=1e-9)


def test_a_scene_expects_each_contact_by_its_speed_and_what_pushes_it() -> None:
    """One mass flies, one falls, one is at rest until the others move it."""
    bodies = {
        "flies": ao.RigidMass(0.3, 2.0),
        "falls": ao.RigidMass(0.5),
        "rests": ao.SiteModes([700.0], [[1.2]], ["tip"]),
        "floor": ao.Obstacle(),
    }
    law = ao.Linear(1e6)
    contacts = [
        ao.Contact("floor", "flies", law),
        ao.Contact("floor", "falls", law, gap=0.02),
        ao.Contact("floor", "rests:tip", law),
    ]
    push = ao.Load("falls", [0.0], [50.0])
    made = assemble(ao.Scene(bodies, contacts, loads=[push]), 0.1)
    fall = np.sqrt(2 * 100.0 * 0.02)
    np.testing.assert_allclose(made.system.speed, [2.0, fall, 2.0], rtol=1e-9)
    np.testing.assert_allclose(made.system.mass, [0.3, 0.5, 1 / 1.44], rtol=1e-9)
    # (k/2) d^2 = (m/2) v^2 + F d
    first = np.sqrt(0.3 * 4 / 1e6)
    second = 50 / 1e6 + np.sqrt((50 / 1e6) ** 2 + 0.5 * fall**2 / 1e6)
    third = np.sqrt(4 / 1.44 / 1e6)
    depth = made.system.depth / np.array([first, second, third])
    assert np.all((depth >= 1 - 1e-9) & (depth <= 1.1))
    pace = made.system.speed + np.sqrt(2 * np.array([0, 100.0, 0]) * made.system.depth)
    assert made.lasting == pytest.approx(np.min(3 * made.system.depth / pace))
    nothing = ao.Scene({"m": ao.RigidMass(1.0), "w": bodies["floor"]}, [ao.Contact("w", "m", law)])
    assert assemble(nothing, 0.32).lasting == 0.02


# -- refinement


class Runs:
    """Stand-ins of runs whose forces have an error in proportion to their share."""

    def __init__(self, error: float, answers: tuple[int, ...] = (), attempts: int = 10) -> None:
        self.error, self.answers, self.attempts = error, answers, attempts
        self.asked: list[dict[str, Any]] = []

    def __call__(self, system: Any, duration: float, share: float, **given: Any) -> Run:
        k = len(self.asked)
        self.asked.append({"share": share, **given})
        answer = self.answers[k] if k < len(self.answers) else march.DONE
        t = np.linspace(0, duration, 201)
        force = 5.0 * np.sin(np.pi * t / duration) * (1 + self.error * share)
        return Run(
            time=t, force=force[:, None], depth=force[:, None], states=None,
            events=np.zeros((0, 4)), answer=answer, steps=100, attempts=self.attempts,
            touches=1, highest=1.0,
        )  # fmt: skip


def refined(monkeypatch: pytest.MonkeyPatch, runs: Runs, tol: float, **more: Any) -> Any:
    monkeypatch.setattr(convergence, "run", runs)
    r = more.get("r", 0.0)
    system: Any = SimpleNamespace(beta=np.ones((1, 1)), R=np.full((1, 1), r))
    law = more.get("law", ao.Linear(1.0))
    return converge(system, [law], 1e-4, 1.0, tol, 7, more.get("most", 10**6))


@pytest.mark.parametrize("error", [0.01, 0.5, 2.0, 5.0])
def test_runs_are_refined_until_two_agree(monkeypatch: pytest.MonkeyPatch, error: float) -> None:
    tol = 1e-2
    runs = Runs(error)
    found = refined(monkeypatch, runs, tol)
    share, finer, expected = tol / 2, SECOND, []
    for _ in range(8):
        expected.append(share)
        if len(expected) > 1:
            one, other = (1 + error * each for each in expected[-2:])
            known = max(left(finer, False) * abs(one / other - 1), FLOOR * share)
            if known <= tol:
                break
            finer = MORE if known <= NEAR * tol else MOST
        share /= finer
    assert [each["share"] for each in runs.asked] == pytest.approx(expected)
    assert found.force == pytest.approx(known, rel=1e-6)
    assert found.share == expected[-1]
    assert found.certain == 1.0
    assert runs.asked[0]["scale"] == 0.0
    assert runs.asked[1]["scale"] == pytest.approx(5.0 * (1 + error * tol / 2))
    assert all(each["fine"] == 1e-4 / convergence.FINE for each in runs.asked)
    assert all(each["max_contacts"] == 7 for each in runs.asked)


def test_rates_on_what_has_no_mass_are_refined_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = Runs(0.3)
    law = ao.HuntCrossley(1e9, 0.5)
    found = refined(monkeypatch, runs, 1e-2, law=law, r=1e-9)
    assert runs.asked[0]["share"] / runs.asked[1]["share"] == MOST
    off = 0.3 * (runs.asked[0]["share"] - runs.asked[1]["share"])
    assert found.force == pytest.approx(left(MOST, rated=True) * off, rel=0.01)
    plain = Runs(0.3)
    refined(monkeypatch, plain, 1e-2, law=law)
    assert plain.asked[0]["share"] / plain.asked[1]["share"] == SECOND


def test_runs_that_stop_are_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unstable ones are repeated with a finer share, three times at most; limits end all."""
    runs = Runs(0.1, (march.GREW, march.STUCK))
    assert refined(monkeypatch, runs, 1e-2).worst <= 1e-2
    shares = np.array([each["share"] for each in runs.asked])
    np.testing.assert_allclose(shares[:-2] / shares[1:-1], [MOST, MOST])
    assert len(shares) == 4
    runs = Runs(0.1, (march.GREW,) * 9)
    assert refined(monkeypatch, runs, 1e-2).worst == np.inf
    assert len(runs.asked) == convergence.PATIENCE
    for answer in (march.TOO_MANY_CONTACTS, march.TOO_MANY_STEPS):
        runs = Runs(0.1, (answer,))
        found = refined(monkeypatch, runs, 1e-2)
        assert (len(runs.asked), found.worst, found.certain) == (1, np.inf, 0.0)


def test_a_finer_run_has_room_for_so_many_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = Runs(5.0, attempts=2000)
    refined(monkeypatch, runs, 1e-3, most=10**6)
    rooms = [each["max_steps"] for each in runs.asked]
    assert rooms[:3] == [10**6, 100_000, 100_000]
    runs = Runs(5.0, attempts=10)
    refined(monkeypatch, runs, 1e-3, most=60_000)
    assert [each["max_steps"] for each in runs.asked][:2] == [60_000, convergence.CHEAP]
    runs = Runs(5.0, attempts=30)
    found = refined(monkeypatch, runs, 1e-3, most=89)
    assert (len(runs.asked), found.worst) == (1, np.inf)
    runs = Runs(5.0, attempts=30)
    refined(monkeypatch, runs, 1e-3, most=90)
    assert [each["max_steps"] for each in runs.asked] == [90, 60]
