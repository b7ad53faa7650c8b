"""A run as gradients see it: its march, and the bodies whose modes stand side by side in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.simulation.histories import History
from antiosc.simulation.march.engine import Run
from antiosc.simulation.march.system import System
from antiosc.simulation.states import marched_starts, starts

EXACT = 'a History that simulate or Scene.run returned with method="exact"'


@dataclass(frozen=True, eq=False)
class Part:
    """A body: its modes among all, the columns of its sites, and its form in free modes if any."""

    body: Any
    modes: Any
    span: slice
    columns: slice


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the march took and wrote down; B (J, P), r (P, P), G (m, P) as in `Assembly`.

    `ends`: the names of the ends of the contacts; `laws`: as they were given. `driven`: loads or
    the ground act in time; `settled`: it begins in equilibrium.
    """

    system: System
    run: Run
    parts: dict[str, Part]
    ends: list[tuple[str, str]]
    laws: list[ContactLaw]
    B: Array
    r: Array
    G: Array
    driven: bool
    settled: bool

    @property
    def edges(self) -> Array:
        """Times (n + 1,) [s] at which steps begin and end."""
        return self.run.time[::2]

    @property
    def places(self) -> dict[str, slice]:
        """The modes of each body among those that the march integrates."""
        first = self.system.first
        spans = [part.span for part in self.parts.values()] if first is None else first.spans
        return dict(zip(self.parts, spans, strict=True))

    def coupled(self, name: str) -> bool:
        """Whether damping couples the modes of a body."""
        first = self.system.first
        return first is not None and first.parts[list(self.parts).index(name)][2] is not None

    def states(self) -> Array:
        """States (n + 1, 2, I) at the edges, of the modes that the march integrates."""
        if self.run.every == 1 and self.run.states is not None:
            return self.run.states
        every = np.arange(self.edges.size)
        return np.stack(marched_starts(self.run, self.system, every), axis=1)

    def velocities(self) -> Array:
        """Velocities (n + 1, J) of the free modes at the edges."""
        return starts(self.run, self.system, np.arange(self.edges.size))[1]


def recorded(hit: Any) -> Recorded:
    """The run of a history; InputError for what has none with all that gradients need."""
    run = hit.run if isinstance(hit, History) else None
    if run is None or run.exits is None or run.states is None:
        raise InputError(f"hit must be {EXACT}; got {checks.shown(hit)}.")
    a = hit.assembly
    parts = {
        name: Part(body.body, body.modes, a.spans[name], a.columns[name])
        for name, body in a.bodies.items()
    }
    return Recorded(
        system=a.system,
        run=run,
        parts=parts,
        ends=[(contact.a, contact.b) for contact in a.scene.contacts],
        laws=[contact.law for contact in a.scene.contacts],
        B=a.B,
        r=a.r,
        G=a.G,
        driven=bool(a.scene.loads) or a.scene.base is not None,
        settled=a.scene.preload,
    )
