"""The system to integrate: modes, rows, contacts, and their initial state.

`system_of_bodies` makes a `System` of several bodies; `PackedSystem` is the C structure of a
`System`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from ctypes import addressof, byref
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise, starmap
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from antiosc.base._types import NDArray
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.law_tables import packed_law, raise_error

if TYPE_CHECKING:
    from antiosc.engine.first_order import StackedModes

Array = NDArray[np.float64]

#: Data type of the C structure of a contact, `aom_contact`.
CONTACT_RECORD = cast("np.dtype[np.void]", np.dtype(library.CContact))
_START_TIME = np.zeros(1)  # the one time of loads that are constant
LEAST_SPEED_SHARE = (
    1e-4  # of the closing speed that is expected: what begins more slowly begins at rest
)


def stretch_energy(quadratic: Array, cubic: Array, a: Array) -> Array:
    """Energies (n,) [J] of second-order forces, from their tensors, at amplitudes a (n, m)."""
    quadratic_force, cubic_force = stretch_forces(quadratic, cubic, a)
    return np.asarray(np.sum((quadratic_force / 3 + cubic_force / 4) * a, axis=1))


def stretch_forces(quadratic: Array, cubic: Array, a: Array) -> tuple[Array, Array]:
    """Quadratic and cubic second-order forces, (n, m) each, at amplitudes a (n, m)."""
    n, m = a.shape
    products = (a[:, :, None] * a[:, None, :]).reshape(n, m * m)
    stiffness = (products @ cubic.reshape(m * m, m * m).T).reshape(n, m, m)
    return products @ quadratic.reshape(m, m * m).T, (stiffness @ a[:, :, None])[:, :, 0]


class ContactState(NamedTuple):
    """A contact at one time of a run: `speed` [m/s] of its last closing, `state` of its law."""

    closed: bool
    speed: float
    state: State


@dataclass(eq=False)
class System:
    """Modes, rows and contacts for time integration (`csrc/antiosc_march.h`).

    A system must not be changed after its first run.
    """

    #: omega, decay: (J,) frequencies [rad/s] and decay constants [1/s] of all bodies in turn
    omega: Array
    decay: Array
    #: (m, J) indentations of the p contacts in each mode, then tangential displacements (friction),
    #: then modal displacements, on which `quadratic` and `cubic` act
    beta: Array
    R: Array  # (m, m) residual compliance [m/N]
    #: breaks, loads, offsets: (K,) times [s], (K, J) modal loads, (K, m) gaps [m], linear in time
    breaks: Array
    loads: Array
    offsets: Array
    laws: Sequence[ContactLaw]  # p contact laws
    #: (p,) `CONTACT_RECORD`: friction and its rows, inertia, expected depth, preload, …; no laws
    contacts: NDArray[np.void]
    #: q, v: (J,) initial modal displacements and velocities
    q: Array
    v: Array
    contact_energy: float = 0.0  # energy [J] in the contacts at the start
    least_speed: float = 0.0  # least closing speed [m/s] from which damped laws take their damping
    #: states (p) of contacts that continue from an earlier run; None for other contacts
    contact_states: Sequence[ContactState | None] | None = None
    #: first-order modes of all bodies, if damping couples the modes of a body
    first: StackedModes | None = None
    #: (m, J) contributions of the rates of first-order modes to the rows, as `beta`
    gamma: Array | None = None
    #: quadratic, cubic: (s, s, s), (s, s, s, s) second-order forces of the last s rows
    quadratic: Array | None = None
    cubic: Array | None = None

    @property
    def arrays(self) -> tuple[Array, ...]:
        """All arrays of bodies and rows, beginning with those that determine modal responses."""
        rows = self.omega, self.decay, self.beta, self.R
        return *rows, self.breaks, self.loads, self.offsets, self.q, self.v

    @property
    def start_forces(self) -> Array:
        """Forces (p,) [N] at the start; a contact with a force is closed."""
        return self.contacts["preload"]

    @property
    def friction_rows(self) -> list[slice]:
        """Slice of the tangential rows of each contact."""
        rows = self.contacts[["first_tangential", "n_tangential"]].tolist()
        return [slice(first, first + count) for first, count in rows]

    def with_second_order_rows(self, beta: Array, quadratic: Array, cubic: Array) -> System:
        """The system with further rows beta (s, J), on which the second-order forces act."""
        count = len(beta)
        return replace(
            self,
            beta=np.vstack([self.beta, beta]),
            R=np.pad(self.R, (0, count)),
            offsets=np.pad(self.offsets, ((0, 0), (0, count))),
            quadratic=quadratic,
            cubic=cubic,
        )

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Mask (p,) of the contacts that are closed at the start."""
        if self.contact_states is None:
            return self.start_forces > 0
        return (self.start_forces > 0) | [
            contact is not None and contact.closed for contact in self.contact_states
        ]

    @property
    def has_damping(self) -> bool:
        """Whether a mode has damping."""
        return self.first is not None or bool(self.decay.any())

    @property
    def undamped(self) -> NDArray[np.bool_]:
        """Mask (J,) of the modes without damping."""
        if self.first is None:
            return self.decay == 0
        return self.first.undamped

    @cached_property
    def marched(self) -> System:
        """The system as integrated: itself, or in first-order modes if damping couples modes."""
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
    def least_speeds(self) -> Array:
        """Least closing speeds (p,) [m/s] that damped laws use for their damping."""
        return np.maximum(LEAST_SPEED_SHARE * self.contacts["expected_speed"], self.least_speed)

    def stretch_energy(self, q: Array) -> Array:
        """Second-order strain energy (n,) [J] at modal displacements q (n, J)."""
        if self.quadratic is None or self.cubic is None:
            return np.zeros(len(q))
        return stretch_energy(self.quadratic, self.cubic, q @ self.beta[-len(self.cubic) :].T)

    @cached_property
    def packed(self) -> PackedSystem:
        """The system as a structure for the C library."""
        return PackedSystem(self)

    def estimate_contact(self, mass: float, duration: float) -> float:
        """Estimate indentation and closing speed of the only contact; returns its duration [s]."""
        packed = self.packed
        (contact,) = packed.contacts
        contact.mass = mass
        estimate = library.library.aom_expect(byref(packed.system), 0, duration)
        packed.raise_law_error()
        if not isfinite(estimate.depth + estimate.speed + estimate.time):
            raise OverflowError("the depth of the contact")

        contact.expected_depth = estimate.depth
        contact.expected_speed = estimate.speed
        contact.slowest = max(LEAST_SPEED_SHARE * estimate.speed, self.least_speed)
        self.contacts = np.frombuffer(cast("bytes", packed.contacts), CONTACT_RECORD)
        return float(estimate.time)

    def __getstate__(self) -> dict[str, Any]:
        omitted = ("packed", "marched")
        return {name: value for name, value in self.__dict__.items() if name not in omitted}


