"""`gradient` against closed forms, identities of dimensions, and differences."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import antiosc as ao
import zener
from antiosc import closed_form
from plates import SupportedPlate

MODEL: dict[str, Any] = {"m0": 0.05, "k0": 2e5, "m": [0.3, 0.1, 0.05], "omega": [2e3, 6e3, 1.4e4]}


def blow(law: ao.ContactLaw, model: dict[str, Any] = MODEL, **options: Any) -> ao.History:
    given = {"gap": 1e-5, "tol": 1e-5} | options
    return ao.simulate(ao.AntiOscillators(**model), ao.RigidMass(0.5, 1.0), law, 3e-3, **given)


@pytest.mark.parametrize(
    ("law", "goal", "powers"),
    [
        (ao.Hertz(1e9), "peak_force", (3 / 5, 6 / 5, 2 / 5)),
        (ao.Hertz(1e9), "contact_time", (2 / 5, -1 / 5, -2 / 5)),
        (ao.Linear(1e6), "peak_force", (1 / 2, 1, 1 / 2)),
        (ao.Linear(1e6), "impulse", (1, 1, 0)),
        (ao.Linear(1e6), "contact_time", (1 / 2, 0, -1 / 2)),
    ],
)
def test_a_mass_on_a_rigid_wall(
    law: ao.ContactLaw, goal: str, powers: tuple[float, float, float]
) -> None:
    """d ln goal/d ln (m, v, k): W. Goldsmith, Impact, London 1960, section 4.2."""
    ball, wall = ao.RigidMass(0.2, 1.5), ao.Obstacle()
    hit = ao.Scene({"wall": wall, "ball": ball}, [ao.Contact("wall", "ball", law)]).run(
        2e-3, tol=1e-7
    )
    g = ao.gradient(hit, goal)
    found = np.array([g.mass * 0.2, g.velocity * 1.5, g.stiffness * law.stiffness]) / g.value
    assert found == pytest.approx(powers, abs=1e-5)


@pytest.mark.slow
def test_a_sphere_on_zeners_plate() -> None:
    """d ln goal/d ln (m, v, k) on a plate so large that no wave returns in time."""
    given, aluminium = np.array([5e-3, 1.0, 1e8]), (70e9, 0.33, 2700.0, 2e-3)

    def zeners(x: np.ndarray) -> dict[str, float]:
        lam = zener.inelasticity(*x, thin.D, thin.surface_density)
        time = zener.contact_time(lam) * zener.time_unit(*x)
        return {"restitution": float(zener.restitution(lam)), "contact_time": float(time)}

    thin = SupportedPlate(*aluminium, a=1.0, b=1.0)
    time = zener.contact_time(0.49) * zener.time_unit(*given)
    side = float(16 * (thin.D / thin.surface_density) ** 0.25 * np.sqrt(time))
    plate, odd = SupportedPlate(*aluminium, a=side, b=side), np.arange(1, 80, 2)
    omega = np.sort(plate.kirchhoff(odd[:, None], odd).ravel())
    b = np.full(omega.size, 2 / np.sqrt(plate.surface_density * side**2))
    compliance = plate.compliance(side / 2, side / 2)
    model = ao.from_free_modes(omega, b, compliance, n=60)
    hit = ao.simulate(model, ao.RigidMass(*given[:2]), ao.Hertz(given[2]), 1.3 * time, tol=1e-6)
    ends = [[zeners(given * (1 + s * 1e-4 * one)) for s in (-1, 1)] for one in np.eye(3)]
    for goal, off in (("restitution", 1e-3), ("contact_time", 1e-2)):
        g = ao.gradient(hit, goal)
        assert g.value == pytest.approx(zeners(given)[goal], rel=1e-4)
        found = np.array([g.mass, g.velocity, g.stiffness]) * given / g.value
        known = np.log([[end[goal] for end in pair] for pair in ends]) @ (-1, 1) / 2e-4
        assert found == pytest.approx(known, abs=off)


#: Powers of mass, length and time in the units of goals and parameters.
UNITS = {
    "peak_force": (1, 1, -2), "impulse": (1, 1, -1), "contact_time": (0, 0, 1),
    "restitution": (0, 0, 0), "peak_displacement": (0, 1, 0), "mass": (1, 0, 0),
    "velocity": (0, 1, -1), "m0": (1, 0, 0), "m": (1, 0, 0), "k0": (1, 0, -2), "omega": (0, 0, -1),
    "gap": (0, 1, 0), "compliance": (-1, 0, 2), "yield_indentation": (0, 1, 0),
    "critical": (0, 1, 0),
}  # fmt: skip


def in_units(g: ao.Gradient, values: dict[str, Any], exponent: float) -> np.ndarray:
    """Sums over all parameters of p dG/dp times the powers of their units."""
    units = UNITS | {"stiffness": (1, 1 - exponent, -2)}
    total = np.zeros(3)
    for name, value in values.items():
        slope = getattr(g, name)
        if slope is not None:
            total += np.sum(np.multiply(slope, value)) * np.array(units[name])
    return total


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "model", "goal"),
    [
        (ao.Hertz(5e8), {}, "peak_displacement"),
        (ao.Hertz(5e8), {"m0": 0.0}, "contact_time"),
        (ao.Hertz(5e8, compliance=2e-9), {"k0": 0.0}, "peak_force"),
        (ao.Linear(5e6), {"m0": 0.0, "k0": 0.0}, "impulse"),
        (ao.Power(2e8, 1.3), {}, "contact_time"),
        (ao.HuntCrossley(5e8, 0.7), {}, "peak_force"),
        (ao.Thornton(5e8, 2e-5), {}, "impulse"),
        (ao.YangSun(5e8, 2e-5), {"m0": 0.0}, "peak_force"),
        (ao.Hertz(5e8), {"damping": ao.Damping(0.03)}, "contact_time"),
    ],
)
def test_units_of_mass_and_length(law: Any, model: dict[str, Any], goal: str) -> None:
    """A result does not depend on the units of its parameters (Buckingham).

    That holds for the steps themselves, of mass and length exactly; a unit of time would change
    their lengths.
    """
    model = MODEL | model
    hit = blow(law, model, tol=1e-7)
    g = ao.gradient(hit, goal)
    values = {name: model[name] for name in ("m0", "k0", "m", "omega")}
    values |= {"mass": 0.5, "velocity": 1.0, "gap": 1e-5, "stiffness": law.stiffness}
    for name in ("compliance", "yield_indentation", "critical"):
        values |= {name: given} if (given := getattr(law, name, None)) else {}
    exponent = 1.0 if isinstance(law, ao.Linear) else getattr(law, "exponent", 1.5)
    found = in_units(g, values, exponent) / g.value
    assert found[:2] == pytest.approx(UNITS[goal][:2], abs=1e-5)
    if goal != "peak_displacement":  # which may grow to the end of the run
        assert found[2] == pytest.approx(UNITS[goal][2], abs=2e-2)


@pytest.mark.slow
def test_a_function_of_the_run() -> None:
    """Samples at given times are the timed goals; the last velocity is v - impulse/mass."""
    hit = blow(ao.Hertz(1e9))
    t = float(hit.run.time[np.argmax(hit.run.force)]) - 1e-5
    wanted = {"velocity": 1.0, "mass": 0.5, "k0": 2e5, "stiffness": 1e9}

    def numbers(goal: Any, **options: Any) -> np.ndarray:
        g = ao.gradient(hit, goal, **options)
        return np.array([g.value, *(getattr(g, name) * x for name, x in wanted.items())])

    for name in ("force", "displacement"):
        expected = numbers(name, time=t)
        found = numbers(lambda run, n=name: np.interp(t, run.time, getattr(run, n)))
        found[0] = numbers(name, time=t)[0]  # the given run is coarser
        assert found == pytest.approx(expected, rel=1e-4, abs=1e-4 * np.abs(expected).max())
    impulse, last = numbers("impulse"), numbers(lambda run: run.impactor_velocity[-1])
    expected = -impulse / 0.5
    expected[:3] += (1.0, 1.0, impulse[0] / 0.5)  # v - J/m by J, v and m
    assert last == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("scene", [False, True])
def test_a_function_that_builds_the_model(scene: bool) -> None:
    """The derivatives by its arguments are those by the model's own numbers."""

    def build(x: np.ndarray) -> ao.AntiOscillators:
        return ao.AntiOscillators(**MODEL | {"k0": x[0], "m": [x[1], 0.1, 0.05]})

    hit: Any = blow(ao.Hertz(1e9))
    if scene:
        contact = ao.Contact("part", "ball", ao.Hertz(1e9), gap=1e-5)
        bodies = {"part": build(np.array([2e5, 0.3])), "ball": ao.RigidMass(0.5, 1.0)}
        hit = ao.Scene(bodies, [contact]).run(3e-3, tol=1e-5)
    g = ao.gradient(hit, "impulse", part=build, x=[2e5, 0.3])
    own = g.bodies["part" if scene else "structure"]
    assert g.x == pytest.approx([own["k0"], own["m"][0]], rel=1e-5)


