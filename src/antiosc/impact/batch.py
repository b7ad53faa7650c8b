"""Many impacts in one call, and lists of objects with different values.

`simulate_many` integrates every scene as `simulate` does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeGuard, TypeVar, cast

import numpy as np

from antiosc.base import checks, plausible, process
from antiosc.base._types import Array, ArrayLike
from antiosc.base.errors import AccuracyWarning, AntioscError, InputError, warn, warnings_to
from antiosc.base.progress import counting
from antiosc.base.texts import COMPLETED, STOPPED
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.impact.histories import History
from antiosc.impact.histories.run_end import (
    COMPLETED_MESSAGE,
    RunEnd,
    scenes_text,
    status_of,
    warn_of_batch,
)
from antiosc.impact.many import Many
from antiosc.impact.scene import DEFAULT_TOL, check_range, range_error, simulate_impact
from antiosc.impact.settings import MAX_CONTACTS, MAX_STEPS, Settings
from antiosc.impact.two_bodies import Impact, ImpactRows, ModalPair, assemble_pair
from antiosc.models.body import AUTO, AnyLaw, LinearBody, info_of, is_auto, law_of

T = TypeVar("T")


def sweep(make: Callable[..., T], **values: object) -> list[T]:
    """Create one object per value: `sweep(RigidMass, mass=masses, velocity=2.0)`.

    Parameters
    ----------
    make : callable
        A constructor, or any function of the keywords.
    values
        Each keyword is one value for all objects or a sequence; sequences have equal lengths.

    Returns
    -------
    list
        The results in the order of the values.

    Raises
    ------
    InputError
        For sequences of different lengths.
    """
    checks.function("make", make, "a constructor, such as RigidMass")
    size = common_length({k: len(v) for k, v in values.items() if is_sequence(v)})
    return [
        make(**{k: v[i] if is_sequence(v) else v for k, v in values.items()}) for i in range(size)
    ]


def is_sequence(value: object) -> TypeGuard[Sequence[Any]]:
    if isinstance(value, np.ndarray):
        return value.ndim == 1
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def common_length(lengths: dict[str, int]) -> int:
    sizes = set(lengths.values())
    if len(sizes) > 1:
        lengths_text = ", ".join(f"{k}: {v}" for k, v in lengths.items())
        raise InputError(f"sequences of a batch must have one length; got {lengths_text}.")
    if not sizes:
        return 1

    size = sizes.pop()
    if size == 0:
        raise InputError("a batch needs at least one scene; got empty sequences.")
    return size


#: Bytes of a scene with its results, measured with 20 000 and with 100 000 scenes.
BYTES_PER_SCENE = 3.2e3
#: Scenes that are solved at once.
SCENES_PER_CHUNK = 4096
#: Sentence on the warnings of `simulate` that a batch does not give.
UNCHECKED_NOTE = (
    "truncation, cells, large deflections and rotations are not checked: simulate the worst impact"
    " alone"
)


@checks.within_range
def simulate_many(
    models: LinearBody | Sequence[LinearBody],
    impactors: LinearBody | Sequence[LinearBody],
    contacts: AnyLaw | Sequence[AnyLaw] = AUTO,
    duration: ArrayLike = checks.REQUIRED,
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
) -> Many:
    """`simulate` for many scenes.

    The warnings of `simulate` on truncation, cells, large deflections and rotations are left out;
    to get them, simulate the impact with the largest force alone.

    Parameters
    ----------
    models, impactors, contacts
        As for `simulate`: one for all scenes, or a sequence of one for each scene (see `sweep`).
    duration, step, initial_velocity, gravity, gap : float or (S,)
        As for `simulate`: one for all scenes, or one for each scene.
    method, n, tol, max_contacts, max_steps
        As for `simulate`.

    Returns
    -------
    Many
        In the order of the scenes, with `peak_force`, `impulse`, `contact_time` and `restitution`
        (NaN if not defined). A scene whose integration fails, for instance because its force leaves
        the range of its law, is among the `failures` and has NaN results; a warning names it.

    Raises
    ------
    InputError
        For sequences of different lengths, and as `simulate`; the message names the scene.
    AccuracyError
        When every scene fails.
    """
    arguments: dict[str, object] = {
        "models": models,
        "impactors": impactors,
        "contacts": contacts,
        "duration": duration,
        "step": step,
        "initial_velocity": initial_velocity,
        "gravity": gravity,
        "gap": gap,
    }
    size = common_length({k: len(v) for k, v in arguments.items() if is_sequence(v)})
    process.require_memory(
        BYTES_PER_SCENE * size, f"a batch of {size} scenes", "simulate it in several calls"
    )
    columns = {k: list(v) if is_sequence(v) else [v] * size for k, v in arguments.items()}
    settings = Settings(DEFAULT_TOL if tol is None else tol, method, None, max_contacts, max_steps)
    movers = columns["impactors"]
    speeds = columns["initial_velocity"]
    plausible.warn_each(plausible.impact_doubts(columns["models"][:1], movers, *speeds))
    steps = cast("list[float | None]", columns.pop("step"))
    columns["contacts"] = _chosen_laws(columns["contacts"], columns["models"], movers)
    scenes = list(map(Impact._make, zip(*columns.values(), strict=True)))
    rows: list[_SceneResult] = []

    with counting("simulating impacts", size) as report:
        for begin in range(0, size, SCENES_PER_CHUNK):
            part = slice(begin, begin + SCENES_PER_CHUNK)

            def report_done(done: int, begin: int = begin) -> None:
                report(begin + done)

            rows += _solve_chunk(scenes[part], steps[part], n, settings, report_done)

    _raise_failures(rows)
    warn_of_batch([(r.status, r.message) for r in rows], [r.needed_radius for r in rows])
    if warned := [(i, row.warnings_text) for i, row in enumerate(rows) if row.warnings_text]:
        first, sentence = warned[0]
        which = scenes_text([i for i, _ in warned], size, first)
        warn(f"{which}: {sentence}", AccuracyWarning)
    return _many_of(rows)


def _chosen_laws(contacts: list[Any], models: list[Any], impactors: list[Any]) -> list[Any]:
    """The contact laws of all scenes, "auto" replaced by a law; InputError names the scene."""
    laws_by_pair: dict[tuple[int, int], ContactLaw] = {}
    laws = list(contacts)

    for i, pair in enumerate(zip(models, impactors, strict=True)):
        if not is_auto(laws[i]):
            continue
        key = id(pair[0]), id(pair[1])
        try:
            laws_by_pair[key] = laws[i] = laws_by_pair.get(key) or law_of(AUTO, *pair)
        except InputError as error:
            raise InputError(f"scene {i}: {error}") from error

    return laws


@dataclass(eq=False)
class _SceneResult:
    """Results of one scene of a batch, as of a `History`; `failure`: error of a failed scene."""

    status: int
    message: str
    peak_force: float = np.nan
    impulse: float = np.nan
    contact_time: float = np.nan
    restitution: float = np.nan
    contacts: int = 0  # their number
    step: float = np.nan  # in contact, mean [s]
    error: float = np.nan  # of the force, relative
    force: tuple[Array, Array] = (np.zeros(0), np.zeros(0))  # times [s] in contact, forces [N]
    failure: AntioscError | None = None
    warnings_text: str = ""

    @property
    def needed_radius(self) -> float:
        """Patch radius [m] that the force requires if it exceeds the law's range; else 0."""
        return getattr(self.failure, "radius", None) or 0.0


