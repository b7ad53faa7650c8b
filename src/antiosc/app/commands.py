"""The commands on scene files: what each prints, writes and returns."""

from __future__ import annotations

import json
import sys
import traceback
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import antiosc
from antiosc.app import new, report, results
from antiosc.app.scene_file import outline, run
from antiosc.app.scene_file.build import Call, Evaluation
from antiosc.app.scene_file.document import read
from antiosc.app.scene_file.scene import STUDIES, Compiled, compiled
from antiosc.app.scene_file.schema import schema
from antiosc.base import checks
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.progress import say


def guarded(options: Namespace) -> int:
    """Run a command; an unforeseen error of one rank ends the others too."""
    try:
        return _study(options) if options.command in STUDIES else _OTHERS[options.command](options)
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
    file, part = options.file, options.part
    if part is None and file is not None and Path(file).suffix.lower() != ".toml":
        file, part = f"{checks.new_file('the part', file).stem}.toml", file  # the part alone
    path, told = new.write_scene(file or "scene.toml", part, options.drop)
    say(f"wrote {path}; next: look at it, then antiosc run {path} --report report.html")
    for sentence in told:
        say(sentence)
    return 0


def _check(options: Namespace) -> int:
    found = compiled(read(options.file))
    told = [*(f"warning: {sentence}" for sentence in found.warnings), *outline.check(found)]
    say(f"{options.file}: no mistakes found; for {', '.join(found.does()) or 'nothing to run'}.")
    for sentence in told:
        say(f"{options.file}: {sentence}")
    return 0


def _export(options: Namespace) -> int:
    """Write the impact or the scene of a file, or its model alone, for another program."""
    from antiosc.app.export import checked

    alone = checked(options.out) == ".mo"
    scene = compiled(read(options.file))
    source = scene.scene or scene.model
    asked = {} if scene.history is None else scene.history.arguments
    if scene.striking:
        source = Call(lambda history: history.model, {"history": scene.history})
    if source is None:
        raise InputError(
            f"{options.file} has nothing to export: give a model ([extract] or [model]) or"
            " a scene of several contacts."
        )
    given = {"path": options.out, "source": source, "fmi": options.fmi}
    if not alone:
        if scene.impactor is not None:
            given |= {"impactor": scene.impactor, "contact": scene.contact}
        shared = ("initial_velocity", "gravity", "gap") if scene.scene is None else ()
        given |= {name: asked[name] for name in ("duration", *shared) if name in asked}
    with run.telling(scene.warnings):
        Evaluation(scene.document)(Call(antiosc.export, given))
    for sentence in scene.warnings:
        say(f"warning: {sentence}", sys.stderr)
    say(f"wrote {options.out}")
    return 0


def _schema(_options: Namespace) -> int:
    say(json.dumps(schema(), indent=1, ensure_ascii=False, default=str))
    return 0


def _study(options: Namespace) -> int:
    """Forecast, or compute, print and write what `antiosc run`, `sweep` or `map` does."""
    scene = compiled(read(options.file))
    study = STUDIES[options.command]
    if getattr(scene, study.result) is None:
        raise InputError(f"{options.file} has {study.lacking}.")
    if getattr(options, "store", None) is not None:
        scene = _stored(scene, options.store)
    if options.dry_run:
        from antiosc.app.forecast import text

        say(text(scene))
        return 0
    page = None if options.report is None else report.checked(options.report)
    # --out, or a folder named after a scene that has [output]
    target = f"{Path(options.file).stem}_out" if scene.output is not None else None
    target = target if options.out is None else options.out
    folder = None if target is None else report.folder(target)
    found = run.results(scene, study.makes)
    say(results.text(found))
    written = [] if folder is None else report.write_output(found, folder)
    if page is not None:
        written += report.write_page(found, page)
    for sentence in found.warnings:
        say(f"warning: {sentence}", sys.stderr)
    if written:
        say("wrote " + ", ".join(str(path) for path in written))
    return 1 if getattr(found.history, "status", 0) == 2 else 0


def _stored(scene: Compiled, path: str) -> Compiled:
    """The scene with the runs of [monte_carlo] stored; a campaign that broke off goes on."""
    comm = run.communicator()
    if comm is not None and comm.size > 1:
        raise InputError(
            f"--store is for one process, not {comm.size} ranks: leave it out, or run without MPI."
        )
    assert scene.sample is not None
    arguments = {**scene.sample.arguments, "store": checks.new_file("--store", path)}
    return replace(scene, sample=replace(scene.sample, arguments=arguments))


_OTHERS = {"new": _new, "check": _check, "export": _export, "schema": _schema}
