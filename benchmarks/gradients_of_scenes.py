"""Gradients of random scenes: every derivative that `gradient` gives, against differences of runs.

Scenes of one to three contacts, of all laws: a struck model (supported, free or without mass at its
site; damping none, by ratios, or coupling the modes), balls in a row, a model of two sites between
a ball and a stop, a rigid ball that slides, sticks or goes over from one to the other on a rough
floor, and scenes with gravity, preload, loads or a moving ground. The goals take turns.

Every number that has a derivative is changed on either side, and the scene run at the same
tolerance, by two steps, whose Richardson extrapolation counts. They are made smaller until both
agree to a tenth of the bound. What is off is relative to the derivative, or to a hundredth of
goal/parameter where that is more.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/gradients_of_scenes.py
"""

from __future__ import annotations

import argparse
import inspect
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import options

import antiosc as ao
from antiosc_studies.gradients.goals import recorded, seeds

Rng = np.random.Generator
#: Where a number stands: "bodies", name, parameter, place; or "contacts", ends, parameter.
Key = tuple[Any, ...]
#: Largest error of a derivative that is accepted.
BOUND = 1e-3
#: Share of goal/parameter below which a derivative is as good as none.
FLOOR = 1e-2
#: Relative changes of a parameter, tried one after the other; each is halved too.
CHANGES = (1e-3, 1e-4, 1e-5)
#: Tolerances of scenes, and of those with friction, whose steps find where it begins to slip.
SMOOTH, ROUGH = 1e-8, 1e-6
GOALS = (
    "peak_force", "impulse", "contact_time", "restitution", "peak_displacement", "force",
    "displacement", "function",
)  # fmt: skip
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Case:
    """A scene, the contact and the goal whose derivatives are asked for.

    `build`: the model `part` as a function of x, factors of what makes it, of several sites.
    """

    kind: str
    law: ao.ContactLaw
    scene: ao.Scene
    duration: float
    build: Callable[[np.ndarray], ao.AntiOscillators] | None = None
    x: tuple[float, ...] = ()


@dataclass
class Row:
    """What is known of a case: the worst error, of which number, how many; or why it is refused."""

    case: Case
    goal: str
    worst: float = 0.0
    at: Key = ()
    count: int = 0
    unsettled: list[Key] = field(default_factory=list)
    refused: str = ""
    seconds: float = 0.0


def main(scenes: int = 200, first: int = 0, tol: float = SMOOTH) -> list[Row]:
    """Compare the scenes `first` to `first + scenes - 1`; a table of laws and goals is printed.

    Parameters
    ----------
    scenes : number of scenes
    first : number of the first one, which is the seed of its random numbers
    tol : relative error of the forces of all runs; with friction 1e-6
    """
    rows = []
    for number in range(first, first + scenes):
        began = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ao.AntioscWarning)
            row = compared(number, tol)
        row.seconds = time.process_time() - began
        rows.append(row)
        if row.worst > BOUND or row.unsettled or row.refused:
            print(f"{number:4} {told(row)}", flush=True)
    report(rows)
    return rows


