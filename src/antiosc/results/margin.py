"""`Margin`: how far the worst point of a part is from yield or from the failure of a ply."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array
from antiosc.base.brief import Brief
from antiosc.base.engineering import engineering, place
from antiosc.fem.recovery.place import Place

#: Criterion -> what is reached at an exposure of 1, and the name of the criterion.
CRITERIA = {
    "yield": ("yield", "von Mises"),
    "tsai_hill": ("failure of a ply", "Tsai–Hill"),
    "tsai_wu": ("failure of a ply", "Tsai–Wu"),
    "delamination": ("delamination", "interlaminar shear"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Margin(Brief):
    """The worst point of a part over a run: the largest stress over the strength.

    The stresses are those of a linear-elastic part: beyond yield it deforms permanently, and its
    stresses stay lower.

    Attributes
    ----------
    criterion : "yield" (von Mises), "tsai_hill", "tsai_wu" or "delamination".
    value : of "yield" the von Mises stress, Pa; else the exposure.
    strength : of "yield" the yield strength, Pa; else 1.
    point : (3,) where, m.
    time : when, s.
    layer, surface : of a laminate: number of the layer, from the bottom, and its surface.
    contact : a sentence where the contact itself yields, which the values leave out; "" otherwise.
    """

    criterion: str
    value: float
    strength: float
    point: Array
    time: float
    layer: int | None = None
    surface: str | None = None
    contact: str = ""

    @property
    def exposure(self) -> float:
        """Stress over strength: 1 at yield or failure, proportional to the load."""
        return self.value / self.strength

    @property
    def margin(self) -> float:
        """Margin of safety, strength over stress minus 1; negative: yield or failure is reached."""
        return float(np.inf) if not self.value else self.strength / self.value - 1

    @property
    def reached(self) -> bool:
        """Whether yield or failure is reached."""
        return self.exposure >= 1

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        what, name = CRITERIA[self.criterion]
        where = f"at {place(self.point)}, {engineering(self.time, 's')}"
        if self.layer is not None:
            where = f"in layer {self.layer} ({self.surface}) {where}"
        verdict = f"{what} is {'reached' if self.reached else 'not reached'}"
        used = f"{self.exposure:.3g} of the strength ({name})"
        if self.criterion == "yield":
            used = (
                f"the largest von Mises stress, {engineering(self.value, 'Pa')} {where}, is "
                f"{self.exposure:.3g} of the yield strength {engineering(self.strength, 'Pa')}"
            )
        else:
            used = f"the largest exposure by {name} is {self.exposure:.3g}, {where}"
        beside = f"; {self.contact}" if self.contact else ""
        return f"{verdict}: {used}; margin of safety {self.margin:.3g}{beside}"

    def __str__(self) -> str:
        return self.sentence

    def _facts(self) -> list[tuple[str, str]]:
        return [(self.criterion, self.sentence)]


def margin_of(
    criterion: str,
    values: Array,
    strengths: Array,
    points: Array,
    times: Array,
    places: list[Place],
) -> Margin | None:
    """The worst of values (S,) with strengths (S,), NaN where unknown; None where none is known."""
    exposure = values / strengths
    if not np.isfinite(exposure).any():
        return None
    k = int(np.nanargmax(exposure))
    layer, side = places[k].layer, str(places[k].surface) if places[k].layer is not None else None
    found = float(values[k]), float(strengths[k])
    return Margin(criterion, *found, points[k], float(times[k]), layer, side)
