"""The commands on scene files: their output, the files that they write, and their exit codes."""

from __future__ import annotations

import json
import sys
import time
import traceback
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import antiosc
from antiosc import impact_band
from antiosc.base import checks
from antiosc.base.errors import AntioscError, InputError, labelled, weight
from antiosc.base.plausible import GRAVITY
from antiosc.base.process import free_memory
from antiosc.base.progress import print_text
from antiosc.base.texts import STOPPED, engineering, plain
from antiosc.extension import BAND_OVER_PULSE, DEFAULT_TOL, FIRST_STEPS, check_point
from antiosc.models.auto_contact import AUTO
from antiosc_app import new, presentation, report, results
from antiosc_app.inspection import Forecast, forecast_of_parts
from antiosc_app.scene_file import outline, run
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import Document, Table, read
from antiosc_app.scene_file.scene import STUDIES, CompiledScene, place_of
from antiosc_app.scene_file.schema import schema
from antiosc_app.scene_file.settled import Settled, settled
from antiosc_app.until_parted import counts_from
from antiosc_studies.drops.body import MODES

if TYPE_CHECKING:
    from antiosc import Structure
    from antiosc.extension import MapForecast, Tradeoff, TradeoffMember


#: Seconds from which the time of a run is told before it.
LONG_RUN = 60.0


def guarded(options: Namespace) -> int:
    """Run a command; on an unforeseen error one rank ends the others too."""
    try:
        if options.command in STUDIES:
            return _study(options)
        return _OTHERS[options.command](options)
    except AntioscError:
        raise
    except BaseException:
        comm = run.communicator()
        if comm is not None and comm.size > 1:
            traceback.print_exc()
            sys.stderr.flush()
            comm.Abort(1)
        raise


def _new(options: Namespace) -> int:
    """Run `antiosc new`; returns the exit code."""
    file = options.file
    part = options.part
    if part is None and file is not None and Path(file).suffix.lower() != ".toml":
        file, part = f"{checks.new_file('the part', file).stem}.toml", file  # the part alone
    path, sentences = new.write_scene(
        file or "scene.toml",
        part,
        options.drop,
        options.material,
        options.unit,
        options.timeout,
        options.size,
        options.piece,
        options.contact,
    )
    for sentence in sentences:
        print_text(sentence)
    print_text(f"wrote {path}; next: look at it, then antiosc run {path} --report report.html")
    return 0


def _open(options: Namespace) -> int:
    """Run `antiosc open`; returns the exit code."""
    from antiosc_app import view

    view.until_interrupted(
        options.part,
        options.unit,
        options.timeout,
        options.size,
        options.piece,
        options.contact,
        browser=not options.no_browser,
    )
    return 0


def _check(options: Namespace) -> int:
    """Run `antiosc check`; returns the exit code."""
    scene = compiled(read(options.file))
    sentences = [*map(labelled, scene.warnings), *outline.check(scene)]
    print_text(
        f"{options.file}: no mistakes found; for {', '.join(scene.does()) or 'nothing to run'}."
    )
    for sentence in sentences:
        print_text(f"{options.file}: {sentence}")
    return 0


def _export(options: Namespace) -> int:
    """`antiosc export`: write an impact, a scene or a model alone for another program."""
    from antiosc_app.export import ending_of

    model_alone = ending_of(options.out) == ".mo"
    scene, evaluate = settled(read(options.file))
    source = scene.scene or scene.model
    options_of_run = {} if scene.history is None else scene.history.arguments
    if scene.striking:
        source = Call(lambda history: history.model, {"history": scene.history})
    if source is None:
        raise InputError(
            f"{options.file} has nothing to export: give a model ([extract] or [model]) or"
            " a scene of several contacts."
        )
    arguments = {"path": options.out, "source": source, "fmi": options.fmi}
    if not model_alone:
        if scene.impactor is not None:
            arguments |= {"impactor": scene.impactor, "contact": scene.contact}
        shared = ("initial_velocity", "gravity", "gap") if scene.scene is None else ()
        arguments |= {
            name: options_of_run[name] for name in ("duration", *shared) if name in options_of_run
        }
    with run.collected_warnings(scene.warnings):
        evaluate(Call(antiosc.export, arguments))
    for sentence in scene.warnings:
        print_text(labelled(sentence), sys.stderr)
    print_text(f"wrote {options.out}")
    return 0


