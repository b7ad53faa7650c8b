"""The cost of one impact at the error that is asked, beside a loop as one writes it in C by hand.

A pinned beam of N anti-oscillators is struck by a ball of 33 g. The loop (`peers/plain_loop.c`)
takes equal steps over 1.2 contact times; their number is searched with the truth known, which no
user has, and a second run with half of them stands for its estimate of error. antiosc
(`simulate_many`) finds its steps, the contact and its error by itself. Errors are those of the
force (L2 norm) or of its peak, the larger one, over the tolerance; times are CPU time of one core.

    .venv/bin/python benchmarks/plain_loop.py
"""

from __future__ import annotations

import argparse
import ctypes
import inspect
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import options
from numpy.typing import NDArray

import antiosc as ao
from antiosc.impact.assembly import assemble_scene
from antiosc.models.closed_form import UniformBeam, pinned_pinned

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
SOURCE = Path(__file__).parent / "peers" / "plain_loop.c"
STIFFNESS, MASS = 1e10, 0.0327
REPEATED = 200

Array = NDArray[np.float64]


def main(tol: float = 1e-3) -> list[dict[str, float]]:
    """Times and errors for 20 and 100 anti-oscillators at 0.01, 1 and 10 m/s.

    Parameters
    ----------
    tol : tolerance of both
    """
    with tempfile.TemporaryDirectory() as folder:
        made = str(Path(folder) / "plain_loop.so")
        subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", made, SOURCE, "-lm"], check=True)
        library = ctypes.CDLL(made)
        return [compared(library, n, v, tol) for n in (20, 100) for v in (0.01, 1.0, 10.0)]


def compared(library: Any, n: int, speed: float, tol: float) -> dict[str, float]:
    model, law = pinned_pinned(BEAM, 0.4).anti_oscillators(n), ao.Hertz(STIFFNESS)
    ball = ao.RigidMass(MASS, speed)
    duration = 1.2 * ao.simulate(model, ball, law, 2e-3).contacts[0][1]
    truth = ao.simulate(model, ball, law, duration, tol=1e-5 * tol)
    scene = ao.Scene({"beam": model, "ball": ball}, [ao.Contact("beam", "ball", law)])
    system = assemble_scene(scene, duration).system

    def loop(steps: int) -> Array:
        force = np.zeros(steps + 1)
        arrays = [x.ctypes.data_as(ctypes.c_void_p) for x in (system.omega, system.beta, system.v)]
        numbers = [ctypes.c_double(x) for x in (system.R[0, 0], STIFFNESS, duration)]
        library.plain_loop(
            system.omega.size, *arrays[:2], *numbers[:2], arrays[2], numbers[2], steps,
            force.ctypes.data_as(ctypes.c_void_p),
        )  # fmt: skip
        return force

    def error(t: Array, force: Array, peak: float) -> float:
        true = np.interp(t, truth.time, truth.force)
        apart = np.sqrt(np.gradient(t) @ (force - true) ** 2 / (np.gradient(t) @ true**2))
        return max(float(apart), abs(peak / truth.peak_force - 1)) / tol

    steps = 8
    while error(np.linspace(0, duration, steps + 1), force := loop(steps), force.max()) > 1:
        steps = int(1.1 * steps) + 1
    hit = ao.simulate(model, ball, law, duration, tol=tol)
    balls = [ball] * REPEATED
    return {
        "N": n,
        "speed": speed,
        "loop steps": steps,
        "loop us": seconds(lambda: [(loop(steps), loop(steps // 2)) for _ in balls]),
        "antiosc us": seconds(lambda: ao.simulate_many(model, balls, law, duration, tol=tol)),
        "error/tol": error(hit.time, hit.force, hit.peak_force),
    }


def seconds(task: Callable[[], object]) -> float:
    """Microseconds of CPU of one of the repeated tasks, the least of five."""
    found = []
    for _ in range(5):
        start = process_time()
        task()
        found.append(process_time() - start)
    return 1e6 * min(found) / REPEATED


# -- the command line


def report(rows: list[dict[str, float]]) -> None:
    print("".join(f"{name:>12}" for name in (*rows[0], "ratio")))
    for row in rows:
        ratio = row["antiosc us"] / row["loop us"]
        print("".join(f"{value:>12.3g}" for value in (*row.values(), ratio)))


def command(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--tol", type=options.positive, default=1e-3)
    report(options.run(parser, main, arguments))
    return 0


if __name__ == "__main__":
    raise SystemExit(command())
