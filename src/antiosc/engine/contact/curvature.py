"""`Curvature`: the curvature of a surface at a point, for contact laws."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from antiosc.base._types import Array
from antiosc.base.texts import ReprMixin

#: Kinds of places on a surface.
PLANE = "plane"
LINE = "line"
CURVED = "curved"
EDGE = "edge"
CORNER = "corner"
#: Kinds without a curvature, whose radius must be given.
SHARP_KINDS = EDGE, CORNER


@dataclass(frozen=True, eq=False, repr=False)
class Curvature(ReprMixin):
    """Principal curvatures of a surface at a point."""

    #: "plane"; "line", curved in one direction (a cylinder or a groove); "curved", in both; "edge"
    #: or "corner", which have no curvature: their radius must be given
    kind: str
    #: (2,) principal curvatures [1/m], ascending; > 0 where the surface is convex, exactly 0 along
    #: planes and lines, NaN of edges and corners
    values: Array
    error: float  # bound on the error of each value [1/m]
    directions: Array  # (2, 3) unit vectors of the principal directions, in the order of `values`
    #: point, normal: (3,) the point on the surface [m], and the outward unit normal there
    point: Array
    normal: Array

    @property
    def radii(self) -> tuple[float, float]:
        """Principal radii [m] in the order of `values`: inf if flat, < 0 concave, NaN sharp."""
        first, second = (1 / float(k) if k else inf for k in self.values)
        return first, second

    def beyond(self, distance: float) -> Curvature:
        """Curvature of the parallel surface at a distance [m] outward, such as a shell's face."""
        stretch = 1 + self.values * distance
        change = 1 / float(np.min(np.abs(stretch))) ** 2 if np.isfinite(stretch).all() else 1.0
        values = self.values / stretch
        point = self.point + distance * self.normal
        return replace(self, values=values, error=self.error * change, point=point)

    def placed(self, rotation: Array, translation: Array) -> Curvature:
        """The same surface after a rotation (3, 3) and a translation (3,) [m]."""
        return replace(
            self,
            directions=self.directions @ rotation.T,
            point=rotation @ self.point + translation,
            normal=rotation @ self.normal,
        )
