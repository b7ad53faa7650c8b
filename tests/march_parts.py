"""The arrays of a march of several contacts, filled at random: for tests of its parts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

import antiosc as ao
from antiosc.simulation import engine
from antiosc.simulation.laws import packed
from antiosc.simulation.march import layout
from antiosc.simulation.system import System

OMEGA, DECAY = np.array([0.0, 300.0, 2e3, 9e3, 3e4]), np.array([0.0, 4.0, 0.0, 90.0, 0.0])
SPRING = ao.Linear(3e5)


class Parts(SimpleNamespace):
    """The arrays of a march of several contacts (and rows of friction), filled at random."""

    system: System
    modes: Any
    contacts: Any
    state: Any
    tables: Any
    work: Any

    @classmethod
    def of(cls, laws: list[ao.ContactLaw], rubs: int = 0, seed: int = 3) -> Parts:
        rng = np.random.default_rng(seed)
        p = len(laws)
        m = p + rubs
        rows = [packed(law) for law in laws]
        params = np.zeros((p, max(values.size for _, values in rows)))
        for row, (_, values) in zip(params, rows, strict=True):
            row[: values.size] = values
        a = rng.normal(size=(m, m))
        system = System(
            omega=OMEGA, decay=DECAY, beta=rng.normal(size=(m, OMEGA.size)), R=1e-7 * a @ a.T,
            breaks=np.array([0.0, 0.2, 0.7]), loads=rng.normal(size=(3, OMEGA.size)),
            offsets=rng.normal(size=(3, m)) * 1e-6,
            kinds=np.array([kind for kind, _ in rows]), params=params,
            slip=np.tile([0.3, 2e5], (p, 1)),
            tangents=np.array([[p, rubs], *[[m, 0]] * (p - 1)]),
            q=rng.normal(size=OMEGA.size) * 1e-5, v=rng.normal(size=OMEGA.size),
            mass=rng.uniform(0.5, 2, p), depth=np.full(p, 1e-4), speed=np.full(p, 2.0),
            pressed=np.zeros(p),
        )  # fmt: skip
        space = engine.Space.of(p, m, OMEGA.size)
        space.begin(system.start)
        mode = space.state[4]
        mode[:] = layout.FORWARD
        row = space.state[3]
        row[:] = rng.normal(size=row.shape)
        row[layout.DEPTH], row[layout.FRESH] = rng.uniform(1e-5, 1e-4, m), 0.0
        row[layout.FORCE] = np.abs(row[layout.FORCE])
        for each in space.work[4:8]:
            each[:] = rng.normal(size=each.shape)
        return cls(
            system=system, modes=system.start.modes, contacts=system.start.contacts,
            state=space.state, tables=space.tables, work=space.work, acting=system.start.acting,
        )  # fmt: skip
