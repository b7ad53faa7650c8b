"""Runs a scene: makes its objects in turn, and the calls of sweeps, maps and random values."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import antiosc
from antiosc.base import progress
from antiosc.base.errors import (
    AntioscError,
    finite_element_packages,
    labelled,
    sorted_by_weight,
    warn,
    warnings_to,
    without_warnings,
)
from antiosc.base.texts import STOPPED
from antiosc.impact.histories import budget_of
from antiosc.impact.histories.bars import ErrorBudget
from antiosc.models.body import coarse_cell_warning, info_of
from antiosc_app.scene_file import schema
from antiosc_app.scene_file.build import Builder, Call, Evaluation
from antiosc_app.scene_file.document import Mistakes, Place, Table, names_text, place_text
from antiosc_app.scene_file.scene import (
    CompiledScene,
    SceneObjects,
    impactor_and_law,
    model_call,
    structure_call,
    structure_section,
)
from antiosc_app.scene_file.schema import KIND_KEY, parameters_of

if TYPE_CHECKING:
    from mpi4py import MPI

    from antiosc import History, Many, PeakField, Structure
    from antiosc.strikes.tradeoff import Tradeoff


T = TypeVar("T")


@dataclass(kw_only=True)
class SceneResults(SceneObjects[Any]):
    """The results of a scene for terminal and report; `compiled` is None without a scene file."""

    compiled: Any = None
    title: str = ""
    tradeoff: Tradeoff | None = None


def make_results(
    compiled: CompiledScene, object_names: Sequence[str], evaluate: Evaluation | None = None
) -> SceneResults:
    """Make the objects of a scene with the names `object_names`; SceneFileError if one fails."""
    evaluate = evaluate or Evaluation(compiled.document)
    title = str(compiled.document.data.get("title") or compiled.document.path.stem)
    results_of_run = SceneResults(compiled=compiled, title=title, warnings=list(compiled.warnings))
    with collected_warnings(results_of_run.warnings):
        for name in object_names:
            setattr(results_of_run, name, evaluate(getattr(compiled, name)))
        hit = results_of_run.history
        if hit and (compiled.is_strike or (compiled.scene is None and hit.assembly.stretch_forces)):
            results_of_run.model = hit.model
        if compiled.is_strike and hit:
            results_of_run.structure = results_of_run.structure or hit.structure
    return results_of_run


@contextlib.contextmanager
def collected_warnings(sentences: list[str]) -> Iterator[None]:
    """Context that appends warnings to `sentences`, and sorts them by weight at its end.

    Repetitions are dropped; after an error the warnings are printed.
    """

    try:
        with warnings_to(sentences.append):
            yield
    except AntioscError:
        for sentence in sorted_by_weight(sentences):
            progress.print_text(labelled(sentence), sys.stderr)
        raise
    finally:
        sentences[:] = sorted_by_weight(sentences)


# -- ranks


def communicator() -> MPI.Comm | None:
    """The communicator of all ranks if mpi4py is loaded; None for a single process."""
    loaded = sys.modules.get("mpi4py.MPI")
    return getattr(loaded, "COMM_WORLD", None)


def on_first_rank(work: Callable[[], T]) -> T:
    """Do `work` on the first rank; return its result, or raise its error, on all ranks.

    For work on files: after an error on only one rank, the others would wait for ever.
    """
    comm = communicator()
    if comm is None or comm.size == 1:
        return work()
    from antiosc.fem.platform import on_root

    return on_root(comm, work)  # type: ignore[no-any-return]


#: Largest number of impacts of a sweep.
MAX_IMPACTS = 100_000
#: Largest number of structures of a sweep.
MAX_MODELS = 1000
#: Arguments of a batch that come from other sections.
_BATCH_ARGUMENTS = ("models", "impactors", "contacts")
#: Their names for one impact.
_SINGULAR_NAMES = {"models": "model", "impactors": "impactor", "contacts": "contact"}

# -- a scene with other values in it


def leaf_values(table: Table, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield (place, value) of each value in nested tables."""
    for key, value in table.items():
        if isinstance(value, dict) and KIND_KEY not in value:
            yield from leaf_values(value, (*place, key))
        else:
            yield (*place, key), value


