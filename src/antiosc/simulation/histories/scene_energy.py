"""The balance of energy of a scene: what its bodies and contacts hold, lose, and are given."""

from __future__ import annotations

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.contact.compiled import is_compiled
from antiosc.simulation.histories.contact_energy import impulses, path_work, replay, stored_alone
from antiosc.simulation.histories.energy import Energy
from antiosc.simulation.march.engine import Run
from antiosc.simulation.problem.assembly import Assembly
from antiosc.simulation.problem.scene_states import blocks, node_states, part_of, starts, touches

GAIN = 1e-3  # of the highest energy: a scene that gains more says so
BALANCED = 5000  # nodes up to which the balance of several contacts is always made
SHORT = 0.05  # phase of a mode over a step, below which the trapezoidal rule serves


def balance(assembly: Assembly, run: Run) -> Energy:
    """Energies at the nodes."""
    a = assembly
    stored, lost = contact_energies(a, run)
    kinetic, modal = np.empty(run.time.size), np.empty(run.time.size)
    work, braked = np.zeros(run.time.size - 1), np.zeros(run.time.size - 1)
    for first, last in blocks(run, a.system.omega.size):
        q, v = node_states(run, a.system, a.load, first, last)
        nodes, between = slice(2 * first, 2 * last + 1), slice(2 * first, 2 * last)
        kinetic[nodes] = 0.5 * np.sum(v**2, axis=1)
        modal[nodes] = 0.5 * np.sum((a.system.omega * q) ** 2, axis=1)
        part = part_of(run, first, last)
        if np.any(a.system.loads):
            work[between] = _work(a, part, q, v)
        if a.system.first is not None:
            pushed = np.diff(path_work(part.force, q @ a.system.beta.T), axis=0).sum(axis=1)
            held = np.diff(kinetic[nodes] + modal[nodes])
            braked[between] = work[between] - pushed - held
        elif a.system.damped:
            braked[between] = _braked(a, part, q, v)
    acting = a.pushes(run.time)
    felt = acting - run.force @ a.G
    residual = felt @ a.r
    work, braked = _in_flight(a, run, kinetic + modal, work, braked)
    if a.scene.loads:
        work = work + path_work(acting, residual).sum(axis=1)
    return Energy(
        kinetic=kinetic,
        strain=modal + 0.5 * np.sum(felt * residual, axis=1),
        contact=stored,
        dissipated=lost + braked,
        gravity=work,
    )


