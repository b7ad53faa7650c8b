"""Free flight: exact rigid motion with large rotations, free vibration, and the next touch.

The floor is the plane z = 0, gravity points along -z. The body rotates freely. The modes vibrate
freely in the axes of the body; stiffening by the spin is neglected, which is valid if the spin is
small against the lowest natural frequency.

The height of a point above the floor is bounded from below by its rigid height minus the largest
elastic displacement that the energies of the modes allow. Only while this bound is below the floor,
the motion is sampled in steps that resolve the modes, and the touch is located.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.engine import library
from antiosc_studies.drops.free_body import FreeBody, State

#: A spin that deviates by less than this share from the direction of the angular momentum is
#: constant.
STEADY_SPIN = 1e-12
#: Largest parameter m of the elliptic functions: closer to 1 SciPy ignores their period.
LARGEST_PARAMETER = 1 - 2e-10


def rotation_matrices(vectors: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    flat = np.reshape(vectors, (-1, 3))
    return np.asarray(Rotation.from_rotvec(flat).as_matrix()).reshape(*np.shape(vectors), 3)


def free_rotation(
    moments: Array, axes: Array, R: Array, momentum: Array
) -> Callable[[Array], Array]:
    """The free rotation of a body, as a function of times (n,) [s] that returns R (n, 3, 3).

    R turns the body's axes to the fixed ones. moments, axes : principal moments (3,) [kg m^2] and
    their axes as rows (3, 3); R, momentum : rotation and angular momentum (3,) at time 0.
    """
    body_momentum = axes @ R.T @ momentum
    spin = R @ axes.T @ (body_momentum / moments)
    size = float(np.linalg.norm(spin) * np.linalg.norm(momentum))
    if size == 0.0:
        return lambda t: np.broadcast_to(R, (len(t), 3, 3))
    if np.linalg.norm(np.cross(spin, momentum)) <= STEADY_SPIN * size:
        return lambda t: rotation_matrices(t[:, None] * spin) @ R

    # L circles the axis of the largest moment, or that of the smallest
    gain, loss = (abs(moments[i] - moments[1]) * body_momentum[i] ** 2 / moments[i] for i in (2, 0))
    order = [0, 1, 2] if gain >= loss else [2, 1, 0]
    axes = axes[order]
    axes[1] *= np.sign(np.linalg.det(axes))
    return _tumbling(moments[order], axes, R, momentum)


def _tumbling(I: Array, axes: Array, R: Array, momentum: Array) -> Callable[[Array], Array]:  # noqa: E741
    """`free_rotation` about an axis that is not principal, by Jacobi's elliptic functions."""
    from scipy.special import ellipj, ellipkinc

    size = float(np.linalg.norm(momentum))
    w = (axes @ R.T @ momentum) / I
    d21 = abs(I[1] - I[0])
    d31 = abs(I[2] - I[0])
    d32 = abs(I[2] - I[1])

    # |2 E I3 - L^2| and |L^2 - 2 E I1|, without cancellation
    small = I[0] * d31 * w[0] ** 2 + I[1] * d32 * w[1] ** 2
    large = I[1] * d21 * w[1] ** 2 + I[2] * d31 * w[2] ** 2
    m = min(float(d21 * small / (d32 * large)), LARGEST_PARAMETER)
    rate = float(np.sqrt(d32 * large / I.prod()))
    third = np.copysign(np.sqrt(I[2] * large / d31), w[2])  # largest component 3 of L
    sign = np.copysign(1.0, w[2]) * np.sign(I[2] - I[1])
    first = np.sqrt(I[0] * d32)
    second = sign * np.sqrt(I[1] * d31)
    nutation = np.sqrt(small / (d31 * d32))
    phase = np.arctan2(sign * w[1] * np.sqrt(I[1] * d32), w[0] * np.sqrt(I[0] * d31))
    start = float(ellipkinc(phase, m))
    third_integral = _third_integral(-I[2] * d21 / (I[0] * d32), m)
    drift = size * (I[2] - I[0]) / (I[0] * I[2] * rate)

    def frames_in_body(u: Array) -> tuple[Array, Array]:
        """(axes (n, 3, 3) in the body, elliptic integrals of the third kind (n,)) at arguments u.

        The columns of the axes are the line of nodes, L × this line, and the direction of L.
        """
        sn, cn, dn, am = ellipj(u, m)
        x = first * cn
        y = second * sn
        projected_length = np.hypot(x, y)
        x = x / projected_length
        y = y / projected_length
        tilt = nutation * projected_length
        momentum = third * dn
        length = np.hypot(tilt, momentum)
        tilt = tilt / length
        momentum = momentum / length
        zeros = 0.0 * x
        rows = [[x * momentum, -y, x * tilt], [y * momentum, x, y * tilt], [-tilt, zeros, momentum]]
        return np.moveaxis(np.array(rows), 2, 0), third_integral(am)

    first_frame, angle0 = frames_in_body(np.array([start]))
    fixed = R @ axes.T @ first_frame[0]

    def orientation(t: Array) -> Array:
        nodes, angle = frames_in_body(rate * t + start)
        angle = size * t / I[2] + drift * (angle - angle0)
        c = np.cos(angle)[:, None]
        s = np.sin(angle)[:, None]
        e1, e2, e3 = fixed.T
        frame_in_space = np.stack(
            [c * e1 + s * e2, c * e2 - s * e1, np.broadcast_to(e3, (len(t), 3))], 2
        )
        return np.asarray(frame_in_space @ np.swapaxes(nodes, 1, 2) @ axes)

    return orientation


