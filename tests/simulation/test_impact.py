"""Impacts against closed forms, balances and mechanics that know nothing of the integrator."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import antiosc as ao
from scenes import HERTZ, case_two, hertz_impact, random_model, rigid


def test_two_bodies_through_hertz_alone():
    m1, m2, v = 0.24, 0.5, 1.3
    mu = m1 * m2 / (m1 + m2)
    peak, time = hertz_impact(mu, v, HERTZ)
    hit = ao.simulate(rigid(m2), ao.RigidMass(m1, v), ao.Hertz(HERTZ), 3 * time, tol=1e-5)
    assert hit.peak_force == pytest.approx(peak, rel=1e-5)
    assert hit.contact_time == pytest.approx(time, rel=1e-5)
    assert hit.impulse == pytest.approx(2 * mu * v, rel=1e-6)
    assert hit.restitution == pytest.approx(1.0, abs=1e-6)
    assert hit.contacts[0][0] == 0.0
    assert hit.status == 0


def test_sphere_on_a_fixed_sphere_and_the_factor_2_9433():
    ball = ao.Sphere(0.01, 2.1e11, 0.3, 7800.0, velocity=0.5)
    law = ball.hertz(7e10, 0.33)
    peak, time = hertz_impact(ball.mass, 0.5, law.stiffness)
    deepest = (peak / law.stiffness) ** (2 / 3)
    assert time * 0.5 / deepest == pytest.approx(2.9433, abs=5e-5)
    wall = ao.AntiOscillators(m0=1e9, k0=0.0, m=[], omega=[])
    hit = ao.simulate(wall, ball, law, 2 * time, tol=1e-4)
    assert hit.peak_force == pytest.approx(peak, rel=1e-4)
    assert hit.contact_time == pytest.approx(time, rel=1e-4)
    assert hit.indentation.max() == pytest.approx(deepest, rel=1e-3)


def test_mass_on_a_spring_is_half_a_sine():
    """Linear contact on a massless spring: F = v sqrt(k m) sin(w t) with k in series."""
    k, c, m, v = 3e6, 2e6, 0.7, 0.4
    series = 1 / (1 / k + 1 / c)
    w = np.sqrt(series / m)
    spring = ao.AntiOscillators(m0=0.0, k0=k, m=[], omega=[])
    hit = ao.simulate(spring, ao.RigidMass(m, v), ao.Linear(c), 4 / w, tol=1e-6)
    inside = hit.time < 0.99 * np.pi / w
    exact = v * np.sqrt(series * m) * np.sin(w * hit.time[inside])
    assert hit.force[inside] == pytest.approx(exact, abs=1e-5 * exact.max())
    assert hit.contact_time == pytest.approx(np.pi / w, rel=1e-5)
    assert hit.displacement[inside] == pytest.approx(exact / k, abs=1e-5 * exact.max() / k)


def test_two_masses_on_a_spring_in_contact():
    """A mass on a sprung mass through a linear contact, still in contact at the end: two modes."""
    M, K, m, c, v = 0.3, 1e6, 0.2, 4e6, 0.1
    end = 3e-4
    x, V = np.linalg.eigh(
        np.array([[(K + c) / M, -c / np.sqrt(M * m)], [-c / np.sqrt(M * m), c / m]])
    )
    body = ao.AntiOscillators(m0=M, k0=K, m=[], omega=[])
    hit = ao.simulate(body, ao.RigidMass(m, v), ao.Linear(c), end, tol=1e-6)
    w = np.sqrt(x)
    q = V[1][:, None] * np.sqrt(m) * v * np.sin(w[:, None] * hit.time) / w[:, None]
    u, s = (V @ q) / np.sqrt([[M], [m]])
    assert hit.displacement == pytest.approx(u, abs=1e-6 * np.abs(u).max())
    assert hit.impactor_displacement == pytest.approx(s, abs=1e-6 * np.abs(s).max())
    assert hit.force == pytest.approx(c * (s - u), abs=1e-5 * hit.peak_force)


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_the_impulse_is_the_momentum_lost_whatever_the_masses(scale):
    """To rounding, although a damped force bends where it is cut at 0; of grains too."""
    mass, law = 0.1 * scale, ao.HuntCrossley(1e8 * scale, restitution=0.3)
    hit = ao.simulate(rigid(0.5 * scale), ao.RigidMass(mass, 1e-2), law, 0.02, tol=1e-2)
    lost = mass * (1e-2 - hit.impactor_velocity[-1])
    assert hit.impulse == pytest.approx(lost, rel=1e-12)
    assert lost > mass * 1e-2


@pytest.mark.parametrize("method", ["exact", "newmark", "conserving", "leapfrog", "DOP853"])
def test_momentum_and_energy_of_a_free_body(rng, method):
    model = random_model(rng, 5, supported=False)
    striker = ao.RigidMass(0.1, 2.0)
    hit = ao.simulate(model, striker, ao.Hertz(1.5e8), 1e-2, method=method)
    assert len(hit.contacts) >= 1
    gained = model.m_st * _rigid_velocity(hit)
    assert gained == pytest.approx(hit.impulse, rel=1e-9)
    assert 0.1 * (2.0 - hit.impactor_velocity[-1]) == pytest.approx(hit.impulse, rel=1e-9)
    assert hit.energy.drift < 1e-3
    assert np.all(hit.force >= 0)


def _rigid_velocity(hit: ao.History) -> float:
    """Velocity of the structure's rigid-body motion at its site, at the end."""
    _, v = hit.states(hit.time[-1])
    body = hit.bodies[0]
    rigid = body.omega == 0
    return float(body.b[rigid] @ v[0, : body.omega.size][rigid])


