"""The march from Python: the memory that it works in, and what it returns."""

from __future__ import annotations

from ctypes import addressof, byref, c_void_p
from dataclasses import dataclass
from itertools import accumulate
from math import prod
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from antiosc.base import process
from antiosc.base.errors import InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.contact.base import is_compiled
from antiosc.engine.system import Given, Kept, System

Array = NDArray[np.float64]

_RECORDS = library.Record * 3
_FIRST = 1024  # nodes of the first buffer; a full one becomes four times as large
# numbers that the march may read and write between two looks for an interrupt: some 0.1 s
_AT_ONCE = 100_000_000
#: Bytes of states that a run keeps; a longer one keeps those of every 2nd, 4th ... step.
STATES = 1 << 27
SHORTER = "shorten the duration, or use fewer contacts or anti-oscillators"


@dataclass(eq=False)
class Run:
    """One run: values at 0, h/2 and h of every step, and the events.

    Attributes
    ----------
    time : (2 n + 1,); force, depth : (2 n + 1, m).
    states : (n // every + 1, 2, J) at the start of the steps 0, every, 2 every ...; None if not
        kept. `antiosc.impact.states` finds those in between.
    events : (., 4) time, contact, branch that begins, closing speed.
    exits : (., 13) `aom_exit`: where a contact goes over to another branch, as gradients need it;
        kept with the states.
    answer : why the march stopped.
    steps : taken; `attempts` those and the ones that were tried and given up for shorter ones,
        `refused` because of their error.
    gained : energy [J] of the bodies beyond what was given, at most; `highest` what there was.
    """

    time: Array
    force: Array
    depth: Array
    states: Array | None
    events: Array
    answer: int
    steps: int
    attempts: int
    touches: int
    highest: float
    refused: int = 0
    gained: float = 0.0
    work: float = 0.0
    every: int = 1
    exits: Array | None = None

    def kept(self, system: System, t: float) -> list[Kept | None]:
        """Contact states (p) at a time [s], from which a run continues; None before the first
        touch.
        """
        last = int(np.searchsorted(self.time, t * (1 + 1e-12), side="right")) - 1
        found = list(system.kept or [None] * len(system.laws))
        for c, law in enumerate(system.laws):
            one, begin = found[c], 0
            if one is None and system.closed[c]:
                one = Kept(True, 0.0, law.touch(0.0))
            own = self.events[:, 1] == c
            for time, _, branch, speed in self.events[own & (self.events[:, 0] <= t)].tolist():
                node = int(np.searchsorted(self.time, time))
                if branch != library.APART:
                    state = law.touch(speed, None if one is None else one.state)
                    one, begin = Kept(True, speed, state), node
                elif one is not None:
                    one = Kept(False, one.speed, self._advanced(law, one.state, c, begin, node))
            if one is not None and one.closed:
                one = one._replace(state=self._advanced(law, one.state, c, begin, last))
            found[c] = one
        return found

    def _advanced(self, law: ContactLaw, state: State, c: int, first: int, last: int) -> State:
        """The law state of contact c, closed throughout, after the steps between two nodes."""
        if is_compiled(law):  # of the deepest indentation alone
            return law.advance(float(self.depth[first : last + 1, c].max()), 0.0, state)
        for n in range(first + first % 2, last - 1, 2):
            d0, d1, d2 = self.depth[n : n + 3, c].tolist()
            h = float(self.time[n + 2] - self.time[n])
            rate = (d0 - 4 * d1 + 3 * d2) / h if h > 0 else 0.0
            state = law.advance(d2, rate, state)
        return state


