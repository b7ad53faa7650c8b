"""`answered`: one mesh's answer of `strike`, with its budget; `compared`, `changed_since`: with the
mesh before."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from antiosc.fem.extraction.extract import extract
from antiosc.fem.site.site import Site
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.simulation.errors.error_budget import SAFETY
from antiosc.simulation.errors.truncation import truncation_error
from antiosc.simulation.histories.error_bars import ErrorBudget, differences, floored
from antiosc.simulation.histories.history import History

#: Shares of the tolerance for the truncation and for the time steps.
TRUNCATION_SHARE, TIME_SHARE = 0.2, 0.05
#: Least truncation error that a number of anti-oscillators is chosen for.
LEAST_TRUNCATION = 1e-7
#: Bounds of the tolerance of the time integration.
FINEST_TIME, COARSEST_TIME = 1e-6, 1e-3
#: First and largest number of anti-oscillators.
FIRST_N, MOST_N = 20, 300
#: Growth of that number from one mesh of lines to the next.
MORE_ON_LINES = 1.5
#: Least and largest power of that number by which the truncation error is taken to fall.
RATES = (0.5, 3.0)
#: Least share of the usual bar of a mesh that a comparison with another mesh leaves; largest ratio
#: of the bars of both, and least one of their dofs, for which they are compared: another mesh with
#: as many dofs shows no convergence.
LEAST_SHARE, CLOSER, FINER = 0.6, 0.8, 1.5

Run = Callable[[AntiOscillators, float], History]


@dataclass(frozen=True)
class Answer:
    """One structure's answer: the run of the raw model; the one that is answered, of the corrected
    model (of shells the raw one), with its budget; and what they took."""

    structure: Structure
    raw: History
    hit: History
    budget: ErrorBudget
    n: int
    seconds: float


def answered(structure: Structure, site: Site, run: Run, tol: float, n: int) -> Answer:
    """Extract and simulate, with more anti-oscillators where the truncation asks for them."""
    started = time.perf_counter()
    accuracy = float(np.clip(TIME_SHARE * tol, FINEST_TIME, COARSEST_TIME))
    most = min(MOST_N, structure.dofs - 1)
    n = min(n, most)
    while True:
        model = extract(structure, site, n=n, error="estimate")
        hit = run(model, accuracy)
        budget = hit.error_budget
        left = max(bar.truncation for bar in budget.values())
        if left <= _truncation_goal(budget, tol) or n >= most or model.n < n:
            break
        n = int(np.clip(_enough(model, run, left, tol), n + n // 2, min(3 * n, most)))
    if model.strain_misfit is not None:  # a shell's corrected model is not always nearer
        seconds = time.perf_counter() - started
        return Answer(structure, hit, hit, budget, n, seconds)
    soft = run(model.corrected(), accuracy)
    seconds = time.perf_counter() - started
    return Answer(structure, hit, soft, budget.of_corrected(soft), n, seconds)


def compared(answer: Answer, before: Answer | None) -> Answer:
    """The answer with a smaller bar of the mesh if the mesh before shows that it may be smaller.

    The corrected models of both meshes differ by Δ, their bars of the mesh are b and b' < b. If the
    errors of both are the same share of their bars, this share is at most Δ / (b - b'). Twice that,
    and at least `LEAST_SHARE`, is taken.
    """
    if before is None or max(before.budget.safety, answer.budget.safety) > SAFETY:
        return answer
    old, new = (max(bar.mesh for bar in each.budget.values()) for each in (before, answer))
    if new > CLOSER * old or answer.structure.dofs < FINER * before.structure.dofs:
        return answer
    changed = max(differences(before.hit, answer.hit).values())
    share = float(np.clip(2 * changed / (old - new), LEAST_SHARE, 1.0))
    bars = {name: replace(bar, mesh=share * bar.mesh) for name, bar in answer.budget.items()}
    return replace(answer, budget=replace(answer.budget, bars=bars))


def changed_since(answer: Answer, before: Answer | None) -> Answer:
    """The answer of a mesh of lines, whose bars are at least the change from the mesh before.

    That had lines twice as long and fewer anti-oscillators: the change is more than the error that
    is left if this falls at all with the size, whatever the estimates of both meshes say.
    """
    if before is None:
        return answer
    changed = floored(differences(before.hit, answer.hit))
    bars = {
        name: replace(bar, mesh=max(bar.mesh, changed[name])) for name, bar in answer.budget.items()
    }
    return replace(answer, budget=replace(answer.budget, bars=bars))


def _truncation_goal(budget: ErrorBudget, tol: float) -> float:
    """Largest error of the truncation for which no further anti-oscillators are extracted now.

    Where a finer mesh is needed in any case it must not exceed the mesh's share, for then it says
    as well where this mesh should be finer.
    """
    share = TRUNCATION_SHARE * tol
    left = 1 - 1 / budget.safety
    meets = all(left * bar.mesh + bar.time + bar.patch + share <= tol for bar in budget.values())
    return share if meets else max(share, left * max(bar.mesh for bar in budget.values()))


def next_n(answer: Answer, run: Run, tol: float, growth: float) -> int:
    """Number of anti-oscillators for the next mesh, at least `growth` times the present one."""
    error = max(bar.truncation for bar in answer.budget.values())
    enough = _enough(answer.raw.model, run, error, tol)
    return int(np.clip(enough, min(growth * answer.n, MOST_N), min(3 * answer.n, MOST_N)))


def _enough(model: AntiOscillators, run: Run, error: float, tol: float) -> int:
    """Number of anti-oscillators whose truncation error is its share of the tolerance.

    It is extrapolated from the error of `model` and that of half as many anti-oscillators.
    """
    share = max(TRUNCATION_SHARE * tol, LEAST_TRUNCATION)
    half = model.n // 2
    if half < 1:
        return FIRST_N
    omega = float(model.omega[half])
    coarser = truncation_error(model.truncated(half), run, next_omega=omega, tol=0.1 * share).worst
    error = max(error, 0.1 * share)
    rate = np.clip(math.log(max(coarser, error) / error) / math.log(model.n / half), *RATES)
    return math.ceil(model.n * (error / share) ** (1 / rate))


class MeshRecord(TypedDict):
    """What is kept of one mesh: its size, `n`, seconds, bars of mesh and all, peak force [N]."""

    dofs: int
    n: int
    seconds: float
    mesh: float
    total: float
    peak_force: float


def record(answer: Answer) -> MeshRecord:
    """What is kept of one mesh, JSON values."""
    return MeshRecord(
        dofs=answer.structure.dofs,
        n=answer.n,
        seconds=answer.seconds,
        mesh=max(bar.mesh for bar in answer.budget.values()),
        total=answer.budget.worst,
        peak_force=answer.hit.peak_force,
    )
