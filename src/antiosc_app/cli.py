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
from antiosc.base.progress import print_text, with_time
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
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand and return the exit code; antiosc's own errors become one line."""
    try:
        try:
            with _terminable(), warnings_to(_Warned().tell), with_time():
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


class _Warned:
    """Prints warnings that no command collects, each once, as one line."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def tell(self, message: str) -> None:
        """Print a warning, unless it was printed before."""
        if message not in self._told:
            self._told.add(str(message))
            print_text(labelled(message), sys.stderr)


@contextmanager
def _terminable() -> Iterator[None]:
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
        _print_error(error)
        return 1


def _print_error(error: AntioscError) -> None:
    """Print an error on the first rank; errors of a scene file begin with the file's name."""
    from antiosc_app.scene_file.document import SceneFileError

    is_of_scene = isinstance(error, SceneFileError)
    print_text(str(error) if is_of_scene else f"antiosc: {error}", sys.stderr)


#: The scene file of a command, and the options of commands as arguments of `add_argument`.
FILE = ("file", {"metavar": "FILE", "help": "the scene file, such as scene.toml"})
REPORT = (
    "--report",
    {
        "metavar": "OUT.html",
        "nargs": "?",
        "const": "",
        "help": "write a report: one page, one file (without a name: that of the scene, .html)",
    },
)
OUT = ("--out", {"metavar": "FOLDER", "help": "where the files of [output] go"})
VERBOSE = ("--verbose", {"action": "store_true", "help": "tell how it is computed, too"})
READING: list[tuple[str, dict[str, Any]]] = [
    ("--unit", {"metavar": "UNIT", "help": "of the file, as mm, in or m"}),
    ("--size", {"type": float, "metavar": "METRES", "help": "largest cell of the mesh"}),
    (
        "--piece",
        {
            "type": int,
            "metavar": "NUMBER",
            "help": "of a part in several pieces the one that is read alone, 1 the largest",
        },
    ),
]
STUDY = [FILE, OUT, REPORT, VERBOSE]
#: Command -> its arguments.
ARGUMENTS: dict[str, list[tuple[str, dict[str, Any]]]] = {
    "new": [
        ("file", {"metavar": "FILE", "nargs": "?", "help": "the scene file (default: scene.toml)"}),
        ("part", {"metavar": "PART", "nargs": "?", "help": "the mesh, CAD file or deck"}),
        ("--drop", {"action": "store_true", "help": "a fall of PART onto a floor, not an impact"}),
        ("--material", {"metavar": "NAME", "help": "of `antiosc materials` (default: steel S235)"}),
        *READING,
    ],
    "open": [
        ("part", {"metavar": "PART", "help": "the mesh, CAD file or deck"}),
        ("--no-browser", {"action": "store_true", "help": "print the address alone"}),
        *READING,
        ("--contact", {"choices": ("tied", "apart"), "help": "what becomes of that of a deck"}),
        ("--timeout", {"type": float, "metavar": "SECONDS", "help": "limit of reading the file"}),
    ],
    "check": [FILE],
    "run": STUDY,
    "sweep": STUDY,
    "monte-carlo": STUDY,
    "map": STUDY,
    "tradeoff": [
        FILE,
        (
            "--tol",
            {"type": float, "help": "relative error of interest (default: of [strike])"},
        ),
        ("--limit", {"type": float, "metavar": "SECONDS", "help": "make no mesh that ends later"}),
        ("--chart", {"metavar": "OUT.png", "help": "draw error against seconds"}),
        (
            "--compare",
            {
                "type": float,
                "metavar": "SECONDS",
                "help": "run the unreduced model too, if it takes at most so long",
            },
        ),
        REPORT,
    ],
    "export": [
        FILE,
        ("out", {"metavar": "OUT", "help": "the file to write, .fmu or .c"}),
        ("--fmi", {"type": int, "choices": (2, 3), "default": 2, "help": "version of an FMU"}),
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
        command.set_defaults(run=_on_scene_file, command=name)
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
    """Run a command on a scene file."""
    from antiosc_app.commands import guarded

    return guarded(options)


def _materials(options: argparse.Namespace) -> int:
    """Print the named materials."""
    from antiosc.base import materials

    part_of_name = (options.name or "").lower()
    matches = [name for name in materials.names() if part_of_name in name.lower()]
    if not matches:
        materials.record(options.name)
    for name in matches:
        record = materials.record(name)
        print_text(f"{name:<38} {record.line}")
        if part_of_name:
            typical = (
                f"typical, no source could be read: {record.typical}" if record.typical else ""
            )
            print_text(
                "\n".join(f"    {text}" for text in (record.source, typical, record.note) if text)
            )
    if not part_of_name:
        print_text("sources: antiosc materials NAME")
    return 0


def _info(_options: argparse.Namespace) -> int:
    """Print versions, and packages that are missing."""
    print(info.report())
    return 0 if info.meshes_work() else 1
