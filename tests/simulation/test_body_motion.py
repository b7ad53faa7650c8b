"""Motion and energy of single bodies: one that strikes, the shares of each, many at once."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.base import progress
from antiosc.impact.from_rest import peak_deflections
from antiosc.impact.histories.factors import column_forces, shape_factors
from marks import TURNS_FAR
from scenes import finely
from struck_beams import THICK, free_free

pytestmark = TURNS_FAR

X = np.linspace(0, THICK.length, 5)
BEAM = free_free(THICK, 0.1).anti_oscillators(2, X)  # pushed along +y
LAW = ao.Hertz(1e8)
WALL = ao.AntiOscillators(m0=0.5, k0=1e6, m=[0.2], omega=[3e3], direction=(0, -1.0, 0))


@pytest.mark.parametrize("body", ["structure", "impactor"])
def test_amplitudes_have_the_derivatives_of_their_motion(body: str) -> None:
    """By central differences, in flight after the blow and under the contact."""
    pair = (WALL, ao.Impactor(BEAM, 2.0)) if body == "impactor" else (BEAM, ao.RigidMass(0.3, 2.0))
    hit = ao.simulate(*pair, LAW, 0.015, tol=1e-6)
    start, end = hit.contacts[-1]
    assert end < hit.time[-1]
    h = 1e-7
    for t in (0.37 * start + 0.63 * end, 0.5 * (end + hit.time[-1])):
        times = np.array([t - h, t, t + h])
        at = [shape_factors(hit, times, body, k) for k in range(3)]
        rate, bend = (at[0][2] - at[0][0]) / (2 * h), (at[1][2] - at[1][0]) / (2 * h)
        np.testing.assert_allclose(at[1][1], rate, rtol=0, atol=1e-4 * np.abs(rate).max())
        np.testing.assert_allclose(at[2][1], bend, rtol=0, atol=1e-4 * np.abs(bend).max())
        field = hit.field(t, body)
        own = (pair[0] if body == "structure" else BEAM).shapes
        np.testing.assert_allclose(field, own @ at[0][1][: own.shape[1]] + _hidden(hit, t, body))
        assert column_forces(hit, times, body)[1, 0] == pytest.approx(hit.force_at(t)[0])


def _hidden(hit: ao.History, t: float, body: str) -> np.ndarray:
    model = hit.model if body == "structure" else BEAM
    if model.hidden is None:
        return np.zeros(X.size)
    return model.hidden @ hit.coordinates(t, body)[model.n + 1 :]


MASS = ao.RigidMass(0.05, 2.0)


def test_a_row_of_masses_takes_what_a_dashpot_takes():
    """Spring k on an impedance Z: ζ = √(km)/2Z, e = exp(−ζπ/√(1−ζ²)); no wave returns in time."""
    n, mass, stiffness = 100, 1e-3, 1e6  # Z = √(1e3)
    K = np.diag(np.full(n, 2 * stiffness)) - stiffness * (np.eye(n, k=1) + np.eye(n, k=-1))
    K[0, 0] = stiffness
    part = ao.Structure.from_matrices(K, mass * np.eye(n), backend="scipy")
    ball = ao.RigidMass(2e-3, 1.0)
    hit = ao.simulate(ao.full(part, ao.Site(dof=0)), ball, ao.Linear(2e4), 2e-3)
    zeta = np.sqrt(2e4 * 2e-3 / 1e3) / 2
    e = np.exp(-zeta * np.pi / np.sqrt(1 - zeta**2))
    assert ao.vibration_share(hit) == pytest.approx(1 - e**2, rel=2e-2)


def test_gravity_as_a_vector_pulls_both_bodies_along_the_impact() -> None:
    """Both fall alike, so that the blow is that without gravity; the wall of a held one is not."""
    free = ao.AntiOscillators(m0=0.5, k0=0.0, m=[], omega=[], participation=[0.5],
                              direction=(0, -1.0, 0))  # fmt: skip
    runs = [
        ao.simulate(free, ao.Impactor(BEAM, 2.0), LAW, 1e-3, gravity=pull, tol=1e-6, gap=1e-4)
        for pull in (0.0, (3.0, 700.0, 5.0))
    ]
    np.testing.assert_allclose(runs[1].peak_force, runs[0].peak_force, rtol=1e-5)
    np.testing.assert_allclose(runs[1].contacts, runs[0].contacts, rtol=1e-5)
    # both are pulled along +y, against the direction of the impact
    fall = runs[1].impactor_velocity[-1] - runs[0].impactor_velocity[-1]
    assert fall == pytest.approx(-700.0 * 1e-3, rel=1e-4)
    assert runs[1].velocity[-1] - runs[0].velocity[-1] == pytest.approx(fall, rel=1e-4)


@pytest.mark.parametrize("m0", [0.02, 0.0])  # without it the site has a residual compliance
def test_bodies_sum_to_the_energy_of_the_run(m0):
    plate = ao.AntiOscillators(m0=m0, k0=2e6, m=[0.2, 0.1], omega=[3e3, 1.1e4])
    hit = ao.simulate(plate, MASS, ao.Hertz(1e9), 2e-3)
    assert (plate.modal().r > 0) == (m0 == 0)
    own = [ao.body_energy(hit, name) for name in ("structure", "impactor")]
    kinetic = sum(e.rigid + e.kinetic for e in own)
    np.testing.assert_allclose(kinetic, hit.energy.kinetic, atol=1e-12)
    np.testing.assert_allclose(sum(e.strain for e in own), hit.energy.strain, rtol=1e-9, atol=1e-15)
    assert own[1].rigid[0] == pytest.approx(0.5 * 0.05 * 4)
    np.testing.assert_array_equal(own[1].vibration, 0)
    np.testing.assert_array_equal(own[0].rigid, 0)


@pytest.mark.slow
def test_bodies_of_different_size_are_histories(rng, monkeypatch):
    monkeypatch.setattr("antiosc.impact.from_rest.BODIES_AT_ONCE", 2)
    ball, law = ao.RigidMass(mass=0.3, velocity=1.0), ao.Hertz(1e8)
    bodies = [
        ao.AntiOscillators(m0=0.0, k0=1e6, m=[0.4], omega=[900.0]),
        ao.AntiOscillators(
            m0=0.2, k0=0.0, m=rng.uniform(0.1, 1, 5), omega=rng.uniform(1e3, 9e3, 5)
        ),
        ao.AntiOscillators(
            m0=0.1, k0=3e6, m=[0.2, 0.1], omega=[2e3, 5e3], damping=ao.Damping(ratio=0.02)
        ),
    ]
    hits = [ao.simulate(body, ball, law, 0.02) for body in bodies]
    forces = [finely(hit) for hit in hits]
    told: list[str] = []
    with progress.following_progress(told.append):
        peaks = peak_deflections(bodies, forces, 0.02)
    assert "largest deflections: 3 of 3" in told  # of hundreds of sites they take seconds
    for peak, hit, (times, _) in zip(peaks, hits, forces, strict=True):
        assert peak == pytest.approx(hit.coordinates(times)[:, 0].max(), rel=1e-6)


PLATE = ao.AntiOscillators(m0=0.02, k0=2e6, m=[0.2, 0.1], omega=[3e3, 1.1e4])


def test_what_vibrates_is_what_the_rebound_lacks():
    """Without losses in the contact, 1 − e² of the ball's energy is in the plate."""
    hit = ao.simulate(PLATE, MASS, ao.Hertz(1e9), 2e-3, tol=1e-6)
    lost = 1 - (hit.impactor_velocity[-1] / 2.0) ** 2
    assert ao.vibration_share(hit) == pytest.approx(lost, abs=1e-4)
    still = ao.simulate(PLATE, ao.RigidMass(1.0), ao.Hertz(1e9), 1e-4)
    with pytest.raises(ao.InputError, match="at rest"):
        ao.vibration_share(still)