#: Tolerance of a trade-off if neither the command nor [strike] gives one.
USUAL_TOL = 0.02
#: What its bars are of.
WORST = (
    "force, all: bars without the error of the contact law; all, to finest: the largest of those of"
    " peak force, impulse and contact time."
)
#: What is said of a trade-off that is ended before its end.
ENDED = (
    "Ended after {} methods, which are not compared with a finest one: none is the cheapest yet."
)
#: Sections that have no place beside [strike]; keys that it shares with [simulate].
NOT_STRUCK = {"extract", "simulate", "sweep", "map", "monte_carlo", "probes", "stress"}
OF_BOTH = {"duration", "initial_velocity", "gravity", "gap"}


def _tradeoff(options: Namespace) -> int:
    """`antiosc tradeoff`: print error against seconds and memory of an impact, and draw it."""
    start = time.perf_counter()
    page = _page(options)
    scene = compiled(to_a_tolerance(settled(read(options.file)).scene.document))
    arguments = {**one_impact(scene, options.file)}
    if options.tol is not None:
        arguments["tol"] = options.tol
    if options.compare is not None:
        arguments["compare"] = options.compare
    if options.limit is not None:
        arguments["limit"] = options.limit
    from antiosc.extension import line_of  # needs dolfinx

    finished: list[TradeoffMember] = []
    chosen = time.perf_counter()

    def ready(member: TradeoffMember) -> None:
        if not finished:
            print_text(f"As they are computed:\n{line_of()}")
        finished.append(member)
        print_text(line_of(member.cells()))

    try:
        with run.collected_warnings(scene.warnings):
            call = Call(antiosc.tradeoff, arguments | {"ready": ready})
            tradeoff = Evaluation(scene.document)(call)
    except (KeyboardInterrupt, SystemExit):
        print_text(ENDED.format(len(finished)))
        raise
    compared = time.perf_counter()
    print_text(f"\n{tradeoff.summary()}\n{WORST}\n{tradeoff.message}")
    for sentence in scene.warnings:
        print_text(labelled(sentence), sys.stderr)
    if options.chart is not None:
        print_text(f"wrote {tradeoff.plot(options.chart)}")
    if page is not None:
        print_text(f"wrote {report.write_report_of(scene, tradeoff, page)}")
    print_text(_took(tradeoff, (start, chosen, compared, time.perf_counter())))
    return 0


def _took(tradeoff: Tradeoff, times: Sequence[float]) -> str:
    """What a trade-off took; `times` [s]: of its start, of that and the end of its methods, and of
    its end.
    """
    before, methods, written = (plain(end - start, 3) for start, end in pairwise(times))
    whole = plain(times[-1] - times[0], 3)
    members = sum(member.seconds for member in (*tradeoff.table, *tradeoff.others))
    return (
        f"In all {whole} s: {before} s to read the part and to choose what the scene leaves open"
        f" (patch, duration), {methods} s for the methods, {written} s for picture and report."
        f" The lines of the methods add to {plain(members, 3)} s, each with the factorization of"
        f" its mesh and without the {plain(tradeoff.compilation)} s in which finite elements were"
        " compiled or loaded, and without making the meshes."
    )


def to_a_tolerance(document: Document) -> Document:
    """A scene with [strike] in place of [extract] and [simulate] where its mesh may be refined."""
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
    common = {name: value for name, value in simulated.items() if name in OF_BOTH}
    sections = {name: value for name, value in data.items() if name not in NOT_STRUCK}
    return replace(document, data={**sections, "strike": {"tol": USUAL_TOL, **common}})


def one_impact(scene: CompiledScene, path: str) -> Table:
    """The arguments of `tradeoff`, from [strike] or from a meshed part and [simulate]."""
    if scene.striking and scene.history is not None:
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
    return {"source": scene.structure, "site": site, "tol": USUAL_TOL, **common}


def _schema(_options: Namespace) -> int:
    """Run `antiosc schema`; returns the exit code."""
    print_text(json.dumps(schema(), indent=1, ensure_ascii=False, default=str))
    return 0


def _page(options: Namespace) -> Path | None:
    """The path of the report that is asked for; without a name, the scene's with .html."""
    if options.report is None:
        return None
    return report.checked(options.report or str(Path(options.file).with_suffix(".html")))


def _check_probes(begun: Settled) -> None:
    """InputError for a probe off the structure, which else would end a run after its impact."""
    scene, evaluate = begun
    for call in scene.probes.values():
        if call is None or scene.structure is None:
            continue
        given = {"structure": scene.structure, **place_of(call)}
        evaluate(Call(check_point, given, call.place))


