"""The truncation estimate against the truth, and the choice of N."""

from __future__ import annotations

import functools
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

import antiosc as ao
import parts
from antiosc.fem.linalg.petsc_algebra import csr
from antiosc.impact import truncation
from antiosc.impact.truncation import (
    choose_n,
    softest_model,
    truncation_error,
)
from scenes import BEAM, HERTZ, case_two
from struck_beams import cantilever, free_free, pinned_free, pinned_pinned

QUANTITIES = ("peak_force", "impulse", "contact_time")


@functools.cache
def whole_models() -> list[ao.AntiOscillators]:
    """Models with so many anti-oscillators that they stand for the truth, of several kinds."""
    beams = (pinned_pinned(BEAM), pinned_free(BEAM), cantilever(BEAM), free_free(BEAM, 0.3))
    models = [each.anti_oscillators(80) for each in beams]
    rng = np.random.default_rng(1)
    i = np.arange(1.0, 200.0)
    for spread, fall in ((1.0, 1.3), (1.0, 2.0), (1.5, 1.5)):  # plate- and solid-like densities
        m = i**-fall * rng.uniform(0.5, 1.5, i.size)
        omega = np.sort(2e3 * i**spread * (1 + 0.2 * rng.uniform(-1, 1, i.size) / i))
        models.append(ao.AntiOscillators(m0=0.0, k0=3e4, m=0.3 * m / m.sum(), omega=omega))
    return models


def struck(striker: ao.RigidMass, law: ao.ContactLaw, duration: float):
    """The impact as a function of the model."""
    return lambda model, tol: ao.simulate(model, striker, law, duration, tol=tol)


