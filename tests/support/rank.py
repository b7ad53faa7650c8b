"""One of the ranks of `mpi.py`: it runs one script after another until its pipe is closed."""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import runpy
import signal
import sys
import traceback
import warnings

import pictures
import readers
from antiosc.io import isolation
from antiosc.plot import charts


def run(script: str, output: str, folder: str, arguments: list[str]) -> None:
    """Run the script as `python` does, and leave nothing of it behind."""
    before, sys.argv, path = sys.argv, [script, *arguments], list(sys.path)
    os.chdir(folder)
    with (
        open(output, "w", 1) as printed,
        contextlib.redirect_stdout(printed),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("default")  # as in a process of its own: pytest makes them errors
        try:
            runpy.run_path(script, run_name="__main__")
        finally:
            sys.argv, sys.path[:] = before, path


def at_once(path: str, flags: int) -> int:
    """Open a pipe, whether or not the test's process still has its other end."""
    pipe = os.open(path, flags | os.O_NONBLOCK)
    os.set_blocking(pipe, True)
    return pipe


def main(pipes: str) -> None:
    from mpi4py import MPI

    rank = MPI.COMM_WORLD.rank
    with contextlib.suppress(ImportError):
        importlib.import_module("antiosc.fem")
    charts.render = pictures.rough
    isolation._run_reader = readers.ask
    with (
        open(f"{pipes}/ask.{rank}", opener=at_once) as asked,
        open(f"{pipes}/done", "wb", 0, opener=at_once) as done,
    ):
        for line in asked:
            script, folder, arguments, patience = json.loads(line)
            signal.alarm(patience)  # ends a rank that hangs where the test's process was killed
            try:
                run(script, f"{script}.{rank}", folder, arguments)
                gc.collect()  # by all ranks at the same place: what they share ends together
            except BaseException:
                traceback.print_exc()
                MPI.COMM_WORLD.Abort(1)  # at once: at the exit PETSc would wait for the others
            signal.alarm(0)
            done.write(b".")


if __name__ == "__main__":
    main(sys.argv[1])
