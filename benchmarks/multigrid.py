"""Conjugate gradients with multigrid against the Cholesky factor: time, memory, error of Z.

    python benchmarks/multigrid.py [--cells 7 12] [--write]

A clamped block of quadratic tetrahedra, N anti-oscillators by both solvers. `--cells` is the number
of cells over the least side. Each solver runs in a process of its own, on one thread; times are
those of the processor.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

TABLE = Path(__file__).parent / "speed" / "multigrid.md"
HEAD = """# The iterative solver against the factor

A clamped block of quadratic tetrahedra, 20 anti-oscillators, one thread, seconds of the
processor; made by `benchmarks/multigrid.py`. Error of Z: up to the fifth antiresonance, over
|Z| + k0.

"""
SIDES = (3, 2, 1)
#: anti-oscillators, and the antiresonances up to which Z is compared
N, COMPARED = 20, 5
TITLES = (
    "dofs", "solver", "set-up s", "a solve s", "extraction s", "bytes an entry of K", "error of Z",
)  # fmt: skip


def one(cells: int, solver: str) -> dict[str, object]:
    """What one solver takes, and its model."""
    import dolfinx.mesh
    from mpi4py import MPI

    import antiosc as ao
    from antiosc.fem.linalg.solver_choice import stored

    counts = [cells * side for side in SIDES]
    corners = [(0.0, 0.0, 0.0), tuple(0.1 * side for side in SIDES)]
    cell = dolfinx.mesh.CellType.tetrahedron
    mesh = ao.Mesh(dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, counts, cell))
    clamp = ao.Support(lambda x: np.isclose(x[0], 0))
    part = ao.Structure(mesh, ao.Solid(70e9, 0.3, 2700.0), [clamp], solver=solver)
    # algebraic multigrid on quadratic solids too; two levels are measured by large_parts.py
    part.matrices.coarser = lambda: None
    before, started = _resident(), time.process_time()
    inverse = part.factorize()
    made, after = time.process_time(), _resident()
    load = np.zeros(part.K.getSize()[0])
    load[-1] = 1.0
    inverse.solve(load)
    solved = time.process_time()
    del inverse
    model = ao.extract(part, ao.Site((0.3, 0.1, 0.05), (-1, 0, 0), radius=0.02), n=N)
    ended = time.process_time()
    return {
        "dofs": part.dofs,
        "times": [made - started, solved - made, ended - solved],
        "bytes": (after - before) / stored(part.K),
        "model": [model.k0, model.m0, model.m.tolist(), model.omega.tolist()],
    }


def _resident() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def _measured(cells: int, solver: str) -> dict[str, object]:
    command = [sys.executable, __file__, "--one", str(cells), solver]
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    text = subprocess.run(command, check=True, capture_output=True, text=True, env=alone).stdout
    return dict(json.loads(text.splitlines()[-1]))


def _error(found: object, exact: object) -> float:
    """Largest difference of Z up to the fifth antiresonance, over the size of its terms."""
    k0, *_, omega = (np.asarray(value) for value in exact)
    at = np.linspace(0.01, 1.02, 997) * omega[COMPARED - 1]
    return float(np.max(abs(_z(found, at) - _z(exact, at)) / (abs(_z(exact, at)) + k0)))


def _z(model: object, at: np.ndarray) -> np.ndarray:
    k0, m0, m, omega = (np.asarray(value) for value in model)
    x, poles = at[:, None] ** 2, omega**2
    return np.asarray(k0 - at**2 * m0 - (m * x * poles / (poles - x)).sum(axis=1))


def _table(rows: list[list[str]]) -> str:
    lines = [list(TITLES), ["---:"] * len(TITLES), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs="+", default=[4, 7, 12])
    parser.add_argument("--write", action="store_true", help=f"write {TABLE.name}")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(one(int(given.one[0]), given.one[1])))
        return
    rows = []
    for cells in given.cells:
        direct, iterative = (_measured(cells, solver) for solver in ("direct", "iterative"))
        for name, found in (("Cholesky", direct), ("multigrid", iterative)):
            error = "–" if found is direct else f"{_error(found['model'], direct['model']):.0e}"
            times = [f"{seconds:.2f}" for seconds in found["times"]]
            rows.append([str(found["dofs"]), name, *times, f"{found['bytes']:.0f}", error])
        print(_table(rows[-2:]), flush=True)
    if given.write:
        TABLE.write_text(HEAD + _table(rows) + "\n")


if __name__ == "__main__":
    main()
