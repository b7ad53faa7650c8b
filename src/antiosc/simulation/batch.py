"""Many impacts at once: every scene is integrated as `simulate` does, here or by an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks, march, plausible
from antiosc.base._types import Array, Index
from antiosc.base.errors import AccuracyWarning, AntioscError, InputError, warn
from antiosc.base.progress import counting
from antiosc.base.texts import Brief
from antiosc.contact import ContactLaw
from antiosc.models.body import LinearBody
from antiosc.models.model_info import info_of
from antiosc.simulation.errors.truncation import too_few
from antiosc.simulation.histories.energy import GAIN
from antiosc.simulation.histories.history import History
from antiosc.simulation.histories.verdict import (
    COMPLETED,
    STOPPED,
    Ended,
    Verdict,
    tell_all,
    tell_rotation,
    verdict_of,
)
from antiosc.simulation.integrators.comparison import MAX_CONTACTS, MAX_STEPS, Settings
from antiosc.simulation.problem.impacts import Impact, Rows
from antiosc.simulation.problem.two_bodies import Pair, pose
from antiosc.simulation.scene import beyond_law, check_range
from antiosc.simulation.simulate import DEFAULT_TOL, impact
from antiosc.simulation.sweep import (
    check_earlier,
    check_executor,
    common_length,
    is_many,
    returned,
)

CHUNKS = 64  # that the scenes are divided into for an executor
TOGETHER = 4096  # scenes that are solved at once without one
LOOKED_AT = 3  # models of which the shortest impact is asked whether they suffice for it


@dataclass(frozen=True, eq=False, repr=False)
class Batch(Brief):
    """Results of many impacts, one entry per scene; see `History` for their meaning.

    Attributes
    ----------
    peak_force, impulse, contact_time, restitution : (S,) float; restitution is NaN where
        `History.restitution` is None.
    contacts : (S,) number of contacts.
    step, error : (S,) step used [s] and estimated relative error of the force (NaN: step given).
    status : (S,) as in `History`; 2 for a scene that failed, whose numbers are NaN.
    force : list of S pairs (time, force): nodes of the contacts, force linear in between.
    message : list of S sentences that explain the status, or the error of a scene that failed.
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


