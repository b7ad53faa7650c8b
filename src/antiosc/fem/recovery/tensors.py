"""Tensors from local axes to those of the mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antiosc._types import Array


def in_frame(local: Array, frame: Sequence[Array]) -> Array:
    """Tensors (P, 3, 3, columns) whose axes are the three `frame` vectors (P, 3), in the mesh's."""
    axes = np.stack(list(frame), axis=1)
    return np.einsum("pai,pabk,pbj->pijk", axes, local, axes, optimize=True)
