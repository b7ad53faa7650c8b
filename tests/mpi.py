r"""Run a script on several MPI ranks from within a serial test.

    @pytest.mark.mpi
    def test_sum_over_ranks():
        script = "from mpi4py import MPI; print(MPI.COMM_WORLD.allreduce(1))"
        assert run_ranks(2, script) == ["2\n", "2\n"]

So the whole suite is one pytest run, and a rank that fails or hangs is an ordinary failed test.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # More ranks than cores, for Open MPI 4 and 5.
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    # A rank that waits leaves its core to those that work: there are more ranks than cores.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    # Containers often forbid one process to read another's memory.
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "UCX_LOG_LEVEL": "fatal",
    "HWLOC_HIDE_ERRORS": "2",
    "OMP_NUM_THREADS": "1",
}

# Ranks that share one stdout write into each other's lines: each gets a file of its own.
PRELUDE = """\
import sys; from mpi4py import MPI; sys.stdout = open(f"{__file__}.{MPI.COMM_WORLD.rank}", "w", 1)
"""


def run_ranks(n: int, script: str, *arguments: str, timeout: float = 600) -> list[str]:
    """Run the Python source `script` on `n` ranks and return what each of them prints.

    Raises AssertionError with the output of all ranks when one of them ends with an error (the
    others are then ended too) or when they are not done after `timeout` seconds.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "script.py"
        path.write_text(PRELUDE + textwrap.dedent(script))
        # "-m mpi4py" ends all ranks when one raises; without it the others would wait for ever.
        python = [sys.executable, "-m", "mpi4py", str(path), *arguments]
        process = subprocess.Popen(
            ["mpirun", "-n", str(n), *python],
            env={**ENVIRONMENT, **os.environ},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            output, errors = process.communicate(timeout=timeout)
            outcome = f"ended with code {process.returncode}"
        except subprocess.TimeoutExpired:
            output, errors = _end(process)
            outcome = f"were not done after {timeout:g} s"
        printed = [_text(Path(f"{path}.{rank}")) for rank in range(n)]
    if outcome == "ended with code 0":
        return printed
    shown = "".join(f"\n--- rank {rank}\n{text}" for rank, text in enumerate(printed))
    raise AssertionError(f"{n} ranks {outcome}{shown}\n--- mpirun\n{output}{errors}")


def _end(process: subprocess.Popen[str]) -> tuple[str, str]:
    process.terminate()  # mpirun then ends the ranks, which are not in its process group
    try:
        return process.communicate(timeout=10)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()


def _text(path: Path) -> str:
    return path.read_text() if path.exists() else ""
