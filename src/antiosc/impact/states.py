"""The state of a scene at any time of a run, exact for parabolic contact forces."""

from __future__ import annotations

from collections.abc import Iterable
from ctypes import byref, c_int
from dataclasses import replace

import numpy as np

from antiosc.base import process
from antiosc.base._types import Array, NDArray
from antiosc.engine import library
from antiosc.engine.march import Run
from antiosc.engine.system import System

Index = NDArray[np.intp]

#: Number of steps in a history for a flight as long as the run.
FLIGHT_STEPS = 100
#: Number of modal responses that are computed at once.
RESPONSES_AT_ONCE = 1 << 18
#: Number of modal states at the ends of steps that are computed at once.
STATES_AT_ONCE = 1 << 22
#: Remedy if the motion of all modes at all times does not fit in memory.
MEMORY_REMEDY = "ask for the motion at fewer times, as hit.at(times), or use fewer anti-oscillators"


def c_record_of(run: Run) -> tuple[library.CRecord, list[Array]]:
    """(the run as a structure for the C library, the arrays to which it points)."""
    arrays = [np.ascontiguousarray(array) for array in (run.time, run.force, run.events)]
    time, force, events = map(library.address, arrays)
    counts = {"n_nodes": run.time.size, "n_events": len(run.events)}
    return library.CRecord(time=time, force=force, events=events, **counts), arrays


def contact_intervals(run: Run, system: System, c: int) -> tuple[NDArray[np.void], bool]:
    """(touches of contact c longer than 0 s (`TOUCH_RECORD`), whether it is closed at the end)."""
    record, _ = c_record_of(run)
    touches = np.empty(len(run.events) + 1, library.TOUCH_RECORD)
    goes_on = c_int()
    closed = bool(system.closed[c])
    count = library.library.aom_touches(
        byref(record), c, closed, library.address(touches), byref(goes_on)
    )

    return touches[:count].copy(), bool(goes_on)


def main_contact_time(contacts: Iterable[tuple[float, float, float]]) -> float:
    """Time [s] from the first touch to the last release of the main impact; 0 without contact.

    contacts : (start [s], end [s], impulse [N s]) of each contact, in order; a contact that lasts
    beyond the run ends with the run. Successive contacts belong to one impact if the flight between
    them is shorter than the impact before it; the main impact has the largest impulse.
    """
    rows = [(a, b, 0.0, impulse, 0.0, 0, 0) for a, b, impulse in contacts]
    touches = np.array(rows, library.TOUCH_RECORD)
    return float(library.library.aom_main_impact(touches.size, library.address(touches)))


def linear_interpolation(t: Array, breaks: Array, values: Array) -> Array:
    """Rows of `values` at times, linear between the breaks, constant after the last."""
    if breaks.size == 1:
        return np.broadcast_to(values[0], (t.size, values.shape[1]))
    i = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, breaks.size - 2)
    u = np.clip((t - breaks[i]) / (breaks[i + 1] - breaks[i]), 0.0, 1.0)[:, None]
    return np.asarray(values[i] * (1 - u) + values[i + 1] * u)


def modal_loads(system: System, t: Array) -> Array:
    """Modal loads (n, J) at times (n,)."""
    return linear_interpolation(t, system.breaks, system.loads)


def steps_at(run: Run, t: Array) -> tuple[Index, Array]:
    """Index of the step that contains each time (n,), and the time since its start."""
    starts = run.time[:-2:2]
    tolerance = 1e-13 * float(run.time[-1])  # what is meant as a node is one
    step = np.searchsorted(starts, t + tolerance, side="right") - 1
    step = np.clip(step, 0, max(starts.size - 1, 0))
    since = t - run.time[2 * step]
    return step, np.where(since > tolerance, since, 0.0)


def contact_forces(run: Run, step: Index, since: Array) -> Array:
    """Contact forces (n, m) at times `since` [s] after step starts, from each step's parabola."""
    if run.time.size < 3:
        return np.repeat(run.force[:1], step.size, axis=0)
    f0, f1, f2 = (run.force[2 * step + i] for i in range(3))
    h = run.time[2 * step + 2] - run.time[2 * step]
    u = np.divide(since, h, out=np.zeros_like(since), where=h > 0)[:, None]
    return np.asarray(f0 + u * (4 * f1 - 3 * f0 - f2) + 2 * u * u * (f0 - 2 * f1 + f2))