def _solve_chunk(
    scenes: Sequence[Impact],
    steps: Sequence[float | None],
    n: int | str | None,
    settings: Settings,
    report: Callable[[int], None],
) -> list[_SceneResult]:
    """Results of scenes: those of one `Impact.group` in one C call, all others one by one."""
    rows: dict[int, _SceneResult] = {}
    groups: dict[tuple[object, ...], list[int]] = {}
    can_group = settings.method == "exact" and n is None

    for i, (scene, step) in enumerate(zip(scenes, steps, strict=True)):
        key = scene.group() if can_group and step is None else None
        if key is not None:
            groups.setdefault(key, []).append(i)

    for group in groups.values():
        group_rows = _solve_group([scenes[i] for i in group], settings)
        rows.update((i, row) for i, row in zip(group, group_rows, strict=True) if row is not None)
        report(len(rows))

    for i, (scene, step) in enumerate(zip(scenes, steps, strict=True)):
        if i not in rows:
            rows[i] = _solve_single(scene, step, n, settings)
            report(len(rows))

    return [rows[i] for i in range(len(scenes))]


def _solve_group(scenes: Sequence[Impact], settings: Settings) -> list[_SceneResult | None]:
    """Results of a group of impacts; None for an impact that must be integrated separately."""
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            group = ImpactRows(scenes, settings)
    except (AntioscError, ArithmeticError):  # it tells itself of which
        return [None] * len(scenes)
    outcomes, pulses = group.solve()
    solved = zip(scenes, group.laws, outcomes.tolist(), pulses, strict=True)
    return [_result_of(*outcome, group.pair, settings) for outcome in solved]


