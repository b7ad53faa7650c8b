"""Steps at which the contact drives the modes: predicted, avoided, found out, told."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import antiosc as ao
from antiosc.simulation import batch as batch_module, simulate
from antiosc.simulation.integrators import FIXED_STEP, Problem
from antiosc.simulation.integrators.onestep import Node
from antiosc.simulation.integrators.stability import STIFFNESS_SAFETY, clear_step, growth, margin
from antiosc.simulation.simulate import assemble, scaled

# a heavy mass on a soft structure whose light residual mass has its mode far above the others
MODEL = ao.AntiOscillators(m0=2e-4, k0=7e6, m=[0.18, 0.01, 0.001], omega=[1.5e4, 6e4, 2.5e5])
LAW = ao.Hertz(1.2e10)
TOP = float(MODEL.modal().omega.max())
STRIKER = ao.RigidMass(10.0, 0.3)
DURATION = 3e-3
TOUCHING = 3  # status: the heavy striker is still in contact at the end


class TwoSided(ao.Linear):
    """A spring that also pulls: the contact linearised."""

    def force(self, delta, rate, state):
        return self.stiffness * delta

    def implicit(self, delta, alpha, rate, alpha_rate, state, guess=0.0):
        return self.stiffness * delta / (1 + self.stiffness * alpha)


def linear(omega, beta, r=0.0, k=1.0, decay=None) -> Problem:
    """Modes behind a two-sided spring, at rest."""
    omega, beta = np.asarray(omega, float), np.asarray(beta, float)
    zero = np.zeros(omega.size)
    decay = zero if decay is None else np.asarray(decay, float)
    return Problem(omega, decay, beta, r, zero, 0.0, zero, zero, TwoSided(k), 0.0, k)


def room(problem: Problem, h: float) -> float:
    p = problem
    r, k, step = (np.array([x]) for x in (p.r, p.stiffness, h))
    return float(margin(p.omega[None], p.beta[None], r, k, step)[0])


def radius(problem: Problem, h: float, k: float | None = None) -> float:
    """Spectral radius of the exact motion under a force that is linear over a step.

    The matrix exponential of (q, v, F, F') gives the step; F at its end is k delta there.
    """
    p, n = problem, problem.omega.size
    k = p.stiffness if k is None else k
    A = np.zeros((2 * n + 2, 2 * n + 2))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -np.diag(p.omega**2)
    A[n : 2 * n, n : 2 * n] = -2 * np.diag(p.decay)
    A[n : 2 * n, -2] = -p.beta
    A[-2, -1] = 1.0
    scale = np.ones(2 * n + 2)
    scale[n : 2 * n] = scale[-1] = 1 / h  # in units of the step: better numbers
    E = expm(A * h * scale / scale[:, None])
    # the force at the start is the spring's, so that (q, v) and F make the state
    state = np.eye(2 * n + 1)
    held, ramp = E[: 2 * n, :-1] @ state, E[: 2 * n, -1]
    held[:, -1] -= ramp  # F' = F1 - F0
    row = k * p.beta @ held[:n] / (1 + k * (p.r - p.beta @ ramp[:n]))
    step = np.vstack((held + np.outer(ramp, row), row))
    return float(np.abs(np.linalg.eigvals(step)).max())


class TestMargin:
    """The criterion against the eigenvalues of a step."""

    def test_one_mass(self):
        """k h^2/m = 12, as for linear elements in time."""
        for mass, h in ((1.0, 1e-3), (1e-4, 1e-6)):
            k = 12 * mass / h**2
            p = linear([0.0], [mass**-0.5], k=k)
            assert room(p, h) == pytest.approx(1.0, rel=1e-9)
            assert radius(p, h, 0.999 * k) == pytest.approx(1.0, abs=1e-6)
            assert radius(p, h, 1.01 * k) > 1.1

    def test_all_modes_below_nyquist(self, rng):
        """To a force of alternating sign each answers by (1 - tan(y)/y)/omega^2, y = omega h/2."""
        omega, b, h, r = rng.uniform(1e3, 5e5, 6), rng.uniform(0.5, 20, 6), 5.5e-6, 1e-10
        y = omega * h / 2
        assert y.max() < np.pi / 2
        soft = -(r + np.sum((b / omega) ** 2 * (1 - np.tan(y) / y)))
        p = linear(omega, b, r, k=1e8)
        assert room(p, h) == pytest.approx(1 / soft / 1e8, rel=1e-9)

    @pytest.mark.parametrize(
        ("omega", "h"),
        [([1.0, 3.0, 0.0], 1.0), ([2.0, 4.05, 0.0], 1.0)],
        ids=["one mode through Nyquist", "two modes about it"],
    )
    def test_window_opens_at_the_predicted_stiffness(self, omega, h):
        p = linear(omega, [1.0, 0.5, 0.3], k=1.0)
        limit = room(p, h) * p.stiffness
        assert 0 < limit < 10
        assert radius(p, h, 0.98 * limit) == pytest.approx(1.0, abs=1e-6)
        assert radius(p, h, 1.1 * limit) > 1.002

    def test_random_bodies(self, rng):
        """What is called stable does not grow by 0.1 % a step at any stiffness up to the given."""
        unstable = idle = 0
        for _ in range(400):
            n = int(rng.integers(1, 9))
            omega = np.append(10 ** rng.uniform(2, 6, n), 0.0)
            beta = 10 ** rng.uniform(-1, 1, n + 1) * rng.choice([-1, 1], n + 1)
            r = float(rng.choice([0.0, 10 ** rng.uniform(-12, -7)]))
            p = linear(omega, beta, r, k=10 ** rng.uniform(3, 11))
            h = 10 ** rng.uniform(0.2, 1) / omega[rng.integers(n)]
            worst = max(radius(p, h, p.stiffness * share) for share in (0.1, 0.3, 0.6, 1.0))
            grows = worst > 1 + 1.1e-3
            unstable += grows
            if room(p, h) >= 1:
                assert not grows
            else:
                idle += not grows
        assert unstable > 100
        assert idle < 0.25 * unstable  # what is avoided for little

    def test_damping_slows_the_growth(self):
        undamped = linear([1.0, 3.0, 0.0], [0.5, 1.0, 0.3], k=2.0)
        damped = linear([1.0, 3.0, 0.0], [0.5, 1.0, 0.3], k=2.0, decay=[0.02, 0.06, 0.0])
        assert 1 < radius(damped, 1.0) < radius(undamped, 1.0)

    def test_clear_step(self):
        p = linear([1.0, 3.0, 0.0], [0.5, 1.0, 0.3], k=2.0)
        clear = clear_step(p, 1.0)
        assert 0.3 < clear < 1.0
        assert room(p, clear) >= STIFFNESS_SAFETY
        assert radius(p, clear) == pytest.approx(1.0, abs=1e-6)
        assert clear_step(p, 1.2) == 1.2  # above the window
        assert clear_step(p, 1.0, least=0.99) == 1.0  # nothing that large


@pytest.mark.parametrize("method", ["newmark", "conserving"])
@pytest.mark.parametrize("r", [0.0, 1e-2])
def test_average_acceleration_and_midpoint_have_no_windows(method, r, monkeypatch):
    """On a linear contact no step of theirs grows, whatever its length."""
    omega, beta = [1.0, 3.0, 7.0, 0.0], [1.0, 0.5, -2.0, 0.3]
    for k in (0.1, 10.0, 1e4):
        p = linear(omega, beta, r, k)
        integrator = FIXED_STEP[method](1.0)
        # what the midpoint rule's potential would be with a spring that pulls: its mean force
        monkeypatch.setattr(
            "antiosc.simulation.integrators.conserving.Quotient.solve",
            lambda self, free, alpha, s=1 / (1 / k + r): (
                s * (self.before + free) / 2 / (1 + s * alpha / 2)
            ),
        )
        for h in (0.1, 0.9, 1.0, 1.05, 2.0, 10.0, 1e3):
            n = p.omega.size
            columns = []
            for unit in np.eye(2 * n):
                q, v = unit[:n], unit[n:] / h
                force = p.law.implicit(p.approach(q), p.r, 0.0, 0.0, ())
                start = Node(q, v, force, 0.0, 0.0, 0.0)
                end = integrator.advance(p, start, (), h)
                columns.append(np.concatenate((end.q, end.v * h)))
            assert np.abs(np.linalg.eigvals(np.array(columns).T)).max() <= 1 + 1e-6


@pytest.fixture(scope="module")
def truth():
    return ao.simulate(MODEL, STRIKER, LAW, DURATION, step=3e-7)


class TestRuns:
    """Of the whole simulation."""

    @pytest.mark.parametrize("y", [2.8, 3.0, 3.1])
    def test_a_given_step_in_a_window_is_told(self, truth, y):
        with pytest.warns(ao.AccuracyWarning, match="gained energy"):
            hit = ao.simulate(MODEL, STRIKER, LAW, DURATION, step=y / TOP)
        assert hit.status == 2
        words = hit.message.split("use step=")[1]
        remedy = float(words.split(" ")[0])
        assert 0.5 * y / TOP < remedy < y / TOP
        good = ao.simulate(MODEL, STRIKER, LAW, DURATION, step=remedy)
        assert good.status == TOUCHING
        assert good.peak_force == pytest.approx(truth.peak_force, rel=3e-3)

    @pytest.mark.parametrize("y", [0.5, 2.0, 3.3, 4.0])
    def test_a_given_step_outside_is_not(self, truth, y):
        hit = ao.simulate(MODEL, STRIKER, LAW, DURATION, step=y / TOP)
        assert hit.status == TOUCHING
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=6e-3)

    def test_chosen_steps_avoid_them(self, monkeypatch):
        runs = []
        plain = simulate.run

        def run(problem, integrator, *rest):
            runs.append((plain(problem, integrator, *rest), integrator.step, problem))
            return runs[-1][0]

        monkeypatch.setattr(simulate, "run", run)
        self.check_avoided()
        assert len(runs) >= 4
        exact = [x for x in runs if x[0].segments and x[1] != 3e-7]
        assert not any(t.diverged for t, _, _ in exact)
        assert all(room(p, h) >= 1 for _, h, p in exact)

    def check_avoided(self):
        """Beside a speed at which plain halving would meet no window: about the same work."""
        striker, neighbour = ao.RigidMass(10.0, 0.8), ao.RigidMass(10.0, 0.6)
        problem, bodies = assemble(MODEL, striker, LAW)
        problem, scale = scaled(problem, bodies, DURATION)
        halves = [scale / simulate.COARSEST / 2**j for j in range(3)]
        assert min(room(problem, h) for h in halves) < 0.1
        hit = ao.simulate(MODEL, striker, LAW, DURATION, tol=3e-3)
        beside = ao.simulate(MODEL, neighbour, LAW, DURATION, tol=3e-3)
        assert hit.status == beside.status == TOUCHING
        assert len(hit.contacts) == 1
        truth = ao.simulate(MODEL, striker, LAW, DURATION, "conserving", step=3e-7)
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=3e-3)
        assert hit.trajectory.evaluations < 3 * beside.trajectory.evaluations

    def test_chosen_steps_without_foresight(self, monkeypatch):
        """With an estimate of the stiffness that sees no window, growth is still found out."""
        striker = ao.RigidMass(10.0, 0.8)
        monkeypatch.setattr(simulate, "_stiffness", lambda *_: 0.0)
        hit = ao.simulate(MODEL, striker, LAW, DURATION, tol=3e-3)
        assert hit.status == TOUCHING
        truth = ao.simulate(MODEL, striker, LAW, DURATION, "conserving", step=3e-7)
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=3e-3)
        assert hit.trajectory.evaluations < 10_000

    def test_short_contacts_are_done_again_outside(self):
        """A step of eight in the window: what is over within it is not done in the window."""
        striker = ao.RigidMass(0.01, 0.8)
        step = 8 * 3.0 / TOP
        hit = ao.simulate(MODEL, striker, LAW, DURATION / 10, step=step)
        start, end = hit.contacts[0]
        assert end - start < 8 * step
        inside = np.unique(np.diff(hit.time[(hit.time >= start) & (hit.time < end)]).round(12))
        assert inside.size
        assert room(hit.problem, 3.0 / TOP) < 1
        assert all(room(hit.problem, float(h)) >= 1 for h in inside[inside > 0])

    @pytest.mark.parametrize(("y", "stopped"), [(None, False), (3.0, True), (24.0, False)])
    @pytest.mark.slow
    def test_batch(self, y, stopped):
        step = None if y is None else y / TOP
        strikers = [ao.RigidMass(10.0, v) for v in np.linspace(0.3, 0.8, 11)]
        strikers += [ao.RigidMass(m, 0.8) for m in (1e-3, 0.01)]  # over within eight steps
        gained = pytest.warns(ao.AccuracyWarning, match="gained energy")
        with gained if stopped else nullcontext():
            batch = ao.simulate_many(MODEL, strikers, LAW, DURATION, step=step, tol=3e-3)
        with gained if stopped else nullcontext():
            alone = [ao.simulate(MODEL, s, LAW, DURATION, step=step, tol=3e-3) for s in strikers]
        assert batch.status.tolist() == [h.status for h in alone]
        assert (2 in batch.status) == stopped
        assert 1 not in batch.status
        assert batch.step == pytest.approx([h.step for h in alone], rel=1e-9)
        assert batch.contacts.tolist() == [len(h.contacts) for h in alone]
        assert batch.peak_force == pytest.approx([h.peak_force for h in alone], rel=1e-6)
        assert batch.impulse == pytest.approx([h.impulse for h in alone], rel=1e-6)

    @pytest.mark.parametrize("coarsest", [24, 48])
    def test_batch_without_foresight(self, monkeypatch, coarsest):
        """The second or the very first step lies in a window."""
        for module in (simulate, batch_module):
            monkeypatch.setattr(module, "COARSEST", coarsest)
        monkeypatch.setattr(simulate, "_stiffness", lambda *_: 0.0)
        strikers = [ao.RigidMass(10.0, v) for v in (0.6, 0.8)]
        batch = ao.simulate_many(MODEL, strikers, LAW, DURATION, tol=3e-3)
        alone = [ao.simulate(MODEL, s, LAW, DURATION, tol=3e-3) for s in strikers]
        assert (batch.status == TOUCHING).all()
        assert batch.step == pytest.approx([h.step for h in alone], rel=1e-9)
        assert batch.peak_force == pytest.approx([h.peak_force for h in alone], rel=1e-6)


class TestConvergence:
    """The refinement on runs whose difference is known: error (h/h0)^2, some diverged."""

    @staticmethod
    def converge(monkeypatch, diverged):
        def go(h):
            level = round(np.log2(1 / h))
            return SimpleNamespace(
                h=h, diverged=level in diverged, evaluations=int(10 / h), contacts=[], failure=""
            )

        pairs = []

        def difference(a, b):
            pairs.append((a, b))
            return (a.h**2 - b.h**2, 0.0)

        monkeypatch.setattr(simulate, "force_difference", difference)
        run, step, error = simulate._converge(go, lambda h: h, 1.0, 1e-3, 10**6, 100)
        assert not any(r.diverged for pair in pairs for r in pair)
        return run, step, error

    @pytest.mark.parametrize("diverged", [(), (0,), (1,), (0, 1), (2,), (1, 2)])
    def test_diverged_runs_are_no_partners(self, monkeypatch, diverged):
        run, step, error = self.converge(monkeypatch, diverged)
        assert not run.diverged
        assert run.h == step
        assert step**2 <= 1e-3
        assert error["force"] >= 0.9 * step**2

    def test_all_diverged(self, monkeypatch):
        run, _, error = self.converge(monkeypatch, range(40))
        assert run.diverged
        assert error["force"] == np.inf


def test_growth_counts_the_work_of_loads():
    """A falling mass: what it gains is the load's work, and no more may come."""
    g, one = 9.81, np.ones(1)
    grown = growth(np.zeros(1), g * one, np.zeros(1), np.zeros(1), 1.2)
    t = 3.0
    q, v = g * t**2 / 2 * one, g * t * one
    assert not grown(q, v)
    assert grown(q, 1.15 * v)
    assert grown(q, np.nan * v)


def test_growth_is_that_of_the_modes_that_the_contact_moves():
    """A fast spin beside a slow blow must not hide energy that comes from nothing."""
    zero, beta = np.zeros(2), np.array([1.0, 0.0])
    v = np.array([1.0, 100.0])
    grown = growth(zero, zero, zero, v, 1.2, beta)
    assert not grown(zero, v)
    assert grown(zero, v * [1.2, 1.0])
    assert not growth(zero, zero, zero, v, 1.2)(zero, v * [1.2, 1.0])
