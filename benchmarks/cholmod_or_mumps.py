"""CHOLMOD's opened factor against MUMPS: compliances of many sites, and a factor over two ranks.

Both solve the clamped bracket at two sizes, in one run, in turns. The compliances bᵀK⁻¹b of patches
on its surface: by the branches of CHOLMOD's elimination tree (`antiosc.fem.linalg.compliance`), by
MUMPS's solves for sparse right-hand sides (ICNTL(20)), and from selected entries of the inverse
(ICNTL(30)). The factor over two ranks: by condensation onto the interface
(`antiosc.fem.linalg.solver_choice`), and by MUMPS. Writes cholmod_or_mumps.md: medians of the CPU
seconds of the slowest rank, numbers in the factor, errors.

    .venv/bin/python benchmarks/cholmod_or_mumps.py --help
"""

from __future__ import annotations

import argparse
import ctypes
import json
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import options
import scipy.sparse
from petsc4py import PETSc

import antiosc as ao
from antiosc.base.process import one_thread
from antiosc.fem.linalg.algebra import multiply
from antiosc.fem.linalg.cholmod import Cholesky
from antiosc.fem.linalg.compliance import compliances
from antiosc.fem.linalg.petsc_algebra import csr, lower, with_entries
from antiosc.fem.linalg.solver_choice import Distributed, Substructures, interface
from antiosc.reduce.site.map_sites import sites_of

#: A measurement in a process of its own.
_apart = partial(options.apart, __file__)

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "benchmarks" / "speed"
#: Sizes of the elements [m], and radius of the patches [m].
SIZES = (5e-3, 2.9e-3)
RADIUS = 3e-3
#: Neighbouring sites whose compliances are computed.
SITES = 128
#: Right-hand sides of a block.
COLUMNS = 16
#: The way that has the whole of K⁻¹b.
SOLVES = "MUMPS, sparse right-hand sides"
Row = dict[str, Any]


def main(
    sizes: tuple[float, ...] = SIZES, sites: int = SITES, rounds: int = 3, out: Path = OUT
) -> dict[str, list[Row]]:
    """Measure, write the tables, and return their rows."""
    found: dict[str, list[Row]] = {"compliances": [], "ranks": []}
    for size in sizes:
        found["compliances"] += _apart("compliances", size, sites, rounds)
        found["ranks"] += _apart("ranks", size, rounds, ranks=2)
    out.mkdir(parents=True, exist_ok=True)
    (out / "cholmod_or_mumps.md").write_text(tables(found, rounds))
    print(tables(found, rounds))
    return found


def bracket(size: float) -> ao.Structure:
    mesh = ao.read_mesh(ROOT / "meshes" / "bracket.geo", size=size)
    material = ao.Solid(E=70e9, nu=0.33, rho=2700.0)
    return ao.Structure(mesh, material, supports=[ao.Support("clamp")])


# --- Compliances of many sites --------------------------------------------------------------------


