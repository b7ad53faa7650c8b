"""What is expected of contacts before they are integrated."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.assembly import largest_indentation
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
    (depth, pace, inertia), *_ = made.system.contacts[
        ["expected_depth", "expected_speed", "mass"]
    ].tolist()
    mass = 1 / (1 / 0.2 + 1 / 0.3)
    push, speed = mass * gravity, np.sqrt(1.4**2 + 2 * gravity * gap)
    assert inertia == pytest.approx(mass)
    state = law.touch(speed)
    excess = [
        law.potential(d, state) - mass * speed**2 / 2 - push * d for d in (depth / 1.1, depth)
    ]
    assert excess[0] <= 0 <= excess[1]
    assert pace == pytest.approx(speed + np.sqrt(2 * gravity * depth))
    assert made.contact_time_estimate == pytest.approx(3 * depth / pace)
