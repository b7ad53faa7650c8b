"""Gradients of bodies whose damping couples their modes: dampers and Maxwell branches."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import antiosc as ao

rng = np.random.default_rng(1)
L = rng.normal(size=(4, 4)) * np.sqrt([200, 80, 80, 300])
C, G, TAU = L.T @ L, np.diag([1e5, 0.0, 2e6, 0.0]), 2e-4
VALUES: dict[str, Any] = {
    "m0": 0.02, "k0": 4e6, "m": np.array([0.3, 0.2, 0.5]), "omega": np.array([3e3, 7e3, 1.5e4]),
    "damping": 1.0, "mass": 0.1, "velocity": 1.0, "stiffness": 1e7,
}  # fmt: skip
Goals = dict[str, float]
#: One entry of each array is asked for.
PLACE = 1


def model(p: dict[str, Any]) -> ao.AntiOscillators:
    damping = ao.DampingMatrix(p["damping"] * C, [(p["damping"] * G, TAU)])
    return ao.AntiOscillators(p["m0"], p["k0"], p["m"], p["omega"], damping=damping)


def changed(name: str, by: complex) -> dict[str, Any]:
    values = {n: np.array(value, dtype=np.result_type(by)) for n, value in VALUES.items()}
    values[name][(PLACE,) if values[name].ndim else ()] += by
    return values


def slope_of(g: ao.Gradient, name: str) -> float:
    found = getattr(g, name)
    return float(found[PLACE] if np.ndim(found) else found)


def size_of(name: str) -> float:
    return float(np.atleast_1d(VALUES[name])[PLACE if np.ndim(VALUES[name]) else 0])


def motion(p: dict[str, Any], mass: Any) -> tuple[np.ndarray, np.ndarray]:
    """x' = A x + a F of displacements, velocities and those of the branch; the ball is the last."""
    root = np.sqrt(p["m"])
    M, K, D, S = (np.zeros((5, 5), dtype=complex) for _ in range(4))
    M[:4, :4] = np.diag(np.append(p["m0"] + p["m"].sum(), np.ones(3)))
    M[0, 1:4] = M[1:4, 0] = root
    M[4, 4] = mass
    K[:4, :4] = np.diag(np.append(p["k0"], p["omega"] ** 2))
    D[:4, :4], S[:4, :4] = p["damping"] * C, p["damping"] * G
    A, a = np.zeros((15, 15), dtype=complex), np.zeros(15, dtype=complex)
    A[:5, 5:10] = np.eye(5)
    A[5:10] = np.linalg.solve(M, np.hstack([-K - S, -D, S]))
    A[10:] = np.hstack([np.eye(5), np.zeros((5, 5)), -np.eye(5)]) / TAU
    a[5:10] = np.linalg.solve(M, [1, 0, 0, 0, -1])
    return A, a


def linear(p: dict[str, Any], t: float) -> np.ndarray:
    """Force and displacement of a linear contact that has not parted, by the matrix exponential."""
    A, a = motion(p, p["mass"])
    gap = np.zeros(15)
    gap[[0, 4]] = -1, 1
    start = np.zeros(15, dtype=complex)
    start[9] = p["velocity"]
    x = scipy.linalg.expm((A + p["stiffness"] * np.outer(a, gap)) * t) @ start
    return np.array([p["stiffness"] * (gap @ x), x[0]])


@pytest.mark.slow
@pytest.mark.parametrize("name", VALUES)
def test_linear_contact(name: str) -> None:
    """The peak force and a displacement before it, by complex steps of the matrix exponential."""
    hit = ao.simulate(
        model(VALUES), ao.RigidMass(VALUES["mass"], VALUES["velocity"]),
        ao.Linear(VALUES["stiffness"]), duration=1e-3, tol=1e-9,
    )  # fmt: skip
    top = hit.time[np.argmax(hit.force)]
    limits = {"bounds": (0.9 * top, 1.1 * top), "method": "bounded", "options": {"xatol": 1e-12}}
    peak = minimize_scalar(lambda t: -linear(VALUES, t)[0].real, **limits).x
    assert abs(hit.peak_force / linear(VALUES, peak)[0].real - 1) < 1e-6
    step = 1e-30 * size_of(name)
    force, _ = linear(changed(name, 1j * step), peak).imag / step
    _, way = linear(changed(name, 1j * step), 0.5 * peak).imag / step
    found = ao.gradient(hit, "peak_force")
    later = ao.gradient(hit, "displacement", time=0.5 * peak)
    assert abs(slope_of(found, name) - force) < 1e-5 * hit.peak_force / size_of(name)
    assert abs(slope_of(later, name) - way) < 1e-6 * later.value / size_of(name)


def struck(p: dict[str, Any], **options: Any) -> ao.History:
    """Several touches of a heavier ball."""
    ball = ao.RigidMass(20 * float(p["mass"]), float(p["velocity"]))
    law = ao.Flores(1000 * float(p["stiffness"]), 0.9)
    return ao.simulate(model(p), ball, law, duration=3e-3, **options)