def _third_integral(n: float, m: float) -> Callable[[Array], Array]:
    """Pi(n; phi | m) for n < 0 and any phi, as a function of phi, by Carlson's integrals."""
    from scipy.special import elliprf, elliprj

    def part(s: Array, c: Array) -> Array:
        x = c * c
        y = 1 - m * s * s
        third = s**3 * elliprj(x, y, 1.0, 1 - n * s * s)
        return np.asarray(s * elliprf(x, y, 1.0) + n / 3 * third)

    half = part(np.ones(1), np.zeros(1))

    def integral(phi: Array) -> Array:
        halves = np.round(phi / np.pi)
        remainder = phi - halves * np.pi
        return 2 * halves * half + part(np.sin(remainder), np.cos(remainder))

    return integral


#: Rotation of the body [rad] between two samples of its rigid motion. Samples only bracket a touch,
#: which is then located to rounding: factors of 2 on it and on PERIOD_SAMPLES change peak forces
#: by 1e-12.
ROTATION_STEP = 0.05
#: Largest number of samples of a flight.
MOST_SAMPLES = 1_000_000
#: Samples in a period of the fastest mode that moves a point by `MOTION_SHARE` of the extent.
PERIOD_SAMPLES = 12
#: See `PERIOD_SAMPLES`.
MOTION_SHARE = 1e-6
#: Number of times at which heights are computed together for a rigid body, …
CHUNK_SIZE = 4096
#: … and for one with modes, whose arrays are larger.
ELASTIC_CHUNK_SIZE = 256
#: A body's lowest point must not be higher over the centre of mass than this share of the extent.
LOWEST_HEIGHT = 0.01
#: Height over the floor at which a point touches, over the extent.
TOUCH_HEIGHT = 1e-10
#: Accuracy of the time of a touch [s].
TOUCH_TIME_ERROR = 1e-14


def free_vibration(omega: Array, decay: Array, q: Array, p: Array, t: Array) -> tuple[Array, Array]:
    """Displacements and velocities (n, J) of freely vibrating damped modes at times (n,)."""
    if np.any(decay >= omega):  # over-damped ones
        P, W, S = library.responses(omega, decay, t[:, None])[:3]
        return P * q + S * p, W * p - omega**2 * S * q
    damped = np.sqrt(omega**2 - decay**2)
    phase = t[:, None] * damped
    fade = np.exp(-t[:, None] * decay)
    c = fade * np.cos(phase)
    s = fade * np.sin(phase) / damped
    return c * q + s * (p + decay * q), c * p - s * (decay * p + omega**2 * q)


def displacement_bounds(omega: Array, q: Array, p: Array) -> Array:
    """Bounds on the modal displacements at all later times, from the energies of the modes."""
    return np.hypot(q, p / np.maximum(omega, np.finfo(float).tiny))