def _study(options: Namespace) -> int:
    """`antiosc run`, `sweep`, `map`, …: compute, print and write, or with --dry-run forecast."""
    document = read(options.file)
    if options.command == "monte-carlo":
        document = run.prepared_for_draws(document)
    scene = compiled(document)
    study = STUDIES[options.command]
    if getattr(scene, study.result) is None:
        raise InputError(f"{options.file} has {study.lacking}.")
    if options.dry_run:
        print_text(_forecast(document, scene))
        return 0
    page = _page(options)
    # --out, or a folder named after a scene that has [output]
    target = f"{Path(options.file).stem}_out" if scene.output is not None else None
    target = target if options.out is None else options.out
    folder = None if target is None else report.folder(target)
    begun = Settled(scene, Evaluation(scene.document))
    first = run.results(scene, ("structure",), begun.evaluate)
    if options.command == "monte-carlo":
        run.refuse_draws(document, first.structure)
    scene.warnings[:] = first.warnings
    _check_probes(begun)
    if told := _told_before(options.command, document, scene, first.structure):
        print_text(f"antiosc: {told}.", sys.stderr)
    scene, evaluate = settled(document, begun)
    if getattr(options, "store", None) is not None:
        scene = _stored(scene, options.store)
    computed = run.results(scene, study.makes, evaluate)
    # what structures hold is asked on every rank, and written on the first
    parts = results.presentations(computed)
    print_text(results.text(computed, parts))
    written = [] if folder is None else report.write_output(computed, parts, folder)
    if page is not None:
        written += report.write_page(computed, parts, page)
    for sentence in filter(weight, computed.warnings):
        print_text(labelled(sentence), sys.stderr)
    if written:
        print_text("wrote " + ", ".join(str(path) for path in written))
    return int(_stopped_early(computed))


def _stopped_early(computed: run.SceneResults) -> bool:
    """Whether the run, or one impact of a sweep, stopped before its end."""
    statuses = () if computed.batch is None else computed.batch.status
    return STOPPED in (getattr(computed.history, "status", 0), *statuses)


def _stored(scene: CompiledScene, path: str) -> CompiledScene:
    """The scene with a file for the runs of [monte_carlo]; an interrupted campaign continues."""
    comm = run.communicator()
    if comm is not None and comm.size > 1:
        raise InputError(
            f"--store is for one process, not {comm.size} ranks: leave it out, or run without MPI."
        )
    assert scene.sample is not None
    arguments = {**scene.sample.arguments, "store": checks.new_file("--store", path)}
    return replace(scene, sample=replace(scene.sample, arguments=arguments))


# -- `--dry-run`: the size and cost of a scene, without a factorization


def _forecast(document: Document, scene: CompiledScene) -> str:
    """Text of family, dofs, n, step and cost; the structure is built but not factored."""
    built = run.results(scene, ("structure", "impactor", "contact"))
    run.refuse_draws(document, built.structure)
    rows: list[tuple[str, str]] = []
    if built.structure is not None:
        dofs = f"{built.structure.dofs}"
        rows += [*results.advice_of(built), ("dofs", dofs), ("factor", _factor(built.structure))]
    foreseen = _of_run(document, scene, built.structure)
    rows += [] if foreseen is None else [("time", foreseen.text())]
    of_map = _of_map(scene, built.structure)
    rows += [] if of_map is None else [("map", of_map.text())]
    rows += [
        (f"box of {outline_of_part.name}", outline_of_part.text())
        for outline_of_part in outline.outlines(scene)
    ]
    rows += _model_rows(scene, built)
    if scene.fall is not None:
        rows += _fall_rows(scene.fall.arguments)
    if built.impactor is not None and built.contact is not None:
        rows += _impact_rows(scene, built)
    rows += [("warning", sentence) for sentence in built.warnings]
    return presentation.format_rows(rows)


def _told_before(
    command: str, document: Document, scene: CompiledScene, structure: Structure | None
) -> str:
    """What is told of the cost of a run or a map that takes long; else ""."""
    if command == "run":
        of_run = _of_run(document, scene, structure)
        return f"the part has {of_run.text()}" if of_run and of_run.answer > LONG_RUN else ""
    of_map = _of_map(scene, structure) if command == "map" else None
    return f"the map has {of_map.text()}" if of_map and of_map.ends[-1] > LONG_RUN else ""


