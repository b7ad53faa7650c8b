"""The commands on scene files: their output, the files that they write, and their exit codes."""

from __future__ import annotations

import sys
import time
import traceback
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import antiosc
from antiosc.base import checks
from antiosc.base.errors import AntioscError, InputError, labelled, message_weight
from antiosc.base.progress import print_text
from antiosc.base.texts import STOPPED, plain_number
from antiosc.fields.probe import probed_point
from antiosc_app import new, report, results
from antiosc_app.kept import PartCache
from antiosc_app.scene_file import run
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import Document, Table, read_document
from antiosc_app.scene_file.scene import COMMAND_STUDIES, CompiledScene, place_arguments
from antiosc_app.scene_file.settled import SettledScene, settle

if TYPE_CHECKING:
    from antiosc.strikes.tradeoff import Tradeoff, TradeoffMember


def run_guarded(options: Namespace) -> int:
    """Run a command and return its exit code; an unforeseen error ends all MPI ranks."""
    try:
        if options.command in COMMAND_STUDIES:
            return _run_study(options)
        return _COMMANDS[options.command](options)
    except AntioscError:
        raise
    except BaseException:
        comm = run.communicator()
        if comm is not None and comm.size > 1:
            traceback.print_exc()
            sys.stderr.flush()
            comm.Abort(1)
        raise


def _run_new(options: Namespace) -> int:
    """Run `antiosc new`; returns the exit code."""
    file = options.file
    part = options.part
    if part is None and file is not None and Path(file).suffix.lower() != ".toml":
        file, part = f"{checks.new_file('the part', file).stem}.toml", file  # the part alone
    names = ("drop", "material", "unit", "size", "piece")
    given = {name: getattr(options, name) for name in names}
    path, sentences = new.write_scene(file or "scene.toml", part, **given)
    for sentence in sentences:
        print_text(sentence)
    print_text(f"wrote {path}; next: look at it, then antiosc run {path} --report report.html")
    return 0


def _run_open(options: Namespace) -> int:
    """Run `antiosc open`; returns the exit code."""
    from antiosc_app import view

    names = ("unit", "size", "piece", "contact")
    given = {name: getattr(options, name) for name in names}
    view.serve_until_interrupted(options.part, not options.no_browser, **given)
    return 0


def _run_check(options: Namespace) -> int:
    """Run `antiosc check`; returns the exit code."""
    scene = compile_document(read_document(options.file))
    sentences = map(labelled, scene.warnings)
    print_text(
        f"{options.file}: no mistakes found; "
        f"for {', '.join(scene.runnable_commands()) or 'nothing to run'}."
    )
    for sentence in sentences:
        print_text(f"{options.file}: {sentence}")
    return 0


def _run_export(options: Namespace) -> int:
    """Run `antiosc export`; returns the exit code."""
    from antiosc_app.export import ending_of

    ending_of(options.out)
    scene, evaluate = settle(read_document(options.file))
    source = scene.scene or scene.model
    options_of_run = {} if scene.history is None else scene.history.arguments
    if scene.is_strike:
        source = Call(lambda history: history.model, {"history": scene.history})
    if source is None:
        raise InputError(
            f"{options.file} has nothing to export: give a model ([extract] or [model]) or"
            " a scene of several contacts."
        )
    arguments = {"path": options.out, "source": source, "fmi": options.fmi}
    if scene.impactor is not None:
        arguments |= {"impactor": scene.impactor, "contact": scene.contact}
    shared = ("initial_velocity", "gravity", "gap") if scene.scene is None else ()
    keys = {"duration", *shared} & set(options_of_run)
    arguments |= {name: options_of_run[name] for name in keys}

    with run.collected_warnings(scene.warnings):
        evaluate(Call(antiosc.export, arguments))
    for sentence in scene.warnings:
        print_text(labelled(sentence), sys.stderr)
    print_text(f"wrote {options.out}")
    return 0


#: Tolerance of a trade-off if neither the command nor [strike] gives one.
DEFAULT_TOL = 0.02
#: What its bars are of.
BARS_TEXT = (
    "force, all: bars without the error of the contact law; all, to finest: the largest of those of"
    " peak force, impulse and contact time."
)
#: Sections that have no place beside [strike]; keys that it shares with [simulate].
EXCLUDED_BY_STRIKE = {"extract", "simulate", "sweep", "map", "monte_carlo", "probes", "stress"}
STRIKE_KEYS = {"duration", "initial_velocity", "gravity", "gap"}


def _run_tradeoff(options: Namespace) -> int:
    """Run `antiosc tradeoff`; returns the exit code."""
    start = time.perf_counter()
    page = _report_path(options)
    given = {name: getattr(options, name) for name in ("tol", "compare", "limit")}
    given = {name: value for name, value in given.items() if value is not None}
    scene, tradeoff = compare_methods(read_document(options.file), True, **given)
    print_text(f"\n{tradeoff.summary()}\n{BARS_TEXT}\n{tradeoff.message}")
    for sentence in scene.warnings:
        print_text(labelled(sentence), sys.stderr)
    if options.chart is not None:
        print_text(f"wrote {tradeoff.plot(options.chart)}")
    if page is not None:
        shown = report.results_of(scene, tradeoff)
        report.write_page(shown, results.presentations(shown), page)
        print_text(f"wrote {page}")
    methods = sum(member.seconds for member in (*tradeoff.table, *tradeoff.others))
    whole = plain_number(time.perf_counter() - start, 3)
    print_text(f"In all {whole} s, of which the methods took {plain_number(methods, 3)} s.")
    return 0


