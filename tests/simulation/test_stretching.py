"""Second-order forces in the march: other integrators, energy, and what they refuse."""

from __future__ import annotations

import pickle
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.impact import stretching
from antiosc.impact.histories.energy import energy_balance
from antiosc.impact.stretching import (
    NEGLIGIBLE_SHARE,
)
from antiosc.models.stretch import Stretch
from stretched import model

DURATION = 0.008
BALL = ao.RigidMass(0.3, velocity=1.0)
LAW = ao.Power(5e8, 1.5)


def integrated(body, forces, t_end=DURATION):
    """The same by DOP853, with force and displacement of the site as functions of time."""
    modal = body.modal()
    omega, b, J = modal.omega, modal.b, modal.omega.size
    decay = np.zeros(J) if modal.decay is None else modal.decay

    def contact(q, w):
        return 5e8 * max(w - b @ q, 0.0) ** 1.5

    def slope(_, x):
        q, v, w, s = x[:J], x[J : 2 * J], x[-2], x[-1]
        F = contact(q, w)
        f = forces.forces((q @ forces.modes)[None])[0]
        acceleration = -(omega**2) * q - 2 * decay * v + b * F - forces.modes @ f
        return np.concatenate([v, acceleration, [s, -F / 0.3]])

    start = np.zeros(2 * J + 2)
    start[-1] = 1.0
    t = np.linspace(0, t_end, 4001)
    x = solve_ivp(slope, (0, t_end), start, "DOP853", t, rtol=1e-8, atol=1e-11).y
    force = np.array([contact(q, w) for q, w in zip(x[:J].T, x[-2], strict=True)])
    return t, force, b @ x[:J]


@pytest.mark.slow
@pytest.mark.parametrize("damping", [None, ao.Damping(ratio=0.02)])
def test_the_march_is_that_of_dop853(damping):
    body = model(damping=damping)
    hit = ao.simulate(body, BALL, LAW, DURATION, tol=1e-4)
    linear = ao.simulate(model(scale=1e-9), BALL, LAW, DURATION)
    times = np.linspace(0, DURATION, 200)
    apart = np.abs(hit.force_at(times) - linear.force_at(times))
    assert apart.max() > 0.1 * hit.peak_force  # they matter
    assert hit.contact_time < DURATION / 2  # it goes on behind the contact
    t, force, moved = integrated(body, body.stretch)
    assert np.abs(hit.force_at(t) - force).max() < 2e-3 * force.max()
    q = hit.states(t)[0][:, : body.modal().omega.size]
    assert np.abs(np.abs(q @ body.modal().b) - np.abs(moved)).max() < 1e-3 * np.abs(moved).max()


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_the_balance_sees_other_second_order_forces(gravity):
    hit = ao.simulate(model(), BALL, LAW, DURATION, gravity=gravity)
    assert hit.energy.drift < 1e-4
    other = replace(hit.assembly.system, cubic=2 * hit.assembly.system.cubic)
    assert energy_balance(replace(hit.assembly, system=other), hit.run).drift > 0.01


def test_a_plate_that_hardly_moves_is_linear_to_the_last_bit():
    slow = ao.RigidMass(0.3, velocity=1e-4)
    hit = ao.simulate(model("auto"), slow, LAW, DURATION)
    linear = ao.simulate(replace(model(), stretch=None), slow, LAW, DURATION)
    assert not hit.assembly.stretch_forces
    assert hit.error_budget["peak_force"].stretch == NEGLIGIBLE_SHARE  # up to which it is linear
    assert np.array_equal(hit.force, linear.force)
    assert np.array_equal(hit.time, linear.time)


def test_an_automatic_number_states_its_error():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        hit = ao.simulate(model("auto", size=5), BALL, LAW, DURATION)
    assert 2 < hit.assembly.stretch_forces["structure"].size <= 5
    bar = hit.error_budget["peak_force"]
    names = ("peak_force", "impulse", "deflection")
    force, *others = (hit.error[f"stretch {name}"] for name in names)
    assert bar.stretch == pytest.approx(stretching.STRETCH_SAFETY * max(force, max(others) / 2))
    told = str(hit.error_budget)
    assert f"There is no error bar. {hit.error_budget.unknown['mesh']}" in told
    assert " not known: extract the model" in hit.error_budget.unknown["mesh"]
    assert "mesh 0 %" not in told  # nobody has estimated it
    whole = ao.simulate(model(5, size=5), BALL, LAW, DURATION)
    assert abs(hit.peak_force / whole.peak_force - 1) <= bar.stretch + bar.time


def test_the_forces_do_not_depend_on_the_axes_of_their_modes():
    body = model()
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turned = body.stretch.turned(turn, body.modal().omega)
    a = np.random.default_rng(2).standard_normal((5, 3)) * 1e-3
    assert np.allclose(turned.forces(a @ turn), body.stretch.forces(a) @ turn, rtol=1e-10)
    assert np.allclose(turned.energy(a @ turn), body.stretch.energy(a), rtol=1e-10)
    step, way = 1e-8, np.eye(3)[1]
    rise = body.stretch.energy(a + step * way) - body.stretch.energy(a - step * way)
    assert np.allclose(rise / (2 * step), body.stretch.forces(a)[:, 1], rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "call",
    [
        lambda body, hit: ao.simulate(body, BALL, LAW, DURATION, method="newmark"),
        lambda body, hit: ao.simulate(body, BALL, LAW, DURATION, step=1e-5),
        lambda body, hit: ao.simulate(body, BALL, LAW, DURATION, n=2),
        lambda body, hit: body.truncated(2),
        lambda body, hit: ao.gradient(hit, "peak_force"),
    ],
)
def test_what_is_linear_refuses_in_a_sentence(call):
    body = model()
    hit = ao.simulate(body, BALL, LAW, DURATION)
    with pytest.raises(InputError, match="stretch"):
        call(body, hit)


def test_files_and_pickles_keep_them(tmp_path):
    body = model("auto")
    body.save(tmp_path / "m.npz")
    for again in (ao.AntiOscillators.load(tmp_path / "m.npz"), pickle.loads(pickle.dumps(body))):
        assert again.stretch.count == "auto"
        assert np.array_equal(again.stretch.cubic, body.stretch.cubic)
        assert np.array_equal(again.stretch.modes, body.stretch.modes)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"modes": np.eye(5)[:, :3] * 2}, "orthonormal"),
        ({"quadratic": np.arange(27.0).reshape(3, 3, 3)}, "symmetric"),
        ({"cubic": np.full((3, 3, 3, 3), np.nan)}, "finite"),
        ({"count": 0}, "count"),
    ],
)
def test_numbers_that_are_no_forces_are_told(change, what):
    good = model().stretch
    given = {name: getattr(good, name) for name in ("modes", "quadratic", "cubic", "count")}
    with pytest.raises(InputError, match=what):
        Stretch(**given | change)
