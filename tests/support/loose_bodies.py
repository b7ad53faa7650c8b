"""Random structures of a few bodies, masses and springs over eight decades, and their exact Z.

The springs are integers of few digits times powers of two, so that K has no rounding and the
rigid-body motions are its exact null vectors. The reference knows nothing of modes: elimination at
each frequency, in extended precision where a bound on its rounding allows that, else in many more
digits.
"""

from __future__ import annotations

import mpmath
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Largest relative error of the reference.
REFERENCE = 1e-10
#: Decimal digits where extended precision is not enough.
DIGITS = 60


def loose_bodies(
    rng: np.random.Generator, rigid: int, along: float | None = None
) -> tuple[Array, Array, Array]:
    """(K, M, b) of `rigid` loose bodies (0: one that is supported).

    Most bodies are pushed by forces in equilibrium, plus a little along their rigid motion:
    `along`, or something between 1e-15 and 1.
    """
    sizes = rng.integers(3, 8, max(rigid, 1))
    n = int(sizes.sum())
    K, b = np.zeros((n, n)), np.zeros(n)

    def spring() -> float:
        return float(rng.integers(512, 1024)) * 2.0 ** int(rng.integers(0, 27))

    first = 0
    for size in sizes:
        pairs = [(i, int(rng.integers(0, i))) for i in range(1, size)]
        pairs += [tuple(rng.choice(size, 2, replace=False)) for _ in range(size // 2)]
        for i, j in pairs:
            e = np.zeros(n)
            e[first + i], e[first + j] = 1.0, -1.0
            K += spring() * np.outer(e, e)
        push = rng.integers(-64, 64, size).astype(float)
        if rigid and rng.integers(4):
            push[-1] -= push.sum()
            push[0] += 10 ** rng.uniform(-15, 0) if along is None else along
        b[first : first + size] = push
        first += size
    if not rigid:
        for i in rng.choice(n, 2, replace=False):
            K[i, i] += spring()
    if not b.any():
        b[0] = 1.0
    return K, np.diag(10 ** rng.uniform(-4, 4, n)), b


def exact_stiffness(
    K: Array, M: Array, b: Array, omega: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Z = 1/(b'(K - omega^2 M)^-1 b) (W,) with a relative error of at most REFERENCE.

    Elimination with pivoting gives the y of a matrix changed by E, |E| <= n eps |K - omega^2 M|,
    and E changes b'y by y'Ey (Higham, Accuracy and Stability of Numerical Algorithms, ch. 9).
    """
    y = _deflections(K, M, b[:, None], omega)[:, :, 0]
    H, far = y @ b, np.abs(y)
    size = np.abs(K) + np.abs(omega**2)[:, None, None] * M
    energy = np.einsum("wi,wij,wj->w", far, size, far) + far @ np.abs(b)
    doubt = len(b) * np.finfo(np.longdouble).eps * energy / np.abs(H)
    for w in np.flatnonzero(doubt > REFERENCE):
        H[w] = _with_many_digits(K, M, b, omega[w])
    return np.asarray(1 / H, dtype=complex)


def _with_many_digits(K: Array, M: Array, b: Array, omega: complex) -> complex:
    with mpmath.workdps(DIGITS):
        k, m, load = (mpmath.matrix(a.tolist()) for a in (K, M, b))
        y = mpmath.lu_solve(k - mpmath.mpc(omega) ** 2 * m, load)
        return complex(mpmath.fdot(load, y))


def exact_receptances(
    K: Array, M: Array, B: Array, omega: NDArray[np.complex128]
) -> tuple[NDArray[np.clongdouble], NDArray[np.clongdouble]]:
    """B'(K - omega^2 M)^-1 B (W, p, p) in two ways: the elimination in two orders."""
    turned = np.arange(len(B))[::-1]
    return (
        B.T @ _deflections(K, M, B, omega),
        B[turned].T @ _deflections(K[turned][:, turned], M[turned][:, turned], B[turned], omega),
    )


def _deflections(
    K: Array, M: Array, B: Array, omega: NDArray[np.complex128]
) -> NDArray[np.clongdouble]:
    """(K - omega^2 M)^-1 B (W, n, p) by elimination in extended precision."""
    x = omega.astype(np.clongdouble) ** 2
    scale = 1 / np.sqrt(np.diag(K) + np.abs(x)[:, None] * np.diag(M))
    load = (scale[:, :, None] * B).astype(np.clongdouble)
    A = (K.astype(np.longdouble) - x[:, None, None] * M) * scale[:, :, None] * scale[:, None, :]
    return np.asarray(scale[:, :, None] * solved(A, load))


def solved(A: NDArray[np.clongdouble], load: NDArray[np.clongdouble]) -> NDArray[np.clongdouble]:
    """A^-1 load for stacks of matrices (W, n, n) and (W, n, p), in extended precision."""
    n, W = A.shape[1], np.arange(len(A))
    A = np.concatenate([A, load], axis=2)
    for k in range(n):
        pivot = k + np.argmax(np.abs(A[:, k:, k]), axis=1)
        A[W, pivot], A[:, k] = A[:, k].copy(), A[W, pivot]
        factor = A[:, k + 1 :, k] / A[:, k, k][:, None]
        A[:, k + 1 :, k:] -= factor[:, :, None] * A[:, k, k:][:, None, :]
    y = np.zeros(load.shape, np.clongdouble)
    for k in reversed(range(n)):
        known = np.einsum("wj,wjp->wp", A[:, k, k + 1 : n], y[:, k + 1 :])
        y[:, k] = (A[:, k, n:] - known) / A[:, k, k][:, None]
    return y