@checks.within_range
def simulate_many(
    models: LinearBody | Sequence[LinearBody],
    impactors: LinearBody | Sequence[LinearBody],
    contacts: ContactLaw | Sequence[ContactLaw],
    duration: ArrayLike,
    method: str = "exact",
    *,
    n: int | str | None = None,
    step: ArrayLike | None = None,
    tol: float | None = None,
    initial_velocity: ArrayLike = 0.0,
    gravity: ArrayLike = 0.0,
    gap: ArrayLike | None = None,
    max_contacts: int = MAX_CONTACTS,
    max_steps: int = MAX_STEPS,
    executor: Executor | None = None,
    earlier: Batch | None = None,
) -> Batch:
    """`simulate` for many scenes.

    Parameters
    ----------
    models, impactors, contacts
        One for all scenes, or a sequence with one per scene (see `sweep`).
    duration, step, initial_velocity, gravity, gap : float or (S,)
        As for `simulate`, for all scenes or one per scene.
    method, n, tol, max_contacts, max_steps
        As for `simulate`.
    executor : concurrent.futures.Executor, optional
        What integrates the scenes, in chunks: processes, threads, `mpi4py.futures`, Dask's. A
        chunk that it does not return, for instance because a process died, fails as a whole.
    earlier : Batch, optional
        What an earlier call with the same scenes returned: only those of status 2 are integrated.

    Returns
    -------
    Batch
        In the order of the scenes. A scene whose integration fails, for instance because its force
        leaves the range of its law, has status 2, NaN for numbers and the error as its message; a
        warning names it.

    Raises
    ------
    InputError
        For sequences of different lengths, and as `simulate`; the message names the scene.
    AccuracyError
        When every scene fails.
    """
    given: dict[str, Any] = {
        "models": models,
        "impactors": impactors,
        "contacts": contacts,
        "duration": duration,
        "step": step,
        "initial_velocity": initial_velocity,
        "gravity": gravity,
        "gap": gap,
    }
    check_executor(executor)
    size = common_length({k: len(v) for k, v in given.items() if is_many(v)})
    columns = {k: list(v) if is_many(v) else [v] * size for k, v in given.items()}
    settings = Settings(DEFAULT_TOL if tol is None else tol, method, None, max_contacts, max_steps)
    movers, speeds = columns["impactors"], columns["initial_velocity"]
    plausible.tell([plausible.of_blow(m, movers, *speeds) for m in columns["models"][:1]])
    steps = columns.pop("step")
    scenes = list(map(Impact._make, zip(*columns.values(), strict=True)))
    rows = _rows_of(earlier, size)
    todo = [i for i, row in enumerate(rows) if row.verdict.status == STOPPED]
    chunk = TOGETHER if executor is None else -(-size // CHUNKS)
    parts = [todo[k : k + chunk] for k in range(0, len(todo), chunk)]

    def given_of(part: list[int]) -> _Chunk:
        return [scenes[i] for i in part], [steps[i] for i in part], n, settings

    with counting("simulating impacts", len(todo)) as ready:
        if executor is None:
            found: Iterable[list[_Row] | AntioscError] = (
                _solved(*given_of(part), partial(_further, ready, k * chunk))
                for k, part in enumerate(parts)
            )
        else:
            found = returned(executor, _solved, [(given_of(part), {}) for part in parts])
        for count, (part, result) in enumerate(zip(parts, found, strict=True), start=1):
            if isinstance(result, AntioscError):
                result = [_failed(result)] * len(part)
            for i, row in zip(part, result, strict=True):
                rows[i] = row
            ready(min(count * chunk, len(todo)))
    _raise(rows)
    tell_all([r.verdict for r in rows])
    if n != "auto":
        _tell_too_few(scenes, steps, rows, n, settings)
    scene = max(range(len(rows)), key=lambda i: rows[i].turned[1])
    tell_rotation(f"{rows[scene].turned[0]} of scene {scene}", rows[scene].turned[1])
    return _gathered(rows)


def _tell_too_few(
    scenes: Sequence[Impact],
    steps: Sequence[float | None],
    rows: Sequence[_Row],
    n: int | str | None,
    settings: Settings,
) -> None:
    """Warn of anti-oscillators that are too few for the shortest impacts, of `LOOKED_AT` models."""
    sharp = [
        (row.peak_force / row.impulse, i)
        for i, row in enumerate(rows)
        if row.impulse > 0 and info_of(scenes[i].model).method == "krylov"
    ]
    seen: set[int] = set()
    for _, i in sorted(sharp, reverse=True):
        if len(seen) == LOOKED_AT:
            return
        if id(scenes[i].model) not in seen:
            seen.add(id(scenes[i].model))
            hit, _ = _impact(scenes[i], steps[i], n, settings)
            if sentence := too_few(hit.model, hit.assembly):
                warn(f"scene {i}: {sentence}", AccuracyWarning)
                return


# -- one scene in, one row out

_Chunk = tuple[list[Impact], list[float | None], int | str | None, Settings]


@dataclass(eq=False)
class _Row:
    """What a batch keeps of one scene; `error` that of a scene which failed."""

    verdict: Verdict
    peak_force: float = np.nan
    impulse: float = np.nan
    contact_time: float = np.nan
    restitution: float = np.nan
    contacts: int = 0
    step: float = np.nan
    accuracy: float = np.nan
    force: tuple[Array, Array] = (np.zeros(0), np.zeros(0))
    error: AntioscError | None = None
    turned: tuple[str, float] = ("", 0.0)


def _solved(
    scenes: Sequence[Impact],
    steps: Sequence[float | None],
    n: int | str | None,
    settings: Settings,
    done: Callable[[int], None] = lambda count: None,
) -> list[_Row]:
    """The rows of scenes: those that the march takes as arrays together, the others by
    themselves."""
    rows: dict[int, _Row] = {}
    groups: dict[tuple[object, ...], list[int]] = {}
    together = settings.method == "exact" and n is None
    for i, (scene, step) in enumerate(zip(scenes, steps, strict=True)):
        key = scene.group() if together and step is None else None
        if key is not None:
            groups.setdefault(key, []).append(i)
    for group in groups.values():
        here = [scenes[i] for i in group]
        found = _together(here, settings, partial(_further, done, len(rows)))
        rows |= {i: row for i, row in zip(group, found, strict=True) if row is not None}
    for i, (scene, step) in enumerate(zip(scenes, steps, strict=True)):
        if i not in rows:
            rows[i] = _alone(scene, step, n, settings)
            done(len(rows))
    return [rows[i] for i in range(len(scenes))]


def _further(done: Callable[[int], None], before: int, count: int) -> None:
    """Tell how many are done, of which some were before."""
    done(before + count)


def _together(
    scenes: Sequence[Impact], settings: Settings, done: Callable[[int], None]
) -> list[_Row | None]:
    """The rows of a group of impacts; None for one that must be integrated by itself."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            group = Rows(scenes, settings.tol, *settings.limits)
    except (AntioscError, ArithmeticError):  # it tells itself of which
        return [None] * len(scenes)
    outcomes, pulses = group.solved(done)
    each = zip(scenes, group.laws, outcomes.tolist(), pulses, strict=True)
    return [_row_of(*one, group.pair, settings) for one in each]


def _row_of(
    scene: Impact,
    law: ContactLaw,
    outcome: tuple[Any, ...],
    pulses: tuple[Array, Array],
    made: Pair,
    settings: Settings,
) -> _Row | None:
    """The row of what the march returned; None where that is not enough."""
    answer, contacts, touches, goes_on, _, body, numbers, force, peak, certain, *rest = outcome
    time, lasting, gained, highest, turned = rest
    if answer == march.FULL or answer >= march.LAW_FAILED or gained > 0.1 * GAIN * highest:
        return None
    ended = Ended(answer, time, touches, [0] * goes_on, force, peak, certain)
    verdict = Verdict(COMPLETED, "Completed.")
    if answer != march.DONE or not touches or goes_on or not max(force, peak) <= settings.tol:
        verdict = verdict_of(pose(*scene), ended, settings.tol, settings.limits)
    most, impulse, contact_time, restitution, closed, steps = numbers
    if most > law.valid_force:
        return _failed(beyond_law(law, most, made.bodies[0].patch_radius, _doubts(scene)))
    return _Row(
        verdict=verdict,
        peak_force=most,
        impulse=impulse,
        contact_time=contact_time,
        restitution=restitution,
        contacts=contacts,
        step=closed / steps if steps else lasting,
        accuracy=force,
        force=pulses,
        turned=(("structure", "impactor")[body], turned) if turned else ("", 0.0),
    )


def _doubts(scene: Impact) -> list[str]:
    """What is implausible of a scene."""
    blow = plausible.of_blow(scene.model, [scene.impactor], scene.initial_velocity)
    return [*plausible.of_model(scene.model), *filter(None, [blow])]


def _alone(scene: Impact, step: float | None, n: int | str | None, settings: Settings) -> _Row:
    try:
        return _row(*_impact(scene, step, n, settings))
    except AntioscError as error:
        return _failed(error)


def _failed(error: AntioscError) -> _Row:
    return _Row(Verdict(STOPPED, str(error)), error=error)


@checks.within_range
def _impact(
    scene: Impact, step: float | None, n: int | str | None, settings: Settings
) -> tuple[History, Verdict]:
    """One scene; AccuracyError if its force leaves the range of its law."""
    scene = scene._replace(duration=checks.positive("duration", scene.duration, "s"))
    history, verdict = impact(scene, replace(settings, step=step), n)
    check_range(history, _doubts(scene))
    return history, verdict


def _row(hit: History, verdict: Verdict) -> _Row:
    e = hit.restitution
    return _Row(
        verdict=verdict,
        peak_force=hit.peak_force,
        impulse=hit.impulse,
        contact_time=hit.contact_time,
        restitution=np.nan if e is None else e,
        contacts=len(hit.contacts),
        step=hit.step,
        accuracy=hit.error.get("force", np.nan),
        force=hit.contact_histories[0].pulses(),
        turned=hit.largest_rotation(),
    )


def _raise(rows: list[_Row]) -> None:
    """Raise the first InputError, and any error that all scenes share."""
    for i, row in enumerate(rows):
        if isinstance(row.error, InputError):
            raise type(row.error)(f"scene {i}: {row.error}") from row.error
    if all(row.error is not None for row in rows):
        error = rows[0].error
        assert error is not None
        raise type(error)(f"scene 0: {error}") from error


def _gathered(rows: list[_Row]) -> Batch:
    def column(name: str, kind: type = float) -> Any:
        return np.array([getattr(row, name) for row in rows], dtype=kind)

    return Batch(
        peak_force=column("peak_force"),
        impulse=column("impulse"),
        contact_time=column("contact_time"),
        restitution=column("restitution"),
        contacts=column("contacts", np.intp),
        step=column("step"),
        error=column("accuracy"),
        status=np.array([row.verdict.status for row in rows], dtype=np.intp),
        force=[row.force for row in rows],
        message=[row.verdict.message for row in rows],
    )


def _rows_of(earlier: Batch | None, size: int) -> list[_Row]:
    """The rows of a batch; without one, rows of status 2."""
    if earlier is None:
        return [_Row(Verdict(STOPPED, ""))] * size
    batch = checks.instance("earlier", earlier, Batch, "the Batch of an earlier call")
    check_earlier(len(batch), size)
    names = ("peak_force", "impulse", "contact_time", "restitution", "contacts", "step", "force")
    rows = []
    for i, (status, message) in enumerate(zip(batch.status.tolist(), batch.message, strict=True)):
        values = {name: getattr(batch, name)[i] for name in names}
        rows.append(_Row(Verdict(status, message), accuracy=batch.error[i], **values))
    return rows
