"""The estimated errors of a run against the true ones, in random scenes under every contact law."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import antiosc as ao
from antiosc.simulation.march.convergence import difference
from antiosc.simulation.reference import Refinement


def law_of(rng: np.random.Generator, kind: int, energy: float) -> ao.ContactLaw:
    """A law of that kind with random numbers, for an impact of this energy [J]."""
    K = 10 ** rng.uniform(7, 10)
    depth = (2.5 * energy / K) ** 0.4
    e, yields = rng.uniform(0.3, 0.95), depth * 10 ** rng.uniform(-1.5, 0)
    grid = np.linspace(0, 4, 9)
    return [
        lambda: ao.Hertz(K),
        lambda: ao.Linear(10 ** rng.uniform(4, 8)),
        lambda: ao.Power(K, rng.uniform(1.1, 2.2)),
        lambda: ao.HuntCrossley(K, e),
        lambda: ao.Flores(K, e),
        lambda: ao.LankaraniNikravesh(K, e),
        lambda: ao.Gonthier(K, e),
        lambda: ao.Thornton(K, yields),
        lambda: ao.Stronge(K, yields),
        lambda: ao.Tabulated(depth * grid, K * depth**1.5 * grid * (1 + grid)),
    ][kind]()


KINDS = 10


def scene_of(seed: int) -> tuple[ao.AntiOscillators, ao.RigidMass, ao.ContactLaw, float]:
    """A model, what strikes it, the law, and a duration of some contact times."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(0, 12))
    model = ao.AntiOscillators(
        m0=0.0 if n and rng.random() < 0.2 else 10 ** rng.uniform(-3, 0),
        k0=10 ** rng.uniform(4, 7) if rng.random() < 0.6 else 0.0,
        m=10 ** rng.uniform(-2, 0, n),
        omega=np.sort(10 ** rng.uniform(2.5, 5, n)),
        damping=ao.Damping(ratio=rng.uniform(0, 0.05)) if rng.random() < 0.3 else None,
    )
    striker = ao.RigidMass(
        model.m_st * 10 ** rng.uniform(-1.5, 1), velocity=10 ** rng.uniform(-1.5, 1)
    )
    energy = 0.5 * striker.mass * striker.velocity**2
    law = law_of(rng, seed % KINDS, energy)
    time = 3 * (2.5 * energy / 1e8) ** 0.4 / striker.velocity
    slowest = 2 * np.pi / model.omega[0] if n else time
    return model, striker, law, float(np.clip(slowest, 6 * time, 12 * time))


@cache
def independent(seed: int) -> ao.History:
    """The impact by an integrator of another kind, to 1e-6; by a finer step where none can."""
    model, striker, law, duration = scene_of(seed)
    if law.rate_dependent and model.m0 == 0:
        return ao.simulate(model, striker, law, duration, tol=1e-6)
    return ao.simulate(model, striker, law, duration, "DOP853", tol=1e-6)


def errors(seed: int, tol: float) -> tuple[np.ndarray, np.ndarray] | None:
    """(estimated, true) errors of force and peak in one scene; None where no run can be had."""
    scene = scene_of(seed)
    hit, truth = ao.simulate(*scene, tol=tol), independent(seed)
    if not truth.contacts or {hit.status, truth.status} & {1, 2}:
        return None
    l2, peak, _ = difference(hit.run, truth.run, np.inf)
    return np.array([hit.error["force"], hit.error["peak"]]), np.array([l2, peak])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AntioscWarning")
def test_estimates_cover_the_true_errors_of_random_scenes():
    """At least 90 % of the true errors lie under the estimate, and nearly all under the tolerance.

    True errors below 1e-5 are left out, where the reference itself is no better.
    """
    found = {(s, tol): errors(s, tol) for s in range(2 * KINDS, 38) for tol in (1e-2, 1e-3)}
    kept = {key: pair for key, pair in found.items() if pair is not None}
    assert len({s for s, _ in kept}) >= 14
    assert {s % KINDS for s, _ in kept} == set(range(KINDS))
    estimated, true = (np.array([pair[i] for pair in kept.values()]) for i in (0, 1))
    tol = np.array([key[1] for key in kept])
    share, factor = {}, {}
    for j, name in enumerate(("force", "peak")):
        seen = true[:, j] > 1e-5
        share[name] = np.mean(estimated[seen, j] >= true[seen, j])
        factor[name] = np.median(estimated[seen, j] / true[seen, j])
    print(f"{len(kept)} runs: under the estimate {share}, over-estimation {factor}")
    assert min(share.values()) >= 0.9
    assert factor["force"] < 4
    assert factor["peak"] < 20
    assert np.mean(np.all(true <= tol[:, None], axis=1)) > 0.9


def test_a_peak_that_two_runs_share_by_chance_is_not_taken_for_exact():
    control = Refinement(0.5)
    control.update(0.1, 0.05)
    control.update(0.03, 0.0)
    assert control.error["peak"] == control.error["force"] > 0.01
