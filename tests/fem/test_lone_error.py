"""An error of one rank that nobody catches ends all ranks, which would wait for it for ever."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from mpi import ENVIRONMENT

pytestmark = [pytest.mark.fem, pytest.mark.slow]
PART = """
    import warnings
    import antiosc as ao
    from mpi4py import MPI
    rank = MPI.COMM_WORLD.rank
    mesh = ao.box_mesh((0.1, 0.05, 0.02), size=0.03)
    part = ao.Structure(mesh, ao.Solid(70e9, 0.33, 2700.0), [ao.Support("-x")])
"""
#: Calls with an error on rank 1, and a word of it.
CALLS = {
    "by itself": ("rank and 1 / 0", "ZeroDivisionError"),
    "a material": ("ao.Solid(float('nan') if rank else 70e9, 0.33, 2700.0)", "InputError"),
    "a warning": (
        "warnings.simplefilter('error'); rank and warnings.warn('told')", "UserWarning: told"
    ),
}  # fmt: skip


@pytest.mark.parametrize("call", CALLS)
def test_an_error_of_one_rank_ends_all(call: str, tmp_path: Path) -> None:
    line, word = CALLS[call]
    script = tmp_path / "script.py"
    after = "part = ao.extract(part, ao.Site((0.1, 0.02, 0.02), (0, 0, -1)), n=3)"
    script.write_text(f"{textwrap.dedent(PART)}{line}\n{after}\n")
    done = subprocess.run(
        ["mpirun", "-n", "2", sys.executable, str(script)],
        env={**ENVIRONMENT, **os.environ},
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert done.returncode != 0
    assert word in done.stderr.decode()
