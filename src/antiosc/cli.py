"""The command `antiosc`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from antiosc import info
from antiosc.errors import AntioscError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand and return the exit code; antiosc's own errors become one line."""
    options = _parser().parse_args(arguments)
    try:
        return options.run(options)
    except AntioscError as error:
        print(f"antiosc: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="antiosc", description="Impacted structures as anti-oscillators."
    )
    parser.add_argument("--version", action="version", version=f"antiosc {info.version()}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="command")

    about = commands.add_parser(
        "info", help="versions, BLAS and solvers found here, and how to get what is missing"
    )
    about.set_defaults(run=_info)
    return parser


def _info(_options: argparse.Namespace) -> int:
    print(info.report())
    return 0
