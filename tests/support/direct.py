"""Physical systems of scenes, integrated without modes or reduction: the references of scenes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

import antiosc as ao
from antiosc.impact.states import contact_forces, steps_at
from paths import demo

Array = NDArray[np.float64]


def chain(n: int, k: float, masses: Array, held: bool) -> tuple[Array, Array]:
    """Stiffness and mass of a row of masses on springs, on the ground at one end if `held`."""
    K = np.zeros((n, n))
    for i in range(n - 1):
        K[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    if held:
        K[0, 0] += k
    return K, np.diag(masses)


def beam(n: int, EI: float, rhoA: float, length: float, clamped: bool) -> tuple[Array, Array]:
    """Stiffness and mass of Euler-Bernoulli's beam in n Hermite elements; one end `clamped`."""
    K, M = demo("validation/hermite").hermite_beam(n, EI, rhoA, length)
    return (K[2:, 2:], M[2:, 2:]) if clamped else (K, M)


def free_modes(K: Array, M: Array, B: Array) -> tuple[Array, Array]:
    """Frequencies, and displacements of the columns of B in the mass-normalised modes."""
    x, phi = eigh(K, M)
    x[x < 1e-10 * x[-1]] = 0.0
    return np.sqrt(x), phi.T @ B


def physical(
    K: Array,
    M: Array,
    rows: Array,
    gaps: Array,
    k: float,
    n: float,
    v0: Array,
    duration: float,
    load: Sequence[float] | Array | float | Callable[[float], Array] = 0.0,
) -> tuple[Array, Array]:
    """Times and contact forces (n, p) of M u'' + K u = load - rows^T F by DOP853, F = k delta^n."""
    size, inverse = len(K), np.linalg.inv(M)

    def force(u: Array) -> Array:
        return k * np.maximum(rows @ u - gaps, 0.0) ** n

    def slope(t: float, y: Array) -> Array:
        u, v = y[:size], y[size:]
        push = load(t) if callable(load) else load
        return np.concatenate((v, inverse @ (push - K @ u - rows.T @ force(u))))

    t = np.linspace(0, duration, 3000)
    y0 = np.concatenate((np.zeros(size), v0))
    s = solve_ivp(
        slope, (0, duration), y0, "DOP853", t, rtol=1e-9, atol=1e-12, max_step=duration / 400
    )
    return t, np.array([force(u) for u in s.y[:size].T])


def force_error(hit: ao.SceneHistory, t: Array, force: Array) -> float:
    """Relative error of all contact forces in the L2 norm."""
    mine = contact_forces(hit.run, *steps_at(hit.run, t))[:, : force.shape[1]]
    return float(np.sqrt(np.sum((mine - force) ** 2) / np.sum(force**2)))
