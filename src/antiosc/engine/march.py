"""Time integration by the C library: memory, runs, and steps refined until two runs agree."""

from __future__ import annotations

from ctypes import addressof, byref, c_void_p
from dataclasses import dataclass
from weakref import WeakSet

import numpy as np

from antiosc.base import process
from antiosc.base._types import NDArray
from antiosc.base.errors import InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.contact.base import is_compiled
from antiosc.engine.system import ContactState, Key, PackedSystem, System

Array = NDArray[np.float64]

_RECORDS = library.CRecord * 3  # the runs with three steps of which the last two are compared
_FIRST_NODES = 1024  # nodes of the first buffer; a full one becomes four times as large
TOUCH_RESOLUTION = 200  # touches closer than the expected contact time over this count as one
# numbers that the march may read and write between two looks for an interrupt: some 0.1 s
_NODES_AT_ONCE = 100_000_000
#: Most bytes of states in a run; a longer run keeps the states of every 2nd, 4th … step.
MOST_STATE_BYTES = 1 << 27
SHORTER_REMEDY = "shorten the duration, or use fewer contacts or anti-oscillators"


@dataclass(eq=False)
class Run:
    """One run: values at 0, h/2 and h of every step, and the events."""

    time: Array  # (2 n + 1,) [s]
    force: Array  # (2 n + 1, m) of each row of the system [N]
    depth: Array  # (2 n + 1, m) indentations, or displacements of other rows [m]
    states: Array  # (n // every + 1, 2, J) modal q and q' at the start of every `every`th step
    events: Array  # (., 4) time [s], contact number, branch that begins (0: apart), closing speed
    answer: int  # status of the C library: why the march stopped
    steps: int  # number n of steps
    attempts: int  # number of steps tried, including those given up for shorter ones
    touches: int  # number of touches of all contacts
    refused: int = 0  # number of steps given up because of their error
    every: int = 1  # steps from one of `states` to the next

    def contact_states(self, system: System, t: float) -> list[ContactState | None]:
        """States (p) of the contacts at t [s], to continue a run; None before the first touch."""
        last = int(np.searchsorted(self.time, t * (1 + 1e-12), side="right")) - 1
        states = list(system.contact_states or [None] * len(system.laws))
        for c, law in enumerate(system.laws):
            contact = states[c]
            start_node = 0
            if contact is None and system.closed[c]:
                contact = ContactState(True, 0.0, law.touch(0.0))
            until = (self.events[:, 1] == c) & (self.events[:, 0] <= t)
            for time, _, branch, speed in self.events[until].tolist():
                node = int(np.searchsorted(self.time, time))
                if branch != library.APART:
                    state = law.touch(speed, None if contact is None else contact.state)
                    contact = ContactState(True, speed, state)
                    start_node = node
                elif contact is not None:
                    state = self._advanced(law, contact.state, c, start_node, node)
                    contact = ContactState(False, contact.speed, state)
            if contact is not None and contact.closed:
                state = self._advanced(law, contact.state, c, start_node, last)
                contact = contact._replace(state=state)
            states[c] = contact
        return states

    def _advanced(self, law: ContactLaw, state: State, c: int, first: int, last: int) -> State:
        """Law state of contact c, which stays closed, after the steps between two time nodes."""
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

    def __init__(self, record: library.CRecord, p: int, m: int, size: int) -> None:
        self.record = record
        self.shape = (p, m, size)
        self.arrays: tuple[Array, ...] = ()
        self.nbytes = 0

    def enlarge(self) -> None:
        """Enlarge the arrays; states are thinned if there are too many."""
        r = self.record
        p, m, size = self.shape
        nodes = r.max_nodes
        if r.n_nodes + 2 > nodes or r.n_events + 1 > r.max_events:
            nodes = max(4 * nodes, _FIRST_NODES)
        limit = max(MOST_STATE_BYTES // (16 * max(size, 1)), 4)
        if self.arrays and r.n_states >= limit - 2:
            self.thin()
        need = 8 * nodes * (2 * m + 5) + 16 * size * min(nodes // 2, limit)
        process.require_memory(need, f"a run of {p} contacts", SHORTER_REMEDY)
        arrays = (
            np.empty(nodes),
            np.empty((nodes, m)),
            np.empty((nodes, m)),
            np.empty((min(nodes // 2 + 2, limit), 2, size)),
            np.empty((nodes + p + 1, 4)),
        )
        written = r.n_nodes, r.n_nodes, r.n_nodes, r.n_states, r.n_events
        for new_array, old_array, count in zip(arrays, self.arrays, written, strict=False):
            new_array[:count] = old_array[:count]
        self.arrays = arrays
        self.nbytes = sum([array.nbytes for array in arrays])
        r.max_nodes = nodes
        r.max_events = len(arrays[4])
        r.max_states = len(arrays[3]) - 1  # and the state of the end
        r.time, r.force, r.depth, r.states, r.events = map(library.address, arrays)

    def thin(self) -> None:
        """Drop every second stored state."""
        r = self.record
        states = self.arrays[3]
        half = states[: r.n_states : 2].copy()
        states[: len(half)] = half
        r.n_states = len(half)
        r.every = 2 * r.every

    def run(self, answer: int, summary: library.CSummary) -> Run:
        """Copy the written values into a `Run`."""
        r = self.record
        time, force, depth, states, events = self.arrays
        while 16 * r.n_states * self.shape[2] > MOST_STATE_BYTES:
            self.thin()
        nodes = r.n_nodes
        return Run(
            time=time[:nodes].copy(),
            force=force[:nodes].copy(),
            depth=depth[:nodes].copy(),
            states=states[: r.n_states].copy(),
            events=events[: r.n_events].copy(),
            answer=answer,
            steps=summary.steps,
            attempts=summary.attempts,
            touches=summary.touches,
            refused=summary.refused,
            every=r.every,
        )


class Workspace:
    """Memory of the C library for runs: stepper, stored step responses, and recorded runs."""

    def __init__(self, packed: PackedSystem) -> None:
        system = packed.system
        self.shape = system.n_contacts, system.n_rows, system.n_modes
        p, _, modes = self.shape
        size = library.library.aom_memory_size(byref(system))
        process.require_memory(
            size, f"a run with {p} contacts and {modes} modes", "use fewer of them"
        )
        self.memory = np.empty(-(-size // 16), dtype=np.complex128)
        self.stepper = c_void_p()
        self.records = _RECORDS()
        self.buffers = [Buffers(record, *self.shape) for record in self.records]
        self.renew(packed)
        _all_workspaces.add(self)

    @property
    def nbytes(self) -> int:
        """Total memory in bytes."""
        return self.memory.nbytes + sum([buffers.nbytes for buffers in self.buffers])

    def fits(self, packed: PackedSystem) -> bool:
        """Whether another system has as many modes and rows, and needs no more memory."""
        system = packed.system
        same_shape = self.shape == (system.n_contacts, system.n_rows, system.n_modes)
        need = library.library.aom_memory_size(byref(system)) if same_shape else 0
        return same_shape and int(need) <= self.memory.nbytes

    def renew(self, packed: PackedSystem) -> None:
        """Reuse the memory for another system of this size, as allocation costs more than a run."""
        status = library.library.aom_create(
            byref(packed.system),
            library.address(self.memory),
            self.memory.nbytes,
            byref(self.stepper),
        )
        check_status(status)


#: All workspaces, including those in use.
_all_workspaces: WeakSet[Workspace] = WeakSet()
#: Stored workspaces, the newest first; threads with the same bodies have one each.
_stored_workspaces: list[tuple[Key, Workspace]] = []
#: Number of stored workspaces at most, and the size in bytes of the largest one.
_MAX_STORED = 8
_MAX_STORED_BYTES = 1 << 23


def take_workspace(packed: PackedSystem) -> Workspace:
    """A workspace for a system, with stored step responses of its bodies if there are any."""
    for entry in _stored_workspaces.copy():
        if entry[0] == packed.key and _take_entry(entry):
            return entry[1]
    if len(_all_workspaces) >= _MAX_STORED:
        oldest = _stored_workspaces[-1:]
        if oldest and _take_entry(oldest[0]) and oldest[0][1].fits(packed):
            oldest[0][1].renew(packed)
            return oldest[0][1]
    return Workspace(packed)


def _take_entry(entry: tuple[Key, Workspace]) -> bool:
    """Remove a workspace from the store; False if another thread was faster."""
    try:
        _stored_workspaces.remove(entry)
    except ValueError:
        return False
    return True


def return_workspace(packed: PackedSystem, workspace: Workspace) -> None:
    """Return a workspace to the store for later runs."""
    if workspace.nbytes <= _MAX_STORED_BYTES:
        _stored_workspaces.insert(0, (packed.key, workspace))
        del _stored_workspaces[_MAX_STORED:]


def check_status(status: int) -> None:
    """InputError if the C library refuses its input."""
    if status > library.LAW_FAILED:
        name = library.library.aom_status_name(status).decode()
        raise InputError(
            f"the march refuses the system ({name}): its numbers must be finite, its laws and"
            f" scales in their range (csrc/antiosc_march.h)."
        )


def solve(system: System, options: library.COptions) -> tuple[Run, library.CSolution]:
    """(the run with these options, or the finest of several runs; its error estimates)."""
    if system.first is not None:
        system = system.marched
    packed = system.packed
    m, size = system.beta.shape
    workspace = take_workspace(packed)
    solution = library.CSolution()
    buffers = workspace.buffers
    arguments = (
        workspace.stepper,
        byref(packed.system),
        byref(options),
        byref(solution),
        addressof(workspace.records),
        max(_NODES_AT_ONCE // (50 * (m + 1) * (size + m + 20)), 16),
    )
    status = library.PAUSED
    while status in (library.PAUSED, library.FULL):
        status = library.library.aom_solve(*arguments)
        if status == library.FULL:
            buffers[solution.present].enlarge()
    check_status(status)
    if status == library.LAW_FAILED:
        return_workspace(packed, workspace)
        packed.raise_law_error()
    best = buffers[solution.best].run(solution.answer, solution.summary)
    return_workspace(packed, workspace)
    return best, solution


def run(
    system: System,
    duration: float,
    step_tol: float,
    *,
    scale: float = 0.0,
    fine: float,
    step: float | None = None,
    max_contacts: int = 10_000,
    max_steps: int = 1_000_000,
) -> Run:
    """Integrate over [0, duration] once, with steps of at most `step` [s] in contact, if given.

    The error of the contact forces in a step is at most `step_tol` times `scale` [N]; with 0 the
    scale of a contact is its largest force so far. Touches closer than `fine` [s] count as one.
    """
    options = library.COptions(
        duration, step_tol, scale, step or 0.0, fine, max_contacts, max_steps, 1
    )
    return solve(system, options)[0]


@dataclass(eq=False)
class Converged:
    """The finest run, its tolerance in a step (or its step [s]), its errors, and the time up to
    which the last two runs agree."""

    run: Run
    step_tol: float
    force_error: float  # relative (L2 norm, impulse); inf: unknown, 0: not estimated
    peak_error: float  # relative, `force_error` at least
    agreed_until: float  # [s]


def stop_text(answer: int, t: float, max_contacts: int, max_steps: int) -> str:
    """Reason why the integration stopped at t [s] before the end; "" if it did not."""
    chatter = f"more than {max_contacts} contacts (chatter); shorten the duration"
    reasons = {
        library.TOO_MANY_CONTACTS: f"{chatter} or raise max_contacts",
        library.TOO_MANY_STEPS: f"more than {max_steps} steps; shorten the duration, use a larger"
        " step or tol, or raise max_steps",
        library.GREW: "the bodies gained energy; use a smaller step or tol",
        library.STUCK: "no step is small enough for the contact forces there; check the laws'"
        " stiffness against the bodies' masses",
    }
    return f"stopped at {t:g} s: {reasons[answer]}" if answer in reasons else ""


def difference(coarse: Run, fine: Run, tol: float) -> tuple[float, float, float]:
    """(force, peak, time): differences between the forces of two runs, for the contact with the
    largest difference.

    `force`: the larger relative difference of L2 norm and impulse; `peak`: relative difference of
    the peak forces; `time`: time [s] up to which the L2 norm of the difference is below `tol`. The
    runs are compared at the times of both, up to the end of the shorter one.
    """
    nodes = [np.ascontiguousarray(x) for run in (coarse, fine) for x in (run.time, run.force)]
    work = np.empty((9, coarse.force.shape[1]))
    a, fa, b, fb = map(library.address, nodes)
    found = library.library.aom_compare(
        len(work.T), coarse.time.size, a, fa, fine.time.size, b, fb, tol, library.address(work)
    )
    return found.force, found.peak, found.until
