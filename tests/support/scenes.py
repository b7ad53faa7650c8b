"""Models and contacts that several tests strike."""

from __future__ import annotations

from functools import cache
from math import sqrt

import numpy as np
from scipy.special import beta

import antiosc as ao
from antiosc.models.closed_form import UniformBeam
from struck_beams import pinned_pinned

HERTZ = 1.55e10
BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)


@cache
def case_two(n: int) -> tuple[ao.AntiOscillators, ao.RigidMass]:
    """The article's second case: a mass of half the beam's strikes mid-span at 0.01 m/s."""
    model = pinned_pinned(BEAM).anti_oscillators(n)
    return model, ao.RigidMass(0.5 * 2400.0 * 2e-4, 0.01)


def rigid(mass: float) -> ao.AntiOscillators:
    """A free rigid body as a structure."""
    return ao.AntiOscillators(m0=mass, k0=0.0, m=[], omega=[])


def random_model(rng: np.random.Generator, n: int, supported: bool = True) -> ao.AntiOscillators:
    """An anti-oscillator model with ordinary numbers."""
    return ao.AntiOscillators(
        m0=float(rng.uniform(0.02, 0.1)),
        k0=1e5 if supported else 0.0,
        m=rng.uniform(0.01, 0.2, n),
        omega=rng.uniform(500.0, 3e4, n),
        participation=rng.uniform(0.0, 0.2, n + 1),
    )


def hertz_impact(mass: float, speed: float, stiffness: float) -> tuple[float, float]:
    """Peak force [N] and contact time [s] of a mass on a fixed plane, F = k delta^(3/2).

    (m/2) v^2 = (2/5) k delta_m^(5/2); t = (2 delta_m/v) int_0^1 dx/sqrt(1 - x^(5/2)), and the
    integral is (2/5) B(2/5, 1/2), so that t = 2.9432... delta_m/v.
    """
    deepest = (1.25 * mass * speed**2 / stiffness) ** 0.4
    return stiffness * deepest**1.5, 2 * deepest / speed * 0.4 * float(beta(0.4, 0.5))


def thornton_restitution(ratio: float) -> float:
    """Restitution of Thornton's law for ratio = (yield speed)/(speed) < 1; J. Appl. Mech. 64."""
    r = ratio
    return sqrt(6 * sqrt(3) / 5 * (1 - r * r / 6)) * (r / (r + 2 * sqrt(1.2 - 0.2 * r * r))) ** 0.25


def finely(hit: ao.History, parts: int = 32) -> tuple[np.ndarray, np.ndarray]:
    """Times and forces so close that straight lines between them will do."""
    within = np.arange(parts) / parts
    times = (hit.time[:-1, None] + np.diff(hit.time)[:, None] * within).ravel()
    times = np.append(times, hit.time[-1])
    return times, hit.force_at(times)