def test_case_two_against_dop853():
    for n in (9, 30):
        model, striker = case_two(n)
        law = ao.Hertz(HERTZ)
        hit = ao.simulate(model, striker, law, 8e-3)
        check = ao.simulate(model, striker, law, 8e-3, method="DOP853", tol=1e-6)
        assert hit.impulse == pytest.approx(check.impulse, rel=1e-4)
        assert hit.contact_time == pytest.approx(check.contact_time, rel=1e-3)
        assert len(hit.contacts) == len(check.contacts)
        from antiosc.simulation.history import force_difference

        l2, peak = force_difference(hit.trajectory, check.trajectory)
        assert l2 < 1e-3
        assert peak < 1e-3


def test_article_contact_time_of_case_two():
    """Article Table 3: 2.4 ms, half the first anti-oscillator's period being 2.5 ms."""
    model, striker = case_two(9)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 8e-3)
    assert hit.contact_time == pytest.approx(2.4e-3, abs=0.2e-3)
    assert hit.contact_time * model.omega[0] / np.pi == pytest.approx(2.4 / 2.5, abs=0.02)


def test_massless_contact_point_is_the_limit(rng):
    """m0 -> 0 runs into m0 = 0: what the site holds on its own vanishes."""
    m, omega = rng.uniform(0.05, 0.2, 4), np.array([2e3, 5e3, 9e3, 1.5e4])
    peaks = []
    for m0 in (1e-4, 1e-6, 1e-8, 0.0):
        model = ao.AntiOscillators(m0=m0, k0=1e5, m=m, omega=omega)
        hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), 5e-4, tol=1e-6)
        peaks.append(hit.peak_force)
    assert abs(peaks[2] / peaks[3] - 1) < abs(peaks[0] / peaks[3] - 1)
    assert peaks[2] == pytest.approx(peaks[3], rel=1e-3)


