"""Landings on an edge or a face: the range of the force within a small angle of the start.

The bar of such a force is that of one orientation, whose corners touch at once or one after the
other. No part lands so exactly: an aluminium block of 60 x 40 x 20 mm that falls flat from 0.5 m on
concrete has 22 kN, and 11, 6.5 and 1.9 kN if it is inclined by 0.6, 1.2 and 2.2 degrees.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import cos, radians, tan

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from antiosc.base._types import Array
from antiosc.base.errors import without_warnings
from antiosc.base.progress import counting
from antiosc_studies.drops.drop import onto
from antiosc_studies.drops.fall import Fall, fall_of
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.trajectory import initial_state

#: Angle of the start [rad] within which a force is sought.
ANGLE = radians(1.0)
#: Least distance of another point that lands, over the size of the part.
APART = 0.1


def is_flat(fall: Fall, angle: float = ANGLE) -> bool:
    """Whether another place, far from the first one, touches first if the part turns by `angle`."""
    x = fall.body.points @ fall.start.R.T
    x = x - x[np.argmin(x[:, 2])]
    distance = np.linalg.norm(x[:, :2], axis=1)
    far = distance > APART * np.ptp(x, axis=0).max()
    return bool((x[far, 2] < tan(angle) * distance[far]).any())


@lru_cache(maxsize=2)
def range_over_tilt(fall: Fall, angle: float = ANGLE) -> tuple[float, float]:
    """Least and largest force [N] of the first impact, of this start, of starts that are turned by
    `angle` [rad] about two horizontal axes, and with a face within `angle` turned flat.
    """
    turns = [rotation_matrices(angle * axis) for axis in np.vstack((np.eye(3)[:2], -np.eye(3)[:2]))]
    forces = [float(fall.impacts[0].peak_force)]
    with without_warnings():
        turns += _flattening(fall, angle)
        with counting("the force over small tilts", len(turns)) as done:
            for k, turn in enumerate(turns):
                done(k)
                forces.append(_force(fall, turn))
    return min(forces), max(forces)


def _force(fall: Fall, turn: Array) -> float:
    """Force [N] of the first impact of a fall whose start is turned."""
    setting = replace(fall.setting, impacts=1)
    start = fall.start
    turned = initial_state(
        fall.body, setting, turn @ start.R, start.spin(fall.body), start.velocity
    )
    return float(fall_of(fall.body, turned, setting).impacts[0].peak_force)


def _flattening(fall: Fall, angle: float) -> list[Array]:
    """The rotation that lays a face of the hull, within `angle` of the floor, flat on it."""
    try:
        normals = ConvexHull(fall.body.points).equations[:, :3] @ fall.start.R.T
    except QhullError:  # all points in a plane
        return []
    down = np.array([0.0, 0.0, -1.0])
    nearest = normals[np.argmax(normals @ down)]
    is_near = nearest @ down > cos(angle)
    return [onto(nearest, down)] if is_near else []
