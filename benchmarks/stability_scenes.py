"""The impacts of `stability.py`: what is struck by what, and the largest stable steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import antiosc as ao
from antiosc.models.closed_form import UniformBeam

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
STRIKER = ao.RigidMass(0.24, 0.01)
HERTZ = 1.55e10


@dataclass(frozen=True)
class Scene:
    """What is struck by what, for how long."""

    name: str
    model: ao.AntiOscillators
    impactor: ao.RigidMass
    law: ao.ContactLaw
    duration: float

    def run(self, method: str, step: float | None = None, tol: float | None = None) -> ao.History:
        return ao.simulate(
            self.model,
            self.impactor,
            self.law,
            self.duration,
            method,
            step=step,
            tol=tol,
            max_contacts=300,
            max_steps=200_000,
        )


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
