"""Gradients of random impacts against differences of an independent integrator, and their cost.

Twenty impacts of a model on a mass by Hertz's law, a spring or Flores' law, with one touch or
several, some under a pull: every number of the impact, by four goals. The integrator is SciPy's
DOP853 on the article's mass matrix with the law's formula (tests/support/gradient_scenes.py).

    make bench-gradients
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np

import antiosc as ao

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from gradient_scenes import rows

#: Largest error of a derivative, over the goal by the number.
BOUND = 1e-5


def main(impacts: int = 20) -> None:
    warnings.simplefilter("ignore")
    held = 0
    worst = 0.0
    for seed in range(impacts):
        found = rows(seed)
        errors, bars = (np.array([row[i] for row in found]) for i in (2, 3))
        holds = bool(np.all(errors <= bars + 2e-8))
        held += holds
        worst = max(worst, errors.max())
        goal, name, error, bar = found[int(np.argmax(errors))]
        worst_text = f"worst {error:.1e} ({goal} by {name}), bar {bar:.1e}"
        print(f"{seed:2} {len(found)} derivatives, {worst_text}, all hold: {holds}", flush=True)
    print(f"worst {worst:.1e} of the goal by the number; the bars hold in {held} of {impacts}")
    assert held == impacts, "a bar does not hold"
    assert worst <= BOUND, f"the worst error exceeds {BOUND:g}"

    rng = np.random.default_rng(0)
    m, omega = rng.uniform(5e-3, 5e-2, 40), np.sort(10 ** rng.uniform(3.3, 5.3, 40))
    model = ao.AntiOscillators(m0=0.02, k0=1e6, m=m, omega=omega)
    hit = ao.simulate(model, ao.RigidMass(0.2, 1.0), ao.Hertz(1e9), 2e-3)
    for goal in ("peak_force", "impulse"):
        begun = time.process_time()
        ao.gradient(hit, goal)
        print(f"{goal} by 87 numbers: {time.process_time() - begun:.2f} s of CPU")


if __name__ == "__main__":
    main()
