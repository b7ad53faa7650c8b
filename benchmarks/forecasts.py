"""Forecasts of the solvers beside what was measured: iterations, seconds, bytes.

    benchmarks/forecasts.py              writes speed/forecasts.md
    benchmarks/forecasts.py CASE SOLVER  one line of it

A model of twenty anti-oscillators of a block that is struck at a point, each solver in a process
of its own, one thread. Iterations: those of the trial solve, of a random load, and the mean of the
solves of the model. Seconds: those of the processor for solver and `extract`, of which some tenths
belong to no solver. GB: the largest memory while the solver is made and solves once, less that
before it. Forecasts are those of `model.info.solver`; of two levels that were asked for, those with
the iterations of the trial.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc.base._types import SolverChoice
from antiosc.base.process import trim_heap
from antiosc.fem.linalg.forecast import LevelSizes
from antiosc.fem.linalg.multigrid import Multigrid
from antiosc.fem.linalg.petsc_algebra import by_cells
from antiosc.fem.linalg.solver_choice import Plan, PlanByLinear, sizes_of

OUT = Path(__file__).parent / "speed" / "forecasts.md"
COMPACT, PLATE = (0.2, 0.1, 0.08), (0.2, 0.2, 0.005)
#: name -> (cells, size [m])
CASES = {
    "20 k": ((15, 8, 6), COMPACT),
    "44 k": ((20, 10, 8), COMPACT),
    "100 k": ((27, 14, 10), COMPACT),
    "300 k": ((38, 20, 16), COMPACT),
    "nu 0.45": ((20, 10, 8), COMPACT),
    "nu 0.49": ((20, 10, 8), COMPACT),
    "nu 0.499": ((20, 10, 8), COMPACT),
    "plate, t = h": ((40, 40, 1), PLATE),
    "plate, t = h/2": ((40, 40, 1), (0.2, 0.2, 0.0025)),
    "plate, t = h/4": ((40, 40, 1), (0.2, 0.2, 0.00125)),
    "plate of three elements": ((30, 30, 3), (0.2, 0.2, 0.02)),
    "bar": ((150, 4, 4), (1.0, 0.03, 0.03)),
    "slivers": ((20, 10, 8), COMPACT),
    "spring 1e12": ((20, 10, 8), COMPACT),
    "free": ((20, 10, 8), COMPACT),
    "anisotropy": ((20, 10, 8), COMPACT),
    "hexahedra": ((22, 12, 10), COMPACT),
}


def part_of(case: str, solver: str) -> ao.Structure:
    """The block of a case."""
    cells, size = CASES[case]
    kind = "hexahedron" if case == "hexahedra" else "tetrahedron"
    corners = [np.zeros(3), np.array(size)]
    cell = getattr(dolfinx.mesh.CellType, kind)
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, corners, list(cells), cell_type=cell)
    if case == "slivers":
        x, rng = mesh.geometry.x, np.random.default_rng(1)
        inner = np.all((x > 1e-9) & (x < corners[1] - 1e-9), axis=1)
        x[inner] += 0.3 * (corners[1] / cells) * rng.uniform(-1, 1, (inner.sum(), 3))
    steel = ao.Solid(210e9, float(case[3:]) if case.startswith("nu") else 0.3, 7800.0)
    if case == "anisotropy":
        E, G = (140e9, 10e9, 8e9), (5e9, 5e9, 3e9)
        steel = ao.AnisotropicSolid.orthotropic(E=E, nu=(0.3, 0.3, 0.4), G=G, rho=1600.0)
    held = [] if case == "free" else [ao.Support(lambda x: np.isclose(x[0], 0.0))]
    top = (0.5 * size[0], 0.5 * size[1], size[2])
    springs = [ao.Spring(top, {"z": 1e12})] if case == "spring 1e12" else []
    return ao.Structure(ao.read_mesh(mesh), steel, held, attached=springs, solver=solver)


def memory(name: str) -> int:
    """A line of this process's memory in bytes: VmRSS, VmHWM."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line.split()[1] for line in lines if line.startswith(name)))


def levels_of(part: ao.Structure) -> LevelSizes:
    """The two levels of a part by their sizes."""
    K = part.K
    plan = PlanByLinear(K, part.matrices.coarser()) if by_cells(K) else Plan(K)
    return sizes_of(K, plan.entries)


def measured(case: str, kind: SolverChoice) -> dict[str, object]:
    """The line of one case and solver."""
    part = part_of(case, kind)
    _, size = CASES[case]
    site = ao.Site((0.9 * size[0], 0.3 * size[1], size[2]), (0.1, 0, -1))
    sizes = levels_of(part)
    trim_heap()
    Path("/proc/self/clear_refs").write_text("5")  # the largest memory begins anew
    before, began = memory("VmRSS"), time.process_time()
    solver = part.factorize()
    solver.solve(np.random.default_rng(0).standard_normal(part.rows))
    used = memory("VmHWM") - before
    made = time.process_time() - began
    cost, trial = solver.cost, 0
    if isinstance(solver, Multigrid):
        trial = solver.trial(500)
        cost = sizes.cost(trial, 1.0)
    counts: list[int] = []
    kept = Multigrid._solve_vector

    def counted(own: Multigrid, r: object, x: object) -> None:
        kept(own, r, x)
        counts.append(own._ksp.getIterationNumber())

    Multigrid._solve_vector = counted
    began = time.process_time()
    ao.extract(part, site, n=20, shapes=False)
    spent = made + time.process_time() - began
    return {
        "dofs": part.dofs,
        "trial": trial or "",
        "mean": round(float(np.mean(counts)), 1) if counts else "",
        "seconds": [round(cost.seconds or 0.0, 2), round(spent, 2)],
        "GB": [round(cost.bytes / 1e9, 3), round(used / 1e9, 3)],
    }


def run(case: str, kind: SolverChoice) -> dict[str, object]:
    """The line of a process of its own."""
    command = [sys.executable, __file__, case, kind]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def main() -> None:
    """Write the table, after every line."""
    names = "forecast s", "measured s", "forecast GB", "measured GB"
    head = " | ".join(["| case", "dofs", "solver", "trial", "mean", *names]) + " |"
    about = " ".join(__doc__.split("\n\n")[2].split())
    lines = ["# Forecasts of the solvers", "", about, "", head, "|" + "---|" * 9]
    for case in CASES:
        for kind in ("direct", "iterative"):
            line = run(case, kind)
            pairs = [f"{x}" for x in (*line["seconds"], *line["GB"])]
            told = "factor" if kind == "direct" else "two levels"
            cells = (case, line["dofs"], told, line["trial"], line["mean"], *pairs)
            lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
            OUT.write_text("\n".join(lines) + "\n")
            print(lines[-1], flush=True)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print(json.dumps(measured(*sys.argv[1:])))
    else:
        main()
