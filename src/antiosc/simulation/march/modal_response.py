"""Exact motion of uncoupled damped oscillators, rigid-body modes included, as arrays.

For q'' + 2 d q' + omega^2 q = f: the formulas are those of the march, free of cancellation for
small and large omega t and d t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array


class Responses(NamedTuple):
    """q = P q0 + S v0 + J0 f, v = W v0 - omega^2 S q0 + S f, each of shape (..., J).

    J1 and J2 are the displacements under modal forces that grow as t and as t^2/2.
    """

    P: Array
    W: Array
    S: Array
    J0: Array
    J1: Array
    J2: Array


def responses(omega: Array, decay: Array, t: Array | float) -> Responses:
    """All responses of the modes (omega, decay), each (..., J), after times `t` [s]."""
    time = np.asarray(t, dtype=float)[..., np.newaxis]
    return Responses(*march.responses(np.asarray(omega), np.asarray(decay), time))