class TestObstacle:
    """The structure moves on a fixed obstacle."""

    def test_free_body_bounces_back(self):
        peak, time = hertz_impact(0.5, 3.0, HERTZ)
        hit = ao.simulate(
            rigid(0.5), ao.Obstacle(), ao.Hertz(HERTZ), 2 * time, initial_velocity=3.0, tol=1e-5
        )
        assert hit.peak_force == pytest.approx(peak, rel=1e-5)
        assert hit.velocity[0] == pytest.approx(-3.0)
        assert hit.velocity[-1] == pytest.approx(3.0, rel=1e-6)
        assert np.all(hit.impactor_displacement == 0)

    def test_gap_delays_the_touch(self):
        hit = ao.simulate(
            rigid(0.5), ao.Obstacle(gap=0.003), ao.Hertz(HERTZ), 2e-3, initial_velocity=3.0
        )
        assert hit.contacts[0][0] == pytest.approx(1e-3, rel=1e-12)

    def test_it_is_the_impactor_seen_from_itself(self, rng):
        """A structure on an obstacle = an impactor of the same model on a rigid structure."""
        model = random_model(rng, 3, supported=False)
        a = ao.simulate(model, ao.Obstacle(), ao.Hertz(1e8), 1e-2, initial_velocity=1.0, step=1e-6)
        wall = ao.ModalBody(np.zeros(0), np.zeros(0))

        class Wall:
            def modal(self):
                return wall

        b = ao.simulate(Wall(), ao.Impactor(model, 1.0), ao.Hertz(1e8), 1e-2, step=1e-6)
        assert a.peak_force == pytest.approx(b.peak_force, rel=1e-9)
        assert a.impulse == pytest.approx(b.impulse, rel=1e-9)
        assert a.displacement == pytest.approx(-b.impactor_displacement, abs=1e-12)

    def test_supported_structure_cannot_have_a_velocity(self):
        model, _ = case_two(1)
        with pytest.raises(ao.InputError, match="supported body"):
            ao.simulate(model, ao.Obstacle(), ao.Hertz(1e9), 1e-3, initial_velocity=1.0)

    def test_article_case_one(self):
        """The falling pinned-free beam, Article eq. (24)-(27): it is thrown back, k0 = 0."""
        from antiosc.closed_form import pinned_free
        from scenes import BEAM

        model = pinned_free(BEAM).anti_oscillators(20)
        hit = ao.simulate(
            model, ao.Obstacle(), ao.Hertz(HERTZ), 30e-3, initial_velocity=3.0, step=2e-6
        )
        # the article: 14.4 ms, half the first anti-oscillator's period 15.2 ms
        assert hit.contact_time == pytest.approx(14.4e-3, rel=0.1)
        assert hit.displacement[0] == 0.0
        assert hit.velocity[0] == pytest.approx(-3.0)


class TestTwoModels:
    """A second anti-oscillator structure as the striker, Article Fig. 1."""

    def test_the_two_structures_may_be_exchanged(self, rng):
        a = random_model(rng, 3, supported=False)
        b = random_model(rng, 4, supported=False)
        law = ao.Hertz(1e8)
        one = ao.simulate(a, ao.Impactor(b, 1.0), law, 5e-3, step=1e-6)
        two = ao.simulate(b, a, law, 5e-3, initial_velocity=1.0, step=1e-6)
        # the same impact seen from a frame that moves with the other body
        assert two.peak_force == pytest.approx(one.peak_force, rel=1e-9)
        assert two.impulse == pytest.approx(one.impulse, rel=1e-9)

    def test_massless_contact_points_of_both(self, rng):
        """Exchanged again, with m0 = 0 on one side and on both: compliances in series."""
        a, b = (random_model(rng, n, supported=False) for n in (3, 4))
        for light in ((a,), (b,), (a, b)):
            x, y = (ao.AntiOscillators(0.0, 0.0, m.m, m.omega) if m in light else m for m in (a, b))
            law = ao.Hertz(1e8)
            one = ao.simulate(x, ao.Impactor(y, 1.0), law, 2e-3, step=1e-6)
            two = ao.simulate(y, x, law, 2e-3, initial_velocity=1.0, step=1e-6)
            assert two.peak_force == pytest.approx(one.peak_force, rel=1e-9)
            gap = one.impactor_displacement - one.displacement
            assert one.indentation == pytest.approx(gap, abs=1e-9 * np.abs(gap).max())
            law_force = 1e8 * np.clip(one.indentation, 0, None) ** 1.5
            assert one.force == pytest.approx(law_force, abs=1e-9 * one.peak_force)

    def test_a_striker_without_oscillators_is_a_rigid_mass(self, rng):
        model = random_model(rng, 3)
        law = ao.Hertz(1e8)
        one = ao.simulate(model, ao.RigidMass(0.2, 1.0), law, 2e-3, step=1e-6)
        two = ao.simulate(model, ao.Impactor(rigid(0.2), 1.0), law, 2e-3, step=1e-6)
        assert one.force == pytest.approx(two.force)

    def test_supported_striker_may_be_touched(self, rng):
        a, b = random_model(rng, 3, supported=False), random_model(rng, 3)
        hit = ao.simulate(a, b, ao.Hertz(1e8), 5e-3, initial_velocity=1.0, gap=1e-4)
        assert hit.contacts[0][0] == pytest.approx(1e-4, rel=1e-9)
        assert hit.energy.drift < 1e-3


