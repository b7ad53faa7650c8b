"""Energies during a run: stored, dissipated and supplied, and the error of their balance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array
from antiosc.base.texts import ReprMixin
from antiosc.engine.contact import ContactLaw, State
from antiosc.engine.contact.base import Compiled, is_compiled
from antiosc.engine.march import Run
from antiosc.engine.system import ContactState
from antiosc.impact.assembly import Assembly
from antiosc.impact.states import contact_intervals, modal_loads, node_states, step_blocks


@dataclass(frozen=True, eq=False, repr=False)
class Energy(ReprMixin):
    """Energies [J] at the time nodes of a history, each (n,), and the error of their balance.

    Attributes
    ----------
    kinetic, strain : kinetic and strain energy of all bodies.
    contact : recoverable energy of the contact.
    dissipated : energy lost in the contact law and in the damping of the bodies up to this time.
    gravity : work of gravity, loads and base motion up to this time.
    drift : largest |kinetic + strain + contact + dissipated - gravity - start|, relative to the
        largest sum of kinetic, strain and contact energy.
    """

    kinetic: Array
    strain: Array
    contact: Array
    dissipated: Array
    gravity: Array

    @property
    def total(self) -> Array:
        """Sum of all energies, constant in exact arithmetic."""
        return self.kinetic + self.strain + self.contact + self.dissipated - self.gravity

    @property
    def drift(self) -> float:
        total = self.total
        scale = float(np.max(self.kinetic + self.strain + self.contact))
        if scale > 0:
            return float(np.max(np.abs(total - total[0]))) / scale
        return 0.0


def replayed_energies(
    law: ContactLaw,
    force: Array,
    depth: Array,
    spans: Iterable[tuple[int, int]],
    speeds: Iterable[float],
    earlier: ContactState | None = None,
) -> tuple[Array, Array, Array]:
    """(recoverable energy [J], accumulated plastic loss [J], damping force [N]), each (n,).

    force, depth : (n,) of one contact at time nodes. spans, speeds : first and last node, and
    closing speed [m/s], of each touch. earlier : state at the end of an earlier run.
    """
    stored, plastic, damping = (np.zeros(depth.size) for _ in range(3))
    state: State | None = None if earlier is None else earlier.state

    goes_on = earlier is not None and earlier.closed
    for (a, b), speed in zip(spans, speeds, strict=False):
        if state is None or not goes_on:
            state = law.touch(speed, state)
        goes_on = False
        span = slice(a, b + 1)

        if is_compiled(law):
            if law.has_memory:
                stored[span], losses, state = _replayed_touch(law, depth[span], state)
                plastic[span] += losses
            else:  # the state lasts as long as the contact
                stored[span] = law.energies(depth[span], state)
            if law.rate_dependent:
                damping[span] = force[span] - law.forces_at_rest(depth[span], state)
            if b < depth.size - 1:
                stored[b] = damping[b] = 0.0
            continue

        lost_before = law.lost(state)
        for n in range(a, b + 1):
            delta = float(depth[n])
            if n > a:
                state = law.advance(delta, 0.0, state)
            if law.rate_dependent:
                damping[n] = float(force[n]) - law.force(delta, 0.0, state)
            stored[n] = law.energy(delta, state)
            plastic[n] += law.lost(state) - lost_before
            lost_before = law.lost(state)

        if b < depth.size - 1:
            stored[b] = damping[b] = 0.0

    return stored, np.cumsum(plastic), damping


def _replayed_touch(law: Compiled, depth: Array, state: State) -> tuple[Array, Array, State]:
    """(recoverable energy, loss at each time node [J], (n,); final state) of one touch."""
    deepest_before = np.maximum.accumulate(np.append(state[1], depth[1:-1]))
    is_deeper = np.append(False, depth[1:] > deepest_before)
    stored = law.energies(depth, state)
    losses = np.zeros(depth.size)
    nodes = np.flatnonzero(is_deeper)
    if not nodes.size:
        return stored, losses, state

    states = [law.advance(delta, 0.0, state) for delta in depth[nodes].tolist()]
    losses[nodes] = np.diff([state[2], *(state_k[2] for state_k in states)])
    returns = np.flatnonzero(np.diff(nodes, append=depth.size) > 1)
    for k in returns.tolist():
        unloading = slice(nodes[k] + 1, nodes[k + 1] if k + 1 < nodes.size else None)
        stored[unloading] = law.energies(depth[unloading], states[k])

    return stored, losses, states[-1]


def path_work(force: Array, displacement: Array) -> Array:
    """Work (n, k) [J] of forces up to each time node; forces and motion are parabolic in steps."""
    f0 = force[:-2:2]
    f1 = force[1:-1:2]
    f2 = force[2::2]
    w0 = displacement[:-2:2]
    w1 = displacement[1:-1:2]
    w2 = displacement[2::2]
    b = 4 * f1 - 3 * f0 - f2
    c = 2 * (f0 - 2 * f1 + f2)
    d = 4 * w1 - 3 * w0 - w2
    e = 4 * (w0 - 2 * w1 + w2)

    def until(u: float) -> Array:
        return np.asarray(
            f0 * d * u + (f0 * e + b * d) * u**2 / 2 + (b * e + c * d) * u**3 / 3 + c * e * u**4 / 4
        )

    full_steps = until(1.0)
    total = np.zeros_like(displacement)
    total[2::2] = np.cumsum(full_steps, axis=0)
    total[1::2] = total[:-1:2] + until(0.5)
    return total


def impulses(time: Array, force: Array) -> Array:
    """Time integrals (n - 1, m) between nodes of forces (n, m) that are parabolic in each step."""
    f0 = force[:-2:2]
    f1 = force[1:-1:2]
    f2 = force[2::2]
    span = np.diff(time)[:, None]
    integrals = np.empty((time.size - 1, force.shape[1]))
    integrals[::2] = span[::2] * (5 * f0 + 8 * f1 - f2) / 12
    integrals[1::2] = span[1::2] * (5 * f2 + 8 * f1 - f0) / 12
    return integrals


SHORT_PHASE = 0.05  # phase of a mode over a step, below which the trapezoidal rule serves


def energy_balance(assembly: Assembly, run: Run) -> Energy:
    """Energies at the time nodes of a run, and the error of their balance."""
    a = assembly
    stored, losses = contact_energies(a, run)

    kinetic = np.empty(run.time.size)
    modal = np.empty(run.time.size)
    work = np.zeros(run.time.size - 1)
    braked = np.zeros(run.time.size - 1)
    for first, last in step_blocks(run, a.system.omega.size):
        q, v = node_states(run, a.system, first, last)
        nodes = slice(2 * first, 2 * last + 1)
        inner_nodes = slice(2 * first, 2 * last)
        kinetic[nodes] = 0.5 * np.sum(v**2, axis=1)
        modal[nodes] = 0.5 * np.sum((a.system.omega * q) ** 2, axis=1)
        modal[nodes] += a.system.stretch_energy(q)
        arrays = {name: getattr(run, name)[nodes] for name in ("time", "force", "depth")}
        part = replace(run, **arrays)
        if np.any(a.system.loads):
            work[inner_nodes] = _load_work(a, part, q, v)
        if a.system.first is not None:
            contact_work = np.diff(path_work(part.force, q @ a.system.beta.T), axis=0).sum(axis=1)
            stored_change = np.diff(kinetic[nodes] + modal[nodes])
            braked[inner_nodes] = work[inner_nodes] - contact_work - stored_change
        elif a.system.has_damping:
            braked[inner_nodes] = _damping_losses(a, part, q, v)

    external_forces = a.external_forces(run.time)
    felt = external_forces - run.force @ a.G
    residual = felt @ a.stacked.r if np.any(a.stacked.r) else np.zeros_like(felt)
    work, braked = _cumulative_work_and_losses(a, run, kinetic + modal, work, braked)
    if a.scene.loads:
        loaded = np.any(external_forces, axis=0)
        work = work + path_work(external_forces[:, loaded], residual[:, loaded]).sum(axis=1)

    return Energy(
        kinetic=kinetic,
        strain=modal + 0.5 * np.sum(felt * residual, axis=1),
        contact=stored,
        dissipated=losses + braked,
        gravity=work,
    )


def _cumulative_work_and_losses(
    a: Assembly, run: Run, mechanical: Array, work: Array, losses: Array
) -> tuple[Array, Array]:
    """(work of loads, damping losses) [J] up to each time node; in flight by energy balance."""
    if not (np.any(work) or a.system.has_damping):
        return np.zeros(run.time.size), np.zeros(run.time.size)
    damped = a.system.has_damping
    in_contact = np.any(run.force != 0.0, axis=1)  # a body that stretches is never in flight
    flight_steps = ~(in_contact[:-1:2] | in_contact[1::2] | in_contact[2::2])
    flight = np.repeat(flight_steps, 2)
    change = np.diff(mechanical)

    if damped:
        losses = np.where(flight, work - change, losses)
    else:
        work = np.where(flight, change, work)

    return np.append(0.0, np.cumsum(work)), np.append(0.0, np.cumsum(losses))


def _damping_losses(a: Assembly, run: Run, q: Array, v: Array) -> Array:
    """Energy (n - 1,) that modal damping dissipates between time nodes, at any step length.

    It is the work of a modal force that is parabolic in time, minus the energy that the mode gains.
    Integration by parts needs the integrals of q and t q, which follow from the equation of motion.
    For short steps the terms cancel; the trapezoidal rule is used there.
    """
    system = a.system
    step = np.diff(run.time)[:, None]
    f0 = run.force[:-2:2]
    f1 = run.force[1:-1:2]
    f2 = run.force[2::2]
    h = step[::2] + step[1::2]
    h = np.where(h > 0, h, 1.0)
    slopes, curvatures = np.empty((2, step.size, run.force.shape[1]))
    slopes[::2] = (4 * f1 - 3 * f0 - f2) / h
    slopes[1::2] = (f2 - f0) / h
    curvatures[::2] = curvatures[1::2] = 4 * (f0 - 2 * f1 + f2) / h**2
    load = modal_loads(a.system, run.time)
    slope = np.diff(load, axis=0) / np.where(step > 0, step, 1.0) - slopes @ system.beta
    load_curvature = -curvatures @ system.beta
    start = load[:-1] - run.force[:-1] @ system.beta
    end = start + step * (slope + step * load_curvature / 2)
    x = np.where(system.omega > 0, system.omega, 1.0) ** 2
    displacements = np.diff(q, axis=0)
    speed_changes = np.diff(v, axis=0)
    impulse = step * (start + step * (slope / 2 + step * load_curvature / 6))
    area = (impulse - speed_changes - 2 * system.decay * displacements) / x
    first = step**2 * (start / 2 + step * (slope / 3 + step * load_curvature / 8))
    first = (first - step * v[1:] + displacements - 2 * system.decay * (step * q[1:] - area)) / x
    energy = 0.5 * (v**2 + (system.omega * q) ** 2)
    work = end * q[1:] - start * q[:-1] - slope * area - load_curvature * first
    power = 2 * system.decay * v**2
    is_short = system.omega * step < SHORT_PHASE
    losses = np.where(is_short, step * (power[:-1] + power[1:]) / 2, work - np.diff(energy, axis=0))
    return np.asarray(np.sum(np.where(system.decay > 0, losses, 0.0), axis=1))


def _load_work(a: Assembly, run: Run, q: Array, v: Array) -> Array:
    """Work (n - 1,) of the modal loads between time nodes, by parts, at any step length."""
    time = run.time
    force = run.force
    system = a.system
    span = np.diff(time)[:, None]
    load = modal_loads(a.system, time)
    if system.first is not None:
        return np.asarray(np.diff(path_work(load, q), axis=0).sum(axis=1))
    impulse = span * 0.5 * (load[1:] + load[:-1]) - impulses(time, force) @ system.beta
    change = np.diff(v, axis=0) + 2 * system.decay * np.diff(q, axis=0)
    elastic = system.omega > 0
    area = (impulse - change) / np.where(elastic, system.omega, 1.0) ** 2
    slope = np.diff(load, axis=0) / np.where(span > 0, span, 1.0)
    work = np.diff(load * q, axis=0) - slope * area
    return np.asarray(np.where(elastic, work, np.diff(path_work(load, q), axis=0)).sum(axis=1))


def contact_energies(a: Assembly, run: Run) -> tuple[Array, Array]:
    """Recoverable energy and losses (n,) [J] of all contacts together at the time nodes."""
    stored = np.zeros(run.time.size)
    losses = np.zeros(run.time.size)

    system = a.system
    for c, law in enumerate(a.laws):
        if not (law.has_memory or law.rate_dependent):
            pressed = np.flatnonzero(run.force[:, c])
            if pressed.size:
                stored[pressed] += law.energies(run.depth[pressed, c], law.touch(0.0))
            continue
        force = run.force[:, c]
        depth = run.depth[:, c]
        closed, _ = contact_intervals(run, system, c)
        first = np.searchsorted(run.time, closed["start"])
        last = np.searchsorted(run.time, closed["end"], side="right") - 1
        nodes = zip(first.tolist(), last.tolist(), strict=True)
        earlier = None if system.contact_states is None else system.contact_states[c]
        speeds = closed["speed"].tolist()
        recoverable, plastic, damping = replayed_energies(law, force, depth, nodes, speeds, earlier)
        stored += recoverable
        losses += plastic
        if law.rate_dependent:
            losses += path_work(damping[:, None], depth[:, None])[:, 0]

    for c, sides in enumerate(system.friction_rows):
        for i in range(sides.start, sides.stop):
            T = run.force[:, i]
            displacement = run.depth[:, i]
            spring = 0.5 * T**2 / system.contacts["tangential_stiffness"][c]
            work = path_work(T[:, None], displacement[:, None])[:, 0]
            stored += spring
            losses += work - spring

    return stored, losses
