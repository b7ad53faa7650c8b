"""Time and memory of one model over dofs and MPI ranks.

    benchmarks/scaling.py                 writes speed/scaling.md
    mpirun -n 2 benchmarks/scaling.py NX NY NZ    one line of it, as JSON

A block of quadratic tetrahedra, made by dolfinx on all ranks and held at one end; twenty
anti-oscillators by two levels, one thread a rank. Seconds are those of the clock for structure,
solver and model together, after a small model, beside the seconds of the processors of all ranks;
the memory is the sum of the peaks of all ranks, and net it has the pages of programs and libraries
that the ranks share once.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao

OUT = Path(__file__).parent / "speed" / "scaling.md"
SIZE = (0.2, 0.1, 0.08)
#: name -> (cubes of six cells along the sides, numbers of ranks)
CASES = {
    "0.13 M": ((28, 15, 12), (1, 2)),
    "0.19 M": ((33, 17, 13), (1, 2)),
    "0.34 M": ((40, 21, 16), (1, 2)),
    "1.0 M": ((60, 30, 23), (1, 2)),
    "2.2 M": ((76, 40, 30), (1,)),
}


def measured(cells: list[int]) -> dict[str, float]:
    """The line of one block on these ranks."""
    comm = MPI.COMM_WORLD
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model_of(block((4, 2, 2)))  # imports are no part of the times
    mesh = block(cells)
    comm.barrier()
    clock, own = time.perf_counter(), time.process_time()
    part, model, solver = model_of(mesh)
    ended = time.perf_counter() - clock
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    common = pages_of_files() if comm.rank else 0.0
    return {
        "dofs": part.dofs,
        "set-up": solver - clock,
        "clock": ended,
        "processor": comm.allreduce(time.process_time() - own),
        "GB": comm.allreduce(peak),
        "net": comm.allreduce(peak - common),
        "k0": model.k0,
        "omega": float(model.omega[0]),
    }


def block(cells: Sequence[int]) -> ao.Mesh:
    """The mesh of a block with so many cubes of six cells along its sides."""
    corners = [np.zeros(3), np.array(SIZE)]
    kind = dolfinx.mesh.CellType.tetrahedron
    return ao.read_mesh(dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, cells, cell_type=kind))


def model_of(mesh: ao.Mesh) -> tuple[ao.Structure, ao.AntiOscillators, float]:
    """(structure, model, clock at the end of the set-up of the solver)."""
    held = ao.Support(lambda x: np.isclose(x[0], 0.0))
    part = ao.Structure(mesh, ao.Solid(210e9, 0.3, 7800.0), [held], solver="iterative")
    part.factorize()
    solver = time.perf_counter()
    site = ao.Site((0.9 * SIZE[0], 0.3 * SIZE[1], SIZE[2]), (0, 0, -1), radius=0.1 * SIZE[0])
    return part, ao.extract(part, site, n=20, shapes=False), solver


def pages_of_files() -> float:
    """Memory of programs and libraries that other processes have mapped too, GB."""
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    (kilobytes,) = (line.split()[1] for line in lines if line.startswith("Shared_Clean:"))
    return float(kilobytes) / 1e6


def run(cells: tuple[int, ...], ranks: int) -> dict[str, float]:
    """The line of a run of its own."""
    command = ["mpirun", "--allow-run-as-root", "--bind-to", "core", "-n", f"{ranks}"]
    command += [sys.executable, __file__, *map(str, cells)]
    # without the variables of MPI that this process has set in C, which stop a further mpirun
    environment = dict(os.environ)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def main() -> None:
    """Write the table, after every line."""
    about = " ".join(__doc__.split("\n\n")[2].split())
    head = "| dofs | ranks | solver s | all s | processors s | GB | net | speed-up |"
    lines = ["# Dofs and ranks", "", about, "", head, "|" + "---|" * 8]
    for cells, counts in CASES.values():
        alone = 0.0
        for ranks in counts:
            line = run(cells, ranks)
            alone = line["clock"] if ranks == 1 else alone
            numbers = " | ".join(
                f"{line[k]:.3g}" for k in ("set-up", "clock", "processor", "GB", "net")
            )
            ratio = alone / line["clock"]
            lines.append(f"| {line['dofs']:.0f} | {ranks} | {numbers} | {ratio:.2f} |")
            OUT.write_text("\n".join(lines) + "\n")
            print(lines[-1], flush=True)


if __name__ == "__main__":
    given = [int(one) for one in sys.argv[1:]]
    if given:
        found = measured(given)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(found))
    else:
        main()
