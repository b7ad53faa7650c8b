"""Curved beams (CBEND) as chains of straight ones on their arc."""

from __future__ import annotations

import math

import numpy as np

from antiosc.io.deck import Array
from antiosc_decks.nastran.cards import Entry

#: Sine below which a direction lies along the chord.
ALONG = 1e-9


def arc(entry: Entry, bend: Entry, x: Array, v: Array, pieces: int) -> tuple[Array, Array]:
    """(points (pieces - 1, 3) between the ends, directions of plane 1 (pieces, 3)) of a CBEND.

    `bend`: its PBEND; `x` (2, 3): its ends; `v`: the vector, or the arm of the node, that it gives.
    """
    chord = x[1] - x[0]
    long = float(np.linalg.norm(chord))
    up = v - (v @ chord) * chord / long**2
    if not np.linalg.norm(up) > ALONG * np.linalg.norm(v) or not v.any():
        raise entry.place.error(
            f"the plane of CBEND {entry.whole(0)} is not known: its vector lies along its chord."
        )
    up /= np.linalg.norm(up)
    kind = entry.whole(7)
    if kind in (3, 4):  # radius or angle; the centre lies across the chord from the point
        radius = bend.real(6) if kind == 3 else (
            long / 2 / max(math.sin(math.radians(bend.real(7)) / 2), ALONG))  # fmt: skip
        if radius < long / 2:
            raise entry.place.error(
                f"the radius of CBEND {entry.whole(0)} is {radius:.4g}, its chord {long:.4g}: "
                "give RB or THETAB of its PBEND."
            )
        centre = x.mean(axis=0) - math.sqrt(radius**2 - long**2 / 4) * up
    elif kind in (1, 2):  # the vector points to the centre, or along the arc
        w = v if kind == 1 else (v @ up) * chord - (v @ chord) * up
        if not abs(w @ chord) > ALONG * long * np.linalg.norm(w):
            raise entry.place.error(f"CBEND {entry.whole(0)} has no centre of curvature.")
        centre = x[0] + w * long**2 / (2 * (w @ chord))
    else:
        raise entry.place.error(f"GEOM of CBEND is 1 to 4; got {kind}.")
    first, last = x - centre
    angle = math.atan2(float(np.linalg.norm(np.cross(first, last))), float(first @ last))
    ahead = last - first * math.cos(angle)
    ahead *= np.linalg.norm(first) / np.linalg.norm(ahead)
    at = np.arange(2 * pieces + 1)[1:-1, None] * angle / (2 * pieces)
    arms = np.cos(at) * first + np.sin(at) * ahead
    return centre + arms[1::2], -arms[::2] / np.linalg.norm(first)
