"""The error budget of a run, and its estimated errors against the true ones of random scenes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import antiosc as ao
from antiosc.base.texts import engineering
from antiosc.engine.march import difference
from antiosc.impact import error_budget
from antiosc.impact.error_budget import (
    COARSE_SAFETY,
    RESOLVED_FACE_RATIO,
    SAFETY,
)
from antiosc.impact.histories import bars
from antiosc.impact.histories.bars import (
    CAUSES,
    MIN_ERROR_SHARE,
    QUANTITIES,
    UNCERTAIN_CONTACTS_TEXT,
    relative_differences,
)
from antiosc.models.body import ModalModel, ModelInfo
from antiosc_app.headline import force_bar

STRIKER, LAW = ao.RigidMass(0.5, 1.0), ao.Hertz(1e9)


def model(share: float = 0.02, **more) -> ao.AntiOscillators:
    """A model whose strains hold errors of this share of the energy of each shape."""
    m, omega = np.array([0.5, 0.3, 0.2, 0.1]), np.array([4e3, 1.1e4, 2.2e4, 3.7e4])
    E = share * np.diag(np.append(2e6, m * omega**2))
    return ao.AntiOscillators(m0=0.05, k0=2e6, m=m, omega=omega, strain_error=E, **more)


def struck(given: ao.AntiOscillators, **options) -> ao.History:
    return ao.simulate(given, STRIKER, LAW, 3e-3, **options)


def test_bars_hold_the_difference_to_the_corrected_model():
    hit = struck(model())
    budget = hit.error_budget
    soft = struck(model().corrected(), tol=1e-4)
    off = relative_differences(struck(model(), tol=1e-4), soft)
    assert set(budget) == set(QUANTITIES)
    for name, bar in budget.items():
        expected = SAFETY * max(off[name], MIN_ERROR_SHARE * max(off.values()))
        assert bar.mesh == pytest.approx(expected, rel=0.05)
        assert bar.total == pytest.approx(sum(getattr(bar, cause) for cause in CAUSES))
        assert bar.value == getattr(hit, name)
        assert bar.time > 0
        assert bar.patch == 0
    assert budget.worst == max(bar.total for bar in budget.values())
    assert budget.energy_error == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize("faces", [3e-3, 6e-3])
def test_faces_above_the_patch_widen_the_bars_by_their_size(faces):
    facts = ({}, {"patch": {"faces": faces}})
    usual, wide = (struck(model(radius=2e-3, info=f)).error_budget for f in facts)
    ratio = wide["peak_force"].mesh / usual["peak_force"].mesh
    assert ratio == pytest.approx(
        COARSE_SAFETY / SAFETY * faces / (RESOLVED_FACE_RATIO * 2e-3), rel=1e-6
    )
    assert len(wide.notes) == len(usual.notes) + 1


@pytest.mark.parametrize("change", [-5e-10, -2e-8])
def test_bars_hold_what_a_patch_changes_even_where_it_exceeds_the_half_space(change):
    facts = {"patch": {"faces": 1e-3, "radius": 3e-3, "compliance": change}}
    body = model(radius=2e-3, local_compliance=1e-9, info=facts)
    hit = struck(body)
    modes = body.modal()
    softer = ModalModel(replace(modes, r=modes.r + abs(change)), body.local_compliance)
    off = relative_differences(hit, struck(softer))
    for name, bar in hit.error_budget.items():
        assert 0.8 * off[name] < bar.patch < 1.5 * max(off.values())
    assert hit.error_budget["peak_force"].patch > (0.05 if change == -2e-8 else 0.0)


@pytest.mark.parametrize("share", [0.02, 0.12])
def test_bars_of_the_corrected_run_are_nearer_by_the_correction(share):
    budget = struck(model(share)).error_budget
    soft = struck(model(share).corrected())
    assert budget.safety == (SAFETY if share < 0.1 else COARSE_SAFETY)
    nearer = budget.of_corrected(soft)
    for name, bar in nearer.items():
        raw = budget[name]
        assert bar.value == getattr(soft, name)
        assert bar.mesh == pytest.approx(raw.mesh - raw.mesh / budget.safety)
        assert (bar.truncation, bar.time) == (raw.truncation, raw.time)


@pytest.mark.parametrize("options", [{"step": 2e-5}, {"step": 1e-6, "method": "newmark"}])
def test_a_given_step_is_compared_with_an_exact_run(options):
    hit = struck(model(), **options)
    exact = struck(model(), tol=1e-6)
    for name, bar in hit.error_budget.items():
        off = abs(getattr(hit, name) / getattr(exact, name) - 1)
        assert off <= bar.time <= 2 * off + 1e-3


def test_runs_of_other_numbers_of_contacts_leave_the_contact_time_without_a_bar(monkeypatch):
    corrected = ao.AntiOscillators.corrected
    harder = lambda one: replace(corrected(one), k0=40 * one.k0, strain_error=None)  # noqa: E731
    monkeypatch.setattr(ao.AntiOscillators, "corrected", harder)
    hit = ao.simulate(model(), ao.RigidMass(5.0, 1.0), LAW, 0.05)
    budget = hit.error_budget
    assert len(hit.contacts) != len(
        ao.simulate(harder(model()), ao.RigidMass(5.0, 1.0), LAW, 0.05).contacts
    )
    assert "contact_time" in budget.unknown
    assert "not comparable" in budget.notes[0]
    assert "±" not in budget.shown("contact_time")
    assert f"{budget.shown('contact_time')}: {UNCERTAIN_CONTACTS_TEXT}" in str(budget)
    assert set(budget.shares("contact_time").values()) == {None}
    assert "±" in budget.shown("peak_force")


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_no_bar_goes_beyond_what_momentum_and_energy_allow(gravity):
    """The impulse of a striker on a part at rest lies between m v and 2 m v."""
    hit = struck(model(), gravity=gravity)
    budget = hit.error_budget
    wide = {name: replace(bar, mesh=4.3) for name, bar in budget.items()}
    budget = replace(budget, bars=wide)
    total = budget["impulse"].total
    assert budget.sides("peak_force") == (1.0, budget["peak_force"].total)
    most = engineering((1 + budget["peak_force"].total) * hit.peak_force, "N", 2)
    assert budget.shown("peak_force").endswith(f"N, at most {most} (law as given)")
    if gravity:
        assert budget.sides("impulse") == (1.0, total)
        assert budget.restitution_sides is None
        return
    momentum = STRIKER.mass * STRIKER.velocity
    shares = budget.shares("impulse")
    assert hit.impulse * (1 - shares["below"]) == pytest.approx(momentum, rel=1e-6)
    assert hit.impulse * (1 + shares["above"]) == pytest.approx(2 * momentum, rel=1e-6)
    assert shares["total"] == total  # of the causes
    below, above = budget.restitution_sides
    assert hit.restitution - below == pytest.approx(0, abs=1e-5)
    assert hit.restitution + above == pytest.approx(1, abs=1e-5)
    assert f"restitution {hit.restitution:.3f} +" in str(budget)
    assert budget.of_corrected(hit).restitution_sides == pytest.approx((below, above))


def test_the_impulse_of_a_free_part_is_that_of_its_restitution():
    free = replace(model(1e-3), k0=0.0, strain_error=None)
    hit = ao.simulate(free, STRIKER, LAW, 3e-3)
    part = free.m_st if free.k0 else free.m0 + free.m.sum()
    momentum = STRIKER.velocity / (1 / STRIKER.mass + 1 / part)
    e = error_budget.restitution_of(hit)
    assert hit.impulse == pytest.approx(momentum * (1 + e), rel=1e-4)
    moving = ao.simulate(free, STRIKER, LAW, 3e-3, initial_velocity=0.5)
    assert error_budget.restitution_of(moving) is None


def test_a_part_whose_mesh_has_no_estimator_has_the_shares_that_are_known():
    """As a deck with ties: truncation, time and law, with a sentence on what is left out."""
    whole = replace(model(), strain_error=None, info=ModelInfo(no_estimate="it is an assembly"))
    few = whole.truncated(2)
    hit = struck(few)
    budget = hit.error_budget
    off = relative_differences(struck(few, tol=1e-5), struck(whole, tol=1e-5))
    for name in QUANTITIES:
        assert 0 < off[name] < budget[name].truncation < budget[name].known
        assert budget[name].mesh == 0
        assert budget.shares(name)["mesh"] is None
        assert budget.shown(name).endswith(" (no error bar)")
        assert budget.shares(name)["total"] is budget.shares(name)["above"] is None
    assert "mesh" not in budget.causes
    assert budget.unknown["mesh"].endswith("it is an assembly")
    assert str(budget).count("mesh's error") == 1
    assert force_bar(budget) is None  # a stress counts with all of the force's error, or none
    assert (
        hit.summary().splitlines()[1].endswith(f"There is no error bar. {budget.unknown['mesh']}")
    )
    assert "±" not in str(budget) + hit.summary()
    unasked = struck(replace(whole, info=ModelInfo())).error_budget
    assert "'estimate'" in unasked.unknown["mesh"]
    assert unasked["peak_force"].time > 0


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
        lambda: ao.YangSun(K, yields),
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
    if law.has_memory or (law.rate_dependent and model.m0 == 0):
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
    seeds = (22, 23, 25, *range(27, 32), 34, 36, 39, 40)  # references take 0.7 s at most
    found = {(s, tol): errors(s, tol) for s in seeds for tol in (1e-2, 1e-3)}
    kept = {key: pair for key, pair in found.items() if pair is not None}
    assert len({s for s, _ in kept}) >= 10
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


@pytest.mark.parametrize("scale", [1.0, 0.1, 0.0])
def test_told_shares_add_up_to_the_bar_and_small_ones_are_one_share(scale):
    shares = {"mesh": 0.06, "truncation": 0.05, "time": 1e-3, "patch": 3e-3, "law": 0.09}
    bar = bars.ErrorBar(1.0, **{name: scale * share for name, share in shares.items()})
    told = bars.ErrorBudget({"peak_force": bar}, 0.0).causes_text("peak_force")
    parts = dict(part.rsplit(" ", 2)[:2] for part in told.split(", "))
    assert sum(map(float, parts.values())) == pytest.approx(100 * bar.known, rel=0.01)
    if scale:
        assert list(parts) == ["mesh", "truncation", "law", "others"]
