"""Random impacts, extreme ones included: nothing may hang, come out as NaN, or lose momentum.

Every scene draws a law, an impactor, a model and a method. For each the run checks

- all results are finite and the force is never negative,
- momentum: the impactor's (and a free structure's) gain is the impulse, to 1e-9 of the impulse
  beyond the rounding of the momentum itself, one unit in the last place a step; by DOP853, whose
  force is recorded as parabolas, to the tolerance of the run,
- what leaves its range is said in an antiosc error, anything else is a failure.

    .venv/bin/python benchmarks/fuzz.py --scenes 10000
"""

from __future__ import annotations

import argparse
import inspect
import time
import warnings
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import options

import antiosc as ao

Rng = np.random.Generator

MOMENTUM = 1e-9
EPS = float(np.finfo(float).eps)


def main(scenes: int = 10_000, seed: int = 1, budget: float = 60.0) -> dict[str, Any]:
    """Run random scenes; return the counts and the worst figures.

    Parameters
    ----------
    scenes : number of scenes
    seed : of the random numbers
    budget : seconds after which one scene counts as hanging
    """
    counts: Counter[str] = Counter()
    failures: list[str] = []
    momentum = slowest = 0.0
    start = time.perf_counter()
    for number in range(scenes):
        rng = np.random.default_rng([seed, number])
        scene = draw(rng)
        counts[f"law {type(scene['contact']).__name__}"] += 1
        counts[f"impactor {type(scene['impactor']).__name__}"] += 1
        counts[f"method {scene['method']}"] += 1
        began = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", ao.AntioscWarning)
                hit = ao.simulate(**scene)
                wrong, balance = check(hit, scene)
            counts[f"status {hit.status}"] += 1
            counts["contacts"] += len(hit.contacts)
            momentum = max(momentum, balance)
        except ao.AntioscError as error:
            counts[f"refused: {type(error).__name__}"] += 1
            wrong = "" if expected(error, scene) else f"{type(error).__name__}: {error}"
        except Exception as error:  # a failure of any kind is what is looked for
            wrong = f"{type(error).__name__}: {error}"
        seconds = time.perf_counter() - began
        slowest = max(slowest, seconds)
        if seconds > budget:
            wrong = f"took {seconds:.0f} s"
        if wrong:
            failures.append(f"scene {number}: {wrong}")
    return {
        "scenes": scenes,
        "failures": failures,
        "momentum": momentum,
        "slowest": slowest,
        "seconds": time.perf_counter() - start,
        "counts": dict(sorted(counts.items())),
    }


def check(hit: ao.History, scene: dict[str, Any]) -> tuple[str, float]:
    """What is wrong with a history, if anything, and its relative momentum error."""
    arrays = (hit.force, hit.indentation, hit.displacement, hit.velocity, hit.impactor_velocity)
    if not all(np.all(np.isfinite(a)) for a in arrays):
        return "not finite", 0.0
    numbers = (hit.impulse, hit.contact_time, hit.peak_force, hit.energy.drift)
    if not np.all(np.isfinite(numbers)):
        return f"not finite: {numbers}", 0.0
    if hit.force.min() < 0:
        return f"negative force {hit.force.min():g} N", 0.0
    if not np.all(np.diff(hit.time) >= 0):
        return "time runs backwards", 0.0
    if hit.status == 2:  # stopped early: the rest is not claimed
        return "", 0.0
    return balance(hit, scene["tol"] if scene.get("method") == "DOP853" else MOMENTUM)


def balance(hit: ao.History, limit: float) -> tuple[str, float]:
    """Momentum of every undamped rigid-body mode against the impulse and gravity."""
    system = hit.assembly.system
    beta, load = system.beta[0], system.loads[0]
    rigid = (system.omega == 0) & (beta != 0) & (system.decay == 0)
    if not np.any(rigid) or hit.impulse == 0.0:
        return "", 0.0
    _, v = hit.states(hit.time[[0, -1]])
    span = hit.time[-1]
    # mass-normalised: v' = load - beta F
    gained = (v[1] - v[0] - load * span)[rigid]
    pushed = -beta[rigid] * hit.impulse
    known = np.abs(v).max(axis=0)[rigid] + np.abs(load[rigid]) * span
    rounding = EPS * known * (100 + hit.time.size)
    error = np.abs(gained - pushed)
    worst = float(np.max((error - rounding) / np.abs(pushed)))
    if worst > limit:
        return f"momentum error {worst:.1e} of the impulse", worst
    return "", max(worst, 0.0)


def expected(error: ao.AntioscError, scene: dict[str, Any]) -> bool:
    """Refusals that a scene may meet: a law's range, and methods that say why they cannot."""
    if isinstance(error, ao.AccuracyError):
        law = scene["contact"]
        limited = isinstance(law, ao.Tabulated) or getattr(law, "compliance", 0) > 0
        return limited and str(error).startswith("the peak force")
    return isinstance(error, ao.InputError) and "use the method 'exact'" in str(error)


# -- drawing scenes


