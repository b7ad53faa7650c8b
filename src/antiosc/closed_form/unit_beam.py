"""A uniform beam with a site, in units of its length L, EI/L² and rhoA: responses and eigenvalues.

The two segments beside the site are solved exactly at a given Ω = ω²/`omega_unit`². Eigenvalues are
counted by Wittrick and Williams's rule, so that none is missed, and bracketed by bisection.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError
from antiosc.closed_form import waves

#: End supports: which of the state (w, θ, Q, M) they hold at zero.
ENDS = {"free": (2, 3), "pinned": (0, 3), "clamped": (0, 1), "guided": (1, 2)}
#: A pole and a zero of Z closer than this (relative, in ω) belong to an unobservable mode.
SAME_ROOT = 1e-9


class Response(NamedTuple):
    """A harmonic response, in units of L, EI/L² and rhoA."""

    value: float  # H under F = 1, Z under w = 1
    mass: float  # ∫ w² + alpha θ² dx
    moved: Array  # ∫ w dx and ∫ w (x - 1/2) + alpha θ dx
    w: Array  # at the points asked for


@dataclass(frozen=True)
class UnitBeam:
    """A beam of length 1 with its end supports and the site.

    Attributes
    ----------
    alpha, eta : rotary inertia and shear compliance over those of the length, as of `UniformBeam`.
    left, right : names of `ENDS`.
    site : distance of the site from the left end, 0 to 1.
    """

    alpha: float
    eta: float
    left: str
    right: str
    site: float

    @property
    def segments(self) -> list[tuple[float, float]]:
        """(start, length) of the one or two segments beside the site, in units of L."""
        a = self.site
        return [(s, length) for s, length in ((0.0, a), (a, 1 - a)) if length > 0]

    @cached_property
    def rigid(self) -> Array:
        """Rigid modes (p, q), w = p + qx and θ = q, as columns: shape (2, r)."""
        rows = [
            (1.0, end) if which == 0 else (0.0, 1.0)
            for end, support in ((0.0, self.left), (1.0, self.right))
            for which in ENDS[support]
            if which < 2
        ]
        return null_space(np.array(rows)) if rows else np.eye(2)

    def moved(self, x: Array, w: Array, theta: Array) -> Array:
        """Momentum and angular momentum about mid-span at points x: (n, 2)."""
        return np.column_stack((w, w * (x - 0.5) + self.alpha * theta))

    def _states(self, Omega: float, length: float, x: Array) -> Array:
        alpha, eta = self.alpha, self.eta
        if Omega == 0:
            return waves.static_states(eta, x)
        return waves.harmonic_states(Omega, alpha, eta, length, x)

    def solve(self, Omega: float, *, force: bool) -> tuple[list[Array], float]:
        """Coefficients of each segment's solutions under F = 1, or w = 1, at the site; and F."""
        segments = self.segments
        size = 4 * len(segments)
        ends = [
            self._states(Omega, length, np.array([0.0, length])) for _, length in segments
        ]  # each (state, end, solution)
        rows: list[Array] = []

        def row(*terms: tuple[int, Array]) -> None:
            line = np.zeros(size)
            for segment, values in terms:
                line[4 * segment : 4 * segment + 4] += values
            rows.append(line)

        last = len(segments) - 1
        # The force at the site: Q jumps down by F there, beyond an end Q is zero.
        jump = np.zeros(size)
        at_left, at_right = self.site == 0, self.site == 1
        if not at_left:
            jump[:4] += ends[0][2, 1]
        if not at_right:
            jump[4 * last :] -= ends[last][2, 0]
        for segment, end, support, struck in (
            (0, 0, self.left, at_left),
            (last, 1, self.right, at_right),
        ):
            for which in ENDS[support]:
                if not (struck and which == 2):
                    row((segment, ends[segment][which, end]))
        if last == 1:
            for which in (0, 1, 3):
                row((0, ends[0][which, 1]), (1, -ends[1][which, 0]))
        deflection = np.zeros(size)
        deflection[:4] = ends[0][0, 0 if at_left else 1]
        rows.append(jump if force else deflection)
        A = np.array(rows)
        scale = np.abs(A).max(axis=1)
        load = np.zeros(size)
        load[-1] = 1 / scale[-1]
        try:
            c = np.linalg.solve(A / scale[:, None], load)
        except np.linalg.LinAlgError:
            raise AccuracyError(
                f"the beam has no bounded response at Ω = {Omega:g}: that is one of its own"
                " frequencies; choose another one."
            ) from None
        return [c[4 * s : 4 * s + 4] for s in range(len(segments))], float(jump @ c)

    def state(self, Omega: float, c: list[Array], x: Array) -> tuple[Array, Array]:
        """w and θ at points x of the solution with coefficients c."""
        w, theta = np.empty_like(x), np.empty_like(x)
        for (start, length), coefficients in zip(self.segments, c, strict=True):
            here = (x >= start) & (x <= start + length)
            states = self._states(Omega, length, x[here] - start)
            w[here], theta[here] = states[0] @ coefficients, states[1] @ coefficients
        return w, theta

    def respond(self, Omega: float, *, force: bool, x: Array | None = None) -> Response:
        """Harmonic response to F = 1, or to w = 1, at the site; its w at x."""
        c, reaction = self.solve(Omega, force=force)
        (mu1, _), (mu2, _) = waves.wave_roots(Omega, self.alpha, self.eta)
        shortest = float(np.sqrt(max(abs(mu1), abs(mu2))))
        nodes, weights = np.polynomial.legendre.leggauss(12)
        mass, moved = 0.0, np.zeros(2)
        for start, length in self.segments:
            panels = int(np.ceil(shortest * length / 2)) + 1
            h = length / panels
            points = start + h * (np.arange(panels)[:, None] + (nodes + 1) / 2).ravel()
            w, theta = self.state(Omega, c, points)
            rule = h / 2 * np.tile(weights, panels)
            mass += float(rule @ (w**2 + self.alpha * theta**2))
            moved += rule @ self.moved(points, w, theta)
        at_site = self.state(Omega, c, np.array([self.site]))[0][0]
        shape = np.empty(0) if x is None else self.state(Omega, c, x)[0]
        return Response(at_site if force else reaction, mass, moved, shape)

    def _count(self, Omega: Array, *, constrained: bool) -> NDArray[np.int64]:
        """Number of eigenvalues below Ω, zero ones included (Wittrick-Williams)."""
        alpha, eta = self.alpha, self.eta
        segments = self.segments
        nodes = len(segments) + 1
        K = np.zeros((len(Omega), 2 * nodes, 2 * nodes))
        count = np.zeros(len(Omega), dtype=np.int64)
        for s, (_, length) in enumerate(segments):
            part = slice(2 * s, 2 * s + 4)
            K[:, part, part] += waves.member_stiffness(Omega, alpha, eta, length)
            count += waves.clamped_count(Omega, alpha, eta, length)
        fixed = {which for which in ENDS[self.left] if which < 2}
        fixed |= {2 * nodes - 2 + which for which in ENDS[self.right] if which < 2}
        if constrained:
            fixed.add(0 if self.site == 0 else 2)
        free = [dof for dof in range(2 * nodes) if dof not in fixed]
        if not free:
            return count
        K = K[:, free][:, :, free]
        # Signs do not change under scaling; rows of one size keep the digits of small entries.
        d = 1 / np.sqrt(np.maximum(np.abs(K).max(axis=2), np.finfo(float).tiny))
        return count + np.sum(np.linalg.eigvalsh(K * d[:, :, None] * d[:, None, :]) < 0, axis=1)

    def eigenvalues(self, n: int, *, constrained: bool) -> Array:
        """The first n eigenvalues Ω > 0 with the site free or constrained, by bisection."""
        rigid = self.rigid.shape[1]
        if constrained and rigid:  # one rigid motion less: the site sees every straight beam's
            rigid -= 1
        low = 0.1 / (1 + self.alpha + self.eta)
        if self._count(np.array([low]), constrained=constrained)[0] != rigid:
            raise AccuracyError(
                f"the count of eigenvalues below Ω = {low:g} is not the number of rigid modes,"
                f" {rigid}: the site is too close to an end for this beam."
            )
        high = 1e3 * low
        while self._count(np.array([high]), constrained=constrained)[0] < n + rigid:
            high *= 4
        # Bisection in Ω^(1/4), in which the spectrum is evenly spread.
        lo, hi = np.full(n, low**0.25), np.full(n, high**0.25)
        wanted = rigid + 1 + np.arange(n)
        while np.any(hi - lo > 1e-12 * hi):
            middle = (lo + hi) / 2
            enough = self._count(middle**4, constrained=constrained) >= wanted
            lo, hi = np.where(enough, lo, middle), np.where(enough, middle, hi)
        return ((lo + hi) / 2) ** 4

    def spectra(self, n: int) -> tuple[Array, Array]:
        """The first n observable poles and zeros of Z, as Ω: the two spectra, common ones out."""
        asked = 2 * n + 4
        while True:
            poles, zeros = (self.eigenvalues(asked, constrained=p) for p in (True, False))
            top = min(poles[-1], zeros[-1]) * (1 + SAME_ROOT)
            poles, zeros = _unmatched(poles[poles <= top], zeros[zeros <= top])
            if min(len(poles), len(zeros)) >= n:
                return poles[:n], zeros[:n]
            asked *= 2


def _unmatched(a: Array, b: Array) -> tuple[Array, Array]:
    """Two ascending lists without the pairs they share (each entry pairs at most once)."""
    keep_a, keep_b = np.ones(len(a), dtype=bool), np.ones(len(b), dtype=bool)
    i = j = 0
    while i < len(a) and j < len(b):
        if abs(a[i] - b[j]) <= 2 * SAME_ROOT * b[j]:
            keep_a[i] = keep_b[j] = False
            i, j = i + 1, j + 1
        elif a[i] < b[j]:
            i += 1
        else:
            j += 1
    return a[keep_a], b[keep_b]
