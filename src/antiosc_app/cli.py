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
        if name == "new":
            about_file = "the scene file (default: scene.toml, or that of PART)"
            command.add_argument("file", metavar="FILE", nargs="?", help=about_file)
        elif name == "open":
            command.add_argument("part", metavar="PART", help="the mesh, CAD file or deck")
            command.add_argument(
                "--no-browser", action="store_true", help="print the address and open no browser"
            )
        else:
            command.add_argument("file", metavar="FILE", help="the scene file, such as scene.toml")
        if name == "new":
            command.add_argument(
                "part", metavar="PART", nargs="?", help="the mesh, CAD file or deck that is struck"
            )
            command.add_argument(
                "--drop", action="store_true", help="a fall of PART onto a floor, not an impact"
            )
            by_name = "a name of `antiosc materials` (default: steel S235)"
            command.add_argument("--material", metavar="NAME", help=by_name)
        if name in ("new", "open"):
            about_unit = "of the file, as mm, in or m (default: what its size and materials tell)"
            command.add_argument("--unit", metavar="UNIT", help=about_unit)
            about_size = (
                "largest cell of the mesh; the cells of a finished mesh are halved until none is"
                " longer (default: a geometry's by its size, else as in the file)"
            )
            command.add_argument("--size", type=float, metavar="METRES", help=about_size)
            about_piece = (
                "of a part in several pieces the one that is read alone, 1 the largest (default:"
                " all if they can be joined, else the largest)"
            )
            command.add_argument("--piece", type=int, metavar="NUMBER", help=about_piece)
            about_contact = (
                "of a deck: its contact pairs are tied where they are closed at first, or apart"
                " (default: tied)"
            )
            command.add_argument("--contact", choices=("tied", "apart"), help=about_contact)
            about_time = "limit of reading and meshing the file (default: by its kind and size)"
            command.add_argument("--timeout", type=float, metavar="SECONDS", help=about_time)
        if name == "export":
            ends = "the file to write; its ending decides what: .fmu or .c"
            command.add_argument("out", metavar="OUT", help=ends)
            command.add_argument(
                "--fmi", type=int, choices=(2, 3), default=2, help="version of an FMU's standard"
            )
        if name == "tradeoff":
            tol_help = "relative error of interest (default: tol of [strike], or 0.02)"
            command.add_argument("--tol", type=float, metavar="TOL", help=tol_help)
            limit_help = "make no further mesh that is expected to end later than this"
            command.add_argument("--limit", type=float, metavar="SECONDS", help=limit_help)
            command.add_argument("--chart", metavar="OUT.png", help="draw error against seconds")
            other_commands = (
                "run the unreduced model and CalculiX too, if each takes at most so many seconds"
            )
            command.add_argument("--compare", type=float, metavar="SECONDS", help=other_commands)
            _report(command, "one HTML page of the impact, with the table and the chart")
        if name in ("run", "sweep", "monte-carlo", "map"):
            _results(command)
    materials_parser = commands.add_parser("materials", help="list the materials that have a name")
    materials_parser.add_argument(
        "name", metavar="NAME", nargs="?", help="only those with this in it"
    )
    materials_parser.set_defaults(run=_materials)
    of_info = (
        "versions, BLAS, solvers, how to get what is missing; exit code 1 if meshes do not work"
    )
    commands.add_parser("info", help=of_info).set_defaults(run=_info)
    return parser


def _results(command: argparse.ArgumentParser) -> None:
    """Add the options of commands that produce results."""
    command.add_argument("--out", metavar="FOLDER", help="where the files of [output] go")
    _report(command, "write a report: one page, one file")


def _report(command: argparse.ArgumentParser, about: str) -> None:
    """Add --report; without a name the page has that of the scene file."""
    about = f"{about} (without a name: that of the scene, .html)"
    command.add_argument("--report", metavar="OUT.html", nargs="?", const="", help=about)


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
