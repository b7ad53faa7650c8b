"""Quantiles and indices of Monte Carlo studies: how often the truth lies within their bars.

Quantiles, against brute force of two kinds of random impacts: of a mass on a rigid wall, whose peak
force has a closed form (Hertz: F = (5/4)^(3/5) K^(2/5) m^(3/5) v^(6/5)), so that brute force costs
nothing; and on pinned beams, with sub-impacts, where brute force integrates every run. A bar
between order statistics holds a little more often than asked for: how often follows from the
binomial distribution, and is told beside.

Sobol's indices, against those of T. Ishigami, T. Homma, Proc. ISUMA (1990) 398, in closed form.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/quantile_coverage.py
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy.stats import binom

import antiosc as ao
from antiosc import closed_form

WALL = ao.AntiOscillators(m0=1e6, k0=0.0, m=[], omega=[])
QUANTILES = (0.05, 0.5, 0.95)
#: Seed of brute force, which no study has.
OTHER = 10**6


def main(
    walls: int = 480,
    beams: int = 20,
    runs: int = 400,
    brute: int = 100_000,
    studies: int = 200,
) -> dict[str, float]:
    """Shares of bars that hold the truth, printed and returned."""
    began = time.process_time()
    found = {}
    expected = np.mean([_expected(runs, q) for q in QUANTILES])
    for name, count, scene in (("wall", walls, _wall), ("beam", beams, _beam)):
        inside, below = [], 0
        for seed in range(count):
            rng = np.random.default_rng([seed, len(name)])
            inputs, run = scene(rng)
            many = ao.monte_carlo(run, inputs, runs, seed=seed)
            if name == "wall":
                drawn = {key: law.rvs(brute, random_state=rng) for key, law in inputs.items()}
                force = peak(**drawn)
            else:
                whole = ao.monte_carlo(run, inputs, brute, seed=OTHER + seed)
                force = whole.finite("peak_force")
            for q in QUANTILES:
                bar = many.quantile("peak_force", q)
                true = np.quantile(force, q)
                inside.append(bool(bar.low <= true <= bar.high))
                below += true < bar.low
        found[name] = float(np.mean(inside))
        print(
            f"{name}: {sum(inside)} of {len(inside)} bars of 95 % hold ({found[name]:.1%}, expected"
            f" {expected:.1%}); the truth is below {below}, above {inside.count(False) - below}"
        )
    found["index"] = _indices(studies)
    print(f"{time.process_time() - began:.0f} s of CPU")
    return found


def _expected(n: int, q: float) -> float:
    """How often the quantile lies between the order statistics of the bar of 95 %."""
    low, high = binom.ppf([0.025, 0.975], n, q)
    return float(binom.cdf(high, n, q) - binom.cdf(low - 1, n, q))


def _indices(studies: int, n: int = 1000, a: float = 7.0, b: float = 0.1) -> float:
    """Share of the bars of Sobol's indices that hold those of the closed form, printed."""
    angle = ao.uniform(-np.pi, np.pi)
    variance = a**2 / 8 + b * np.pi**4 / 5 + b**2 * np.pi**8 / 18 + 0.5
    true = np.array([0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, 0.0]) / variance

    def ishigami(x: float, y: float, z: float) -> float:
        return float(np.sin(x) + a * np.sin(y) ** 2 + b * z**4 * np.sin(x))

    off, inside = [], []
    for seed in range(studies):
        many = ao.monte_carlo(ishigami, dict.fromkeys("xyz", angle), n, seed=seed)
        shares = many.sensitivity("value")
        off.append(shares.first - true)
        inside.append((shares.bars[:, 0] <= true) & (true <= shares.bars[:, 1]))
    print(
        f"indices of {n} runs: off by {np.mean(off, axis=0).round(4)} in the mean, by"
        f" {np.std(off, axis=0).round(4)} at random; {np.sum(inside)} of {np.size(inside)} bars of"
        f" 95 % hold ({np.mean(inside):.1%}; {np.mean(inside, axis=0)})"
    )
    return float(np.mean(inside))


def peak(mass: Any, velocity: Any, stiffness: Any) -> Any:
    """The peak force of a mass on a rigid wall."""
    return 1.25**0.6 * stiffness**0.4 * mass**0.6 * velocity**1.2


def _inputs(rng: np.random.Generator) -> dict[str, Any]:
    """Random distributions of mass, velocity and stiffness."""
    low = rng.uniform(1.0, 2.0)
    return {
        "mass": ao.lognormal(rng.uniform(0.02, 0.1), rng.uniform(0.02, 0.2)),
        "velocity": ao.uniform(low, low * rng.uniform(1.1, 2.0)),
        "stiffness": ao.lognormal(10 ** rng.uniform(8.0, 9.0), rng.uniform(0.05, 0.5)),
    }


def _wall(rng: np.random.Generator) -> tuple[dict[str, Any], Any]:
    def run(mass: float, velocity: float, stiffness: float) -> tuple[Any, ...]:
        duration = 10 * (mass / stiffness / velocity**0.5) ** 0.4
        return WALL, ao.RigidMass(mass, velocity), ao.Hertz(stiffness), duration

    return _inputs(rng), run


def _beam(rng: np.random.Generator) -> tuple[dict[str, Any], Any]:
    beam = closed_form.UniformBeam.timoshenko(
        E=70e9, nu=0.33, rho=2700.0, area=2e-4, inertia=1.7e-9, length=rng.uniform(0.1, 0.4)
    )
    model = closed_form.pinned_pinned(beam).anti_oscillators(int(rng.integers(4, 12)))

    def run(mass: float, velocity: float, stiffness: float) -> tuple[Any, ...]:
        return model, ao.RigidMass(mass, velocity), ao.Hertz(stiffness), 2e-3

    return _inputs(rng), run


if __name__ == "__main__":
    main()
