"""Light contacts, alone and beside heavy ones: errors are weighed by each contact's own forces.

An oscillator grazes a stop so soft that its motion does not change: the force is that of the sine.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

import antiosc as ao

OMEGA, AMPLITUDE, SOFT = 1000.0, 1e-4, 1e4


def oscillator() -> tuple[ao.SiteModes, ao.ModalState]:
    """One of 1 kg that starts at rest's place toward its stop."""
    body = ao.SiteModes([OMEGA], [[-1.0]], ["tip"])
    return body, ao.ModalState([0.0], [OMEGA * AMPLITUDE])


def pulse(share: float) -> tuple[float, float]:
    """Impulse and peak on a stop at a share of the amplitude."""
    first = np.arcsin(share)

    def force(phase: float) -> float:
        return float(SOFT * (AMPLITUDE * max(np.sin(phase) - share, 0.0)) ** 1.5)

    return quad(force, first, np.pi - first, epsabs=0, epsrel=1e-10)[0] / OMEGA, force(np.pi / 2)


@pytest.mark.parametrize("share", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("tol", [1e-3, 1e-5])
def test_a_graze_has_its_impulse(share: float, tol: float) -> None:
    """A step that ends at a release is as short as its error permits."""
    body, start = oscillator()
    contact = ao.Contact("body", "stop", ao.Hertz(SOFT), gap=share * AMPLITUDE)
    bodies = {"body": body, "stop": ao.Obstacle()}
    hit = ao.Scene(bodies, [contact], motion={"body": start}).run(4.0 / OMEGA, tol=tol)
    impulse, peak = pulse(share)
    assert hit["body", "stop"].impulse == pytest.approx(impulse, rel=tol)
    assert hit["body", "stop"].peak_force == pytest.approx(peak, rel=tol)


@pytest.mark.parametrize("tol", [1e-3, 1e-5])
def test_a_light_contact_is_as_accurate_beside_a_heavy_one(tol: float) -> None:
    """The bodies do not know each other; the forces differ by 300."""
    body, start = oscillator()
    bodies = {"body": body, "stop": ao.Obstacle(), "mass": ao.RigidMass(1e-3, 0.04)}
    bodies |= {"wall": ao.Obstacle()}
    light = ao.Contact("body", "stop", ao.Hertz(SOFT), gap=0.9 * AMPLITUDE)
    heavy = ao.Contact("wall", "mass", ao.Hertz(1e6), gap=0.0)
    hit = ao.Scene(bodies, [light, heavy], motion={"body": start}).run(4.0 / OMEGA, tol=tol)
    impulse, peak = pulse(0.9)
    assert 1e-3 < peak / hit["wall", "mass"].peak_force < 0.01
    assert hit["body", "stop"].impulse == pytest.approx(impulse, rel=tol)
    assert hit["body", "stop"].peak_force == pytest.approx(peak, rel=tol)
