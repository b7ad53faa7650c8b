"""Torque-free rotation in closed form, after Euler and Jacobi.

In principal axes, ordered so that the angular momentum L circles the third one, the spin is

    w = (a1 cn, s a2 sn, a3 dn)(O t + u0 | m),

and the line of nodes turns about L by the angle

    L t/I3 + L (I3 - I1)/(I1 I3 O) [Pi(n; am(O t + u0) | m) - Pi(n; am(u0) | m)]

(Landau and Lifshitz, Mechanics, section 37), Pi the elliptic integral of the third kind.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from antiosc.base._types import Array

#: A spin whose axis deviates by less than this share from the angular momentum keeps it.
SPINNING = 1e-12
#: Largest parameter m of the elliptic functions: SciPy leaves their period out nearer to 1.
LARGEST_M = 1 - 2e-10


def turned(angle: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    flat = np.reshape(angle, (-1, 3))
    return np.asarray(Rotation.from_rotvec(flat).as_matrix()).reshape(*np.shape(angle), 3)


def free_rotation(
    moments: Array, axes: Array, R: Array, momentum: Array
) -> Callable[[Array], Array]:
    """R (n, 3, 3) from the axes of the body to the fixed ones, as a function of times (n,) [s].

    Parameters
    ----------
    moments, axes : (3,) principal moments [kg m^2], ascending, and their axes as rows (3, 3).
    R : (3, 3) at the time 0.
    momentum : (3,) angular momentum in the fixed axes [kg m^2/s].
    """
    own = axes @ R.T @ momentum
    spin = R @ axes.T @ (own / moments)
    size = float(np.linalg.norm(spin) * np.linalg.norm(momentum))
    if size == 0.0:
        return lambda t: np.broadcast_to(R, (len(t), 3, 3))
    if np.linalg.norm(np.cross(spin, momentum)) <= SPINNING * size:
        return lambda t: turned(t[:, None] * spin) @ R
    # the axis that L circles: that of the largest moment, or that of the smallest
    gain, loss = (abs(moments[i] - moments[1]) * own[i] ** 2 / moments[i] for i in (2, 0))
    order = [0, 1, 2] if gain >= loss else [2, 1, 0]
    axes = axes[order]
    axes[1] *= np.sign(np.linalg.det(axes))
    return _tumbling(moments[order], axes, R, momentum)


def _tumbling(I: Array, axes: Array, R: Array, momentum: Array) -> Callable[[Array], Array]:  # noqa: E741
    from scipy.special import ellipj, ellipkinc

    size = float(np.linalg.norm(momentum))
    w = (axes @ R.T @ momentum) / I
    d21, d31, d32 = abs(I[1] - I[0]), abs(I[2] - I[0]), abs(I[2] - I[1])
    # |2 E I3 - L^2| and |L^2 - 2 E I1|, without cancellation
    small = I[0] * d31 * w[0] ** 2 + I[1] * d32 * w[1] ** 2
    large = I[1] * d21 * w[1] ** 2 + I[2] * d31 * w[2] ** 2
    m = min(float(d21 * small / (d32 * large)), LARGEST_M)
    rate = float(np.sqrt(d32 * large / I.prod()))
    third = np.copysign(np.sqrt(I[2] * large / d31), w[2])  # largest component 3 of L
    sign = np.copysign(1.0, w[2]) * np.sign(I[2] - I[1])
    first, second = np.sqrt(I[0] * d32), sign * np.sqrt(I[1] * d31)
    nutation = np.sqrt(small / (d31 * d32))
    phase = np.arctan2(sign * w[1] * np.sqrt(I[1] * d32), w[0] * np.sqrt(I[0] * d31))
    start = float(ellipkinc(phase, m))
    third_integral = _third_integral(-I[2] * d21 / (I[0] * d32), m)
    drift = size * (I[2] - I[0]) / (I[0] * I[2] * rate)

    def looked(u: Array) -> tuple[Array, Array]:
        """Axes (n, 3, 3) of nodes, L and both as columns, in those of the body; the third Pi."""
        sn, cn, dn, am = ellipj(u, m)
        x, y = first * cn, second * sn
        across = np.hypot(x, y)
        x, y, tilt, along = x / across, y / across, nutation * across, third * dn
        length = np.hypot(tilt, along)
        tilt, along, none = tilt / length, along / length, 0.0 * x
        rows = [[x * along, -y, x * tilt], [y * along, x, y * tilt], [-tilt, none, along]]
        return np.moveaxis(np.array(rows), 2, 0), third_integral(am)

    before, angle0 = looked(np.array([start]))
    fixed = R @ axes.T @ before[0]

    def orientation(t: Array) -> Array:
        nodes, angle = looked(rate * t + start)
        angle = size * t / I[2] + drift * (angle - angle0)
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        e1, e2, e3 = fixed.T
        turning = np.stack([c * e1 + s * e2, c * e2 - s * e1, np.broadcast_to(e3, (len(t), 3))], 2)
        return np.asarray(turning @ np.swapaxes(nodes, 1, 2) @ axes)

    return orientation


def _third_integral(n: float, m: float) -> Callable[[Array], Array]:
    """Pi(n; phi | m) of n < 0 at any phi, by Carlson's integrals."""
    from scipy.special import elliprf, elliprj

    def part(s: Array, c: Array) -> Array:
        x, y = c * c, 1 - m * s * s
        third = s**3 * elliprj(x, y, 1.0, 1 - n * s * s)
        return np.asarray(s * elliprf(x, y, 1.0) + n / 3 * third)

    half = part(np.ones(1), np.zeros(1))

    def whole(phi: Array) -> Array:
        halves = np.round(phi / np.pi)
        rest = phi - halves * np.pi
        return 2 * halves * half + part(np.sin(rest), np.cos(rest))

    return whole