class Buffers:
    """Arrays into which a run is written: times, forces, depths, states, events."""

    def __init__(self, record: library.Record, p: int, m: int, size: int) -> None:
        self.record, self.shape = record, (p, m, size)
        self.arrays: tuple[Array, ...] = ()
        self.nbytes = 0

    def keep(self, states: bool) -> None:
        """Choose whether states and exits are written; all arrays are reallocated if they lack
        space.
        """
        r = self.record
        if states == (r.states is not None):
            return
        held = states and self.arrays and len(self.arrays[3])
        r.states, r.exits = map(library.address, self.arrays[3::2]) if held else (None, None)
        if states and not held:
            r.max_nodes = 0

    def enlarge(self, keep: bool) -> None:
        """Enlarge the arrays; with `keep` also the states, of every second node where there are
        many.
        """
        r, (p, m, size) = self.record, self.shape
        nodes = r.max_nodes
        full = r.n_events + 1 > r.max_events or (keep and r.n_exits + 1 > r.max_exits)
        if r.n_nodes + 2 > nodes or full:
            nodes = max(4 * nodes, _FIRST)
        most = max(STATES // (16 * max(size, 1)), 4)
        if keep and self.arrays and r.n_states >= most - 2:
            self.thin()
        need = 8 * nodes * (2 * m + 5) + 16 * size * min(nodes // 2, most)
        process.require(need, f"a run of {p} contacts", SHORTER)
        arrays = (
            np.empty(nodes),
            np.empty((nodes, m)),
            np.empty((nodes, m)),
            np.empty((min(nodes // 2 + 2, most) if keep else 0, 2, size)),
            np.empty((nodes + p + 1, 4)),
            np.empty((nodes // 2 + p + 1 if keep else 0, library.EXIT)),
        )
        written = r.n_nodes, r.n_nodes, r.n_nodes, r.n_states, r.n_events, r.n_exits
        for new, old, count in zip(arrays, self.arrays, written, strict=False):
            new[:count] = old[:count]
        self.arrays, self.nbytes = arrays, sum([each.nbytes for each in arrays])
        r.max_nodes, r.max_events, r.max_exits = nodes, len(arrays[4]), len(arrays[5])
        r.max_states = len(arrays[3]) - 1  # and the state of the end
        r.time, r.force, r.depth, r.states, r.events, r.exits = map(library.address, arrays)
        if not keep:
            r.states = r.exits = None

    def thin(self) -> None:
        """Keep every other one of the stored states."""
        r, states = self.record, self.arrays[3]
        half = states[: r.n_states : 2].copy()
        states[: len(half)] = half
        r.n_states, r.every = len(half), 2 * r.every

    def run(self, answer: int, told: library.Summary, keep: bool) -> Run:
        """A copy of what was written, as a run."""
        r, (time, force, depth, states, events, exits) = self.record, self.arrays
        while keep and 16 * r.n_states * self.shape[2] > STATES:
            self.thin()
        nodes = r.n_nodes
        return Run(
            time=time[:nodes].copy(),
            force=force[:nodes].copy(),
            depth=depth[:nodes].copy(),
            states=states[: r.n_states].copy() if keep else None,
            events=events[: r.n_events].copy(),
            answer=answer,
            steps=told.steps,
            attempts=told.attempts,
            touches=told.touches,
            highest=told.highest,
            refused=told.refused,
            gained=told.gained,
            work=told.work,
            every=r.every,
            exits=exits[: r.n_exits].copy() if keep else None,
        )


class Workspace:
    """A stepper of the C library with its memory, and the arrays of its runs.

    It holds the responses of the steps that earlier runs of the same bodies and rows used.
    """

    def __init__(self, given: Given) -> None:
        system = given.system
        self.shape = system.n_contacts, system.n_rows, system.n_modes
        p, _, modes = self.shape
        size = library.library.aom_memory_size(byref(system))
        process.require(size, f"a run with {p} contacts and {modes} modes", "use fewer of them")
        self.memory = np.empty(-(-size // 16), dtype=np.complex128)
        self.stepper = c_void_p()
        self.records = _RECORDS()
        self.buffers = [Buffers(record, *self.shape) for record in self.records]
        self.work: Array | None = None  # of gradients
        self.renew(given)
        _spaces.add(self)

    @property
    def nbytes(self) -> int:
        """Bytes of memory in all."""
        own = self.memory.nbytes + (0 if self.work is None else self.work.nbytes)
        return own + sum([each.nbytes for each in self.buffers])

    def fits(self, given: Given) -> bool:
        """Whether another system has as many modes and rows, and needs no more memory."""
        system = given.system
        same = self.shape == (system.n_contacts, system.n_rows, system.n_modes)
        need = library.library.aom_memory_size(byref(system)) if same else 0
        return same and int(need) <= self.memory.nbytes

    def renew(self, given: Given) -> None:
        """Use the memory for another system of as many modes and rows: allocation costs more than a
        run.
        """
        answer = library.library.aom_create(
            byref(given.system),
            library.address(self.memory),
            self.memory.nbytes,
            byref(self.stepper),
        )
        _check(answer)


Key = tuple[int, int, int, bytes]  # contacts, rows, modes, and the numbers of the bodies

_spaces: WeakSet[Workspace] = WeakSet()  # all of them, those in use too
_kept: list[
    tuple[Key, Workspace]
] = []  # the newest first; threads with the same bodies have one each
_MOST_KEPT, _LARGEST_KEPT = 8, 1 << 23  # of them; bytes of one


def _space(key: Key, given: Given) -> Workspace:
    """A workspace for a system, with stored step responses of its bodies if there are any.

    It is taken out of the store, so that no other thread fills it meanwhile.
    """
    for one in _kept.copy():
        if one[0] == key and _taken(one):
            return one[1]
    if len(_spaces) >= _MOST_KEPT:
        oldest = _kept[-1:]
        if oldest and _taken(oldest[0]) and oldest[0][1].fits(given):
            oldest[0][1].renew(given)
            return oldest[0][1]
    return Workspace(given)


def _taken(one: tuple[Key, Workspace]) -> bool:
    """Remove a workspace from the store; False if another thread has taken it."""
    try:
        _kept.remove(one)
    except ValueError:
        return False
    return True


def _keep(key: Key, space: Workspace) -> None:
    """Return a workspace to the store for later runs."""
    if space.nbytes <= _LARGEST_KEPT:
        _kept.insert(0, (key, space))
        del _kept[_MOST_KEPT:]


def _check(answer: int) -> None:
    """InputError if the C library refuses its input."""
    if answer > library.LAW_FAILED:
        name = library.library.aom_status_name(answer).decode()
        raise InputError(
            f"the march refuses the system ({name}): its numbers must be finite, its laws and"
            f" scales in their range (csrc/antiosc_march.h)."
        )


def solve(
    system: System, options: library.Options, keep: bool = True
) -> tuple[Run, library.Solution]:
    """The run with these options, or the finest of several with the estimates of its errors."""
    if system.first is not None:
        system = system.marched
    given = system.packed
    p, (m, size) = len(system.laws), system.beta.shape
    key = (p, m, size, given.bodies)
    space = _space(key, given)
    solution, buffers = library.Solution(), space.buffers
    for each in buffers:
        each.keep(keep)
    arguments = (
        space.stepper, byref(given.system), byref(options), byref(solution),
        addressof(space.records), max(_AT_ONCE // (50 * (m + 1) * (size + m + 20)), 16),
    )  # fmt: skip
    answer = library.PAUSED
    while answer in (library.PAUSED, library.FULL):
        answer = library.library.aom_solve(*arguments)
        if answer == library.FULL:
            buffers[solution.present].enlarge(keep)
    _check(answer)
    if answer == library.LAW_FAILED:
        _keep(key, space)
        given.failed()
    found = buffers[solution.best].run(solution.answer, solution.summary, keep)
    _keep(key, space)
    return found, solution


def run(
    system: System,
    duration: float,
    share: float,
    *,
    scale: float = 0.0,
    fine: float,
    step: float | None = None,
    keep: bool = True,
    max_contacts: int = 10_000,
    max_steps: int = 1_000_000,
) -> Run:
    """Integrate over [0, duration] with forces to `share` of their scale (0: the scale so far).

    The steps under contact are halvings of the longest; with `step` [s] given they are that step,
    or halvings of it where the forces need them.
    """
    options = library.Options(duration, share, scale, step or 0.0, fine, max_contacts, max_steps, 1)
    return solve(system, options, keep)[0]


@dataclass(eq=False)
class Slopes:
    """Derivatives of a goal by the numbers of a `System`, of the same shapes.

    `square` (J,): by omega^2; `decay`: 0 without damping; `laws` (p, 3): by the first parameters
    of the laws; `friction` (p, 2) by its coefficient and the tangential stiffness; `pressed` (p,):
    by the forces at the start, as if these followed from nothing; `gamma`: of size 0 without it.
    """

    square: Array
    decay: Array
    beta: Array
    residual: Array
    loads: Array
    offsets: Array
    laws: Array
    friction: Array
    q: Array
    v: Array
    pressed: Array
    gamma: Array


def gradient(
    system: System,
    found: Run,
    states: Array,
    readings: NDArray[np.void],
    weights: Array,
    force: Array,
    time: Array,
) -> tuple[Slopes, float, int]:
    """Derivatives of a goal by all numbers of a system, the grazing, and the status.

    The grazing is the least speed at which a contact touches or parts, over the largest.

    Parameters
    ----------
    states : (n + 1, 2, J) at the edges of all steps of the run.
    readings, weights : of `library.READING`, and (., 2 J + m): `aom_goal`.
    force, time : (2 n + 1, m), (n + 1,) derivatives by the forces at nodes and the times of edges.
    """
    given, (m, size) = system.packed, system.beta.shape
    key = (len(system.laws), m, size, given.bodies)
    space = _space(key, given)
    options = library.Options(float(found.time[-1]), 1.0, 0.0, 0.0, 0.0, 0, 0, 1)
    _check(library.library.aom_start(space.stepper, byref(given.system), byref(options)))
    arrays = [found.time, found.force, found.depth, states, found.exits, readings, weights, force]
    given_arrays = [np.ascontiguousarray(each) for each in (*arrays, time)]
    at = [library.address(each) for each in given_arrays]
    run = library.Record(
        n_nodes=found.time.size, n_states=len(states), n_exits=len(given_arrays[4]), every=1,
        time=at[0], force=at[1], depth=at[2], states=at[3], exits=at[4],
    )  # fmt: skip
    goal = library.Goal(len(readings), *at[5:])
    s, laws = system, (len(system.laws), library.LAW_SLOPES)
    like = [s.omega, s.decay, s.beta, s.R, s.loads, s.offsets, s.slip, s.q, s.v, s.pressed]
    like.append(np.zeros(0) if s.gamma is None else s.gamma)
    shapes: list[tuple[int, ...]] = [each.shape for each in like]
    shapes.insert(6, laws)
    ends = [0, *accumulate([prod(shape) for shape in shapes])]
    block = np.zeros(ends[-1])
    out = [block[a:b].reshape(n) for a, b, n in zip(ends, ends[1:], shapes, strict=False)]
    begin = library.address(block)
    slopes = library.Slopes(*[begin + 8 * end for end in ends[:-1]])
    if s.gamma is None:
        slopes.gamma = None
        if not s.decay.any():
            slopes.decay = None
    if space.work is None:
        space.work = np.empty(library.library.aom_gradient_size(space.stepper) // 8 + 1)
    work = library.address(space.work), space.work.nbytes
    answer = library.library.aom_gradient(
        space.stepper, byref(run), byref(goal), byref(slopes), *work
    )
    _keep(key, space)
    return Slopes(*out), slopes.grazing, answer
