"""Contacts that are closed at the start: what their forces, and a scene at rest, follow from."""

from __future__ import annotations

from ctypes import addressof
from typing import Any

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.simulation.march.engine import Slopes
from antiosc.simulation.march.system import System


def through_start(s: System, by: Slopes, settled: bool) -> None:
    """From derivatives by the forces at the start, and by a state of rest, to those by the rest.

    The forces are F = law(beta q - gap - R F). With preload (`settled`) q is the equilibrium,
    omega^2 q = load - beta' F.
    """
    p = len(s.laws)
    beta, R, F = s.beta[:p], s.R[:p, :p], s.pressed
    depth = beta @ s.q - s.offsets[0, :p] - R @ F
    each = [_slopes(law, float(d)) for law, d in zip(s.laws, depth, strict=True)]
    stiffness = np.array([slope for slope, _ in each])
    held = np.linalg.solve(np.eye(p) + stiffness[:, None] * R, np.diag(stiffness))  # dF/d(beta q)
    by_force = by.pressed.copy()
    if settled:
        H = np.diag(s.omega**2) + beta.T @ held @ beta
        scale = 1 / np.sqrt(np.where(H.diagonal() > 0, H.diagonal(), 1.0))
        wanted = scale * (by.q + beta.T @ held @ by_force)
        mu = scale * np.linalg.lstsq(scale[:, None] * H * scale, wanted, rcond=None)[0]
        by.loads[0] += mu
        by.square -= mu * s.q
        by.beta[:p] -= np.outer(F, mu)
        by.q[:] = 0.0
        by_force -= beta @ mu
    push = held @ by_force
    by.beta[:p] += np.outer(push, s.q)
    by.offsets[0, :p] -= push
    by.residual[:p, :p] -= np.outer(push, F)
    by_law = np.linalg.solve(np.eye(p) + R * stiffness, by_force)
    by.laws += by_law[:, None] * np.array([slopes for _, slopes in each])
    by.pressed[:] = 0.0


def _slopes(law: Any, depth: float) -> tuple[float, Array]:
    """Derivatives of the force of a new contact at rest, by indentation and by parameters."""
    by_parameters = np.zeros(march.LAW_SLOPES)
    march.library.aom_law_slopes(addressof(law.kernel[0]), depth, march.address(by_parameters))
    return float(law.tangent(depth, 0.0, law.touch(0.0))[0]), by_parameters
