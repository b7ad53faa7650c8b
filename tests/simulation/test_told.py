"""Numbers in what runs say of themselves, and in how far they are refined, by stand-ins."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from antiosc.engine import library
from antiosc.engine.march import Run
from antiosc.impact import reference


class Runs:
    """Runs whose forces have an error in proportion to the square of their step."""

    def __init__(self, *answers: int) -> None:
        self.answers = answers
        self.asked: list[float] = []

    def __call__(self, size: float) -> Run:
        k = len(self.asked)
        self.asked.append(size)
        t = np.linspace(0, 1.0, 101)
        force = np.sin(np.pi * t)[:, None] * (1 + size**2)
        return Run(
            time=t, force=force, depth=force, states=None, events=np.zeros((0, 4)),
            answer=self.answers[k] if k < len(self.answers) else library.DONE,
            steps=round(10 / size), attempts=1, touches=1,
        )  # fmt: skip


GREW, DONE = library.GREW, library.DONE


@pytest.mark.parametrize("answers", [(), (GREW,), (DONE, GREW), (GREW, GREW), (DONE, GREW, GREW)])
def test_compared_methods_refine_until_two_runs_agree(
    answers: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs that diverged are no partners."""
    runs = Runs(*answers)
    monkeypatch.setattr(reference, "run_in_fixed_steps", lambda _system, step, *_: runs(step))
    made: Any = SimpleNamespace(
        system=SimpleNamespace(omega=np.ones(1), first=None),
        scene=SimpleNamespace(contacts=[]),
        contact_time_estimate=0.4 * reference.INITIAL_STEPS_PER_CONTACT,
    )
    settings = reference.Settings(1e-3, "newmark", max_contacts=1000, max_steps=10_000)
    found = reference.integrate_reference(made, 0.8, settings)
    assert found.run.answer == DONE
    assert found.step_tol == runs.asked[-1] == min(runs.asked)
    assert 0.9 * found.step_tol**2 <= max(found.force_error, found.peak_error) <= 1e-3
