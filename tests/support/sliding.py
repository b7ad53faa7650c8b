"""Random masses on springs that rub, and their exact motion.

The truth integrates each phase (free, stick, slip) by itself with `scipy.integrate.solve_ivp` and
locates the events between them; it shares nothing with the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import antiosc as ao
from antiosc.engine import library
from antiosc.engine.march import TOUCH_RESOLUTION, Converged, solve
from antiosc.engine.system import BodyModes, System, system_of_bodies

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """A mass [kg] on tangential springs [N/m], pressed by a force [N] on a normal spring [N/m].

    It is released at `start` [m], one number for each tangential direction, where the normal force
    is `excess` times more than the pressing one.
    """

    mass: float
    springs: tuple[float, ...]
    start: tuple[float, ...]
    pressing: float
    normal: float
    excess: float
    friction: float
    tangential: float
    duration: float


def random_scene(seed: int) -> Scene:
    """Every third one bounces, every third one vibrates under its pressing force, every fourth one
    moves in two directions.
    """
    random = np.random.default_rng(seed)
    mass = 10 ** random.uniform(-1, 1)
    spring = 10 ** random.uniform(3, 6)
    friction = random.uniform(0.05, 0.5)
    pressing = 10 ** random.uniform(0, 2)
    tangential = spring * 10 ** random.uniform(0, 1.5)
    start = friction * pressing / spring * random.uniform(1.5, 40)
    excess = (0.0, random.uniform(0.2, 0.9), random.uniform(1.2, 3.0))[seed % 3]
    normal = spring * 10 ** random.uniform(-1, 1)
    springs, starts = (spring,), (start,)
    if seed % 4 == 3:
        springs += (spring * random.uniform(0.3, 3),)
        starts += (start * random.uniform(-1, 1),)
    periods = random.uniform(2, 8)
    duration = periods * 2 * np.pi * np.sqrt(mass / spring)
    return Scene(mass, springs, starts, pressing, normal, excess, friction, tangential, duration)


def system_of(scene: Scene) -> System:
    """The scene as the engine takes it: the normal mode, then the tangential ones."""
    directions = 1 + len(scene.springs)
    root = np.sqrt(scene.mass)
    pressed = scene.pressing * (1 + scene.excess)
    body = BodyModes(
        omega=np.array([0.0, *(np.sqrt(k / scene.mass) for k in scene.springs)]),
        decay=None,
        beta=np.eye(directions) / root,
        v=np.zeros(directions),
        load=np.array([scene.pressing / root, *[0.0] * len(scene.springs)]),
    )
    law = ao.Linear(scene.normal)
    system = system_of_bodies([body], [law], np.zeros((directions, directions)))
    (row,) = system.contacts
    row["first_tangential"], row["n_tangential"] = 1, len(scene.springs)
    system.q[:] = root * np.array([pressed / scene.normal, *scene.start])
    row["friction"], row["tangential_stiffness"] = scene.friction, scene.tangential
    row["mass"], row["expected_depth"] = scene.mass, pressed / scene.normal
    row["expected_speed"] = pressed / np.sqrt(scene.mass * scene.normal)
    system.start_forces[0] = pressed
    system.contact_energy = pressed**2 / (2 * scene.normal)
    return system


class Truth:
    """The motion y = (z, z', x, x', anchor or angle of the friction) by phases with their ends."""

    def __init__(self, scene: Scene, rtol: float = 1e-10) -> None:
        self.scene, self.rtol = scene, rtol
        self.count = len(scene.springs)
        self.ends: list[float] = []
        self.pieces: list[tuple[str, Callable[[Array], Array]]] = []
        stiffest = max(scene.normal, scene.tangential + max(scene.springs))
        self.longest = 0.5 * np.sqrt(scene.mass / stiffest)
        depth = scene.pressing * (1 + scene.excess) / scene.normal
        start, rest = np.array(scene.start), np.zeros(self.count)
        self._solve(np.array([depth, 0.0, *start, *rest, *start, 0.0]))

    def _parts(self, y: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Depth, x, x', anchors and the unit vector of sliding friction."""
        n = self.count
        unit = np.array([np.cos(y[-1]), np.sin(y[-1])][:n])
        return y[0], y[2 : 2 + n], y[2 + n : 2 + 2 * n], y[2 + 2 * n : 2 + 3 * n], unit

    def _most(self, y: Array) -> Array:
        return self.scene.friction * self.scene.normal * np.maximum(y[0], 0.0)

    def friction(self, phase: str, y: Array) -> Array:
        """Forces (n,) of friction [N] in a phase."""
        _, x, _, anchor, unit = self._parts(y)
        if phase == "free":
            return 0.0 * x
        return self.scene.tangential * (x - anchor) if phase == "stick" else self._most(y) * unit

    def _rates(self, phase: str, y: Array) -> Array:
        scene, n = self.scene, self.count
        _, x, rate, _, unit = self._parts(y)
        normal = 0.0 if phase == "free" else scene.normal * y[0]
        T = self.friction(phase, y)
        change = np.zeros_like(y)
        change[0], change[1] = y[1], (scene.pressing - normal) / scene.mass
        change[2 : 2 + n] = rate
        change[2 + n : 2 + 2 * n] = -(np.array(scene.springs) * x + T) / scene.mass
        if phase == "slip" and n == 2:
            across = rate[1] * unit[0] - rate[0] * unit[1]
            change[-1] = scene.tangential * across / max(self._most(y), 1e-7 * scene.pressing)
        return change

    def _ends_of(self, phase: str) -> list[Callable[[float, Array], float]]:
        """Functions that rise through 0 where the phase ends."""
        scene = self.scene

        def touch(_: float, y: Array) -> float:
            return y[0]

        def release(_: float, y: Array) -> float:
            return -y[0]

        def slips(_: float, y: Array) -> float:
            beyond = np.linalg.norm(self.friction("stick", y)) - self._most(y)
            return float(beyond) - 1e-12 * scene.friction * scene.pressing  # not at its start

        def sticks(_: float, y: Array) -> float:
            _, _, rate, _, unit = self._parts(y)
            return scene.friction * scene.normal * y[1] / scene.tangential - float(rate @ unit)

        found = {"free": [touch], "stick": [release, slips], "slip": [release, sticks]}[phase]
        for event in found:
            event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
        return found

    def _next(self, phase: str, which: int, y: Array) -> tuple[str, Array]:
        """The phase that follows, and its start."""
        n = self.count
        _, x, rate, anchor, unit = self._parts(y)
        y = y.copy()
        slides = x - anchor
        if phase != "free" and which == 0:
            return "free", y
        if phase == "free":
            y[2 + 2 * n : 2 + 3 * n] = x
            slides = rate
            grows = self.scene.tangential * np.linalg.norm(rate)
            if grows <= self.scene.friction * self.scene.normal * y[1]:
                return "stick", y
        elif phase == "slip":
            y[2 + 2 * n : 2 + 3 * n] = x - self._most(y) * unit / self.scene.tangential
            return "stick", y
        y[-1] = np.arctan2(slides[1], slides[0]) if n == 2 else np.arccos(np.sign(slides[0]))
        return "slip", y

    def _grazes(self, phase: str, solution: Any) -> float | None:
        """When friction's event first rises for less than a step, which the solver does not see."""
        if phase == "free":
            return None
        event, t = self._ends_of(phase)[1], solution.t

        def below(s: float) -> float:
            return -event(s, solution.sol(s))

        values = np.array([event(s, y) for s, y in zip(t, solution.y.T, strict=True)])
        padded = np.concatenate([[-np.inf], values, [-np.inf]])
        tops = np.flatnonzero((padded[:-2] <= values) & (values >= padded[2:]))
        for i in tops:
            low, high = t[max(i - 1, 0)], t[min(i + 1, t.size - 1)]
            top = minimize_scalar(below, bounds=(low, high), method="bounded").x
            if below(top) < -1e-12 * np.abs(values).max() and below(low) > 0.0:
                return float(brentq(below, low, top))
        return None

    def _solve(self, y: Array) -> None:
        t, phase, end = 0.0, "stick", self.scene.duration
        while t < end:
            with np.errstate(over="ignore"):  # Radau's steps for numbers that nothing depends on
                solution = solve_ivp(
                    lambda _, y, phase=phase: self._rates(phase, y),
                    (t, end),
                    y,
                    method="Radau" if phase == "slip" and self.count == 2 else "DOP853",
                    events=self._ends_of(phase),
                    dense_output=True,
                    rtol=1e-8 if phase == "slip" and self.count == 2 else self.rtol,
                    atol=1e-12 * np.abs(y[:-1]).max(),
                    max_step=self.longest,
                )
            assert solution.status >= 0, solution.message
            self.pieces.append((phase, solution.sol))
            t, y = solution.t[-1], solution.y[:, -1]
            which = [i for i, times in enumerate(solution.t_events) if times.size > 0]

            grazes = self._grazes(phase, solution)
            if grazes is not None and grazes < t:
                t, y, which = grazes, solution.sol(grazes), [1]

            self.ends.append(t)
            if which:
                phase, y = self._next(phase, which[0], y)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Forces (., 1 + n) [N] and tangential displacements (., n) [m] at times."""
        forces, ways = [], []
        piece = np.minimum(np.searchsorted(self.ends, times), len(self.ends) - 1)
        for t, i in zip(times, piece, strict=True):
            phase, solution = self.pieces[i]
            y = solution(t)
            normal = 0.0 if phase == "free" else self.scene.normal * y[0]
            forces.append([normal, *self.friction(phase, y)])
            ways.append(y[2 : 2 + self.count])
        return np.array(forces), np.array(ways)


@dataclass(frozen=True)
class Errors:
    """Relative errors: of forces and peaks as `Converged` claims them, of the displacement."""

    force: float
    peak: float
    way: float


def errors(truth: Truth, found: Converged) -> Errors:
    """The errors of a run; displacements over their largest."""
    run = found.run
    t, h = run.time[:-1:2], np.diff(run.time[::2])
    f0, f1, f2 = run.force[:-1:2], run.force[1::2], run.force[2::2]
    difference, size, shift, impulse = 0.0, 0.0, 0.0, 0.0
    highest = np.zeros((2, f0.shape[1]))
    points, weights = np.polynomial.legendre.leggauss(3)
    for u, weight in zip((1 + points) / 2, weights / 2, strict=True):
        ours = f0 + u * (4 * f1 - 3 * f0 - f2 + 2 * u * (f0 - 2 * f1 + f2))
        exact = truth.at(t + u * h)[0]
        difference = difference + weight * h @ (ours - exact) ** 2
        shift = shift + weight * h @ (ours - exact)
        size += weight * h @ exact[:, 0] ** 2
        impulse += weight * h @ np.abs(exact[:, 0])
    exact, ways = truth.at(run.time)
    highest = np.abs([exact, run.force]).max(axis=1)
    most = highest[0, 0]
    force = max(float(np.sqrt(difference.max() / size)), float(np.abs(shift).max() / impulse))
    peak = float(np.abs(highest[0] - highest[1]).max() / most)
    deviation = float(np.abs(run.depth[:, 1:] - ways).max() / np.abs(ways).max())
    return Errors(force, peak, deviation)


def run_scene(scene: Scene, tol: float) -> Converged:
    """The engine's run."""
    period = np.pi * np.sqrt(scene.mass / scene.normal)
    options = library.COptions(
        scene.duration, tol, 0.0, 0.0, period / TOUCH_RESOLUTION, 10_000, 2_000_000, 0
    )
    run, found = solve(system_of(scene), options)
    return Converged(run, found.share, found.force, found.peak, found.certain)
