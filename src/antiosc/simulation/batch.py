"""Many impacts at once: `simulate_many` checks and refines every scene as `simulate` does.

Scenes with power laws (Linear, Hertz, Power) are integrated together
(`antiosc.simulation.integrators.many`), those with other laws one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import log2
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import checks
from antiosc._types import Array, Index
from antiosc.brief import Brief
from antiosc.contact import ContactLaw
from antiosc.contact.many import VECTORISED
from antiosc.errors import AccuracyError, InputError
from antiosc.models.body import LinearBody
from antiosc.progress import counting
from antiosc.simulation.history import main_impact
from antiosc.simulation.integrators import MAX_STEPS, Problem
from antiosc.simulation.integrators.many import Result, Stack, run_many
from antiosc.simulation.simulate import (
    COARSEST,
    DEFAULT_TOL,
    MAX_LEVELS,
    assemble,
    check_span,
    integrated,
    scaled,
    without_patch,
)
from antiosc.simulation.step_control import Refinement
from antiosc.simulation.verdict import judge, tell_all

_BLOCK = 2048  # scenes integrated together: enough to make the overhead of a call negligible


@dataclass(frozen=True, eq=False, repr=False)
class Batch(Brief):
    """Results of many impacts, one entry per scene; see `History` for their meaning.

    Attributes
    ----------
    peak_force, impulse, contact_time, restitution : (S,) float; restitution is NaN where
        `History.restitution` is None.
    contacts : (S,) number of contacts.
    step, error : (S,) step used [s] and estimated relative error of the force (NaN: step given).
    status : (S,) as in `History`.
    force : list of S pairs (time, force): nodes of the contacts, force linear in between.
    message : list of S sentences that explain the status.
    """

    peak_force: Array
    impulse: Array
    contact_time: Array
    restitution: Array
    contacts: Index
    step: Array
    error: Array
    status: Index
    force: list[tuple[Array, Array]]
    message: list[str]

    def __len__(self) -> int:
        return self.peak_force.size


def sweep(make: Callable[..., Any], **values: Any) -> list[Any]:
    """Objects made from arrays: `sweep(RigidMass, mass=masses, velocity=2.0)`.

    Every keyword is one value for all or a sequence; all sequences must have the same length.
    """
    checks.function("make", make, "a constructor, such as RigidMass")
    lengths = {k: len(v) for k, v in values.items() if _is_many(v)}
    size = _common_length(lengths)
    return [
        make(**{k: v[i] if k in lengths else v for k, v in values.items()}) for i in range(size)
    ]


@checks.within_range
def simulate_many(
    models: LinearBody | Sequence[LinearBody],
    impactors: LinearBody | Sequence[LinearBody],
    contacts: ContactLaw | Sequence[ContactLaw],
    duration: ArrayLike,
    *,
    step: ArrayLike | None = None,
    tol: float | None = None,
    initial_velocity: ArrayLike = 0.0,
    gravity: ArrayLike = 0.0,
    max_contacts: int = 10_000,
    max_steps: int = MAX_STEPS,
) -> Batch:
    """`simulate` with the exact integrator for many scenes.

    Parameters
    ----------
    models, impactors, contacts
        One for all scenes, or a sequence with one per scene (see `sweep`).
    duration, step, initial_velocity, gravity : float or (S,)
        As for `simulate`, for all scenes or one per scene.
    tol, max_contacts, max_steps
        As for `simulate`.

    Raises
    ------
    InputError
        For sequences of different lengths, and as `simulate`.
    AccuracyError
        When a scene's force leaves the range of its law; the message names the scene.
    """
    given: dict[str, Any] = {
        "models": models,
        "impactors": impactors,
        "contacts": contacts,
        "duration": duration,
        "step": step,
        "initial_velocity": initial_velocity,
        "gravity": gravity,
    }
    size = _common_length({k: len(v) for k, v in given.items() if _is_many(v)})
    columns = {k: list(v) if _is_many(v) else [v] * size for k, v in given.items()}
    accuracy = DEFAULT_TOL if tol is None else checks.tolerance(tol)
    max_contacts = checks.whole("max_contacts", max_contacts)
    max_steps = checks.whole("max_steps", max_steps)
    scenes = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    results: list[Result | None] = [None] * size
    groups: dict[type, list[int]] = {}
    for i, scene in enumerate(scenes):
        groups.setdefault(type(scene["contacts"]), []).append(i)
    ended = 0
    with counting("simulating impacts", size) as ready:
        for kind, members in groups.items():
            width = _BLOCK if kind in VECTORISED else 1
            for first in range(0, len(members), width):
                block = members[first : first + width]
                if kind in VECTORISED:
                    prepared = [_prepare(scenes[i], i) for i in block]
                    solved = _solve(kind, prepared, accuracy, max_contacts, max_steps)
                else:
                    i = block[0]
                    solved = [_alone(scenes[i], i, accuracy, max_contacts, max_steps)]
                for i, result in zip(block, solved, strict=True):
                    results[i] = result
                ended += len(block)
                ready(ended)
    done = [r for r in results if r is not None]
    tell_all([r.verdict for r in done])
    return _gather(done)


# -- one scene in, one result out


@dataclass(eq=False)
class _Scene:
    index: int
    problem: Problem
    duration: float
    scale: float
    step: float
    fixed: bool


def _prepare(scene: dict[str, Any], index: int) -> _Scene:
    duration = checks.positive("duration", scene["duration"], "s")
    law, _ = without_patch(scene["contacts"], scene["models"], scene["impactors"])
    problem, bodies = assemble(
        scene["models"], scene["impactors"], law, scene["initial_velocity"], scene["gravity"]
    )
    check_span(problem, duration)
    problem, scale = scaled(problem, bodies, duration)
    step = scene["step"]
    if step is None:
        return _Scene(index, problem, duration, scale, scale / COARSEST, False)
    step = checks.positive("step", step, "s")
    if step > duration:
        raise InputError(f"step must be <= the duration {duration:g} s; got {step:g} s.")
    return _Scene(index, problem, duration, scale, step, True)


def _alone(
    scene: dict[str, Any], index: int, tol: float, max_contacts: int, max_steps: int
) -> Result:
    hit, verdict = integrated(
        scene["models"],
        scene["impactors"],
        scene["contacts"],
        checks.positive("duration", scene["duration"], "s"),
        step=scene["step"],
        tol=tol,
        initial_velocity=scene["initial_velocity"],
        gravity=scene["gravity"],
        gap=None,
        max_contacts=max_contacts,
        max_steps=max_steps,
    )
    _check_range(hit.problem.law, hit.peak_force, index)
    e = hit.restitution
    return Result(
        contacts=[
            (c.start, c.end, sum(s.impulse for s in hit.trajectory.segments[slice(*c.segments)]))
            for c in hit.trajectory.contacts
        ],
        time=hit.time,
        force=hit.force,
        closing=1.0,
        parting=np.nan if e is None else -e,
        released=True,
        step=hit.step,
        error=hit.error.get("force", np.nan),
        verdict=verdict,
    )


def _check_range(law: ContactLaw, peak_force: float, index: int) -> None:
    if peak_force > law.valid_force:
        raise AccuracyError(f"scene {index}: {law.out_of_range(peak_force, None)}.")


def _gather(results: list[Result]) -> Batch:
    def restitution(r: Result) -> float:
        return -r.parting / r.closing if r.released and r.closing > 0 else np.nan

    return Batch(
        peak_force=np.array([r.force.max(initial=0.0) for r in results]),
        impulse=np.array([sum(c[2] for c in r.contacts) for r in results]),
        contact_time=np.array([main_impact(r.contacts) for r in results]),
        restitution=np.array([restitution(r) for r in results]),
        contacts=np.array([len(r.contacts) for r in results], dtype=np.intp),
        step=np.array([r.step for r in results]),
        error=np.array([r.error for r in results]),
        status=np.array([r.verdict.status for r in results], dtype=np.intp),
        force=[(r.time, r.force) for r in results],
        message=[r.verdict.message for r in results],
    )


def _is_many(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim == 1
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _common_length(lengths: dict[str, int]) -> int:
    sizes = set(lengths.values())
    if len(sizes) > 1:
        listed = ", ".join(f"{k}: {v}" for k, v in lengths.items())
        raise InputError(f"sequences of a batch must have one length; got {listed}.")
    if not sizes:
        return 1
    size = sizes.pop()
    if size == 0:
        raise InputError("a batch needs at least one scene; got empty sequences.")
    return size


# -- error control, as in `simulate`


def _solve(
    kind: type, scenes: list[_Scene], tol: float, max_contacts: int, max_steps: int
) -> list[Result]:
    stack = Stack(kind, [s.problem for s in scenes], [s.duration for s in scenes])
    step = np.array([s.step for s in scenes])
    fixed = np.array([s.fixed for s in scenes])
    least = np.array([s.scale for s in scenes]) / max_steps
    todo = np.flatnonzero(~fixed)
    step[todo] = stack.clear(todo, step[todo], least[todo])
    results = run_many(stack, np.arange(len(scenes)), step, max_contacts, max_steps)
    control = [Refinement(tol) for _ in scenes]
    for _ in range(MAX_LEVELS):
        share = np.array([2**c.halvings for c in control])
        work = np.array([r.work for r in results])
        full = np.array([r.full for r in results])
        todo = todo[(share * work <= max_steps)[todo] & ~full[todo]]
        if todo.size == 0:
            break
        finer = stack.clear(todo, step[todo] / share[todo], least[todo])
        fine = run_many(stack, todo, finer, max_contacts, max_steps)
        l2, peak = _differences([results[i] for i in todo], fine, stack.duration[todo])
        for j, i in enumerate(todo):
            control[i].halvings = log2(step[i] / finer[j])
            if fine[j].diverged and not results[i].diverged:
                control[i].halvings += 1
                continue
            if not results[i].diverged:
                control[i].update(float(l2[j]), float(peak[j]))
            results[i], step[i] = fine[j], finer[j]
        todo = np.array([i for i in todo if not control[i].reached], dtype=np.intp)
    for i, (result, scene) in enumerate(zip(results, scenes, strict=True)):
        result.step = float(step[i])
        worst = 0.0
        if not fixed[i]:
            result.error = control[i].error["force"]
            worst = max(control[i].error.values())
        result.verdict = judge(
            scene.problem,
            scene.duration,
            touched=bool(result.contacts),
            released=result.released,
            failure=_failure(result, max_contacts, max_steps),
            error=worst,
            tol=tol,
        )
        _check_range(scene.problem.law, float(result.force.max(initial=0.0)), scene.index)
    return results


def _failure(result: Result, max_contacts: int, max_steps: int) -> str:
    """Why a scene stopped before its end, if it did."""
    if result.diverged:
        return "stopped: it gained energy at the step given; use a smaller one, or none"
    if result.full:
        return (
            f"stopped before its end: more than {max_contacts} contacts, or {max_steps} steps in"
            f" one; shorten the duration or raise max_contacts or max_steps"
        )
    return ""


def _differences(coarse: list[Result], fine: list[Result], duration: Array) -> tuple[Array, Array]:
    """`force_difference` of many pairs: their time axes are laid end to end."""
    ends = np.concatenate(([0.0], np.cumsum(2 * duration)))

    def flat(results: list[Result]) -> tuple[Array, Array]:
        time = [a + np.concatenate(([0.0], r.time)) for a, r in zip(ends, results, strict=False)]
        force = [np.concatenate(([0.0], r.force)) for r in results]
        last = [np.array([a + d]) for a, d in zip(ends, duration, strict=False)]
        hold = [np.array([f[-1]]) for f in force]
        pairs = zip(time, last, strict=True), zip(force, hold, strict=True)
        return tuple(np.concatenate([x for pair in p for x in pair]) for p in pairs)  # type: ignore

    (ta, fa), (tb, fb) = flat(coarse), flat(fine)
    time = np.union1d(ta, tb)
    a, b = np.interp(time, ta, fa), np.interp(time, tb, fb)
    starts = np.searchsorted(time, ends[:-1])
    inside = np.ones(time.size - 1, dtype=bool)
    inside[starts[1:] - 1] = False  # between two scenes

    def norm(f: Array) -> Array:
        piece = np.diff(time) * (f[:-1] ** 2 + f[:-1] * f[1:] + f[1:] ** 2) / 3
        return np.sqrt(np.add.reduceat(np.where(inside, piece, 0.0), starts))

    size, gap = norm(b), norm(a - b)
    tops = np.maximum.reduceat(a, starts), np.maximum.reduceat(b, starts)
    with np.errstate(divide="ignore", invalid="ignore"):
        l2 = np.where(size > 0, gap / size, np.where(gap > 0, 1.0, 0.0))
        peak = np.where(size > 0, np.abs(tops[0] - tops[1]) / tops[1], l2)
    return l2, peak