class TestGravity:
    def test_free_fall_onto_an_obstacle(self):
        """g < 0: the structure falls against d."""
        fall = 0.01
        hit = ao.simulate(
            ao.AntiOscillators(m0=0.5, k0=0, m=[], omega=[], participation=[0.5]),
            ao.Obstacle(gap=fall),
            ao.Hertz(HERTZ),
            0.05,
            gravity=-9.81,
        )
        assert hit.contacts[0][0] == pytest.approx(np.sqrt(2 * fall / 9.81), rel=1e-9)
        # it rises back to where it came from
        assert hit.restitution == pytest.approx(1.0, abs=1e-3)
        assert hit.energy.drift < 1e-3

    def test_falling_together_nothing_touches(self):
        body = ao.AntiOscillators(m0=0.5, k0=0, m=[], omega=[], participation=[0.5])
        hit = ao.simulate(body, ao.RigidMass(0.1), ao.Hertz(1e9), 0.1, gravity=9.81, gap=1e-3)
        assert hit.contacts == []
        assert hit.peak_force == 0.0
        assert hit.restitution is None
        assert hit.displacement[-1] == pytest.approx(0.5 * 9.81 * 0.1**2)

    def test_rest_under_gravity_carries_the_weight(self):
        """Laid down without speed: the force swings about the weight, which is its mean."""
        m, k = 0.5, 1e6
        ground = ao.AntiOscillators(m0=0.0, k0=1e9, m=[], omega=[])
        series = 1 / (1 / k + 1e-9)
        period = 2 * np.pi * np.sqrt(m / series)
        hit = ao.simulate(
            ground, ao.RigidMass(m), ao.Linear(k), 10 * period, gravity=9.81, tol=1e-4
        )
        assert hit.impulse / (10 * period) == pytest.approx(m * 9.81, rel=1e-4)
        assert hit.peak_force == pytest.approx(2 * m * 9.81, rel=1e-3)

    def test_damped_rest_comes_to_rest(self):
        m, k = 0.5, 1e6
        omega = np.sqrt(k / m)
        ground = ao.AntiOscillators(m0=m, k0=k, m=[], omega=[], damping=ao.Damping(0.3))
        hit = ao.simulate(ground, ao.RigidMass(m), ao.Linear(1e8), 60 / omega, gravity=9.81)
        assert hit.force[-1] == pytest.approx(m * 9.81, rel=0.02)

    def test_participation_is_asked_for(self):
        with pytest.raises(ao.InputError, match="participation"):
            ao.simulate(rigid(1.0), ao.RigidMass(1.0, 1.0), ao.Hertz(1e9), 1e-3, gravity=9.81)


