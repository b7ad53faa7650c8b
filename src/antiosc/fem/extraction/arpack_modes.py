"""The lowest modes of SciPy matrices by ARPACK, with the structure's own factor."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError
from antiosc.fem.extraction.eigenmodes import RESIDUAL, Search
from antiosc.fem.linalg.algebra import multiply


def lowest(search: Search) -> tuple[Array, Array]:
    """(ω² [rad²/s²], shapes (rows, k)) of at least the modes wanted, in any order."""
    structure, known = search.structure, search.known
    known_loads = multiply(structure.M, known)

    def inverse(r: Array) -> Array:
        x = search.inverse(r)
        return np.asarray(x - known @ (known_loads.T @ x))

    shape = (structure.size, structure.size)
    try:
        values, shapes = eigsh(
            structure.K,
            search.computed,
            structure.M,
            sigma=-structure.shift,
            OPinv=LinearOperator(shape, inverse, dtype=float),
            v0=search.start(),
            tol=RESIDUAL,
        )
    except ArpackError as error:
        raise NotConvergedError(
            f"ARPACK did not find {search.wanted} modes ({error}): ask for fewer modes."
        ) from error
    return values, shapes
