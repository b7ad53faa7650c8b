"""Models from measured frequency responses: the same parameters, passive, with bars."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
from antiosc.models.body import ModelInfo
from antiosc_studies.measured import anti_oscillators
from antiosc_studies.measured.frf import FittedModes, TailModes

F = np.linspace(8.0, 4000.0, 500)
W = 2 * np.pi * F
#: A supported part: modes in the band, some above it.
OMEGA = 2 * np.pi * np.array([300.0, 900.0, 1900.0, 3100.0, 4900.0, 7000.0])
B = np.array([[1.0, 0.5], [0.8, -0.7], [1.1, 0.6], [0.6, -0.9], [0.9, 0.4], [0.7, 0.6]])
ZETA = np.array([0.01, 0.008, 0.012, 0.006, 0.01, 0.01])


def part(free: bool = False, hysteretic: bool = False) -> ao.SiteModes | object:
    """Receptances (W, 2, 2) of the part."""
    x = OMEGA**2 * (1 + 2j * ZETA) if hysteretic else OMEGA**2 + 2j * ZETA * OMEGA * W[:, None]
    D = 1 / (x - W[:, None] ** 2)
    H = np.einsum("wj,jm,jn->wmn", D, B, B) + 1e-9 * np.eye(2)
    return H - np.array([[1.0, 0.3], [0.3, 0.5]]) / W[:, None, None] ** 2 if free else H


def noisy(H: np.ndarray, share: float = 0.01) -> np.ndarray:
    random = np.random.default_rng(1)
    return H * (1 + share * (random.standard_normal((*H.shape, 2)) @ [1, 1j]) / np.sqrt(2))


def accelerance(H: np.ndarray) -> np.ndarray:
    return -H * (W**2).reshape(-1, *[1] * (H.ndim - 1))


@pytest.fixture(scope="module")
def model() -> ao.AntiOscillators:
    frf = ao.FRF(F, accelerance(noisy(part()[:, 0, 0])), "accelerance")
    return ao.from_frf(frf, damping="viscous")


@pytest.mark.slow
def test_modes_come_back_and_the_model_has_them(model):
    body = model.modal()
    for omega, b, zeta in zip(OMEGA[:4], B[:4, 0], ZETA[:4], strict=True):
        j = int(np.argmin(np.abs(body.omega - omega)))
        assert body.omega[j] == pytest.approx(omega, rel=1e-3)
        assert abs(body.b[j]) == pytest.approx(abs(b), rel=0.01)
        assert body.decay[j] / body.omega[j] == pytest.approx(zeta, rel=0.05)
    exact = part()[:, 0, 0]
    assert np.median(np.abs(body.receptance(W) / exact - 1)) < 0.003
    assert model.k0 == pytest.approx(1 / (np.sum(B[:, 0] ** 2 / OMEGA**2) + 1e-9), rel=0.01)


@pytest.mark.slow
def test_the_impact_is_that_of_the_part_within_its_bars(model):
    truth = ao.SiteModes(OMEGA, B[:, :1], ["tip"], r=[[1e-9]], decay=ZETA * OMEGA)
    ball, law = ao.RigidMass(0.1, velocity=1.0), ao.Hertz(1e8)
    exact = ao.Scene({"part": truth, "ball": ball}, [ao.Contact("part:tip", "ball", law)])
    true = exact.run(3e-3, tol=1e-5)["part:tip", "ball"]
    hit = ao.simulate(model, ball, law, 3e-3, tol=1e-5)
    budget = hit.error_budget
    assert hit.peak_force == pytest.approx(true.peak_force, rel=0.005)
    for name in ("peak_force", "impulse"):
        bar = budget[name]
        assert abs(getattr(hit, name) / getattr(true, name) - 1) <= bar.total
        assert bar.total == pytest.approx(bar.noise + bar.time)
        assert 0 < bar.noise < 0.02
    assert "noise" in str(budget)


@pytest.mark.slow
def test_without_noise_a_supported_part_is_not_taken_for_a_free_one():
    """Modes above the band bend the receptance by less than any noise; k0 is not 0 for that."""
    random = np.random.default_rng(0)
    omega = 2 * np.pi * 300 * np.arange(1, 9) ** random.uniform(1.2, 2)
    body = ao.ModalBody(omega, random.uniform(0.3, 1.5, 8), decay=0.01 * omega)
    w = 1.2 * omega[1] * np.arange(1, 61) / 60
    frf = ao.FRF(w / (2 * np.pi), body.receptance(w), "receptance")
    found = ao.from_frf(frf, damping="viscous")
    assert found.k0 == pytest.approx(1 / np.sum((body.b / omega) ** 2), rel=1e-3)


@pytest.mark.slow
def test_several_sites_have_modes_of_rank_one():
    values = accelerance(noisy(part(free=True)))
    sites = {"sites": ("tip", "heel")}
    found = ao.from_frf(ao.FRF(F, values, "accelerance", **sites), damping="viscous", free=True)
    assert found.sites == ("tip", "heel")
    H = found.site_modes().receptance(W)
    exact = part(free=True)
    size = np.sqrt(np.abs(exact[:, 0, 0] * exact[:, 1, 1]))
    assert np.median(np.abs(H - exact) / size[:, None, None]) < 0.005
    w = np.geomspace(1.0, 1e7, 300)
    power = (1j * w[:, None, None] * found.site_modes().receptance(w)).real
    assert np.linalg.eigvalsh(power).min() >= -1e-9 * power.max()
    column = ao.FRF(F, values[:, :, :1], "accelerance", **sites, references=("tip",))
    one = ao.from_frf(column, damping="viscous", free=True).site_modes().receptance(W)
    assert np.median(np.abs(one[:, 1, 0] - exact[:, 1, 0]) / size) < 0.005


@pytest.mark.slow
def test_damping_that_is_hysteretic_is_recognised():
    H = noisy(part(hysteretic=True)[:, 0, 0])
    found = ao.from_frf(ao.FRF(F, H, "receptance"))
    assert found.info["damping"] == "hysteretic"
    assert found.damping.ratio[0] == pytest.approx(ZETA[0], rel=0.05)


def test_a_sensors_mass_is_removed_to_rounding():
    H, m = part(), 0.05
    loaded = np.linalg.inv(np.linalg.inv(H) - m * W[:, None, None] ** 2 * np.eye(2))
    frf = ao.FRF(F, loaded, "receptance", sites=("a", "b"))
    assert np.allclose(frf.without_sensor(m).receptance, H, rtol=1e-9)
    single = 1 / (1 / H[:, 0, 0] - m * W**2)
    assert np.allclose(ao.FRF(F, single, "receptance").without_sensor(m).receptance, H[:, 0, 0])
    column = ao.FRF(F, loaded[:, :, :1], "receptance", sites=("a", "b"), references=("a",))
    with pytest.raises(ao.InputError, match="references"):
        column.without_sensor(m)


def test_noise_follows_from_the_coherence():
    """A coherence of one measurement in which noise adds to the response (H1)."""
    frf = ao.FRF(F, part()[:, 0, 0], "receptance", coherence=np.full(F.size, 0.9), averages=10)
    expected = np.sqrt(0.1 / 0.9 / 10) * np.abs(frf.receptance)
    assert np.allclose(frf.receptance_sigma, expected)


@pytest.mark.parametrize(
    "change",
    [
        {"frequency": F[::-1]}, {"values": part()[:10, 0, 0]}, {"quantity": "impedance"},
        {"coherence": np.full(F.size, 1.5)}, {"sigma": np.zeros(F.size)}, {"values": 0 * F},
        {"values": np.full(F.size, np.nan)}, {"sites": ("a", "a")}, {"averages": 0},
    ],
)  # fmt: skip
def test_unsound_measurements_are_refused(change):
    sound = {"frequency": F, "values": part()[:, 0, 0], "quantity": "receptance"}
    with pytest.raises(ao.InputError):
        ao.FRF(**(sound | change))


@pytest.mark.parametrize(
    ("f", "values", "word"),
    [
        (np.arange(1.0, 100_002.0), np.ones(100_001) + 0j, "band"),
        (F, np.abs(part()[:, 0, 0]), "imaginary"),
    ],
)
def test_measurements_that_cannot_be_fitted_are_refused(f, values, word):
    with pytest.raises(ao.InputError, match=word):
        ao.from_frf(ao.FRF(f, values, "receptance"))


def test_what_no_part_can_be_is_refused():
    random = np.random.default_rng(0)
    rubbish = random.standard_normal((F.size, 2)) @ [1, 1j]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        with pytest.raises(ao.AccuracyError, match="passive"):
            ao.from_frf(ao.FRF(F, rubbish, "accelerance"), damping="viscous")


def test_fitted_bodies_become_passive_models():
    """Of one site and of two, supported and free: the model has the receptance of the body."""
    random = np.random.default_rng(0)
    for k in range(24):
        p, J = 1 + k % 2, int(random.integers(1, 12))
        omega = np.sort(10 ** random.uniform(2, 4, J))
        body = FittedModes(
            omega,
            10 ** random.uniform(-2.5, -1, J),
            random.standard_normal((J, p)),
            TailModes(np.zeros(0), np.zeros(0), np.zeros((0, p)), np.zeros(0)),
            np.tril(random.uniform(0.5, 1.0, (p, p))) * 1e-5,
            np.tril(random.uniform(0.5, 1.0, (p, p))) if k % 3 == 0 else None,
        )
        made = anti_oscillators(body, ("a", "b")[:p] if p > 1 else (), ModelInfo())
        modes = made.site_modes() if p > 1 else made.modal()
        w = np.geomspace(1e-2, 100.0, 300) * omega[-1]
        H = modes.receptance(w).reshape(-1, p, p)
        pairs = [(m, n) for m in range(p) for n in range(p)]
        exact = body.receptance(w, pairs).reshape(-1, p, p)
        assert np.abs(H - exact).max() < 1e-5 * np.abs(exact).max()
        power = (1j * w[:, None, None] * H).real
        assert np.linalg.eigvalsh(power).min() >= -1e-12 * np.abs(power).max()


@pytest.mark.slow
def test_a_supported_part_without_modes_above_the_band_is_no_free_one():
    """Two modes, half a per cent of noise: a body of 269 kg on a soft spring fitted its tail."""
    f = np.linspace(5.0, 2000.0, 400)
    iw = 2j * np.pi * f
    part = ao.AntiOscillators(m0=0.02, k0=1e6, m=[0.1], omega=[2000.0], damping=ao.Damping(0.01))
    noise = 0.005 * np.random.default_rng(1).standard_normal((400, 2)) @ [1, 1j]
    H = part.modal().receptance(iw.imag) * iw**2 * (1 + noise)
    model = ao.from_frf(ao.FRF(f, H, "accelerance"), damping="viscous")
    assert model.k0 == pytest.approx(1e6, rel=0.02)
    assert model.m_st < 0.2
