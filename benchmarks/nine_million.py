"""Model and force of a block of nine million dofs on one core, with a log.

    benchmarks/nine_million.py             writes speed/nine_million.md
    benchmarks/nine_million.py NX NY NZ    another number of cubes of six cells, to the screen

A block of quadratic tetrahedra, held at one end, is struck by a steel ball; twenty
anti-oscillators, one thread. Each line: what was done, seconds since the start by the clock and of
the processor, the peak of the memory so far.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao

OUT = Path(__file__).parent / "speed" / "nine_million.md"
CELLS = (122, 64, 49)
SIZE = (0.2, 0.1, 0.08)


def main(cells: tuple[int, ...], out: Path | None) -> None:
    """Log every stage."""
    about = " ".join(__doc__.split("\n\n")[2].split())
    lines = ["# Nine million dofs", "", about, "", "| | clock s | processor s | peak GB |"]
    lines.append("|---|---|---|---|")
    started = time.perf_counter()

    def log(what: str) -> None:
        clock, own = time.perf_counter() - started, time.process_time()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        lines.append(f"| {what} | {clock:.0f} | {own:.0f} | {peak:.2f} |")
        print(lines[-1], flush=True)
        if out is not None:
            out.write_text("\n".join(lines) + "\n")

    corners = [np.zeros(3), np.array(SIZE)]
    tetrahedron = dolfinx.mesh.CellType.tetrahedron
    box = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, list(cells), cell_type=tetrahedron)
    log("dolfinx's mesh")
    mesh = ao.read_mesh(box)
    del box
    log(f"read_mesh, {mesh.n_cells} cells")
    held = ao.Support(lambda x: np.isclose(x[0], 0.0))
    part = ao.Structure(mesh, ao.Solid(210e9, 0.3, 7800.0), [held])
    log(f"structure, {part.dofs} dofs")
    part.factorize()
    log("solver")
    site = ao.Site((0.9 * SIZE[0], 0.3 * SIZE[1], SIZE[2]), (0, 0, -1), radius=0.1 * SIZE[0])
    model = ao.extract(part, site, n=20, shapes=False)
    log(f"model of {model.n} anti-oscillators ({model.info['solver']})")
    ball = ao.Sphere(radius=0.02, material="bearing steel 100Cr6", velocity=1.0)
    hit = ao.simulate(model, ball, ao.Hertz(1e10), duration=1e-3)
    log(f"force, peak {hit.peak_force:.4g} N")


if __name__ == "__main__":
    given = tuple(int(one) for one in sys.argv[1:])
    main(given or CELLS, None if given else OUT)
