"""Steps at which the contact drives the modes: predicted, avoided, found out, told."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.linalg import expm

import antiosc as ao
from antiosc.engine.stability import clear_step, growth_rate, margin
from antiosc.engine.system import System
from antiosc.impact.reference import SCENE_STEPS, Step, StepLoads

# a heavy mass on a soft structure whose light residual mass has its mode far above the others
MODEL = ao.AntiOscillators(m0=2e-4, k0=7e6, m=[0.18, 0.01, 0.001], omega=[1.5e4, 6e4, 2.5e5])
LAW = ao.Hertz(1.2e10)
TOP = float(MODEL.modal().omega.max())
STRIKER = ao.RigidMass(10.0, 0.3)
DURATION = 3e-3
TOUCHING = 3  # status: the heavy striker is still in contact at the end


class TwoSided(ao.Linear):
    """A spring that also pulls: the contact linearised."""

    def implicit(self, delta, alpha, rate, alpha_rate, state, guess=0.0):
        return self.stiffness * delta / (1 + self.stiffness * alpha)


def one(omega, beta, r=0.0):
    """Modes, rows and compliance of one contact."""
    return np.asarray(omega, float), np.asarray(beta, float)[None], np.array([[r]])


def radius(omega, beta, R, k, h, decay=0.0) -> float:
    """Spectral radius of a step of the exact motion under parabolas of force.

    The matrix exponential of (q, v, F, F', F'') gives the motion; F', F'' meet F = k delta at h/2
    and h.
    """
    p, n = beta.shape
    A = np.zeros((2 * n + 3 * p, 2 * n + 3 * p))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -np.diag(omega**2)
    A[n : 2 * n, n : 2 * n] = -2 * np.diag(decay * np.ones(n))
    force = slice(2 * n, 2 * n + p)
    A[n : 2 * n, force] = -beta.T
    A[force, 2 * n + p : 2 * n + 2 * p] = np.eye(p)
    A[2 * n + p : 2 * n + 2 * p, 2 * n + 2 * p :] = np.eye(p)
    scale = np.ones(len(A))  # in units of the step: better numbers
    scale[n : 2 * n] = scale[2 * n + p : 2 * n + 2 * p] = 1 / h
    scale[2 * n + 2 * p :] = 1 / h**2
    A = A * scale / scale[:, None] * h
    K = np.diag(k)
    static = np.linalg.solve(np.eye(p) + K @ R, K @ beta)
    state = np.vstack((np.eye(2 * n), np.hstack((static, np.zeros((p, n))))))
    half, whole = expm(A / 2), expm(A)

    def unmet(x):
        return x[force] - K @ (beta @ x[:n] - R @ x[force])

    known = [E[:, : 2 * n + p] @ state for E in (half, whole)]
    free = [E[:, 2 * n + p :] for E in (half, whole)]
    bend = np.linalg.solve(
        np.vstack([unmet(x) for x in free]), -np.vstack([unmet(x) for x in known])
    )
    step = (known[1] + free[1] @ bend)[: 2 * n]
    return float(np.abs(np.linalg.eigvals(step)).max())


class TestMargin:
    """The criterion against the eigenvalues of a step."""

    def test_one_mass(self):
        """k h^2/m = 9.6 and 12 bound the first window, and above 48 it is unstable for good."""
        for mass, h in ((1.0, 1e-3), (1e-4, 1e-6)):
            modes = one([0.0], [mass**-0.5])
            k = mass / h**2
            assert margin(*modes, np.array([9.6 * k]), h) == pytest.approx(1.0, rel=1e-5)
            for share, grows in ((9.5, False), (9.7, True), (11.9, True), (12.1, False)):
                assert (growth_rate(*modes, np.array([share * k]), h) > 1e-3) == grows
            assert growth_rate(*modes, np.array([47.9 * k]), h) == pytest.approx(0, abs=1e-6)
            assert growth_rate(*modes, np.array([48.1 * k]), h) > 1e-3

    def test_growth_of_random_bodies_with_several_contacts(self, rng):
        unstable = 0
        for _ in range(200):
            n, p = int(rng.integers(1, 6)), int(rng.integers(1, 4))
            omega = np.append(rng.uniform(0.1, 5, n), 0.0)
            beta = rng.uniform(-1, 1, (p, n + 1))
            B = rng.normal(size=(p, p)) * rng.choice([0.0, 0.1])
            k, h = 10 ** rng.uniform(-1, 2, p), rng.uniform(0.2, 3)
            modes = omega, beta, B @ B.T
            grows = radius(*modes, k, h) - 1
            assert growth_rate(*modes, k, h) == pytest.approx(grows, rel=1e-4, abs=1e-4)
            unstable += grows > 1e-3
        assert 20 < unstable < 180

    def test_an_open_contact_does_nothing(self):
        omega, beta = np.array([1.0, 2.0]), np.array([[1.0, 0.5], [0.3, -1.0]])
        two = growth_rate(omega, beta, np.zeros((2, 2)), np.array([30.0, 0.0]), 1.5)
        alone = growth_rate(omega, beta[:1], np.zeros((1, 1)), np.array([30.0]), 1.5)
        assert two == alone > 0

    def test_a_window_opens_at_the_predicted_stiffness(self):
        modes, h = one([1.0, 3.0, 0.0], [1.0, 0.5, 0.3]), 1.7
        limit = margin(*modes, np.array([20.0]), h) * 20.0
        assert 0 < limit < 20
        assert radius(*modes, np.array([0.97 * limit]), h) == pytest.approx(1.0, abs=1e-4)
        assert radius(*modes, np.array([1.05 * limit]), h) > 1.001

    def test_two_contacts_may_be_unstable_together_alone(self):
        """Two springs at one mass add up: each alone is stable up to twice the stiffness."""
        omega, beta, R = np.zeros(1), np.ones((2, 1)), np.zeros((2, 2))
        assert margin(omega, beta, R, np.array([6.0, 6.0]), 1.0) == pytest.approx(0.8, rel=1e-4)
        assert margin(omega, beta[:1], R[:1, :1], np.array([6.0]), 1.0) == np.inf

    def test_damping_slows_the_growth(self):
        modes, h, k = one([0.0], [1.0]), 1.0, np.array([10.5])
        assert 1 < radius(*modes, k, h, decay=0.05) < radius(*modes, k, h)

    def test_clear_step(self):
        modes = one([0.0], [1.0])
        k = np.array([10.0])
        clear = clear_step(*modes, k, 1.0)
        # 1.2 k h^2 below 9.6
        assert 0.8 < clear < np.sqrt(9.6 / 12)
        assert margin(*modes, k, clear) == np.inf
        assert clear_step(*modes, k, 0.5) == 0.5
        assert clear_step(*modes, k, 1.0, least=0.99) == 1.0  # nothing that large


@pytest.mark.parametrize("method", ["newmark", "conserving"])
@pytest.mark.parametrize("r", [0.0, 1e-2])
def test_average_acceleration_and_midpoint_have_no_windows(method, r, monkeypatch):
    """On a linear contact no step of theirs grows, whatever its length."""
    omega, beta, R = one([1.0, 3.0, 7.0, 0.0], [1.0, 0.5, -2.0, 0.3], r)
    n, nothing, still = omega.size, np.zeros((1, omega.size)), np.zeros(1)
    for k in (0.1, 10.0, 1e4):
        laws = [TwoSided(k)]
        system = System(
            omega, nothing[0], beta, R, still, nothing, np.zeros((1, 1)), laws, np.zeros((1, 2)),
            np.array([[1, 0]]), nothing[0], nothing[0], *(np.ones(1) for _ in range(4)),
        )  # fmt: skip
        integrator = SCENE_STEPS[method](system, laws, 1.0)
        # what the midpoint rule's potential would be with a spring that pulls: its mean force
        monkeypatch.setattr(
            "antiosc.impact.reference.Quotient.solve",
            lambda self, free, alpha, s=1 / (1 / k + r): (
                s * (self.before + free) / 2 / (1 + s * alpha / 2)
            ),
        )
        for h in (0.1, 0.9, 1.0, 1.05, 2.0, 10.0, 1e3):
            columns = []
            for unit in np.eye(2 * n):
                q, v = unit[:n], unit[n:] / h
                force = beta @ q / (1 / k + r)
                begin = Step(q, v, force, beta @ q - r * force, beta @ v, still)
                end = integrator.advance(begin, StepLoads(nothing[0], nothing[0], still), h)
                columns.append(np.concatenate((end.q, end.v * h)))
            assert np.abs(np.linalg.eigvals(np.array(columns).T)).max() <= 1 + 1e-6


@pytest.fixture(scope="module")
def truth():
    return ao.simulate(MODEL, STRIKER, LAW, DURATION, step=3e-7)


class TestRuns:
    """Of the whole simulation."""

    @pytest.mark.sample
    @pytest.mark.parametrize("y", [2.5, 5.5, 6.0])
    def test_a_given_step_in_a_window_is_told(self, truth, y):
        with pytest.warns(ao.AccuracyWarning, match="gained energy"):
            hit = ao.simulate(MODEL, STRIKER, LAW, DURATION, step=y / TOP)
        assert hit.status == 2
        words = hit.message.split("use a step of ")[1]
        remedy = float(words.split(" ")[0])
        assert 0.5 * y / TOP < remedy < y / TOP
        good = ao.simulate(MODEL, STRIKER, LAW, DURATION, step=remedy)
        assert good.status == TOUCHING
        assert good.peak_force == pytest.approx(truth.peak_force, rel=3e-3)

    @pytest.mark.parametrize("y", [0.5, 2.0, 3.3, 4.0, 7.0, 24.0])
    def test_a_given_step_outside_is_not(self, truth, y):
        hit = ao.simulate(MODEL, STRIKER, LAW, DURATION, step=y / TOP)
        assert hit.status == TOUCHING
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=6e-3)

    @pytest.mark.slow
    @pytest.mark.parametrize("speed", [0.3, 0.6, 0.8])
    def test_chosen_steps_keep_the_tolerance(self, speed):
        """Steps in a window show as an error of the force, and are refused."""
        striker = ao.RigidMass(10.0, speed)
        hit = ao.simulate(MODEL, striker, LAW, DURATION, tol=3e-3)
        assert hit.status == TOUCHING
        assert len(hit.contacts) == 1
        truth = ao.simulate(MODEL, striker, LAW, DURATION, "conserving", step=3e-7)
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=3e-3)
        assert hit.run.attempts < 10_000

    @pytest.mark.filterwarnings("ignore:The scene gained energy")
    def test_short_contacts_are_resolved(self):
        """A step longer than the contact is halved until it resolves it."""
        striker = ao.RigidMass(0.01, 0.8)
        step = 8 * 3.0 / TOP
        hit = ao.simulate(MODEL, striker, LAW, DURATION / 10, step=step)
        truth = ao.simulate(MODEL, striker, LAW, DURATION / 10, tol=1e-5)
        start, end = hit.contacts[0]
        assert end - start < 8 * step
        assert hit.peak_force == pytest.approx(truth.peak_force, rel=0.05)
        assert hit.impulse == pytest.approx(truth.impulse, rel=0.05)


def resting(p: int, stiffness: float) -> ao.Scene:
    """1 kg that rests on p springs side by side, struck lightly."""
    walls = {f"w{i}": ao.Obstacle() for i in range(p)}
    contacts = [ao.Contact(wall, "m", ao.Linear(stiffness / p)) for wall in walls]
    bodies = {"m": ao.RigidMass(1.0, 1e-4), **walls}
    return ao.Scene(bodies, contacts, gravity=100.0, preload=True)


@pytest.mark.parametrize("p", [1, 2, 4])
def test_contacts_that_excite_the_modes_together_are_told(p: int) -> None:
    """k h^2/m = 10.6 lies in the window from 9.6 to 12; each of two springs alone is stable.

    The step in the message has 9.6 beyond the margin of 1.2 on the stiffness.
    """
    h, stiffness = 1e-3, 10.6e6
    for stable in (9.4e6, 13e6):
        assert resting(p, stable).run(0.2, step=h).status == 0
    with pytest.warns(ao.AccuracyWarning, match="unstable step"):
        hit = resting(p, stiffness).run(0.2, step=h)
    assert hit.status == 2
    found = re.search(r"use a step of ([0-9.e-]+) s or no step", hit.message)
    clear = float(found[1])
    assert 0.9 * 9.6 < 1.2 * stiffness * clear**2 < 9.6
    assert resting(p, stiffness).run(0.2, step=clear).status == 0