def varied_builder(
    build: Builder,
    values: Mapping[Place, object],
    origins: Mapping[Place, Place],
    mistakes_collector: Mistakes,
) -> Builder:
    """The scene with `values` at their places.

    `origins`: place of a value -> its place in [sweep] or [monte_carlo], for mistakes, which
    `mistakes_collector` collects.
    """
    data = dict(build.data)
    for place, value in values.items():
        table = data
        for key in map(str, place[:-1]):
            section = table.get(key)
            table[key] = dict(section) if isinstance(section, dict) else {}
            table = table[key]
        table[str(place[-1])] = value
    return Builder(
        replace(
            build.document, data=data, mistakes=replace(mistakes_collector, varied_origins=origins)
        )
    )


# -- [sweep]


def varied_values(build: Builder | CompiledScene) -> dict[Place, list[object]]:
    """Lists in [sweep] by the place of the varied value in the scene."""
    data = build.data if isinstance(build, Builder) else build.document.data
    table = data.get("sweep")
    if isinstance(table, dict):
        return dict(leaf_values(table))
    return {}


def sweep_call(build: Builder, compiled: CompiledScene) -> Call | None:
    """The call of `simulate_many` for [sweep]; None without it, or after a mistake in it."""
    lists = varied_values(build)
    sections = _variable_sections(build)
    if "sweep" in build.data and not lists:
        sentence = "[sweep] holds no list of values, as impactor.velocity = [1.0, 2.0]."
        build.note(("sweep",), sentence)
    combinations: list[list[object]] = []
    for place, values in lists.items():
        limit = MAX_IMPACTS if place[0] in schema.SWEPT_SECTIONS else MAX_MODELS
        sweep_place = ("sweep", *place)
        if place[0] not in sections or len(place) < 2:
            sentence = (
                f"[sweep] has lists of {names_text(sections)}, as impactor.velocity = [1.0, 2.0]"
            )
            build.note(sweep_place, f"{sentence}; got {place_text(place)}.")
        elif not isinstance(values, list) or not 0 < len(values) <= limit:
            build.note(
                sweep_place, f"{place_text(sweep_place)} must be a list of 1 to {limit} values."
            )
        elif place[0] == "simulate" and place[1] not in _batch_keys():
            sentence = f"[sweep] has lists of {names_text(_batch_keys())} of [simulate]"
            build.note(sweep_place, f"{sentence}; got {place[1]!r}.")
        else:
            combinations.append(values)
    if len(combinations) < len(lists):
        return None
    sizes = {place_text(place): len(values) for place, values in lists.items()}
    if len(set(sizes.values())) > 1:
        text = ", ".join(f"{name}: {size}" for name, size in sizes.items())
        build.note(("sweep",), f"the lists of [sweep] must be equally long; got {text}.")
        return None
    if not lists or None in (compiled.model, compiled.impactor, compiled.contact, compiled.history):
        return None
    return _batch_call(build, compiled, lists, next(iter(sizes.values())))


#: Largest number of impacts of a sweep whose error bars are computed: each is run again for them.
MAX_BUDGETS = 50


def budgets_of_rows(batch: Many, arguments: Table) -> list[ErrorBudget | None]:
    """The error budget of each impact of a batch, None if it has none.

    `arguments`: arguments of `simulate_many` by name. More than MAX_BUDGETS impacts get none.
    """
    if len(batch) > MAX_BUDGETS:
        return [None] * len(batch)

    lists = {name for name, values in arguments.items() if isinstance(values, list)}
    budgets: list[ErrorBudget | None] = []
    with progress.counting("error bars of the sweep", len(batch)) as report:
        for i, status in enumerate(batch.facts["status"]):
            row = {name: x[i] if name in lists else x for name, x in arguments.items()}
            impact = {_SINGULAR_NAMES.get(name, name): value for name, value in row.items()}
            budgets.append(None if status == STOPPED else _budget_of_row(impact))
            report(i + 1)
    return budgets


def _budget_of_row(arguments: Table) -> ErrorBudget | None:
    """The error budget of the impact with these arguments of `simulate`; None after an error."""
    with without_warnings():  # the batch has shown them
        try:
            return error_budget(antiosc.simulate(**arguments))
        except AntioscError:
            return None


