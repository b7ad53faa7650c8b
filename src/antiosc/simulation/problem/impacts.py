"""Impacts of two bodies as rows of arrays, which the march solves in one call."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from ctypes import byref, c_int64, c_void_p
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from antiosc.base import checks, march, process
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError
from antiosc.contact import ContactLaw
from antiosc.contact.base import Compiled, is_compiled
from antiosc.models.body import LinearBody
from antiosc.models.motion import Motion
from antiosc.simulation.bodies.bodies import may_turn
from antiosc.simulation.bodies.impactors import RigidMass, Sphere
from antiosc.simulation.problem.scales import freed
from antiosc.simulation.problem.scene_parts import LAW
from antiosc.simulation.problem.two_bodies import Pair, pair

IMPACT = cast("np.dtype[np.void]", np.dtype(march.Impact))
OUTCOME = cast("np.dtype[np.void]", np.dtype(march.Outcome))

#: Modes times attempted steps between two looks for an interrupt: some 0.05 s.
_AT_ONCE = 4_000_000
#: Least nodes that a call may write.
_NODES = 200_000


class Impact(NamedTuple):
    """An impact as `simulate` and `pose` take it."""

    model: LinearBody
    impactor: LinearBody
    contact: ContactLaw
    duration: float
    initial_velocity: float | Motion = 0.0
    gravity: float | Sequence[float] = 0.0
    gap: float | None = None

    def group(self) -> tuple[object, ...] | None:
        """Equal for impacts that can be rows of the same arrays; None for one that cannot."""
        if not is_compiled(self.contact) or _coupled(self.model) or _coupled(self.impactor):
            return None
        still = isinstance(self.gravity, int | float) and self.gravity == 0
        rigid = still and type(self.impactor) in (RigidMass, Sphere)
        moving = self.initial_velocity
        speed = moving if isinstance(moving, int | float) else id(moving)
        return id(self.model), 0 if rigid else (id(self.impactor), id(self.gravity)), speed


def _coupled(body: LinearBody) -> bool:
    """Whether damping couples the modes of a body; False for what is none, which `pair` tells."""
    if type(body) in (RigidMass, Sphere) or not callable(getattr(body, "modal", None)):
        return False
    try:
        return getattr(body.modal(), "damping", None) is not None
    except AntioscError:
        return False


class Rows:
    """Impacts of one group: the two bodies of the first, and what the march takes.

    Attributes
    ----------
    pair : the bodies of the first impact; those of the others differ in a rigid impactor alone.
    laws : without the half-space compliance of the patches.
    given : (S,) `aom_impact`.
    """

    def __init__(
        self, impacts: Sequence[Impact], tol: float, max_contacts: int, max_steps: int
    ) -> None:
        model, first, _, _, velocity, gravity, _ = impacts[0]
        self.pair = made = pair(model, first, velocity, gravity)
        count, size = len(impacts), made.omega.size
        beta, v = np.tile(made.beta, (count, 1)), np.tile(made.v, (count, 1))
        mobility = np.full(count, sum(made.mobilities))
        if any(each.impactor is not first for each in impacts):  # rigid ones, see `group`
            strikers = [cast("RigidMass | Sphere", each.impactor) for each in impacts]
            b = 1 / np.sqrt(np.array([each.mass for each in strikers]))
            beta[:, -1] = -b
            v[:, -1] = -(np.array([each.velocity for each in strikers]) * b / (b * b))
            mobility = made.mobilities[0] + b * b
        self.laws = cast("list[Compiled]", _freed([each.contact for each in impacts], made.local))
        self.given = given = np.zeros(count, IMPACT)
        self._held = [made.omega, made.decay, beta, v, made.load, *_turning(made)]
        omega, decay, rows, speeds, load, *turning = map(march.address, self._held)
        each = 8 * size * np.arange(count, dtype=np.uintp)
        given["n_modes"], given["omega"], given["decay"] = size, omega, decay
        given["beta"], given["v"], given["load"] = rows + each, speeds + each, load
        if turning:
            given["n_turning"], given["turning"] = len(self._held[-1]), turning[0]
        kernels = [law.kernel[0] for law in self.laws]
        for name in ("kind", "n_params", "params"):
            given["law"][name] = [getattr(kernel, name) for kernel in kernels]
        given["residual"] = made.r
        given["mass"] = np.where(mobility > 0, 1 / np.where(mobility > 0, mobility, 1.0), 1.0)
        own = made.bodies[1].gap
        given["gap"] = [
            own if each.gap is None else checks.nonnegative("gap", each.gap, "m")
            for each in impacts
        ]
        given["duration"] = [checks.positive("duration", each.duration, "s") for each in impacts]
        made.check_span(float(given["duration"].max()))
        given["rel_tol"], given["max_contacts"], given["max_steps"] = tol, max_contacts, max_steps

    def solved(
        self, done: Callable[[int], None]
    ) -> tuple[NDArray[np.void], list[tuple[Array, Array]]]:
        """The outcomes (`aom_outcome`), and nodes [s] and forces [N] of the contacts of each.

        `done` is told how many are solved, now and then.
        """
        given, size = self.given, self.pair.omega.size
        space = _space(size)
        outcomes, count = np.zeros(len(given), OUTCOME), c_int64()
        pulses: list[tuple[Array, Array]] = []
        arguments = (
            space.batch, len(given), march.address(given), march.address(outcomes),
            byref(space.nodes), max(_AT_ONCE // (size + 20), 16), byref(count),
        )  # fmt: skip
        answer = march.PAUSED
        while answer in (march.PAUSED, march.FULL):
            answer = march.library.aom_batch_solve(*arguments)
            pulses += space.taken(outcomes["n_nodes"][len(pulses) : count.value])
            done(count.value)
        _spaces.append(space)
        return outcomes, pulses


def _freed(contacts: Iterable[ContactLaw], local: float) -> list[ContactLaw]:
    """The laws as the march takes them."""
    found: dict[int, ContactLaw] = {}
    laws = []
    for contact in contacts:
        if id(contact) not in found:
            checks.instance("contact", contact, ContactLaw, LAW)
            found[id(contact)] = freed(contact, local, "structure", "impactor")[0]
        laws.append(found[id(contact)])
    return laws


def _turning(made: Pair) -> list[Array]:
    """Rotation vectors (n, 3, J) by the modes of the bodies that may turn, [] without one."""
    found, begin = [], 0
    for body in made.bodies:
        span = slice(begin, begin + body.omega.size)
        begin = span.stop
        if may_turn(body):
            turning = np.zeros((3, made.omega.size))
            turning[:, span] = body.rotation(np.eye(body.omega.size)).T
            found.append(turning)
    return [np.array(found)] if found else []


class _Space:
    """Memory that the march solves impacts with so many modes in."""

    def __init__(self, size: int) -> None:
        need = march.library.aom_batch_size(size)
        process.require(need, f"an impact with {size} modes", "use fewer of them")
        self.memory = np.empty(-(-need // 16), dtype=np.complex128)
        room = max(march.library.aom_batch_nodes(size), _NODES)
        self.time, self.force = np.empty(room), np.empty(room)
        self.nodes = march.PulseNodes(room, 0, *map(march.address, (self.time, self.force)))
        self.batch, self.size = c_void_p(), -1

    def renew(self, size: int) -> bool:
        """Be for other impacts; False if there is too little memory.

        With as many modes as before the march goes on with the responses that it has.
        """
        at = march.address(self.memory), self.memory.nbytes, byref(self.batch)
        self.nodes.n_nodes = 0
        if size != self.size:
            room = int(march.library.aom_batch_nodes(size)) <= self.time.size
            made = room and march.library.aom_batch_create(size, *at) == march.DONE
            self.size = size if made else -1
        return size == self.size

    def taken(self, counts: NDArray[np.int64]) -> list[tuple[Array, Array]]:
        """The nodes that were written, so many of each impact."""
        time, force = (each[: self.nodes.n_nodes].copy() for each in (self.time, self.force))
        self.nodes.n_nodes = 0
        ends = np.cumsum(counts).tolist()
        begins = [0, *ends[:-1]]
        return [(time[a:b], force[a:b]) for a, b in zip(begins, ends, strict=True)]


_spaces: list[_Space] = []


def _space(size: int) -> _Space:
    """Memory of an earlier call, if it is enough; taken out, so that no other thread has it."""
    while _spaces:
        try:
            found = _spaces.pop()
        except IndexError:  # another thread took it
            break
        if found.renew(size):
            return found
    found = _Space(size)
    found.renew(size)
    return found
