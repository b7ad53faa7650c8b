"""A beam that strikes, or is struck: its start, its motion in its own coordinates, its weight."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.closed_form import free_free
from antiosc.simulation.histories.body_motion import amplitudes, forces_of
from marks import TURNS_FAR
from struck_beams import THICK

pytestmark = TURNS_FAR

X = np.linspace(0, THICK.length, 5)
BEAM = free_free(THICK, 0.1).anti_oscillators(2, X)  # pushed along +y
LAW = ao.Hertz(1e8)
WALL = ao.AntiOscillators(m0=0.5, k0=1e6, m=[0.2], omega=[3e3], direction=(0, -1.0, 0))


def strike(velocity: float | ao.Motion, **options: object) -> ao.History:
    return ao.simulate(WALL, ao.Impactor(BEAM, velocity), LAW, 1e-3, tol=1e-5, **options)


def test_a_motion_of_an_impactor_is_that_of_its_own_mesh() -> None:
    """A number closes the gap: the beam flies along -y, against the push on it."""
    one, two = strike(2.0), strike(ao.Motion((0, -2.0, 0)))
    np.testing.assert_allclose(two.force, one.force, rtol=1e-9, atol=1e-6)
    assert one.impactor_velocity[0] == pytest.approx(2.0)
    assert one.peak_force > 1
    scene = ao.Scene({"w": WALL, "b": ao.Impactor(BEAM, 2.0)}, [ao.Contact("w", "b", LAW)])
    hit = scene.run(1e-3, tol=1e-5)
    assert hit["w", "b"].impulse == pytest.approx(one.impulse, rel=1e-4)
    np.testing.assert_allclose(hit.bodies["b"].momentum[0], [0, -2.0 * THICK.mass, 0], atol=1e-9)
    change = hit.bodies["b"].momentum[-1] - hit.bodies["b"].momentum[0]
    np.testing.assert_allclose(change, [0, one.impulse, 0], rtol=1e-4, atol=1e-9)


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
        at = [amplitudes(hit, times, body, k) for k in range(3)]
        rate, bend = (at[0][2] - at[0][0]) / (2 * h), (at[1][2] - at[1][0]) / (2 * h)
        np.testing.assert_allclose(at[1][1], rate, rtol=0, atol=1e-4 * np.abs(rate).max())
        np.testing.assert_allclose(at[2][1], bend, rtol=0, atol=1e-4 * np.abs(bend).max())
        field = hit.field(t, body)
        own = (pair[0] if body == "structure" else BEAM).shapes
        np.testing.assert_allclose(field, own @ at[0][1][: own.shape[1]] + _hidden(hit, t, body))
        assert forces_of(hit, times, body)[1, 0] == pytest.approx(hit.force_at(t)[0])


def _hidden(hit: ao.History, t: float, body: str) -> np.ndarray:
    model = hit.model if body == "structure" else BEAM
    if model.hidden is None:
        return np.zeros(X.size)
    return model.hidden @ hit.coordinates(t, body)[model.n + 1 :]


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