def error_budget(history: Any) -> ErrorBudget | None:
    """The error budget of a history; None for a scene, or if cells are too large for it."""
    if not isinstance(history, antiosc.History) or coarse_cell_sentence(history):
        return None
    return budget_of(history)


def coarse_cell_sentence(hit: History | None) -> str:
    """Sentence if the cell at the impact's site is too large for the contact; else ""."""
    if hit is None or isinstance(hit, antiosc.SceneHistory) or not hit.run.touches:
        return ""
    told = coarse_cell_warning(hit.model, "", hit.assembly.contact_time_estimate)
    reason = info_of(hit.model).no_estimate
    return f"{told} The mesh's error is not estimated: {reason}" if told and reason else told


def _variable_sections(build: Builder) -> list[str]:
    """The sections that a sweep of this scene may vary."""
    reduced = structure_section(build) not in schema.MODEL_SECTIONS
    structural = (
        n for n in schema.STRUCTURE_SECTIONS if n in build.data or (n == "extract" and reduced)
    )
    return [*schema.SWEPT_SECTIONS, *structural]


def _batch_keys() -> list[str]:
    """The keys of [simulate] for which a batch accepts lists."""
    batch = parameters_of("simulate_many")
    of_one = parameters_of("simulate")
    return [name for name in batch if name in of_one and batch[name].form.to_array]


def _batch_call(
    build: Builder, compiled: CompiledScene, varied_lists: Mapping[Place, list[object]], count: int
) -> Call | None:
    """The call of `simulate_many` with the arguments of [simulate] and `count` varied values.

    None after a mistake.
    """
    table = build.section("simulate")
    swept = {place[0] for place in varied_lists}
    stretches = _with_second_order_forces(build, compiled.structure, compiled.model)
    rows: list[tuple[Call | None, ...]] = []
    times: dict[str, list[object]] = {str(p[1]): [] for p in varied_lists if p[0] == "simulate"}
    for i in range(count):
        values = {place: entries[i] for place, entries in varied_lists.items()}
        origins = {place: ("sweep", *place, i) for place in varied_lists}
        variant = varied_builder(build, values, origins, build.document.mistakes)
        # objects that the values do not change are shared
        part = stretches if swept <= {*schema.SWEPT_SECTIONS} else _varied_model(variant)
        pair = (compiled.impactor, compiled.contact)
        if swept & {"impactor", "contact"}:
            pair = impactor_and_law(variant)
        rows.append((part, *pair))
        if times:
            last_scene = zip(("model", "impactor", "contact"), rows[-1], strict=True)
            hit = variant.call_of_section("simulate", given_arguments=dict(last_scene))
            for name, entries in times.items():
                entries.append(None if hit is None else hit.arguments[name])
        build.warnings += [
            sentence for sentence in variant.warnings if sentence not in build.warnings
        ]
    if None in chain(*rows, *times.values()):
        return None
    columns = {
        **dict(zip(_BATCH_ARGUMENTS, map(list, zip(*rows, strict=True)), strict=True)),
        **times,
    }
    fixed_values = {name: value for name, value in table.items() if name not in times}
    return build.call(("simulate_many",), fixed_values, ("simulate",), columns)


def _with_second_order_forces(
    build: Builder, part: Call | None, model_call: Call | None
) -> Call | None:
    """The call `model_call` of the model for many impacts, extended by second-order forces.

    It is unchanged if [extract] has the key `stretch`, or [simulate] `step`, `n` or a `method`
    other than "exact".
    """
    options = {
        **build.section("simulate"),
        **build.section("simulate", dict, build.section("sweep")),
    }
    linear = {"step", "n"} & set(options) or options.get("method", "exact") != "exact"
    if None in (part, model_call) or linear or "stretch" in build.section("extract"):
        return model_call

    def stretching(structure: Any, model: Any) -> object:
        with finite_element_packages():
            from antiosc.strikes.second_order import stretching as with_forces
        return with_forces(structure, model)

    return Call(stretching, {"structure": part, "model": model_call})


def _varied_model(build: Builder) -> Call | None:
    """The call that makes the model of a varied scene, without shapes, to save memory."""
    part = structure_call(build)
    reduced_call = _with_second_order_forces(build, part, model_call(build, part))

    def model_without_shapes() -> object:
        reduced = Evaluation(build.document)(reduced_call)
        forces = None if reduced.stretch is None else replace(reduced.stretch, shapes=None)
        return replace(reduced, shapes=None, hidden=None, stretch=forces)

    if reduced_call is None:
        return None
    return Call(model_without_shapes, {})


