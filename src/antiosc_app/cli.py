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
COMMANDS = {
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
            with _exit_on_sigterm(), warnings_to(_WarningPrinter().tell):
                return _run(arguments)
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
    """Prints each warning that no command collects as one line, and repeats none."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def tell(self, message: str) -> None:
        """Print a warning, unless it was printed before."""
        if message not in self._told:
            self._told.add(str(message))
            print_text(labelled(message), sys.stderr)


@contextmanager
def _exit_on_sigterm() -> Iterator[None]:
    """Exit on SIGTERM as on Ctrl-C, with code 143, so that temporary files are removed."""

    def end(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_IGN)  # `timeout` sends it twice
        sys.exit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous_handler = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous_handler)


def _run(arguments: Sequence[str] | None) -> int:
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


def _argument(name: str, help: str, metavar: str | None = None, **options: Any) -> Argument:
    """The name and options of an argument, for `add_argument`."""
    given = {} if metavar is None else {"metavar": metavar}
    return name, {"help": help, **given, **options}


FILE = _argument("file", "the scene file, such as scene.toml", "FILE")
ABOUT_REPORT = "write a report: one page, one file (without a name: that of the scene, .html)"
REPORT = _argument("--report", ABOUT_REPORT, "OUT.html", nargs="?", const="")
STUDY_ARGUMENTS = [
    FILE,
    _argument("--out", "where the files of [output] go", "FOLDER"),
    REPORT,
    _argument("--verbose", "tell how it is computed, too", action="store_true"),
]
ABOUT_PIECE = "of a part in several pieces the one that is read alone, 1 the largest"
READING_ARGUMENTS = [
    _argument("--unit", "of the file, as mm, in or m", "UNIT"),
    _argument("--size", "largest cell of the mesh", "METRES", type=float),
    _argument("--piece", ABOUT_PIECE, "NUMBER", type=int),
]
ABOUT_COMPARE = "run the unreduced model too, if it takes at most so long"
#: Command -> its arguments.
ARGUMENTS: dict[str, list[Argument]] = {
    "new": [
        _argument("file", "the scene file (default: scene.toml)", "FILE", nargs="?"),
        _argument("part", "the mesh, CAD file or deck", "PART", nargs="?"),
        _argument("--drop", "a fall of PART onto a floor, not an impact", action="store_true"),
        _argument("--material", "of `antiosc materials` (default: steel S235)", "NAME"),
        *READING_ARGUMENTS,
    ],
    "open": [
        _argument("part", "the mesh, CAD file or deck", "PART"),
        _argument("--no-browser", "print the address alone", action="store_true"),
        *READING_ARGUMENTS,
        _argument("--contact", "what becomes of that of a deck", choices=("tied", "apart")),
    ],
    "check": [FILE],
    "run": STUDY_ARGUMENTS,
    "sweep": STUDY_ARGUMENTS,
    "monte-carlo": STUDY_ARGUMENTS,
    "map": STUDY_ARGUMENTS,
    "tradeoff": [
        FILE,
        _argument("--tol", "relative error of interest (default: of [strike])", type=float),
        _argument("--limit", "make no mesh that ends later", "SECONDS", type=float),
        _argument("--chart", "draw error against seconds", "OUT.png"),
        _argument("--compare", ABOUT_COMPARE, "SECONDS", type=float),
        REPORT,
    ],
    "export": [
        FILE,
        _argument("out", "the file to write, .fmu or .c", "OUT"),
        _argument("--fmi", "version of an FMU", type=int, choices=(2, 3), default=2),
    ],
    "mcp": [
        _argument("folder", "files are read and written below it alone", "FOLDER"),
        _argument("--seconds", "longest call", "SECONDS", type=float, default=600.0),
        _argument("--gigabytes", "largest memory of a call", "GB", type=float, default=8.0),
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
    parser.add_argument("--version", action="version", version=f"antiosc {info.version()}")
    commands = parser.add_subparsers(title="commands", metavar="command")

    for name, about in COMMANDS.items():
        command = commands.add_parser(name, help=about, description=f"{about.capitalize()}.")
        command.set_defaults(run=_mcp if name == "mcp" else _on_scene_file, command=name)
        for argument, options in ARGUMENTS[name]:
            command.add_argument(argument, **options)

    materials_parser = commands.add_parser("materials", help="list the materials that have a name")
    about_name = "only those with this in it"
    materials_parser.add_argument("name", metavar="NAME", nargs="?", help=about_name)
    materials_parser.set_defaults(run=_materials)
    of_info = "versions, how to get what is missing; exit code 1 if meshes do not work"
    commands.add_parser("info", help=of_info).set_defaults(run=_info)
    return parser


def _on_scene_file(options: argparse.Namespace) -> int:
    """Run a command of `antiosc_app.commands`; returns the exit code."""
    from antiosc_app.commands import guarded

    return guarded(options)


def _mcp(options: argparse.Namespace) -> int:
    """Run `antiosc mcp` until the assistant closes the streams; returns the exit code."""
    from antiosc_app.agents import serve

    serve(options.folder, options.seconds, options.gigabytes)
    return 0


def _materials(options: argparse.Namespace) -> int:
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


def _info(_options: argparse.Namespace) -> int:
    """Run `antiosc info`; returns the exit code, 1 if meshes do not work."""
    print(info.report())
    return 0 if info.meshes_work() else 1
