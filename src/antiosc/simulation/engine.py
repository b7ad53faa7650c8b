"""One run of the march: the memory that it works in, and what it returns."""

from __future__ import annotations

from collections import OrderedDict
from ctypes import byref, c_void_p
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from antiosc import march
from antiosc.errors import InputError
from antiosc.simulation.system import Given, System

Array = NDArray[np.float64]

_FIRST, _LONGEST = 2048, 1 << 17  # nodes of the first buffer, and of the largest
# numbers that the march may read and write between two looks for an interrupt: some 0.1 s
_AT_ONCE = 100_000_000


@dataclass(eq=False)
class Run:
    """One run: values at 0, h/2, h of every step, and the events.

    Attributes
    ----------
    time : (2 n + 1,); force, depth : (2 n + 1, m).
    states : (n + 1, 2, J) at the start and after each step; None if not kept.
    events : (., 4) time, contact, branch that begins, closing speed.
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


class Buffers:
    """What the march writes into: times, forces, depths, states, events."""

    def __init__(self, nodes: int, p: int, m: int, size: int) -> None:
        self.arrays = (
            np.empty(nodes),
            np.empty((nodes, m)),
            np.empty((nodes, m)),
            np.empty((nodes // 2 + 2, 2, size)),
            np.empty((nodes + p + 1, 4)),
        )
        at = map(march.address, self.arrays)
        # room for one state more than the march writes: the last
        self.record = march.Record(nodes, nodes // 2 + 1, len(self.arrays[4]), 0, 0, 0, *at)
        self.states = self.record.states

    def emptied(self, keep: bool) -> march.Record:
        """The record, empty; `keep`: states are written too."""
        record = self.record
        record.n_nodes = record.n_states = record.n_events = 0
        record.states = self.states if keep else None
        return record

    def taken(self) -> tuple[Array, ...]:
        """Copies of what was written."""
        record = self.record
        nodes, states, events = record.n_nodes, record.n_states, record.n_events
        time, force, depth, kept, met = self.arrays
        return (
            time[:nodes].copy(), force[:nodes].copy(), depth[:nodes].copy(),
            kept[:states].copy(), met[:events].copy(),
        )  # fmt: skip


class Space:
    """A stepper in its memory, and its first buffers.

    It holds the responses of the steps that earlier runs of the same bodies and rows used.
    """

    def __init__(self, given: Given) -> None:
        system = given.system
        self.shape = system.n_contacts, system.n_rows, system.n_modes
        size = march.library.aom_memory_size(byref(system))
        self.memory = np.empty(-(-size // 16), dtype=np.complex128)
        self.stepper = c_void_p()
        self.buffers = Buffers(_FIRST, *self.shape)
        self.nbytes = size + sum(each.nbytes for each in self.buffers.arrays)
        self.renew(given)

    def renew(self, given: Given) -> None:
        """Be for other bodies of as many modes and rows: new memory costs more than a run."""
        answer = march.library.aom_create(
            byref(given.system), march.address(self.memory), self.memory.nbytes, byref(self.stepper)
        )
        _check(answer)


_kept: OrderedDict[tuple[object, ...], Space] = OrderedDict()
_MOST_KEPT, _LARGEST_KEPT = 8, 1 << 23  # of them; bytes of one


def _space(key: tuple[object, ...], given: Given) -> Space:
    """Space for a system, with the responses of its bodies if they are kept.

    It is taken out of the store, so that no other thread fills it meanwhile.
    """
    found = _kept.pop(key, None)
    if found is not None:
        return found
    oldest = _oldest() if len(_kept) >= _MOST_KEPT else None
    system = given.system
    if oldest is None or oldest.shape != (system.n_contacts, system.n_rows, system.n_modes):
        return Space(given)
    oldest.renew(given)
    return oldest


def _oldest() -> Space | None:
    """The space that has been kept longest, taken out; other threads may have taken them all."""
    try:
        return _kept.popitem(last=False)[1]
    except KeyError:
        return None


def _keep(key: tuple[object, ...], space: Space) -> None:
    """Leave the space to later runs."""
    if space.nbytes > _LARGEST_KEPT:
        return
    _kept[key] = space
    while len(_kept) > _MOST_KEPT:
        _oldest()


def _check(answer: int) -> None:
    """InputError where the march refuses what it is given."""
    if answer > march.LAW_FAILED:
        name = march.library.aom_status_name(answer).decode()
        raise InputError(
            f"the march refuses the system ({name}): its numbers must be finite, its laws and"
            f" scales in their range (csrc/antiosc_march.h)."
        )


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
    """March over [0, duration] with forces to `share` of their scale (0: found as it goes).

    The steps under contact are halvings of the longest; with `step` [s] given they are that step,
    or halvings of it where the forces need them.
    """
    given = system.packed
    p, m, size = len(system.laws), *system.beta.shape
    key = (p, m, size, given.bodies)
    space = _space(key, given)
    options = march.Options(duration, share, scale, step or 0.0, fine, max_contacts, max_steps)
    answer = march.library.aom_start(space.stepper, byref(given.system), byref(options))
    _check(answer)
    parts: list[tuple[Array, ...]] = []
    at_once = max(_AT_ONCE // (50 * (m + 1) * (size + m + 20)), 16)
    nodes, buffers = _FIRST, space.buffers
    record = buffers.emptied(keep)
    while answer in (march.DONE, march.PAUSED, march.FULL):
        answer = march.library.aom_integrate(space.stepper, byref(record), np.inf, at_once)
        if answer == march.FULL:
            parts.append(buffers.taken())
            nodes = min(4 * nodes, _LONGEST)
            buffers = Buffers(nodes, p, m, size)
            record = buffers.emptied(keep)
        elif answer != march.PAUSED:
            break
    if keep:
        last = buffers.arrays[3][record.n_states]
        march.library.aom_modal_state(space.stepper, march.address(last))
        record.n_states += 1
    parts.append(buffers.taken())
    told = march.library.aom_summarize(space.stepper)
    _keep(key, space)
    if answer == march.LAW_FAILED:
        given.failed()
    whole = parts[0]
    if len(parts) > 1:  # a part begins with the node that the one before ends with
        rest = [(time[1:], force[1:], depth[1:], *kept) for time, force, depth, *kept in parts[1:]]
        whole = tuple(np.concatenate(part) for part in zip(parts[0], *rest, strict=True))
    return Run(
        time=whole[0],
        force=whole[1],
        depth=whole[2],
        states=whole[3] if keep else None,
        events=whole[4],
        answer=int(answer),
        steps=told.steps,
        attempts=told.attempts,
        touches=told.touches,
        highest=told.highest,
        refused=told.refused,
        gained=told.gained,
        work=told.work,
    )
