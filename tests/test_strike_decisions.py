"""What `strike` decides between two meshes: sizes, anti-oscillators, bars, when it stops."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.histories.parts import QUANTITIES, ErrorBar, ErrorBudget

pytestmark = pytest.mark.fem
pytest.importorskip("dolfinx")

from mpi4py import MPI  # noqa: E402

from antiosc.studies import striking  # noqa: E402

TOL = 0.01


def budget(mesh: float = 0.05, safety: float = 2.0, **bars: float) -> ErrorBudget:
    """The same bars for all quantities, but for that of the mesh: 1, 0.8 and 0.6 of it."""
    own = {"truncation": 0.0, "time": 0.0, "patch": 0.0, **bars}
    shares = zip(QUANTITIES, (1.0, 0.8, 0.6), strict=True)
    found = {name: ErrorBar(value=1.0, mesh=s * mesh, **own) for name, s in shares}
    return ErrorBudget(found, 0.01, (), safety)


def answer(given: ErrorBudget | None = None, **more: Any) -> Any:
    own = {
        "structure": SimpleNamespace(dofs=1000, comm=MPI.COMM_SELF),
        "raw": SimpleNamespace(model=SimpleNamespace(strain_misfit=None)),
        "hit": SimpleNamespace(peak_force=10.0, impulse=1.0, contact_time=2.0),
        "budget": given or budget(), "n": 20, "seconds": 3.0,
    }  # fmt: skip
    return striking.Answer(**{**own, **more})


@pytest.fixture
def step(monkeypatch: pytest.MonkeyPatch) -> Any:
    """`_next` of a mesh in the plane of 50 cells with equal errors, in which the limit is told."""
    monkeypatch.setattr(striking, "_errors_of_cells", lambda *_: np.ones(50))
    monkeypatch.setattr(striking.time, "perf_counter", lambda: 107.0)
    mesh = SimpleNamespace(comm=MPI.COMM_SELF, tdim=2)

    def called(given: Any, limit: float | None = None, meshes: int = 1, free: float = 1e12) -> Any:
        monkeypatch.setattr(striking, "free_memory", lambda: free)
        return striking._next(given, mesh, 1, TOL, limit, 100.0, meshes)

    return called


def test_a_mesh_that_takes_too_long_or_too_much_memory_is_not_made(step: Any) -> None:
    """Goal 0.2: five times the cells; 3 s now, so many more, 7 s spent."""
    given = answer(budget(0.04))
    seconds = 3.0 * 5**1.2
    assert step(given, limit=7.0 + seconds * 1.001)[1] == ""
    told = step(given, limit=7.0 + seconds * 0.999)[1]
    assert told.startswith("Stopped before the limit of")
    assert f"about 5e+03 dofs would meet it, in some {seconds:.2g} s more" in told
    needed = 400.0 * 5000**1.1 / striking.MEMORY_SHARE
    assert step(given, free=needed * 1.001)[1] == ""
    assert "GB free: a mesh of about 5e+03 dofs" in step(given, free=needed * 0.999)[1]


def test_when_no_mesh_helps_it_is_said(step: Any) -> None:
    assert "take the tolerance alone" in step(answer(budget(0.05, time=0.0094)))[1]
    assert step(answer(budget(0.05, time=0.0093)))[1] == ""
    assert "300 anti-oscillators do not bring" in step(answer(n=300))[1]
    assert step(answer(n=299))[1] == ""


@pytest.mark.parametrize(
    ("error", "coarser", "expected"),
    [
        (0.02, 0.08, 120),  # falls as n^-2 to 0.002: 40 sqrt(10) = 127, thrice at most
        (0.004, 0.016, 57),
        (0.004, 0.0041, 120),  # hardly falls: as n^-1/2, thrice at most
        (0.004, 1.0, 51),  # n^-3 at most
        (0.001, 0.1, 40),  # enough already
    ],
)
def test_the_next_number_follows_from_the_fall_of_the_error(
    monkeypatch: pytest.MonkeyPatch, error: float, coarser: float, expected: int
) -> None:
    model = ao.AntiOscillators(m0=0.1, k0=1e5, m=np.ones(40), omega=np.arange(1.0, 41.0))
    known = SimpleNamespace(worst=coarser)
    monkeypatch.setattr(striking, "truncation_error", lambda *_, **__: known)
    given = answer(budget(truncation=error), n=40, raw=SimpleNamespace(model=model))
    assert striking.next_n(given, lambda *_: None, TOL, 1.0) == expected
    assert striking.next_n(given, lambda *_: None, TOL, 1.5) == max(expected, 60)
    many = answer(budget(truncation=error), n=290, raw=SimpleNamespace(model=model))
    assert striking.next_n(many, lambda *_: None, TOL, 1.5) == 300
    few = ao.AntiOscillators(m0=0.1, k0=1e5, m=[1.0], omega=[1.0])
    none = answer(budget(truncation=error), n=1, raw=SimpleNamespace(model=few))
    assert striking.next_n(none, lambda *_: None, TOL, 1.0) == 3


@pytest.mark.parametrize(
    ("given", "goal"),
    [
        (budget(0.05), 0.8 * 0.01 / 0.05),
        (budget(0.04, time=0.002, patch=0.001), 0.8 * 0.007 / 0.04),
        # the truncation counts up to a fifth of the tolerance
        (budget(0.04, truncation=0.001), (0.008 - 0.001) / 0.04),
        (budget(0.04, truncation=0.5), (0.008 - 0.002) / 0.04),
        # bars of a mesh that is not resolved fall by their factor too: (2 - 1)/(3 - 1)
        (budget(0.05, safety=3.0), 0.8 * 0.01 / (0.05 / 2)),
        # a mesh that is nearly good enough gets finer by a fifth at least
        (budget(0.009), 0.8),
    ],
)
def test_the_next_mesh_has_the_error_that_is_left(step: Any, given: Any, goal: float) -> None:
    """Of order 1 the error falls as the size squared, and so do sizes for the goal."""
    ratio, told = step(answer(given))
    np.testing.assert_allclose(ratio, np.sqrt(goal), rtol=1e-6)
    assert told == ""


def test_later_meshes_aim_lower_and_none_grows_more_than_eightfold(step: Any) -> None:
    for meshes, goal in ((1, 0.4), (2, 0.24), (3, 0.144), (4, 1 / 8)):
        ratio, _ = step(answer(budget(0.02)), meshes=meshes)
        np.testing.assert_allclose(ratio**2, goal, rtol=1e-6)
