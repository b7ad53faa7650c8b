"""What the march integrates: modes, rows and contacts, and their state at the start."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc.simulation import march
from antiosc.simulation.laws import MEMORY

Array = NDArray[np.float64]

SLOWEST = 1e-4  # of the closing speed that is expected: what begins more slowly begins at rest


@dataclass(eq=False)
class System:
    """Modes, rows and contacts as the march takes them (see `march.march`).

    Attributes
    ----------
    omega, decay : (J,) of all bodies side by side.
    beta : (m, J), the p contacts first, then the tangential rows of their friction.
    R : (m, m) residual compliance.
    breaks, loads, offsets : (K,), (K, J), (K, m).
    kinds, params : (p,) and (p, .) of the laws.
    slip : (p, 2) coefficient of friction, tangential stiffness [N/m].
    tangents : (p, 2) first tangential row and their number.
    q, v : (J,) initial state.
    mass : (p,) inertia behind each contact [kg], roughly.
    depth, speed : (p,) indentation [m] and closing speed [m/s] that are expected, roughly.
    pressed : (p,) forces [N] at the start: a contact with one is closed.
    """

    omega: Array
    decay: Array
    beta: Array
    R: Array
    breaks: Array
    loads: Array
    offsets: Array
    kinds: NDArray[np.int64]
    params: Array
    slip: Array
    tangents: NDArray[np.int64]
    q: Array
    v: Array
    mass: Array
    depth: Array
    speed: Array
    pressed: Array
    given: float = 0.0

    @property
    def slowest(self) -> Array:
        """Closing speeds (p,) [m/s] below which a contact counts as begun at that speed.

        The damping of a law that takes it from the closing speed has no limit for a start from
        rest: this is the speed that it then has, the same for all integrators.
        """
        return SLOWEST * self.speed

    @cached_property
    def start(self) -> Start:
        """What every run begins with; the system is not to be changed once it has run."""
        return Start.of(self)


@dataclass(eq=False)
class Start:
    """A system as the march takes it, and its state at the start (shapes: `march/layout.py`)."""

    modes: tuple[Array, ...]
    acting: tuple[Array, ...]
    contacts: tuple[NDArray[Any], ...]
    state: tuple[NDArray[Any], ...]
    key: tuple[object, ...]

    @classmethod
    def of(cls, system: System) -> Start:
        """The start of a system."""
        p, (m, size) = system.kinds.size, system.beta.shape
        clock, count = np.zeros(16), np.zeros(15, dtype=np.int64)
        mode, s, anchor = np.zeros(p, dtype=np.int64), np.zeros((p, MEMORY)), np.zeros((3, p, 2))
        x, row, scales = np.empty((2, size)), np.zeros((7, m)), np.empty((p, 2))
        met = np.empty((p, 2))
        x[0], x[1] = system.q, system.v
        scales[:, 0], scales[:, 1] = system.depth, system.speed
        met[:, 0], met[:, 1] = system.mass, system.slowest
        count[march.LEVEL] = 4
        count[march.LOADED] = np.count_nonzero(system.loads) > 0
        count[march.SHIFTED] = np.count_nonzero(system.offsets) > 0
        row[march.FRESH] = 1.0
        row[march.DEPTH] = system.beta @ system.q - system.offsets[0]
        row[march.RATE] = system.beta @ system.v
        if np.count_nonzero(system.pressed):
            for c in np.flatnonzero(system.pressed > 0):
                mode[c] = march.change(
                    system.kinds[c], march.APART, march.HIGH, 0.0, 0.0, system.params[c], s[c]
                )
                row[march.FORCE, c] = system.pressed[c]
            clock[march.FORCE_SCALE] = system.pressed.max()
            count[march.LEVEL] = 10
            row[march.DEPTH] -= system.R @ row[march.FORCE]
        for c, (first, n) in enumerate(system.tangents.tolist()):
            anchor[0, c, :n] = row[march.DEPTH, first : first + n]
        clock[march.GIVEN] = system.given + march.mechanical(x, system.omega)
        clock[march.HIGHEST] = clock[march.GIVEN]
        modes = (system.omega, system.decay, system.beta, system.R)
        rated = any(kind in (march.DAMPED, march.USER) for kind in system.kinds.tolist())
        return cls(
            modes,
            (system.breaks, system.loads, system.offsets),
            (system.kinds, system.params, system.slip, system.tangents, met),
            (clock, count, x, row, mode, s, anchor, scales),
            (rated, p, *(each.tobytes() for each in modes)),
        )
