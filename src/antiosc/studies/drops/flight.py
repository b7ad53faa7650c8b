"""Free flight: exact rigid motion with large rotations, ringing of the modes, and the next touch.

The floor is the plane z = 0, gravity points along -z. The angular momentum is constant; the
orientation R(t) follows from R' = (I(R)^-1 L) x R, closed where the spin keeps its axis. The modes
ring freely in the axes of the body: what the spin adds to their stiffness is left out, which holds
while the spin is small against the lowest natural frequency.

The height of a point over the floor is bounded from below by its rigid height minus the largest
elastic displacements; only where this bound reaches the floor is the motion looked at in steps that
resolve the modes, and the touch located.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antiosc.base._types import Array, IntArray
from antiosc.models.modal import ModalBody
from antiosc.studies.drops.body import FreeBody

#: Angle [rad] that the body turns between two looks at its rigid motion.
TURN = 0.02
#: Looks at a period of the fastest mode that moves a point by more than `SEEN` of the extent.
LOOKS, SEEN = 12, 1e-8
#: Most times at which heights are looked at together.
AT_ONCE = 4096
#: A spin whose axis deviates by less than this share from the angular momentum keeps it.
SPINNING = 1e-12
#: Relative error of the orientation over one flight.
ROTATION_ERROR = 1e-10
#: Time of a touch is found to this share of the extent over the speed.
TOUCH = 1e-12


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


def turned(angle: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    flat = np.reshape(angle, (-1, 3))
    return np.asarray(Rotation.from_rotvec(flat).as_matrix()).reshape(*np.shape(angle), 3)


def ringing(omega: Array, decay: Array, q: Array, p: Array, t: Array) -> tuple[Array, Array]:
    """Displacements and velocities (n, J) of free damped modes at times (n,) since the start."""
    fast = np.sqrt(np.maximum(omega**2 - decay**2, 0.0))
    phase = t[:, None] * fast
    fade, c = np.exp(-t[:, None] * decay), np.cos(phase)
    s = np.where(fast > 0, np.sin(phase) / np.where(fast > 0, fast, 1.0), t[:, None])
    x = fade * (c * q + s * (p + decay * q))
    return x, fade * (c * p - s * (decay * p + omega**2 * q))


class Flight:
    """The flight of a body from a state, under a gravity [m/s^2] along -z, above a floor."""

    def __init__(
        self, body: FreeBody, start: State, gravity: float, floor: ModalBody | None = None
    ) -> None:
        self.body, self.start, self.gravity, self.floor = body, start, gravity, floor
        self._turning = _orientation(body, start)

    def longest(self) -> float:
        """Time [s] at which the centre reaches the floor: something has touched before."""
        v, z = float(self.start.velocity[2]), max(float(self.start.centre[2]), 0.0)
        return (v + np.sqrt(v * v + 2 * self.gravity * z)) / self.gravity

    def orientation(self, t: Array) -> Array:
        """R (n, 3, 3) at times (n,) since the start."""
        return self._turning(t)

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
        """Heights (n, k) [m] over the floor of points (k,) at times (n,) since the start."""
        return self._rigid(t, which) + self._elastic(t, which)

    def _rigid(self, t: Array, which: IntArray) -> Array:
        s, body = self.start, self.body
        z = s.centre[2] + s.velocity[2] * t - 0.5 * self.gravity * t * t
        up = self.orientation(t)[:, 2]
        return np.asarray(z[:, None] + up @ body.points[which].T - body.balls[which])

    def _elastic(self, t: Array, which: IntArray) -> Array:
        body, s = self.body, self.start
        total = np.zeros((len(t), len(which)))
        if body.omega.size:
            q, _ = ringing(body.omega, body.decay, s.q, s.p, t)
            up = self.orientation(t)[:, 2]
            moved = (
                q @ body.shapes[which].transpose(1, 0, 2).reshape(body.omega.size, -1)
            ).reshape(len(t), len(which), 3)
            total = np.einsum("nkd,nd->nk", moved, up)
        if self.floor is not None:
            total += (self._floor_at(t)[0] @ self.floor.b)[:, None]
        return total

    def _floor_at(self, t: Array) -> tuple[Array, Array]:
        floor = self.floor
        assert floor is not None
        decay = np.zeros(floor.omega.size) if floor.decay is None else floor.decay
        q, p = self.start.floor
        return ringing(floor.omega, decay, q, p, t)

    def touch(self, until: float) -> float | None:
        """Time [s] since the start of the first touch up to `until`; None if there is none.

        A point that is below the floor and rises has parted, and may touch again after it has
        left.
        """
        body, s = self.body, self.start
        spin = float(np.linalg.norm(s.spin(body)))
        every = np.arange(len(body.points))
        bounds = self._sizes()
        reach = float(np.linalg.norm(body.points, axis=1).max(initial=0.0))
        # between two looks the height deviates from a straight line by a'' h^2/8 at most
        bend = self.gravity + 4 * spin**2 * reach
        h = min(until, TURN / spin if spin > 0 else until)
        h = max(min(h, np.sqrt(8 * 1e-3 * body.extent / bend)), until * 1e-6)
        count = max(int(np.ceil(until / h)), 1)
        edges = np.linspace(0.0, until, count + 1)
        slack = bend * (edges[1] - edges[0]) ** 2 / 8
        parted = None
        for first in range(0, count, AT_ONCE):
            t = edges[first : first + AT_ONCE + 1]
            low = self._rigid(t, every) - bounds - slack
            near = np.minimum(low[:-1], low[1:]) <= 0
            for k in np.flatnonzero(near.any(axis=1)):
                which = np.flatnonzero(near[k])
                if parted is None:
                    parted = self._below(every)
                found = self._within(float(t[k]), float(t[k + 1]), which, parted)
                if found is not None:
                    return found
        return None

    def _below(self, which: IntArray) -> Array:
        """Which points start below the floor, or on it."""
        return np.asarray(self.heights(np.zeros(1), which)[0] <= TOUCH * self.body.extent)

    def _within(self, start: float, end: float, which: IntArray, parted: Array) -> float | None:
        """The first touch of points between two times; `parted`: below since they parted."""
        span, v = end - start, float(np.abs(self.start.velocity).max()) + 1e-3
        count = max(int(np.ceil(span / self._resolved(span))), 2)
        close = TOUCH * self.body.extent
        for first in range(0, count, AT_ONCE):
            last = min(first + AT_ONCE, count)
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

    def _sizes(self) -> Array:
        """Largest elastic displacements (V,) of the points [m]."""
        body, s = self.body, self.start
        q, _ = _swing(body.omega, body.decay, s.q, s.p)
        found = np.abs(np.linalg.norm(body.shapes, axis=2)) @ q
        if self.floor is not None:
            rate = np.zeros(self.floor.omega.size) if self.floor.decay is None else self.floor.decay
            found = found + _swing(self.floor.omega, rate, *s.floor)[0] @ np.abs(self.floor.b)
        return np.asarray(found)

    def _resolved(self, span: float) -> float:
        """Time [s] between two looks that resolves the modes which move a point."""
        body, s = self.body, self.start
        size = np.abs(body.shapes).max(axis=(0, 2), initial=0.0)
        size = size * _swing(body.omega, body.decay, s.q, s.p)[0]
        seen = body.omega[size > SEEN * body.extent]
        fastest = [float(seen.max())] if seen.size else []
        if self.floor is not None and np.any(s.floor):
            fastest.append(float(self.floor.omega.max()))
        return min([span / 2] + [2 * np.pi / (LOOKS * w) for w in fastest])


def _swing(omega: Array, decay: Array, q: Array, p: Array) -> tuple[Array, Array]:
    """Largest displacements (J,) and velocities of free modes, at most."""
    slow = np.where(omega > 0, omega, 1.0)
    size = np.hypot(q, (np.abs(p) + decay * np.abs(q)) / slow)
    return size, size * omega


def _orientation(body: FreeBody, start: State) -> Callable[[Array], Array]:
    """R (n, 3, 3) as a function of times (n,) since the start."""
    spin, L = start.spin(body), start.momentum
    size = float(np.linalg.norm(spin) * np.linalg.norm(L))
    if np.linalg.norm(np.cross(spin, L)) <= SPINNING * size:
        if size == 0.0:
            return lambda t: np.broadcast_to(start.R, (len(t), 3, 3))
        return lambda t: turned(t[:, None] * spin) @ start.R
    return _Tumbling(body, start)


class _Tumbling:
    """The orientation of a body whose spin wanders, by an integration that reaches on demand."""

    def __init__(self, body: FreeBody, start: State) -> None:
        # turned into the axes of the floor at the start
        self._inverse = start.R @ np.linalg.inv(body.tensor) @ start.R.T
        self._start, self._end = start, -1.0

    def __call__(self, t: Array) -> Array:
        last = max(float(t.max(initial=0.0)), TOUCH)
        if last > self._end:
            self._reach(last)
        return np.asarray(_matrix(self._solution(t)) @ self._start.R)

    def _reach(self, last: float) -> None:
        from scipy.integrate import solve_ivp

        found = solve_ivp(
            self._rate, (0.0, last), np.array([1.0, 0.0, 0.0, 0.0]), "DOP853", dense_output=True,
            rtol=ROTATION_ERROR, atol=ROTATION_ERROR,
        )  # fmt: skip
        self._solution: Callable[[Array], Array] = found.sol
        self._end = last

    def _rate(self, t: float, y: Array) -> Array:
        R = _matrix(y)
        w = R @ (self._inverse @ (R.T @ self._start.momentum))
        (a, b, c, d), (x, y_, z) = y.tolist(), w.tolist()
        return 0.5 * np.array(
            [
                -x * b - y_ * c - z * d,
                a * x + y_ * d - z * c,
                a * y_ + z * b - x * d,
                a * z + x * c - y_ * b,
            ]
        )


def _matrix(y: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (4, ...), the scalar first."""
    a, b, c, d = y / np.sqrt((y * y).sum(axis=0))
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    found = np.array(rows)
    return found if found.ndim == 2 else np.moveaxis(found, 2, 0)