def draw(rng: Rng) -> dict[str, Any]:
    """One random scene as keywords of `simulate`."""
    model = random_model(rng)
    impactor, speed = random_impactor(rng, model)
    mass = effective_mass(model, impactor)
    pace = abs(speed) if speed else 1.0
    stiffness = 10 ** rng.uniform(3, 13)
    law = random_law(rng, stiffness, mass, pace)
    deepest = (mass * pace**2 / stiffness) ** 0.4
    free = model.k0 == 0
    moves = free and (isinstance(impactor, ao.Obstacle) or rng.random() < 0.2)
    return {
        "model": model,
        "impactor": impactor,
        "contact": law,
        "duration": deepest / pace * 10 ** rng.uniform(-0.5, 1.5),
        "method": str(
            rng.choice(
                ["exact", "newmark", "conserving", "leapfrog", "DOP853"],
                p=[0.82, 0.06, 0.04, 0.06, 0.02],
            )
        ),
        "tol": 10 ** rng.uniform(-3.5, -1),
        "initial_velocity": pace if moves else 0.0,
        "gravity": float(rng.choice([0.0, 0.0, 9.81, -9.81])),
        "gap": float(rng.choice([0.0, 1.0])) * deepest * rng.uniform(0, 2),
        "max_contacts": 200,
        "max_steps": 20_000,
    }


def random_model(rng: Rng) -> ao.AntiOscillators:
    """From no anti-oscillator to 40, heavy and light, with and without residual mass."""
    n = int(rng.choice([0, 1, 3, 10, 40]))
    scale = 10 ** rng.uniform(-3, 3)
    m = scale * 10 ** rng.uniform(-4, 0, n)
    if n and rng.random() < 0.2:  # near-zero participation
        m[rng.integers(n)] *= 1e-12
    omega = 10 ** rng.uniform(1, 6, n)
    light = float(rng.choice([1.0, 1e-3, 1e-9, 1e-14, 0.0]))
    m0 = scale * light if n else scale
    k0 = 0.0 if rng.random() < 0.4 else scale * 10 ** rng.uniform(2, 12)
    damping = None
    if rng.random() < 0.3:
        damping = ao.Damping(
            ratio=10 ** rng.uniform(-4, -0.7),
            alpha=float(rng.choice([0.0, 10.0])),
            beta=float(rng.choice([0.0, 1e-6])),
        )
    share = rng.uniform(0, 1, n + 1) * np.concatenate(([m0], m))
    return ao.AntiOscillators(m0, k0, m, omega, participation=share, damping=damping)


def random_impactor(rng: Rng, model: ao.AntiOscillators) -> tuple[Any, float]:
    """Something that strikes and its speed: mass ratios 1e-6 to 1e6, speeds 1e-9 to 100 m/s."""
    speed = 10 ** (rng.uniform(-9, 2) if rng.random() < 0.3 else rng.uniform(-2, 1))
    kind = rng.choice(["mass", "sphere", "obstacle", "free model", "supported model"])
    if kind == "obstacle" and model.k0 == 0:
        return ao.Obstacle(), speed
    if kind == "sphere":
        radius = 10 ** rng.uniform(-3, 0)
        return ao.Sphere(radius, 2.1e11, 0.3, 7800.0, speed), speed
    if kind.endswith("model"):
        other = random_model(rng)
        if other.k0 == 0:
            return ao.Impactor(other, speed), speed
        if model.k0 == 0:
            return other, speed  # the structure runs into it
    return ao.RigidMass(model.m_st * 10 ** rng.uniform(-6, 6), speed), speed


def effective_mass(model: ao.AntiOscillators, impactor: Any) -> float:
    if isinstance(impactor, ao.Obstacle):
        return model.m_st
    body = getattr(impactor, "body", impactor)
    mass = body.m_st if isinstance(body, ao.AntiOscillators) else body.mass
    return 1 / (1 / mass + 1 / model.m_st)


def random_law(rng: Rng, k: float, mass: float, speed: float) -> ao.ContactLaw:
    """One of all the laws, its yield or table at about the depth that is reached."""
    depth = (mass * speed**2 / k) ** 0.4 * 10 ** rng.uniform(-2, 1)
    e = float(rng.choice([0.05, 0.5, 0.9, 1.0]))
    x = depth * np.linspace(0, 1, 9)
    force = k * x**1.5
    back = depth * np.linspace(0.3, 1, 6)
    down = force[-1] * np.linspace(0, 1, 6) ** 2
    makers = [
        lambda: ao.Linear(k * np.sqrt(depth)),
        lambda: ao.Power(k * depth ** (1.5 - 2.2), 2.2),
        lambda: ao.Hertz(k),
        lambda: ao.Hertz(k),
        lambda: ao.Hertz(k, compliance=float(0.05 / (k * np.sqrt(depth)))),
        lambda: ao.HuntCrossley(k, e),
        lambda: ao.LankaraniNikravesh(k, e),
        lambda: ao.Flores(k, e),
        lambda: ao.Gonthier(k, e),
        lambda: ao.Thornton(k, depth),
        lambda: ao.Stronge(k, depth),
        lambda: ao.YangSun(k, depth),
        lambda: ao.TanSun(k, depth, slope=0.4),
        lambda: ao.Tabulated(x, force, (back, down)),
        lambda: ao.Tabulated(x, force),
    ]
    return makers[rng.integers(len(makers))]()


def report(result: dict[str, Any]) -> None:
    for name, count in result["counts"].items():
        print(f"{name:<28}{count:>8}")
    print(f"{'worst momentum error':<28}{result['momentum']:>8.1e}")
    print(f"{'slowest scene':<28}{result['slowest']:>7.2f} s")
    print(f"{'all':<28}{result['seconds']:>7.1f} s")
    for failure in result["failures"][:20]:
        print(failure)
    print(f"{len(result['failures'])} failures in {result['scenes']} scenes")


def command(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--scenes", type=options.count, default=10_000)
    parser.add_argument("--seed", type=options.seed, default=1)
    parser.add_argument("--budget", type=options.positive, default=60.0)
    result = options.run(parser, main, arguments)
    report(result)
    return 1 if result["failures"] else 0


if __name__ == "__main__":
    raise SystemExit(command())
