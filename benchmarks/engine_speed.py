"""How fast the engine is: the first impact of a process, one impact, a batch, threads; a chart.

The article's case 2 with error estimate at tol = 1e-3: a mass of 0.24 kg strikes the middle of a
pinned beam. `engine` is the C library with the refinement of its runs, `simulate` all that a user
calls; of a batch, C is the one call of the library. Seconds are those of the processor, but for
threads; the least and the median of repeats, for other work on the machine counts. Instructions are
those of a warm `simulate` as valgrind counts them, which other work does not change.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/engine_speed.py
"""

from __future__ import annotations

import argparse
import inspect
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import options

import antiosc as ao
from antiosc import plotting
from antiosc.engine.contact.choice import choose
from antiosc.engine.contact.surfaces import Surface, matter_of
from antiosc.engine.march import converge
from antiosc.impact.two_bodies import Impact, ImpactRows
from antiosc.models.closed_form import UniformBeam, pinned_pinned

BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
HERTZ, DURATION, TOL = 1.55e10, 4e-3, 1e-3
FIRST = """
import json, sys, time
import antiosc as ao
model, count = ao.AntiOscillators(**json.loads(sys.argv[1])), int(sys.argv[2])
mass, law = ao.RigidMass(0.24, 1.0), ao.Hertz(1.55e10)
began = time.process_time()
simulate = ao.simulate
spent = [1e3 * (time.process_time() - began)]
for _ in range(count):
    began = time.process_time()
    simulate(model, mass, law, 4e-3, tol=1e-3)
    spent.append(1e3 * (time.process_time() - began))
print(json.dumps(spent))
"""
PROCESSES = 5  # of whose first calls the median is taken


def main(
    repeats: int = 200,
    scenes: int = 1000,
    workers: int = 8,
    chart: Path | None = None,
    count: bool = False,
) -> dict[str, Any]:
    """Measure; times in ms.

    Parameters
    ----------
    repeats : runs of which the least and the median are taken
    scenes : in the batch
    workers : threads that are compared with one, by calls of `simulate` and by a batch
    chart : picture of the first and the warm call, if wanted
    count : count instructions by valgrind, which takes a minute
    """
    models = {n: pinned_pinned(BEAM).anti_oscillators(n) for n in (20, 100)}
    first = {n: [calls(n, 3)[1:] for _ in range(PROCESSES)] for n in models}
    impacts = []
    for n, model in models.items():
        for speed in (0.01, 1.0):
            striker, law = ao.RigidMass(0.24, speed), ao.Hertz(HERTZ)

            def whole(model: Any = model, striker: Any = striker, law: Any = law) -> ao.History:
                return ao.simulate(model, striker, law, DURATION, tol=TOL)

            alone = engine(whole())
            both = {"engine": ms(alone, repeats), "simulate": ms(whole, repeats)}
            impacts.append({"n": n, "speed": speed, **both})
    result = {
        "chosen": chosen(repeats),
        "loading": float(np.median([calls(20, 0)[0] for _ in range(PROCESSES)])),
        "first": {n: np.median(each, axis=0).tolist() for n, each in first.items()},
        "impacts": impacts,
        "instructions": {n: instructions(n) for n in models if count},
        "batch": batch(models[20], scenes),
        "threads": {n: threads(model, workers) for n, model in models.items()},
    }
    if chart is not None:
        draw(result, chart)
    return result


def chosen(repeats: int) -> dict[str, list[float]]:
    """Times [ms] of choosing a law anew, of a circular contact and of an elliptic one, and of
    `simulate` with N = 20: by Hertz's law, by one that yields, and by "auto".
    """
    beam, ball = pinned_pinned(BEAM).anti_oscillators(20), ao.Sphere(0.01, material="100Cr6")
    alloy, striker = matter_of("6061"), ball.surface()
    flat, round_one = Surface(alloy), Surface(alloy, (0.0, 20.0), kind="line")
    model = replace(beam, info={"surfaces": {"": flat.as_dict()}})
    hitter = replace(ball, velocity=1.0)
    law = choose(flat, striker).law
    work: dict[str, Callable[[], Any]] = {
        "choice": lambda: choose.__wrapped__(flat, striker),
        "choice of an ellipse": lambda: choose.__wrapped__(round_one, striker),
    }
    for name, one in {"Hertz": ao.Hertz(law.stiffness), "yields": law, "auto": "auto"}.items():
        work[name] = lambda one=one: ao.simulate(model, hitter, one, 4e-4, tol=TOL)
    return {name: ms(run, repeats) for name, run in work.items()}


def beam(n: int) -> str:
    """The model of all measurements as JSON, with which a process need not load the beam."""
    model = pinned_pinned(BEAM).anti_oscillators(n)
    given = {"m0": model.m0, "k0": model.k0, "m": model.m.tolist(), "omega": model.omega.tolist()}
    return json.dumps(given)


