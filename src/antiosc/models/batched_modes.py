"""Constraint modes of many sites at once, in the coordinates of their free modes.

In the J + 1 coordinates of the free modes (`antiosc.models.free_modes`) the stiffness is diagonal,
D = diag(w_j^2). The flexibility with the site constrained is a rank-one change of A^-1,
T = A^-1 - A^-1 b b'A^-1/C with A = D + shift. Its eigenvectors are the constraint modes, and the
antiresonances are 1/theta - shift of its eigenvalues theta: the zeros of H.
"""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array
from antiosc.models import driving_point

#: Relative norm of a new direction after orthogonalisation, below which the space is exhausted.
EXHAUSTED = 1e-10
#: An eigenvalue of T below this share of the largest is rounding error.
NULL_SHARE = 1e-13
#: Sqrt of the share of m_st at the site that is rounding.
MASSLESS = 1e-12


def parameters(
    omega: Array, b: Array, r: Array, s: Array, n: int, shift: float, method: str
) -> tuple[Array, Array, Array, Array, Array]:
    """(k0, m0, m_st, omega, m) of S sites: (S,) each, and (S, n).

    Parameters
    ----------
    omega, b : free frequencies (J,), and the displacements (S, J) of the sites in the free modes.
    r, s : (S,) residual compliances and inertias of the modes left out.
    n, shift, method : as of `antiosc.models.free_modes.from_free_modes`.
    """
    heavy = s > 0
    above = np.where(heavy, r / np.where(heavy, s, 1.0), omega[-1] ** 2 + shift)
    A = np.column_stack([np.broadcast_to(omega**2 + shift, b.shape), above])
    b = np.column_stack([b, np.sqrt(np.where(heavy, r * above, 0.0))])
    massless = np.where(heavy, 0.0, r)
    bAb = np.sum(b**2 / A, axis=1) + massless
    rigid = np.append(omega == 0, False)
    deflection = np.where(rigid, 0.0, b / np.where(rigid, 1.0, A - shift))
    C = np.sum(b * deflection, axis=1) + massless
    # the static mode, or the rigid-body mode in its place
    along = np.sum(b[:, rigid] ** 2, axis=1)
    free = along > 0
    swing = np.where(rigid, b, 0.0) / np.where(free, along, 1.0)[:, None]
    phi = np.where(free[:, None], swing, deflection / C[:, None])
    m_st = np.sum(phi**2, axis=1)
    solve = _lanczos if method == "krylov" else _eigenpairs
    theta, c, left = solve(A, b, bAb, massless, phi, n)
    k0, m = np.where(free, 0.0, 1 / C), c**2
    with np.errstate(divide="ignore"):
        x = np.where(theta > 0, 1 / theta - shift, np.inf)
    real = np.isfinite(x) & (x > 0)
    rest = left + np.sum(np.where(real, 0.0, m), axis=1)
    share = driving_point.shares(k0, rest, np.where(real, m, 0.0), np.where(real, x, 1.0))
    seen = share > driving_point.UNOBSERVABLE
    order = np.argsort(np.where(seen, x, np.inf), axis=1, kind="stable")
    x, m, seen = (np.take_along_axis(a, order, axis=1) for a in (x, m, seen))
    seen[:, n:] = False
    m0 = left + np.sum(np.where(seen, 0.0, m), axis=1)  # what is not kept, no difference
    m0 = np.where(m0 <= MASSLESS**2 * m_st, 0.0, m0)
    frequency = np.sqrt(np.where(seen, x, np.inf))[:, :n]
    return k0, m0, m_st, frequency, np.where(seen, m, 0.0)[:, :n]


def _eigenpairs(
    A: Array, b: Array, bAb: Array, massless: Array, phi: Array, n: int
) -> tuple[Array, Array, Array]:
    """All eigenvalues of T, the parts of phi in them (S, J + 1) each, and the mass left (S,)."""
    y = b / A
    T = -y[:, :, None] * y[:, None, :] / bAb[:, None, None]
    diagonal = np.arange(A.shape[1])
    T[:, diagonal, diagonal] += 1 / A
    theta, z = np.linalg.eigh(T)
    # T b = 0 where nothing is massless
    theta = np.where(theta > NULL_SHARE * theta[:, -1:], theta, 0.0)
    return theta, np.einsum("sji,sj->si", z, phi), np.zeros(len(b))


def _lanczos(
    A: Array, b: Array, bAb: Array, massless: Array, phi: Array, n: int
) -> tuple[Array, Array, Array]:
    """The n Ritz values of T from the start T phi in the inner product of A; as `_eigenpairs`.

    As `antiosc.fem.extraction.krylov`; a massless residual compliance r takes up b'v, which adds
    (b'v)^2/r to v'Av, and without one b'v = 0.
    """
    y = b / A
    soft = massless > 0
    stiff = np.where(soft, 1 / np.where(soft, massless, 1.0), 0.0)
    pin = np.where(soft, 0.0, 1 / np.where(soft, 1.0, np.sum(b * y, axis=1)))

    def flexed(v: Array) -> Array:
        return np.asarray(v / A - y * (np.sum(y * v, axis=1) / bAb)[:, None])

    def force(v: Array) -> Array:
        return np.asarray(A * v + b * (stiff * np.sum(b * v, axis=1))[:, None])

    sites, size = phi.shape
    V, F = np.zeros((sites, n, size)), np.zeros((sites, n, size))
    H = np.zeros((sites, n, n))
    w = flexed(phi)
    for k in range(n):
        before = np.sum(w * force(w), axis=1)
        for _ in range(2):  # twice is enough (Kahan)
            h = np.einsum("skj,sj->sk", F[:, :k], w)
            w = w - np.einsum("skj,sk->sj", V[:, :k], h)
            w = w - y * (pin * np.sum(b * w, axis=1))[:, None]
        f = force(w)
        left = np.sum(w * f, axis=1)
        real = left > EXHAUSTED**2 * before
        beta = np.sqrt(np.where(real, left, 0.0))
        scale = np.where(real, 1 / np.where(real, beta, 1.0), 0.0)[:, None]
        V[:, k], F[:, k] = w * scale, f * scale
        H[:, : k + 1, k] = H[:, k, : k + 1] = np.einsum("skj,sj->sk", V[:, : k + 1], V[:, k])
        w = flexed(V[:, k])
    theta, turn = np.linalg.eigh(H)
    theta = np.where(theta > 0, theta, 0.0)
    scale = np.where(theta > 0, 1 / np.sqrt(np.where(theta > 0, theta, 1.0)), 0.0)
    shapes = np.einsum("skj,ski->sji", V, turn) * scale[:, None]
    left, c = phi, np.zeros_like(theta)
    for _ in range(2):  # twice is enough (Kahan)
        part = np.einsum("sji,sj->si", shapes, left)
        c, left = c + part, left - np.einsum("sji,si->sj", shapes, part)
    return theta, c, np.sum(left**2, axis=1)
