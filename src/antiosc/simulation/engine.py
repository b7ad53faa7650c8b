"""One run of the march: the space that it works in, and what it returns."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from math import ceil, log2
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from antiosc import memory
from antiosc.simulation import march
from antiosc.simulation.compilation import fitting_march
from antiosc.simulation.laws import MEMORY
from antiosc.simulation.system import Start, System

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_FIRST = 2048  # nodes of the first buffer
#: Bytes of states that a run keeps; a longer one keeps those of every 2nd, 4th ... step.
STATES = 1 << 27
SHORTER = "shorten the duration, or use fewer contacts or anti-oscillators"


@dataclass(eq=False)
class Run:
    """One run: values at 0, h/2, h of every step, and the events.

    Attributes
    ----------
    time : (2 n + 1,); force, depth : (2 n + 1, m).
    states : (n // every + 1, 2, J) at the start of the steps 0, every, 2 every ...; None if not
        kept. `antiosc.simulation.scene_states` finds those in between.
    events : (., 4) time, contact, piece that begins, closing speed.
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


@dataclass(eq=False)
class Space:
    """Arrays of the march for as many modes, rows and contacts (shapes: `march/layout.py`).

    `tables` hold the responses of the steps that earlier runs of the same bodies and rows used;
    all else is filled anew by each run.
    """

    tables: tuple[NDArray[Any], ...]
    state: tuple[NDArray[Any], ...]
    work: tuple[NDArray[Any], ...]
    out: tuple[NDArray[Any], ...]
    shape: tuple[int, int, int]
    nbytes: int

    @classmethod
    def of(cls, p: int, m: int, size: int) -> Space:
        """For p contacts, m rows, `size` modes."""
        slots = march.LEVELS + 2
        need = 8 * slots * (16 * m * m + 10 * m * size + 10 * size)
        memory.require(need, f"a run with {p} contacts and {size} modes", "use fewer of them")
        tables = (
            np.full(slots, np.nan),
            np.zeros((slots, 3), dtype=np.int64),
            np.empty((slots, 6, size)),
            np.empty((slots, 2, m, 2, size)),
            np.empty((slots, 4, m, m)),
            np.empty((slots, 4, 3, m, m)),
            np.empty((slots, 2 + 3 * m, 2, size)),
        )
        state = (
            np.zeros(16),
            np.zeros(15, dtype=np.int64),
            np.empty((2, size)),
            np.empty((7, m)),
            np.empty(p, dtype=np.int64),
            np.empty((p, MEMORY)),
            np.empty((3, p, 2)),
            np.empty((p, 2)),
        )
        work = (
            np.zeros((3, m)),
            np.zeros((4, m)),
            np.zeros((4, m)),
            np.zeros((2, m)),
            np.zeros(size),
            np.zeros(size),
            np.zeros(m),
            np.zeros(m),
            np.zeros(2, dtype=np.int64),
            np.zeros((p, size)),
            np.zeros(p),
            np.zeros((march.LEVELS + 1, p)),
            np.zeros(march.LEVELS + 1, dtype=np.int64),
        )
        out = buffers(_FIRST, p, m, size)
        nbytes = sum(each.nbytes for each in (*tables, *out))
        return cls(tables, state, work, out, (p, m, size), nbytes)

    def begin(self, start: Start) -> None:
        """Put all that runs change to the start."""
        for mine, given in zip(self.state, start.state, strict=True):
            mine[...] = given
        for each in self.work[4:8]:  # loads and gaps, which the march sets where there are any
            each.fill(0.0)


def buffers(nodes: int, p: int, m: int, size: int) -> tuple[Array, ...]:
    """What the march writes into: times, forces, depths, states, events."""
    return (
        np.empty(nodes),
        np.empty((nodes, m)),
        np.empty((nodes, m)),
        np.empty((nodes // 2 + 2, 2, size)),
        np.empty((nodes + p + 1, 4)),
    )


_kept: OrderedDict[tuple[object, ...], Space] = OrderedDict()
_MOST_KEPT, _LARGEST_KEPT = 8, 1 << 23  # of them; bytes of one


def _space(key: tuple[object, ...], system: System) -> Space:
    """Space with the responses for halvings of the longest step [s].

    It is taken out of the store, so that no other thread fills it meanwhile.
    """
    found = _kept.pop(key, None)
    if found is not None:
        return found
    shape = system.kinds.size, *system.beta.shape
    oldest = _oldest() if len(_kept) >= _MOST_KEPT else None
    if oldest is None or oldest.shape != shape:
        return Space.of(*shape)
    oldest.tables[0].fill(np.nan)  # new memory costs more than a run of few modes
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


def run(
    system: System,
    duration: float,
    share: float,
    *,
    module: ModuleType | None = None,
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
    p, (m, size) = system.kinds.size, system.beta.shape
    width = size if keep else 0
    if march.USER in system.kinds.tolist():
        module = march  # only the interpreted march calls a law of one's own
    chosen, before = module or fitting_march(0), 0
    unit = 1.0 if step is None else step
    longest = unit * 2.0 ** ceil(log2(duration / unit))
    start = system.start
    key = (chosen.__name__, longest, *start.key)
    space = _space(key, system)
    space.begin(start)
    clock, count, x, row = space.state[:4]
    clock[march.DURATION], clock[march.SHARE], clock[march.LONGEST] = duration, share, longest
    roof = np.inf if step is None else step
    clock[march.FINE], clock[march.CAP], clock[march.ROOF] = fine, min(duration / 16, roof), roof
    clock[march.FORCE_SCALE] = max(clock[march.FORCE_SCALE], scale)
    clock[march.KNOWN] = float(scale > 0)
    count[march.MOST_TOUCHES], count[march.MOST_STEPS] = max_contacts, max_steps
    count[march.KEEP] = keep
    given = start.modes, start.acting, start.contacts
    out, buffer = space.out, _FIRST
    out[0][0], out[1][0], out[2][0] = 0.0, row[march.FORCE], row[march.DEPTH]
    count[march.NODES] = 1
    found: list[tuple[Array, ...]] = []
    thinned = _Thinned()
    while True:
        if chosen is march:
            answer = _interpret(start, space, out)
        else:
            answer = chosen.march(*given, space.state, space.tables, space.work, out)
        nodes, states, events = count[march.NODES], count[march.STATES], count[march.EVENTS]
        time, force, depth, kept, met = out
        if keep and answer != march.FULL:
            kept[states] = x
            states += 1
        found.append(
            (
                time[:nodes].copy(),
                force[:nodes].copy(),
                depth[:nodes].copy(),
                met[:events].copy(),
            )
        )
        thinned.add(kept[:states, :, :width])
        if chosen is march and module is None:
            chosen = fitting_march(int(count[march.STEPS]) - before)
            before = int(count[march.STEPS])
        if answer != march.FULL:
            break
        buffer = min(4 * buffer, 1 << 17, max(_FIRST, STATES // (8 * max(width, 1))))
        used = sum(each.nbytes for parts in found for each in parts)
        memory.require(used + 8 * buffer * (2 * m + width), f"a run of {p} contacts", SHORTER)
        out = buffers(buffer, p, m, width)
        count[march.NODES] = count[march.EVENTS] = count[march.STATES] = 0
    _keep(key, space)
    whole = found[0]
    if len(found) > 1:
        whole = tuple(np.concatenate(parts) for parts in zip(*found, strict=True))
    counts, clocks = count.tolist(), clock.tolist()
    return Run(
        time=whole[0],
        force=whole[1],
        depth=whole[2],
        states=thinned.states() if keep else None,
        events=whole[3],
        answer=int(answer),
        steps=counts[march.STEPS],
        attempts=counts[march.STEPS] + counts[march.RETRIES],
        touches=counts[march.TOUCHES],
        highest=clocks[march.HIGHEST],
        refused=counts[march.REFUSED],
        gained=clocks[march.SURPLUS],
        work=clocks[march.WORKED],
        every=thinned.every,
    )


class _Thinned:
    """States of steps as they come; of every 2nd, 4th ... step where they would be too many."""

    def __init__(self) -> None:
        self.every, self._steps, self._parts = 1, 0, list[Array]()

    def add(self, states: Array) -> None:
        """States (n, 2, J) at the starts of the next n steps."""
        self._parts.append(states[(-self._steps) % self.every :: self.every].copy())
        self._steps += len(states)
        while sum(part.nbytes for part in self._parts) > STATES and self._steps > self.every:
            self._parts = [self.states()[::2].copy()]
            self.every *= 2

    def states(self) -> Array:
        """All that are kept."""
        return self._parts[0] if len(self._parts) == 1 else np.concatenate(self._parts)


def _interpret(start: Start, space: Space, out: tuple[Array, ...]) -> int:
    """The interpreted march; it reads single numbers of lists more quickly than those of arrays."""
    clock, count, x, row, mode, *others = space.state
    read = [each.tolist() for each in (clock, count, mode)]
    state = (read[0], read[1], x, row, read[2], *others)
    contacts = (start.contacts[0].tolist(), *start.contacts[1:])
    work = (*space.work[:8], space.work[8].tolist(), *space.work[9:])
    with np.errstate(all="ignore"):  # forces that are not found overflow: the march sees it
        answer = march.march(start.modes, start.acting, contacts, state, space.tables, work, out)
    for array, values in zip((clock, count, mode), read, strict=True):
        array[...] = values
    return int(answer)
