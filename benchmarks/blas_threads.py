"""BLAS threads on an idle and on a busy machine: times of a factor and of solves, as ratios.

The stiffness of the bracket at three sizes is factored and solved with one BLAS thread, with one a
core (what BLAS takes by itself), and with those that antiosc chooses; first with the machine as it
is, then beside two busy processes a core. All in one run, one after the other in every round; the
medians are told over that of one thread without load. Writes blas_threads.md and blas_threads.png.

    .venv/bin/python benchmarks/blas_threads.py --rounds 5 --out benchmarks/speed
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import options
from threadpoolctl import ThreadpoolController

import antiosc as ao
from antiosc import plotting
from antiosc.base import process
from antiosc.fem.linalg.cholmod import Cholesky
from antiosc.fem.linalg.petsc_algebra import csr, lower

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "benchmarks" / "speed"
#: Sizes of the elements [m].
SIZES = (0.012, 0.008, 0.005)
#: Columns of the solves.
COLUMNS = (1, 16)
TASKS = ("factor", *(f"solve, {k} column{'s' * (k > 1)}" for k in COLUMNS))
#: Seconds by load, way and task; and those by dofs.
Times = dict[tuple[str, str, str], list[float]]
Found = dict[int, Times]


def main(sizes: tuple[float, ...] = SIZES, rounds: int = 5, out: Path = OUT) -> Found:
    """Measure with elements of these sizes, write the table and the chart, return the seconds."""
    if process.user_threads():
        sys.exit(f"unset {process.user_threads()[0]} first: it decides the threads by itself.")
    ways = {"1 thread": 1, f"{process.cores()} threads": process.cores(), "antiosc": None}
    found = dict(measured(size, ways, rounds) for size in sizes)
    out.mkdir(parents=True, exist_ok=True)
    (out / "blas_threads.md").write_text(table(found, ways))
    draw(found, ways, out / "blas_threads.png")
    print(table(found, ways))
    return found


def measured(size: float, ways: dict[str, int | None], rounds: int) -> tuple[int, Times]:
    """(Dofs, seconds by load, way and task) of the bracket at a size of its elements."""
    mesh = ao.read_mesh(ROOT / "meshes" / "bracket.geo", size=size)
    material = ao.Solid(E=70e9, nu=0.33, rho=2700.0)
    part = ao.Structure(mesh, material, supports=[ao.Support("clamp")])
    A = lower(csr(part.K))
    order = Cholesky(A, part.K.getBlockSize()).permutation
    times: Times = {}
    for load in ("idle", "busy"):
        with busy() if load == "busy" else nullcontext():
            for _ in range(rounds):
                for way, count in ways.items():
                    for task, seconds in once(A, order, count):
                        times.setdefault((load, way, task), []).append(seconds)
    return A.shape[0], times


def once(A, order, count: int | None) -> Iterator[tuple[str, float]]:
    """Seconds of every task with so many threads, or those that antiosc chooses."""
    with given(count) if count else nullcontext():
        started = time.perf_counter()
        factor = Cholesky(A, permutation=order)
        yield TASKS[0], time.perf_counter() - started
        for task, columns in zip(TASKS[1:], COLUMNS, strict=True):
            B = np.ones((A.shape[0], columns), order="F")
            started = time.perf_counter()
            factor.solve(B)
            yield task, time.perf_counter() - started


@contextmanager
def given(count: int) -> Iterator[None]:
    """So many threads, as if the user had set them."""
    os.environ["OPENBLAS_NUM_THREADS"] = str(count)
    try:
        with ThreadpoolController().limit(limits=count, user_api="blas"):
            yield
    finally:
        del os.environ["OPENBLAS_NUM_THREADS"]


@contextmanager
def busy() -> Iterator[None]:
    """Two processes a core that compute without end."""
    command = [sys.executable, "-c", "while True: pass"]
    processes = [subprocess.Popen(command) for _ in range(2 * process.cores())]
    time.sleep(1.0)
    try:
        yield
    finally:
        for one in processes:
            one.kill()
            one.wait()


def ratio(times: Times, load: str, way: str, task: str) -> float:
    """Median over that of one thread without load."""
    return float(np.median(times[load, way, task]) / np.median(times["idle", "1 thread", task]))


def table(found: Found, ways: dict[str, int | None]) -> str:
    lines = [
        "# BLAS threads, idle and busy",
        "",
        f"Bracket, {process.cores()} cores; idle: the machine as it was; busy: beside "
        f"{2 * process.cores()} processes that compute without end. Medians over that of one "
        "thread without load; in brackets the longest one. Made by `benchmarks/blas_threads.py`. "
        f"{options.code_state()}",
        "",
        f"| dofs | | {' | '.join(f'{load}, {way}' for load in ('idle', 'busy') for way in ways)} |",
        "|---|---|" + "---|" * (2 * len(ways)),
    ]
    for dofs, times in found.items():
        for task in TASKS:
            base = np.median(times["idle", "1 thread", task])
            cells = [
                f"{ratio(times, load, way, task):.2f} ({max(times[load, way, task]) / base:.2f})"
                for load in ("idle", "busy")
                for way in ways
            ]
            lines.append(f"| {dofs} | {task}, {base:.3g} s | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def draw(found: Found, ways: dict[str, int | None], path: Path) -> None:
    figure, grid = plotting.panels(1, 2, size=(9, 3.6), sharey=True)
    axes = grid[0]
    dofs = [str(n) for n in found]
    places = np.arange(len(dofs))
    for axis, load in zip(axes, ("idle", "busy"), strict=True):
        for k, way in enumerate(ways):
            values = [ratio(times, load, way, "factor") for times in found.values()]
            axis.bar(places + 0.27 * (k - 1), values, 0.25, label=way)
        axis.set(title=load, xlabel="dofs", yscale="log")
        axis.set_xticks(places, dofs)
        axis.grid(axis="y", alpha=0.3)
    axes[0].set_ylabel("factorization, over one thread idle")
    axes[0].legend(title="BLAS threads")
    plotting.save_figure(figure, path, dpi=120)


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=options.count, default=5, help="how often all is repeated")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