#: Arguments of a map that its forecast has too.
OF_MAP = ("where", "direction", "radius", "most_sites", "modes")


def _of_map(scene: CompiledScene, structure: Structure | None) -> MapForecast | None:
    """Forecast of the map of a scene; None without one."""
    if scene.map is None or structure is None:
        return None
    from antiosc.extension import foreseen_map

    return foreseen_map(structure, *(scene.map.arguments.get(name) for name in OF_MAP))


def _of_run(
    document: Document, scene: CompiledScene, structure: Structure | None
) -> Forecast | None:
    """Forecast of the models of a scene and of the whole run; None where no part has a mesh."""
    if scene.model is None or structure is None:
        return None
    n = _count(scene, structure)
    is_auto = document.data.get("extract", {}).get("n") == AUTO
    return forecast_of_parts(structure, counts_from(n, structure.dofs) if is_auto else [n])


def _count(scene: CompiledScene, structure: Structure) -> int:
    """The number of anti-oscillators of a scene; the usual one where a band gives it."""
    from antiosc.extension import DEFAULT_COUNT

    section = scene.document.data.get("extract", {})
    return int(section.get("n", min(DEFAULT_COUNT, structure.dofs - 1)))


def _factor(structure: Structure) -> str:
    """Forecast of the Cholesky factor as text, and of the iterative solver that may replace it."""
    from antiosc.extension import missing

    if missing is not None or not hasattr(structure.K, "getSizes"):
        return "by SciPy; not forecast"
    from antiosc.extension import foreseen

    forecast = foreseen(structure.K, structure.matrices.coarser)
    return f"{forecast}; {free_memory() / 1e9:.3g} GB are free"


def _model_rows(scene: CompiledScene, results: run.SceneResults) -> list[tuple[str, str]]:
    """Rows on the reduced model."""
    if scene.model is None or results.structure is None:
        return []
    section = scene.document.data.get("extract", {})
    sites = len(scene.document.data.get("sites", {}))
    if "band" in section:
        highest = engineering(section["band"], "Hz")
        return [("anti-oscillators", f"as many as needed up to {highest}")]
    n = _count(scene, results.structure)
    return [("anti-oscillators", f"{n} of {sites} site(s): about {n + sites} solves")]


def _fall_rows(section: Table) -> list[tuple[str, str]]:
    """Rows on a fall."""
    height = section["height"]
    gravity = section.get("gravity", GRAVITY)
    rows = [
        ("free modes", f"{section.get('modes', MODES)}: most of the cost of one fall"),
        ("first touch", f"after {engineering(sqrt(2 * height / gravity), 's')}"),
        ("speed", f"{sqrt(2 * height * gravity):.4g} m/s there, without [drop] velocity"),
    ]
    if "ensemble" in section:
        rows.append(("falls", f"{section.get('n', 100)}"))
    return rows


def _impact_rows(scene: CompiledScene, results: run.SceneResults) -> list[tuple[str, str]]:
    """Rows on an impact: contact time, band, step."""
    section = scene.document.data.get("simulate", {})
    from antiosc.reduce.site.surface import PlaneOf

    rows = []
    if "strike" in scene.document.data:
        tol = scene.document.data["strike"].get("tol")
        rows.append(("mesh, model, step", f"chosen while it runs, for an error of {tol:g}"))
    try:
        surface = None if results.structure is None else PlaneOf(results.structure)
        band = impact_band(results.impactor, results.contact, surface)
    except AntioscError as error:
        rows.append(("contact time", f"not forecast: {error}"))
        return rows
    time = BAND_OVER_PULSE / (2 * band)
    rows.append(("contact time", f"at least {engineering(time, 's')}, that on a rigid wall"))
    rows.append(("band of the impact", f"up to {engineering(band, 'Hz')}"))
    if "strike" not in scene.document.data:
        step = section.get("step", time / FIRST_STEPS)
        tol = section.get("tol", DEFAULT_TOL)
        step_rule = "given" if "step" in section else f"halved until tol = {tol:g} is met"
        rows.append(("step", f"{engineering(step, 's')}, {step_rule}"))
    impacts = len(next(iter(run.varied(scene).values()), [0]))
    if impacts > 1:
        rows.append(("sweep", f"{impacts} impacts"))
    return rows


_OTHERS = {
    "new": _new,
    "open": _open,
    "check": _check,
    "tradeoff": _tradeoff,
    "export": _export,
    "schema": _schema,
}
