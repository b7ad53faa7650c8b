"""A passive body in modes, as it is fitted to measured receptances.

Between the sites m and n, at the circular frequency w,

    H_mn = sum_j b_jm b_jn D_j(w) - sum_k a_mk a_nk/w^2 + sum_k l_mk l_nk,
    D_j = 1/(w_j^2 - w^2 + 2i zeta_j w_j w)  viscous,  1/(w_j^2 (1 + 2i zeta_j) - w^2)  hysteretic:

modes of rank one, rigid-body motions a, and a residual compliance l l'. Every term is semidefinite:
whatever the parameters, the body is passive. The last modes lie above the measured band; of these
something is known beforehand (`Tail`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from antiosc.base._types import Array, ComplexArray, Index

#: Columns of a measurement: (response, excitation), numbers of sites.
Pairs = list[tuple[int, int]]
#: The lowest mode above the band lies at least this share above its top.
BEYOND = 0.02
#: Damping ratio where no mode is seen; least square of a displacement over the expected one.
TYPICAL, LEAST_SQUARE = 0.01, 1e-3
#: Modes above the band: the highest over its top, the least distance over the frequency, and the
#: modes in the band whose mean distance and mean square go on.
TAIL_END, TAIL_STEP, GOING_ON = 5.0, 0.15, 6
#: Standard deviations: of a frequency over the distance, of a square over the mean.
SPREAD, DOUBT = 0.5, 1.0
#: Variance of the relative mean square times the number of modes that it is taken of.
FEW = 2.0
#: Standard deviation of the logarithm of all distances.
STRETCH = 0.3


@dataclass(frozen=True, eq=False)
class Tail:
    """Expected modes above the band: omega (U,) [rad/s] and squares b2 (U, p) of the displacements
    [1/kg], with relative standard deviations (U,) of either."""

    omega: Array
    spread: Array
    b2: Array
    doubt: Array


@dataclass(frozen=True, eq=False)
class Modes:
    """The parameters of the fit.

    Attributes
    ----------
    omega, zeta : (J,) frequencies [rad/s] and damping ratios; the last U modes are the tail.
    b : (J, p) displacements of the sites in modes of unit mass [kg^-1/2].
    tail : what is known of the last modes beforehand; their damping ratios are given.
    root, rigid : (p, p) l and a, lower triangles [(m/N)^1/2], [kg^-1/2]; rigid None: supported.
    hysteretic : the form of the damping.
    """

    omega: Array
    zeta: Array
    b: Array
    tail: Tail
    root: Array
    rigid: Array | None = None
    hysteretic: bool = False

    @property
    def seen(self) -> int:
        """Number of modes in the band."""
        return len(self.omega) - len(self.tail.omega)

    def receptance(self, w: Array, pairs: Pairs) -> ComplexArray:
        """H (W, M) of the pairs at circular frequencies (W,) [rad/s]."""
        D = factors(w, self.omega, self.zeta, self.hysteretic)
        m, n = np.array(pairs).T
        H = D @ (self.b[:, m] * self.b[:, n]) + (self.root @ self.root.T)[m, n]
        if self.rigid is not None:
            H = H - (self.rigid @ self.rigid.T)[m, n] / w[:, None] ** 2
        return np.asarray(H)

    def jacobian(self, w: Array, pairs: Pairs) -> ComplexArray:
        """Derivatives (W, M, n) of H by `values`."""
        D = factors(w, self.omega, self.zeta, self.hysteretic)
        m, n = np.array(pairs).T
        at, p = w[:, None], self.b.shape[1]
        weight = (self.b[:, m] * self.b[:, n]).T  # (M, J)
        loss = self.zeta * self.omega * (self.omega if self.hysteretic else at)
        square = D * D
        by_zeta = -2j * loss * square
        by_omega = -2 * self.omega**2 * square + by_zeta * (2 if self.hysteretic else 1)
        band = slice(self.seen)
        blocks = [by_omega[:, None, :] * weight, by_zeta[:, None, band] * weight[:, band]]
        # d(b_m b_n)/db_s = [m = s] b_n + [n = s] b_m, of every mode and site
        moved = np.zeros((len(pairs), len(self.omega), p))
        columns = np.arange(len(pairs))
        moved[columns, :, m] += self.b[:, n].T
        moved[columns, :, n] += self.b[:, m].T
        blocks.append((D[:, None, :, None] * moved).reshape(len(w), len(pairs), -1))
        for L, factor in ((self.rigid, -1 / at**2), (self.root, np.ones_like(at))):
            if L is not None:
                blocks.append(factor[:, :, None] * _of_root(L, m, n))
        return np.concatenate(blocks, axis=2)

    def expected(self) -> Array:
        """What the tail is off its expectation, in standard deviations (E,)."""
        omega, b, tail = self.omega[self.seen :], self.b[self.seen :], self.tail
        off = (b**2 - tail.b2) / (tail.doubt[:, None] * tail.b2)
        return np.append(np.log(omega / tail.omega) / tail.spread, off)

    def expected_jacobian(self) -> Array:
        """Derivatives (E, n) of `expected` by `values`."""
        seen, p, U = self.seen, self.b.shape[1], len(self.tail.omega)
        J = np.zeros((U + U * p, sum(self.sizes)))
        J[np.arange(U), seen + np.arange(U)] = 1 / self.tail.spread
        first = len(self.omega) + seen + seen * p
        slope = 2 * self.b[seen:] / (self.tail.doubt[:, None] * self.tail.b2)
        J[U + np.arange(U * p), first + np.arange(U * p)] = slope.ravel()
        return J

    @property
    def sizes(self) -> list[int]:
        """Numbers of `values` of each kind."""
        triangle = len(self.root) * (len(self.root) + 1) // 2
        rigid = 0 if self.rigid is None else triangle
        return [len(self.omega), self.seen, self.b.size, rigid, triangle]

    @property
    def values(self) -> Array:
        """All parameters: ln omega, ln zeta of modes in the band, b, a and l."""
        lower = _lower(len(self.root))
        parts = [np.log(self.omega), np.log(self.zeta[: self.seen]), self.b.ravel()]
        return np.concatenate(parts + [L[lower] for L in (self.rigid, self.root) if L is not None])

    def at(self, values: Array) -> Modes:
        """The same body with other `values`."""
        omega, zeta, b, rigid, root = np.split(values, np.cumsum(self.sizes)[:-1])
        p = len(self.root)
        return replace(
            self,
            omega=np.exp(omega),
            zeta=np.append(np.exp(zeta), self.zeta[self.seen :]),
            b=b.reshape(self.b.shape),
            root=_triangle(root, p),
            rigid=None if self.rigid is None else _triangle(rigid, p),
        )

    def with_seen(self, omega: Array, zeta: Array, b: Array) -> Modes:
        """The body with other modes in the band."""
        order, seen = np.argsort(omega), self.seen
        return replace(
            self,
            omega=np.append(omega[order], self.omega[seen:]),
            zeta=np.append(zeta[order], self.zeta[seen:]),
            b=np.vstack((b[order], self.b[seen:])),
        )


def factors(w: Array, omega: Array, zeta: Array, hysteretic: bool) -> ComplexArray:
    """D (W, J) at circular frequencies (W,) of modes (J,)."""
    at = w[:, None]
    # in real numbers and in place: a complex quotient takes twice as long
    stiff, loss = omega**2 - at**2, 2 * zeta * omega * (omega if hysteretic else at)
    size = stiff**2 + loss**2
    np.reciprocal(size, out=size)
    D = np.empty(size.shape, dtype=complex)
    np.multiply(stiff, size, out=D.real)
    np.multiply(-loss, size, out=D.imag)
    return D


def _of_root(L: Array, m: Index, n: Index) -> Array:
    """Derivatives (M, p(p+1)/2) of (L L')_mn by the lower triangle of L."""
    rows, columns = _lower(len(L))
    by_m = (m[:, None] == rows) * L[n][:, columns]
    by_n = (n[:, None] == rows) * L[m][:, columns]
    return np.asarray(by_m + by_n, dtype=float)


def _triangle(values: Array, size: int) -> Array:
    L = np.zeros((size, size))
    L[_lower(size)] = values
    return L


@cache
def _lower(size: int) -> tuple[Index, Index]:
    """Rows and columns of a lower triangle."""
    return np.tril_indices(size)


# -- what is expected of the modes above the band: they go on as the last ones in it


def expected_tail(modes: Modes, top: float) -> Tail:
    """Modes that go on above `top` [rad/s] as the last ones in the band, in growing distances.

    Where the distances grow beyond those of the part, each stands for several modes.
    """
    seen = modes.seen
    omega, last = modes.omega[:seen], slice(max(seen - GOING_ON, 0), seen)
    own = np.append(0.0, omega)[-GOING_ON - 1 :]
    gap = max(float(own[-1] - own[0]) / max(len(own) - 1, 1), 0.01 * top) if seen else top
    rigid = modes.root if modes.rigid is None else modes.rigid
    least = np.sum(rigid**2, axis=1) * (top**2 if modes.rigid is None else 0.5)
    mean = np.sum(modes.b[last] ** 2, axis=0) / max(min(seen, GOING_ON), 1)
    b2 = np.maximum(mean, least) + np.finfo(float).tiny
    at = [max((float(omega[-1]) if seen else 0.0) + gap, (1 + 2 * BEYOND) * top)]
    steps = []
    while at[-1] < TAIL_END * top or len(at) < 3:
        steps.append(max(gap, TAIL_STEP * at[-1]))
        at.append(at[-1] + steps[-1])
    step = np.array([*steps, steps[-1]])
    many = np.maximum(step / gap, 1.0)
    doubt = np.sqrt(DOUBT**2 / many + FEW / max(seen, 0.5))
    return Tail(np.array(at), SPREAD * step / np.array(at), many[:, None] * b2, doubt)


def with_tail(modes: Modes, tail: Tail) -> Modes:
    """The body with a tail as it is expected; the signs of its displacements are drawn."""
    seen, U = modes.seen, len(tail.omega)
    typical = float(np.median(modes.zeta[:seen])) if seen else TYPICAL
    signs = np.random.default_rng(0).choice((-1.0, 1.0), tail.b2.shape)
    signs[:, 0] = 1.0
    return replace(
        modes,
        omega=np.append(modes.omega[:seen], tail.omega),
        zeta=np.append(modes.zeta[:seen], np.full(U, typical)),
        b=np.vstack((modes.b[:seen], signs * np.sqrt(tail.b2))),
        tail=tail,
    )


def drawn(tail: Tail, top: float, random: np.random.Generator) -> Tail:
    """Another tail as probable: all its modes nearer or farther, then each."""
    U = len(tail.omega)
    stretch = np.exp(STRETCH * random.standard_normal())
    omega = top + stretch * (tail.omega - top)
    omega = omega * np.exp(tail.spread * random.standard_normal(U))
    b2 = stretch * tail.b2 * np.abs(1 + tail.doubt[:, None] * random.standard_normal(tail.b2.shape))
    omega = np.maximum(np.sort(omega), (1 + BEYOND) * top)
    return replace(tail, omega=omega, b2=np.maximum(b2, LEAST_SQUARE * tail.b2))