def modal_states(run: Run, system: System, step: Index, since: Array) -> tuple[Array, Array]:
    """Modal displacements and velocities (n, J) at times `since` [s] after the starts of steps."""
    q, v = integrated_states(run, system, step, since)
    return _free_modes(system, q, v)


def integrated_states(run: Run, system: System, step: Index, since: Array) -> tuple[Array, Array]:
    """Displacements, rates (n, I) of `System.marched` at `since` [s] after the starts of steps."""
    q, v = integrated_start_states(run, system, step)
    if run.time.size < 3:
        return q, v
    return _advanced_states(run, system, step, since, q, v)


def _free_modes(system: System, q: Array, v: Array) -> tuple[Array, Array]:
    """Displacements and velocities of the free modes from states q, v of `System.marched`."""
    if system.first is None:
        return (q, v)
    return system.first.motion(q, v)[:2]


def damping_states(
    run: Run, system: System, step: Index, since: Array
) -> tuple[Array, list[list[Array]]]:
    """(decelerations (n, J) by coupled damping; by body, displacements (n, J) of the spring of each
    Maxwell branch)."""
    assert system.first is not None
    integrated = integrated_states(run, system, step, since)
    return system.first.motion(*integrated)[2], system.first.springs(*integrated)


def modal_start_states(run: Run, system: System, step: Index) -> tuple[Array, Array]:
    """Modal displacements and velocities (n, J) at the starts of steps (n,), or at the end."""
    return _free_modes(system, *integrated_start_states(run, system, step))


