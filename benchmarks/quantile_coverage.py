"""Quantiles of Monte Carlo studies: how often brute force lies within their bars.

Two kinds of random impacts: of a mass on a rigid wall, whose peak force has a closed form (Hertz:
F = (5/4)^(3/5) K^(2/5) m^(3/5) v^(6/5)), so that brute force costs nothing; and
on pinned beams, with sub-impacts, where brute force integrates every run.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/quantile_coverage.py
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import antiosc as ao
from antiosc import closed_form

WALL = ao.AntiOscillators(m0=1e6, k0=0.0, m=[], omega=[])
QUANTILES = (0.05, 0.5, 0.95)
#: Seed of brute force, which no study has.
OTHER = 10**6


def main(
    walls: int = 80,
    beams: int = 20,
    runs: int = 400,
    brute: int = 100_000,
    brute_beam: int = 20_000,
) -> dict[str, float]:
    """Shares of quantiles whose bar holds that of brute force, printed and returned."""
    began = time.perf_counter()
    found = {}
    for name, count, scene in (("wall", walls, _wall), ("beam", beams, _beam)):
        inside = []
        for seed in range(count):
            rng = np.random.default_rng([seed, len(name)])
            inputs, run = scene(rng)
            many = ao.monte_carlo(run, inputs, runs, seed=seed)
            if name == "wall":
                drawn = {key: law.rvs(brute, random_state=rng) for key, law in inputs.items()}
                force = peak(**drawn)
            else:
                whole = ao.monte_carlo(run, inputs, brute_beam, seed=OTHER + seed)
                force = whole.finite("peak_force")
            for q in QUANTILES:
                bar = many.quantile("peak_force", q)
                inside.append(bar.low <= np.quantile(force, q) <= bar.high)
        found[name] = float(np.mean(inside))
        print(f"{name}: {sum(inside)} of {len(inside)} bars of 95 % hold ({found[name]:.1%})")
    print(f"{time.perf_counter() - began:.0f} s")
    return found


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