def compare(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """True and estimated relative errors of one random scene."""
    models = whole_models()
    whole = models[rng.integers(len(models))]
    striker = ao.RigidMass(whole.m_st * 10 ** rng.uniform(-2, 1), 10 ** rng.uniform(-2, 1))
    law = ao.Hertz(10 ** rng.uniform(7, 10))
    n = int(2 ** rng.uniform(1, 5.5))
    duration = (2.5 if whole.k0 else 1.5) * np.pi / whole.omega[0]
    short = whole.truncated(n)
    run = struck(striker, law, duration)
    estimate = truncation_error(short, run)
    hits = [run(m, 1e-4) for m in (short, whole)]
    true = [abs(getattr(hits[0], q) / getattr(hits[1], q) - 1) for q in QUANTITIES]
    return np.array(true), np.array([getattr(estimate, q) for q in QUANTITIES])


def coverage(scenes: int, compare=compare) -> tuple[np.ndarray, np.ndarray]:
    """Share of scenes whose true error lies under the estimate, and the median over-estimation."""
    rng = np.random.default_rng(7)
    pairs = np.array([compare(rng) for _ in range(scenes)])
    true, estimate = pairs[:, 0], pairs[:, 1]
    share, factor = np.empty(3), np.empty(3)
    for j in range(3):
        seen = true[:, j] > 5e-4  # above what time integration leaves
        share[j] = np.mean(estimate[seen, j] >= true[seen, j])
        factor[j] = np.median(estimate[seen, j] / true[seen, j])
    return share, factor


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning")
def test_estimate_covers_the_truth_in_random_scenes():
    share, factor = coverage(130)
    print("share under the estimate", share, "median over-estimation", factor)
    assert share.min() >= 0.9
    assert factor.max() < 15


@pytest.mark.slow
def test_choice_is_the_smallest_that_meets_the_tolerance():
    model, striker = case_two(60)
    run = struck(striker, ao.Hertz(HERTZ), 8e-3)
    choice = choose_n(model, run, tol=0.03)
    assert choice.worst <= 0.03
    assert 1 < choice.n < 60
    # one less is not enough, and the answer is right
    below, short, whole = (run(model.truncated(n), 1e-3) for n in (choice.n - 1, choice.n, 60))
    changed = max(abs(getattr(below, q) / getattr(whole, q) - 1) for q in QUANTITIES)
    assert changed + truncation_error(model, run).worst > 0.03 - 2e-3
    for quantity in QUANTITIES:
        assert getattr(short, quantity) == pytest.approx(getattr(whole, quantity), rel=0.03)


@pytest.mark.slow
def test_simulate_chooses():
    model, striker = case_two(40)
    hit = ao.simulate(model, striker, ao.Hertz(HERTZ), 8e-3, n="auto", tol=0.05)
    assert hit.model.n < 40
    assert hit.status == 0
    assert max(hit.error.values()) <= 0.05
    assert set(hit.error) == {"force", "peak", *(f"truncation {q}" for q in QUANTITIES)}


@pytest.mark.slow
def test_the_hung_model_keeps_the_dampers():
    """A chain with a dashpot: given back by what was truncated, and its impact by n = "auto"."""
    full = ao.AntiOscillators(
        m0=0.0, k0=1e6, m=[0.2, 0.1, 0.05], omega=[3e3, 9e3, 2e4],
        damping=ao.DampingMatrix(np.diag([0.0, 30.0, 20.0, 0.0]) + 10.0 * np.diag([1, 1, 1, 0])),
    )  # fmt: skip
    again = truncation.softest_model(full.truncated(2))
    np.testing.assert_allclose(again.damping.matrix, full.damping.matrix, atol=1e-12)
    n, k = 30, 4e6
    K = 2 * k * np.eye(n) - k * np.eye(n, k=1) - k * np.eye(n, k=-1)
    C = np.zeros((n, n))
    C[9, 9] = C[20, 20] = 80.0
    chain = ao.Structure.from_matrices(K, 0.02 * np.eye(n), C=C)
    models = {count: ao.extract(chain, ao.Site(dof=20), n=count) for count in (20, 29)}
    striker, law = ao.RigidMass(0.1, 1.0), ao.Hertz(1e8)
    truth = ao.simulate(models[29], striker, law, 5e-3, tol=1e-6)
    chosen = ao.simulate(models[20], striker, law, 5e-3, tol=0.1, n="auto")
    assert chosen.peak_force == pytest.approx(truth.peak_force, rel=0.1)


@functools.cache
def rod(method: str, n: int) -> ao.AntiOscillators:
    """A free rod of steel, 25.4 mm thick and 254 mm long, struck at its end."""
    steel = ao.Beam(200e9, 0.3, 7850.0, ao.Section.circle(25.4e-3))
    part = ao.Structure(parts.line(0.254, 100), steel)
    return ao.extract(part, ao.Site((0, 0, 0), (1, 0, 0)), n=n, method=method, error="estimate")


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("stiffness", [1e10, 1e11])
@pytest.mark.parametrize("n", [20, 80])
@pytest.mark.parametrize("method", ["krylov", "modes"])
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning")
def test_the_bar_of_a_rod_on_a_stiff_stop_holds_the_force_of_the_wave(method, n, stiffness):
    """Waves: rho c A v (1 - exp(-K t/(rho c A))) up to t = 2 L/c, whatever mass is at the site."""
    E, rho, diameter, length, v = 200e9, 7850.0, 25.4e-3, 0.254, 4.43
    area, c = np.pi * diameter**2 / 4, np.sqrt(E / rho)
    impedance = rho * c * area
    wave = impedance * v * (1 - np.exp(-stiffness * 2 * length / c / impedance))
    hit = ao.simulate(
        rod(method, n), ao.Obstacle(), ao.Linear(stiffness), 3e-4, initial_velocity=v, tol=1e-3
    )
    bar = hit.error_budget["peak_force"]
    assert abs(wave / hit.peak_force - 1) <= bar.total


def thin_plate(n: int = 31) -> ao.Structure:
    """Differences of a square plate of aluminium, 0.2 m and 2 mm thick, held along its edges."""
    h, bending, mass = 0.2 / (n + 1), 70e9 * 2e-3**3 / (12 * 0.91), 2700.0 * 2e-3
    line = sparse.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n))
    eye = sparse.identity(n)
    laplacian = sparse.kron(line, eye) + sparse.kron(eye, line)
    K = bending / h**2 * laplacian.T @ laplacian
    return ao.Structure.from_matrices(K.tocsr(), (mass * h**2 * sparse.identity(n * n)).tocsr())


SITE = ao.Site(dof=15 * 31 + 15)
#: Frequency of an expansion point [Hz].
POINT = 4e3


def receptance(part: ao.Structure, s: float) -> float:
    """Displacement of the site under a unit force as e^(st), by a direct solve."""
    K, M = csr(part.K), csr(part.M)
    force = np.zeros(K.shape[0])
    force[SITE.dof] = 1.0
    return float(spsolve((K + s**2 * M).tocsc(), force)[SITE.dof])


def of_model(model: ao.AntiOscillators, s: float) -> float:
    """The same of a model."""
    springs = model.m * s**2 / (1 + (s / model.omega) ** 2)
    return float(1 / (model.k0 + model.m0 * s**2 + springs.sum()))