def integrated_start_states(run: Run, system: System, step: Index) -> tuple[Array, Array]:
    """Displacements and rates (n, I) of `System.marched` at the starts of steps."""
    if run.every == 1:
        return run.states[step, 0], run.states[step, 1]

    q, v = (np.empty((step.size, run.states.shape[2])) for _ in range(2))
    stored, stored_index = np.unique(step // run.every, return_inverse=True)
    steps_ahead = step % run.every

    block_size = max(RESPONSES_AT_ONCE // max(run.states.shape[2], 1), 1)
    for start in range(0, stored.size, block_size):
        in_block = np.flatnonzero((stored_index >= start) & (stored_index < start + block_size))
        x, y = (run.states[stored[start : start + block_size], i] for i in range(2))
        most_ahead = np.zeros(len(x), dtype=np.intp)
        np.maximum.at(most_ahead, stored_index[in_block] - start, steps_ahead[in_block])

        for k in range(int(most_ahead.max()) + 1):
            at_step = in_block[steps_ahead[in_block] == k]
            q[at_step] = x[stored_index[at_step] - start]
            v[at_step] = y[stored_index[at_step] - start]
            remaining = np.flatnonzero(most_ahead > k)
            numbers = stored[start + remaining] * run.every + k
            h = run.time[2 * numbers + 2] - run.time[2 * numbers]
            x[remaining], y[remaining] = _advanced_states(
                run, system, numbers, h, x[remaining], y[remaining]
            )

    return q, v


def _advanced_states(
    run: Run, system: System, step: Index, since: Array, q: Array, v: Array
) -> tuple[Array, Array]:
    """States of `System.marched` at `since` [s] after the starts of steps, from q, v there."""
    full_system = system
    system = system.marched
    P, W, S, J0, J1, J2 = library.responses(system.omega, system.decay, since[:, None])
    f0, f1, f2 = (run.force[2 * step + i] for i in range(3))
    start = run.time[2 * step]
    middle = run.time[2 * step + 1]
    h = run.time[2 * step + 2] - start
    steps_or_one = np.where(h > 0, h, 1.0)[:, None]
    start_loads = modal_loads(full_system, start)
    slope = (modal_loads(full_system, middle) - start_loads) / (0.5 * steps_or_one)
    coefficients = (
        f0,
        (4 * f1 - 3 * f0 - f2) / steps_or_one,
        4 * (f0 - 2 * f1 + f2) / steps_or_one**2,
    )
    if full_system.first is not None:
        start_loads = full_system.first.rows(start_loads)
        slope = full_system.first.rows(slope)

    size = system.omega.size
    a = coefficients[0] @ system.beta - start_loads[:, :size]
    b = coefficients[1] @ system.beta - slope[:, :size]
    c = coefficients[2] @ system.beta
    displacements = P * q + S * v - a * J0 - b * J1 - c * J2
    velocity = W * v - system.omega**2 * S * q - a * S - b * J0 - c * J1
    if system.gamma is None:
        return displacements, velocity

    x, y, z = (bend @ system.gamma for bend in coefficients)
    x = x - start_loads[:, size:]
    y = y - slope[:, size:]
    force_response = x * J0 + y * J1 + z * J2
    rate = x * S + y * J0 + z * J1

    return (
        displacements - rate,
        velocity + system.omega**2 * force_response + 2 * system.decay * rate,
    )


def node_states(
    run: Run, system: System, first: int = 0, last: int | None = None
) -> tuple[Array, Array]:
    """Modal displacements, velocities (n, J) at the time nodes of steps `first` to `last` - 1."""
    last = run.time.size // 2 if last is None else last
    size = system.omega.size
    nodes = 2 * (last - first) + 1
    process.require_memory(
        16 * nodes * size, f"the motion of {size} modes at {nodes} times", MEMORY_REMEDY
    )
    marched = system.marched.omega.size
    q, v = (np.empty((nodes, marched)) for _ in range(2))
    q[::2], v[::2] = integrated_start_states(run, system, np.arange(first, last + 1))

    block = max(RESPONSES_AT_ONCE // max(size, 1), 1)
    for start in range(first, last, block):
        steps = np.arange(start, min(start + block, last))
        since = run.time[2 * steps + 1] - run.time[2 * steps]
        node = 2 * (steps - first)
        q[node + 1], v[node + 1] = _advanced_states(run, system, steps, since, q[node], v[node])

    return _free_modes(system, q, v)


def step_blocks(run: Run, size: int) -> list[tuple[int, int]]:
    """(first, last) step of each block of a run whose states of `size` modes fit in memory."""
    steps = run.time.size // 2
    block_size = max(STATES_AT_ONCE // max(size, 1), 1)
    return [(k, min(k + block_size, steps)) for k in range(0, max(steps, 1), block_size)]


def with_flight_nodes(run: Run, system: System) -> Run:
    """The run with more time nodes in its flights, for pictures."""
    if run.time.size < 3:
        return run

    h = run.time[2::2] - run.time[:-2:2]
    in_contact = run.force.any(axis=1)
    flight = ~(in_contact[:-2:2] | in_contact[1::2] | in_contact[2::2])
    count = np.where(flight, 1 + (FLIGHT_STEPS * h / run.time[-1]).astype(int), 1)
    step = np.repeat(np.arange(h.size), count)
    if step.size == h.size:
        return run

    length = (h / count)[step]
    since = length * (np.arange(step.size) - np.repeat(np.cumsum(count) - count, count))
    step_ends = np.append(np.ravel(2 * step[:, None] + [0, 1]), run.time.size - 1)
    time = run.time[step_ends]
    force = run.force[step_ends]
    depth = run.depth[step_ends]
    new = np.flatnonzero(np.repeat(count[step] > 1, 2))
    step_of_new = step[new // 2]
    time_in_step = since[new // 2] + new % 2 * 0.5 * length[new // 2]
    time[new] = run.time[2 * step_of_new] + time_in_step
    displacements, _ = modal_states(run, system, step_of_new, time_in_step)
    depth[new] = displacements @ system.beta.T - linear_interpolation(
        time[new], system.breaks, system.offsets
    )
    start_steps = np.append(step, h.size)[:: run.every]
    delays = np.append(since, 0.0)[:: run.every]
    q, v = integrated_start_states(run, system, start_steps)
    long_flights = np.flatnonzero(delays)
    q[long_flights], v[long_flights] = _advanced_states(
        run,
        system,
        start_steps[long_flights],
        delays[long_flights],
        q[long_flights],
        v[long_flights],
    )

    return replace(run, time=time, force=force, depth=depth, states=np.stack([q, v], axis=1))


def step_end_displacements(run: Run, system: System) -> Array:
    """Displacements (n, J) of the free modes at the stored ends of steps."""
    return _free_modes(system, run.states[:, 0], run.states[:, 1])[0]
