"""A run as gradients see it: its march, and the bodies whose modes stand side by side in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.models.modal import ModalBody
from antiosc.simulation.engine import Run
from antiosc.simulation.history import History
from antiosc.simulation.scene_history import SceneHistory
from antiosc.simulation.scene_states import between, starts
from antiosc.simulation.system import System

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

    `ends`: the names of the ends of the contacts. `driven`: loads or the ground act in time.
    """

    system: System
    run: Run
    load: Callable[[Array], Array]
    parts: dict[str, Part]
    ends: list[tuple[str, str]]
    B: Array
    r: Array
    G: Array
    driven: bool = False

    @property
    def edges(self) -> Array:
        """Times (n + 1,) [s] at which steps begin and end."""
        return self.run.time[::2]

    def states(self) -> Array:
        """Modal displacements and velocities (n + 1, 2, J) at the edges."""
        if self.run.every == 1 and self.run.states is not None:
            return self.run.states
        every = np.arange(self.edges.size)
        return np.stack(starts(self.run, self.system, self.load, every), axis=1)


def recorded(hit: Any) -> Recorded:
    """The run of a history; InputError for what has none with all that gradients need."""
    if isinstance(hit, SceneHistory):
        a = hit.assembly
        parts = {
            name: Part(body.body, body.modes, a.spans[name], a.columns[name])
            for name, body in a.bodies.items()
        }
        ends = [(contact.a, contact.b) for contact in a.scene.contacts]
        driven = bool(a.scene.loads) or a.scene.base is not None
        found = Recorded(a.system, hit.run, a.load, parts, ends, a.B, a.r, a.G, driven)
    elif isinstance(hit, History) and hit.trajectory.march is not None:
        found = _of_two(hit, *hit.trajectory.march)
    else:
        raise InputError(f"hit must be {EXACT}; got {type(hit).__name__}.")
    if found.run.exits is None or found.run.states is None:
        raise InputError(f"hit must be {EXACT}: this run did not keep its states.")
    return found


def _of_two(hit: History, system: System, run: Run) -> Recorded:
    modes: list[ModalBody] = list(hit.bodies)
    at = [0, *np.cumsum([each.omega.size for each in modes]).tolist()]
    names = {"structure": hit.model, "impactor": hit.impactor}
    parts = {
        name: Part(body, modes[i], slice(at[i], at[i + 1]), slice(i, i + 1))
        for i, (name, body) in enumerate(names.items())
    }
    return Recorded(
        system=system,
        run=run,
        load=partial(between, breaks=system.breaks, values=system.loads),
        parts=parts,
        ends=[("structure", "impactor")],
        B=block_diag(*(each.b[:, None] for each in modes)),
        r=np.diag([each.r for each in modes]),
        G=np.array([[-1.0, 1.0]]),
    )
