"""Damping where a model is made: ratios of all modes, of each mode, Rayleigh's."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
import parts

SITE = ao.Site((0.13, 0.06), (0.2, -1), radius=0.034)


@pytest.fixture(scope="module")
def sheet():
    solid = ao.Solid(**parts.STEEL, plane="stress", thickness=0.01)
    return ao.Structure(parts.plate((6, 3), (0.2, 0.06)), solid, [ao.Support("left")])


@pytest.mark.sample
@pytest.mark.parametrize("damping", [0.02, [0.05, 0.02, 0.01], ao.Damping(alpha=30.0, beta=1e-7)])
def test_every_model_has_the_damping_of_its_free_modes(sheet, damping):
    known = damping if isinstance(damping, ao.Damping) else ao.Damping(ratio=damping)
    for model in (
        ao.extract(sheet, SITE, 6, damping=damping),
        ao.superposition(sheet, SITE, 4, damping=damping),
        ao.full(sheet, SITE, damping=damping),
        *ao.extract(sheet, [SITE, SITE], 4, damping=damping),
    ):
        body = model.modal()
        np.testing.assert_allclose(body.decay, known.decay(body.omega), rtol=1e-12)
    several = ao.extract(sheet, {"tip": SITE}, 6, damping=damping).site_modes()
    np.testing.assert_allclose(several.decay, known.decay(several.omega), rtol=1e-12)


def test_the_ringing_after_a_blow_decays_by_its_ratio(sheet):
    """The lowest mode alone is left after the others have died: e^(−ζωt)."""
    model = ao.extract(sheet, SITE, 8, damping=[0.02, 0.2])
    hit = ao.simulate(model, ao.RigidMass(0.02, 1.0), ao.Hertz(1e8), 0.05)
    omega = model.modal().omega[0]
    period = 2 * np.pi / (omega * np.sqrt(1 - 0.02**2))
    start = 0.05 - 20 * period
    t = start + np.linspace(0, 1, 400) * period
    first, last = (
        np.abs(ao.probe(sheet, hit, (0.2, 0.03), times=t + k * period)[:, 1]).max() for k in (0, 15)
    )
    assert np.log(first / last) == pytest.approx(0.02 * omega * 15 * period, rel=1e-3)
