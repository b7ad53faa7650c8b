"""How far a given point may lie from a structure, onto which it is moved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import point_text
from antiosc.base.errors import InputError

#: Without a length a point is moved by at most this share of the part's size, or by one element.
SNAP_SHARE = 0.02


@dataclass(frozen=True)
class Reach:
    """Largest distance of a given point from the structure, onto which it is projected.

    Attributes
    ----------
    what : the point in words, for messages.
    snap : largest distance [m]; None: `SNAP_SHARE` of the part's size, or one element.
    remedy : the remedy for messages.
    """

    what: str
    snap: float | None = None
    remedy: str = "give a point on it, or the length that it may be moved (snap)"

    def check(
        self, point: Array, nearest: Array, size: float, element: Callable[[], float]
    ) -> None:
        """InputError for a point (3,) whose nearest point (3,) of the structure is too far [m].

        `size` [m]: size of the part; `element`: returns the size [m] of its element there.
        """
        distance = float(np.linalg.norm(point - nearest))
        limit = SNAP_SHARE * size if self.snap is None else self.snap
        if distance > limit and self.snap is None:
            limit = max(limit, element())
        if distance <= limit:
            return
        rule = "2 % of the part's size, or one element" if self.snap is None else "the length given"
        units = f"; coordinates are in metres, and the part measures {size:.3g} m"
        raise InputError(
            f"{self.what} {point_text(point)} is {distance:.3g} m off the structure, whose nearest "
            f"point is {point_text(nearest)}: farther than {limit:.3g} m, {rule}"
            f"{units if distance > size else ''}; {self.remedy}."
        )


def check_reach(reach: Reach, point: Array, points: Array, nearest: int) -> None:
    """`Reach.check` for the node `nearest` of `points` (P, 3).

    The size of an element there is the distance to the next node.
    """
    x = points[nearest]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    reach.check(
        point, x, size, lambda: float(np.sort(np.linalg.norm(points - x, axis=1))[:2].max())
    )
