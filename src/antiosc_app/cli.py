"""The command `antiosc`."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from antiosc.base.errors import AntioscError, labelled, warnings_to
from antiosc.base.progress import print_text
from antiosc_app import info

#: Command -> its description.
COMMAND_TEXTS = {
    "new": "look at a part and write a scene that runs: antiosc new PART, or new FILE PART",
    "open": "click a part in the browser and strike it: antiosc open PART",
    "check": "look for mistakes in a scene file, without meshing",
    "run": "simulate the impact of a scene file",
    "sweep": "simulate the impact for each value of the section [sweep]",
    "monte-carlo": "simulate the impact for random values, of the section [monte_carlo]",
    "map": "simulate the impact at every point of the section [map]",
    "tradeoff": "error against seconds and memory of the impact of a scene file",
    "export": "write the impact of a scene file for another program: FMU or C",
    "mcp": "answer the calls of an assistant (Model Context Protocol): antiosc mcp FOLDER",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (default: sys.argv) and return the exit code.

    Errors of antiosc are printed as one line.
    """
    try:
        try:
            with _exit_on_sigterm(), warnings_to(_WarningPrinter().print_once):
                return _run_command(arguments)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()  # what is left for the end of Python would raise there
    except BrokenPipeError:  # the reader of the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print("antiosc: interrupted", file=sys.stderr)
        return 130


class _WarningPrinter:
    """Prints each warning that no command collects once, as one line."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def print_once(self, message: str) -> None:
        """Print a warning, unless it was printed before."""
        if message not in self._told:
            self._told.add(str(message))
            print_text(labelled(message), sys.stderr)


@contextmanager
def _exit_on_sigterm() -> Iterator[None]:
    """Exit on SIGTERM as on Ctrl-C, with code 143, so that temporary files are removed."""

    def exit_143(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_IGN)  # `timeout` sends it twice
        sys.exit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous_handler = signal.signal(signal.SIGTERM, exit_143)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous_handler)


def _run_command(arguments: Sequence[str] | None) -> int:
    """Run the command that the arguments name; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if not hasattr(options, "run"):
        parser.print_help()
        return 0
    try:
        return int(options.run(options))
    except AntioscError as error:
        from antiosc_app.scene_file.document import SceneFileError

        is_of_scene = isinstance(error, SceneFileError)  # it begins with the file's name
        print_text(str(error) if is_of_scene else f"antiosc: {error}", sys.stderr)
        return 1


#: A name of `add_argument`, and its options.
Argument = tuple[str, dict[str, Any]]


def _argument_of(name: str, help: str, metavar: str | None = None, **options: Any) -> Argument:
    """The name and options of an argument, for `add_argument`."""
    given = {} if metavar is None else {"metavar": metavar}
    return name, {"help": help, **given, **options}


