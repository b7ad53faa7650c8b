"""What falls of a steel block cost: one of ten impacts, and an ensemble of them in two processes.

The free modes are computed once. Seconds are those of the processors, of all processes together:
half of them pass on two quiet cores.

    .venv/bin/python benchmarks/tumbles.py --help
"""

from __future__ import annotations

import resource
import time
from concurrent.futures import ProcessPoolExecutor

import dolfinx
import numpy as np
from mpi4py import MPI
from options import command

import antiosc as ao

SIZE = (0.15, 0.10, 0.05)
STEEL, CONCRETE = ao.Solid(210e9, 0.3, 7800.0), ao.Solid(30e9, 0.2, 2400.0)


def main(size: float = 5.8e-3, modes: int = 60, falls: int = 200) -> dict[str, float]:
    """Let the block fall; return the seconds.

    Parameters
    ----------
    size : of the elements, m
    modes : free modes
    falls : of the ensemble
    """
    cells = [round(length / size) for length in SIZE]
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, [np.zeros(3), np.array(SIZE)], cells)
    part = ao.Structure(ao.read_mesh(mesh), STEEL)
    print(part.describe())
    floor = ao.Floor(CONCRETE, friction=0.3)
    begun = spent()
    body = ao.drop(part, 1.0, (10, 5, 0), floor, until=1, modes=modes).body
    seconds = {"modes and first impact": spent() - begun}
    for tol in (1e-3, 1e-2):
        begun = spent()
        fall = ao.drop(body, 1.0, (10, 5, 0), floor, until=10, tol=tol)
        seconds[f"ten impacts, tol = {tol:g}"] = spent() - begun
    assert len(fall.impacts) == 10
    begun = spent()
    with ProcessPoolExecutor(2) as pool:
        many = ao.drop(
            body, 1.0, (10, 5, 0), floor, until=10, tol=1e-2,
            ensemble=ao.Tilts(sigma=2.0), n=falls, executor=pool,
        )  # fmt: skip
    seconds["one fall of the ensemble"] = (spent() - begun) / falls
    print(many.quantile("peak_force", 0.99))
    for name, value in seconds.items():
        print(f"{name:28} {value:8.3f} s")
    print(
        f"5000 falls on two cores: {seconds['one fall of the ensemble'] * 5000 / 120:.1f} minutes"
    )
    return seconds


def spent() -> float:
    """Processor seconds of this process and of those that it waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


if __name__ == "__main__":
    command(main)
