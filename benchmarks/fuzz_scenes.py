"""Random scenes of one to four bodies and one to six contacts: no NaN, no hang, no lost momentum.

Every scene draws chains of masses, rigid bodies and single masses, their contacts with each other
and with the ground, laws, friction, gaps, loads, gravity and a moving ground. For each the run
checks

- all results are finite, the contact forces never negative and friction within its cone,
- momentum: what each rigid-body mode gains is the impulse of forces and loads, to 1e-10,
- energy: a run that says that it completed has gained less than 1e-3 of the highest energy,
- CPU time: no scene takes more than its budget,
- what is refused is told in an antiosc error, anything else is a failure.

    .venv/bin/python benchmarks/fuzz_scenes.py --scenes 1000 --first 0
"""

from __future__ import annotations

import argparse
import inspect
import time
import warnings
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import options
from numpy.typing import NDArray

import antiosc as ao

Array = NDArray[np.float64]
Rng = np.random.Generator

MOMENTUM, GAIN, CONE = 1e-10, 1e-3, 1e-6
DURATION = 5e-3
UP = (0.0, 0.0, 1.0)


def main(scenes: int = 1000, first: int = 0, budget: float = 10.0) -> dict[str, Any]:
    """Run the scenes `first` to `first + scenes - 1`; return the counts and the worst figures.

    Parameters
    ----------
    scenes : number of scenes
    first : number of the first scene, which is the seed of its random numbers
    budget : seconds of CPU after which one scene counts as hanging
    """
    counts: Counter[str] = Counter()
    failures: list[str] = []
    figures: dict[str, list[float]] = {"momentum": [], "gain": [], "drift": [], "seconds": []}
    for number in range(first, first + scenes):
        began, seconds = time.process_time(), 0.0
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", ao.AntioscWarning)
                scene = draw(number)
                hit = scene.run(DURATION)
                seconds = time.process_time() - began
                wrong, found = check(hit)
            for name, value in found.items():
                figures[name].append(value)
            counts[f"status {hit.status}"] += 1
            counts["contacts"] += len(scene.contacts)
            counts["touches"] += hit.run.touches
        except ao.AntioscError as error:
            counts[f"refused: {type(error).__name__}"] += 1
            wrong = "" if expected(error) else f"{type(error).__name__}: {error}"
        except Exception as error:  # a failure of any kind is what is looked for
            wrong = f"{type(error).__name__}: {error}"
        figures["seconds"].append(seconds)
        if seconds > budget:
            wrong = f"took {seconds:.1f} s of CPU. {wrong}"
        if wrong:
            failures.append(f"scene {number}: {wrong}")
    return {"scenes": scenes, "failures": failures, "counts": dict(counts), "figures": figures}


def check(hit: ao.SceneHistory) -> tuple[str, dict[str, float]]:
    """What is wrong with a history, if anything; its momentum and energy errors."""
    run, energy = hit.run, hit.energy
    pairs = [(c.a, c.b) for c in hit.assembly.scene.contacts]
    arrays = [run.time, run.force, run.depth, energy.total, *(b.q for b in hit.bodies.values())]
    if not all(np.all(np.isfinite(a)) for a in arrays):
        return "not finite", {}
    if np.any(np.diff(run.time) < 0):
        return "time runs backwards", {}
    for c, pair in enumerate(pairs):
        contact = hit[pair]
        if contact.force.min() < 0:
            return f"negative force {contact.force.min():g} N between {pair}", {}
        if contact.friction.shape[1]:
            over = np.linalg.norm(contact.friction, axis=1)
            over -= hit.assembly.system.contacts["friction"][c] * contact.force
            if over.max() > CONE * contact.peak_force:
                return f"friction leaves its cone by {over.max():g} N between {pair}", {}
    momentum = momentum_error(hit)
    highest = float(np.max(energy.kinetic + energy.strain + energy.contact))
    gain = float(np.max(energy.total - energy.total[0])) / highest if highest else 0.0
    found = {"momentum": momentum, "gain": gain}
    if hit.status in (0, 3):
        found["drift"] = energy.drift
        if gain > GAIN:
            return f"gained {gain:.1e} of its highest energy", found
    if momentum > MOMENTUM:
        return f"momentum error {momentum:.1e}", found
    return "", found


def expected(error: ao.AntioscError) -> bool:
    """Refusals that a scene may meet: a force beyond the range of its law."""
    return isinstance(error, ao.AccuracyError) and "the peak force" in str(error)