def measured_compliances(size: float, count: int, rounds: int) -> list[Row]:
    """Seconds of the factor and of a site, and the error, for each way."""
    part = bracket(size)
    places = sites_of(part, None, None, RADIUS).sites
    near = np.argsort(places.points @ [1.0, 0.1, 0.01])[:count]
    loads = scipy.sparse.csc_matrix(places.loads[:, near])
    ways: dict[str, Callable[[], Row]] = {
        "CHOLMOD, branches of the tree": lambda: by_cholmod(part, loads),
        SOLVES: lambda: by_mumps(part, loads, sparse_solves),
        "MUMPS, entries of the inverse": lambda: by_mumps(part, loads, entries_of_inverse),
    }
    part.factorize()
    B = loads.toarray()
    exact = np.einsum("ij,ij->j", B, part.factorize().solve_block(B))
    tries: dict[str, list[Row]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, run in ways.items():
            tries[way].append(run())
    rows = []
    for way, runs in tries.items():
        row = medians(runs, ("factor", "sites"))
        error = float(np.max(np.abs(runs[0]["compliances"] / exact - 1)))
        row = {"dofs": part.dofs, "way": way, **row, "entries": runs[0]["entries"], "error": error}
        row["each"] = row.pop("sites") / count
        row["map"] = row["factor"] + len(places) * row["each"]
        if run_twice(way):
            row["map"] *= 2
        rows.append({**row, "sites": len(places)})
    return rows


def run_twice(way: str) -> bool:
    """Whether a map takes the inertia of the sites from a second factor, instead of K⁻¹b."""
    return way != SOLVES


def by_cholmod(part: ao.Structure, loads: scipy.sparse.csc_matrix) -> Row:
    started = time.process_time()
    factor = Cholesky(lower(csr(part.K)), part.K.getBlockSize())
    made = time.process_time()
    found = compliances(factor, loads)
    spent = time.process_time() - made
    return {
        "factor": made - started,
        "sites": spent,
        "entries": float(factor.supernodes.values.size),
        "compliances": found,
    }


def by_mumps(
    part: ao.Structure,
    loads: scipy.sparse.csc_matrix,
    solve: Callable[[PETSc.Mat, scipy.sparse.csc_matrix], np.ndarray],
) -> Row:
    started = time.process_time()
    solver = Distributed(with_entries(part.K))  # MUMPS chooses its ordering
    made = time.process_time()
    found = solve(solver._ksp.getPC().getFactorMatrix(), loads)
    spent = time.process_time() - made
    return {
        "factor": made - started,
        "sites": spent,
        "entries": solver.entries,
        "compliances": found,
    }


def sparse_solves(factor: PETSc.Mat, loads: scipy.sparse.csc_matrix) -> np.ndarray:
    """bᵀK⁻¹b by MUMPS's solves, in blocks; PETSc sets ICNTL(20)."""
    found = np.zeros(loads.shape[1])
    for first in range(0, loads.shape[1], COLUMNS):
        b = scipy.sparse.csc_matrix(loads[:, first : first + COLUMNS])
        right, _kept = transposed(b.T.tocsr())
        X = PETSc.Mat().createDense(b.shape, comm=factor.getComm())
        X.setUp()
        X.assemble()
        factor.matSolve(right, X)
        found[first : first + COLUMNS] = b.multiply(X.getDenseArray()).sum(axis=0)
        X.destroy()
    return found


def entries_of_inverse(factor: PETSc.Mat, loads: scipy.sparse.csc_matrix) -> np.ndarray:
    """bᵀK⁻¹b from the entries of the inverse at the dofs of each patch (ICNTL(30))."""
    pattern = abs(loads) @ abs(loads).T
    wanted, kept = transposed(scipy.sparse.tril(pattern).tocsr())
    library = ctypes.CDLL(None)
    failed = library.MatMumpsGetInverse(
        ctypes.c_void_p(factor.handle), ctypes.c_void_p(wanted.handle)
    )
    if failed:
        raise SystemExit(f"MatMumpsGetInverse: PETSc error {failed}")
    pointers, columns, values = kept.getValuesCSR()
    half = scipy.sparse.csr_matrix((values, columns, pointers), shape=pattern.shape)
    inverse = half + half.T - scipy.sparse.diags(half.diagonal())
    return np.asarray(loads.multiply(inverse @ loads).sum(axis=0)).ravel()


def transposed(matrix: scipy.sparse.csr_matrix) -> tuple[PETSc.Mat, PETSc.Mat]:
    """The transpose as MUMPS wants sparse right-hand sides, and the matrix that it refers to."""
    kept = PETSc.Mat().createAIJ(
        matrix.shape,
        csr=(matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data),
        comm=PETSc.COMM_SELF,
    )
    kept.assemble()
    return PETSc.Mat().createTranspose(kept), kept


# --- A factor over ranks --------------------------------------------------------------------------


def measured_ranks(size: float, rounds: int) -> list[Row]:
    """Seconds of a factor and of solves on the ranks of this run, for both ways."""
    part = bracket(size)
    K, comm = with_entries(part.K), part.comm
    ways = {
        "condensation, CHOLMOD": lambda: Substructures(K, interface(K)),
        "MUMPS": lambda: Distributed(K),
    }
    rng = np.random.default_rng(comm.rank)
    R = rng.standard_normal((K.getLocalSize()[0], COLUMNS))
    R[part.fixed[part.fixed < len(R)]] = 0.0
    tries: dict[str, list[Row]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, make in ways.items():
            comm.Barrier()
            times = [time.process_time()]
            solver = make()
            times.append(time.process_time())
            solver.solve(R[:, 0])
            times.append(time.process_time())
            X = solver.solve_block(R)
            times.append(time.process_time())
            spent = np.max(comm.allgather(np.diff(times)), axis=0)
            left = comm.allreduce(np.sum((multiply(K, X) - R) ** 2))
            tries[way].append(
                {
                    "factor": spent[0],
                    "solve": spent[1],
                    "block": spent[2],
                    "entries": solver.entries,
                    "error": float(np.sqrt(left / comm.allreduce(np.sum(R**2)))),
                }
            )
            del solver, X
    return [
        {
            "dofs": part.dofs,
            "way": way,
            **medians(runs, ("factor", "solve", "block")),
            "entries": runs[0]["entries"],
            "error": runs[0]["error"],
        }
        for way, runs in tries.items()
    ]


# --- The whole ------------------------------------------------------------------------------------


def medians(runs: list[Row], names: Sequence[str]) -> Row:
    return {name: float(np.median([run[name] for run in runs])) for name in names}


TASKS: dict[str, Callable[..., list[Row]]] = {
    "compliances": measured_compliances,
    "ranks": measured_ranks,
}


@one_thread()
def _task(text: str) -> None:
    name, *arguments = json.loads(text)
    rows = TASKS[name](*arguments)
    from mpi4py import MPI

    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(rows))


def tables(found: dict[str, list[Row]], rounds: int) -> str:
    lines = [
        "# CHOLMOD or MUMPS",
        "",
        f"Clamped bracket; medians of {rounds} interleaved rounds, CPU seconds (over ranks: of the "
        "slowest), one thread a rank, in brackets the ratio to the first way; the error is that of "
        "bᵀK⁻¹b against solves, or ‖KX - R‖/‖R‖. MUMPS chooses its ordering. "
        "`map` is that of all sites: factor and sites, twice where the inertia "
        "needs a second factor. Made by `benchmarks/cholmod_or_mumps.py`. "
        f"{options.code_state()}",
        "",
        "| dofs | compliances | factor, s | each site, ms | map, s | factor, GB | error |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += _lines(found["compliances"], ("factor", "each", "map"), {"each": 1e3})
    lines += [
        "",
        f"| dofs | two ranks | factor, s | solve, s | {COLUMNS} solves, s | factor, GB | error |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += _lines(found["ranks"], ("factor", "solve", "block"), {})
    return "\n".join(lines) + "\n"


def _lines(rows: list[Row], names: Sequence[str], units: dict[str, float]) -> list[str]:
    lines = []
    first: Row = {}
    for row in rows:
        if row["dofs"] != first.get("dofs"):
            first = row
        cells = [f"{row[n] * units.get(n, 1):.3g} ({row[n] / first[n]:.2f})" for n in names]
        cells += [f"{8e-9 * row['entries']:.3g}", f"{row['error']:.1e}"]
        lines.append(f"| {row['dofs']} | {row['way']} | {' | '.join(cells)} |")
    return lines


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    sizes = options.listed(options.positive)
    parser.add_argument("--sizes", type=sizes, default=SIZES, help="of the elements, m: a,b,…")
    parser.add_argument("--sites", type=options.count, default=SITES, help="number of sites")
    parser.add_argument("--rounds", type=options.count, default=3, help="how often all is repeated")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--task"]:
        _task(sys.argv[2])
    else:
        command()
