"""What the errors of a run rest on: differences of runs that do not agree by chance."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc import march
from antiosc.simulation import convergence
from antiosc.simulation.convergence import SECOND, converge
from antiosc.simulation.engine import Run


def run_of(time, force) -> Run:
    """A run with these forces (n,) at its nodes."""
    return Run(
        time=np.asarray(time, float),
        force=np.asarray(force, float)[:, None],
        depth=np.zeros((len(time), 1)),
        states=None,
        events=np.zeros((0, 4)),
        answer=march.DONE,
        steps=1,
        attempts=1,
        touches=1,
        highest=1.0,
    )


def test_a_run_whose_forces_do_not_settle_is_not_taken_for_converged(monkeypatch):
    """A vibration whose phase is another one in every run: no two of them agree by chance."""
    t = np.linspace(0.0, 1.0, 401)
    shares = []

    def vibrating(system, duration, share, **given):
        shares.append(share)
        phase = 2.4 * len(shares)
        return replace(run_of(t, 1.0 + 0.01 * np.sin(200 * t + phase)), attempts=100)

    monkeypatch.setattr(convergence, "run", vibrating)
    system: Any = SimpleNamespace(beta=np.ones((1, 1)), R=np.zeros((1, 1)))
    found = converge(system, [ao.Linear(1.0)], 1e-4, 1.0, 1e-3, 100, 10**6)
    assert found.force > 1e-3
    assert len(shares) > 3
    assert shares[1] == pytest.approx(shares[0] / SECOND)
