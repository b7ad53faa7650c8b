"""Measured orders of convergence."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def observed_order(h: ArrayLike, error: ArrayLike) -> float:
    """Slope of log(error) over log(h), by least squares."""
    return float(np.polyfit(np.log(np.asarray(h)), np.log(np.asarray(error)), 1)[0])
