"""Matrices of beams in Hermite's elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def hermite_beam(elements: int, EI: float, rhoA: float, length: float) -> tuple[Array, Array]:
    """K and consistent M of Euler-Bernoulli's beam in Hermite's elements, as code_aster's POU_D_E.

    Deflection and rotation of each node in turn. Published digits hold the error of their few
    elements, which `antiosc.Beam` does not share.
    """
    h, size = length / elements, 2 * elements + 2
    K, M = np.zeros((2, size, size))
    stiff = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4.0]])
    heavy = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4.0]])
    scale = np.outer([1, h, 1, h], [1, h, 1, h])
    for first in range(0, size - 2, 2):
        rows = slice(first, first + 4)
        K[rows, rows] += EI / h**3 * stiff * scale
        M[rows, rows] += rhoA * h / 420 * heavy * scale
    return K, M