# -- [monte_carlo_call]


class NominalImpact(NamedTuple):
    """A study's impact at the scene's own values: history, structure and stress fields."""

    hit: History
    structure: Structure | None
    fields: Mapping[str, PeakField]


def monte_carlo_call(build: Builder, compiled: CompiledScene) -> Call | None:
    """The call of `monte_carlo`; None without its section, or after a mistake in it."""
    table = build.data.get("monte_carlo")
    if not isinstance(table, dict):
        return None
    random = {name: value for name, value in table.items() if isinstance(value, dict)}
    options = {name: value for name, value in table.items() if name not in random}
    inputs = _distributions(build, random)
    if not inputs:
        example = 'impactor.velocity = {kind = "normal", mean = 2.0, sigma = 0.1}'
        build.note(("monte_carlo",), f"[monte_carlo] draws nothing, as {example}.")
    model = _with_second_order_forces(build, compiled.structure, compiled.model)
    if model is None or compiled.history is None or None in inputs.values():
        return None

    names = {place_text(place): place for place in inputs}
    run = partial(_impact_of_values, build, names, compiled.history.arguments["duration"])
    laws = {place_text(place): law for place, law in inputs.items()}
    arguments = {"run": Call(run, {"model": model}), "inputs": laws}
    return build.call(schema.SECTIONS["monte_carlo"], options, ("monte_carlo",), arguments)


def _distributions(build: Builder, random_inputs: Table) -> dict[Place, Call | None]:
    """Calls of distributions (None after a mistake) by the place of the random value."""
    calls: dict[Place, Call | None] = {}
    for place, value in leaf_values(random_inputs):
        at: Place = ("monte_carlo", *place)
        if place[0] not in schema.RANDOM_SECTIONS or place[0] not in build.data or len(place) < 2:
            sections = names_text([n for n in schema.RANDOM_SECTIONS if n in build.data])
            build.note(at, f"[monte_carlo] draws values of {sections}; got {place_text(place)}.")
            continue
        law = calls[place] = build.call(schema.DISTRIBUTION_NAMES.split(), value, at)
        if law is not None:  # a scene with the median has to be sound
            middle = {place: float(law.result.median())}
            impactor_and_law(varied_builder(build, middle, {place: at}, build.document.mistakes))
    return calls


def _impact_of_values(
    build: Builder, places: Mapping[str, Place], duration: float, model: Any
) -> Callable[..., tuple[object, ...]]:
    """The function that `monte_carlo` calls with values by name, such as impactor.velocity.

    It returns (model, impactor, contact law, duration [s]); `places`: places of values by name.
    """

    problems = build.document.mistakes
    origins = {place: ("monte_carlo", *place) for place in places.values()}

    def impact_of(**values: Any) -> tuple[object, ...]:
        drawn = {place: values[name] for name, place in places.items()}
        scene = varied_builder(build, drawn, origins, Mistakes(problems.name, problems.text))
        calls = impactor_and_law(scene)
        scene.document.mistakes.raise_if_any()
        for sentence in scene.warnings:
            warn(sentence)
        return (model, *(None if call is None else call.result for call in calls), duration)

    return impact_of


# -- [map]


def map_call(build: Builder, compiled: CompiledScene) -> Call | None:
    """The call of `impact_map`; None without [map]."""
    arguments: dict[str, object] = {"structure": compiled.structure}
    table = dict(build.section("map"))
    if table.get("where") == []:
        build.note(("map", "where"), "map.where: a map needs at least one point or group.")
    if "map" in build.data and {"impactor", "contact"} & set(build.data):
        arguments |= {"impactor": compiled.impactor, "contact": compiled.contact}
        if "duration" in build.section("simulate"):
            table.setdefault("duration", build.section("simulate")["duration"])
        if "duration" not in table:
            build.note(("map",), "[map] lacks 'duration', of each impact in s.")
    return build.call_of_section(
        "map", {"map": table} if "map" in build.data else {}, given_arguments=arguments
    )
