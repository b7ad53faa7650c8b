"""The impacts of `stability.py`: what is struck by what, and the hard cases."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np

import antiosc as ao
from antiosc.models.closed_form import UniformBeam

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
STRIKER = ao.RigidMass(0.24, 0.01)
HERTZ = 1.55e10


@dataclass(frozen=True)
class Scene:
    """What is struck by what, for how long; `unit` is the time that steps are counted in."""

    name: str
    model: ao.AntiOscillators
    impactor: ao.RigidMass
    law: ao.ContactLaw
    duration: float
    unit: float
    gravity: float = 0.0

    def run(
        self,
        method: str,
        step: float | None = None,
        tol: float | None = None,
        max_steps: int = 200_000,
    ) -> ao.History:
        return ao.simulate(
            self.model,
            self.impactor,
            self.law,
            self.duration,
            method,
            step=step,
            tol=tol,
            gravity=self.gravity,
            max_contacts=300,
            max_steps=max_steps,
        )


def hard_scenes(model: ao.AntiOscillators) -> list[Scene]:
    """The cases that are known to be hard."""
    m = model.m.copy()
    m[-1] += model.m0  # the residual mass moves to the last anti-oscillator
    share = np.array(model.m)
    share[0] *= 1e-12

    def light(m0: float) -> ao.AntiOscillators:
        return ao.AntiOscillators(m0, model.k0, m, model.omega)

    base = ao.Hertz(HERTZ)
    cases = [
        ("as in the article", model, STRIKER, base),
        ("k_H × 10³", model, STRIKER, ao.Hertz(1e3 * HERTZ)),
        ("k_H × 10⁶", model, STRIKER, ao.Hertz(1e6 * HERTZ)),
        ("m0 × 10⁻³", light(1e-3 * model.m0), STRIKER, base),
        ("m0 × 10⁻⁶", light(1e-6 * model.m0), STRIKER, base),
        ("m0 × 10⁻⁹", light(1e-9 * model.m0), STRIKER, base),
        ("m0 = 0", light(0.0), STRIKER, base),
        *(
            (f"mass ratio 10{power}", model, replace(STRIKER, mass=ratio * model.m_st), base)
            for power, ratio in {"⁻⁶": 1e-6, "⁻³": 1e-3, "³": 1e3, "⁶": 1e6}.items()
        ),
        ("10⁻⁹ m/s", model, replace(STRIKER, velocity=1e-9), base),
        ("massless AO", ao.AntiOscillators(model.m0, model.k0, share, model.omega), STRIKER, base),
    ]
    scenes = []
    for name, body, striker, law in cases:
        first = _first_contact(body, striker, law)
        scenes.append(Scene(name, body, striker, law, 3 * first, first))
    rest = replace(STRIKER, velocity=0.0)
    period = 2 * np.pi / model.modal().omega[0]
    scenes.append(Scene("rest under gravity", model, rest, base, period, period / 30, 9.81))
    return scenes


def _first_contact(model: ao.AntiOscillators, striker: ao.RigidMass, law: ao.ContactLaw) -> float:
    """Length of the first contact, or of what is looked at of a long one [s]."""
    longest = 1e-3 if striker.velocity > 1e-6 else 1e-1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AccuracyWarning)
        hit = ao.simulate(model, striker, law, longest, tol=0.03, max_contacts=2)
    start, end = hit.contacts[0]
    return end - start


def stable_steps(model: ao.AntiOscillators) -> tuple[float, float]:
    """Largest stable steps of central differences, without and with the contact's stiffness.

    The contact is linearised at the indentation of a mass m_st on a fixed plane.
    """
    body = model.modal()
    mass = 1 / (1 / STRIKER.mass + 1 / model.m_st)
    deepest = (1.25 * mass * STRIKER.velocity**2 / HERTZ) ** 0.4
    k = 1.5 * HERTZ * np.sqrt(deepest)
    b = np.append(body.b, 1 / np.sqrt(STRIKER.mass))
    K = np.diag(np.append(body.omega**2, 0.0)) + k * np.outer(b, b)
    return 2 / body.omega.max(), 2 / np.sqrt(np.linalg.eigvalsh(K)[-1])
