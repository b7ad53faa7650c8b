"""Bodies that fall without meshes, and integrations of their falls that know no episodes."""

from __future__ import annotations

from itertools import product
from math import cos, sin
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import antiosc as ao
from antiosc.engine.contact.surfaces import RIGID_MATTER
from antiosc_studies.drops.episode import Episode
from antiosc_studies.drops.fall import initial_state
from antiosc_studies.drops.flight import rotation_matrices
from antiosc_studies.drops.floor import Setting
from antiosc_studies.drops.free_body import FreeBody, State
from antiosc_studies.drops.orientation import tilt_rotation

G = 9.80665

HALF = np.array([0.075, 0.035, 0.004])
CORNERS = HALF * np.array(list(product((-1, 1), repeat=3)))


def block(mass: float = 0.3, half: np.ndarray = HALF) -> ao.RigidBody:
    x, y, z = half
    moments = mass / 3 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    sites = {f"{i}": (p * half / HALF, (0, 0, 1)) for i, p in enumerate(CORNERS)}
    return ao.RigidBody(mass, moments, sites)


def bar(modes: int = 2) -> FreeBody:
    """A flat steel bar along x that bends in x and z: free Bernoulli modes, tips that touch."""
    length, width, height, rho, E = 0.15, 0.07, 0.008, 7800.0, 210e9
    mass = rho * length * width * height
    roots = [4.730040744862704, 7.853204624095838, 10.995607838001671][:modes]
    stiff = np.sqrt(E * height**2 / (12 * rho))
    omega = np.array([(root / length) ** 2 * stiff for root in roots])

    def shape(root: float, x: float) -> float:
        s = (np.cosh(root) - np.cos(root)) / (np.sinh(root) - np.sin(root))
        k = root * (x / length + 0.5)
        return np.cosh(k) + np.cos(k) - s * (np.sinh(k) + np.sin(k))

    points = np.array([[s * length / 2, 0.0, -height / 2] for s in (-1, 1)])
    shapes = np.zeros((2, modes, 3))
    shapes[:, :, 2] = [[shape(r, x) / np.sqrt(mass) for r in roots] for x, _, _ in points]
    moments = mass / 12 * np.array([width**2 + height**2, length**2 + height**2, length**2])
    return FreeBody(
        mass, np.diag(moments), points, np.zeros(3), np.zeros(2), np.full((2, 2), 1e-3),
        np.full(2, RIGID_MATTER, dtype=object), omega, 0.002 * omega, shapes, length,
    )  # fmt: skip


def setting(law: ao.ContactLaw, friction: float = 0.0, **rest: float) -> Setting:
    given = {"gravity": G, "height": 0.2, "impacts": 2, "duration": np.inf, "tol": 1e-4} | rest
    return Setting(ao.Floor(law=law, friction=friction), **given)  # type: ignore[arg-type]


def started(body: FreeBody, where: Setting, tilt: tuple[float, ...]) -> State:
    return initial_state(body, where, tilt_rotation(np.array(tilt)), np.zeros(3), np.zeros(3))


def landed(body: FreeBody, one: Episode, k: float, friction: float) -> tuple[np.ndarray, ...]:
    """Euler's equations through an episode, by the leapfrog: R, velocity, L and the peak force.

    The friction of each corner is that of a spring which slides.
    """
    s, inverse, down = one.start, np.linalg.inv(body.inertia), np.array([0.0, 0.0, 1.0])
    stiff = float(one.history.assembly.system.contacts["tangential_stiffness"][0]) or 1.0
    x, v, R, L = s.centre, s.velocity, s.R, s.angular_momentum
    drawn, peak, steps = np.zeros((len(body.points), 2)), 0.0, 500
    h = one.duration / steps
    way = h / 2
    for n in range(steps + 1):
        spin = R @ inverse @ R.T @ L
        middle = rotation_matrices(spin * way / 2) @ R
        R = rotation_matrices(middle @ inverse @ middle.T @ L * way) @ R
        x = x + v * way
        if n == steps:
            break
        spin, arms = R @ inverse @ R.T @ L, body.points @ R.T - body.ball_radii[:, None] * down
        N = k * np.maximum(-x[2] - arms[:, 2], 0.0) ** 1.5
        drawn = np.where(N[:, None] > 0, drawn + h * (v + np.cross(spin, arms))[:, :2], 0.0)
        size = np.maximum(np.linalg.norm(drawn, axis=1), 1e-300)
        drawn *= np.minimum(friction * N / (stiff * size), 1.0)[:, None]
        F = np.column_stack((-stiff * drawn, N)) if friction else N[:, None] * down
        v, L = v + h * (F.sum(axis=0) / body.mass - G * down), L + h * np.cross(arms, F).sum(axis=0)
        peak, way = max(peak, float(N.sum())), h / 2 if n == steps - 1 else h
    return R, v, L, peak


