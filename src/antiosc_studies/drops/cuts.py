"""Areas at which planes cut a solid."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc_studies.drops.layer_contact import below


def cut_areas(triangles: Array, heights: Array, up: Array, depths: Array) -> Array:
    """Areas (n,) [m^2] of the cuts of a solid by planes at depths (n,) [m].

    triangles : (T, 3, 3) of its surface, oriented outward; heights : (T, 3) of their corners over
    the lowest point; up : (3,) normal of the planes.
    """
    is_low = heights.min(axis=1) < depths[-1]
    corners = triangles[is_low]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    over_planes = heights[is_low] - depths[:, None, None]
    volumes = below(over_planes).sum(axis=2) @ (-normals @ up)
    return np.maximum(np.gradient(volumes, depths), 0.0)