def momentum_error(hit: ao.SceneHistory) -> float:
    """Largest error of the momentum of a rigid-body mode, relative to what it was given."""
    system, run = hit.assembly.system, hit.run
    rigid = (system.omega == 0) & (system.decay == 0)
    if not np.any(rigid) or run.time.size < 3:
        return 0.0
    assert run.states is not None
    f, step = run.force, np.diff(run.time[::2])[:, None]
    impulse = step / 6 * (f[:-2:2] + 4 * f[1:-1:2] + f[2::2])
    flight = (f[1:-1:2] == 0.0) & (f[2::2] == 0.0)
    impulse[flight] = 0.0  # its first node is the contact's last
    beta = system.beta[:, rigid]
    t = np.union1d(run.time[::2], system.breaks[system.breaks <= run.time[-1]])
    load = np.array([np.interp(t, system.breaks, row) for row in system.loads[:, rigid].T])
    parts = np.diff(t) * (load[:, 1:] + load[:, :-1]) / 2
    given = parts.sum(axis=1) - impulse.sum(axis=0) @ beta
    v = run.states[:, 1][:, rigid]
    size = np.abs(v).max(axis=0) + np.abs(parts).sum(axis=1)
    size = size + np.abs(impulse).sum(axis=0) @ np.abs(beta)
    error = np.abs(v[-1] - v[0] - given)
    return float(np.max(np.divide(error, size, out=np.zeros_like(error), where=size > 0)))


# -- drawing scenes


def draw(number: int) -> ao.Scene:
    """The random scene of that number."""
    rng = np.random.default_rng([12, number])
    single = rng.random() < 0.5  # bodies of one coordinate: no gravity as a vector
    bodies: dict[str, Any] = {"floor": ao.Obstacle()}
    motion: dict[str, Any] = {}
    ends, rough = ["floor"], {"floor"}
    for i in range(int(rng.integers(1, 5))):
        name, kind = f"b{i}", rng.random()
        if single and kind < 0.4:
            bodies[name] = ao.RigidMass(10 ** rng.uniform(-2, 1), rng.uniform(-3, 5))
            ends.append(name)
        elif kind < 0.4:
            bodies[name], motion[name] = rigid_body(rng)
            sites = [f"{name}:{s}" for s in bodies[name].sites]
            ends += sites
            rough.update(sites)
        else:
            bodies[name], free = chain(rng, in_space=not single)
            ends += [f"{name}:{s}" for s in bodies[name].sites]
            if free and not single:
                motion[name] = ao.Motion(velocity=(0, 0, rng.uniform(-3, 3)))
    pairs: set[tuple[str, str]] = set()
    for _ in range(int(rng.integers(1, 7))):
        a, b = map(str, rng.choice(ends, 2, replace=False))
        if (b, a) not in pairs:  # two sites have one contact
            pairs.add((a, b))
    contacts = [contact(rng, a, b, a in rough and b in rough) for a, b in sorted(pairs)]
    loads = [load(rng, str(rng.choice(ends[1:]))) for _ in range(int(rng.integers(0, 3)))]
    base = None
    if not single and rng.random() < 0.3:
        values = np.zeros((4, 3))
        values[:, 2] = rng.normal(size=4) * 10 ** rng.uniform(0, 3)
        base = ao.Base(np.linspace(0, DURATION * rng.uniform(0.2, 1.2), 4), values)
    gravity = (0.0, 0.0, -9.81) if not single and rng.random() < 0.5 else 0.0
    return ao.Scene(bodies, contacts, gravity=gravity, loads=loads, base=base, motion=motion)


def rigid_body(rng: Rng) -> tuple[ao.RigidBody, ao.Motion]:
    """A body with one to three sites on its upper and lower side, and how it starts."""
    size, mass = 10 ** rng.uniform(-2, -0.5), 10 ** rng.uniform(-2, 1)
    sites = {}
    for i in range(int(rng.integers(1, 4))):
        side = float(rng.choice([-1.0, 1.0]))
        x, y = rng.uniform(-size, size, 2)
        sites[f"s{i}"] = ((x, y, 0.3 * side * size), (0.0, 0.0, -side))
    a, b, c = rng.uniform(0.3, 1, 3) * size  # half edges
    moments = mass / 3 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    velocity = (*rng.uniform(-2, 2, 2), rng.uniform(-3, 3))
    return ao.RigidBody(mass, moments, sites), ao.Motion(velocity, rng.uniform(-5, 5, 3))


