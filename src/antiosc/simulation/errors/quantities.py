"""Differences of two impacts in peak force, impulse and contact time."""

from __future__ import annotations

from collections.abc import Mapping

from antiosc.simulation.histories.error_bars import QUANTITIES
from antiosc.simulation.histories.history import History

#: Each error is at least this share of the largest of the three.
FLOOR = 0.5


def differences(one: History, other: History) -> dict[str, float]:
    """Relative differences of the three quantities."""
    return {name: _relative(getattr(one, name), getattr(other, name)) for name in QUANTITIES}


def floored(errors: Mapping[str, float]) -> dict[str, float]:
    """Errors of the three quantities, each at least `FLOOR` times the largest."""
    worst = max(errors.values())
    return {name: max(error, FLOOR * worst) for name, error in errors.items()}


def _relative(a: float, b: float) -> float:
    return abs(a - b) / max(abs(a), abs(b)) if a != b else 0.0
