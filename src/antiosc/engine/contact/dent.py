"""`Dent`: the permanent indentation of a contact that yields."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi, sqrt

import numpy as np

from antiosc.base.texts import ReprMixin, engineering
from antiosc.engine.contact.base import ContactLaw
from antiosc.engine.contact.laws import ElasticPlastic, Hysteretic

#: Indentation over that at first yield, and radius² of the rim of the dent over that times R
#: (benchmarks/elastoplastic/small_strain.csv; the volume is π/2 depth radius² within 5 % there).
RIM_TABLE = ((1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0), (1.0, 1.2, 1.27, 1.42, 1.62, 1.75, 1.84))


@dataclass(frozen=True, repr=False)
class Dent(ReprMixin):
    """A permanent indentation.

    Attributes
    ----------
    depth : depth [m].
    radius : radius of the rim [m]; None if the law does not give it.
    volume : volume [m^3]; None if the law does not give it.
    """

    depth: float
    radius: float | None = None
    volume: float | None = None

    @property
    def text(self) -> str:
        """The dent in words: "a dent of 42.0 µm, some 2 mm across"."""
        text = f"a dent of {engineering(self.depth, 'm')}"
        if self.radius is None:
            return text
        return f"{text}, some {engineering(2 * self.radius, 'm', 2)} across"

    def _facts(self) -> list[tuple[str, str]]:
        return [("dent", self.text)]


def dent_of(law: ContactLaw, deepest: float) -> Dent | None:
    """The dent of a law after the largest indentation `deepest` [m]; None for an elastic law."""
    if not isinstance(law, Hysteretic) or deepest <= 0:
        return None

    depth = law.permanent(deepest)
    if depth <= 0:
        return None
    if isinstance(law, ElasticPlastic):
        radius = rim_radius(law, deepest)
        return Dent(depth, radius, pi / 2 * depth * radius**2)

    return Dent(depth)


def rim_radius(law: ElasticPlastic, deepest: float) -> float:
    """Radius [m] of the contact at its largest indentation [m]: the rim of the dent."""
    x = deepest / law.yield_indentation
    return sqrt(float(np.interp(log(x), np.log(RIM_TABLE[0]), RIM_TABLE[1])) * law.radius * deepest)
