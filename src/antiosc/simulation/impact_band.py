"""Highest frequency that an impact excites, estimated without a model of the structure."""

from __future__ import annotations

import numpy as np

from antiosc.base import checks
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.models.body import Body, LinearBody, checked_body
from antiosc.models.modal import ModalBody
from antiosc.simulation.problem.two_bodies import pose

#: the band of an impact over the circular frequency pi/T of its contact time: a half-sine of length
#: T has its first zero there
BAND_OVER_PULSE = 3.0


@checks.within_range
def impact_band(impactor: LinearBody, contact: ContactLaw) -> float:
    """The highest circular frequency [rad/s] that an impact excites, about 3 pi/T.

    T is the contact time of `impactor` on a rigid wall, the shortest that a single contact with
    the structure can have. Raises InputError for an impactor at rest.
    """
    velocity = checked_body("impactor", impactor).velocity
    if not checks.number("velocity", velocity, "m/s") > 0:
        raise InputError(
            "impact_band needs an impactor with a velocity > 0; with an Obstacle or a body at rest "
            "give the band as a number."
        )
    endless = 1e6  # s
    return BAND_OVER_PULSE * np.pi / pose(RigidWall(), impactor, contact, endless).lasting


class RigidWall(Body):
    """A body that does not move."""

    def modal(self) -> ModalBody:
        return ModalBody(np.zeros(0), np.zeros(0))
