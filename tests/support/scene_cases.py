"""Scenes of several contacts that several tests run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import antiosc as ao
from direct import chain, free_modes

Array = NDArray[np.float64]
UP = (0.0, 0.0, 1.0)

CORNERS = {"a": (0.1, 0.06), "b": (0.1, -0.06), "c": (-0.1, 0.06), "d": (-0.1, -0.06)}


def plate(law: ao.ContactLaw, tilt: float) -> tuple[ao.Scene, Array]:
    """A rigid plate that falls on springs at its corners, flat or tilted, and its gaps."""
    sites = {name: ((x, y, 0.0), UP) for name, (x, y) in CORNERS.items()}
    gaps = np.array([tilt * (x + 0.3 * y) for x, y in CORNERS.values()])
    gaps -= gaps.min()
    body = ao.RigidBody(2.0, (2 * 0.06**2 / 3, 2 * 0.1**2 / 3, 2 * 0.0136 / 3), sites)
    contacts = [
        ao.Contact(f"plate:{c}", "floor", law, gap=float(g))
        for c, g in zip(CORNERS, gaps, strict=True)
    ]
    motion = {"plate": ao.Motion(velocity=(0, 0, -1.0))}
    bodies = {"plate": body, "floor": ao.Obstacle()}
    return ao.Scene(bodies, contacts, gravity=(0, 0, -9.81), motion=motion), gaps


def rod_between_walls(n: float) -> tuple[ao.Scene, Array, Array]:
    k = 11 / 12 * 11 * 5000.0**2 / 11
    masses = np.full(12, 1 / 11)
    masses[[0, -1]] /= 2
    K, M = chain(12, k, masses, held=False)
    B = np.eye(12)[:, [0, 11]]
    omega, b = free_modes(K, M, B)
    # the middle of the rod is pushed for a moment, so that it flies to the left wall
    b = np.column_stack((b, free_modes(K, M, np.ones((12, 1)) / 12)[1]))
    rod = ao.SiteModes(omega, b, ("left", "right", "all"))
    law = ao.Power(1e8 if n == 1 else 1e10, n)
    contacts = [
        ao.Contact("rod:left", "wall", law, gap=1e-4),
        ao.Contact("other", "rod:right", law, gap=2e-4),
    ]
    load = ao.Load("rod:all", [0, 1e-4, 2e-4], [0, -3e4, 0])
    bodies = {"rod": rod, "wall": ao.Obstacle(), "other": ao.Obstacle()}
    return ao.Scene(bodies, contacts, loads=[load]), K, M


def stops() -> tuple[ao.Scene, Array, Array, Array, Array, Array]:
    """A chain with nine stops that a hammer strikes at its tenth site; the physical system."""
    rng = np.random.default_rng(1)
    K, M = chain(20, 1e6, rng.uniform(0.05, 0.2, 20), held=True)
    omega, b = free_modes(K, M, np.eye(20)[:, ::2])
    gaps = np.append(rng.uniform(1e-5, 3e-4, 10)[:9], 0.0)
    law = ao.Hertz(1e9)
    names = [f"s{i}" for i in range(10)]
    contacts = [
        ao.Contact("ground", f"chain:{s}", law, gap=float(g))
        for s, g in zip(names[:9], gaps[:9], strict=True)
    ]
    contacts.append(ao.Contact("chain:s9", "hammer", law))
    bodies = {
        "chain": ao.SiteModes(omega, b, names),
        "ground": ao.Obstacle(),
        "hammer": ao.RigidMass(1.0, 3.0),
    }
    whole_K, whole_M, rows = np.zeros((21, 21)), np.eye(21), np.zeros((10, 21))
    whole_K[:20, :20], whole_M[:20, :20] = K, M
    for i in range(9):
        rows[i, 2 * i] = 1
    rows[9, 18], rows[9, 20] = -1, 1
    start = np.zeros(21)
    start[20] = 3.0
    return ao.Scene(bodies, contacts), whole_K, whole_M, rows, gaps, start


LAWS = [
    ao.Linear(1e7),
    ao.Hertz(1e10),
    ao.Hertz(1e10, 2e-9),
    ao.Power(1e9, 2.0),
    ao.HuntCrossley(1e10, 0.7),
    ao.Flores(1e10, 0.3),
    ao.Gonthier(1e7, 0.5, exponent=1.0),
    ao.Thornton(1e10, 1e-5),
    ao.YangSun(1e10, 1e-6),
    ao.Tabulated(
        np.linspace(0, 1e-3, 9),
        1e8 * np.linspace(0, 1e-3, 9) ** 1.3,
        (np.linspace(3e-4, 1e-3, 9), 1e8 * 1e-3**1.3 * np.linspace(0, 1, 9) ** 1.6),
    ),
    ao.Tabulated(np.linspace(0, 1e-3, 9), 1e8 * np.linspace(0, 1e-3, 9) ** 1.3),
]


def ball(vx: float, friction: float, law: ao.ContactLaw, kt: float | None = None) -> ao.Scene:
    """A ball of 0.3 kg and 20 mm that falls on the floor at 1 m/s, and vx along it."""
    moment = 0.4 * 0.3 * 0.02**2
    body = ao.RigidBody(0.3, (moment,) * 3, {"foot": ((0, 0, -0.02), UP)})
    contact = ao.Contact("ball:foot", "floor", law, friction=friction, tangential_stiffness=kt)
    start = ao.Motion(velocity=(vx, 0.0, -1.0), spin=(3.0, 0.0, 5.0) if vx > 2 else (0, 0, 0))
    return ao.Scene({"ball": body, "floor": ao.Obstacle()}, [contact], motion={"ball": start})


def bounce() -> ao.Scene:
    """A mass of 1 kg that strikes a stiff wall at 1 m/s."""
    bodies = {"m": ao.RigidMass(1.0, 1.0), "w": ao.Obstacle()}
    return ao.Scene(bodies, [ao.Contact("w", "m", ao.Linear(1e6))])


def random_law(rng: np.random.Generator) -> ao.ContactLaw:
    k, depth = 10 ** rng.uniform(6, 10), 10 ** rng.uniform(-7, -4)
    return [
        ao.Linear(10 ** rng.uniform(4, 8)),
        ao.Hertz(k),
        ao.Power(k, rng.uniform(1, 3)),
        ao.HuntCrossley(k, rng.uniform(0.2, 1)),
        ao.Thornton(k, depth),
        ao.Gonthier(k, 0.5),
        ao.YangSun(k, depth),
    ][rng.integers(7)]


def random_scene(seed: int) -> ao.Scene:
    """One to four chains and masses with one to six contacts, loads, residual compliance."""
    rng = np.random.default_rng(seed)
    bodies, ends = {"floor": ao.Obstacle(), "wall": ao.Obstacle()}, ["floor"]
    for i in range(int(rng.integers(1, 5))):
        name, sites = f"b{i}", int(rng.integers(1, 4))
        if rng.random() < 0.3:
            bodies[name] = ao.RigidMass(10 ** rng.uniform(-2, 1), rng.uniform(-3, 5))
            ends.append(name)
            continue
        n = int(rng.integers(2, 12))
        K, M = chain(n, 10 ** rng.uniform(4, 7), rng.uniform(0.02, 0.3, n), rng.random() < 0.5)
        omega, b = free_modes(K, M, np.eye(n)[:, rng.integers(0, n, sites)])
        a = rng.normal(size=(sites, sites)) * (rng.random() < 0.3)
        names = [f"s{j}" for j in range(sites)]
        bodies[name] = ao.SiteModes(
            omega,
            np.tile(b, 2),
            [*names, *(f"{s}'" for s in names)],
            r=np.tile(a @ a.T * 1e-8, (2, 2)),
            decay=0.01 * (rng.random() < 0.5) * omega,
        )
        ends += [f"{name}:{s}" for s in names]
    pairs = {tuple(map(str, rng.choice(ends, 2, replace=False))) for _ in range(rng.integers(1, 7))}
    contacts = [
        ao.Contact(a, b, random_law(rng), gap=float(rng.choice([0, 10 ** rng.uniform(-6, -3)])))
        for a, b in _each_once(sorted(pairs))
    ]
    times, forces = np.sort(rng.uniform(0, 5e-3, 3)), rng.normal(size=3) * 10 ** rng.uniform(0, 3)
    return ao.Scene(bodies, contacts, loads=[ao.Load(str(rng.choice(ends[1:])), times, forces)])


def _each_once(pairs: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The pairs; one that is there in reverse too gets another obstacle or site there, or goes."""

    def apart(a: str, b: str) -> tuple[str, str]:
        if "floor" in (a, b):
            return ("wall", b) if a == "floor" else (a, "wall")
        return (f"{a}'", b) if ":" in a else (a, f"{b}'" if ":" in b else b)

    kept = [apart(a, b) if a > b and (b, a) in pairs else (a, b) for a, b in pairs]
    return [(a, b) for a, b in kept if a < b or (b, a) not in kept]
