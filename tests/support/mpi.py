r"""Run a script on several MPI ranks from within a serial test.

    @pytest.mark.mpi
    def test_sum_over_ranks():
        script = "from mpi4py import MPI; print(MPI.COMM_WORLD.allreduce(1))"
        assert run_ranks(2, script) == ["2\n", "2\n"]

So the whole suite is one pytest run, and a rank that fails or hangs is an ordinary failed test.
The ranks stay for the next script, with the packages that they have imported.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path
from typing import Any

import rank
from paths import SUPPORT

ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # More ranks than cores, for Open MPI 4 and 5.
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    # A rank that waits leaves its core to those that work: there are more ranks than cores.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    # A rank bound to a core would wait there for a test that runs on it, beside a free core.
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    # Containers often forbid one process to read another's memory.
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "UCX_LOG_LEVEL": "fatal",
    "HWLOC_HIDE_ERRORS": "2",
    "OMP_NUM_THREADS": "1",
}
#: What most scripts import.
START = """
import json, sys, warnings
import dolfinx
import numpy as np
from mpi4py import MPI
import antiosc as ao
import parts
from antiosc.fem.platform import compat
"""
#: Seconds over its time for which a rank whose test's process was killed may hang.
SPARE = 30


def run_ranks(n: int, script: str, *arguments: str, timeout: float = 300) -> list[str]:
    """Run the Python source `script` on `n` ranks and return what each of them prints.

    It can import the modules of this folder, and must leave these and all others as they were:
    later scripts find them. Raises AssertionError with the output of all ranks when one of them
    ends with an error (the others are then ended too) or when they are not done after `timeout`
    seconds. One rank is this process, whose errors are raised as they are.
    """
    if n == 1:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "script.py")
            path.write_text(textwrap.dedent(script))
            rank.run(str(path), f"{path}.0", os.getcwd(), [*arguments])
            return [_text(Path(f"{path}.0"))]
    ranks = _ranks.pop(n, None)
    if ranks and (ranks.environment != _environment() or ranks.process.poll() is not None):
        ranks.end()
        ranks = None
    ranks = ranks or Ranks(n)
    try:
        printed = ranks.run(textwrap.dedent(script), arguments, timeout)
    except BaseException:
        ranks.end(patience=0.1)
        raise
    _ranks[n] = ranks
    return printed


def one_and_several(script: str, *arguments: str, ranks: int = 2) -> tuple[Any, Any]:
    """What one rank prints, as JSON, and what several do, each of them the same."""
    (one,), several = (run_ranks(n, script, *arguments) for n in (1, ranks))
    assert several == several[:1] * ranks
    return json.loads(one), json.loads(several[0])


def _environment() -> dict[str, str]:
    return {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}


class Ranks:
    """`n` processes of one MPI world, each of which waits at a pipe for a script."""

    def __init__(self, n: int) -> None:
        self.environment = _environment()
        self.folder = Path(tempfile.mkdtemp(prefix="ranks-"))
        names = [*(f"ask.{k}" for k in range(n)), "done"]
        for name in names:
            os.mkfifo(self.folder / name)
        # both ways, so that opening waits for no rank
        self.pipes = [os.open(self.folder / name, os.O_RDWR) for name in names]
        *self.asks, self.done = self.pipes
        path = os.pathsep.join([str(SUPPORT), os.environ.get("PYTHONPATH", "")])
        python = [sys.executable, str(SUPPORT / "rank.py"), str(self.folder)]
        with open(self.folder / "errors", "w") as errors:
            self.process = subprocess.Popen(
                ["mpirun", "-n", str(n), *python],
                env={**ENVIRONMENT, **os.environ, "PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                stdout=errors,
                stderr=errors,
                start_new_session=True,
            )

    def run(self, script: str, arguments: tuple[str, ...], timeout: float) -> list[str]:
        """What each rank prints."""
        path = Path(tempfile.mkdtemp(dir=self.folder)) / "script.py"
        path.write_text(script)
        line = json.dumps([str(path), os.getcwd(), arguments, int(timeout) + SPARE]) + "\n"
        for ask in self.asks:
            os.write(ask, line.encode())
        wrong = self._wait(timeout)
        printed = [_text(Path(f"{path}.{k}")) for k in range(len(self.asks))]
        if not wrong:
            return printed
        shown = "".join(f"\n--- rank {k}\n{text}" for k, text in enumerate(printed))
        errors = _text(self.folder / "errors")
        raise AssertionError(f"{len(printed)} ranks {wrong}{shown}\n--- mpirun\n{errors}")

    def _wait(self, timeout: float) -> str:
        """What went wrong until all ranks were done."""
        left, deadline = len(self.asks), time.monotonic() + timeout
        while left:
            if self.process.poll() is not None:
                return f"ended with code {self.process.returncode}"
            if time.monotonic() > deadline:
                return f"were not done after {timeout:g} s"
            if select.select([self.done], [], [], 0.1)[0]:
                left -= len(os.read(self.done, left))
        return ""

    def close(self) -> None:
        """Close the pipes, with which the ranks end."""
        while self.pipes:
            os.close(self.pipes.pop())

    def end(self, patience: float = 5) -> None:
        """The ranks end as their pipes do; those that hang are killed."""
        self.close()
        try:
            self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.terminate()  # mpirun then ends the ranks, which are not in its group
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(10)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


_ranks: dict[int, Ranks] = {}


@atexit.register
def _end() -> None:
    while _ranks:
        _ranks.popitem()[1].end()


def _text(path: Path) -> str:
    return path.read_text() if path.exists() else ""
