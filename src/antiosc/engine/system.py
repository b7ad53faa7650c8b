"""What the march integrates: modes, rows and contacts, and their state at the start.

`posed` makes a `System` of bodies side by side, `Given` the C structure of a `System`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ctypes import addressof, byref
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise, starmap
from math import isfinite, prod
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
_AT_START = np.zeros(1)  # the one time of loads that are constant
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
    block : memory of the arrays of `numbers`, one behind the other, where they stand so.
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
    def numbers(self) -> tuple[Array, ...]:
        """The arrays of the bodies and the rows in the order of their memory."""
        rows = self.omega, self.decay, self.beta, self.R
        return *rows, self.breaks, self.loads, self.offsets, self.q, self.v

    @property
    def sides(self) -> list[slice]:
        """The tangential rows of each contact."""
        return [slice(first, first + count) for first, count in self.tangents.tolist()]

    def with_rows(self, beta: Array, quadratic: Array, cubic: Array) -> System:
        """The system with rows beta (s, J) behind the others, whose forces are the polynomials."""
        more = len(beta)
        return replace(
            self,
            beta=np.vstack([self.beta, beta]),
            R=np.pad(self.R, (0, more)),
            offsets=np.pad(self.offsets, ((0, 0), (0, more))),
            quadratic=quadratic,
            cubic=cubic,
        )

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Which contacts (p,) are closed at the start."""
        if self.kept is None:
            return self.pressed > 0
        return (self.pressed > 0) | [one is not None and one.closed for one in self.kept]

    def begun(self) -> list[State]:
        """States of the p laws at the start; a law that was never touched starts from a touch at
        rest.
        """
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
        if self.first is None:
            return self.decay == 0
        return self.first.undamped

    @cached_property
    def marched(self) -> System:
        """The system in the modes that the C library integrates: first-order ones where damping
        couples the modes, with loads (K, 2 I) on displacements and velocities.
        """
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
        free = self.beta @ q
        rate = self.beta @ v
        if self.gamma is None:
            return free, rate
        return free + self.gamma @ v, rate - self.gamma @ (self.omega**2 * q + 2 * self.decay * v)

    @cached_property
    def packed(self) -> Given:
        """The system as the march takes it."""
        return Given(self)

    def expect_contact(self, mass: float, duration: float) -> float:
        """Set what is expected of the only contact; returns its time [s].

        mass : inertia [kg] behind the contact, of the slowest motion of each body.
        """
        given = self.packed
        (contact,) = given.contacts
        contact.mass = mass
        found = library.library.aom_expect(byref(given.system), 0, duration)
        given.failed()
        if not isfinite(found.depth + found.speed + found.time):
            raise OverflowError("the depth of the contact")
        self.mass[0] = mass
        self.depth[0] = found.depth
        self.speed[0] = found.speed
        contact.expected_depth = found.depth
        contact.expected_speed = found.speed
        contact.slowest = float(self.slowest[0])
        return float(found.time)

    def __getstate__(self) -> dict[str, Any]:
        left = ("packed", "marched", "block")
        return {name: value for name, value in self.__dict__.items() if name not in left}


class BodyModes(NamedTuple):
    """The modes (J,) of one body in a system.

    Frequencies and decay, displacements (m, J) in the rows, or (J,) in the only one, the state at
    the start, and the loads (K, J); None: zeros.
    """

    omega: Array
    decay: Array | None
    beta: Array
    v: Array
    q: Array | None = None
    loads: Array | None = None


def side_by_side(sizes: Iterable[int]) -> list[slice]:
    """The places of parts of these sizes, one behind the other."""
    return list(starmap(slice, pairwise(accumulate(sizes, initial=0))))


def posed(
    bodies: Sequence[BodyModes],
    laws: Sequence[ContactLaw],
    R: Array,
    offsets: Array | float = 0.0,
    breaks: Array = _AT_START,
    tangents: Sequence[tuple[int, int]] | None = None,
    first: StackedModes | None = None,
) -> System:
    """Bodies side by side in m rows, the first p of which are contacts.

    R : (m, m); offsets : (K, m); breaks : (K,); tangents : (p, 2), none without friction. What is
    expected of the contacts is 0 at first, their mass too.
    """
    spans = side_by_side([body.omega.size for body in bodies])
    places = _places(spans[-1].stop, len(R), breaks.size)
    block = np.zeros(places[-1][0].stop)
    numbers = [block[own].reshape(shape) for own, shape in places]
    omega, decay, beta, residual, times, loads, gaps, q, v = numbers
    residual[...] = R
    times[...] = breaks
    gaps[...] = offsets
    for body, own in zip(bodies, spans, strict=True):
        omega[own] = body.omega
        beta[:, own] = body.beta
        v[own] = body.v
        if body.decay is not None:
            decay[own] = body.decay
        if body.q is not None:
            q[own] = body.q
        if body.loads is not None:
            loads[:, own] = body.loads
    p = len(laws)
    friction = np.zeros((p, 2), dtype=np.int64)
    friction[:, 0] = len(R)
    if tangents is not None:
        friction[...] = tangents
    mass, depth, speed, pressed = np.zeros((4, p))
    system = System(
        omega,
        decay,
        beta,
        residual,
        times,
        loads,
        gaps,
        laws,
        np.zeros((p, 2)),
        friction,
        q,
        v,
        mass,
        depth,
        speed,
        pressed,
        first=first,
    )
    system.block = block
    return system


@lru_cache(maxsize=256)
def _places(size: int, m: int, times: int) -> list[tuple[slice, tuple[int, ...]]]:
    """Where the arrays of `System.numbers` stand in a block, and their shapes."""
    modes = (size,)
    rows = [(m, size), (m, m)]
    given = [(times,), (times, size), (times, m)]
    shapes = [modes, modes, *rows, *given, modes, modes]
    return list(zip(side_by_side(map(prod, shapes)), shapes, strict=True))


Key = tuple[int, int, int, bytes]


class Given:
    """A system as the march takes it: all its arrays in one block of memory.

    `key`: contacts, rows and modes, and the numbers that the responses of the modes depend on.
    """

    def __init__(self, system: System) -> None:
        s = system
        p = len(s.laws)
        m, size = s.beta.shape
        breaks = s.breaks.size
        block = s.block
        numbers = s.numbers
        if block is None or any([each.base is not block for each in numbers]):
            block = np.concatenate([each.ravel() for each in numbers], dtype=float)
        self.block: Array = block
        bodies = block[: 2 * size + m * (size + m)].tobytes()
        gamma = None
        if s.gamma is not None:
            gamma = library.address(s.gamma)
            bodies += s.gamma.tobytes()
            self.gamma = s.gamma  # it lasts as long as the block
        if s.cubic is not None:  # the memory of the march is laid out for them
            bodies += len(s.cubic).to_bytes(2, "little")
        self.key: Key = p, m, size, bodies
        ends = accumulate([8 * each.size for each in numbers], initial=library.address(block))
        *arrays, q, v, _ = ends
        self.laws = [packed(law) for law in s.laws]
        each_contact = zip(
            self.laws,
            s.slip.tolist(),
            s.tangents.tolist(),
            s.mass.tolist(),
            s.depth.tolist(),
            s.speed.tolist(),
            s.slowest.tolist(),
            s.pressed.tolist(),
            strict=True,
        )
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
                contact.state = library.address(state)
                contact.closed = one.closed
                states.append(state)
        return states

    def failed(self) -> None:
        """Raise the error of a law of the user's own."""
        for _, own in self.laws:
            raise_error(own)
