"""Second-order forces in the march: other integrators, energy, and what they refuse."""

from __future__ import annotations

import itertools
import pickle
import warnings
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import antiosc as ao
from antiosc.base.errors import InputError
from antiosc.base.texts import STOPPED, percent
from antiosc.impact import stretching
from antiosc.impact.histories.bars import CAUSES
from antiosc.impact.histories.energy import energy_gain
from antiosc.impact.stretching import (
    NEGLIGIBLE,
    with_rows,
)
from antiosc.impact.truncation import WARN_SHARE
from antiosc.models.stretch import Stretch
from antiosc_app import headline, live
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


def test_long_steps_keep_the_energy():
    hit = ao.simulate(model(), BALL, LAW, DURATION)
    assert hit.energy.drift < 1e-4
    assert hit.energy.strain.max() > 0


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_the_gain_of_energy_is_that_of_the_whole_balance(gravity):
    """At the ends of steps, with little more than rounding between both."""
    hit = ao.simulate(model(), BALL, LAW, DURATION, gravity=gravity)
    energy = hit.energy
    held = energy.kinetic + energy.strain + energy.contact
    wanted = (energy.total[::2].max() - energy.total[0]) / held[::2].max()
    assert energy_gain(hit.assembly, hit.run) == pytest.approx(wanted, abs=1e-9)
    taken = replace(hit.assembly.system, cubic=2 * hit.assembly.system.cubic)
    assert energy_gain(replace(hit.assembly, system=taken), hit.run) > 0.01


def test_a_plate_that_hardly_moves_is_linear_to_the_last_bit():
    slow = ao.RigidMass(0.3, velocity=1e-4)
    hit = ao.simulate(model("auto"), slow, LAW, DURATION)
    linear = ao.simulate(replace(model(), stretch=None), slow, LAW, DURATION)
    assert not hit.assembly.stretched
    assert hit.error_budget["peak_force"].stretch == NEGLIGIBLE  # up to which it is linear
    assert np.array_equal(hit.force, linear.force)
    assert np.array_equal(hit.time, linear.time)


def test_an_automatic_number_states_its_error():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        hit = ao.simulate(model("auto", size=5), BALL, LAW, DURATION)
    assert 2 < hit.assembly.stretched["structure"].size <= 5
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


def test_modes_whose_energy_has_no_bound_do_not_count(monkeypatch):
    """The least modes that are taken may lack those that stiffen them."""
    body = model(count="auto", size=5)
    right = ao.simulate(body, BALL, LAW, DURATION)

    def with_unbounded(a, by_body):
        unbounded = {name: replace(f, cubic=-1e3 * f.cubic) for name, f in by_body.items()}
        return with_rows(a, unbounded if len(sizes) == 1 else by_body)

    sizes: list[int] = []
    monkeypatch.setattr(
        stretching, "with_rows", lambda a, by: sizes.append(1) or with_unbounded(a, by)
    )
    hit = ao.simulate(body, BALL, LAW, DURATION)
    assert len(sizes) > 2
    assert hit.status != STOPPED
    assert hit.peak_force == pytest.approx(right.peak_force, rel=hit.error["stretch peak_force"])
    assert hit.error["stretch peak_force"] < 0.2


def test_too_few_anti_oscillators_are_in_the_bar_without_an_estimate_of_the_mesh():
    body = model("auto", size=5)
    body = replace(body, info=replace(body.info, method="krylov", converged=2))
    hits = []
    for stiffness in (1e5, 1e8):  # a contact far below the last antiresonance, and one above it
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            hits.append(ao.simulate(body, BALL, ao.Hertz(stiffness), DURATION))
    enough, too_few = (hit.error_budget for hit in hits)
    assert too_few["peak_force"].numerical >= WARN_SHARE
    assert "too few" in str(too_few)
    assert "mesh and truncation" not in str(too_few)
    assert enough["peak_force"].numerical < WARN_SHARE
    assert "too few" not in str(enough)
    assert "mesh's error is not known" in str(enough)


def test_the_truncation_is_that_of_the_linear_part():
    """The softest model of the rest has no second-order forces."""
    body = model()
    hit = ao.simulate(body, BALL, LAW, DURATION, tol=1e-4)
    flat = replace(body, stretch=None)
    linear = ao.simulate(flat, BALL, LAW, DURATION, tol=1e-4)
    assert ao.truncation_error(body, hit.rerun) == ao.truncation_error(flat, linear.rerun)


