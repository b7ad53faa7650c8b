"""The error of a force on a soft layer, whose law leaves out edges and large strains.

The elastic foundation carries the area A under the part alone. Along the perimeter P of this area
the layer beside it helps: with the stiffness 2aE* of a circle on a half-space in addition, the
foundation's E A/t grows by the share t P/(pi A). A compression by the share s of the thickness
grows it by s/(1 - s). At equal work a force k d^n grows with the power 1/(n + 1) of the stiffness.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np

from antiosc.base._types import Array
from antiosc_studies.drops.episode import Episode, path_of
from antiosc_studies.drops.floor import SoftLayer
from antiosc_studies.drops.layer_contact import LayerContact

#: Change of the depth by which the area of an imprint is measured, over the depth.
CHANGE = 1e-3
#: Times at which the deepest imprint is sought.
TIMES = 65


class Imprint(NamedTuple):
    """Depth [m], area [m^2] and perimeter [m] of an imprint, and the exponent of its force."""

    depth: float
    area: float
    perimeter: float
    exponent: float


def layer_error(episode: Episode, layer: SoftLayer) -> float | None:
    """Relative error of the largest force on a layer; None if it is pressed to its ground."""
    imprint = imprint_of(episode)
    strain = imprint.depth / layer.thickness
    if strain >= 1:
        return None
    stiffer = edge_share(imprint, layer.thickness) + strain / (1 - strain)
    power = 1 / (imprint.exponent + 1)
    ends = [(end / layer.E) ** power for end in layer.range or (layer.E,)]
    return (1 + stiffer) ** power - 1 + max(abs(end - 1) for end in ends)


def edge_share(imprint: Imprint, thickness: float) -> float:
    """Share by which the layer beside an imprint makes it stiffer at most."""
    return thickness * imprint.perimeter / (pi * imprint.area)


def imprint_of(episode: Episode) -> Imprint:
    """The imprint of an episode at its largest depth."""
    body = episode.body
    surface = body.layer_contact
    if surface is None or surface.height == 0.0:
        return _of_ball(episode)
    last = min(episode.duration, float(episode.history.time[-1]))
    path = path_of(episode.touch, episode.history, np.linspace(0.0, last, TIMES))
    rise = (path.q - path.q[0])[:, :6] @ episode.touch.modes[:, 2]
    heights = surface.height + rise
    states = path.R[:, 2], path.q[:, 6:]
    k = int(surface.pressed(surface.every, *states, heights)[0].sum(axis=1).argmax())
    state = path.R[k, 2], path.q[k, 6:]
    z = float(heights[k])
    depth = -float(_heights_of(surface, *state, z).min())
    change = CHANGE * depth
    volumes, _, _ = surface.pressed(surface.every, *state, z - np.array([0.0, change]))
    volume, more = volumes.sum(axis=1).tolist()
    if not volume > 0:
        return _of_ball(episode)
    area = (more - volume) / change
    return Imprint(depth, area, _perimeter(surface, *state, z), area * depth / volume)


def _of_ball(episode: Episode) -> Imprint:
    """The imprint of the point of a round body that sinks deepest."""
    depths = episode.sunk()
    k = int(np.argmax(depths))
    depth = float(depths[k])
    low, high = np.sort(episode.body.radii[episode.which[k]]).tolist()
    if not 0 < depth * high < np.inf:
        return Imprint(0.0, np.inf, 0.0, 1.0)  # it only comes near
    area = 2 * pi * sqrt(low * high) * depth
    # that of an ellipse is at most that of its box
    perimeter = 4 * (sqrt(2 * low * depth) + sqrt(2 * high * depth))
    return Imprint(depth, area, perimeter, 2.0)


def _heights_of(surface: LayerContact, up: Array, q: Array, z: float) -> Array:
    """Heights (P,) [m] of the points of a surface over the layer."""
    raised = np.concatenate((up, (q[:, None] * up).ravel()))
    return np.asarray(surface.places @ raised + z)


def _perimeter(surface: LayerContact, up: Array, q: Array, z: float) -> float:
    """Length [m] of the convex outline of what lies below the layer's surface."""
    from scipy.spatial import ConvexHull

    h = _heights_of(surface, up, q, z)
    points = surface.places[:, :3] + np.outer(z - h, up)  # shifted along the vertical
    first, second = surface.triangles, np.roll(surface.triangles, -1, axis=1)
    crossed = h[first] * h[second] < 0
    a, b = first[crossed], second[crossed]
    share = (h[a] / (h[a] - h[b]))[:, None]
    outline = np.vstack([points[h <= 0], points[a] + share * (points[b] - points[a])])
    across = np.linalg.svd(up[None])[2][1:]
    hull = ConvexHull(outline @ across.T)
    return float(hull.area)
