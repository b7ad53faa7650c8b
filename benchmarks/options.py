"""What the measurements share: command lines, tasks in new processes, the state of the code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parent.parent / "demos"))

import compared
from command_line import command, count, line, listed, positive, run, seed

__all__ = [
    "apart",
    "code_state",
    "command",
    "compared",
    "count",
    "line",
    "listed",
    "positive",
    "run",
    "seed",
]


def apart(script: str, *task: Any, ranks: int = 1) -> Any:
    """What `script --task` prints as its last line, in JSON: a measurement in a new process.

    Its peak memory is its own. It runs on one thread, or on several MPI ranks with one thread each.
    """
    command = [sys.executable, script, "--task", json.dumps(task)]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    environment = {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
        "OMP_NUM_THREADS": "1",
        **os.environ,
    }
    print(*task, *([f"{ranks} ranks"] if ranks > 1 else []), flush=True)
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr or run.stdout)
    return json.loads(run.stdout.strip().splitlines()[-1])


def code_state() -> str:
    """The commit with which a page of figures is made, as a sentence; "" outside a repository."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(Path(__file__).parent), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        # programs alone: the pages and pictures of this run change too
        changed = git("status", "--porcelain", "--", ":/src", "*.py")
        commit = git("show", "-s", "--format=%h of %as")
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"Made with commit {commit}{', changed since' if changed else ''}."
