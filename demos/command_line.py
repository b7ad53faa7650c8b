"""What the demos share: arguments of command lines, errors in one line, the axis of a beam."""

from __future__ import annotations

import argparse
import inspect
import re
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import antiosc as ao
from antiosc.base import checks


def positive(text: str) -> float:
    """A number > 0."""
    return _checked(lambda: checks.positive("it", float(text)), text, "a number > 0")


def count(text: str) -> int:
    """A whole number from 1 to a million."""
    return _checked(lambda: checks.whole("it", int(text), most=10**6), text, "a whole number >= 1")


def seed(text: str) -> int:
    """A whole number from 0."""
    return _checked(lambda: checks.whole("it", int(text), least=0), text, "a whole number >= 0")


def listed(kind: Callable[[str], Any]) -> Callable[[str], tuple[Any, ...]]:
    """A comma-separated list of a kind."""

    def several(text: str) -> tuple[Any, ...]:
        return tuple(kind(part) for part in text.split(","))

    return several


def line(start: Sequence[float], end: Sequence[float], count: int) -> ao.Mesh:
    """A straight line in space of `count` elements, as the axis of a beam."""
    points = "".join(
        f"Point({k}) = {{{x}, {y}, {z}}};\n" for k, (x, y, z) in enumerate((start, end), 1)
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "line.geo"
        path.write_text(points + 'Line(1) = {1, 2};\nPhysical Curve("line") = {1};\n')
        size = float(np.linalg.norm(np.subtract(end, start))) / count
        return ao.read_mesh(path, size=size, gdim=3)


def command(main: Callable[..., Any], arguments: Sequence[str] | None = None) -> Any:
    """Run `main` with the arguments of the command line, which are its parameters.

    Their types are those of the defaults, their help the section "Parameters" of its docstring.
    """
    told = inspect.getdoc(main) or ""
    parser = argparse.ArgumentParser(description=told.split("\n\n")[0])
    for name, parameter in inspect.signature(main).parameters.items():
        default = parameter.default
        line = re.search(rf"^(?:.*, )?{name}(?:, .*)? : (.*)$", told, re.MULTILINE)
        parser.add_argument(
            f"--{name}",
            type=_reader(default),
            default=default,
            help=f"{line[1] if line else ''} (default: %(default)s)",
        )
    return run(parser, main, arguments)


def _reader(default: Any) -> Callable[[str], Any]:
    """What reads a text of the kind of a default."""
    if isinstance(default, tuple):
        return listed(_reader(default[0]))
    return {float: positive, int: count}.get(type(default), Path)


def run(parser: argparse.ArgumentParser, main: Callable[..., Any], arguments: Any = None) -> Any:
    """`main` with the arguments by name; what antiosc refuses ends the program with one line."""
    options = parser.parse_args(arguments)
    try:
        return main(**vars(options))
    except ao.AntioscError as error:
        parser.exit(1, f"{parser.prog}: {error}\n")


def _checked(convert: Callable[[], Any], text: str, kind: str) -> Any:
    try:
        return convert()
    except ValueError:  # InputError too
        raise argparse.ArgumentTypeError(f"must be {kind}; got {text!r}") from None
