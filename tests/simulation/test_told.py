"""Numbers in what runs say of themselves, and in how far they are refined, by stand-ins."""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest

import antiosc as ao
from antiosc.engine import library
from antiosc.engine.march import Run
from antiosc.impact import reference, truncation

MODEL = ao.AntiOscillators(m0=0.1, k0=1e6, m=[0.3, 0.1], omega=[2e3, 9e3])


@pytest.mark.parametrize(("rate", "known"), [(1.0, 1.0), (1.7, 1.7), (0.2, 0.5), (3.0, 2.0)])
def test_what_is_missing_follows_from_the_fall_of_the_error(rate: float, known: float) -> None:
    estimates = {
        n: truncation.TruncationError(n, 0.4 * (8 / n) ** rate, 0.0, 0.0) for n in (1, 2, 4, 8)
    }
    missing = truncation._missing_count(estimates, 0.01)
    assert missing == ceil(8 * ((0.4 / 0.01) ** (1 / known) - 1) - 1e-9)
    none = {2: truncation.TruncationError(2, np.inf, 0.0, 0.0)}
    assert truncation._missing_count(none, 0.01) == 4
    none = {6: truncation.TruncationError(6, np.inf, 0.0, 0.0)}
    assert truncation._missing_count(none, 0.01) == 12


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
            steps=round(10 / size), attempts=1, touches=1, highest=1.0,
        )  # fmt: skip


GREW, DONE = library.GREW, library.DONE


def settings(tol: float, max_steps: int, max_contacts: int = 1000) -> reference.Settings:
    return reference.Settings(tol, max_contacts=max_contacts, max_steps=max_steps)


@pytest.mark.parametrize("answers", [(), (GREW,), (DONE, GREW), (GREW, GREW), (DONE, GREW, GREW)])
def test_compared_methods_refine_until_two_runs_agree(answers: tuple[int, ...]) -> None:
    """Runs that diverged are no partners."""
    runs = Runs(*answers)
    found = reference._converged(runs, 0.4, settings(1e-3, 10_000))
    assert found.run.answer == DONE
    assert found.share == runs.asked[-1] == min(runs.asked)
    assert 0.9 * found.share**2 <= found.worst <= 1e-3


def test_refinement_ends_where_the_steps_are_too_many_or_all_runs_diverge() -> None:
    runs = Runs()
    found = reference._converged(runs, 0.4, settings(1e-9, 300))
    assert max(10 / size for size in runs.asked) <= 300
    assert found.worst > 1e-9
    found = reference._converged(Runs(*[GREW] * 40), 0.4, settings(1e-2, 10_000))
    assert (found.run.answer, found.worst) == (GREW, np.inf)
    runs = Runs()
    reference._converged(runs, 0.05, settings(1e-9, 10**6, 1))
    assert runs.asked == [0.05]  # as many contacts as are allowed
