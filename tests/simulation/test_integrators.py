"""Every integrator: declared order measured, energy, massless points, agreement with the others."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import antiosc as ao
from antiosc.base._types import Array
from antiosc.engine import library
from antiosc.engine.march import difference, run
from antiosc.impact.reference import FIXED_STEP_METHODS

methods = pytest.mark.parametrize("method", ["exact", *FIXED_STEP_METHODS])
MODEL = {"k0": 1e5, "m": [0.02, 0.05, 0.04, 0.08], "omega": [1.5e3, 6e3, 1.1e4, 2e4]}
STRIKER = ao.RigidMass(0.1, 1.0)
LAWS = {
    "hertz": ao.Hertz(1.55e8),
    "hunt-crossley": ao.HuntCrossley(1.55e8, 0.5),
    "thornton": ao.Thornton(1.55e8, 2e-5),
    "yang-sun": ao.YangSun(1.55e8, 2e-5),
}
laws = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
STEPS = [4e-6, 2e-6, 1e-6]
DURATION = 6e-4


def observed_order(h, error) -> float:
    """Slope of log(error) over log(h), by least squares."""
    return float(np.polyfit(np.log(h), np.log(error), 1)[0])


@cache
def strike(law, method, step=None, m0=0.05, **kwargs):
    return ao.simulate(
        ao.AntiOscillators(m0=m0, **MODEL), STRIKER, law, DURATION, method, step=step, **kwargs
    )


@laws
@methods
@pytest.mark.slow
def test_declared_order_is_measured(law, method):
    """Against DOP853 at tight tolerance where it takes the law: the two share nothing."""
    other = "exact" if law.has_memory else "DOP853"
    truth = strike(law, other, tol=1e-8, step=None if law.has_memory else 1e-6)
    runs = [strike(law, method, step) for step in STEPS]
    t = np.linspace(0, DURATION, 3001)
    reference = np.interp(t, truth.time, truth.force)
    errors = [np.linalg.norm(np.interp(t, r.time, r.force) - reference) for r in runs]
    # between its nodes the force of a history is linear, of order 2 whatever the method
    assert observed_order(STEPS, errors) == pytest.approx(2, abs=0.35)
    assert errors[-1] < 1e-4 * np.linalg.norm(reference)


@methods
def test_energy_drift_falls_with_the_step(method):
    hits = [strike(LAWS["hertz"], method, step) for step in STEPS]
    drifts = [hit.energy.drift for hit in hits]
    if method == "exact":  # the force rises as t^1.5
        assert observed_order(STEPS, drifts) == pytest.approx(2.5, abs=0.35)
    else:
        assert observed_order(STEPS, drifts) == pytest.approx(2, abs=0.35)


@methods
def test_momentum_is_exact_whatever_the_step(method):
    run = strike(LAWS["hertz"], method, 1e-5)
    lost = STRIKER.mass * (STRIKER.velocity - run.impactor_velocity[-1])
    assert lost == pytest.approx(run.impulse, rel=1e-12)


@methods
@pytest.mark.parametrize("law", [LAWS["hertz"], LAWS["thornton"]], ids=["hertz", "thornton"])
def test_massless_contact_point(law, method):
    truth = strike(law, "exact" if law.has_memory else "DOP853", tol=1e-6, m0=0.0)
    run = strike(law, method, 1e-6, m0=0.0)
    assert difference(run.run, truth.run, np.inf)[0] < 2e-4


@pytest.mark.slow
def test_a_rate_on_a_massless_point_has_order_three() -> None:
    """Against Radau's method for F' = (closing speed - rate of the law) / compliance."""
    model = ao.AntiOscillators(m0=0.0, k0=1e6, m=[0.1, 0.1], omega=[5e3, 1e4])
    k, e, mass, speed = 1e9, 0.4, 0.24, 1.0
    soft, d = 1 / (model.k0 + model.k.sum()), 1.5 * (1 - e) / speed

    def derivatives(_: float, y: Array) -> Array:
        u, v, force, x, w = y[0], y[1], y[2], y[3:5], y[5:]
        site = soft * (force + model.k @ x)
        rate = (force / (k * (u - site) ** 1.5) - 1) / d
        rise = (v - soft * (model.k @ w) - rate) / soft
        return np.concatenate(([v, -force / mass, rise], w, model.k * (site - x) / model.m))

    begin, end = 1e-8, 3e-4  # the site has not moved yet, and the contact is still closed
    y = np.zeros(7)
    y[:3] = speed * begin, speed, k * (speed * begin) ** 1.5 * (1 + d * speed)
    size = np.array([1e-3, 1.0, 1e3, 1e-3, 1e-3, 1.0, 1.0])
    truth = solve_ivp(
        derivatives, (begin, end), y, "Radau", rtol=1e-10, atol=1e-12 * size, dense_output=True
    )
    hit = ao.simulate(model, ao.RigidMass(mass, speed), ao.HuntCrossley(k, e), end)
    steps, errors = [], []
    for share in 1e-3 * 8.0 ** -np.arange(1, 6):
        found = run(hit.assembly.system, end, share, fine=1e-7)
        node = found.time > begin
        expected = truth.sol(found.time[node])[2]
        errors.append(np.abs(found.force[node, 0] - expected).max() / expected.max())
        steps.append(1 / found.steps)
    assert observed_order(steps, errors) == pytest.approx(3, abs=0.3)
    assert hit.run.steps < 100
    assert hit.error["force"] < 1e-3


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau", "BDF", "LSODA"])
def test_every_solve_ivp_method_agrees(method):
    exact = strike(LAWS["hertz"], "exact", 2e-7)
    run = strike(LAWS["hertz"], method, tol=1e-4)
    assert run.impulse == pytest.approx(exact.impulse, rel=1e-3)
    assert run.peak_force == pytest.approx(exact.peak_force, rel=2e-3)


class TestResponses:
    """The closed forms against the matrix exponential."""

    OMEGA = np.array([0.0, 0.0, 0.0, 1e-4, 1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 30.0, 30.0])
    DECAY = np.array([0.0, 1e-3, 20.0, 0.0, 0.0, 1e-3, 1.0, 3.0, 2.9999999, 3.0000001, 2.0, 70.0])

    @pytest.mark.parametrize("t", [0.03, 0.2, 1.0, 4.0])
    def test_against_expm(self, t):
        P, W, S, J0, J1, J2 = library.responses(self.OMEGA, self.DECAY, t)
        for j, (w, d) in enumerate(zip(self.OMEGA, self.DECAY, strict=True)):
            A = np.diag([1.0, 1.0, 1.0, 1.0], 1)
            A[1, :2] = -(w**2), -2 * d
            A[1, 2] = 1.0
            E = expm(A * t)
            assert P[j] == pytest.approx(E[0, 0], abs=1e-11)
            assert W[j] == pytest.approx(E[1, 1], abs=1e-11)
            assert S[j] == pytest.approx(E[0, 1], rel=1e-9, abs=1e-12)
            assert J0[j] == pytest.approx(E[0, 2], rel=1e-9)
            assert J1[j] == pytest.approx(E[0, 3], rel=1e-9)
            assert J2[j] == pytest.approx(E[0, 4], rel=1e-9)

    def test_small_times_do_not_cancel(self):
        t = 1e-7
        J0, J1, J2 = library.responses(self.OMEGA, self.DECAY, t)[3:]
        # leading terms of the series; the next ones are smaller by 2 d t and (w t)^2
        assert pytest.approx(t**2 / 2 * (1 - 2 * self.DECAY * t / 3), rel=1e-11) == J0
        assert pytest.approx(t**3 / 6 * (1 - 2 * self.DECAY * t / 4), rel=1e-11) == J1
        assert pytest.approx(t**4 / 24 * (1 - 2 * self.DECAY * t / 5), rel=1e-11) == J2