def test_a_part_with_two_modes_takes_both_and_says_nothing():
    body = model("auto", size=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hit = ao.simulate(body, BALL, LAW, DURATION)
    assert hit.assembly.stretched["structure"].size == 2


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


def test_modes_that_are_left_out_follow_with_least_energy():
    """The least energy of all modes at given amplitudes of two, by minimization."""
    rng = np.random.default_rng(3)
    omega = np.array([1.0, 2.0, 3.0, 5.0])
    quadratic, cubic = rng.standard_normal((4,) * 3), rng.standard_normal((4,) * 4)
    quadratic = sum(quadratic.transpose(way) for way in itertools.permutations(range(3)))
    cubic = sum(cubic.transpose(way) for way in itertools.permutations(range(4)))
    modes, both = (np.linalg.qr(rng.standard_normal((4, 4)))[0] for _ in range(2))
    forces = Stretch(modes, quadratic, cubic)
    stiffness = modes.T @ np.diag(omega**2) @ modes
    turn = both[:, :2]
    two = forces.turned(turn, omega)
    free = scipy.linalg.null_space(turn.T @ stiffness)
    a = 1e-3 * rng.standard_normal(2)

    def energy(z):
        x = turn @ a + free @ z
        return (x @ stiffness @ x / 2 + forces.energy(x[None])[0]) * 1e9

    found = minimize(energy, np.zeros(2), tol=1e-12)
    known = (a @ turn.T @ stiffness @ turn @ a / 2 + two.energy(a[None])[0]) * 1e9
    follows = turn @ a + np.einsum("mij,i,j->m", forces.following(turn, omega), a, a)
    still = energy(np.zeros(2))
    assert found.fun < still - 1e-6
    assert found.fun == pytest.approx(known, abs=0.05 * (still - found.fun))
    moved = free @ found.x
    assert moved == pytest.approx(follows - turn @ a, abs=0.02 * np.abs(moved).max())


def test_a_scene_of_two_plates_that_stretch():
    one = model()
    scene = ao.Scene(
        {"a": one, "b": ao.RigidMass(0.3, velocity=1.0)},
        [ao.Contact("a", "b", LAW)],
    )  # fmt: skip
    alone = ao.simulate(one, BALL, LAW, DURATION)
    assert scene.run(DURATION).peak_force == pytest.approx(alone.peak_force, rel=2e-3)
    both = ao.Scene(
        {"a": one, "b": ao.Impactor(one), "ball": BALL},
        [ao.Contact("a", "ball", LAW), ao.Contact("b", "ball", ao.Linear(1e3))],
    ).run(DURATION)
    assert set(both.assembly.stretched) == {"a", "b"}
    assert len(both.assembly.system.cubic) == 6


def test_rows_of_the_march_are_sites_displacements():
    hit = ao.simulate(model(), BALL, LAW, DURATION)
    a = with_rows(hit.assembly, {})
    assert len(a.system.beta) == len(hit.assembly.system.beta)
    own = hit.assembly.system.beta[1:]
    assert np.allclose(own[:, -1], 0)  # the ball has none


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


def test_many_impacts_take_them_one_by_one():
    body = model()
    speeds = [0.5, 1.0]
    found = ao.simulate_many(body, [ao.RigidMass(0.3, velocity=v) for v in speeds], LAW, DURATION)
    own = [ao.simulate(body, ao.RigidMass(0.3, velocity=v), LAW, DURATION) for v in speeds]
    assert np.allclose(found.peak_force, [one.peak_force for one in own], rtol=1e-9)


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


def test_what_stretches_is_told_and_a_striker_that_does_is_not_on_the_page():
    hit = ao.simulate(model(3), BALL, LAW, DURATION)
    linear = ao.simulate(replace(model(), stretch=None), BALL, LAW, DURATION)
    (told,) = hit.stretch_texts
    change = hit.peak_force / linear.peak_force - 1
    direction = "larger" if change > 0 else "smaller"
    assert told.startswith("'structure' stretches: second-order forces of 3 motions make")
    assert told.endswith(f"largest force {percent(abs(change))} {direction}")
    assert told in hit.summary()
    slight = ao.simulate(model(3, scale=1e-6), BALL, LAW, DURATION)
    assert "less than its error" in slight.stretch_texts[0]
    assert "stretch" not in linear.summary()
    assert live.blow_of_history(hit, None)["body"]["stretch"] is not None
    assert live.blow_of_history(linear, None)["body"]["stretch"] is None
    rigid, struck = ao.RigidMass(0.3, velocity=0.0), ao.Impactor(model(3))
    other = ao.simulate(rigid, struck, LAW, DURATION, initial_velocity=1.0)
    assert other.assembly.stretched
    assert live.blow_of_history(other, None) is None
    assert set(headline.REMEDIES) >= set(CAUSES)
