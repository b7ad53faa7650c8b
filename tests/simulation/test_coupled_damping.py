"""Impacts on bodies whose damping couples their modes, against DOP853 on all their states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import antiosc as ao
from antiosc.base.errors import InputError
from scenes import random_model

N = 5
RNG = np.random.default_rng(5)
OMEGA, MASS = np.sort(RNG.uniform(1e3, 2e4, N)), RNG.uniform(0.02, 0.1, N)
DASHPOTS = RNG.normal(size=(2, N + 1)) * 8
SPRINGS, TAU = RNG.normal(size=(1, N + 1)) * 100, 2e-4
BARE = ao.AntiOscillators(m0=0.02, k0=2e4, m=MASS, omega=OMEGA)
DAMPED = replace(
    BARE, damping=ao.DampingMatrix(DASHPOTS.T @ DASHPOTS, [(SPRINGS.T @ SPRINGS, TAU)])
)
BALL, LAW, END = ao.RigidMass(mass=0.1, velocity=1.0), ao.Hertz(1e7), 4e-3
SIZE = N + 1
K, M = np.diag(np.append(BARE.k0, OMEGA**2)), np.eye(SIZE)
M[0, 0], M[0, 1:], M[1:, 0] = BARE.m_st, np.sqrt(MASS), np.sqrt(MASS)


def rates(t: float, y: np.ndarray) -> np.ndarray:
    """Of the displacements, velocities, the spring of the branch, and the ball."""
    q, v, xi, ball, speed = y[:SIZE], y[SIZE:-3], y[-3], y[-2], y[-1]
    force = LAW.stiffness * max(ball - q[0], 0.0) ** 1.5
    stretch = float(SPRINGS[0] @ q) - xi
    f = -K @ q - DASHPOTS.T @ (DASHPOTS @ v) - SPRINGS[0] * stretch
    f[0] += force
    a = np.linalg.solve(M, f)
    return np.concatenate([v, a, [stretch / TAU, speed, -force / BALL.mass]])


@pytest.fixture(scope="module")
def exact():
    start = np.zeros(2 * SIZE + 3)
    start[-1] = 1.0
    return solve_ivp(
        rates, (0, END), start, method="DOP853", rtol=1e-9, atol=1e-13, dense_output=True,
        max_step=4e-6,
    ).sol  # fmt: skip


def test_the_energy_that_damping_took_is_that_of_the_dashpots(exact):
    hit = ao.simulate(DAMPED, BALL, LAW, END, tol=1e-6)
    t = np.linspace(0, END, 4001)
    y = exact(t)
    power = np.sum((DASHPOTS @ y[SIZE:-3]) ** 2, axis=0)
    stretch = SPRINGS[0] @ y[:SIZE] - y[-3]
    power = power + stretch**2 / TAU
    lost = float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(t))) + 0.5 * float(stretch[-1] ** 2)
    assert hit.energy.dissipated[-1] == pytest.approx(lost, rel=1e-4)
    assert hit.energy.drift < 1e-6


@pytest.mark.slow
def test_a_scene_under_a_load_agrees_with_an_integrator():
    """Two contacts of a damped body, and a load."""
    rng = np.random.default_rng(7)
    L = rng.normal(size=(1, 6)) * 5
    body = ao.AntiOscillators(
        m0=np.diag([0.02, 0.03]), k0=np.array([[3e4, -1e4], [-1e4, 2e4]]),
        P=rng.normal(size=(2, 4)) * 0.1, omega=np.array([1e3, 3e3, 5e3, 9e3]), sites=("a", "b"),
        damping=ao.DampingMatrix(L.T @ L),
    )  # fmt: skip
    scene = ao.Scene(
        bodies={"part": body, "ball": ao.RigidMass(0.05, 1.0), "other": ao.RigidMass(0.02, 0.5)},
        contacts=[ao.Contact("part:a", "ball", LAW), ao.Contact("part:b", "other", LAW)],
        loads=[ao.Load("part:b", [0.0, 1e-3, 2e-3], [0.0, 20.0, 0.0])],
    )
    M, K, C = np.eye(8), np.diag([0, 0, 1e6, 9e6, 2.5e7, 8.1e7, 0, 0]), np.zeros((8, 8))
    M[:2, :2], M[:2, 2:6], M[2:6, :2] = body.m0 + body.P @ body.P.T, body.P, body.P.T
    M[6, 6], M[7, 7], K[:2, :2], C[:6, :6] = 0.05, 0.02, body.k0, L.T @ L
    push = np.zeros((8, 2))  # of the contacts on the sites, and back on the balls
    push[[0, 6], 0] = push[[1, 7], 1] = 1, -1

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        x, v = y[:8], y[8:16]
        force = LAW.stiffness * np.maximum(-(x @ push), 0.0) ** 1.5
        load = np.zeros(8)
        load[1] = np.interp(t, [0, 1e-3, 2e-3], [0, 20, 0])
        a = np.linalg.solve(M, push @ force + load - K @ x - C @ v)
        return np.concatenate((v, a, force))

    start = np.zeros(18)
    start[[14, 15]] = 1.0, 0.5
    last = solve_ivp(slope, (0, 3e-3), start, "DOP853", rtol=1e-9, atol=1e-13, max_step=1e-6).y[
        :, -1
    ]
    hit = scene.run(3e-3, tol=1e-5)
    for k, (site, ball) in enumerate((("a", "ball"), ("b", "other"))):
        assert hit[f"part:{site}", ball].impulse == pytest.approx(last[16 + k], rel=2e-5)
        assert hit.bodies["part"].displacement(site)[-1] == pytest.approx(last[k], rel=1e-4)


def test_what_does_not_take_such_damping_says_so(tmp_path):
    for call in (
        lambda: ao.export(tmp_path / "a.c", DAMPED, BALL, LAW),
        lambda: ao.export(tmp_path / "a.fmu", DAMPED),
        lambda: ao.simulate(DAMPED, BALL, LAW, END, method="newmark"),
    ):
        with pytest.raises(InputError, match="DampingMatrix"):
            call()


@pytest.mark.parametrize("speed", [0.2, 2.0])
def test_the_impulse_is_the_momentum_that_the_ball_loses(speed):
    ball = ao.RigidMass(0.1, speed)
    hit = ao.simulate(DAMPED, ball, LAW, END)
    begin, end = hit.bodies["impactor"].velocity()[[0, -1]]
    assert hit.impulse == pytest.approx(ball.mass * abs(begin - end), rel=1e-9)
    assert ao.simulate_many(DAMPED, ball, LAW, END).impulse[0] == hit.impulse


@pytest.mark.slow
def test_force_motion_and_acceleration_are_those_of_all_states(exact):
    hit = ao.simulate(DAMPED, BALL, LAW, END, tol=1e-6)
    y = exact(hit.time)
    force = LAW.stiffness * np.maximum(y[-2] - y[0], 0.0) ** 1.5
    assert np.abs(hit.force - force).max() < 2e-8 * hit.peak_force
    body = hit.bodies["structure"]
    a = np.array([rates(t, s)[SIZE] for t, s in zip(hit.time, y.T, strict=True)])
    for found, true in ((hit.displacement, y[0]), (body.velocity(), y[SIZE]),
                        (body.acceleration(), a)):  # fmt: skip
        assert np.abs(found - true).max() < 1e-6 * np.abs(true).max()
    bare = ao.simulate(BARE, BALL, LAW, END)
    assert abs(bare.impulse / hit.impulse - 1) > 5e-3


class TestDamping:
    def test_modal_damping_of_a_single_oscillator(self):
        """A rigid body on a damped spring, struck: its later motion decays as the closed form."""
        m, k, zeta = 1.0, 1e4, 0.05
        w = np.sqrt(k / m)
        body = ao.AntiOscillators(m0=m, k0=k, m=[], omega=[], damping=ao.Damping(zeta))
        hit = ao.simulate(body, ao.RigidMass(0.01, 1.0), ao.Hertz(1e9), 1.0)
        after = hit.contacts[-1][1]
        t = np.linspace(after, 1.0, 50)
        (u0, v0), u = _site(hit, after), hit.coordinates(t)[:, 0]
        s, wd = t - after, w * np.sqrt(1 - zeta**2)
        decay = np.exp(-zeta * w * s)
        exact = decay * (u0 * np.cos(wd * s) + (v0 + zeta * w * u0) / wd * np.sin(wd * s))
        assert u == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())

    def test_rayleigh_puts_dashpots_beside_the_springs(self, rng):
        """The modal decays are those of C = alpha M + beta K of the chain."""
        alpha, beta = 3.0, 1e-6
        model = random_model(rng, 3)
        damped = ao.AntiOscillators(
            model.m0, model.k0, model.m, model.omega, damping=ao.Damping(alpha=alpha, beta=beta)
        )
        K = np.diag(np.concatenate(([model.k0 + model.k.sum()], model.k)))
        K[0, 1:] = K[1:, 0] = -model.k
        M = np.diag(np.concatenate(([model.m0], model.m)))
        w = 2e3
        direct = np.linalg.inv(K - w**2 * M + 1j * w * (alpha * M + beta * K))[0, 0]
        assert damped.modal().receptance(w) == pytest.approx(direct, rel=1e-9)

    @pytest.mark.parametrize("ratio", [5, 1.0, [0.02, 3.0]])
    def test_per_cent_are_no_ratios(self, ratio):
        with pytest.raises(ao.InputError, match=r"0\.05 is 5 %"):
            ao.Damping(ratio)


def _site(hit: ao.History, t: float) -> tuple[float, float]:
    q, v = hit.states(t)
    b, n = (
        hit.assembly.bodies["structure"].modes.B[:, 0],
        hit.assembly.stacked.spans["structure"].stop,
    )
    return float(q[0, :n] @ b), float(v[0, :n] @ b)