class TestGrazingAndFlight:
    def test_a_graze_between_samples_is_found(self):
        """A vibrating site comes close to an obstacle's face once per period, by 1e-9 of its swing.

        The site starts inside the gap and swings freely: u = -a cos(w t) reaches the face at -a.
        """
        from antiosc.simulation.integrators.problem import Problem
        from antiosc.simulation.integrators.touch import next_touch

        swing, w = 1e-3, 1e3
        for excess, touches in ((1e-9, True), (-1e-9, False)):
            problem = Problem(
                omega=np.array([w, 37 * w]),
                decay=np.zeros(2),
                beta=np.array([1.0, 1.0]),
                r=0.0,
                load=np.zeros(2),
                gap=swing * (1 - excess),
                q=np.array([0.0, 0.0]),
                v=np.array([swing * w, 0.0]),
                law=ao.Hertz(1e9),
                depth=1e-6,
                speed=swing * w,
            )
            found = next_touch(problem, problem.q, problem.v, 0.0, 100 / w, 1e-6)
            if touches:
                early = np.arcsin(1 - excess) / w
                assert found == pytest.approx(early, rel=1e-6)
            else:
                assert found is None

    def test_flight_over_a_long_gap_costs_nothing(self):
        hit = ao.simulate(
            rigid(1.0), ao.RigidMass(1.0, 1e-9), ao.Hertz(1e9), 1e3, gap=5e-7, tol=1e-3
        )
        assert hit.contacts[0][0] == pytest.approx(500.0, rel=1e-9)
        assert hit.trajectory.evaluations < 10_000

    def test_grazing_speed_scales_like_hertz(self):
        """1e-9 m/s: the same pulse as at 1 m/s in Hertz's own units."""
        for v in (1e-9, 1.0):
            peak, time = hertz_impact(1.0, v, 1e9)
            wall = ao.AntiOscillators(m0=1e12, k0=0.0, m=[], omega=[])
            hit = ao.simulate(wall, ao.RigidMass(1.0, v), ao.Hertz(1e9), 2 * time, tol=1e-4)
            assert hit.peak_force == pytest.approx(peak, rel=1e-4)
            assert hit.contact_time == pytest.approx(time, rel=1e-4)

    def test_sub_impacts_are_counted_and_bounded(self):
        """A light site under a heavy mass is struck again and again."""
        model = ao.AntiOscillators(m0=1e-2, k0=1e4, m=[1.0], omega=[300.0])
        striker, law = ao.RigidMass(10.0, 1.0), ao.Hertz(1e11)
        hit = ao.simulate(model, striker, law, 0.004)
        assert len(hit.contacts) > 5
        assert hit.status == 0
        bound = len(hit.contacts) - 2
        with pytest.warns(ao.AccuracyWarning, match=f"more than {bound} contacts"):
            short = ao.simulate(model, striker, law, 0.004, step=hit.step, max_contacts=bound)
        assert short.status == 2
        assert len(short.contacts) == bound

    def test_separating_bodies_never_touch(self):
        hit = ao.simulate(rigid(1.0), ao.RigidMass(1.0, -1.0), ao.Hertz(1e9), 1.0)
        assert hit.contacts == []
        assert hit.contact_time == 0.0
        assert hit.impulse == 0.0


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

    def test_energy_balance_with_damping(self, rng):
        model = random_model(rng, 4)
        damped = ao.AntiOscillators(
            model.m0, model.k0, model.m, model.omega, damping=ao.Damping(0.02)
        )
        hit = ao.simulate(damped, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 3e-3, step=5e-7)
        assert hit.energy.dissipated[-1] > 0.01 * hit.energy.total[0]
        assert hit.energy.drift < 1e-3

    @pytest.mark.parametrize(
        ("kwargs", "says"),
        [({"ratio": -0.1}, "ratios"), ({"alpha": -1.0}, "alpha"), ({"beta": np.nan}, "beta")],
    )
    def test_bad_damping(self, kwargs, says):
        with pytest.raises(ao.InputError, match=says):
            ao.Damping(**kwargs)


def _site(hit: ao.History, t: float) -> tuple[float, float]:
    q, v = hit.states(t)
    b, n = hit.bodies[0].b, hit.bodies[0].omega.size
    return float(q[0, :n] @ b), float(v[0, :n] @ b)