def compared(number: int, tol: float) -> Row:
    """The derivatives of a scene against differences."""
    case = draw(number)
    goal = GOALS[number // len(LAWS) % len(GOALS)]
    if case.kind == "rough":
        tol, goal = ROUGH, goal.replace("function", "impulse")
    elif goal == "function":  # which is called for each node
        tol = ROUGH
    row = Row(case, goal)
    ends = case.scene.contacts[0].a, case.scene.contacts[0].b
    hit = case.scene.run(case.duration, tol=tol)
    wanted = asked(goal, hit, ends)
    try:
        g = ao.gradient(hit, contact=ends, **wanted, **given(case))
    except ao.AntioscError as error:
        row.refused = f"{type(error).__name__}: {error}"
        return row
    for key, slope in slopes(g):
        at = value_of(case, key)
        if slope is None or at == 0.0:
            continue
        least = FLOOR * abs(g.value)
        found, settled = difference(case, key, wanted, ends, tol, least)
        size = max(abs(found), least)
        off = abs(slope * at - found) / size
        row.count += 1
        if not settled:
            row.unsettled.append(key)
        elif off > row.worst:
            row.worst, row.at = off, key
    return row


def asked(goal: str, hit: ao.SceneHistory, ends: tuple[str, str]) -> dict[str, Any]:
    """The goal as `gradient` takes it; times within the first touch."""
    touches = hit[ends].contacts or [(0.0, hit.time[-1])]
    begin, end = touches[0]
    if goal in ("force", "displacement"):
        return {"goal": goal, "time": begin + 0.37 * (end - begin)}
    return {"goal": square if goal == "function" else goal}


def square(run: Any) -> float:
    """The integral of the squared force, of parabolas through the nodes."""
    f0, f1, f2 = (run.force[k::2][: run.time.size // 2] for k in range(3))
    h = run.time[2::2] - run.time[:-2:2]
    return float(h @ (2 * f0**2 + 8 * f1**2 + 2 * f2**2 + 2 * f1 * (f0 + f2) - f0 * f2)) / 15


def given(case: Case) -> dict[str, Any]:
    return {} if case.build is None else {"part": case.build, "x": case.x}


def slopes(g: ao.Gradient) -> Iterator[tuple[Key, float | None]]:
    """Every derivative of a gradient, entry by entry, and where its number stands."""
    for room, named in (("bodies", g.bodies), ("contacts", g.contacts)):
        for name, values in named.items():
            for parameter, slope in values.items():
                if slope is None or np.ndim(slope) == 0:
                    yield (room, name, parameter), slope
                    continue
                for i, one in enumerate(slope):
                    yield (room, name, parameter, i), float(one)


def value_of(case: Case, key: Key) -> float:
    """The number that stands there; of a damping matrix the factor 1."""
    room, name, parameter, *place = key
    if parameter == "x":
        return case.x[place[0]]
    if parameter == "damping":
        return 1.0
    if room == "contacts":
        contact = contact_of(case.scene, name)
        return float(getattr(contact if hasattr(contact, parameter) else contact.law, parameter))
    if parameter == "initial_velocity":
        return abs(case.scene.motion[name])  # the speed of closing
    value = getattr(case.scene.bodies[name], parameter)
    return float(value[place[0]] if place else value)


def contact_of(scene: ao.Scene, ends: tuple[str, str]) -> ao.Contact:
    return next(each for each in scene.contacts if (each.a, each.b) == ends)


def changed(case: Case, key: Key, by: float) -> ao.Scene:
    """The scene with another value of a number, relatively."""
    scene = case.scene
    room, name, parameter, *place = key
    value = value_of(case, key) * (1 + by)
    if room == "contacts":
        one = contact_of(scene, name)
        if hasattr(one, parameter):
            other = replace(one, **{parameter: value})
        else:
            other = replace(one, law=replace(one.law, **{parameter: value}))  # type: ignore[type-var]
        return replace(scene, contacts=[other if each is one else each for each in scene.contacts])
    body: Any = scene.bodies[name]
    if parameter == "initial_velocity":
        return replace(scene, motion={name: (1 + by) * scene.motion[name]})
    if parameter == "x":
        assert case.build is not None
        x = np.array(case.x)
        x[place[0]] = value
        body = case.build(x)
    elif parameter == "damping":
        body = replace(body, damping=ao.DampingMatrix((1 + by) * body.damping.matrix))
    else:
        if place:
            value = getattr(body, parameter) * (1 + by * np.eye(body.n)[place[0]])
        body = replace(body, **{parameter: value})
    return replace(scene, bodies={**scene.bodies, name: body})


def difference(
    case: Case,
    key: Key,
    wanted: dict[str, Any],
    ends: tuple[str, str],
    tol: float,
    least: float,
) -> tuple[float, bool]:
    """d goal/d ln parameter, and whether two steps agree on it; below `least` it is none."""

    def value(by: float) -> float:
        hit = changed(case, key, by).run(case.duration, tol=tol)
        return result(hit, ends, **wanted)

    best, found = np.inf, np.nan
    for change in CHANGES:
        wide, near = ((value(h) - value(-h)) / (2 * h) for h in (change, change / 2))
        if (off := abs(wide - near) / 3) < best:
            best, found = off, (4 * near - wide) / 3
        if best <= BOUND / 10 * max(abs(found), least):
            break
    return found, best <= BOUND / 2 * max(abs(found), least)


def result(
    hit: ao.SceneHistory, ends: tuple[str, str], goal: Any, time: float | None = None
) -> float:
    """The goal of a run: as its history has it, and others as gradients read them."""
    if goal in GOALS[:4]:
        return float(getattr(hit[ends], goal))
    if goal is square:
        return square(hit[ends])
    index = [each.ends for each in hit.contact_histories].index(ends)
    return seeds(recorded(hit), goal, index, time).value


# -- drawing scenes


def laws(rng: Rng) -> list[ao.ContactLaw]:
    """One of each law."""
    k, e, depth = 10 ** rng.uniform(8, 9.5), rng.uniform(0.3, 0.9), 10 ** rng.uniform(-6, -4.5)
    x = np.linspace(0.0, 1e-3, 12)
    back = np.linspace(3e-4, 1e-3, 9)
    force = k * x**1.4
    return [
        ao.Linear(k / 100),
        ao.Power(k / 5, rng.uniform(1.1, 2.0)),
        ao.Hertz(k),
        ao.Hertz(k, compliance=1e-9),
        ao.HuntCrossley(k, e),
        ao.LankaraniNikravesh(k, e),
        ao.Flores(k, e),
        ao.Gonthier(k, e),
        ao.Thornton(k, depth),
        ao.Stronge(k, depth),
        ao.YangSun(k, depth),
        ao.TanSun(k, depth, slope=0.3),
        ao.Tabulated(x, force, (back, force[-1] * np.linspace(0, 1, 9) ** 1.8)),
    ]


LAWS = [type(law).__name__ for law in laws(np.random.default_rng(0))]


def draw(number: int) -> Case:
    """The random scene of that number; laws and kinds take turns."""
    rng = np.random.default_rng([3, number])
    kind = KINDS[number % len(KINDS)]
    law = laws(rng)[number % len(LAWS)]
    return kind(rng, law)


def model(rng: Rng, law: ao.ContactLaw, number: int = 2) -> ao.AntiOscillators:
    """Supported, free, without mass at its site; without damping, by ratios, coupling its modes."""
    massless = rng.random() < 0.25 and not law.rate_dependent
    damping: Any = None
    if (how := rng.random()) < 0.3:
        damping = ao.Damping(rng.uniform(0.005, 0.05), 20.0, 1e-7)
    elif how < 0.5:
        root = rng.normal(size=(number + 1, number + 1)) * 8.0
        damping = ao.DampingMatrix(root.T @ root)
    return ao.AntiOscillators(
        m0=0.0 if massless else rng.uniform(0.02, 0.1),
        k0=0.0 if rng.random() < 0.3 else 10 ** rng.uniform(4.5, 6),
        m=rng.uniform(0.05, 0.3, number),
        omega=np.sort(10 ** rng.uniform(3.2, 4.3, number)),
        damping=damping,
    )


def ball(rng: Rng) -> ao.RigidMass:
    return ao.RigidMass(rng.uniform(0.05, 0.5), rng.uniform(0.5, 2.0))


def blow(rng: Rng, law: ao.ContactLaw) -> Case:
    bodies = {"part": model(rng, law), "ball": ball(rng)}
    contact = ao.Contact("part", "ball", law, gap=rng.uniform(1e-6, 2e-5))
    return Case("blow", law, ao.Scene(bodies, [contact]), 2e-3)


def row(rng: Rng, law: ao.ContactLaw) -> Case:
    bodies: dict[str, Any] = {"part": model(rng, law), "last": ball(rng)}
    bodies = {**bodies, "first": ao.RigidMass(rng.uniform(0.05, 0.3), 0.0)}
    other = laws(rng)[rng.integers(len(LAWS))]
    contacts = [
        ao.Contact("part", "first", law, gap=rng.uniform(1e-6, 5e-5)),
        ao.Contact("first", "last", other, gap=rng.uniform(1e-6, 5e-5)),
    ]
    return Case("row", law, ao.Scene(bodies, contacts), 2e-3)


def two_sites(rng: Rng, law: ao.ContactLaw) -> Case:
    P = rng.uniform(0.1, 0.3, (2, 2))
    omega = np.sort(10 ** rng.uniform(3.2, 4.3, 2))
    k = 10 ** rng.uniform(5.5, 6.5)

    def build(x: np.ndarray) -> ao.AntiOscillators:
        k0 = k * np.array([[2.0, -0.5], [-0.5, x[0]]])
        return ao.AntiOscillators(
            m0=0.05 * x[1] * np.eye(2), k0=k0, m=None, omega=omega * [1.0, x[2]],
            P=P * [[1.0, x[3]], [1.0, 1.0]], sites=("tip", "heel"),
        )  # fmt: skip

    x = (1.0, 1.0, 1.0, 1.0)
    bodies = {"part": build(np.array(x)), "ball": ball(rng), "stop": ao.Obstacle()}
    contacts = [
        ao.Contact("part:tip", "ball", law, gap=rng.uniform(1e-6, 1e-5)),
        ao.Contact("part:heel", "stop", ao.Linear(1e7), gap=rng.uniform(1e-6, 1e-4)),
    ]
    return Case("two sites", law, ao.Scene(bodies, contacts), 2e-3, build, x)


def rough(rng: Rng, law: ao.ContactLaw) -> Case:
    """A ball whose foot is beside its middle, so that friction and pressure act on each other."""
    mass, radius = rng.uniform(0.1, 0.5), 0.02
    moment = 0.4 * mass * radius**2
    arm = rng.uniform(-0.3, 0.3, 2) * radius
    body = ao.RigidBody(mass, (moment,) * 3, {"foot": ((*arm, -radius), UP)})
    speed = rng.choice([0.02, 0.3, 1.0, 3.0]) * rng.uniform(0.7, 1.4)
    turn = rng.uniform(0, 2 * np.pi)
    contact = ao.Contact(
        "ball:foot", "floor", law, gap=rng.uniform(1e-6, 1e-5), friction=rng.uniform(0.1, 0.5),
        tangential_stiffness=10 ** rng.uniform(6, 7) if rng.random() < 0.5 else None,
    )  # fmt: skip
    start = ao.Motion(velocity=(speed * np.cos(turn), speed * np.sin(turn), -1.0))
    scene = ao.Scene(
        {"ball": body, "floor": ao.Obstacle()}, [contact], motion={"ball": start},
        gravity=(0, 0, -9.81),
    )  # fmt: skip
    return Case("rough", law, scene, 1e-3)


def driven(rng: Rng, law: ao.ContactLaw) -> Case:
    """Gravity that a model meets at rest or not, a load or a ground that moves."""
    bodies: dict[str, Any] = {"part": model(rng, law), "ball": ball(rng)}
    contact = ao.Contact("part", "ball", law, gap=rng.uniform(1e-6, 2e-5))
    how = rng.integers(4)
    if how == 0:
        bodies["part"] = replace(bodies["part"], k0=rng.uniform(1e5, 1e6))
        scene = ao.Scene(bodies, [contact], gravity=rng.uniform(10, 500))
    elif how == 1:
        times, forces = np.sort(rng.uniform(0, 1e-3, 3)), rng.uniform(-100, 100, 3)
        scene = ao.Scene(bodies, [contact], loads=[ao.Load("ball", times, forces)])
    elif how == 2:
        held = replace(bodies["part"], k0=2e5, damping=ao.Damping(0.01))
        rider = {"part": held, "rider": ao.RigidMass(0.1, 0.0), "ball": bodies["ball"]}
        contacts = [
            ao.Contact("part", "rider", law, gap=0.0),
            ao.Contact("rider", "ball", ao.Hertz(5e8), gap=1e-5),
        ]
        scene = ao.Scene(rider, contacts, gravity=50.0, preload=True)
    else:
        free = replace(bodies["part"], k0=0.0)
        scene = ao.Scene(
            {"part": free, "wall": ao.Obstacle()}, [ao.Contact("part", "wall", law, gap=1e-5)],
            motion={"part": -rng.uniform(0.5, 2.0)},
        )  # fmt: skip
    return Case(("gravity", "load", "preload", "start")[how], law, scene, 2e-3)


KINDS = (blow, row, rough, two_sites, blow, driven, rough)


# -- what is told


def told(row: Row) -> str:
    what = f"{row.case.kind}, {type(row.case.law).__name__}, {row.goal}: "
    if row.refused:
        return f"{what}refused: {row.refused}"
    if row.unsettled:
        what += f"differences do not settle by {row.unsettled}; "
    return f"{what}off by {row.worst:.1e} at {row.at}"


def report(rows: list[Row]) -> None:
    """Tables of laws and goals, and of kinds."""
    for title, of in (
        ("law", lambda row: type(row.case.law).__name__),
        ("goal", lambda row: row.goal),
        ("kind", lambda row: row.case.kind),
    ):
        print(
            f"{title:<20}{'scenes':>8}{'refused':>9}{'derivatives':>13}{'unsettled':>11}{'worst':>9}"
            f"{'s of CPU':>10}"
        )
        for name in dict.fromkeys(map(of, rows)):
            own = [row for row in rows if of(row) == name]
            print(
                f"{name:<20}{len(own):8}{sum(bool(r.refused) for r in own):9}"
                f"{sum(r.count for r in own):13}{sum(len(r.unsettled) for r in own):11}"
                f"{max(r.worst for r in own):9.1e}{sum(r.seconds for r in own):10.1f}"
            )
    off = sum(row.worst > BOUND for row in rows)
    seconds = sum(row.seconds for row in rows)
    print(f"{off} of {len(rows)} scenes are off by more than {BOUND:g}; {seconds:.0f} s of CPU")


def command(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=inspect.getdoc(main))
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--scenes", type=options.count, default=200)
    parser.add_argument("--first", type=options.seed, default=0)
    parser.add_argument("--tol", type=options.positive, default=SMOOTH)
    rows = options.run(parser, main, arguments)
    return 1 if any(row.worst > BOUND for row in rows) else 0


if __name__ == "__main__":
    raise SystemExit(command())