def compare_methods(
    document: Document, print_methods: bool = False, **tradeoff_options: object
) -> tuple[CompiledScene, Tradeoff]:
    """(compiled scene, trade-off of its impact).

    `print_methods`: print each method once it has run; `tradeoff_options`: arguments of `tradeoff`
    instead of the scene's.
    """
    scene = compile_document(with_strike(settle(document).scene.document))
    arguments = {**tradeoff_arguments(scene, str(document.path)), **tradeoff_options}
    from antiosc.strikes.tradeoff import line_of

    def print_member(member: TradeoffMember) -> None:
        print_text(line_of(member.cells()))

    if print_methods:
        print_text(f"As they are computed:\n{line_of()}")
        arguments["ready"] = print_member
    with run.collected_warnings(scene.warnings):
        return scene, Evaluation(scene.document)(Call(antiosc.tradeoff, arguments))


def with_strike(document: Document) -> Document:
    """The scene with [strike] instead of [extract] and [simulate], if its mesh can be refined."""
    data = document.data
    simulated = data.get("simulate")
    meshed = {"geometry", "extract", "impactor"} <= set(data)
    if (
        not isinstance(simulated, dict)
        or not meshed
        or {"attached", "structure"} & set(data)
        or len(data.get("sites", ())) != 1
    ):
        return document
    common = {name: value for name, value in simulated.items() if name in STRIKE_KEYS}
    sections = {name: value for name, value in data.items() if name not in EXCLUDED_BY_STRIKE}
    return replace(document, data={**sections, "strike": {"tol": DEFAULT_TOL, **common}})


def tradeoff_arguments(scene: CompiledScene, path: str) -> Table:
    """The arguments of `tradeoff` for a scene's impact; InputError names `path` without one."""
    if scene.is_strike and scene.history is not None:
        return scene.history.arguments
    model = scene.model
    history = scene.history
    if model is None or history is None or model.name != "extract":
        raise InputError(
            f"{path} has no impact to compare: a trade-off needs [strike], or [simulate] on a part"
            " with a mesh and one site."
        )
    arguments = history.arguments
    options = ("impactor", "contact", "duration", "initial_velocity", "gravity", "gap")
    common = {name: arguments[name] for name in options if name in arguments}
    site = model.arguments["site"]
    return {"source": scene.structure, "site": site, "tol": DEFAULT_TOL, **common}


def _report_path(options: Namespace) -> Path | None:
    """The path of --report, by default the scene's name with .html; None without --report."""
    if options.report is None:
        return None
    return report.writable_report_path(
        options.report or str(Path(options.file).with_suffix(".html"))
    )


def _check_probes(begun: SettledScene) -> None:
    """Raise InputError for a probe off the structure, before the impact is computed."""
    scene, evaluate = begun
    for call in scene.probes.values():
        if call is None or scene.structure is None:
            continue
        given = {"structure": scene.structure, **place_arguments(call)}
        evaluate(Call(probed_point, given, call.place))


def compiled_for(document: Document, command: str) -> CompiledScene:
    """The compiled scene of a document; InputError if it lacks what `command` computes."""
    scene = compile_document(document)
    study = COMMAND_STUDIES[command]
    if getattr(scene, study.result) is None:
        raise InputError(f"{document.path} has {study.missing_message}.")
    return scene


def study_results(document: Document, scene: CompiledScene, command: str) -> run.SceneResults:
    """The results of `command` for a document and its compiled scene."""
    begun = SettledScene(scene, PartCache().cached_evaluation(scene.document))
    first = run.make_results(scene, ("structure",), begun.evaluation)
    scene.warnings[:] = first.warnings
    _check_probes(begun)
    scene, evaluate = settle(document, begun)
    return run.make_results(scene, COMMAND_STUDIES[command].made_fields, evaluate)


def _run_study(options: Namespace) -> int:
    """Run `antiosc run`, `sweep`, `map` or `monte-carlo`; returns the exit code."""
    document = read_document(options.file)
    scene = compiled_for(document, options.command)
    page = _report_path(options)
    # --out, or a folder named after a scene that has [output]
    target = f"{Path(options.file).stem}_out" if scene.output is not None else None
    target = target if options.out is None else options.out
    folder = None if target is None else report.created_folder(target)
    computed = study_results(document, scene, options.command)
    # what structures hold is asked on every rank, and written on the first
    parts = results.presentations(computed)
    is_brief = not options.verbose and any(part.answers for part in parts)
    print_text((results.long_text if options.verbose else results.short_text)(computed, parts))
    told = len(computed.warnings) if is_brief else 0
    written = [] if folder is None else report.write_output(computed, parts, folder)
    if page is not None:
        written += report.write_page(computed, parts, page)
    for sentence in filter(message_weight, computed.warnings[told:]):
        print_text(labelled(sentence), sys.stderr)
    if written:
        print_text("wrote " + ", ".join(str(path) for path in written))
    return int(_is_stopped_early(computed))


def _is_stopped_early(computed: run.SceneResults) -> bool:
    """Whether the run, or one impact of a sweep, stopped before its end."""
    statuses = () if computed.batch is None else computed.batch.facts["status"]
    return STOPPED in (getattr(computed.history, "status", 0), *statuses)


_COMMANDS = {
    **{
        "new": _run_new,
        "open": _run_open,
        "check": _run_check,
        "tradeoff": _run_tradeoff,
        "export": _run_export,
    },
}
