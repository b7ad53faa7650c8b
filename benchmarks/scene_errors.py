"""How far scenes are from the truth: random blows over all contact laws, run at a tolerance.

Beams struck anywhere and random anti-oscillators, free or held, with masses of 0.01 to 3 kg at 0.01
to 10 m/s, under every contact law (those of `fuzz_scenes.py`). The truth is the same scene at a
hundredth of the tolerance. Printed are the share of scenes whose error is within the tolerance,
quantiles of error and of the estimated error over the true one, and the steps of a scene.

    .venv/bin/python benchmarks/scene_errors.py --scenes 500
"""

from __future__ import annotations

import argparse
import inspect
import warnings
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import options
from fuzz_scenes import law

import antiosc as ao
from antiosc.engine.march import difference
from antiosc.models.closed_form import UniformBeam, cantilever, pinned_pinned

FINER = 100.0
BEAM = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)


def main(scenes: int = 500, first: int = 0, tol: float = 1e-3) -> dict[str, Any]:
    """Errors of the scenes `first` to `first + scenes - 1`, relative to the tolerance.

    Parameters
    ----------
    scenes : number of scenes
    first : number of the first scene, which is the seed of its random numbers
    tol : tolerance of the runs
    """
    laws: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    errors, estimates, steps, outside = [], [], [], []
    for number in range(first, first + scenes):
        scene, duration = draw(number)
        name = type(scene.contacts[0].law).__name__
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ao.AntioscWarning)
                hit = scene.run(duration, tol=tol)
                truth = scene.run(duration, tol=tol / FINER)
        except ao.AccuracyError:  # beyond the range of the law
            counts["refused"] += 1
            continue
        counts[f"status {hit.status}"] += 1
        if {hit.status, truth.status} & {1, 2}:
            continue
        error = max(difference(hit.run, truth.run, tol)[:2])
        laws[name] += 1
        errors.append(error / tol)
        estimates.append(max(hit.error.values()) / max(error, 1e-300))
        steps.append(hit.run.steps)
        if error > tol:
            outside.append(f"scene {number}, {name}: {error / tol:.2f} tol")
    return {
        "laws": dict(laws),
        "counts": dict(counts),
        "errors": errors,
        "estimates": estimates,
        "steps": steps,
        "outside": outside,
    }


def draw(number: int) -> tuple[ao.Scene, float]:
    """The random blow of that number and its duration [s]."""
    rng = np.random.default_rng([77, number])
    kind = rng.integers(3)
    if kind == 2:
        n = int(rng.integers(1, 30))
        model = ao.AntiOscillators(
            m0=float(rng.uniform(0.02, 0.1)) * (rng.random() < 0.7),
            k0=1e5 * (rng.random() < 0.5),
            m=rng.uniform(0.01, 0.2, n),
            omega=rng.uniform(500.0, 3e4, n),
        )
    else:
        end, place = (pinned_pinned, rng.uniform(0.1, 0.9))
        if kind == 1:
            end, place = cantilever, rng.uniform(0.3, 1.0)
        model = end(BEAM, float(place)).anti_oscillators(int(rng.integers(3, 40)))
    mass = ao.RigidMass(10 ** rng.uniform(-2, 0.5), 10 ** rng.uniform(-2, 1))
    contact = ao.Contact("struck", "mass", law(rng))
    return ao.Scene({"struck": model, "mass": mass}, [contact]), 10 ** rng.uniform(-3.3, -2.0)


# -- the command line


def report(result: dict[str, Any]) -> None:
    for name, count in sorted({**result["counts"], **result["laws"]}.items()):
        print(f"{name:<24}{count:>8}")
    errors = np.array(result["errors"])
    print(f"within the tolerance: {np.mean(errors <= 1):.2%} of {errors.size}")
    quantiles = (0.5, 0.9, 0.99, 1.0)
    for name in ("errors", "estimates", "steps"):
        values = "".join(f"{v:>10.3g}" for v in np.quantile(result[name], quantiles))
        print(f"{name:<12}{values}   quantiles 50, 90, 99, 100 %")
    for line in result["outside"]:
        print(line)


def command(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--scenes", type=options.count, default=500)
    parser.add_argument("--first", type=options.seed, default=0)
    parser.add_argument("--tol", type=options.positive, default=1e-3)
    report(options.run(parser, main, arguments))
    return 0


if __name__ == "__main__":
    raise SystemExit(command())
