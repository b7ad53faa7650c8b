"""What the errors of a run rest on: the rate of its convergence, and the chords between nodes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from antiosc.simulation import convergence, march
from antiosc.simulation.convergence import FINER, LEFT, chord_error, converge, error_left
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


def test_chords_of_parabolas_against_quadrature():
    time, force = [0.0, 0.5, 1.0, 1.75, 2.5], [0.0, 3.0, 4.0, 4.2, 1.0]
    found = chord_error(run_of(time, force))
    t = np.linspace(0, 2.5, 200_001)
    bent = np.where(
        t <= 1.0,
        np.polyval(np.polyfit(time[:3], force[:3], 2), t),
        np.polyval(np.polyfit(time[2:], force[2:], 2), t),
    )
    gap = bent - np.interp(t, time, force)
    assert found[0] == pytest.approx(np.sqrt(np.mean(gap**2) / np.mean(bent**2)), rel=1e-4)
    assert found[1] == pytest.approx((bent.max() - max(force)) / max(force), rel=1e-6)
    assert chord_error(run_of([0, 1, 2], [0, 0, 0])) == (0.0, 0.0)


@pytest.mark.parametrize("rate", [1 / 8, 1 / 3, 0.45])
def test_the_error_left_covers_a_sequence_of_that_rate(rate):
    """Errors e, e rate, e rate^2: the last is covered by the share of the last difference."""
    first, second = 1 - rate, rate - rate**2
    assert error_left(second, first) * second >= rate**2
    assert error_left(second, 0.0) == 1.0  # of two runs nothing is known of the rate


def test_runs_that_do_not_converge_keep_their_whole_difference():
    assert error_left(0.9, 1.0) > 1.0
    assert error_left(1e-9, 1.0) == LEFT


def test_a_run_whose_forces_do_not_settle_is_not_taken_for_converged(monkeypatch):
    """A vibration whose phase is another one in every run: no two of them agree by chance."""
    t = np.linspace(0.0, 1.0, 401)
    shares = []

    def vibrating(system, duration, share, **given):
        shares.append(share)
        phase = 2.4 * len(shares)
        return replace(run_of(t, 1.0 + 0.01 * np.sin(200 * t + phase)), attempts=100)

    monkeypatch.setattr(convergence, "run", vibrating)
    system = SimpleNamespace(kinds=np.zeros(1, dtype=np.int64), beta=np.ones((1, 1)))
    found = converge(system, 1.0, 1e-3, 100, 10**6, fine=1e-6)  # type: ignore[arg-type]
    assert found.force > 5e-3
    assert len(shares) > 3
    assert shares[1] == pytest.approx(shares[0] / FINER)
