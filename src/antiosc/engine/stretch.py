"""Quadratic and cubic forces of second-order strain, and their energy, at given amplitudes."""

from __future__ import annotations

import numpy as np

from antiosc.base._types import Array


def stretch_energy(quadratic: Array, cubic: Array, a: Array) -> Array:
    """Energies (n,) [J] of the forces at amplitudes (n, m)."""
    quadratic_force, cubic_force = stretch_forces(quadratic, cubic, a)
    return np.asarray(np.sum((quadratic_force / 3 + cubic_force / 4) * a, axis=1))


def stretch_forces(quadratic: Array, cubic: Array, a: Array) -> tuple[Array, Array]:
    """The quadratic and the cubic forces (n, m) at amplitudes (n, m)."""
    n, m = a.shape
    products = (a[:, :, None] * a[:, None, :]).reshape(n, m * m)
    stiffness = (products @ cubic.reshape(m * m, m * m).T).reshape(n, m, m)
    return products @ quadratic.reshape(m, m * m).T, (stiffness @ a[:, :, None])[:, :, 0]