NAMES = ("mass", "velocity", "stiffness")


@pytest.mark.slow
def test_bars_hold_what_more_oscillators_and_finer_steps_give() -> None:
    beam = closed_form.UniformBeam.timoshenko(
        E=70e9, nu=0.33, rho=2700.0, area=2e-4, inertia=1.7e-9, length=0.3
    )
    struck = closed_form.pinned_pinned(beam, 0.13)
    few, many = struck.anti_oscillators(8), struck.anti_oscillators(24)
    inside = []
    for stiffness in (3e7, 1e9):
        blow = (ao.RigidMass(0.05, 1.0), ao.Hertz(stiffness), 1e-3)
        hit, best = ao.simulate(few, *blow), ao.simulate(many, *blow, tol=1e-5)
        for goal in ("peak_force", "impulse"):
            g, fine = ao.gradient(hit, goal, error="estimate"), ao.gradient(best, goal)
            inside += [
                abs(getattr(g, name) - getattr(fine, name)) <= getattr(g.error, name)
                for name in NAMES
            ]
    assert np.mean(inside) >= 0.8, inside


def on_wall(gravity=0.0, duration=2e-3):
    contact = ao.Contact("wall", "ball", ao.Linear(1e6))
    bodies = {"wall": ao.Obstacle(), "ball": ao.RigidMass(0.2, 1.0)}
    return ao.Scene(bodies, [contact], gravity=gravity).run(duration, tol=1e-8)


