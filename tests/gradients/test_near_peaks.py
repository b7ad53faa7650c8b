"""A gradient beside a second peak nearly as large says how far it reaches."""

from __future__ import annotations

import pytest

import antiosc as ao


def bounces(restitution):
    """A ball that gravity presses to a wall: each rebound is weaker by its losses alone."""
    law = ao.Gonthier(1e6, restitution, exponent=1.0)
    bodies = {"wall": ao.Obstacle(), "ball": ao.RigidMass(0.2, 1.0)}
    return ao.Scene(bodies, [ao.Contact("wall", "ball", law)], gravity=2000.0).run(5e-3, tol=1e-8)


@pytest.mark.parametrize("loss", [1e-3, 1e-4])
def test_peaks_of_rebounds_are_equal_where_nothing_is_lost(loss):
    gradient = ao.gradient(bounces(1 - loss), "peak_force")
    assert gradient.reach is not None
    # to first order in the loss
    assert gradient.reach.restitution == pytest.approx(loss, rel=10 * loss)
    assert gradient.reach.value < gradient.value
    assert f"of {gradient.reach.value:.6g} becomes the largest" in repr(gradient)


def test_far_peaks_and_other_goals_have_no_reach():
    hit = bounces(0.7)
    assert ao.gradient(hit, "peak_force").reach is None
    assert ao.gradient(bounces(0.999), "impulse").reach is None
