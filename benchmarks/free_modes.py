"""The free modes of a map: SLEPc against a block Lanczos method, on one Cholesky factor.

A block of right-hand sides reads the factor from memory once, single solves read it once each. The
lowest modes of the clamped bracket are computed at two sizes, in one run and in turns: by block
Lanczos with full orthogonalisation (below), and by SLEPc's Krylov–Schur and LOBPCG methods, all to
the same residual, and by SLEPc as antiosc calls it. Beside these stands the rest of a map: mesh,
assembly, factor, sites, static deflections and models. Writes free_modes.md: medians of CPU
seconds.

    .venv/bin/python benchmarks/free_modes.py --help
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import options
from petsc4py import PETSc
from slepc4py import SLEPc

import antiosc as ao
from antiosc.base.process import one_thread
from antiosc.fem.linalg.algebra import multiply
from antiosc.reduce.extraction.eigenmodes import Modes, ModeSolver
from antiosc.strikes import impact_map as maps

#: A measurement in a process of its own.
_apart = partial(options.apart, __file__)

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "benchmarks" / "speed"
#: Sizes of the elements [m], radius of the patches [m], numbers of modes.
SIZES = (5e-3, 2.5e-3)
RADIUS = 3e-3
COUNTS = (20, 60)
#: Dofs up to which more settings of SLEPc are tried, once; above, the first number of modes alone.
SMALL = 60_000
#: Largest ‖A⁻¹Mφ - θφ‖ over θ in the norm of M, for all methods.
RESIDUAL = 1e-7
#: Right-hand sides of a block; with 16 instead of 8 it takes a third longer.
BLOCK = 8
#: Names of the ways.
OURS, LIBRARY = f"block Lanczos, {BLOCK} vectors", "SLEPc, as antiosc calls it (1e-11)"
Row = dict[str, Any]
Pairs = tuple[np.ndarray, np.ndarray]


def main(
    sizes: tuple[float, ...] = SIZES,
    counts: tuple[int, ...] = COUNTS,
    rounds: int = 3,
    out: Path = OUT,
) -> list[Row]:
    """Measure, write the table, and return its rows."""
    rows: list[Row] = []
    for size in sizes:
        rows += _apart(size, counts, rounds)
    out.mkdir(parents=True, exist_ok=True)
    (out / "free_modes.md").write_text(table(rows, rounds))
    print(table(rows, rounds))
    return rows


@one_thread()
def measured(size: float, counts: Sequence[int], rounds: int) -> list[Row]:
    """One row for each number of modes and each way."""
    started = time.process_time()
    mesh = ao.read_mesh(ROOT / "meshes" / "bracket.geo", size=size)
    material = ao.Solid(E=70e9, nu=0.33, rho=2700.0)
    part = ao.Structure(mesh, material, supports=[ao.Support("clamp")])
    part.factorize()
    before = time.process_time() - started
    rows = []
    for count in counts if part.dofs <= SMALL else counts[:1]:
        found: dict[str, list[tuple[float, Pairs | None]]] = {}
        for again in range(rounds):
            for way, find in ways(part, count, once=not again).items():
                started = time.process_time()
                pairs = find()
                found.setdefault(way, []).append((time.process_time() - started, pairs))
        rest = before + rest_of_map(part, found[OURS][0][1])
        for way, tries in found.items():
            pairs = tries[0][1]
            row = {"dofs": part.dofs, "modes": count, "way": way, "rest": rest}
            row["seconds"] = float(np.median([seconds for seconds, _ in tries]))
            row["residual"] = float("nan") if pairs is None else residual(part, *pairs)
            rows.append(row)
    return rows


def rest_of_map(part: ao.Structure, pairs: Pairs) -> float:
    """CPU seconds of a map beside its free modes, which are given."""
    modes = Modes(*pairs, complete=False)
    kept = maps._free_modes
    maps._free_modes = lambda *_: modes
    started = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of sites that need more modes
            ao.impact_map(part, radius=RADIUS)
    finally:
        maps._free_modes = kept
    return time.process_time() - started


def ways(part: ao.Structure, count: int, once: bool) -> dict[str, Callable[[], Pairs | None]]:
    """The methods by name; each gives (ω, shapes of unit mass), or None where it fails.

    `once`: those as well that are slower, and measured but once, on the smaller structure.
    """

    def library() -> Pairs:
        found = ModeSolver(part).lowest(count)
        return found.omega, found.phi

    more: dict[str, Callable[[], Pairs | None]] = {
        "SLEPc, Krylov–Schur, 20 vectors more": lambda: by_slepc(part, count, count + 20),
        "SLEPc, Krylov–Schur, no restart": lambda: by_slepc(part, count, 3 * count + 20),
        "SLEPc, LOBPCG": lambda: by_slepc(part, count, kind="lobpcg"),
        LIBRARY: library,
    }
    return {
        OURS: lambda: block_lanczos(part, count),
        "SLEPc, Krylov–Schur": lambda: by_slepc(part, count),
        **(more if once and part.dofs <= SMALL else {}),
    }


def residual(part: ao.Structure, omega: np.ndarray, phi: np.ndarray) -> float:
    """Largest ‖A⁻¹Mφ - θφ‖/θ in the norm of M; A = K, whose supports leave no rigid motion."""
    m_phi = multiply(part.M, phi)
    scale = np.sqrt(np.einsum("ij,ij->j", phi, m_phi))
    off = (part.factorize().solve_block(m_phi) * omega**2 - phi) / scale
    return float(np.sqrt(np.einsum("ij,ij->j", off, multiply(part.M, off)).max()))


# --- SLEPc ----------------------------------------------------------------------------------------


def by_slepc(
    part: ao.Structure, count: int, vectors: int | None = None, kind: str = "krylovschur"
) -> Pairs | None:
    """The lowest modes with the structure's factor as (preconditioner or) inverse of K."""
    eps = SLEPc.EPS().create(part.K.getComm())
    eps.setOperators(part.K, part.M)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setType(kind)
    eps.setDimensions(count, vectors)
    eps.setTolerances(RESIDUAL, 200)
    st = eps.getST()
    if kind == "lobpcg":
        eps.setWhichEigenpairs(SLEPc.EPS.Which.SMALLEST_REAL)
        st.setType("precond")
    else:
        eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        eps.setTarget(0.0)
        st.setType(SLEPc.ST.Type.SINVERT)
        st.setMatMode(SLEPc.ST.MatMode.SHELL)
    ksp = st.getKSP()
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.PYTHON)
    pc.setPythonContext(Inverse(part))
    start = part.K.createVecRight()
    start.setArray(part.factorize().solve(multiply(part.M, _random(part, 1)[:, 0])))
    eps.setInitialSpace([start])
    try:
        eps.solve()
    except (PETSc.Error, SystemError):  # LOBPCG's small eigenproblem is not always definite
        return None  # (Python 3.14 makes a SystemError of PETSc's)
    found = min(eps.getConverged(), count)
    omega, phi = np.zeros(found), np.zeros((part.size, found))
    for k in range(found):
        omega[k] = np.sqrt(eps.getEigenpair(k, start).real)
        phi[:, k] = start.array_r
    eps.destroy()
    return (omega, phi) if found == count else None


