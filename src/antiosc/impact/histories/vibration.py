"""Energy of the vibration of each body: the energy left in its modes after a contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import ReprMixin
from antiosc.impact.histories import History


@dataclass(frozen=True, eq=False, repr=False)
class BodyEnergy(ReprMixin):
    """Energies [J] of one body, at the times (n,) of the history.

    Attributes
    ----------
    time : s.
    rigid : kinetic energy of the rigid-body motion.
    kinetic : kinetic energy of the vibration.
    strain : strain energy of the vibration and of the residual compliance.
    """

    time: Array
    rigid: Array
    kinetic: Array
    strain: Array

    @property
    def vibration(self) -> Array:
        """Energy (n,) of the vibration: the energy left in the elastic modes after the contact."""
        return self.kinetic + self.strain

    @property
    def total(self) -> Array:
        """Total energy (n,) of the body."""
        return self.rigid + self.vibration


def body_energy(history: History, body: str) -> BodyEnergy:
    """Energies of the body with this name; for `simulate`: "structure" or "impactor".

    Raises
    ------
    InputError
        An unknown name.
    """
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    motion = history.bodies[history.name_of(body)]
    omega = motion.placed.omega
    v = motion.v
    is_rigid = omega == 0

    return BodyEnergy(
        time=history.time,
        rigid=0.5 * np.sum(v[:, is_rigid] ** 2, axis=1),
        kinetic=0.5 * np.sum(v[:, ~is_rigid] ** 2, axis=1),
        strain=motion.strain,
    )


def vibration_share(history: History) -> float:
    """Share of the initial kinetic energy that remains as vibration of all bodies.

    If the contact is lossless, the rebound of a sphere from a plate lacks this energy (C. Zener,
    Phys. Rev. 59 (1941) 669-673).

    Raises
    ------
    InputError
        Bodies at rest at the start.
    """
    checks.instance("history", history, History, "a History, which simulate and Scene.run return")
    energies = [body_energy(history, name) for name in history.bodies]
    start = sum(float(e.rigid[0] + e.kinetic[0]) for e in energies)
    if start == 0:
        raise InputError("all bodies are at rest at the start: there is no share of their energy.")
    return sum(float(e.vibration[-1]) for e in energies) / start
