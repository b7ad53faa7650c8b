"""The energies of bodies and contact along a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array
from antiosc.base.brief import Brief


@dataclass(frozen=True, eq=False, repr=False)
class Energy(Brief):
    """Energies [J] at the nodes of a history, each (n,), and how well they balance.

    Attributes
    ----------
    kinetic, strain : of both bodies.
    contact : recoverable energy of the contact.
    dissipated : energy lost in the contact law and in the damping of the bodies up to this time.
    gravity : work of gravity up to this time.
    drift : largest |kinetic + strain + contact + dissipated - gravity - start|, relative to the
        largest sum of kinetic, strain and contact energy.
    """

    kinetic: Array
    strain: Array
    contact: Array
    dissipated: Array
    gravity: Array

    @property
    def total(self) -> Array:
        """The energy balance, constant in exact arithmetic."""
        return self.kinetic + self.strain + self.contact + self.dissipated - self.gravity

    @property
    def drift(self) -> float:
        total = self.total
        scale = float(np.max(self.kinetic + self.strain + self.contact))
        return float(np.max(np.abs(total - total[0]))) / scale if scale > 0 else 0.0
