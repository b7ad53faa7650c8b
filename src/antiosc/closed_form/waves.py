"""Exact solutions of Timoshenko's beam equations on one segment, static and harmonic.

Everything here is dimensionless: lengths in L, deflections in L, forces in EI/L², moments in EI/L,
and Ω = ω² rhoA L⁴/EI. With alpha and η of `UniformBeam` and Q, M the shear force and the moment,

    w' = θ + η Q,   θ' = M,   Q' = -Ω w,   M' = -Q - alpha Ω θ.

w ~ exp(λx) needs μ = λ² with μ² + Ω (alpha + η) μ + Ω (Ω alpha η - 1) = 0. Its two roots have
opposite signs below the cut-off Ω = 1/(alpha η) (a wave and an edge effect) and are both negative
above (two waves: the first and the second spectrum). All formulae below stay finite through μ = 0
and do not overflow, however short the waves.

Source: S. P. Timoshenko (1921); the dynamic stiffness of such a member and the rule that counts
its eigenvalues: W. P. Howson, F. W. Williams, J. Sound Vib. 26 (1973) 503, and W. H. Wittrick,
F. W. Williams, Q. J. Mech. Appl. Math. 24 (1971) 263.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from antiosc.base._types import Array


def wave_roots(
    Omega: Array | float, alpha: float, eta: float
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Roots ((μ₁, β₁), (μ₂, β₂)) at Ω, where β = μ + Ωη couples the rotation: θ' = β w.

    Root 1 is the first spectrum's (always μ₁ < 0); root 2 changes sign at the cut-off.
    """
    Omega = np.asarray(Omega, dtype=float)
    spread = np.sqrt((Omega * (alpha - eta)) ** 2 + 4 * Omega)
    mu1 = -(Omega * (alpha + eta) + spread) / 2
    mu2 = -Omega * (1 - Omega * alpha * eta) / mu1
    # β₁β₂ = -Ω: take from the formula the one that does not cancel.
    if eta >= alpha:
        beta2 = (Omega * (eta - alpha) + spread) / 2
        beta1 = -Omega / beta2
    else:
        beta1 = (Omega * (eta - alpha) - spread) / 2
        beta2 = -Omega / beta1
    return (mu1, beta1), (mu2, beta2)


def even_odd(mu: Array, x: Array | float, half: float) -> tuple[Array, Array]:
    """cosh(λx) and sinh(λx)/λ with λ² = μ, both over cosh(λ·half) where they would grow."""
    mu, x = np.broadcast_arrays(np.asarray(mu, dtype=float), np.asarray(x, dtype=float))
    lam = np.sqrt(np.abs(mu))
    wave = mu <= 0
    # np.sinc(z/π) = sin(z)/z is exact at z = 0.
    cos, sin = np.cos(lam * x), x * np.sinc(lam * x / np.pi)
    a = np.where(wave, 1.0, lam)
    size = np.abs(x)
    decay = np.exp(-a * np.maximum(half - size, 0)) / (1 + np.exp(-2 * a * half))
    cosh = decay * (1 + np.exp(-2 * a * size))
    sinh = -decay * np.sign(x) * np.expm1(-2 * a * size) / a
    return np.where(wave, cos, cosh), np.where(wave, sin, sinh)


def harmonic_states(Omega: float, alpha: float, eta: float, length: float, x: Array) -> Array:
    """States (w, θ, Q, M) of four independent solutions at points x of a segment [0, length].

    Returns shape (4 states, len(x), 4 solutions).
    """
    half = length / 2
    xi = np.asarray(x, dtype=float) - half
    columns = []
    for mu, beta in wave_roots(Omega, alpha, eta):
        C, S = even_odd(mu, xi, half)
        columns.append((C, beta * S, -Omega * S, beta * C))
        size = 1 / np.sqrt(1 + np.abs(mu))
        columns.append(
            tuple(size * f for f in (mu * S, beta * C, -Omega * C, beta * mu * S)),
        )
    return np.moveaxis(np.array(columns), 0, -1)


def static_states(eta: float, x: Array) -> Array:
    """As `harmonic_states` at Ω = 0: the cubic with w, θ, M, Q at x = 0 as its coefficients."""
    x = np.asarray(x, dtype=float)
    o, i = np.zeros_like(x), np.ones_like(x)
    w = (i, x, x**2 / 2, eta * x - x**3 / 6)
    theta = (o, i, x, -(x**2) / 2)
    Q = (o, o, o, i)
    M = (o, o, i, -x)
    return np.array([np.stack(rows, axis=-1) for rows in (w, theta, Q, M)])


def _half_stiffness(Omega: Array, alpha: float, eta: float, length: float) -> tuple[Array, Array]:
    """(Q, M) from (w, θ) at the right end, for motions even and odd about the middle.

    Two symmetric matrices of shape (2, 2, len(Ω)).
    """
    (mu1, beta1), (mu2, beta2) = wave_roots(Omega, alpha, eta)
    C1, S1 = even_odd(mu1, length / 2, length / 2)
    C2, S2 = even_odd(mu2, length / 2, length / 2)
    cross = Omega * (S1 * C2 - S2 * C1)
    even = np.array(
        [
            [Omega * S1 * S2 * (beta1 - beta2), cross],
            [cross, C1 * C2 * (beta2 - beta1)],
        ]
    ) / _nonzero(beta2 * C1 * S2 - beta1 * S1 * C2)
    cross = Omega * (C1 * S2 * mu2 - C2 * S1 * mu1)
    odd = np.array(
        [
            [Omega * C1 * C2 * (beta1 - beta2), cross],
            [cross, mu1 * mu2 * S1 * S2 * (beta2 - beta1)],
        ]
    ) / _nonzero(mu1 * beta2 * S1 * C2 - mu2 * beta1 * S2 * C1)
    return even, odd


def _nonzero(determinant: Array) -> Array:
    # A bisection can land on an eigenvalue of the clamped segment: step off it.
    return np.where(determinant == 0, 1e-30, determinant)


def member_stiffness(Omega: Array, alpha: float, eta: float, length: float) -> Array:
    """Dynamic stiffness of a segment for (w, θ) at its two ends, shape (len(Ω), 4, 4)."""
    to_even = np.array([[0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5]])
    to_odd = np.array([[-0.5, 0, 0.5, 0], [0, 0.5, 0, 0.5]])
    even, odd = _half_stiffness(Omega, alpha, eta, length)
    return 2 * (
        np.einsum("ai,ab...,bj->...ij", to_even, even, to_even)
        + np.einsum("ai,ab...,bj->...ij", to_odd, odd, to_odd)
    )


def clamped_count(Omega: Array, alpha: float, eta: float, length: float) -> NDArray[np.int64]:
    """How many eigenvalues of the segment clamped at both ends lie below Ω.

    Those of the hinged segment are known (wave number nπ/length, in both spectra; n = 0 of the
    second is pure shear); each hinge made rigid takes a negative rotational stiffness away.
    """
    (mu1, _), (mu2, _) = wave_roots(Omega, alpha, eta)
    y1 = np.sqrt(-mu1) * length / np.pi
    y2 = np.sqrt(np.maximum(-mu2, 0)) * length / np.pi
    above = mu2 < 0
    hinged = (y1 + 1) // 2 + y1 // 2 + np.where(above, (y2 + 1) // 2 + y2 // 2 + 1, 0)
    even, odd = _half_stiffness(Omega, alpha, eta, length)
    return (hinged - (even[1, 1] < 0) - (odd[1, 1] < 0)).astype(np.int64)