def calls(n: int, count: int, *before: str) -> list[float]:
    """Times [ms] of loading `ao.simulate`, beside a model, and of the first calls of a process."""
    command = [*before, sys.executable, "-c", FIRST, beam(n), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [float(each) for each in json.loads(done.stdout)]


def instructions(n: int, count: int = 20) -> float:
    """Instructions of a warm call."""
    found = []
    for times in (2, 2 + count):
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
        command += [sys.executable, "-c", FIRST, beam(n), str(times)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        counted = re.search(r"Collected : (\d+)", done.stderr)
        assert counted is not None
        found.append(int(counted[1]))
    return (found[1] - found[0]) / count


def draw(result: dict[str, Any], path: Path) -> None:
    """What a process pays for its impacts with 20 anti-oscillators."""
    figure, ((axis,),) = plotting.panels(1, 1, size=(6, 3.4))
    first = result["first"][20]
    warm = next(r for r in result["impacts"] if r["n"] == 20 and r["speed"] == 1.0)
    times = {
        "loading\nao.simulate": result["loading"],
        "first call": first[0],
        "second": first[1],
        "warm call": warm["simulate"][1],
        "of it the\nC library": warm["engine"][1],
    }
    bars = axis.bar(list(times), list(times.values()), 0.6)
    axis.bar_label(bars, [f"{value:.2g}" for value in times.values()])
    axis.set_yscale("log")
    axis.set_ylabel("ms of the processor, median")
    plotting.save_figure(figure, path, dpi=80, bbox_inches="tight")


def engine(hit: ao.History) -> Callable[[], Any]:
    """The runs of an impact that error control makes, without the rest of `simulate`."""
    made = hit.assembly
    return lambda: converge(
        made.system, made.contact_time_estimate, DURATION, TOL, 10_000, 1_000_000
    )


def ms(work: Callable[[], Any], repeats: int) -> list[float]:
    """The least and the median of the time [ms] of the processor."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        spent.append(1e3 * (time.process_time() - began))
    return [float(each) for each in np.quantile(spent, [0.0, 0.5])]


def drawn(scenes: int) -> tuple[list[ao.RigidMass], list[ao.Hertz]]:
    """Impactors and laws with masses, speeds and stiffnesses drawn for each scene."""
    rng = np.random.default_rng(0)
    masses, stiffness = 0.24 * rng.uniform(0.5, 2, scenes), HERTZ * rng.uniform(0.5, 2, scenes)
    strikers = ao.sweep(ao.RigidMass, mass=masses, velocity=10 ** rng.uniform(-2, 1, scenes))
    return strikers, ao.sweep(ao.Hertz, stiffness=stiffness)


def batch(model: ao.AntiOscillators, scenes: int, repeats: int = 5) -> dict[str, float]:
    """Scenes a second, the best of some repeats: the C library alone, and all of a batch."""
    strikers, laws = drawn(scenes)
    each = zip(strikers, laws, strict=True)
    rows = ImpactRows(
        [Impact(model, *one, DURATION, 0.0, 0.0, None) for one in each], TOL, 10_000, 1_000_000
    )
    work = {
        "C": lambda: rows.solved(lambda count: None),
        "simulate_many": lambda: ao.simulate_many(model, strikers, laws, DURATION, tol=TOL),
    }
    best = dict.fromkeys(work, np.inf)
    for _ in range(repeats):
        for name, run in work.items():
            best[name] = min(best[name], ms(run, 1)[0])
    return {name: 1e3 * scenes / spent for name, spent in best.items()}


def threads(
    model: ao.AntiOscillators, workers: int, scenes: int = 640, repeats: int = 5
) -> dict[str, float]:
    """How many times faster several threads are than one, by the clock, at best of some repeats:
    calls of `simulate`."""
    strikers, laws = drawn(scenes)

    def strike(first: int, count: int) -> None:
        for blow in list(zip(strikers, laws, strict=True))[first::count]:
            ao.simulate(model, *blow, DURATION, tol=TOL)

    def calls(count: int, pool: ThreadPoolExecutor) -> None:
        list(pool.map(strike, range(count), [count] * count))

    found = {}
    for work in (calls,):
        least = dict.fromkeys((1, workers), np.inf)
        for _ in range(repeats):
            for count in least:
                with ThreadPoolExecutor(count) as pool:
                    began = time.perf_counter()
                    work(count, pool)
                    least[count] = min(least[count], time.perf_counter() - began)
        found[work.__name__] = least[1] / least[workers]
    return found


def report(result: dict[str, Any]) -> None:
    print(f"loading ao.simulate, beside a model: {result['loading']:.0f} ms, once in a process")
    for n, first in result["first"].items():
        print(f"N = {n:>3}: first, second, third simulate of a process, ms:", np.round(first, 2))
    for r in result["impacts"]:
        parts = (f"{what} {r[what][0]:.3f} ({r[what][1]:.3f})" for what in ("engine", "simulate"))
        print(f"N = {r['n']:>3}, {r['speed']:>4g} m/s, ms: {', '.join(parts)}")
    for name, (least, median) in result["chosen"].items():
        print(f"{name:>22}: {1e3 * least:.0f} ({1e3 * median:.0f}) µs")
    print("instructions of a warm simulate:", result["instructions"])
    print("scenes a second:", {k: round(v) for k, v in result["batch"].items()})
    for n, found in result["threads"].items():
        ratios = ", ".join(f"{what} {ratio:.2f}" for what, ratio in found.items())
        print(f"N = {n:>3}, times that threads are faster than one: {ratios}")


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--repeats", type=options.count, default=200)
    parser.add_argument("--scenes", type=options.count, default=1000)
    parser.add_argument("--workers", type=options.count, default=8)
    parser.add_argument("--chart", type=Path)
    parser.add_argument("--count", action="store_true")
    report(options.run(parser, main, arguments))


if __name__ == "__main__":
    command()