def integrated(p: dict[str, Any]) -> Goals:
    """The goals of `struck` by SciPy, from touch to release and on."""
    A, a = (z.real for z in motion(p, 20 * p["mass"]))
    k, d, duration = 1000 * p["stiffness"], 1.6 * (1 - 0.9) / 0.9, 3e-3
    x, t, peak = np.zeros(16), 0.0, 0.0
    touches: list[tuple[float, float]] = []
    x[9] = p["velocity"]  # the last entry is the impulse
    closed, speed = True, x[9]

    def force(x: np.ndarray) -> float:
        depth, rate = x[4] - x[0], x[9] - x[5]
        return float(k * max(depth, 0.0) ** 1.5 * (1 + d * rate / speed))

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        f = force(x) if closed else 0.0
        return np.append(A @ x[:15] + a * f, f)

    def edge(_: float, x: np.ndarray) -> float:
        return float(x[4] - x[0])

    edge.terminal = True  # type: ignore[attr-defined]
    while t < duration:
        edge.direction = -1.0 if closed else 1.0  # type: ignore[attr-defined]
        run = solve_ivp(
            slope, (t, duration), x, "DOP853", rtol=1e-11, atol=1e-15, events=edge,
            first_step=1e-9, dense_output=True,
        )  # fmt: skip
        if closed:
            touches.append((t, run.t[-1]))
            top = run.t[np.argmax([force(y) for y in run.y.T])]
            near = max(t, top - 2e-5), min(run.t[-1], top + 2e-5)
            found = minimize_scalar(
                lambda s, y=run.sol: -force(y(s)),
                bounds=near,
                method="bounded",
                options={"xatol": 1e-13},
            )
            peak = max(peak, -found.fun)
        t, x = float(run.t[-1]), run.y[:, -1]
        closed, speed = not closed, x[9] - x[5]
    return {
        "peak_force": peak,
        "impulse": float(x[15]),
        "restitution": -float(x[9]) / float(p["velocity"]),
        "contact_time": touches[-1][1] - touches[0][0],
    }


#: Relative change of a parameter on either side.
STEP = 1e-4
#: Of the ball and the law in `struck`.
FACTORS = {"mass": 20, "stiffness": 1000}


@pytest.fixture(scope="module")
def ends() -> dict[str, list[Goals]]:
    """Runs of another integrator on either side of each parameter."""
    return {
        name: [integrated(changed(name, s * STEP * size_of(name))) for s in (-1, 1)]
        for name in ("m", "damping", "mass")
    }


@pytest.mark.slow
@pytest.mark.parametrize("goal", ["peak_force", "impulse", "restitution", "contact_time"])
def test_differences_of_another_integrator(
    goal: str, ends: dict[str, list[dict[str, float]]]
) -> None:
    """Goals of several touches, by all parameters."""
    hit = struck(VALUES, tol=1e-8)
    found = ao.gradient(hit, goal)
    assert len(hit.contacts) > 2
    for name, (before, after) in ends.items():
        expected = (after[goal] - before[goal]) / (2 * STEP)
        relative = FACTORS.get(name, 1) * slope_of(found, name) * size_of(name)
        assert abs(relative - expected) < 2e-6 * abs(found.value), name


@pytest.mark.slow
def test_free_model_and_massless_site() -> None:
    """A free body with a damped site that has no mass: a fast pole; by differences of runs."""
    C = np.array([[900.0, -2e3], [-2e3, 5e3]])

    def run(m: float, scale: float = 1.0) -> ao.History:
        damping = ao.DampingMatrix(scale * C)
        body = ao.AntiOscillators(0.0, 0.0, [m], [8e3], damping=damping)
        return ao.simulate(body, ao.RigidMass(0.1, 1.0), ao.Hertz(1e9), 1e-3, tol=1e-9)

    hit = run(0.3)
    for goal in ("peak_force", "restitution"):
        g = ao.gradient(hit, goal)
        by_m, by_damping = (
            (getattr(b, goal) - getattr(a, goal)) / (2 * STEP)
            for a, b in ((run(0.3 * (1 - STEP)), run(0.3 * (1 + STEP))),
                         (run(0.3, 1 - STEP), run(0.3, 1 + STEP)))
        )  # fmt: skip
        assert g.m[0] * 0.3 == pytest.approx(by_m, abs=5e-6 * abs(g.value))
        assert g.damping == pytest.approx(by_damping, abs=5e-6 * abs(g.value))
        assert g.m0 is None
        assert g.k0 is None


@pytest.mark.slow
@pytest.mark.parametrize(("k0", "speed", "gravity"), [(4e6, 0.0, 300.0), (0.0, 0.7, 300.0)])
def test_gravity_and_initial_velocity(k0: float, speed: float, gravity: float) -> None:
    """The modes are loaded, or begin with a speed; by differences of runs."""

    def run(faster: float, more: float) -> ao.History:
        m = np.array([0.3, 0.2 * (1 + more), 0.5])
        body, ball = model(VALUES | {"k0": k0, "m": m}), ao.RigidMass(0.1, 0.5)
        body = replace(body, participation=np.append(VALUES["m0"], VALUES["m"]))
        return ao.simulate(
            body, ball, ao.Flores(1e9, 0.8), 1e-3, tol=1e-9, gravity=gravity,
            initial_velocity=speed * (1 + faster),
        )  # fmt: skip

    hit = run(0.0, 0.0)
    for goal in ("peak_force", "impulse"):
        g = ao.gradient(hit, goal)
        by_speed, by_m = (
            (getattr(run(*step), goal) - getattr(run(*-step), goal)) / (2 * STEP)
            for step in STEP * np.eye(2)
        )
        assert g.m[1] * 0.2 == pytest.approx(by_m, abs=5e-6 * g.value)
        found = g.bodies["structure"].get("initial_velocity", 0.0)
        assert speed * found == pytest.approx(by_speed, abs=5e-6 * g.value)
