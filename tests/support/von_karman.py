"""An impact on the middle of a clamped disc after von Kármán, by Ritz and DOP853: no mesh."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss
from numpy.polynomial.polynomial import Polynomial
from scipy.integrate import solve_ivp

#: Deflections (1 − ρ²)² P_i(2ρ² − 1) beside the static one under a point force, and radial motions.
TERMS, RADIAL = 8, 16


class Disc:
    """A clamped disc: stiffness, mass, deflection of the middle, forces of second order.

    The membrane follows at once: its inertia is left out.
    """

    def __init__(self, radius: float, thickness: float, E: float, nu: float, rho: float) -> None:
        x, weight = leggauss(120)
        s, weight = (x + 1) / 2, weight / 2
        s, weight = s**2, weight * 2 * s  # fine at the middle, where slopes are ρ ln ρ
        r, area = radius * s, 2 * np.pi * radius**2 * s * weight
        square, rim = Polynomial([0, 0, 1]), Polynomial([1, 0, -1]) ** 2
        shapes = [rim * _legendre(i)(square) for i in range(TERMS)]
        w, slope, bend = (
            np.array([(p.deriv(k) if k else p)(s) for p in shapes]) / radius**k for k in range(3)
        )
        w = np.vstack([1 - s**2 + 2 * s**2 * np.log(s), w])
        slope = np.vstack([4 * s * np.log(s) / radius, slope])
        bend = np.vstack([4 * (np.log(s) + 1) / radius**2, bend])
        held = [Polynomial([0, 1]) * Polynomial([1, 0, -1]) * _legendre(j) for j in range(RADIAL)]
        radial = np.stack(
            [np.array([p.deriv()(s) for p in held]) / radius, np.array([p(s) for p in held]) / r]
        )
        C = np.array([[1, nu], [nu, 1]]) * E * thickness / (1 - nu**2)

        def gram(a, b):
            return np.einsum("aiq,ab,bjq,q->ij", a, C, b, area, optimize=True)

        curved = np.stack([bend, slope / r])
        self.K = gram(curved, curved) * thickness**2 / 12
        self.M = rho * thickness * np.einsum("iq,jq,q->ij", w, w, area)
        self.middle = np.append(1.0, [p(0.0) for p in shapes])
        n = len(w)
        pairs = (slope[:, None] * slope[None]).reshape(n * n, -1) / 2
        strain = np.stack([pairs, 0 * pairs])
        across, own = gram(strain, radial), gram(radial, radial)
        self._quartic = gram(strain, strain) - across @ np.linalg.solve(own, across.T)
        self._count = n

    def forces(self, q: np.ndarray) -> np.ndarray:
        """Of second-order strain on q (n,)."""
        pull = (self._quartic @ np.outer(q, q).ravel()).reshape(self._count, -1)
        return (pull + pull.T) @ q

    def impact(self, mass, speed, k, duration, exponent=1.5):
        """(largest force, largest deflection of the middle) under a mass by k δ^exponent."""
        inverse, n, b = np.linalg.inv(self.M), self._count, self.middle

        def force(x):
            return k * max(x[-2] - b @ x[:n], 0.0) ** exponent

        def rate(_, x):
            F = force(x)
            rise = inverse @ (b * F - self.K @ x[:n] - self.forces(x[:n]))
            return np.concatenate([x[n : 2 * n], rise, [x[-1], -F / mass]])

        start = np.zeros(2 * n + 2)
        start[-1] = speed
        times = np.linspace(0, duration, 4001)
        x = solve_ivp(rate, (0, duration), start, "DOP853", times, rtol=1e-6, atol=1e-9).y
        return max(force(one) for one in x.T), np.abs(b @ x[:n]).max()


def _legendre(i: int) -> Polynomial:
    """P_i(2x − 1)."""
    return Legendre.basis(i, domain=[0, 1]).convert(kind=Polynomial)