def chain(rng: Rng, in_space: bool) -> tuple[ao.SiteModes, bool]:
    """Masses on springs along z, held at one end or free, and whether it is free."""
    n, count = int(rng.integers(2, 12)), int(rng.integers(1, 4))
    k, masses, held = 10 ** rng.uniform(4, 7), rng.uniform(0.02, 0.3, n), rng.random() < 0.5
    K = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    K[-1, -1] = k
    K[0, 0] = 2 * k if held else k
    root = 1 / np.sqrt(masses)
    x, phi = np.linalg.eigh(K * root[:, None] * root)
    if not held:
        x[0], phi[:, 0] = 0.0, np.sqrt(masses) / np.linalg.norm(np.sqrt(masses))
    omega, modes = np.sqrt(x), root[:, None] * phi  # (dofs, modes)
    b = modes[rng.integers(0, n, count)].T
    a = rng.normal(size=(count, count)) * float(rng.random() < 0.3)
    extra: dict[str, Any] = {}
    if in_space:
        momentum, total = np.zeros((n, 6)), float(masses.sum())
        momentum[:, 2] = masses @ modes
        matrix = np.diag([total, total, total, 1e-3, 1e-3, 1e-3])
        extra = {
            "directions": np.tile(UP, (count, 1)),
            "inertia": ao.Inertia(np.zeros(3), matrix, momentum),
        }
    decay = np.where(omega > 0, 0.01 * omega, 0.0) if rng.random() < 0.5 else None
    names = [f"s{j}" for j in range(count)]
    return ao.SiteModes(omega, b, names, r=a @ a.T * 1e-8, decay=decay, **extra), not held


def contact(rng: Rng, a: str, b: str, rough: bool) -> ao.Contact:
    """A contact of the two ends, with friction where both can carry it."""
    gap = float(rng.choice([0.0, 10 ** rng.uniform(-6, -3)]))
    friction = float(rng.uniform(0, 0.8)) if rough and rng.random() < 0.7 else 0.0
    return ao.Contact(a, b, law(rng), gap=gap, friction=friction)


def load(rng: Rng, end: str) -> ao.Load:
    times = np.sort(rng.uniform(0, DURATION, 3))
    return ao.Load(end, times, rng.normal(size=3) * 10 ** rng.uniform(0, 3))


def law(rng: Rng) -> ao.ContactLaw:
    """One of all the laws."""
    k, depth, e = 10 ** rng.uniform(6, 10), 10 ** rng.uniform(-7, -4), rng.uniform(0.2, 1)
    x = np.linspace(0, 1e-3, 9)
    force = k * x**1.5
    back = np.linspace(2e-4, 1e-3, 6)
    makers = [
        lambda: ao.Linear(10 ** rng.uniform(4, 8)),
        lambda: ao.Hertz(k),
        lambda: ao.Hertz(k, compliance=1e-9),
        lambda: ao.Power(k, rng.uniform(1, 3)),
        lambda: ao.HuntCrossley(k, e),
        lambda: ao.LankaraniNikravesh(k, e),
        lambda: ao.Flores(k, e),
        lambda: ao.Gonthier(k, e),
        lambda: ao.Thornton(k, depth),
        lambda: ao.YangSun(k, depth),
        lambda: ao.Tabulated(x, force, (back, force[-1] * np.linspace(0, 1, 6) ** 2)),
        lambda: ao.Tabulated(x, force),
    ]
    return makers[rng.integers(len(makers))]()


# -- the command line


def report(result: dict[str, Any]) -> None:
    for name, count in sorted(result["counts"].items()):
        print(f"{name:<24}{count:>10}")
    for name, values in result["figures"].items():
        if values:
            middle, most = np.quantile(values, [0.5, 0.99])
            print(f"{name:<12}{middle:>10.1e} median {most:>10.1e} 99 % {max(values):>10.1e} worst")
    for failure in result["failures"]:
        print(failure)
    print(f"{len(result['failures'])} failures in {result['scenes']} scenes")


def command(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--scenes", type=options.count, default=1000)
    parser.add_argument("--first", type=options.seed, default=0)
    parser.add_argument("--budget", type=options.positive, default=10.0)
    result = options.run(parser, main, arguments)
    report(result)
    return 1 if result["failures"] else 0


if __name__ == "__main__":
    raise SystemExit(command())
