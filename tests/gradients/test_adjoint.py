"""The derivatives that the C library finds, against complex steps and differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao
import laws
from antiosc.engine import adjoint, library, march
from antiosc.engine.damping import StackedModes, first_order
from antiosc.engine.system import System
from gradient_replay import Inputs, Steps, derivative

END = 0.03


def system(law: ao.ContactLaw, pull: float, m0: float, damped: bool, rng) -> System:
    """A ball that a pull [m/s^2] brings back to a vibrating model again and again."""
    model = ao.AntiOscillators(
        m0=m0,
        k0=4e6,
        m=rng.uniform(0.2, 1.0, 3),
        omega=np.sort(rng.uniform(3e3, 2e4, 3)),
        damping=ao.Damping(0.02, 30.0, 1e-6) if damped else None,
    )
    body = model.modal()
    ball = 1 / np.sqrt(0.1)
    size = body.omega.size + 1
    beta = np.append(-body.b, ball)
    load = np.append(np.zeros(size - 1), pull / ball)  # pushes it back to the model
    return System(
        omega=np.append(body.omega, 0.0),
        decay=np.zeros(size) if body.decay is None else np.append(body.decay, 0.0),
        beta=beta[None],
        R=np.array([[body.r]]),
        breaks=np.zeros(1),
        loads=load[None],
        offsets=np.array([[1e-5]]),
        laws=(law,),
        slip=np.zeros((1, 2)),
        tangents=np.array([[1, 0]], dtype=np.int64),
        q=1e-7 * rng.normal(size=size) * (np.append(body.omega, 0.0) > 0),
        v=np.append(np.zeros(size - 1), 0.5 / ball),
        mass=np.array([0.1]),
        depth=np.array([1e-5]),
        speed=np.array([0.5]),
        pressed=np.zeros(1),
    )


def run_of(s: System, tol: float) -> march.Run:
    options = library.COptions(END, tol, 0.0, 0.0, 1e-7, 10_000, 1_000_000, 1)
    return march.solve(s, options)[0]


#: The replay knows the patch of Hertz's law alone; that of the others: test_gradient.py, by
#: differences of runs.
LAWS = {
    name: law for name, law in laws.LAWS.items() if isinstance(law, ao.Hertz) or not law.compliance
} | {
    "power": ao.Power(6e11, 2.2),
    "flores": ao.Flores(1e9, 0.9),
    "gonthier": ao.Gonthier(1e9, 0.9),
}
TOUCHES = 6


def rattling(law: ao.ContactLaw, rng, make=system) -> tuple[System, march.Run]:
    """A run with many touches; elastic bodies are pulled back sooner."""
    massless = isinstance(law, ao.Hertz | ao.HuntCrossley | ao.TanSun)
    damped = not isinstance(law, ao.Linear | ao.Stronge)
    for pull in (50.0, 100.0, 200.0, 500.0, 1000.0):
        s = make(law, pull, 0.0 if massless else 0.02, damped, rng)
        run = run_of(s, 1e-2 if law.rate_dependent else 1e-3)
        if np.sum(run.exits[:, 5] == library.APART) >= TOUCHES:
            return s, run
    raise AssertionError("too few touches")


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_complex_steps(law: ao.ContactLaw) -> None:
    """A goal of all that a run wrote down, through many touches, by every number of the system."""
    rng = np.random.default_rng(3)
    agrees(*rattling(law, rng), rng)


def agrees(s: System, run: march.Run, rng) -> None:
    """The derivatives of a random goal along random changes of all numbers, by complex steps."""
    law = s.laws[0]
    assert run.exits is not None
    assert run.states is not None
    n, size = run.time.size // 2, s.omega.size
    places = np.array([(n - 1, 1.0, 0)], dtype=library.READING)
    weights = np.append(np.append(1e3 * rng.normal(size=size), rng.normal(size=size)), 0.0)
    by_force, by_time = 1e-4 * rng.normal(size=(2 * n + 1, 1)), rng.normal(size=n + 1)
    by_force[0] = by_time[-1] = 0.0
    found, _, answer = adjoint.gradient(
        s, run, run.states, places, weights[None], by_force, by_time
    )
    assert answer == library.DONE

    def goal(steps: Steps) -> complex:
        at_end = np.concatenate((steps.q, steps.v)) @ weights[:-1]
        return at_end + np.array(steps.force) @ by_force[:, 0] + np.array(steps.time) @ by_time

    kind = s.packed.laws[0][0].kind
    given = Inputs(
        s.omega, s.decay, s.beta[0], s.loads[0, :size], s.q, s.v, s.R[0, 0], s.offsets[0, 0],
        np.array(law.parameters(), dtype=complex), kind, float(s.slowest[0]),
        *(() if s.gamma is None else (s.gamma[0], s.loads[0, size:])),
    )  # fmt: skip
    by = {
        "omega": 2 * s.omega * found.square, "decay": found.decay, "beta": found.beta[0],
        "load": found.loads[0, :size], "q": found.q, "v": found.v, "R": found.residual[0, 0],
        "gap": found.offsets[0, 0],
    }  # fmt: skip
    if s.gamma is not None:
        by |= {"gamma": found.gamma[0], "drive": found.loads[0, size:]}
    along = {name: rng.normal(size=np.shape(by[name])) * getattr(given, name) for name in by}
    if kind != library.TABLE:
        count = 1 if kind == library.HERTZ and not given.law[1] else min(given.law.size, 3)
        by["law"] = np.pad(found.laws[0, :count], (0, given.law.size - count))
        along["law"] = by["law"] * 0.0
        along["law"][:count] = rng.normal(size=count) * given.law[:count].real
        if kind == library.HERTZ:  # what follows from k and c
            along["law"][2] = -2 / 3 * given.law[2].real * along["law"][0] / given.law[0].real
            by["law"][1], by["law"][2:] = found.laws[0, -1], 0.0
    parts = [float(np.sum(by[name] * along[name])) for name in by]
    expected = derivative(given, run, along, goal)
    assert abs(sum(parts) - expected) <= 1e-8 * max(map(abs, parts))


@pytest.mark.parametrize("name", ["linear", "hertz", "hunt-crossley", "thornton", "flores"])
def test_complex_steps_with_coupled_modes(name: str) -> None:
    """The same of modes whose rate counts too, one of them two real poles."""
    rng = np.random.default_rng(4)
    s, run = rattling(LAWS[name], rng, coupled)
    agrees(s, run, rng)


def coupled(law: ao.ContactLaw, pull: float, m0: float, damped: bool, rng) -> System:
    """That of `system` with dampers between its coordinates; the pull acts on all modes."""
    s = system(law, pull, m0, damped=False, rng=rng)
    free = s.omega.size - 1
    turn = rng.normal(size=(free, free)) * np.sqrt(
        np.append(s.omega[: free - 1] / 20, 3 * s.omega[free - 1])
    )
    first = first_order(s.omega[:-1], ao.DampingMatrix(turn.T @ turn))
    beside = StackedModes(
        [(s.omega[:-1], s.decay[:-1], first, None), (s.omega[-1:], s.decay[-1:], None, None)]
    )
    s.loads[0, :-1] = rng.normal(size=free)
    return replace(s, first=beside).marched