def test_a_model_is_exact_at_its_expansion_point_and_at_rest():
    part, s = thin_plate(), 2 * np.pi * POINT
    exact = receptance(part, s)
    static = ao.extract(part, SITE, n=3)
    assert abs(of_model(static, s) / exact - 1) > 0.01
    for n in (1, 3, 8):
        model = ao.extract(part, SITE, n=n, expansion=POINT)
        assert of_model(model, s) == pytest.approx(exact, rel=1e-9)
        assert 1 / model.k0 == pytest.approx(receptance(part, 0.0), rel=1e-9)
        assert model.m_st == pytest.approx(static.m_st, rel=1e-9)
        assert model.m0 > 0
        assert (model.m > 0).all()
        assert model.info["expansion"] == POINT


@pytest.mark.slow
def test_a_blow_that_is_over_before_its_waves_return_needs_fewer_about_its_contact_time():
    """Against all anti-oscillators that the site sees; the static ones are far off."""
    part = thin_plate(41)
    site = ao.Site(dof=20 * 41 + 20)
    ball, law = ao.RigidMass(3e-4, 1.0), ao.Hertz(2e10)
    every = ao.simulate(ao.extract(part, site, n=90), ball, law, 5e-5).peak_force
    forces = [
        ao.simulate(ao.extract(part, site, n=12, expansion=point), ball, law, 5e-5).peak_force
        for point in (None, 4 * POINT)
    ]
    assert abs(forces[0] / every - 1) > 0.1
    assert forces[1] == pytest.approx(every, rel=0.01)


@pytest.mark.parametrize("point", [None, POINT])
def test_the_softest_model_has_the_moments_of_the_model(point):
    """Both receptances agree at the expansion point, and differ elsewhere."""
    model = ao.extract(thin_plate(), SITE, n=4, expansion=point)
    softest = softest_model(model)
    s = 2 * np.pi * (point or 0.0)
    assert of_complex(softest, s) == pytest.approx(of_complex(model, s), rel=1e-9)
    assert abs(of_complex(softest, 2e5j) / of_complex(model, 2e5j) - 1) > 1e-3


def of_complex(model: ao.AntiOscillators, s: complex) -> complex:
    """The receptance of a model at a complex s."""
    springs = model.m * s**2 / (1 + (s / model.omega) ** 2)
    return complex(1 / (model.k0 + model.m0 * s**2 + springs.sum()))


def test_an_expansion_point_is_one_of_a_krylov_space():
    with pytest.raises(ao.InputError, match="krylov"):
        ao.extract(thin_plate(), SITE, n=3, method="modes", expansion=POINT)
    with pytest.raises(ao.InputError, match="expansion"):
        ao.extract(thin_plate(), SITE, n=3, expansion=-1.0)


@pytest.mark.slow
def test_two_sites_are_checked_as_one_is() -> None:
    """Too few anti-oscillators of a thin plate are told, and are wrong; enough are not."""
    part, sites = thin_plate(), {"a": ao.Site(dof=15 * 31 + 15), "b": ao.Site(dof=8 * 31 + 20)}
    ball, law = ao.RigidMass(0.004, 1.0), ao.Hertz(5e9)
    peaks, told = [], []
    for n in (16, 120):
        model = ao.extract(part, sites, n=n)
        scene = ao.Scene({"plate": model, "ball": ball}, [ao.Contact("plate:a", "ball", law)])
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            peaks.append(scene.run(3e-4).peak_force)
        told.append(any("too few" in str(one.message) for one in caught))
    assert told == [True, False]
    assert peaks[0] > 1.05 * peaks[1]


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.filterwarnings("ignore::antiosc.base.errors.AccuracyWarning")
def test_a_scene_of_more_sites_than_anti_oscillators_runs(n) -> None:
    """As the scene with the other sites left alone: they carry no force."""
    part = thin_plate()
    sites = {name: ao.Site(dof=k) for name, k in (("a", 480), ("b", 268), ("c", 100))}
    model = ao.extract(part, sites, n=n)
    ball = ao.RigidMass(0.004, 1.0)
    scene = ao.Scene({"plate": model, "ball": ball}, [ao.Contact("plate:a", "ball", ao.Hertz(5e9))])
    assert scene.run(1e-4)["plate:a", "ball"].peak_force > 0


@pytest.mark.slow
def test_the_warning_and_the_bar_are_one_number() -> None:
    """With an estimate of the mesh and without: above the limit both tell it, below neither."""
    law, ball = ao.Hertz(5e9), ao.RigidMass(0.004, 1.0)
    for n, told in ((10, True), (60, False)):
        model = ao.extract(thin_plate(), SITE, n=n)
        estimated = replace(model, strain_error=np.zeros((model.n + 1, model.n + 1)))
        for each in (model, estimated):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                hit = ao.simulate(each, ball, law, 3e-4)
            assert any("too few" in str(one.message) for one in caught) is told
            assert (truncation_error(each, hit.rerun).peak_force > 0.3) is told
