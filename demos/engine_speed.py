"""How fast the engine is: the first impact of a process, one impact, a batch, threads.

The article's case 2 with error estimate at tol = 1e-3: a mass of 0.24 kg strikes the middle of a
pinned beam. `engine` is the C library with the refinement of its runs, `simulate` all that a user
calls. Seconds are those of the processor, but for threads; quantiles of 10 % and 50 %, for other
work on the machine counts.

    OMP_NUM_THREADS=1 .venv/bin/python demos/engine_speed.py
"""

from __future__ import annotations

import argparse
import inspect
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import options

import antiosc as ao
from antiosc.closed_form import UniformBeam, pinned_pinned
from antiosc.simulation.convergence import converge
from antiosc.simulation.exact import of_problem

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
HERTZ, DURATION, TOL = 1.55e10, 4e-3, 1e-3
FIRST = """
import json, time
import antiosc as ao
model = ao.AntiOscillators(m0=0.1, k0=1e5, m=[0.1] * 20, omega=[1e3 * (i + 1) for i in range(20)])
mass, law, simulate = ao.RigidMass(0.24, 1.0), ao.Hertz(1.55e10), ao.simulate
spent = []
for _ in range(3):
    began = time.process_time()
    simulate(model, mass, law, 4e-3)
    spent.append(1e3 * (time.process_time() - began))
print(json.dumps(spent))
"""


def main(repeats: int = 200, scenes: int = 1000, workers: int = 8) -> dict[str, Any]:
    """Measure; times in ms.

    Parameters
    ----------
    repeats : runs of which quantiles are taken
    scenes : in the batch
    workers : threads that are compared with one
    """
    models = {n: pinned_pinned(BEAM).anti_oscillators(n) for n in (20, 100)}
    done = subprocess.run([sys.executable, "-c", FIRST], capture_output=True, text=True, check=True)
    impacts = []
    for n, model in models.items():
        for speed in (0.01, 1.0):
            striker, law = ao.RigidMass(0.24, speed), ao.Hertz(HERTZ)

            def whole(model: Any = model, striker: Any = striker, law: Any = law) -> ao.History:
                return ao.simulate(model, striker, law, DURATION, tol=TOL)

            alone = engine(whole())
            both = {"engine": ms(alone, repeats), "simulate": ms(whole, repeats)}
            impacts.append({"n": n, "speed": speed, **both})
    return {
        "first": json.loads(done.stdout),
        "impacts": impacts,
        "batch": batch(models[20], scenes),
        "threads": threads(models[100], workers),
    }


def engine(hit: ao.History) -> Callable[[], Any]:
    """The runs of an impact that error control makes, without the rest of `simulate`."""
    problem = hit.problem
    system = of_problem(problem)
    lasting = 3 * problem.depth / problem.speed
    return lambda: converge(system, lasting, DURATION, TOL, 10_000, 1_000_000)


def ms(work: Callable[[], Any], repeats: int) -> list[float]:
    """Quantiles of the time [ms] of the processor."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        spent.append(1e3 * (time.process_time() - began))
    return [float(each) for each in np.quantile(spent, [0.1, 0.5])]


def batch(model: ao.AntiOscillators, scenes: int) -> dict[str, float]:
    """Scenes a second with masses, speeds and laws drawn for each."""
    rng = np.random.default_rng(0)
    masses, stiffness = 0.24 * rng.uniform(0.5, 2, scenes), HERTZ * rng.uniform(0.5, 2, scenes)
    strikers = ao.sweep(ao.RigidMass, mass=masses, velocity=10 ** rng.uniform(-2, 1, scenes))
    laws = ao.sweep(ao.Hertz, stiffness=stiffness)
    runs = [
        engine(ao.simulate(model, *each, DURATION)) for each in zip(strikers, laws, strict=True)
    ]
    began = time.process_time()
    for run in runs:
        run()
    middle = time.process_time()
    ao.simulate_many(model, strikers, laws, DURATION, tol=TOL)
    end = time.process_time()
    return {"engine": scenes / (middle - began), "simulate_many": scenes / (end - middle)}


def threads(model: ao.AntiOscillators, workers: int) -> dict[str, float]:
    """Seconds of the clock of 400 impacts in one thread and in several."""
    runs = [engine(ao.simulate(model, ao.RigidMass(0.24, 1.0), ao.Hertz(HERTZ), DURATION))] * 400
    found = {}
    for count in (1, workers):
        with ThreadPoolExecutor(count) as pool:
            began = time.perf_counter()
            list(pool.map(lambda run: run(), runs))
            found[f"{count} threads"] = time.perf_counter() - began
    return found


def report(result: dict[str, Any]) -> None:
    print("first, second, third simulate of a process, ms:", np.round(result["first"], 2))
    for r in result["impacts"]:
        parts = (f"{what} {r[what][0]:.3f} ({r[what][1]:.3f})" for what in ("engine", "simulate"))
        print(f"N = {r['n']:>3}, {r['speed']:>4g} m/s, ms: {', '.join(parts)}")
    print("scenes a second:", {k: round(v) for k, v in result["batch"].items()})
    one, several = result["threads"].values()
    print(f"400 impacts: {result['threads']}, ratio {one / several:.2f}")


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--repeats", type=options.count, default=200)
    parser.add_argument("--scenes", type=options.count, default=1000)
    parser.add_argument("--workers", type=options.count, default=8)
    report(options.run(parser, main, arguments))


if __name__ == "__main__":
    command()