def gained(a: Assembly, run: Run) -> float:
    """Energy that came from nowhere, relative to the highest.

    The balance is dear to find: of one contact, and of a long run, it is made only where the march
    had a doubt, and of other methods. A law of one's own need not know its energy.
    """
    system = a.system
    if not all(map(is_compiled, system.laws)):
        return 0.0
    doubted = run.gained > 0.1 * GAIN * run.highest
    if not doubted and (len(system.beta) == 1 or run.time.size > BALANCED):
        return 0.0
    if system.damped or (a.scene.loads and a.r.any()):
        energy = balance(a, run)
        held, total = energy.kinetic + energy.strain + energy.contact, energy.total
    else:  # nothing between the ends of the steps is needed
        force, mechanical = run.force[::2], np.empty(run.time.size // 2 + 1)
        work = np.zeros(mechanical.size - 1)
        for first, last in blocks(run, system.omega.size):
            q, v = starts(run, system, a.load, np.arange(first, last + 1))
            here = mechanical[first : last + 1]
            here[...] = march.energies(np.stack([q, v], axis=1), system.omega)
            if system.loads.any():
                work[first:last] = _work_by_step(a, part_of(run, first, last), q, v, here)
        held = mechanical.copy()
        if system.R.any():
            held += 0.5 * np.einsum("ni,ij,nj->n", force, system.R, force)
        stored, lost = contact_energies(a, run)
        held += stored[::2]
        total = held + lost[::2]
        if system.loads.any():
            total[1:] -= np.cumsum(work)
    highest = float(held.max())
    return float(total.max() - total[0]) / highest if highest > 0 else 0.0


def _in_flight(
    a: Assembly, run: Run, mechanical: Array, work: Array, lost: Array
) -> tuple[Array, Array]:
    """Work (n,) of all modal loads since the start, and what the damping took.

    `work`, `lost` (n - 1,) from node to node. In flight the motion is exact and the steps are long:
    there both follow from the balance.
    """
    if not (np.any(work) or a.system.damped):
        return np.zeros(run.time.size), np.zeros(run.time.size)
    damped = a.system.damped
    pressed = np.any(run.force != 0.0, axis=1)
    still = ~(pressed[:-1:2] | pressed[1::2] | pressed[2::2])
    flight = np.repeat(still, 2)
    change = np.diff(mechanical)
    if damped:
        lost = np.where(flight, work - change, lost)
    else:
        work = np.where(flight, change, work)
    return np.append(0.0, np.cumsum(work)), np.append(0.0, np.cumsum(lost))


def _braked(a: Assembly, run: Run, q: Array, v: Array) -> Array:
    """What the damping of the modes takes from node to node, (n - 1,), however long the steps.

    The work of a modal force that is a parabola in time, less the gain of the mode: by parts it
    needs the integrals of q and t q, which the equation of motion gives. They cancel for short
    steps, for which the trapezoidal rule serves.
    """
    system, step = a.system, np.diff(run.time)[:, None]
    f0, f1, f2 = run.force[:-2:2], run.force[1:-1:2], run.force[2::2]
    h = step[::2] + step[1::2]
    h = np.where(h > 0, h, 1.0)
    slopes, bends = np.empty((2, step.size, run.force.shape[1]))
    slopes[::2], slopes[1::2] = (4 * f1 - 3 * f0 - f2) / h, (f2 - f0) / h
    bends[::2] = bends[1::2] = 4 * (f0 - 2 * f1 + f2) / h**2
    load = a.load(run.time)
    slope = np.diff(load, axis=0) / np.where(step > 0, step, 1.0) - slopes @ system.beta
    bend = -bends @ system.beta
    start = load[:-1] - run.force[:-1] @ system.beta
    end = start + step * (slope + step * bend / 2)
    x = np.where(system.omega > 0, system.omega, 1.0) ** 2
    moved, sped = np.diff(q, axis=0), np.diff(v, axis=0)
    given = step * (start + step * (slope / 2 + step * bend / 6))
    area = (given - sped - 2 * system.decay * moved) / x
    first = step**2 * (start / 2 + step * (slope / 3 + step * bend / 8))
    first = (first - step * v[1:] + moved - 2 * system.decay * (step * q[1:] - area)) / x
    energy = 0.5 * (v**2 + (system.omega * q) ** 2)
    work = end * q[1:] - start * q[:-1] - slope * area - bend * first
    power = 2 * system.decay * v**2
    short = system.omega * step < SHORT
    lost = np.where(short, step * (power[:-1] + power[1:]) / 2, work - np.diff(energy, axis=0))
    return np.asarray(np.sum(np.where(system.decay > 0, lost, 0.0), axis=1))


def _work(a: Assembly, run: Run, q: Array, v: Array) -> Array:
    """Work of the modal loads from node to node, (n - 1,), however long the steps.

    By parts: a load that is linear in time needs the integral of q, which an elastic mode's
    equation of motion gives.
    """
    time, force, system = run.time, run.force, a.system
    span = np.diff(time)[:, None]
    load = a.load(time)
    if system.first is not None:
        return np.asarray(np.diff(path_work(load, q), axis=0).sum(axis=1))
    given = span * 0.5 * (load[1:] + load[:-1]) - impulses(time, force) @ system.beta
    change = np.diff(v, axis=0) + 2 * system.decay * np.diff(q, axis=0)
    elastic = system.omega > 0
    area = (given - change) / np.where(elastic, system.omega, 1.0) ** 2
    slope = np.diff(load, axis=0) / np.where(span > 0, span, 1.0)
    work = np.diff(load * q, axis=0) - slope * area
    return np.asarray(np.where(elastic, work, np.diff(path_work(load, q), axis=0)).sum(axis=1))


def _work_by_step(a: Assembly, run: Run, q: Array, v: Array, mechanical: Array) -> Array:
    """Work (n - 1,) of the modal loads over each step, without damping, from its ends alone.

    By parts as in `_work`; the integral of a rigid motion is that of its acceleration, a parabola.
    """
    system = a.system
    f0, f1, f2 = run.force[:-2:2], run.force[1:-1:2], run.force[2::2]
    time = run.time[::2]
    h = np.diff(time)[:, None]
    load = a.load(time)
    work = np.diff(load * q, axis=0)
    if len(system.breaks) > 1:  # loads that change in time
        rise = np.diff(load, axis=0)
        impulse = h / 6 * (f0 + 4 * f1 + f2)
        elastic = system.omega > 0
        given = h * 0.5 * (load[1:] + load[:-1]) - impulse @ system.beta
        area = (given - np.diff(v, axis=0)) / np.where(elastic, system.omega, 1.0) ** 2
        start = load[:-1] - f0 @ system.beta
        slope = rise - (4 * f1 - 3 * f0 - f2) @ system.beta
        bend = -4 * (f0 - 2 * f1 + f2) @ system.beta
        carried = q[:-1] + h / 2 * (v[:-1] + h / 3 * (start + slope / 4 + bend / 20))
        work -= rise * np.where(elastic, area / np.where(h > 0, h, 1.0), carried)
    flight = ~np.any((f0 != 0.0) | (f1 != 0.0) | (f2 != 0.0), axis=1)  # exact and long
    return np.where(flight, np.diff(mechanical), work.sum(axis=1))


def contact_energies(a: Assembly, run: Run) -> tuple[Array, Array]:
    """Energy that all contacts can give back, and what they lost, at the nodes."""
    stored, lost = np.zeros(run.time.size), np.zeros(run.time.size)
    system = a.system
    for c, law in enumerate(a.laws):
        if not (law.has_memory or law.rate_dependent):
            stored += stored_alone(law, run.force[:, c], run.depth[:, c])
            continue
        force, depth = run.force[:, c], run.depth[:, c]
        closed, _ = touches(run, system, c)
        nodes = [
            (
                int(np.searchsorted(run.time, start)),
                int(np.searchsorted(run.time, end, side="right")) - 1,
            )
            for start, end in zip(closed["start"], closed["end"], strict=True)
        ]
        each, plastic, damping = replay(law, force, depth, nodes, closed["speed"].tolist())
        stored += each
        lost += plastic
        if law.rate_dependent:
            lost += path_work(damping[:, None], depth[:, None])[:, 0]
    for c, (first, count) in enumerate(system.tangents.tolist()):
        for i in range(first, first + count):
            T, way = run.force[:, i], run.depth[:, i]
            spring = 0.5 * T**2 / system.slip[c, 1]
            work = path_work(T[:, None], way[:, None])[:, 0]
            stored += spring
            lost += work - spring
    return stored, lost
