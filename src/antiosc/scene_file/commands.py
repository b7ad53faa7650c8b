"""The commands on scene files: what each prints, writes and returns."""

from __future__ import annotations

import argparse
import json
import sys
import traceback
from pathlib import Path

from antiosc.errors import AntioscError, InputError
from antiosc.progress import say
from antiosc.scene_file import (
    group_names,
    output,
    report,
    result_tables as tables,
    run as runs,
    template,
)
from antiosc.scene_file.exported import export as exported
from antiosc.scene_file.read import read
from antiosc.scene_file.scene import Compiled, compiled


def new(options: argparse.Namespace) -> int:
    """`antiosc new FILE [PART]`."""
    path, told = template.write(options.file, options.part)
    say(f"wrote {path}; next: edit it, then antiosc check {path}")
    for sentence in told:
        say(sentence)
    return 0


def check(options: argparse.Namespace) -> int:
    """`antiosc check FILE`."""
    found = compiled(read(options.file))
    told = [*(f"warning: {sentence}" for sentence in found.warnings), *group_names.check(found)]
    say(f"{options.file}: no mistakes found; for {', '.join(found.does()) or 'nothing to run'}.")
    for sentence in told:
        say(f"{options.file}: {sentence}")
    return 0


def run(options: argparse.Namespace) -> int:
    """`antiosc run FILE`."""
    scene = compiled(read(options.file))
    if scene.history is None:
        raise InputError(
            f"{options.file} has no simulation to run: give [simulate], or [run] for a scene of "
            "several contacts."
        )
    return _study(options, scene, "run")


def sweep(options: argparse.Namespace) -> int:
    """`antiosc sweep FILE`."""
    scene = compiled(read(options.file))
    if scene.batch is None:
        raise InputError(
            f"{options.file} has no [sweep]; one is, for instance, [sweep] with the line "
            "impactor.velocity = [0.5, 1.0, 2.0]."
        )
    return _study(options, scene, "sweep")


def map(options: argparse.Namespace) -> int:
    """`antiosc map FILE`."""
    scene = compiled(read(options.file))
    if scene.map is None:
        raise InputError(
            f"{options.file} has no [map]; with that line alone all of the surface is struck."
        )
    return _study(options, scene, "map")


def export(options: argparse.Namespace) -> int:
    """`antiosc export FILE OUT`."""
    from antiosc.exports.export import checked

    kind = checked(options.out)
    scene = compiled(read(options.file))
    for sentence in exported(scene, options.out, options.fmi, kind == ".mo"):
        say(f"warning: {sentence}", sys.stderr)
    say(f"wrote {options.out}")
    return 0


def _study(options: argparse.Namespace, scene: Compiled, command: str) -> int:
    """Print, forecast or compute what a command does."""
    if options.dry_run:
        from antiosc.scene_file.forecast import text

        say(text(scene))
        return 0
    page = None if options.report is None else report.checked(options.report)
    folder = _folder(options, scene)
    found = runs.results(scene, runs.COMMANDS[command])
    say(tables.text(found))
    written = [] if folder is None else output.write(found, folder)
    if page is not None:
        written += report.write(found, page)
    for sentence in found.warnings:
        say(f"warning: {sentence}", sys.stderr)
    if written:
        say("wrote " + ", ".join(str(path) for path in written))
    return 1 if getattr(found.history, "status", 0) == 2 else 0


def _folder(options: argparse.Namespace, scene: Compiled) -> Path | None:
    """Where files go: --out, or a folder named after a scene that has [output]."""
    if options.out is not None:
        return output.folder(options.out)
    if scene.output is None:
        return None
    return output.folder(f"{Path(options.file).stem}_out")


def guarded(options: argparse.Namespace) -> int:
    """Run a command; an unforeseen error of one rank ends the others too."""
    try:
        return int(options.command(options))
    except AntioscError:
        raise
    except BaseException:
        comm = runs.communicator()
        if comm is not None and comm.size > 1:
            traceback.print_exc()
            sys.stderr.flush()
            comm.Abort(1)
        raise


def schema(_options: argparse.Namespace) -> int:
    """`antiosc schema`."""
    from antiosc.scene_file.json_schema import schema as made

    say(json.dumps(made(), indent=1, ensure_ascii=False, default=str))
    return 0
