"""Solvers of large solids: a factor and two levels.

    benchmarks/large_parts.py            writes speed/large_parts.md
    benchmarks/large_parts.py CASE KIND  one line of the table

Twenty anti-oscillators of a block of quadratic elements that is held at one end, each case and
solver in a process of its own, one thread: CPU seconds of the solver's set-up and of `extract`
after it, CPU seconds of one solve, the peak of the memory, and the largest relative difference of
Z(ω) from that of the factor, at 25 frequencies up to the fifth antiresonance, with a hundredth of
each as its imaginary part, which keeps off the poles.

The bracket, curved unless it says straight, beside dolfinx alone: the space, K and M by its own
assembly and quadrature, one factor by MUMPS. "Over" is assembly, set-up and extraction over that.
Forms are compiled and modules loaded before, by a coarse bracket.

Two levels on one rank and on two, seconds by the clock. "Efficiency" is the time a dof of the one
rank in the line above it over that of the ranks together: of the same part, or of a larger one. The
peak of the memory is that of the largest rank.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

import antiosc as ao
from antiosc.base._types import SolverChoice
from antiosc.fem.linalg import solver_choice
from antiosc.fem.linalg.iterative import Levels
from antiosc.fem.linalg.solver import Solver

Line = dict[str, Any]
Parts = tuple[ao.Mesh, ao.Solid, ao.Support, ao.Site]

OUT = Path(__file__).parent / "speed" / "large_parts.md"
GEOMETRY = Path(__file__).parents[1] / "meshes" / "bracket.geo"
COMPACT, PLATE = (0.2, 0.1, 0.08), (0.2, 0.2, 0.005)
#: name -> (cells, size [m], cell, nu, whether a factor is tried)
CASES = {
    "44 k": ((20, 10, 8), COMPACT, "tetrahedron", 0.3, True),
    "125 k": ((28, 15, 12), COMPACT, "tetrahedron", 0.3, True),
    "340 k": ((40, 21, 16), COMPACT, "tetrahedron", 0.3, True),
    "680 k": ((50, 26, 20), COMPACT, "tetrahedron", 0.3, False),
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
#: name -> (largest cell [m], order of the geometry, whether a factor is tried) of the bracket
BRACKETS = {
    "bracket 34 k": (6.5e-3, 2, True),
    "bracket 109 k": (3.05e-3, 2, True),
    "bracket 281 k": (2.11e-3, 2, True),
    "bracket 281 k, straight": (2.11e-3, 1, True),
    "bracket 1.6 M, straight": (1.11e-3, 1, False),
}
#: Size of the cells of the bracket that compiles the forms and loads the modules [m].
COARSE = 1e-2
#: What the table says of the machine of its figures.
NOTE = (
    "Lines of a case were measured one after another; between cases the speed of the machine "
    "changes: ratios tell more than seconds. OpenBLAS took Haswell's kernels."
)
PEER = "dolfinx + MUMPS"
#: cases on one rank, and after it on two: the same part, or one with as many dofs on each
RANKS = ("bracket 281 k", 1), ("bracket 281 k", 2), ("340 k", 1), ("340 k", 2), ("680 k", 2)
#: kinds of solver -> the choice of a structure
KINDS: dict[str, SolverChoice] = {"direct": "direct", "two levels": "iterative", "auto": "auto"}


def block_of(case: str) -> Parts:
    """The block of a case: mesh, material, support, site."""
    cells, size, cell, nu, _ = CASES[case]
    kind = getattr(dolfinx.mesh.CellType, cell)
    corners = [np.zeros(3), np.array(size)]
    mesh = dolfinx.mesh.create_box(MPI.COMM_WORLD, corners, list(cells), cell_type=kind)
    held = ao.Support(lambda x: np.isclose(x[0], 0.0))
    site = ao.Site((0.9 * size[0], 0.3 * size[1], size[2]), (0.1, 0, -1), radius=0.1 * size[0])
    return ao.read_mesh(mesh), ao.Solid(210e9, nu, 7800.0), held, site


def bracket_of(case: str) -> Parts:
    """The bracket of a case: mesh, material, support, site."""
    return bracket(*BRACKETS[case][:2])


def bracket(size: float, order: int) -> Parts:
    """The bracket in cells of a size [m] and of an order: mesh, material, support, site."""
    mesh = ao.read_mesh(GEOMETRY, size=size, order=order)
    angle = np.radians(35)
    eye = np.array([0.0193, 0.03 + 0.018 * np.sin(angle), 0.06 + 0.018 * np.cos(angle)])
    direction = -0.25, -np.sin(angle), -np.cos(angle)
    site = ao.Site(tuple(eye), direction, radius=4.5e-3, snap=True)
    return mesh, ao.Solid(70e9, 0.33, 2700.0), ao.Support("clamp"), site


def make(part: ao.Structure, kind: str) -> Solver:
    """The solver of a kind, which `extract` then uses."""
    levels = Levels(lambda: part.matrices.rigid_motions, part.matrices.prolongation)
    solver = solver_choice.solver_for(part.K, KINDS[kind], levels)
    part._factored, part.seconds["factorization"] = (solver, 0.0), solver.seconds
    return solver


def dolfinx_alone(mesh: ao.Mesh, material: ao.Solid, clock: Callable[[], float]) -> Line:
    """The line of plain dolfinx and MUMPS."""
    start = clock()
    V = fem.VectorFunctionSpace(mesh.dolfinx, ("Lagrange", 2))
    held = fem.locate_dofs_topological(V, 2, mesh.groups["clamp"][2])
    clamp = fem.dirichletbc(np.zeros(3), held, V)

    before = clock()
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    mu = material.E / 2 / (1 + material.nu)
    lam = 2 * mu * material.nu / (1 - 2 * material.nu)
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * mu * strain + lam * ufl.tr(strain) * ufl.Identity(3)
    stiffness = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx)
    mass = fem.form(material.rho * ufl.inner(u, v) * ufl.dx)
    forms = clock() - before

    K = fem.petsc.assemble_matrix(stiffness, [clamp])
    M = fem.petsc.assemble_matrix(mass, [clamp], 0.0)
    K.assemble(), M.assemble()
    assembled = clock()

    ksp = PETSc.KSP().create(mesh.comm)
    ksp.setOperators(K)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.getPC().setType(PETSc.PC.Type.CHOLESKY)
    ksp.getPC().setFactorSolverType("mumps")
    ksp.setUp()
    made = clock()

    x, b = K.createVecs()
    b.set(1.0)
    ksp.solve(b, x)
    solved = clock()
    return {
        "dofs": 3 * V.dofmap.index_map.size_global,
        "solver": "MUMPS",
        "assembly": assembled - start - forms,
        "set-up": made - assembled,
        "extract": 0.0,
        "whole": made - start - forms,
        "solve": solved - made,
        "Z": [[], []],
    }


def with_solver(part_of: Parts, kind: str, clock: Callable[[], float]) -> Line:
    """The line of a kind of solver; `Z` to compare."""
    mesh, material, held, site = part_of
    start = clock()
    part = ao.Structure(mesh, material, [held])
    before = clock()
    solver = make(part, kind)
    made = clock()

    model = ao.extract(part, site, n=20, shapes=False)
    done = clock()
    solver.solve(np.random.default_rng(0).standard_normal(part.rows))
    solved = clock()

    fifth = float(f"{model.omega[4]:.3g}")  # the same for every solver
    Z = model.dynamic_stiffness(np.linspace(0.04, 1.0, 25) * fifth * (1 - 0.01j))
    return {
        "dofs": part.dofs,
        "solver": type(solver).__name__,
        "assembly": before - start,
        "set-up": made - before,
        "extract": done - made,
        "whole": done - start,
        "solve": solved - done,
        "Z": [np.real(Z).tolist(), np.imag(Z).tolist()],
    }


def measured(case: str, kind: str, clock: Callable[[], float] = time.process_time) -> Line:
    """The line of one case and solver."""

    def line(part_of: Parts) -> Line:
        if kind == PEER:
            return dolfinx_alone(part_of[0], part_of[1], clock)
        return with_solver(part_of, kind, clock)

    if case in BRACKETS:
        line(bracket(COARSE, BRACKETS[case][1]))
    part_of = (bracket_of if case in BRACKETS else block_of)(case)
    found = line(part_of)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return {**found, "GB": part_of[0].comm.allreduce(peak, MPI.MAX)}


def run(case: str, kind: str, ranks: int = 0) -> dict[str, Any]:
    """The line of a process of its own, or of ranks by the clock; its last words if it failed."""
    command = [sys.executable, __file__, case, kind]
    if ranks:
        command = ["mpirun", "-n", str(ranks), *command, "clock"]
    environment = dict(os.environ)  # without what MPI has set here for itself
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        return {"failed": done.stderr.strip().splitlines()[-1][:90]}
    return dict(json.loads(done.stdout.splitlines()[-1]))


#: columns of numbers of the tables of blocks and of brackets
OF_BLOCKS = "set-up", "extract", "solve", "GB"
OF_BRACKETS = "assembly", *OF_BLOCKS, "over"


def table(lines: list[str], cases: dict[str, list[str]], columns: tuple[str, ...]) -> None:
    """Add the lines of some cases with their kinds; the file is written after each."""
    units = {"GB": "peak GB", "over": "over"}
    names = [units.get(name, f"{name} s") for name in columns]
    heads = ["case", "dofs", "solver", *names, "error of Z"]
    lines += ["", f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]

    for case, kinds in cases.items():
        exact: np.ndarray | None = None
        peer = np.nan
        for kind in kinds:
            line = run(case, kind)
            if "failed" in line:
                cells = [case, "", kind, str(line["failed"]), *[""] * len(columns)]
            else:
                Z = np.array([1, 1j]) @ np.array(line["Z"])
                exact = Z if kind == "direct" else exact
                peer = float(line["whole"]) if kind == PEER else peer
                line["over"] = line["whole"] / peer
                error = "" if exact is None or kind == PEER else f"{max(abs(Z / exact - 1)):.0e}"
                numbers = [f"{line[name]:.3g}".replace("nan", "") for name in columns]
                cells = [case, str(line["dofs"]), f"{kind} ({line['solver']})", *numbers, error]
            lines.append(f"| {' | '.join(cells)} |")
            OUT.write_text("\n".join(lines) + "\n")
            print(lines[-1], flush=True)


def over_ranks(lines: list[str]) -> None:
    """Add the table of ranks."""
    columns = "assembly", "set-up", "extract", "whole", "GB", "efficiency"
    names = ["GB" if name == "GB" else f"{name} s" for name in columns[:-1]]
    heads = ["case", "dofs", "ranks", *names, "efficiency"]
    lines += ["", f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]

    alone = 0.0
    for case, ranks in RANKS:
        line = run(case, "two levels", ranks)
        a_dof = ranks * line["whole"] / line["dofs"]
        if ranks == 1:
            alone = a_dof
        line["efficiency"] = alone / a_dof
        numbers = [f"{line[name]:.3g}" for name in columns]
        lines.append(f"| {' | '.join([case, str(line['dofs']), str(ranks), *numbers])} |")
        OUT.write_text("\n".join(lines) + "\n")
        print(lines[-1], flush=True)


def main() -> None:
    """Write all tables."""
    texts = [text.strip().replace("\n", " ") for text in __doc__.split("\n\n")[2:]]
    of_blocks, of_brackets, of_ranks = texts
    lines = ["# Solvers of large solids", "", f"{of_blocks} {NOTE}"]
    every = list(KINDS)
    tried = {case: every if item[-1] else ["two levels"] for case, item in CASES.items()}
    table(lines, tried, OF_BLOCKS)
    lines += ["", of_brackets]
    every = [PEER, *every]
    tried = {case: every if item[-1] else ["two levels"] for case, item in BRACKETS.items()}
    table(lines, tried, OF_BRACKETS)
    lines += ["", of_ranks]
    over_ranks(lines)


if __name__ == "__main__":
    if len(sys.argv) > 2:
        line = measured(*sys.argv[1:3], time.perf_counter if sys.argv[3:] else time.process_time)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(line))
    else:
        main()
