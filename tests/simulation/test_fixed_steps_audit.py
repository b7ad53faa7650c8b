"""Every step of the fixed-step methods on scenes keeps the equations that define the method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.march import Run
from antiosc.impact.assembly import Assembly, assemble_scene
from antiosc.impact.reference import SCENE_STEPS
from antiosc.impact.scene import set_initial_forces
from audited_scenes import SCENES

Array = NDArray[np.float64]
STEPS = 60
SKIPPED = ("given step", "LankaraniNikravesh", "Flores", "Tabulated10", "Hertz1")
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
    set_initial_forces(made)
    s = made.system
    found = SCENE_STEPS[method](s, made.laws, duration / STEPS).run(duration, 1000, 1000)
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


@pytest.mark.parametrize("name", [name for name in NAMES if not name.endswith("loaded")])
def test_the_conserving_rule_takes_the_middle_and_the_work(name: str) -> None:
    """The mean force times the way is the change of the contact's potential, but for damping."""
    n = nodes(name, "conserving")
    middle = [(each[1:] + each[:-1]) / 2 for each in (n.load, n.q, n.v)]
    near(n, np.diff(n.v, axis=0), n.h * pulled(n, n.mean, *middle))
    near(n, np.diff(n.q, axis=0), n.h * middle[2])
    check_forces(n, potential=True)


def check_forces(n: Nodes, potential: bool = False) -> None:
    """Forces at the nodes are those of the laws, or their means those of the potentials."""
    made, run, s = n.made, n.run, n.made.system
    t, touched = run.time[::2], 0
    for c, law in enumerate(made.laws):
        state: State | None = law.touch(0.0) if s.pressed[c] > 0 else None
        closed, scale = bool(s.pressed[c] > 0), max(n.force[:, c].max(), n.mean[:, c].max())
        events = run.events[run.events[:, 1] == c]
        first, count = s.tangents[c]
        rows = slice(first, first + count)
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
            if potential and not law.rate_dependent:
                check_work(law, state, n.free[k : k + 2, c], n.mean[k, c], scale)
            if count:
                most = s.slip[c, 0] * (n.mean[k, c] if potential else F)
                T = n.mean[k, rows] if potential else n.force[k + 1, rows]
                assert np.linalg.norm(T) <= most * (1 + 1e-9) + 1e-9 * scale
                inside = np.linalg.norm(T) < 0.99 * most
                if inside and not potential and n.force[k, c] > 0:
                    way = np.diff(run.depth[2 * k : 2 * k + 3 : 2, rows], axis=0)[0]
                    spring = s.slip[c, 1] * way
                    np.testing.assert_allclose(change[rows], spring, rtol=0, atol=1e-7 * scale)
            state = law.advance(delta, rate, state)
            if any(piece == 0 for _, _, piece, _ in within):
                closed = False
    assert touched or s.pressed.any()


def check_work(law: ContactLaw, state: State, ends: Array, mean: float, scale: float) -> None:
    before, after = (max(law.potential(float(d), state), 0.0) for d in ends)
    way = float(np.diff(ends)[0])
    assert abs(mean * way - (after - before)) <= 1e-6 * scale * max(abs(way), 1e-9)