FILE_ARGUMENT = _argument_of("file", "the scene file, such as scene.toml", "FILE")
REPORT_TEXT = "write a report: one page, one file (without a name: that of the scene, .html)"
REPORT_ARGUMENT = _argument_of("--report", REPORT_TEXT, "OUT.html", nargs="?", const="")
STUDY_ARGUMENTS = [
    FILE_ARGUMENT,
    _argument_of("--out", "where the files of [output] go", "FOLDER"),
    REPORT_ARGUMENT,
    _argument_of("--verbose", "tell how it is computed, too", action="store_true"),
]
PIECE_TEXT = "of a part in several pieces the one that is read alone, 1 the largest"
READING_ARGUMENTS = [
    _argument_of("--unit", "of the file, as mm, in or m", "UNIT"),
    _argument_of("--size", "largest cell of the mesh", "METRES", type=float),
    _argument_of("--piece", PIECE_TEXT, "NUMBER", type=int),
]
COMPARE_TEXT = "run the unreduced model too, if it takes at most so long"
#: Command -> its arguments.
COMMAND_ARGUMENTS: dict[str, list[Argument]] = {
    "new": [
        _argument_of("file", "the scene file (default: scene.toml)", "FILE", nargs="?"),
        _argument_of("part", "the mesh, CAD file or deck", "PART", nargs="?"),
        _argument_of("--drop", "a fall of PART onto a floor, not an impact", action="store_true"),
        _argument_of("--material", "of `antiosc materials` (default: steel S235)", "NAME"),
        *READING_ARGUMENTS,
    ],
    "open": [
        _argument_of("part", "the mesh, CAD file or deck", "PART"),
        _argument_of("--no-browser", "print the address alone", action="store_true"),
        *READING_ARGUMENTS,
        _argument_of("--contact", "what becomes of that of a deck", choices=("tied", "apart")),
    ],
    "check": [FILE_ARGUMENT],
    "run": STUDY_ARGUMENTS,
    "sweep": STUDY_ARGUMENTS,
    "monte-carlo": STUDY_ARGUMENTS,
    "map": STUDY_ARGUMENTS,
    "tradeoff": [
        FILE_ARGUMENT,
        _argument_of("--tol", "relative error of interest (default: of [strike])", type=float),
        _argument_of("--limit", "make no mesh that ends later", "SECONDS", type=float),
        _argument_of("--chart", "draw error against seconds", "OUT.png"),
        _argument_of("--compare", COMPARE_TEXT, "SECONDS", type=float),
        REPORT_ARGUMENT,
    ],
    "export": [
        FILE_ARGUMENT,
        _argument_of("out", "the file to write, .fmu or .c", "OUT"),
        _argument_of("--fmi", "version of an FMU", type=int, choices=(2, 3), default=2),
    ],
    "mcp": [
        _argument_of("folder", "files are read and written below it alone", "FOLDER"),
        _argument_of("--seconds", "longest call", "SECONDS", type=float, default=600.0),
        _argument_of("--gigabytes", "largest memory of a call", "GB", type=float, default=8.0),
    ],
}


def _parser() -> argparse.ArgumentParser:
    """The parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="antiosc",
        description="Impacts on structures by anti-oscillators, from scene files in TOML.",
        epilog="To begin: antiosc open part.step, in the browser; or antiosc new part.step, which"
        " writes a scene file (docs/scene_files.md).",
    )
    parser.add_argument("--version", action="version", version=f"antiosc {info.antiosc_version()}")
    commands = parser.add_subparsers(title="commands", metavar="command")

    for name, about in COMMAND_TEXTS.items():
        command = commands.add_parser(name, help=about, description=f"{about.capitalize()}.")
        command.set_defaults(run=_run_mcp if name == "mcp" else _run_scene_command, command=name)
        for argument, options in COMMAND_ARGUMENTS[name]:
            command.add_argument(argument, **options)

    materials_parser = commands.add_parser("materials", help="list the materials that have a name")
    about_name = "only those with this in it"
    materials_parser.add_argument("name", metavar="NAME", nargs="?", help=about_name)
    materials_parser.set_defaults(run=_run_materials)
    of_info = "versions, how to get what is missing; exit code 1 if meshes do not work"
    commands.add_parser("info", help=of_info).set_defaults(run=_run_info)
    return parser


def _run_scene_command(options: argparse.Namespace) -> int:
    """Run a command of `antiosc_app.commands`; returns the exit code."""
    from antiosc_app.commands import run_guarded

    return run_guarded(options)


def _run_mcp(options: argparse.Namespace) -> int:
    """Run `antiosc mcp` until the assistant closes the streams; returns the exit code."""
    from antiosc_app.agents import serve

    serve(options.folder, options.seconds, options.gigabytes)
    return 0


def _run_materials(options: argparse.Namespace) -> int:
    """Run `antiosc materials`; returns the exit code."""
    from antiosc.base import materials

    part_of_name = (options.name or "").lower()
    matches = [name for name in materials.names() if part_of_name in name.lower()]
    if not matches:
        materials.record(options.name)
    for name in matches:
        record = materials.record(name)
        print_text(f"{name:<38} {record.line}")
        typical = record.typical and f"typical, no source could be read: {record.typical}"
        for text in filter(None, (record.source, typical, record.note) if part_of_name else ()):
            print_text(f"    {text}")
    if not part_of_name:
        print_text("sources: antiosc materials NAME")
    return 0


def _run_info(_options: argparse.Namespace) -> int:
    """Run `antiosc info`; returns the exit code, 1 if meshes do not work."""
    print(info.info_text())
    return 0 if info.meshing_works() else 1
