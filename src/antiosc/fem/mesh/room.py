"""The largest ball that touches a surface at a site and meets the part nowhere else."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.fem.mesh.surface import Faces

#: Points of the surface so near the site, over the radius of its patch or the size of its face, are
#: those of the contact itself.
NEAR = 2.0
#: Height of a point over the tangent plane, over its distance from the site, that the error of the
#: normal may make: at facets of 15° it is 0.03. A wall at a distance D is met by balls from 1.08 D.
SLOPE = 0.05
#: Height of a point over its distance from which on it is another face, half as near too. A post
#: beside a site, 1.6 patch radii away, was left out: a ball of 4 mm struck it 0.3 mm before.
STEEP = 0.3


def largest_ball(
    faces: Faces, point: Array, normal: Array, patch_radius: float
) -> tuple[float, Array]:
    """(radius [m], the point (3,) that a larger ball meets); inf if there is none.

    `point`, `normal` : (3,) of the site; `patch_radius` : radius of its patch [m], 0 of a point.
    """
    r = faces.samples - point
    distance = np.linalg.norm(r, axis=1)
    mean = faces.sizes[np.argmin(np.linalg.norm(faces.centres - point, axis=1))] if r.size else 0
    height = r @ normal - SLOPE * distance
    near = np.where(height > STEEP * distance, NEAR / 2, NEAR) * max(patch_radius, float(mean))
    touched = (height > 0) & (distance > near)
    radii = np.where(touched, distance**2 / (2 * np.where(touched, height, 1.0)), np.inf)
    ball = (np.inf, point)
    if radii.size:
        i = int(np.argmin(radii))
        ball = float(radii[i]), faces.samples[i]
    everywhere: list[tuple[float, Array]] = faces.mesh.comm.allgather(ball)
    return min(everywhere, key=lambda found: found[0])