class Inverse:
    """PETSc's Python preconditioner: r → K⁻¹r."""

    def __init__(self, part: ao.Structure) -> None:
        self._factor = part.factorize()

    def apply(self, pc: Any, r: PETSc.Vec, x: PETSc.Vec) -> None:
        x.setArray(self._factor.solve(r.array_r))


# --- Block Lanczos --------------------------------------------------------------------------------


def block_lanczos(part: ao.Structure, count: int) -> Pairs:
    """The `count` lowest modes: K⁻¹M V = V T + (next block)(coupling), VᵀMV = 1.

    Golub and Underwood, in Mathematical Software III, 1977, 361.
    """
    factor = part.factorize()
    start = factor.solve_block(multiply(part.M, _random(part, BLOCK)))
    blocks: list[np.ndarray] = []
    V, MV, _ = _orthonormal(part, blocks, start)
    T, coupling = np.zeros((0, 0)), np.zeros((0, 0))
    while True:
        size, width = len(T), V.shape[1]
        blocks.append(V)
        Y = factor.solve_block(MV)
        own = MV.T @ Y
        T = np.pad(T, (0, width))
        T[size:, size:] = (own + own.T) / 2
        if size:
            T[size:, size - coupling.shape[1] : size] = coupling
            T[size - coupling.shape[1] : size, size:] = coupling.T
            Y -= blocks[-2] @ coupling.T
        V, MV, coupling = _orthonormal(part, blocks, Y - blocks[-1] @ own)
        theta, turn = np.linalg.eigh(T)
        theta, turn = theta[::-1][:count], turn[:, ::-1][:, :count]
        left = np.linalg.norm(coupling @ turn[-width:], axis=0) / theta
        if len(theta) == count and left.max() <= RESIDUAL:
            return 1 / np.sqrt(theta), np.hstack(blocks) @ turn