def _result_of(
    scene: Impact,
    law: ContactLaw,
    outcome: tuple[Any, ...],
    pulses: tuple[Array, Array],
    pair: ModalPair,
    settings: Settings,
) -> _SceneResult | None:
    """The result from an outcome of the C library; None: integrate this scene separately."""
    answer, contacts, touches, goes_on, _, numbers, *others = outcome
    force, peak, certain, end, contact_time_estimate, *_ = others
    if answer == library.FULL or answer >= library.LAW_FAILED:
        return None

    run_end = RunEnd(answer, end, touches, [0] * goes_on, force, peak, certain)
    status, message = COMPLETED, COMPLETED_MESSAGE
    if answer != library.DONE or not touches or goes_on or not max(force, peak) <= settings.tol:
        limits = settings.max_contacts, settings.max_steps
        status, message = status_of(assemble_pair(scene), run_end, settings.tol, limits)
    peak_force, impulse, contact_time, restitution, closed, steps = numbers
    if peak_force > law.valid_force:
        doubts = [*info_of(scene.model).get("doubts", ()), *_blow_doubts(scene)]
        failure = range_error(law, peak_force, pair.structure.patch_radius, doubts)
        return _SceneResult(STOPPED, str(failure), failure=failure)
    return _SceneResult(
        status=status,
        message=message,
        peak_force=peak_force,
        impulse=impulse,
        contact_time=contact_time,
        restitution=restitution,
        contacts=contacts,
        step=closed / steps if steps else contact_time_estimate,
        error=force,
        force=pulses,
    )


def _blow_doubts(scene: Impact) -> list[str]:
    """Sentences on implausible numbers of an impact; empty if there are none."""
    (blow,) = plausible.impact_doubts([scene.model], [scene.impactor], scene.initial_velocity)
    return [blow] if blow else []


def _solve_single(
    scene: Impact, step: float | None, n: int | str | None, settings: Settings
) -> _SceneResult:
    """The result of one scene."""
    sentences: list[str] = []
    try:
        with warnings_to(sentences.append):
            hit = _history_of(scene, step, n, settings)
            e = hit.restitution
            return _SceneResult(
                status=hit.status,
                message=hit.message,
                peak_force=hit.peak_force,
                impulse=hit.impulse,
                contact_time=hit.contact_time,
                restitution=np.nan if e is None else e,
                contacts=len(hit.contacts),
                step=hit.step,
                error=hit.error.get("force", np.nan),
                force=hit.contact_histories[0].pulses(),
                warnings_text=" ".join(sentences),
            )
    except AntioscError as error:
        return _SceneResult(STOPPED, str(error), failure=error)


@checks.within_range
def _history_of(
    scene: Impact, step: float | None, n: int | str | None, settings: Settings
) -> History:
    """The history of one scene; AccuracyError if its force is out of range."""
    scene = scene._replace(duration=checks.positive("duration", scene.duration, "s"))
    history = simulate_impact(scene, replace(settings, step=step), n)
    check_range(history, _blow_doubts(scene))
    return history


def _raise_failures(rows: list[_SceneResult]) -> None:
    """Raise the first InputError or, if all failed, the error with the largest needed radius."""
    for i, row in enumerate(rows):
        if isinstance(row.failure, InputError):
            raise type(row.failure)(f"scene {i}: {row.failure}") from row.failure
    if all(row.failure is not None for row in rows):
        i = max(range(len(rows)), key=lambda k: rows[k].needed_radius)
        error = rows[i].failure
        assert error is not None
        raise type(error)(f"scene {i}: {error}") from error


def _many_of(rows: list[_SceneResult]) -> Many:
    """The results of all scenes as one object."""

    def columns(*names: str) -> dict[str, Array]:
        return {n: np.array([getattr(row, n) for row in rows], dtype=float) for n in names}

    told = {i: row.message for i, row in enumerate(rows)}
    facts = columns("step", "error")
    facts["contacts"] = np.array([row.contacts for row in rows], dtype=np.intp)
    facts["status"] = np.array([row.status for row in rows], dtype=np.intp)

    return Many(
        values=columns("peak_force", "impulse", "contact_time", "restitution"),
        failures={i: str(row.failure) for i, row in enumerate(rows) if row.failure is not None},
        facts=facts,
        messages={i: message for i, message in told.items() if message != COMPLETED_MESSAGE},
        force=[row.force for row in rows],
        what="impacts",
        note=UNCHECKED_NOTE,
    )