class TestErrorControl:
    @pytest.mark.parametrize("tol", [1e-2, 1e-3, 1e-4])
    def test_tolerance_is_kept(self, tol):
        model, striker = case_two(9)
        law = ao.Hertz(HERTZ)
        truth = ao.simulate(model, striker, law, 4e-3, step=5e-8)
        hit = ao.simulate(model, striker, law, 4e-3, tol=tol)
        from antiosc.simulation.history import force_difference

        l2, peak = force_difference(hit.trajectory, truth.trajectory)
        assert max(l2, peak) <= tol
        assert hit.error["force"] <= tol
        assert l2 <= 2 * hit.error["force"]

    def test_unreached_tolerance_is_said(self):
        model, striker = case_two(9)
        with pytest.warns(ao.AccuracyWarning, match=r"not tol = 1e-08"):
            hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 4e-3, tol=1e-8, max_steps=5000)
        assert hit.status == 1
        assert hit.error["force"] > 1e-8

    def test_divergence_is_said(self):
        model, striker = case_two(9)
        top = model.modal().omega.max()
        law = ao.Linear(1e3)
        with pytest.warns(ao.AccuracyWarning, match="(?i)leapfrog diverged"):
            hit = ao.simulate(model, striker, law, 8e-3, method="leapfrog", step=2.5 / top)
        assert hit.status == 2
        fine = ao.simulate(model, striker, law, 8e-3, method="leapfrog", step=1.9 / top)
        assert fine.status == 3  # it ends during contact
        assert np.all(np.isfinite(hit.force))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"duration": 0.0}, "duration must be > 0"),
        ({"duration": np.nan}, "duration must be finite"),
        ({"tol": -1e-3}, "tol must be > 0"),
        ({"tol": 1.0}, "0 < tol < 1"),
        ({"step": 0.0}, "step must be > 0"),
        ({"step": 1.0}, "step must be <= the duration 0.001 s; got 1 s"),
        ({"method": "euler"}, "method must be 'exact', 'newmark'"),
        ({"gap": -1.0}, "gap must be >= 0"),
        ({"contact": 3.0}, "contact must be a ContactLaw"),
        ({"model": 3.0}, r"model must have a modal\(\) method"),
        ({"impactor": "ball"}, r"impactor must have a modal\(\) method"),
        ({"gravity": np.inf}, "gravity must be finite"),
        ({"max_contacts": 0}, "max_contacts must be a whole number"),
    ],
)
def test_bad_scene(change, says):
    good = {
        "model": rigid(1.0),
        "impactor": ao.RigidMass(1.0, 1.0),
        "contact": ao.Hertz(1e9),
        "duration": 1e-3,
    }
    with pytest.raises(ao.InputError, match=says):
        ao.simulate(**{**good, **change})


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ao.RigidMass(0.0, 1.0), "mass must be > 0"),
        (lambda: ao.RigidMass(-1.0, 1.0), "mass must be > 0"),
        (lambda: ao.RigidMass(1.0, np.nan), "velocity must be finite"),
        (lambda: ao.Sphere(0.0, 1.0, 0.3, 1.0), "radius must be > 0"),
        (lambda: ao.Sphere(1.0, 1.0, 0.5, 1.0), "nu must lie in"),
        (lambda: ao.Sphere(1.0, 1.0, 0.3, -1.0), "rho must be > 0"),
        (lambda: ao.Obstacle(gap=-1.0), "gap must be >= 0"),
        (lambda: ao.Obstacle(velocity=1.0), "an obstacle is fixed"),
        (lambda: ao.Impactor(3.0), r"body must have a modal\(\) method"),
        (lambda: ao.ModalBody([-1.0], [1.0]), "omega must be >= 0"),
        (lambda: ao.ModalBody([1.0], [1.0, 2.0]), "b must have shape"),
        (lambda: ao.ModalBody([1.0], [1.0], decay=[-1.0]), "decay must be >= 0"),
    ],
)
def test_bad_body(make, says):
    with pytest.raises(ao.InputError, match=says):
        make()


def test_runs_without_the_finite_element_packages_and_loads_little():
    script = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"dolfinx", "gmsh", "petsc4py", "slepc4py", "mpi4py", "ufl",
                                  "basix", "ffcx", "matplotlib", "meshio"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocked())
import antiosc as ao
model = ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.2], omega=[1e3])
hit = ao.simulate(model, ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 5e-3)
assert hit.peak_force > 0
late = {"scipy.optimize", "scipy.integrate", "scipy.interpolate", "scipy.spatial"}
assert not late & sys.modules.keys(), late & sys.modules.keys()
try:
    ao.read_mesh
except ao.MissingDependencyError as error:
    print("says:", error)
else:
    raise SystemExit("no error")
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "dolfinx" in done.stdout


def test_public_names_exist():
    for name, module in ao._MODULES.items():
        if not module.startswith(("antiosc.fem", "antiosc.maps")):
            assert hasattr(ao, name), name
    assert sorted(ao.__all__) == sorted(set(ao.__all__))
    assert set(ao.__all__) <= set(dir(ao))
    with pytest.raises(AttributeError, match="no_such"):
        _ = ao.no_such


def test_a_run_over_which_no_phase_is_left_is_refused():
    model = ao.AntiOscillators(m0=1e20, k0=0.0, m=[1e-40], omega=[1e40])
    ball, law = ao.RigidMass(1e60, -1e60), ao.Hertz(1e-20)
    with pytest.raises(ao.AccuracyError, match=r"the fastest motion, 1e\+40 rad"):
        ao.simulate(model, ball, law, 1e60)
    with pytest.raises(ao.AccuracyError, match="rounding destroys the phase"):
        ao.simulate_many(model, ball, law, 1e60)


def test_bodies_without_any_mass_are_refused():
    spring = ao.AntiOscillators(m0=0.0, k0=1e6, m=[], omega=[])
    for run in (ao.simulate, ao.simulate_many):
        with pytest.raises(ao.InputError, match="nothing can move"):
            run(spring, ao.Obstacle(), ao.Linear(1e6), 1e-3)