def _orthonormal(
    part: ao.Structure, blocks: list[np.ndarray], Y: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An M-orthonormal basis Q of what Y adds to the blocks, MQ, and QᵀMY."""
    MY, coupling = multiply(part.M, Y), np.eye(Y.shape[1])
    for again in (False, True):  # twice is enough (Kahan)
        for block in blocks:
            Y = Y - block @ (block.T @ MY)
        if not again:
            MY = multiply(part.M, Y)
        L = np.linalg.cholesky(Y.T @ MY)
        coupling = L.T @ coupling
        Y, MY = (np.linalg.solve(L, x.T).T for x in (Y, MY))
    return Y, MY, coupling


def _random(part: ao.Structure, columns: int) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((part.size, columns))


# --- The whole ------------------------------------------------------------------------------------


def table(rows: list[Row], rounds: int) -> str:
    lines = [
        "# Free modes of a map: SLEPc or block Lanczos",
        "",
        f"Clamped bracket, one thread, CPU seconds, medians of {rounds} interleaved rounds "
        "(one, for what stands at the smaller size alone); in brackets over block Lanczos. `whole "
        "map`: mesh, assembly, factor, these modes, and all "
        f"else of a map with patches of {1e3 * RADIUS:g} mm on the whole surface. All stop at a "
        f"residual of {RESIDUAL:g} of each mode but where another is named; the largest that is "
        "left stands last. Made by `benchmarks/free_modes.py`. "
        f"{options.code_state()}",
        "",
        "| dofs | modes | method | modes, s | whole map, s | residual |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        mine = {"dofs": row["dofs"], "modes": row["modes"], "way": OURS}
        base = next(r for r in rows if mine.items() <= r.items())
        if np.isnan(row["residual"]):
            cells = ["failed", "", ""]
        else:
            own, whole = row["seconds"], row["seconds"] + row["rest"]
            cells = [
                f"{own:.3g} ({own / base['seconds']:.2f})",
                f"{whole:.3g} ({whole / (base['seconds'] + base['rest']):.2f})",
                f"{row['residual']:.1e}",
            ]
        lines.append(f"| {row['dofs']} | {row['modes']} | {row['way']} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    sizes, counts = options.listed(options.positive), options.listed(options.count)
    parser.add_argument("--sizes", type=sizes, default=SIZES, help="of the elements, m: a,b,…")
    parser.add_argument("--counts", type=counts, default=COUNTS, help="numbers of modes: a,b,…")
    parser.add_argument("--rounds", type=options.count, default=3, help="how often all is repeated")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--task"]:
        print(json.dumps(measured(*json.loads(sys.argv[2]))))
    else:
        command()
