"""Detection of energy that an integrator creates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from antiosc.base._types import Array, BoolArray


def growth(
    square: Array, load: Array, q0: Array, v0: Array, most: float, beta: Array | float = 1.0
) -> Callable[[Array, Array], BoolArray]:
    """Function that tells whether the energy at (q, v) exceeds `most` times the energy supplied.

    The energy supplied is that at (q0, v0), without contact, plus the work of the loads; a contact
    cannot add to it. Modes that the contact does not excite (beta = 0) are left out, because their
    energy would hide a growth. All arrays of shape (J,) or (S, J); `square` is omega^2.
    """
    struck = np.not_equal(beta, 0)

    def product(a: Array, b: Array) -> Any:
        return a.dot(b) if a.ndim == 1 else np.einsum("sj,sj->s", a, b)

    def mechanical(q: Array, v: Array) -> Any:
        return 0.5 * (product(struck * v, v) + product(struck * square * q, q))

    start = mechanical(q0, v0)

    def grown(q: Array, v: Array) -> BoolArray:
        fall = abs(product(struck * load, q - q0))
        return np.logical_not(mechanical(q, v) <= most * (start + fall))

    return grown
