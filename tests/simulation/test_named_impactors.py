"""Impactors by name, and the laws of their tips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import antiosc as ao


def test_a_steel_tip_has_the_law_of_its_sphere():
    hammer = ao.named_impactor("IK08")
    same = ao.Hertz.from_radii(0.025, 210e9, 0.3, np.inf, 70e9, 0.33)
    assert hammer.hertz(70e9, 0.33) == same
    with pytest.raises(ao.InputError, match="needs its tip"):
        ao.named_impactor("IK02").hertz(70e9, 0.33)
    with pytest.raises(ao.InputError, match="needs its tip"):
        ao.RigidMass(0.1, 1.0).hertz(70e9, 0.33)
    tipped = ao.RigidMass(0.3, 2.0, tip_radius=0.01, E=200e9, nu=0.3)
    sphere = ao.Sphere(0.01, 200e9, 0.3, mass=0.3, velocity=2.0)
    assert sphere.mass == pytest.approx(0.3, rel=1e-14)
    assert tipped.hertz(70e9, 0.3) == sphere.hertz(70e9, 0.3)
    advice = [ao.advise((0.3, 0.2, 0.01), one, E=70e9, nu=0.3, rho=2700.0) for one in
              (tipped, sphere)]  # fmt: skip
    assert advice[0].family == advice[1].family


def test_balls_have_size_and_speed():
    ball = ao.named_impactor("steel ball", 3.0, diameter=0.05)
    assert ball.mass == pytest.approx(7850 * np.pi * 0.05**3 / 6, rel=1e-12)
    ice = ao.named_impactor("ice ball", 30.0, diameter=0.0427)
    assert ice.mass == pytest.approx(917 * np.pi * 0.0427**3 / 6, rel=1e-12)
    assert ao.named_impactor("golf ball", 60.0).mass == 0.04593
    for arguments, message in (
        ({"name": "steel ball", "velocity": 1.0}, "give diameter"),
        ({"name": "golf ball"}, "give velocity"),
        ({"name": "IK07", "diameter": 0.1}, "diameter is for"),
        ({"name": "anvil"}, "'anvil'"),
    ):
        with pytest.raises(ao.InputError, match=message):
            ao.named_impactor(**arguments)


def test_a_tennis_ball_passes_the_tests_of_its_rules():
    """Rebound of 135 to 147 cm from 254 cm on a rigid surface; 0.56 to 0.74 cm at 8.165 kg."""
    known = ao.IMPACTORS["tennis ball"]
    ball = ao.named_impactor("tennis ball", np.sqrt(2 * 9.80665 * 2.54))
    law = known.law()
    run = ao.Scene({"ball": ball, "floor": ao.Obstacle()}, [ao.Contact("floor", "ball", law)]).run(
        8e-3
    )
    parted = abs(run.bodies["ball"].velocity()[-1])
    assert 1.35 < parted**2 / (2 * 9.80665) < 1.47
    squeezed = 2 * 8.165 * 9.80665 / law.stiffness
    assert 0.0056 < squeezed < 0.0074
    assert 0.0654 < 2 * ball.tip_radius < 0.0686
    for other in {*ao.IMPACTORS} - {"tennis ball"}:
        with pytest.raises(ao.InputError, match=f"{other} has no stiffness"):
            ao.IMPACTORS[other].law()
    assert "polyamide" in ao.IMPACTORS["IK02"].note


def test_a_sphere_takes_mass_or_density_and_is_replaced():
    one = ao.Sphere(0.01, 210e9, 0.3, 7850.0, 2.0)
    assert replace(one, velocity=3.0) == ao.Sphere(0.01, 210e9, 0.3, 7850.0, 3.0)
    assert repr(one) == "Sphere(radius=0.01, E=2.1e+11, nu=0.3, rho=7850, velocity=2)"
    for arguments in ({}, {"rho": 7850.0, "mass": 0.1}):
        with pytest.raises(ao.InputError, match="rho or mass"):
            ao.Sphere(0.01, 210e9, 0.3, **arguments)
