"""What is expected of contacts before they are integrated."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.assembly import assemble_scene, largest_indentation, stiffness_at
from antiosc.impact.two_bodies import Impact, assemble_pair
from laws import laws

DEPTHS = (1e-7, 3e-6, 4e-5)


@laws
@pytest.mark.parametrize("push", [0.0, 30.0])
@pytest.mark.parametrize("close", [0.1, 1e-6])
def test_the_deepest_indentation_takes_up_energy_and_work(
    law: ao.ContactLaw, push: float, close: float
) -> None:
    """At most so far above: the potential of the contact, less the work of the push."""
    state = law.touch(1.0)
    for wanted in DEPTHS:
        energy = law.potential(wanted, state) - push * wanted
        if energy < 0.0:
            continue
        found = largest_indentation(law, 1.0, energy, push, 1e-3, close)
        assert wanted * (1 - 1e-9) <= found <= wanted * (1 + 1.01 * close)
        assert largest_indentation(law, 1.0, energy, push, wanted / 2, close) == wanted / 2


@pytest.mark.parametrize("law", [ao.Hertz(1e9), ao.Linear(3e6), ao.Thornton(1e9, 1e-6)])
@pytest.mark.parametrize(("gravity", "gap"), [(0.0, 1e-3), (9.81, 0.0), (500.0, 2e-3)])
def test_an_impact_is_expected_to_be_that_of_two_masses(
    law: ao.ContactLaw, gravity: float, gap: float
) -> None:
    """Free bodies 0.2 and 0.3 kg that close at 1.4 m/s; gravity speeds the gap up on one."""
    held = ao.AntiOscillators(m0=0.2, k0=0.0, m=[], omega=[], participation=[0.0])
    pair = held, ao.RigidMass(0.3, 1.5)
    made = assemble_pair(Impact(*pair, law, 0.02, -0.1, gravity, gap))
    (depth,), (pace,) = made.system.depth, made.system.speed
    mass = 1 / (1 / 0.2 + 1 / 0.3)
    push, speed = mass * gravity, np.sqrt(1.4**2 + 2 * gravity * gap)
    assert made.system.mass == pytest.approx(mass)
    state = law.touch(speed)
    excess = [
        law.potential(d, state) - mass * speed**2 / 2 - push * d for d in (depth / 1.1, depth)
    ]
    assert excess[0] <= 0 <= excess[1]
    assert pace == pytest.approx(speed + np.sqrt(2 * gravity * depth))
    assert made.contact_time_estimate == pytest.approx(3 * depth / pace)


def test_a_scene_expects_each_contact_by_its_speed_and_what_pushes_it() -> None:
    """One mass flies, one falls, one is at rest until the others move it."""
    bodies = {
        "flies": ao.RigidMass(0.3, 2.0),
        "falls": ao.RigidMass(0.5),
        "rests": ao.SiteModes([700.0], [[1.2]], ["tip"]),
        "floor": ao.Obstacle(),
    }
    law = ao.Linear(1e6)
    contacts = [
        ao.Contact("floor", "flies", law),
        ao.Contact("floor", "falls", law, gap=0.02),
        ao.Contact("floor", "rests:tip", law),
    ]
    push = ao.Load("falls", [0.0], [50.0])
    made = assemble_scene(ao.Scene(bodies, contacts, loads=[push]), 0.1)
    fall = np.sqrt(2 * 100.0 * 0.02)
    np.testing.assert_allclose(made.system.speed, [2.0, fall, 2.0], rtol=1e-9)
    np.testing.assert_allclose(made.system.mass, [0.3, 0.5, 1 / 1.44], rtol=1e-9)
    # (k/2) d^2 = (m/2) v^2 + F d
    first = np.sqrt(0.3 * 4 / 1e6)
    second = 50 / 1e6 + np.sqrt((50 / 1e6) ** 2 + 0.5 * fall**2 / 1e6)
    third = np.sqrt(4 / 1.44 / 1e6)
    depth = made.system.depth / np.array([first, second, third])
    assert np.all((depth >= 1 - 1e-9) & (depth <= 1.1))
    pace = made.system.speed + np.sqrt(2 * np.array([0, 100.0, 0]) * made.system.depth)
    assert made.contact_time_estimate == pytest.approx(np.min(3 * made.system.depth / pace))
    nothing = ao.Scene({"m": ao.RigidMass(1.0), "w": bodies["floor"]}, [ao.Contact("w", "m", law)])
    assert assemble_scene(nothing, 0.32).contact_time_estimate == 0.02


@laws
def test_the_stiffness_of_a_contact_is_that_of_the_steeper_branch(law: ao.ContactLaw) -> None:
    for depth in DEPTHS:
        state, h = law.touch(1.0), 1e-5 * depth
        after = law.advance(depth, 0.0, state)
        rise = (law.force(depth + h, 0, state) - law.force(depth - h, 0, state)) / (2 * h)
        fall = (law.force(depth - h, 0, after) - law.force(depth - 3 * h, 0, after)) / (2 * h)
        assert stiffness_at(law, depth, state) == pytest.approx(max(rise, fall), rel=2e-3)
