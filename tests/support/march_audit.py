"""A run of the march checked step by step, by formulas and laws that the march does not use.

The motion of each mode over a step follows from the recorded forces (roots of its characteristic
polynomial), the indentations from the motion, and the forces from the laws' own classes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import antiosc as ao
from antiosc.engine import library
from antiosc.engine.equilibrium import set_initial_forces
from antiosc.engine.march import Run, run
from antiosc.engine.system import System
from antiosc.impact.assembly import Assembly, assemble_scene

Array = NDArray[np.float64]


class Audit(NamedTuple):
    """The scene as it was run; errors (p, n) of its parabolas at h/4 and 3 h/4, of the tolerance.

    NaN where a contact is open or has a law with memory or damping.
    """

    made: Assembly
    run: Run
    errors: Array


def audited(
    scene: ao.Scene, duration: float, share: float, step: float | None = None, tol: float = 1e-9
) -> Audit:
    """A run of the scene, each of whose steps keeps the equations of motion and the laws."""
    made = assemble_scene(scene, duration)
    set_initial_forces(made.system, made.scene.preload)
    found = run(made.system, duration, share, fine=made.contact_time_estimate / 200, step=step)
    assert found.answer == library.DONE
    _check_times(made.system, found, duration, step or 1.0)
    steps = Steps(made.system, found)
    _check_motion(steps, tol)
    errors = [_check_law(made, steps, c, tol) for c in range(len(made.laws))]
    for c in range(len(made.laws)):
        _check_friction(made.system, found, c, tol)
    scale = share * found.force[:, : len(errors)].max()
    return Audit(made, found, np.array(errors) / scale)


def _check_times(system: System, found: Run, duration: float, unit: float) -> None:
    """Steps have nodes in the middle and are halvings of a unit, but for those that events end."""
    t, ends = found.time, found.time[2::2]
    h = ends - t[:-1:2]
    assert t[0] == 0.0
    assert abs(t[-1] - duration) <= 1e-12 * duration
    assert np.all(h > 0)
    np.testing.assert_allclose(t[1::2], (ends + t[:-1:2]) / 2, rtol=1e-14)
    assert found.steps == h.size
    events = any(law.has_memory or law.rate_dependent for law in system.laws)
    if not events and not system.contacts["friction"].any():
        known = np.concatenate((found.events[:, 0], system.breaks, [duration]))
        free = ~np.any(np.abs(ends[:, None] - known) <= 1e-12 * duration, axis=1)
        halvings = np.log2(h[free] / unit)
        np.testing.assert_allclose(halvings, np.round(halvings), rtol=0, atol=1e-6)


class Motion(NamedTuple):
    """All steps at one share of each: (n, J) of the modes, (n, m) of the rows."""

    time: Array
    q: Array
    v: Array
    load: Array
    depth: Array
    rate: Array
    force: Array
    force_rate: Array


class Steps:
    """The motion over the steps of a run, under the parabolas of its forces and the loads."""

    def __init__(self, system: System, found: Run) -> None:
        assert found.states is not None
        self.system, self.run, self.states = system, found, found.states
        self.start, ends, F = found.time[:-1:2], found.time[2::2], found.force
        self.h = (ends - self.start)[:, None]
        f0, f1, f2 = F[:-1:2], F[1::2], F[2::2]
        self.force = f0, (4 * f1 - 3 * f0 - f2) / self.h, 4 * (f0 - 2 * f1 + f2) / self.h**2
        begin, end = (_linear(at, system.breaks, system.loads) for at in (self.start, ends))
        self.load = begin, (end - begin) / self.h
        self.gap, after = (_linear(at, system.breaks, system.offsets) for at in (self.start, ends))
        self.drift = (after - self.gap) / self.h

    def at(self, u: float) -> Motion:
        """The motion at a share u of each step."""
        system, t = self.system, u * self.h
        (f0, slope, bend), (load, rise) = self.force, self.load
        push = [load - f0 @ system.beta, rise - slope @ system.beta, -bend @ system.beta]
        x, y = self.states[:-1].transpose(1, 0, 2)
        q, v = motion(system.omega, system.decay, t, x, y, np.stack(push))
        force, changes = f0 + t * (slope + t * bend / 2), slope + t * bend
        return Motion(
            time=self.start + t[:, 0],
            q=q,
            v=v,
            load=load + rise * t,
            depth=q @ system.beta.T - self.gap - self.drift * t - force @ system.R,
            rate=v @ system.beta.T - self.drift - changes @ system.R,
            force=force,
            force_rate=changes,
        )


def _check_motion(steps: Steps, tol: float) -> None:
    """States and indentations of the steps are those under the forces and loads."""
    found, size = steps.run, np.abs(steps.run.depth).max()
    middle, end = steps.at(0.5), steps.at(1.0)
    for new, exact in zip(steps.states[1:].transpose(1, 0, 2), (end.q, end.v), strict=True):
        np.testing.assert_allclose(new, exact, rtol=0, atol=tol * np.abs(exact).max())
    np.testing.assert_allclose(found.depth[1::2], middle.depth, rtol=0, atol=tol * size)
    np.testing.assert_allclose(found.depth[2::2], end.depth, rtol=0, atol=tol * size)


def _linear(t: Array, times: Array, values: Array) -> Array:
    """Rows of `values` (K, .) at times, linear in between."""
    return np.stack([np.interp(t, times, column) for column in values.T], axis=1)


def motion(w: Array, d: Array, t: Array, x: Array, y: Array, f: Array) -> tuple[Array, Array]:
    """(q, v) of q'' + 2 d q' + w^2 q = f0 + f1 t + f2 t^2/2 after times t (n, 1), from (x, y).

    By its power series where the phase is small, else by the roots of its characteristic equation.
    """
    fast = np.maximum(w, 2 * d) * t > 1
    short = np.where(fast, 0.0, t)
    one, other, power = x, y, np.ones_like(short)
    q, v = x + 0.0, y + 0.0
    for n, force in enumerate([f[0], f[1], f[2] / 2, *[0.0] * 20]):
        new = (force - 2 * d * (n + 1) * other - w**2 * one) / ((n + 1) * (n + 2))
        one, other, power = other, new, power * short
        v = v + (n + 2) * new * power
        q = q + new * power * short
    q = q + y * short
    if fast.any():
        square = np.where(w > 0, w, 1.0) ** 2
        c = f[2] / square
        b = (f[1] - 2 * d * c) / square
        a = (f[0] - 2 * d * b - c) / square
        root = np.sqrt((d * d - square).astype(complex))
        one, other = root - d, -root - d
        p = ((y - b) - other * (x - a)) / (one - other) * np.exp(one * t)
        r = (one * (x - a) - (y - b)) / (one - other) * np.exp(other * t)
        q = np.where(fast, a + b * t + c * t**2 / 2 + (p + r).real, q)
        v = np.where(fast, b + c * t + (one * p + other * r).real, v)
    return q, v


def _check_law(made: Assembly, steps: Steps, c: int, tol: float) -> Array:
    """Forces of a contact are its law's, none while it is open; errors between the nodes."""
    law, system, found, F = made.laws[c], made.system, steps.run, steps.run.force
    scale = F[:, c].max()
    size = max(
        found.depth[:, c].max(), system.contacts["expected_depth"][c]
    )  # bounds are met to 1e-9 of it
    is_open, errors = np.ones(len(steps.h), dtype=bool), np.full(len(steps.h), np.nan)
    at = {u: steps.at(u) for u in (0.25, 0.5, 0.75, 1.0)}
    state = None
    for first, last, speed in _closed(found, c, bool(system.start_forces[c] > 0)):
        is_open[first:last] = False
        if first > 0:
            origin = 0.0 if state is None else law.origin(state)
            assert abs(found.depth[2 * first, c] - origin) <= 3e-9 * size
        state = law.touch(speed, state)
        for k in range(first, last):
            for node, u in ((2 * k + 1, 0.5), (2 * k + 2, 1.0)):
                way = float(at[u].depth[k, c])
                # of what has no mass the rate is that of backward differences
                massless = system.R[c] @ ((F[node] - F[node - 1]) * 2 / steps.h[k])
                rate = float(at[u].rate[k, c] + system.R[c] @ at[u].force_rate[k] - massless)
                if law.has_memory:
                    state = law.advance(way, rate, state)
                assert abs(F[node, c] - law.force(way, rate, state)) <= 100 * tol * scale
            if not (law.rate_dependent or law.has_memory):
                apart = (
                    one.force[k, c] - law.force(float(one.depth[k, c]), 0.0, state)
                    for one in (at[0.25], at[0.75])
                )
                errors[k] = max(map(abs, apart))
    assert not F[1::2, c][is_open].any()
    assert not F[2::2, c][is_open].any()
    origin = 0.0 if state is None else law.origin(state)
    assert all(np.all(one.depth[is_open, c] <= origin + 1e-6 * size) for one in at.values())
    return errors


