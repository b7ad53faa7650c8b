"""What the march integrates: modes, rows and contacts, and their state at the start."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import addressof
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.damping import StackedModes
from antiosc.engine.law_tables import packed, raise_error
from antiosc.engine.stretch import stretch_energy

Array = NDArray[np.float64]

_ONE = (
    library.Contact * 1
)  # ctypes keeps this type as long as it is held, and takes 50 µs to make it
SLOWEST = 1e-4  # of the closing speed that is expected: what begins more slowly begins at rest


class Kept(NamedTuple):
    """A contact at a time of a run: whether it is closed, the speed [m/s] at which it closed last,
    and the state of its law."""

    closed: bool
    speed: float
    state: State


@dataclass(eq=False)
class System:
    """Modes, rows and contacts as the march takes them (`csrc/antiosc_march.h`).

    It is not to be changed once it has run.

    Attributes
    ----------
    omega, decay : (J,) of all bodies side by side.
    beta : (m, J), the p contacts first, then the tangential rows of their friction.
    R : (m, m) residual compliance.
    breaks, loads, offsets : (K,), (K, J), (K, m).
    laws : p contact laws.
    slip : (p, 2) coefficient of friction, tangential stiffness [N/m].
    tangents : (p, 2) first tangential row and their number.
    q, v : (J,) initial state.
    mass : (p,) inertia behind each contact [kg], roughly.
    depth, speed : (p,) indentation [m] and closing speed [m/s] that are expected, roughly.
    pressed : (p,) forces [N] at the start: a contact with one is closed.
    least_speed : closing speed [m/s] from which, at least, damped laws take their damping.
    kept : of p contacts what goes on from a run before; None of others.
    first : first-order modes of all bodies, where damping couples modes of one.
    gamma : (m, J) as `beta`, of the rates of first-order modes (`marched`).
    quadratic, cubic : (s, s, s), (s, s, s, s) forces of the last s rows: of sheets that stretch.
    block : omega to v in one array, where they already stand so.
    """

    omega: Array
    decay: Array
    beta: Array
    R: Array
    breaks: Array
    loads: Array
    offsets: Array
    laws: Sequence[ContactLaw]
    slip: Array
    tangents: NDArray[np.int64]
    q: Array
    v: Array
    mass: Array
    depth: Array
    speed: Array
    pressed: Array
    given: float = 0.0
    least_speed: float = 0.0
    kept: Sequence[Kept | None] | None = None
    first: StackedModes | None = None
    gamma: Array | None = None
    quadratic: Array | None = None
    cubic: Array | None = None
    block: Array | None = field(default=None, init=False)

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Which contacts (p,) are closed at the start."""
        if self.kept is None:
            return self.pressed > 0
        return (self.pressed > 0) | [one is not None and one.closed for one in self.kept]

    def begun(self) -> list[State]:
        """The states of the p laws at the start; before a first touch as of one at rest."""
        kept = self.kept or [None] * len(self.laws)
        return [
            law.touch(0.0) if one is None else one.state
            for law, one in zip(self.laws, kept, strict=True)
        ]

    @property
    def damped(self) -> bool:
        """Whether a mode has damping."""
        return self.first is not None or bool(self.decay.any())

    @property
    def undamped(self) -> NDArray[np.bool_]:
        """Which modes (J,) have no damping."""
        return self.decay == 0 if self.first is None else self.first.undamped

    @cached_property
    def marched(self) -> System:
        """The system in the modes that the march integrates: first-order ones where damping
        couples the modes. Its loads are those on both, (K, 2 I)."""
        first = self.first
        if first is None:
            return self
        size = first.omega.size
        rows = first.rows(self.beta)
        q, v = first.state(self.q, self.v)
        return replace(
            self,
            omega=first.omega,
            decay=first.decay,
            beta=np.ascontiguousarray(rows[:, :size]),
            gamma=np.ascontiguousarray(rows[:, size:]),
            loads=first.rows(self.loads),
            q=q,
            v=v,
            first=None,
        )

    @property
    def slowest(self) -> Array:
        """Closing speeds (p,) [m/s] below which a contact counts as begun at that speed.

        The damping of a law that takes it from the closing speed has no limit for a start from
        rest: this is the speed that it then has, the same for all integrators.
        """
        return np.maximum(SLOWEST * self.speed, self.least_speed)

    def stretch_energy(self, q: Array) -> Array:
        """Energy (n,) [J] of bodies that stretch, beyond their linear one, at q (n, J)."""
        if self.quadratic is None or self.cubic is None:
            return np.zeros(len(q))
        return stretch_energy(self.quadratic, self.cubic, q @ self.beta[-len(self.cubic) :].T)

    def free_rows(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Indentations and rates (m,) of the rows in a state, without gaps and forces."""
        free, rate = self.beta @ q, self.beta @ v
        if self.gamma is None:
            return free, rate
        return free + self.gamma @ v, rate - self.gamma @ (self.omega**2 * q + 2 * self.decay * v)

    @cached_property
    def packed(self) -> Given:
        """The system as the march takes it."""
        return Given(self)

    def __getstate__(self) -> dict[str, Any]:
        left = ("packed", "marched", "block")
        return {name: value for name, value in self.__dict__.items() if name not in left}


class Given:
    """A system as the march takes it: all its arrays in one block of memory.

    `bodies` are those that the responses of the modes depend on.
    """

    def __init__(self, system: System) -> None:
        s = system
        p, (m, size), breaks = len(s.laws), s.beta.shape, s.breaks.size
        block = s.block if s.q.base is s.v.base is s.block else None  # else another start
        if block is None:
            parts = (s.omega, s.decay, s.beta, s.R, s.breaks, s.loads, s.offsets, s.q, s.v)
            block = np.concatenate([each.ravel() for each in parts], dtype=float)
        self.block: Array = block
        self.bodies = self.block[: 2 * size + m * (size + m)].tobytes()
        gamma = None if s.gamma is None else library.address(s.gamma)
        if s.gamma is not None:
            self.bodies += s.gamma.tobytes()
            self.gamma = s.gamma  # it lasts as long as the block
        if s.cubic is not None:  # the memory of the march is laid out for them
            self.bodies += len(s.cubic).to_bytes(2, "little")
        row, at = 8 * size, library.address(self.block)
        R = at + (2 + m) * row
        times = R + 8 * m * m
        loads = times + 8 * breaks
        offsets = loads + 8 * s.loads.size
        q = offsets + 8 * breaks * m
        arrays, v = (at, at + row, at + 2 * row, R, times, loads, offsets), q + row
        self.laws = [packed(law) for law in s.laws]
        each_contact = zip(
            self.laws, s.slip.tolist(), s.tangents.tolist(), s.mass.tolist(), s.depth.tolist(),
            s.speed.tolist(), s.slowest.tolist(), s.pressed.tolist(), strict=True,
        )  # fmt: skip
        self.contacts = (library.Contact * p)(
            *[
                library.Contact(law, *slip, *tangents, *each)
                for (law, _), slip, tangents, *each in each_contact
            ]
        )
        self.states = [] if s.kept is None else self._keep(s.kept, s.laws)
        self.tensors = [np.ascontiguousarray(x) for x in (s.quadratic, s.cubic) if x is not None]
        stretch = 0 if s.cubic is None else len(s.cubic), *map(library.address, self.tensors)
        self.system = library.System(
            size, m, p, breaks, *arrays, addressof(self.contacts), q, v, s.given, gamma, *stretch
        )

    def _keep(self, kept: Sequence[Kept | None], laws: Sequence[ContactLaw]) -> list[Array]:
        """Let contacts go on from a run before; their states, which last as long as the block."""
        states = []
        for contact, one, law in zip(self.contacts, kept, laws, strict=True):
            if one is not None:
                state = np.array([*one.state, law.origin(one.state), 0.0], dtype=float)
                contact.state, contact.closed = library.address(state), one.closed
                states.append(state)
        return states

    def failed(self) -> None:
        """Raise the error of a law of the user's own."""
        for _, own in self.laws:
            raise_error(own)
