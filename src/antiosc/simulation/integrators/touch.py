"""The next touch of two bodies in free flight, as the march finds it."""

from __future__ import annotations

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.contact import Linear
from antiosc.simulation.engine import run
from antiosc.simulation.integrators.problem import Problem
from antiosc.simulation.system import System


def next_touch(
    problem: Problem, q: Array, v: Array, origin: float, span: float, fine: float
) -> float | None:
    """Time [s] until the indentation first rises above `origin`, or None within `span`."""
    p = problem
    ahead = System(
        omega=p.omega,
        decay=p.decay,
        beta=p.beta[None],
        R=np.zeros((1, 1)),
        breaks=np.zeros(1),
        loads=p.load[None],
        offsets=np.array([[p.gap + origin]]),
        laws=(Linear(1.0),),
        slip=np.zeros((1, 2)),
        tangents=np.array([[1, 0]], dtype=np.int64),
        q=q,
        v=v,
        mass=np.ones(1),
        depth=np.array([p.depth]),
        speed=np.array([p.speed]),
        pressed=np.zeros(1),
    )
    found = run(ahead, span, 1.0, fine=fine, keep=False, max_contacts=0)
    return float(found.time[-1]) if found.answer == march.TOO_MANY_CONTACTS else None