def _closed(found: Run, c: int, pressed: bool) -> list[tuple[int, int, float]]:
    """First step, the one after the last, and closing speed of each time that one touches."""
    starts, first, speed = found.time[::2], 0 if pressed else -1, 0.0
    spans: list[tuple[int, int, float]] = []
    for t, _, piece, fast in found.events[found.events[:, 1] == c]:
        node = int(np.flatnonzero(starts == t)[0])
        if piece == library.APART:
            spans.append((first, node, speed))
            first = -1
        else:
            first, speed = node, float(fast)
    if first >= 0:
        spans.append((first, starts.size - 1, speed))
    return spans


def _check_friction(system: System, found: Run, c: int, tol: float) -> None:
    """Friction lies in its cone, and is that of its spring while it lies inside."""
    first, count = system.contacts[["first_tangential", "n_tangential"]][c]
    if not count:
        return
    mu, stiffness = system.contacts[["friction", "tangential_stiffness"]][c]
    T, way = found.force[:, first : first + count], found.depth[:, first : first + count]
    most, size = mu * np.maximum(found.force[:, c], 0.0), np.linalg.norm(T, axis=1)
    assert np.all(size <= most + 1e3 * tol * most.max())
    sticks = (size[1:] < most[1:] * (1 - 1e-6)) & (found.force[:-1, c] > 0)
    spring = np.diff(T, axis=0) - stiffness * np.diff(way, axis=0)
    assert np.abs(spring[sticks]).max(initial=0.0) <= 1e3 * tol * most.max()
