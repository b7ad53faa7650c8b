"""An independent beam for tests: Timoshenko's K and M in Legendre polynomials, two segments.

It shares nothing with `antiosc.models.closed_form`: no characteristic equation, no wave numbers.
Each segment carries w and the rotation as polynomials, so the lowest modes converge exponentially.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre, legendre
from scipy.linalg import eigh, null_space, solve

from antiosc.models.closed_form import UniformBeam


class SpectralBeam:
    """K, M, the site functional b and the basis values of a struck beam, supports applied."""

    def __init__(self, beam: UniformBeam, left: str, right: str, site: float, degree: int = 40):
        n = degree + 1
        parts = [(s, h) for s, h in ((0.0, site), (site, beam.length - site)) if h > 0]
        size = 2 * n * len(parts)
        K, M = np.zeros((size, size)), np.zeros((size, size))
        nodes, weights = legendre.leggauss(degree + 2)
        V = legendre.legvander(nodes, degree)
        D = np.column_stack([Legendre.basis(i).deriv()(nodes) for i in range(n)])
        for p, (_, h) in enumerate(parts):
            w, t = (slice((2 * p + i) * n, (2 * p + i + 1) * n) for i in (0, 1))
            W = (weights * h / 2)[:, None]
            dV = D * 2 / h
            M[w, w] += beam.rhoA * V.T @ (W * V)
            M[t, t] += beam.rhoI * V.T @ (W * V)
            K[t, t] += beam.EI * dV.T @ (W * dV) + beam.kGA * V.T @ (W * V)
            K[w, w] += beam.kGA * dV.T @ (W * dV)
            K[w, t] -= beam.kGA * dV.T @ (W * V)
            K[t, w] -= beam.kGA * V.T @ (W * dV)
        at = {-1: legendre.legvander(np.array([-1.0]), degree)[0], 1: np.ones(n)}

        def trace(part: int, which: int, end: int) -> np.ndarray:
            row = np.zeros(size)
            row[(2 * part + which) * n : (2 * part + which + 1) * n] = at[end]
            return row

        held = {"free": (), "pinned": (0,), "clamped": (0, 1), "guided": (1,)}
        rows = [trace(0, i, -1) for i in held[left]]
        rows += [trace(len(parts) - 1, i, 1) for i in held[right]]
        if len(parts) == 2:
            rows += [trace(0, i, 1) - trace(1, i, -1) for i in (0, 1)]
        N = null_space(np.array(rows)) if rows else np.eye(size)
        self.K, self.M = N.T @ K @ N, N.T @ M @ N
        self.b = N.T @ (trace(0, 0, -1) if site == 0 else trace(0, 0, 1))

    def natural_frequencies(self) -> np.ndarray:
        return np.sqrt(np.maximum(eigh(self.K, self.M, eigvals_only=True), 0))

    def anti_oscillators(self) -> tuple[float, float, np.ndarray, np.ndarray]:
        """k0, m_st, m, omega by the article's definitions, for a structure without rigid modes."""
        y = solve(self.K, self.b, assume_a="pos")
        static = y / (self.b @ y)
        N = null_space(self.b[None, :])
        x, phi = eigh(N.T @ self.K @ N, N.T @ self.M @ N)
        m = (static @ self.M @ N @ phi) ** 2
        return 1 / (self.b @ y), static @ self.M @ static, m, np.sqrt(x)
