"""Too few anti-oscillators for a contact: known without a further run, and told."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao
from antiosc.impact.truncation import _stiffness_deficit, truncation_share

BALL = ao.RigidMass(0.05, 1.0)
LAW = ao.Hertz(1e9)


def chain(n: int) -> ao.AntiOscillators:
    """A long string, struck in its middle, which is a damper for blows shorter than its waves."""
    size, pull, mass = 100, 4e6, 1e-3
    K = pull * (2 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    part = ao.Structure.from_matrices(K, mass * np.eye(size))
    return ao.extract(part, ao.Site(dof=size // 2), n=n)


def test_a_contact_that_is_too_short_for_the_model_is_told():
    whole = chain(60)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        truth = ao.simulate(whole, BALL, LAW, 4e-3)
    few = chain(8)
    with pytest.warns(ao.AccuracyWarning, match="too few for this contact"):
        hit = ao.simulate(few, BALL, LAW, 4e-3)
    assert "8 anti-oscillators" in hit.summary()
    wrong = abs(hit.peak_force / truth.peak_force - 1)
    assert 0.1 < wrong < truncation_share(few, hit.assembly)


def test_the_softer_extreme_is_the_gauss_rule():
    """With the same moments of the masses over 1/omega^2, and no mass at the site."""
    model = chain(6)
    lam = np.append(0.0, model.omega**-2.0) * model.omega[0] ** 2
    start = np.sqrt(np.append(model.m0, model.m))
    basis = np.linalg.qr(lam[:, None] ** np.arange(6) * start[:, None])[0]
    theta, turn = np.linalg.eigh(basis.T * lam @ basis)
    masses, omega = (turn.T @ basis.T @ start) ** 2, model.omega[0] / np.sqrt(theta)
    soft = ao.AntiOscillators(0.0, model.k0, masses, omega)
    s = model.omega[-1] * np.array([0.5, 1 + 2j, 3 + 9j])
    Z, softer = (one.dynamic_stiffness(-1j * s) for one in (model, soft))
    assert _stiffness_deficit(model, s) == pytest.approx(Z - softer, rel=1e-6)


@pytest.mark.filterwarnings("always")
@pytest.mark.parametrize("kind", ["batch", "scene", "turned scene"])
def test_batches_and_scenes_tell_it_too(kind):
    few, enough = chain(8), chain(60)

    def run(model: ao.AntiOscillators) -> None:
        if kind == "batch":
            ao.simulate_many([enough, model], [BALL, BALL], LAW, 4e-3)
        else:
            bodies = {"long string": model, "ball": BALL}
            names = list(bodies) if kind == "scene" else list(bodies)[::-1]
            scene = ao.Scene(
                {name: bodies[name] for name in names}, [ao.Contact("long string", "ball", LAW)]
            )
            scene.run(4e-3)

    with pytest.warns(ao.AccuracyWarning, match="8 anti-oscillators are too few"):
        run(few)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(enough)