class Flight:
    """The flight of a body from a state, under a gravity [m/s^2] along -z, above a floor."""

    def __init__(self, body: FreeBody, start: State, gravity: float) -> None:
        self.body = body
        self.start = start
        self.gravity = gravity
        #: R (n, 3, 3) at times (n,) since the start
        self.orientation = free_rotation(*body.principal_inertia, start.R, start.angular_momentum)

    def longest_duration(self) -> float:
        """Time [s] within which a point must touch, as later the whole body is below the floor."""
        v = float(self.start.velocity[2])
        z = max(float(self.start.centre[2]), 0.0)
        depth = LOWEST_HEIGHT * self.body.extent + float(self._bounds(np.zeros(1)).max())
        return (v + np.sqrt(v * v + 2 * self.gravity * (z + depth))) / self.gravity

    def state_at(self, t: float) -> State:
        """The state at a time t [s] since the start."""
        s = self.start
        g = np.array([0.0, 0.0, -self.gravity])
        instant = np.array([t])
        q, p = self._modal_motion(instant)
        return State(
            s.time + t,
            s.centre + s.velocity * t + 0.5 * g * t * t,
            s.velocity + g * t,
            self.orientation(instant)[0],
            s.angular_momentum,
            q[0],
            p[0],
        )

    def heights(self, t: Array, points: IntArray) -> Array:
        """Heights (n, k) [m] of points (k,) over the floor at ascending times (n,)."""
        vertical = self.orientation(t)[:, 2]
        shapes = self.body.shapes[points]
        displacements = np.tensordot(self._modal_motion(t)[0], shapes, axes=(1, 1))
        lifted = np.einsum("nkd,nd->nk", displacements, vertical)
        return self._rigid_heights(t, vertical, points) + lifted

    def _rigid_heights(self, t: Array, vertical: Array, points: IntArray) -> Array:
        """Heights (n, k) [m] without vibration; `vertical` (n, 3): the vertical in body axes."""
        s = self.start
        body = self.body
        z = s.centre[2] + s.velocity[2] * t - 0.5 * self.gravity * t * t
        return np.asarray(z[:, None] + vertical @ body.points[points].T - body.ball_radii[points])

    def _modal_motion(self, t: Array) -> tuple[Array, Array]:
        """Displacements and velocities (n, J) of the modes at times (n,)."""
        return free_vibration(self.body.omega, self.body.decay, self.start.q, self.start.p, t)

    def first_touch(self, until: float) -> float | None:
        """Time [s] of the first touch of a point; None if none touches up to `until` [s].

        A point that touches at the start counts once it has left the floor.
        """
        parted = self.start.heights(self.body) <= TOUCH_HEIGHT * self.body.extent
        touches = (self._touch_in(*interval, parted) for interval in self._intervals(until))
        return next((t for t in touches if t is not None), None)

    def _intervals(self, end: float) -> Iterator[tuple[float, float, IntArray]]:
        """Yield (start, end, indices): these points may touch between these times, up to `end`."""
        body = self.body
        points = np.arange(len(self.body.points))
        spin = float(np.linalg.norm(self.start.spin(body)))
        reach = float(np.linalg.norm(body.points, axis=1).max(initial=0.0))
        # between two samples the height deviates from a straight line by at most a'' h^2/8
        acceleration = self.gravity + 4 * spin**2 * reach
        # a deviation of ROTATION_STEP^2 times the size is harmless
        harmless = ROTATION_STEP * np.sqrt(8 * body.extent / acceleration)
        h = max(ROTATION_STEP / spin if spin > 0 else end, harmless)
        count = int(np.clip(np.ceil(end / h), 1, MOST_SAMPLES))
        edges = np.linspace(0.0, end, count + 1)
        slack = acceleration * (edges[1] - edges[0]) ** 2 / 8
        for first in range(0, count, CHUNK_SIZE):
            t = edges[first : first + CHUNK_SIZE + 1]
            rigid_heights = self._rigid_heights(t, self.orientation(t)[:, 2], points)
            may_touch = (
                np.minimum(rigid_heights[:-1], rigid_heights[1:]) <= self._bounds(t[:-1]) + slack
            )
            for k in np.flatnonzero(may_touch.any(axis=1)):
                yield float(t[k]), float(t[k + 1]), np.flatnonzero(may_touch[k])

    def _touch_in(
        self, start: float, end: float, points: IntArray, parted: BoolArray
    ) -> float | None:
        """Time [s] of the first touch of one of these points in an interval, or None.

        parted : (V,) whether a point was released and has not yet left the floor; it is updated.
        """
        frequency = self._highest_frequency(start)
        count = max(int(np.ceil((end - start) * PERIOD_SAMPLES * frequency / (2 * np.pi))), 2)
        tolerance = TOUCH_HEIGHT * self.body.extent
        for first in range(0, count, ELASTIC_CHUNK_SIZE):
            last = min(first + ELASTIC_CHUNK_SIZE, count)
            t = start + (end - start) * np.arange(first, last + 1) / count
            h = self.heights(t, points)
            # a point that has parted is free to touch once it has left the floor
            free = np.logical_or.accumulate(h > tolerance, axis=0) | ~parted[points]
            falls = (h[1:] < 0) & (h[:-1] >= 0) & free[:-1]
            sinks = ~free[:-1] & (h[1:] < h[:-1]) & (h[1:] < -tolerance)
            parted[points[free[-1]]] = False
            touching = np.flatnonzero((falls | sinks).any(axis=1))
            if len(touching):
                i = int(touching[0])
                if sinks[i].any():
                    return float(t[i])
                return self._touch_time(float(t[i]), float(t[i + 1]), points[falls[i]])

        return None

    def _touch_time(self, start: float, end: float, points: IntArray) -> float:
        """Time [s] in an interval at which the first of these points reaches the floor."""
        from scipy.optimize import brentq

        def lowest(t: float) -> float:
            return float(self.heights(np.array([t]), points).min())

        if lowest(start) <= 0:
            return start
        return float(brentq(lowest, start, end, xtol=TOUCH_TIME_ERROR))

    def _bounds(self, t: Array) -> Array:
        """Bounds (n, V) [m] on the elastic displacements of all points after times (n,)."""
        bounds = displacement_bounds(self.body.omega, *self._modal_motion(t))
        return np.asarray(bounds @ self.body.mode_sizes.T)

    def _highest_frequency(self, start: float) -> float:
        """Highest frequency [rad/s] of modes that move a point noticeably after a time."""
        (bounds,) = displacement_bounds(self.body.omega, *self._modal_motion(np.array([start])))
        motion = bounds * self.body.mode_sizes.max(axis=0)
        frequencies = self.body.omega[motion > MOTION_SHARE * self.body.extent]
        return float(frequencies.max(initial=0.0))