def away():
    model = ao.AntiOscillators(**MODEL)
    return ao.simulate(model, ao.RigidMass(0.5, 1.0), ao.Hertz(1e8), 1e-6, gap=1.0)


NONE, WRONG = ao.NotDifferentiableError, ao.InputError


@pytest.mark.parametrize(
    ("call", "error", "word"),
    [
        (lambda hit: ao.gradient(away(), "peak_force"), NONE, "touch"),
        (lambda hit: ao.gradient(away(), "contact_time"), NONE, "touch"),
        (lambda hit: ao.gradient(away(), "restitution"), NONE, "touch"),
        # the mass rebounds between two touches of the wall with the same force
        (lambda hit: ao.gradient(on_wall(2000.0, 8e-3), "peak_force"), NONE, "equal"),
        (lambda hit: ao.gradient(on_wall(), "impulse", error="estimate"), WRONG, "bars"),
        (lambda hit: ao.gradient(hit, "momentum"), WRONG, "goal"),
        (lambda hit: ao.gradient(hit, "force"), WRONG, "time"),
        (lambda hit: ao.gradient(hit, lambda run: float("nan")), WRONG, "goal"),
        (lambda hit: ao.gradient(hit, "impulse").yield_indentation, AttributeError, "stiffness"),
    ],
)  # fmt: skip
def test_what_has_no_gradient_or_optimum(call, error, word):
    with pytest.raises(error, match=word):
        call(blow(ao.Hertz(1e8)))


