"""Structures with several sites, and their receptances by direct solves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import antiosc as ao
from parts import STEEL, box

Array = NDArray[np.float64]
OMEGA = np.geomspace(20, 2e3, 25) * (1 + 0.01j)


def sites_of(B: Array) -> dict[str, ao.Site]:
    """A named site for each column."""
    return {f"s{i}": ao.Site(vector=b) for i, b in enumerate(B.T)}


def block_with_corners() -> ao.Structure:
    """A block of steel, held at its left end."""
    return ao.Structure(box((6, 3, 2)), ao.Solid(**STEEL), [ao.Support("left")])


def _corner(x: float, y: float) -> ao.Site:
    return ao.Site((x, y, 0.04), (0.1, 0.2, -1), radius=0.03)


CORNERS = {"near": _corner(0.1, 0.02), "far": _corner(0.17, 0.03)}