def pressed(part: ao.RigidBody, half: np.ndarray, start: State, c: float) -> tuple[Any, ...]:
    """A block on springs under each area: when it parts, then v, R and L, and the peak force.

    In one integration that sums the depths of midpoints on the faces; c is E/t [N/m^3].
    """
    edges = -np.cos(np.linspace(0.0, np.pi, 101))  # cells are small next to the edges of the block
    u, w = np.meshgrid(*[(edges[1:] + edges[:-1]) / 2] * 2)
    faces = np.stack(
        [np.stack([u.ravel(), w.ravel(), np.full(u.size, s)]) for s in (-1, 1)], axis=1
    )
    x = np.concatenate([np.roll(faces, k, axis=0).reshape(3, -1).T for k in range(3)]) * half
    cells = np.tile(np.outer(np.diff(edges), np.diff(edges)).ravel(), 6)
    sides = np.repeat([[0, 0, 1], [1, 0, 0], [0, 1, 0]], 2 * u.size, axis=0) * np.sign(x)
    areas = half.prod() * cells[:, None] * sides / half
    inverse = np.linalg.inv(np.asarray(part.inertia))

    def force(y: np.ndarray) -> tuple[float, np.ndarray]:
        R = y[5:].reshape(3, 3)
        down = np.maximum(-areas @ R[2], 0.0)
        F = c * down * np.maximum(-y[0] - x @ R[2], 0.0)
        arm = R @ (F @ x)
        return float(F.sum()), np.array([arm[1], -arm[0]])

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        R, L = y[5:].reshape(3, 3), np.append(y[2:4], y[4])
        N, torque = force(y)
        turning = np.cross(R @ inverse @ R.T @ L, R, axisb=0, axisc=0)
        return np.concatenate(([y[1], N / part.mass - G], torque, [0.0], turning.ravel()))

    def parted(_: float, y: np.ndarray) -> float:
        return float(y[0] - np.abs(y[11:]) @ half)

    parted.terminal, parted.direction = True, 1.0  # type: ignore[attr-defined]
    y = np.concatenate(([start.centre[2], start.velocity[2]], start.momentum, start.R.ravel()))
    end = solve_ivp(rate, (0, 0.03), y, rtol=1e-6, atol=1e-9, max_step=5e-5, events=parted)
    F, last = np.array([force(each)[0] for each in end.y.T]), end.y[:, -1]
    return end.t[-1], last[1], last[5:].reshape(3, 3), last[2:5], top(end.t, F)


def floating(body: FreeBody, start: State, k: float, until: float) -> list[float]:
    """Peak forces of the impacts of the plane bar, all in one nonlinear integration."""
    mass, inertia = body.mass, float(body.inertia[1, 1])
    (x0, _, h0), (x1, _, h1) = body.points.tolist()
    (s00, s01), (s10, s11) = body.shapes[:, :, 2].tolist()
    (w0, w1), (d0, d1) = (body.omega**2).tolist(), (2 * body.decay).tolist()

    def forces(z: float, a: float, q0: float, q1: float) -> tuple[float, ...]:
        c, s = cos(a), sin(a)
        b0, b1 = h0 + s00 * q0 + s01 * q1, h1 + s10 * q0 + s11 * q1
        low0, low1 = s * x0 - c * b0 - z, s * x1 - c * b1 - z
        F0, F1 = k * max(low0, 0.0) ** 1.5, k * max(low1, 0.0) ** 1.5
        return F0, F1, F0 * (c * x0 + s * b0) + F1 * (c * x1 + s * b1), c

    def rate(_: float, y: np.ndarray) -> list[float]:
        z, a, q0, q1, *rates = y.tolist()
        F0, F1, torque, c = forces(z, a, q0, q1)
        *_, p0, p1 = rates
        bent0 = (s00 * F0 + s10 * F1) * c - w0 * q0 - d0 * p0
        bent1 = (s01 * F0 + s11 * F1) * c - w1 * q1 - d1 * p1
        return [*rates, (F0 + F1) / mass - G, -torque / inertia, bent0, bent1]

    tilt = np.arctan2(start.R[0, 2], start.R[0, 0])  # about y
    y = np.concatenate(([start.centre[2], tilt], start.q, [start.velocity[2], 0.0], start.p))
    found = solve_ivp(rate, (0, until), y, "DOP853", rtol=1e-8, atol=1e-11, max_step=4e-5)
    assert found.success
    F = np.array([sum(forces(*each[:4])[:2]) for each in found.y.T.tolist()])
    on = np.flatnonzero(F > 0)
    parts = np.split(on, np.flatnonzero(np.diff(found.t[on]) > 3e-4) + 1)
    return [top(found.t[part], F[part]) for part in parts]


def top(t: np.ndarray, F: np.ndarray) -> float:
    """The largest value of a smooth curve through points."""
    near = slice(max(int(np.argmax(F)) - 3, 0), int(np.argmax(F)) + 4)
    curve = CubicSpline(t[near], F[near])
    return float(curve(np.linspace(t[near][0], t[near][-1], 2000)).max())
