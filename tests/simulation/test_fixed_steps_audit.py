"""Every step of the fixed-step methods on scenes keeps the equations that define the method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from antiosc.engine import library
from antiosc.engine.contact import State
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.reference import Settings, run_in_fixed_steps
from audited_scenes import SCENES

Array = NDArray[np.float64]
STEPS = 60
SKIPPED = ("given step", "slips", "sticks", "LankaraniNikravesh", "Flores", "Tabulated10", "Hertz1")
NAMES = [name for name in SCENES if not name.startswith(SKIPPED)]


class Nodes(NamedTuple):
    """A run at the ends of its steps, and the mean forces (n, m) over the steps."""

    made: Assembly
    run: Run
    h: Array
    q: Array
    v: Array
    force: Array
    mean: Array
    load: Array
    free: Array

    @property
    def pressed(self) -> Array:
        """Steps (n,) under contact: flights are exact, and longer."""
        return self.force[:-1].any(axis=1) | self.mean.any(axis=1)


def nodes(name: str, method: str) -> Nodes:
    """A run of `STEPS` steps; `free`: indentations (n + 1, m) without what has no mass."""
    scene, duration = SCENES[name]
    made = assemble_scene(scene(), duration)
    set_initial_forces(made.system, made.scene.preload)
    s = made.system
    found = run_in_fixed_steps(
        s, duration / STEPS, duration, Settings(method=method, max_steps=1000)
    )
    assert found.answer == library.DONE
    t, force = found.time[::2], found.force[::2]
    mean = (force[:-1] + 4 * found.force[1::2] + force[1:]) / 6  # what the parabolas give
    load, gap = (
        np.stack([np.interp(t, s.breaks, column) for column in values.T], axis=1)
        for values in (s.loads, s.offsets)
    )
    q, v = found.states.transpose(1, 0, 2)
    free = q @ s.beta.T - gap
    size = np.abs(found.depth).max()
    np.testing.assert_allclose(found.depth[::2], free - force @ s.R, rtol=0, atol=1e-9 * size)
    n = Nodes(made, found, np.diff(t)[:, None], q, v, force, mean, load, free)
    assert np.all(n.h[n.pressed] <= duration / STEPS * (1 + 1e-9))
    return n


def near(n: Nodes, found: Array, expected: Array) -> None:
    atol = 1e-9 * np.abs(expected).max(initial=1e-300)
    np.testing.assert_allclose(found[n.pressed], expected[n.pressed], rtol=0, atol=atol)


def pulled(n: Nodes, force: Array, load: Array, q: Array, v: Array) -> Array:
    s = n.made.system
    return load - force @ s.beta - s.omega**2 * q - 2 * s.decay * v


@pytest.mark.parametrize("name", NAMES)
def test_newmark_takes_the_mean_acceleration(name: str) -> None:
    n = nodes(name, "newmark")
    a = pulled(n, n.force, n.load, n.q, n.v)
    near(n, np.diff(n.v, axis=0), n.h / 2 * (a[1:] + a[:-1]))
    near(n, np.diff(n.q, axis=0), n.h / 2 * (n.v[1:] + n.v[:-1]))
    near(n, n.mean, (n.force[1:] + n.force[:-1]) / 2)
    check_forces(n)


@pytest.mark.parametrize("name", NAMES)
def test_leapfrog_takes_central_differences(name: str) -> None:
    n = nodes(name, "leapfrog")
    half = n.v[:-1] + n.h / 2 * pulled(n, n.force, n.load, n.q, n.v)[:-1]
    near(n, np.diff(n.q, axis=0), n.h * half)
    after = pulled(n, n.force, n.load, n.q, n.v)[1:]
    near(n, n.v[1:] - half, n.h / 2 * after)
    near(n, n.mean, (n.force[1:] + n.force[:-1]) / 2)
    check_forces(n)


def check_forces(n: Nodes) -> None:
    """Forces at the nodes are those of the laws."""
    made, run, s = n.made, n.run, n.made.system
    t, touched = run.time[::2], 0
    for c, law in enumerate(made.laws):
        state: State | None = law.touch(0.0) if s.start_forces[c] > 0 else None
        closed, scale = bool(s.start_forces[c] > 0), max(n.force[:, c].max(), n.mean[:, c].max())
        events = run.events[run.events[:, 1] == c]
        for k in range(len(n.h)):
            within = events[(events[:, 0] > t[k]) & (events[:, 0] <= t[k + 1])]
            if k == 0:
                within = events[events[:, 0] <= t[1]]
            for _, _, piece, speed in within:
                if piece == 1:
                    touched += 1
                    closed, state = True, law.touch(float(speed), state)
            F, delta = float(n.force[k + 1, c]), float(run.depth[2 * k + 2, c])
            if not closed:
                assert F == n.mean[k, c] == 0
                assert delta <= (0.0 if state is None else law.origin(state))
                continue
            assert state is not None
            change = n.force[k + 1] - n.force[k]
            rate = float(s.beta[c] @ n.v[k + 1] - s.R[c] @ change / n.h[k, 0])
            assert abs(F - law.force(delta, rate, state)) <= 1e-7 * scale
            state = law.advance(delta, rate, state)
            if any(piece == 0 for _, _, piece, _ in within):
                closed = False
    assert touched or s.start_forces.any()
