"""Random impacts of one contact, and their goals by an independent integrator, SciPy's DOP853.

The bodies are the coordinates of the article, with a mass matrix, not modes; the contact is a force
by its law's formula, and touches and releases are events.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import antiosc as ao
from antiosc.impact.states import main_contact_time

GOALS = ("peak_force", "impulse", "contact_time", "restitution")
END = 3e-3
Numbers = dict[str, Any]


def numbers_of(seed: int) -> Numbers:
    """The numbers of a random impact."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    k = 10 ** rng.uniform(8, 9.3)
    return {
        "m0": rng.uniform(0.02, 0.1), "k0": 10 ** rng.uniform(4, 6), "m": rng.uniform(0.03, 0.3, n),
        "omega": np.sort(10 ** rng.uniform(3.2, 4.5, n)), "mass": rng.uniform(0.05, 0.5),
        "velocity": rng.uniform(0.5, 2.0), "gap": rng.uniform(1e-6, 5e-5),
        "stiffness": k / 100 if seed % 3 == 1 else k, "restitution": rng.uniform(0.4, 0.95),
        "pull": float(40.0 * (seed % 4 == 3)), "kind": ("hertz", "linear", "flores")[seed % 3],
    }  # fmt: skip


def law(x: Numbers) -> ao.ContactLaw:
    """The law of an impact."""
    if x["kind"] == "flores":
        return ao.Flores(x["stiffness"], x["restitution"])
    return (ao.Hertz if x["kind"] == "hertz" else ao.Linear)(x["stiffness"])


def struck(x: Numbers) -> ao.SceneHistory:
    """The impact by the engine, as a user runs it."""
    model = ao.AntiOscillators(m0=x["m0"], k0=x["k0"], m=x["m"], omega=x["omega"])
    bodies = {"part": model, "ball": ao.RigidMass(x["mass"], x["velocity"])}
    contact = ao.Contact("part", "ball", law(x), gap=x["gap"])
    pulls = [ao.Load("ball", [0.0, 1.0], [x["pull"]] * 2)]
    return ao.Scene(bodies, [contact], loads=pulls if x["pull"] else ()).run(END)


def expected(x: Numbers) -> dict[str, float]:
    """The goals by DOP853, from one touch or release to the next."""
    n = len(x["m"])
    M = np.diag(np.append(x["m0"], x["m"]))
    k = x["m"] * x["omega"] ** 2
    K = np.diag(np.append(x["k0"] + k.sum(), k))
    K[0, 1:] = K[1:, 0] = -k
    size = n + 2  # of the model and the ball
    speed = [x["velocity"]]
    inverse = np.linalg.inv(M)
    A = np.zeros((2 * size + 1, 2 * size + 1))
    A[:size, size : 2 * size] = np.eye(size)
    A[size : size + n + 1, : n + 1] = -inverse @ K
    pulled, pushed = np.zeros((2, 2 * size + 1))
    pulled[2 * size - 1] = x["pull"] / x["mass"]
    pushed[size : size + n + 1] = inverse[0]
    pushed[2 * size - 1 :] = -1 / x["mass"], 1.0

    def depth(y: np.ndarray) -> float:
        return float(y[n + 1] - y[0] - x["gap"])

    def force(y: np.ndarray) -> float:
        d, rate = depth(y), float(y[size + n + 1] - y[size])
        if x["kind"] == "linear":
            return float(x["stiffness"] * d)
        elastic = float(x["stiffness"] * max(d, 0.0) ** 1.5)
        if x["kind"] == "hertz":
            return elastic
        e = x["restitution"]
        return elastic * float(1 + 8 / 5 * (1 - e) / e * rate / speed[0])

    def rates(_: float, y: np.ndarray, closed: bool) -> np.ndarray:
        linear: np.ndarray = A @ y + pulled
        return linear + force(y) * pushed if closed else linear

    def edge(_: float, y: np.ndarray, closed: bool) -> float:
        return force(y) if closed and x["kind"] == "flores" and depth(y) > 0 else depth(y)

    y = np.zeros(2 * size + 1)
    y[2 * size - 1] = x["velocity"]
    t, closed = 0.0, False
    spans: list[list[float]] = []
    peak, parted = 0.0, 0.0
    approach = 0.0
    while t < END:
        crossing = lambda s, z, c=closed: edge(s, z, c)  # noqa: E731
        crossing.terminal, crossing.direction = True, -1.0 if closed else 1.0
        found = solve_ivp(
            lambda s, z, c=closed: rates(s, z, c), (t, END), y, "DOP853", events=crossing,
            rtol=1e-12, atol=1e-15, dense_output=closed, max_step=2e-5,
        )  # fmt: skip
        if closed:
            forces = np.array([force(z) for z in found.y.T])
            i = int(np.argmax(forces))
            ends = found.t[max(i - 1, 0)], found.t[min(i + 1, len(forces) - 1)]
            best = minimize_scalar(
                lambda s, sol=found.sol: -force(sol(s)), bounds=ends, method="bounded",
                options={"xatol": 1e-13},
            )  # fmt: skip
            peak = max(peak, -best.fun)
        t, y = float(found.t[-1]), found.y[:, -1]
        if found.status != 1:
            break
        closed = not closed
        if closed:
            speed[0] = float(y[size + n + 1] - y[size])
            approach = approach or float(y[2 * size - 1])
            spans.append([t, t, -y[-1]])
        else:
            spans[-1][1:] = [t, spans[-1][2] + y[-1]]
            parted = -float(y[2 * size - 1])
    return {
        "peak_force": peak,
        "impulse": float(y[-1]),
        "contact_time": main_contact_time([(a, b, j) for a, b, j in spans]),
        "restitution": parted / approach,
    }


def parameters(x: Numbers) -> list[str]:
    """The numbers whose derivatives are compared."""
    names = ["m0", "k0", "m", "omega", "mass", "velocity", "gap", "stiffness"]
    return [*names, "restitution"] if x["kind"] == "flores" else names


def changed(x: Numbers, name: str, factor: float) -> Numbers:
    """The numbers with one of them, or the first of an array, times a factor."""
    value = np.array(x[name], dtype=float)
    value[(0,) if value.ndim else ()] *= factor
    return {**x, name: value if value.ndim else float(value)}


def rows(seed: int, h: float = 3e-4) -> list[tuple[str, str, float, float]]:
    """(goal, number, error of its derivative, told error), both over the goal by the number."""
    x = numbers_of(seed)
    hit = struck(x)
    slopes = {name: _slopes(x, name, h) for name in parameters(x)}
    found = []
    for goal in GOALS:
        g = ao.gradient(hit, goal)
        for name, slope in slopes.items():
            size = float(np.ravel(x[name])[0]) / g.value
            mine, bar = (_of(one, name) * size for one in (g, g.error))
            found.append((goal, name, abs(mine - slope[goal] / g.value), abs(bar)))
    return found


def _of(g: ao.Gradient, name: str) -> float:
    """The derivative by a number, or by the first of an array."""
    tree = g.bodies["part"] | g.bodies["ball"] | g.contacts["part", "ball"]
    return float(np.ravel(tree[name])[0])


def _slopes(x: Numbers, name: str, h: float) -> dict[str, float]:
    """Derivatives of all goals by ln of a number: of two differences, extrapolated."""
    both = []
    for step in (h, h / 2):
        ends = [expected(changed(x, name, 1 + side * step)) for side in (-1, 1)]
        both.append({goal: (ends[1][goal] - ends[0][goal]) / (2 * step) for goal in GOALS})
    return {goal: (4 * both[1][goal] - both[0][goal]) / 3 for goal in GOALS}
