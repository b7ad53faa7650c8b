"""Free flight: exact rigid motion with large rotations, ringing of the modes, and the next touch.

The floor is the plane z = 0, gravity points along -z. The orientation is that of a free rotation.
The modes ring freely in the axes of the body: what the spin adds to their stiffness is left out,
which holds while the spin is small against the lowest natural frequency.

The height of a point over the floor is bounded from below by its rigid height minus the largest
elastic displacements; only where this bound reaches the floor is the motion looked at in steps that
resolve the modes, and the touch located.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.models.modal import ModalBody
from antiosc.studies.drops.body import FreeBody
from antiosc.studies.drops.rotation import free_rotation

#: Angles [rad] that the body turns between two looks at its rigid motion, the first from afar.
COARSE, TURN = 0.25, 0.02
#: Most looks at one flight.
MOST_LOOKS = 1_000_000
#: Looks at a period of the fastest mode that moves a point by more than `SEEN` of the extent.
LOOKS, SEEN = 12, 1e-6
#: A mode that moves all points by less than this share of the extent is left out of the heights.
NEGLIGIBLE = 1e-14
#: Most times at which heights are looked at together: of the rigid body, of the modes too.
AT_ONCE, AT_ONCE_ELASTIC = 4096, 256
#: Time of a touch is found to this share of the extent over the speed.
TOUCH = 1e-10


@dataclass(frozen=True, eq=False)
class State:
    """The motion of a free body at one time.

    Attributes
    ----------
    time : [s].
    centre, velocity : (3,) of the centre of mass, in the axes of the floor [m], [m/s].
    R : (3, 3) from the axes of the body to those of the floor.
    momentum : (3,) angular momentum about the centre [kg m^2/s].
    q, p : (J,) elastic modal displacements and velocities.
    floor : (2, F) modal displacements and velocities of an elastic floor, which u = b q lowers.
    """

    time: float
    centre: Array
    velocity: Array
    R: Array
    momentum: Array
    q: Array
    p: Array
    floor: Array

    def spin(self, body: FreeBody) -> Array:
        """Angular velocity (3,) in the axes of the floor [rad/s]."""
        return np.asarray(self.R @ np.linalg.solve(body.tensor, self.R.T @ self.momentum))

    def energies(self, body: FreeBody, gravity: float) -> tuple[float, float, float]:
        """Energies [J]: of the rigid motion, of the vibration, and of the height of the centre."""
        rigid = 0.5 * body.mass * self.velocity @ self.velocity
        rigid += 0.5 * self.momentum @ self.spin(body)
        elastic = 0.5 * (self.p @ self.p + (body.omega * self.q) @ (body.omega * self.q))
        return float(rigid), float(elastic), float(body.mass * gravity * self.centre[2])


def ringing(omega: Array, decay: Array, q: Array, p: Array, t: Array) -> tuple[Array, Array]:
    """Displacements and velocities (n, J) of free damped modes at times (n,) since the start."""
    c, s = _waves(omega, decay, t)
    return c * q + s * (p + decay * q), c * p - s * (decay * p + omega**2 * q)


def _waves(omega: Array, decay: Array, t: Array) -> tuple[Array, Array]:
    """exp(-d t) cos(w t) and exp(-d t) sin(w t)/w (n, J), w the frequency of the damped mode."""
    fast = np.sqrt(np.maximum(omega**2 - decay**2, 0.0))
    phase, fade = t[:, None] * fast, np.exp(-t[:, None] * decay)
    sine = np.where(fast > 0, np.sin(phase) / np.where(fast > 0, fast, 1.0), t[:, None])
    return fade * np.cos(phase), fade * sine


class Flight:
    """The flight of a body from a state, under a gravity [m/s^2] along -z, above a floor."""

    def __init__(
        self, body: FreeBody, start: State, gravity: float, floor: ModalBody | None = None
    ) -> None:
        self.body, self.start, self.gravity, self.floor = body, start, gravity, floor
        #: R (n, 3, 3) at times (n,) since the start
        self.orientation = free_rotation(*body.principal, start.R, start.momentum)

    def longest(self) -> float:
        """Time [s] at which the centre reaches the floor: something has touched before."""
        v, z = float(self.start.velocity[2]), max(float(self.start.centre[2]), 0.0)
        return (v + np.sqrt(v * v + 2 * self.gravity * z)) / self.gravity

    def at(self, t: float) -> State:
        """The state a time t [s] after the start."""
        s, g = self.start, np.array([0.0, 0.0, -self.gravity])
        body, at = self.body, np.array([t])
        q, p = ringing(body.omega, body.decay, s.q, s.p, at)
        floor = s.floor
        if self.floor is not None:
            floor = np.array([part[0] for part in self._floor_at(at)])
        return State(
            s.time + t,
            s.centre + s.velocity * t + 0.5 * g * t * t,
            s.velocity + g * t,
            self.orientation(at)[0],
            s.momentum,
            q[0],
            p[0],
            floor,
        )

    def heights(self, t: Array, which: IntArray) -> Array:
        """Heights (n, k) [m] over the floor of points (k,) at times (n,), ascending from start."""
        body, s = self.body, self.start
        up = self.orientation(t)[:, 2]
        found = self._rigid(t, up, which)
        live = np.flatnonzero(self._moves(float(t[0])) > NEGLIGIBLE * body.extent)
        if live.size:
            c, sine = _waves(body.omega[live], body.decay[live], t)
            q = c * s.q[live] + sine * (s.p + body.decay * s.q)[live]
            shapes = body.shapes[np.ix_(which, live)].transpose(1, 0, 2).reshape(live.size, -1)
            moved = (q @ shapes).reshape(len(t), len(which), 3)
            found += np.einsum("nkd,nd->nk", moved, up)
        if self.floor is not None:
            found += (self._floor_at(t)[0] @ self.floor.b)[:, None]
        return found

    def _rigid(self, t: Array, up: Array, which: IntArray) -> Array:
        """Heights without vibration; `up` (n, 3): the vertical in the axes of the body."""
        s, body = self.start, self.body
        z = s.centre[2] + s.velocity[2] * t - 0.5 * self.gravity * t * t
        return np.asarray(z[:, None] + up @ body.points[which].T - body.balls[which])

    def _floor_at(self, t: Array) -> tuple[Array, Array]:
        floor = self.floor
        assert floor is not None
        q, p = self.start.floor
        return ringing(floor.omega, self._floor_decay, q, p, t)

    @property
    def _floor_decay(self) -> Array:
        floor = self.floor
        assert floor is not None
        return np.zeros(floor.omega.size) if floor.decay is None else floor.decay

    def touch(self, until: float) -> float | None:
        """Time [s] since the start of the first touch up to `until`; None if there is none.

        A point that is below the floor and rises has parted, and may touch again after it has
        left.
        """
        parted = self._below(np.arange(len(self.body.points)))
        for start, end, _ in self._near(0.0, until, COARSE):
            for first, last, which in self._near(start, end, TURN):
                found = self._within(first, last, which, parted)
                if found is not None:
                    return found
        return None

    def _near(
        self, start: float, end: float, turn: float
    ) -> Iterator[tuple[float, float, IntArray]]:
        """Intervals in which points may touch, in order, and which points.

        turn: angle [rad] by which the body turns in an interval, roughly.
        """
        body, every = self.body, np.arange(len(self.body.points))
        spin = float(np.linalg.norm(self.start.spin(body)))
        reach = float(np.linalg.norm(body.points, axis=1).max(initial=0.0))
        # between two looks the height deviates from a straight line by a'' h^2/8 at most
        bend = self.gravity + 4 * spin**2 * reach
        # a deviation of turn^2 of the size does no harm
        h = max(turn / spin if spin > 0 else end - start, turn * np.sqrt(8 * body.extent / bend))
        count = int(np.clip(np.ceil((end - start) / h), 1, MOST_LOOKS))
        edges = np.linspace(start, end, count + 1)
        slack = bend * (edges[1] - edges[0]) ** 2 / 8
        for first in range(0, count, AT_ONCE):
            t = edges[first : first + AT_ONCE + 1]
            low = self._rigid(t, self.orientation(t)[:, 2], every)
            near = np.minimum(low[:-1], low[1:]) <= self._sizes(t[:-1]) + slack
            for k in np.flatnonzero(near.any(axis=1)):
                yield float(t[k]), float(t[k + 1]), np.flatnonzero(near[k])

    def _below(self, which: IntArray) -> Array:
        """Which points start below the floor, or on it."""
        return np.asarray(self.heights(np.zeros(1), which)[0] <= TOUCH * self.body.extent)

    def _within(self, start: float, end: float, which: IntArray, parted: Array) -> float | None:
        """The first touch of points between two times; `parted`: below since they parted."""
        span, v = end - start, float(np.abs(self.start.velocity).max()) + 1e-3
        count = max(int(np.ceil(span / self._resolved(start, span))), 2)
        close = TOUCH * self.body.extent
        for first in range(0, count, AT_ONCE_ELASTIC):
            last = min(first + AT_ONCE_ELASTIC, count)
            t = start + span * np.arange(first, last + 1) / count
            h = self.heights(t, which)
            # a point that has parted is free to touch once it has left the floor
            free = np.logical_or.accumulate(h > close, axis=0) | ~parted[which]
            falls = (h[1:] < 0) & (h[:-1] >= 0) & free[:-1]
            sinks = ~free[:-1] & (h[1:] < h[:-1]) & (h[1:] < -close)
            parted[which[free[-1]]] = False
            touching = np.flatnonzero((falls | sinks).any(axis=1))
            if len(touching):
                i = int(touching[0])
                if sinks[i].any():
                    return float(t[i])
                return self._located(float(t[i]), float(t[i + 1]), which[falls[i]], close / v)
        return None

    def _located(self, start: float, end: float, which: IntArray, close: float) -> float:
        """The time at which the lowest of some points reaches the floor."""
        from scipy.optimize import brentq

        def lowest(t: float) -> float:
            return float(self.heights(np.array([t]), which)[0].min())

        if lowest(start) <= 0:
            return start
        return float(brentq(lowest, start, end, xtol=max(close, 4e-16 * end), rtol=1e-15))

    def _sizes(self, t: Array) -> Array:
        """Largest elastic displacements (n, V) of the points [m] from times (n,) on."""
        body, s = self.body, self.start
        size = np.linalg.norm(body.shapes, axis=2)
        found = _swing(body.omega, body.decay, s.q, s.p, t) @ size.T
        if self.floor is not None:
            swing = _swing(self.floor.omega, self._floor_decay, s.floor[0], s.floor[1], t)
            found = found + (swing @ np.abs(self.floor.b))[:, None]
        return np.asarray(found)

    def _moves(self, start: float) -> Array:
        """By how much the modes (J,) move a point from a time on, at most [m]."""
        body, s = self.body, self.start
        swing = _swing(body.omega, body.decay, s.q, s.p, np.array([start]))[0]
        return np.asarray(body.largest_shapes * swing)

    def _resolved(self, start: float, span: float) -> float:
        """Time [s] between two looks that resolves the modes which move a point from a time on."""
        body, s = self.body, self.start
        seen = body.omega[self._moves(start) > SEEN * body.extent]
        fastest = [float(seen.max())] if seen.size else []
        if self.floor is not None and np.any(s.floor):
            fastest.append(float(self.floor.omega.max()))
        return min([span / 2] + [2 * np.pi / (LOOKS * w) for w in fastest])


def _swing(omega: Array, decay: Array, q: Array, p: Array, t: Array) -> Array:
    """Largest displacements (n, J) of free modes from times (n,) on, at most."""
    fast = np.sqrt(np.maximum(omega**2 - decay**2, np.where(omega > 0, 0.01 * omega**2, 1.0)))
    size = np.hypot(q, (np.abs(p) + decay * np.abs(q)) / fast)
    return np.asarray(np.exp(-t[:, None] * decay) * size)
