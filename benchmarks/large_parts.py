"""Solvers of large solids: a factor and two levels.

    benchmarks/large_parts.py            writes speed/large_parts.md
    benchmarks/large_parts.py CASE KIND  one line of the table

Twenty anti-oscillators of a block of quadratic elements that is held at one end, each case and
solver in a process of its own, one thread: CPU seconds of the solver's set-up and of `extract`
after it, CPU seconds of one solve, the peak of the memory, and the largest relative difference of
Z(ω) from that of the factor, at 25 frequencies up to the fifth antiresonance, with a hundredth of
each as its imaginary part, which keeps off the poles.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

import antiosc as ao
from antiosc.base._types import SolverChoice
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.iterative import Levels
from antiosc.fem.linalg.solver import Solver

OUT = Path(__file__).parent / "speed" / "large_parts.md"
COMPACT, PLATE = (0.2, 0.1, 0.08), (0.2, 0.2, 0.005)
#: name -> (cells, size [m], cell, nu, whether a factor is tried)
CASES = {
    "44 k": ((20, 10, 8), COMPACT, "tetrahedron", 0.3, True),
    "125 k": ((28, 15, 12), COMPACT, "tetrahedron", 0.3, True),
    "340 k": ((40, 21, 16), COMPACT, "tetrahedron", 0.3, True),
    "1.0 M": ((60, 30, 23), COMPACT, "tetrahedron", 0.3, False),
    "2.2 M": ((76, 40, 30), COMPACT, "tetrahedron", 0.3, False),
    "9.3 M": ((122, 64, 49), COMPACT, "tetrahedron", 0.3, False),
    "hexahedra 56 k": ((22, 12, 10), COMPACT, "hexahedron", 0.3, True),
    "nu 0.45": ((20, 10, 8), COMPACT, "tetrahedron", 0.45, True),
    "nu 0.49": ((20, 10, 8), COMPACT, "tetrahedron", 0.49, True),
    "nu 0.499": ((20, 10, 8), COMPACT, "tetrahedron", 0.499, True),
    "plate, t = h": ((40, 40, 1), PLATE, "tetrahedron", 0.3, True),
    "plate, t = h/4": ((40, 40, 1), (0.2, 0.2, 0.00125), "tetrahedron", 0.3, True),
}
#: What the table says of the machine of its figures.
NOTE = "The machine had other work: ratios tell more than seconds."
#: kinds of solver -> the choice of a structure
KINDS: dict[str, SolverChoice] = {"direct": "direct", "two levels": "iterative", "auto": "auto"}


def part_of(case: str) -> ao.Structure:
    """The block of a case."""
    cells, size, cell, nu, _ = CASES[case]
    kind = getattr(dolfinx.mesh.CellType, cell)
    corners = [np.zeros(3), np.array(size)]
    mesh = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, list(cells), cell_type=kind)
    held = ao.Support(lambda x: np.isclose(x[0], 0.0))
    return ao.Structure(ao.read_mesh(mesh), ao.Solid(210e9, nu, 7800.0), [held])


def make(part: ao.Structure, kind: str) -> Solver:
    """The solver of a kind, which `extract` then uses."""
    levels = Levels(lambda: part.matrices.rigid_motions, part.matrices.coarser)
    solver = solver_choice.solver_for(part.K, KINDS[kind], levels)
    part._factored, part.seconds["factorization"] = (solver, 0.0), solver.seconds
    return solver


def measured(case: str, kind: str) -> dict[str, object]:
    """The line of one case and solver; `Z` to compare."""
    part = part_of(case)
    before = time.process_time()
    solver = make(part, kind)
    made = time.process_time()
    _, size, *_ = CASES[case]
    site = ao.Site((0.9 * size[0], 0.3 * size[1], size[2]), (0.1, 0, -1), radius=0.1 * size[0])
    model = ao.extract(part, site, n=20, shapes=False)
    done = time.process_time()
    solver.solve(np.random.default_rng(0).standard_normal(part.rows))
    solved = time.process_time()
    fifth = float(f"{model.omega[4]:.3g}")  # the same for every solver
    Z = model.dynamic_stiffness(np.linspace(0.04, 1.0, 25) * fifth * (1 - 0.01j))
    return {
        "dofs": part.dofs,
        "solver": type(solver).__name__,
        "set-up": made - before,
        "extract": done - made,
        "solve": solved - done,
        "GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "Z": [np.real(Z).tolist(), np.imag(Z).tolist()],
    }


def run(case: str, kind: str) -> dict[str, object]:
    """The line of a process of its own; {} with its last words where it failed."""
    command = [sys.executable, __file__, case, kind]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return {"failed": done.stderr.strip().splitlines()[-1][:90]}
    return dict(json.loads(done.stdout.splitlines()[-1]))


def main() -> None:
    """Write the table, after every line."""
    head = "| case | dofs | solver | set-up s | extract s | solve s | peak GB | error of Z |"
    about = __doc__.split("\n\n")[2].strip().replace("\n", " ")
    lines = ["# Solvers of large solids", "", f"{about} {NOTE}", "", head, "|" + "---|" * 8]
    for case, (*_, factored) in CASES.items():
        exact: np.ndarray | None = None
        for kind in KINDS if factored else ("two levels",):
            line = run(case, kind)
            if "failed" in line:
                lines.append(f"| {case} | | {kind} | {line['failed']} | | | | |")
            else:
                Z = np.array([1, 1j]) @ np.array(line["Z"])
                exact = Z if kind == "direct" else exact
                error = "" if exact is None else f"{np.max(np.abs(Z / exact - 1)):.0e}"
                numbers = " | ".join(f"{line[k]:.3g}" for k in ("set-up", "extract", "solve", "GB"))
                name = f"{kind} ({line['solver']})"
                lines.append(f"| {case} | {line['dofs']} | {name} | {numbers} | {error} |")
            OUT.write_text("\n".join(lines) + "\n")
            print(lines[-1], flush=True)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print(json.dumps(measured(*sys.argv[1:])))
    else:
        main()
