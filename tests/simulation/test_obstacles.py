"""Impacts on obstacles, under gravity, and with flights between contacts."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import library
from antiosc.engine.march import run
from antiosc.impact.assembly import assemble_scene
from scenes import HERTZ, hertz_impact, random_model, rigid


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

    def test_article_case_one(self):
        """The falling pinned-free beam, Article eq. (24)-(27): it is thrown back, k0 = 0."""
        from scenes import BEAM
        from struck_beams import pinned_free

        model = pinned_free(BEAM).anti_oscillators(20)
        hit = ao.simulate(
            model, ao.Obstacle(), ao.Hertz(HERTZ), 30e-3, initial_velocity=3.0, step=2e-6
        )
        # the article: 14.4 ms, half the first anti-oscillator's period 15.2 ms
        assert hit.contact_time == pytest.approx(14.4e-3, rel=0.1)
        assert hit.displacement[0] == 0.0
        assert hit.velocity[0] == pytest.approx(-3.0)


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


class TestGrazingAndFlight:
    def test_a_graze_between_samples_is_found(self):
        """A vibrating site comes close to an obstacle's face once per period, by 1e-9 of its swing.

        The site starts inside the gap and swings freely: u = -a cos(w t) reaches the face at -a.
        """
        swing, w = 1e-3, 1e3
        for excess, touches in ((1e-9, True), (-1e-9, False)):
            site = ao.SiteModes([w, 37 * w], [[1.0], [1.0]], ["tip"])
            contact = ao.Contact("wall", "body", ao.Hertz(1e9), gap=swing * (1 - excess))
            made = assemble_scene(
                ao.Scene({"wall": ao.Obstacle(), "body": site}, [contact]), 100 / w
            )
            made.system.v[:] = np.array([swing * w, 0.0])
            found = run(made.system, 100 / w, 1.0, fine=1e-6, max_contacts=0)
            assert (found.answer == library.TOO_MANY_CONTACTS) == touches
            if touches:
                assert found.time[-1] == pytest.approx(np.arcsin(1 - excess) / w, rel=1e-6)

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