def random_row(seed, count):
    """A run of (change, tol) with all inputs changed in proportion, and the sum of their parts.

    A structure and balls in a row, the last of which strikes the others.
    """
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(1, 6)), 10 ** rng.uniform(8, 9.5)
    kinds = [
        ao.Linear(k / 100), ao.Hertz(k), ao.Power(k / 5, 1.3), ao.HuntCrossley(k, 0.7),
        ao.Gonthier(k, 0.8), ao.Thornton(k, 1e-5), ao.YangSun(k, 1e-5),
        ao.Thornton(k, 1e-5, compliance=0.1 / k),
    ]  # fmt: skip
    laws = [kinds[(seed + i) % len(kinds)] for i in range(count)]
    massless = rng.random() < 0.3 and not laws[0].rate_dependent
    model = {
        "m0": 0.0 if massless else rng.uniform(0.01, 0.1),
        "k0": 0.0 if rng.random() < 0.3 else 10 ** rng.uniform(4, 6),
        "m": rng.uniform(0.02, 0.3, n), "omega": np.sort(10 ** rng.uniform(3, 4.5, n)),
    }  # fmt: skip
    damping = ao.Damping(rng.uniform(0, 0.05), 20.0, 1e-7) if rng.random() < 0.5 else None
    masses, gaps = rng.uniform(0.05, 1.0, count), rng.uniform(1e-6, 5e-5, count)
    speed, w = rng.uniform(0.3, 3.0), rng.uniform(-1, 1, 5)
    by_ball = rng.uniform(-1, 1, (3, count))
    names = ["part", *(f"ball{i}" for i in range(count))]
    ends = list(pairwise(names))

    def run(change, tol):
        f, of = 1 + change * w, 1 + change * by_ball
        numbers = {name: value * f[i] for i, (name, value) in enumerate(model.items())}
        bodies = {"part": ao.AntiOscillators(**numbers, damping=damping)}
        for i, mass in enumerate(masses * of[0]):
            bodies[names[1 + i]] = ao.RigidMass(mass, speed * f[4] if i == count - 1 else 0.0)
        contacts = [
            ao.Contact(*pair, replace(law, stiffness=law.stiffness * more), gap=gap)
            for pair, law, more, gap in zip(ends, laws, of[1], gaps * of[2], strict=True)
        ]
        return ao.Scene(bodies, contacts).run(3e-3, tol=tol)

    def along(g):
        part = g.bodies["part"]
        parts = [
            float(np.sum(np.multiply(part[name], value))) * w[i]
            for i, (name, value) in enumerate(model.items())
            if part.get(name) is not None
        ]
        parts.append(g.bodies[names[-1]]["velocity"] * speed * w[4])
        for i, pair in enumerate(ends):
            contact = g.contacts[pair]
            parts.append(g.bodies[names[1 + i]]["mass"] * masses[i] * by_ball[0, i])
            parts.append(contact["stiffness"] * laws[i].stiffness * by_ball[1, i])
            parts.append(contact["gap"] * gaps[i] * by_ball[2, i])
        return parts

    return run, along, ends[0]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.filterwarnings("ignore")
def test_random_rows_against_differences(seed):
    """Along a random direction of all inputs, within 1e-3 of its largest part."""
    run, along, ends = random_row(seed, 1 + seed % 3)
    h = 1e-5
    below, at, above = run(-h, 1e-8), run(0.0, 1e-6), run(h, 1e-8)
    for goal in ("peak_force", "impulse") if at[ends].contacts else ():
        parts = along(ao.gradient(at, goal, contact=ends))
        slope = (getattr(above[ends], goal) - getattr(below[ends], goal)) / (2 * h)
        assert abs(sum(parts) - slope) <= 1e-3 * max(map(abs, parts)), (seed, goal)
