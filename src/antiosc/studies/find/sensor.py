"""`Sensor`: what is measured at a point of a structure, and the same of its free modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import Given
from antiosc.fem.fields import source
from antiosc.fem.recovery import place
from antiosc.fem.site import Reach, point_of
from antiosc.fem.structure.structure import Structure

#: Quantities of sensors: the time derivative of the displacement that each is made of.
DERIVATIVE = {"displacement": 0, "velocity": 1, "acceleration": 2, "strain": 0}
#: Points of a strain gauge along its length (Gauss–Legendre).
GAUGE_POINTS = 6


@dataclass(frozen=True)
class Sensor(Given):
    """A sensor on a structure: an accelerometer, a vibrometer, a strain gauge.

    Parameters
    ----------
    point : sequence of 3 (2) floats, or str
        Coordinates [m], or the name of a group, as of `probe`.
    direction : sequence of 3 (2) floats
        Along which it measures; of strains the direction of the gauge.
    quantity : "acceleration" m/s², "velocity" m/s, "displacement" m or "strain"
    length : float, optional
        Of a strain gauge [m], over which it takes the mean; default: the strain at the point.
    surface : "top", "bottom", "middle" or sequence of 3 floats
        Of a shell: the surface with the gauge, as of `probe`.
    part : str, optional
        Of an assembly: the part on which it sits.
    """

    point: Sequence[float] | str
    direction: Sequence[float]
    quantity: str = "acceleration"
    length: float | None = None
    surface: str | Sequence[float] = "top"
    part: str | None = None

    def __post_init__(self) -> None:
        checks.choice("quantity", self.quantity, tuple(DERIVATIVE))
        if isinstance(self.point, str):
            checks.text("point", self.point)
        else:
            checks.store(self, point=checks.coordinates("point", self.point))
        direction = checks.coordinates("direction", self.direction, "")
        if not np.linalg.norm(direction):
            raise InputError("direction must not be the zero vector: the sensor measures along it.")
        checks.store(self, direction=direction)
        if self.length is not None:
            checks.store(self, length=checks.positive("length", self.length, "m"))
            if self.quantity != "strain":
                raise InputError(f"a length is that of a strain gauge, not of {self.quantity}.")
        place(self.surface, None, (0.0, 0.0), "global")
        if self.part is not None:
            checks.text("part", self.part)

    @property
    def derivative(self) -> int:
        """Time derivative of the displacement of which its signal is made."""
        return DERIVATIVE[self.quantity]


def of_shapes(sensor: Sensor, structure: Structure, shapes: Array) -> Array:
    """The displacement along a sensor, or its strain, (J,) in shapes (rows of this rank, J)."""
    d = np.pad(sensor.direction, (0, 3 - len(sensor.direction)))
    d = d / np.linalg.norm(d)
    x, part, end = point_of(structure, sensor.point, sensor.part)
    if end is not None:
        raise InputError(f"{sensor.point!r} has no mesh: a sensor sits on the mesh of a part.")
    fields, reach = source(structure), Reach("the point of the sensor")
    if sensor.quantity != "strain":
        columns = fields.at_point(structure, shapes, x, part, reach)
        return np.asarray(d[: len(columns)] @ columns)
    nodes, weights = np.zeros(1), np.full(1, 2.0)
    if sensor.length is not None:
        nodes, weights = np.polynomial.legendre.leggauss(GAUGE_POINTS)
    points = x + np.outer(nodes, d) * (sensor.length or 0.0) / 2
    there = place(sensor.surface, None, (0.0, 0.0), "global")
    strain = fields.recovered(structure, shapes, points, part, "strain", there, reach)
    return np.asarray(np.einsum("p,i,pijk,j->k", weights / 2, d, strain, d, optimize=True))