class BodyModes(NamedTuple):
    """The J modes of one body in a system; None means zeros."""

    #: omega, decay: (J,) frequencies [rad/s] and decay constants [1/s]
    omega: Array
    decay: Array | None
    beta: Array  # (m, J) displacements in the rows of the system, or (J,) in its only row
    v: Array  # (J,) modal velocities at the start
    load: Array | None = None  # (J,) constant modal forces


def consecutive_slices(sizes: Iterable[int]) -> list[slice]:
    """Consecutive slices of these sizes, the first from 0."""
    return list(starmap(slice, pairwise(accumulate(sizes, initial=0))))


def system_of_bodies(
    bodies: Sequence[BodyModes],
    laws: Sequence[ContactLaw],
    R: Array,
    gap: float = 0.0,
    first: StackedModes | None = None,
) -> System:
    """The system of several bodies with m rows, the first being the contacts; R (m, m): residual
    compliance [m/N]; `gap` [m] of all rows."""
    spans = consecutive_slices([body.omega.size for body in bodies])
    size, m = spans[-1].stop, len(R)

    omega, decay, q, v = np.zeros((4, size))
    beta = np.zeros((m, size))
    loads = np.zeros((1, size))
    gaps = np.full((1, m), gap)

    for body, span in zip(bodies, spans, strict=True):
        omega[span] = body.omega
        beta[:, span] = body.beta
        v[span] = body.v
        if body.decay is not None:
            decay[span] = body.decay
        if body.load is not None:
            loads[0, span] = body.load

    contacts = np.zeros(len(laws), CONTACT_RECORD)
    contacts["first_tangential"] = m
    times = _START_TIME, loads, gaps
    return System(omega, decay, beta, R, *times, laws, contacts, q, v, first=first)


Key = tuple[int, int, int, bytes]


class PackedSystem:
    """A system for the C library; systems of equal `key` have equal sizes and modal responses."""

    def __init__(self, system: System) -> None:
        s = system
        p = len(s.laws)
        m, size = s.beta.shape
        breaks = s.breaks.size
        self.numbers = [np.ascontiguousarray(array, dtype=float) for array in s.arrays]
        bodies = b"".join([array.tobytes() for array in self.numbers[:4]])

        gamma = None

        if s.gamma is not None:
            gamma = library.address(s.gamma)
            bodies += s.gamma.tobytes()
            self.gamma = s.gamma  # it lasts as long as the addresses

        if s.cubic is not None:  # the memory of the march is laid out for them
            bodies += len(s.cubic).to_bytes(2, "little")
        self.key: Key = p, m, size, bodies

        *addresses, q, v = map(library.address, self.numbers)

        self.laws = [packed_law(law) for law in s.laws]
        self.contacts = (library.CContact * p).from_buffer_copy(cast("bytes", s.contacts))
        for contact, (law, _) in zip(self.contacts, self.laws, strict=True):
            contact.law = law
            contact.slowest = max(LEAST_SPEED_SHARE * contact.expected_speed, s.least_speed)

        self.states: list[Array] = []  # of contacts that go on; they must stay in memory
        for c, earlier in enumerate(s.contact_states or ()):
            if earlier is not None:
                origin = s.laws[c].origin(earlier.state)
                self.states.append(np.array([*earlier.state, origin, 0.0], dtype=float))
                self.contacts[c].state = library.address(self.states[-1])
                self.contacts[c].closed = earlier.closed

        self.tensors = [np.ascontiguousarray(x) for x in (s.quadratic, s.cubic) if x is not None]
        stretch = 0 if s.cubic is None else len(s.cubic), *map(library.address, self.tensors)
        self.system = library.CSystem(
            size,
            m,
            p,
            breaks,
            *addresses,
            addressof(self.contacts),
            q,
            v,
            s.contact_energy,
            gamma,
            *stretch,
        )

    def raise_law_error(self) -> None:
        """Raise the error of a law that is written in Python, if one failed."""
        for _, memory in self.laws:
            raise_error(memory)
