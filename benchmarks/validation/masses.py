"""Single masses that strike an elastic stop (code_aster, Ansys)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Case, Row, drawing
from numpy.typing import NDArray

import antiosc as ao
from antiosc.models.closed_form import UniformBeam, pinned_pinned

Array = NDArray[np.float64]
INCH, POUND = 0.0254, 4.4482216  # m, N


def oscillator(picture: Path) -> list[Row]:
    """SDND101: a mass on a spring passes its rest position at 1 m/s, where it touches a stop.

    A supported body starts at rest here: a load moves the mass away from the stop and lets it go,
    so that it arrives there at 1 m/s.
    """
    mass, spring, stop, speed = 100.0, 1e4, 1e6, 1.0
    omega = np.sqrt(spring / mass)
    away = np.pi / omega  # at rest, farthest from the stop
    load = spring * speed / (2 * omega)
    started = 1.5 * np.pi / omega
    scene = ao.Scene(
        {"mass": ao.AntiOscillators(m0=mass, k0=spring, m=[], omega=[]), "stop": ao.Obstacle()},
        [ao.Contact("mass", "stop", ao.Linear(stop))],
        loads=[ao.Load("mass", [0.0, away, away * (1 + 1e-6)], [load, load, 0.0])],
    )
    hit = scene.run(started + 0.5, tol=1e-5)
    one = hit["mass", "stop"]
    first, second = one.contacts[:2]
    rows = []
    for name, (begin, end), at, bound in (
        ("first", first, 0.01563, 0.01),
        ("second", second, 0.361, 1e-3),
    ):
        during = (one.time >= begin) & (one.time <= end)
        t, force = one.time[during], one.force[during]
        peak = int(np.argmax(force))
        rows.append(Row(f"{name} shock, its peak at, s", at, float(t[peak] - started), bound))
        rows.append(Row(f"{name} shock, peak force, N", 9950.0, float(force[peak]), 1e-3))
    impulse = float(np.sum((force[1:] + force[:-1]) / 2 * np.diff(t)))
    arriving = float(hit.at([begin])["mass"].velocity()[0])
    rows += [
        Row("second shock, duration, s", 0.03126, second[1] - second[0], 0.01),
        Row("second shock, impulse, N s", 198.05, impulse, 1e-3),
        Row("second shock, speed of arrival, m/s", -1.0, arriving, 1e-3),
    ]
    drawn(picture, one.time - started, one.force / 1e3, "force on the stop (kN)", start=0.0)
    return rows


def falling(
    gravity: float, height: float, thrown: float, mass: float, stiffness: float
) -> ao.Scene:
    """A mass that falls on a spring; `thrown` is its speed downward at the start."""
    bodies = {"ground": ao.Obstacle(), "ball": ao.RigidMass(mass, velocity=thrown)}
    contact = ao.Contact("ground", "ball", ao.Linear(stiffness), gap=height)
    return ao.Scene(bodies, [contact], gravity=gravity)


#: SDND108, modelling A: time, height over the start, bound
FALLEN = [
    (0.54031242374329, -2.0, 1e-6),
    (0.88545615307643, -2.0, 1e-2),
    (1.0, -1.332162981855, 1e-2),
    (1.1, -0.856394405035, 2e-2),
]


def bouncing_mass(picture: Path) -> list[Row]:
    """SDND108: a mass is thrown on an elastic ground and flies up again."""
    hit = falling(10.0, 2.0, 1.0, 1.0, 100.0).run(1.11, tol=1e-5)
    found = -hit.at([time for time, *_ in FALLEN])["ball"].displacement()
    t = np.linspace(0.0, 1.1, 400)
    drawn(picture, t, -hit.at(t)["ball"].displacement(), "height over the start (m)")
    return [
        Row(f"height at {time:.4g} s, m", value, float(ours), bound)
        for (time, value, bound), ours in zip(FALLEN, found, strict=True)
    ]


def ball_on_spring(picture: Path) -> list[Row]:
    """VM65: a ball falls on a flexible surface."""
    mass, stiffness, gravity = 0.5 * POUND / INCH, 1973.92 * POUND / INCH, 386 * INCH
    hit = falling(gravity, INCH, 0.0, mass, stiffness).run(0.16, tol=1e-6)
    arrived = hit["ground", "ball"].contacts[0][0]
    at = hit.at([arrived])["ball"]
    speed = -float(at.velocity()[0]) / INCH
    omega = np.sqrt(stiffness / mass)
    sag = gravity / omega**2
    deepest = INCH + sag + np.hypot(sag, np.sqrt(2 * gravity * INCH) / omega)
    t = np.linspace(0.0, 0.16, 400)
    fallen = hit.at(t)["ball"].displacement() / INCH
    drawn(picture, t, -fallen, "height over the start (in)")
    energy = 0.5 * 0.5 * speed**2
    own = float(hit["ground", "ball"].indentation.max()) / INCH + 1.0
    return [
        Row("arrives at, s", 0.071982, arrived, 1e-4),
        Row("speed there, in/s", -27.785, speed, 1e-4),
        Row("kinetic energy there, lbf in", 193.0, energy, 1e-4),
        Row("deepest, in", -float(deepest) / INCH, -own, 1e-4, "equation"),
    ]


#: SDND121: contacts of the 70 within 4 s, and when they begin and end, s
FORCED = {
    "1st contact": (0.024867876, 0.025260518),
    "35th contact": (1.884829878, 1.885221033),
    "70th contact": (3.886525493, 3.886916559),
    "mean of all 70": (1.9638139588, 1.9642065762),
}


def rattling(picture: Path) -> list[Row]:
    """SDND121: a mass on a spring is pushed to and fro against a hard stop."""
    t = np.linspace(0.0, 4.0, 200_001)
    scene = ao.Scene(
        {"mass": ao.AntiOscillators(m0=156.0, k0=2e6, m=[], omega=[]), "stop": ao.Obstacle()},
        [ao.Contact("mass", "stop", ao.Linear(1e10), gap=1e-3)],
        loads=[ao.Load("mass", t, -3e3 * np.sin(10 * np.pi * t))],
    )
    hit = scene.run(4.0, tol=1e-6)
    times = np.array(hit["mass", "stop"].contacts)
    found = [times[0], times[34], times[69], times[:70].mean(axis=0)]
    rows = [Row("contacts within 4 s", 70, len(times), 0.0)]
    for (name, published), ours in zip(FORCED.items(), found, strict=True):
        for word, value, own in zip(("begins", "ends"), published, ours, strict=True):
            rows.append(Row(f"{name} {word}, s", value, float(own), 1e-8, absolute=True))
    moved = -hit.at(t[::50])["mass"].displacement() * 1e3
    drawn(picture, t[::50], moved, "mass (mm)")
    return rows


def hammered(picture: Path) -> list[Row]:
    """A hammer loses to the modes of a beam what its rebound lacks."""
    beam = UniformBeam.euler_bernoulli(E=67e9, rho=2400.0, area=2e-4, inertia=0.33e-8, length=1.0)
    model = pinned_pinned(beam, site=0.4).anti_oscillators(60)
    modes, rows = model.modal(), []
    for stiffness in (1e8, 1e10):
        hammer = ao.RigidMass(0.01, 1.0)
        hit = ao.simulate(model, hammer, ao.Hertz(stiffness), duration=4e-3, step=2e-7)
        weights = np.gradient(hit.time) * hit.force / (hammer.mass * (1 + hit.restitution))
        spectrum = np.exp(-1j * np.outer(modes.omega, hit.time)) @ weights
        lost = (1 - hit.restitution) / (1 + hit.restitution)
        taken = float(np.sum(np.abs(spectrum * modes.b) ** 2)) * hammer.mass
        name = f"share of the modes, contact of {stiffness:g} N/m^1.5"
        rows.append(Row(name, lost, taken, 1e-3, "equation"))
    drawn(picture, hit.time, hit.force, "force (N)")
    return rows


def drawn(picture: Path, t: Array, value: Array, label: str, start: float = 0.0) -> None:
    """A quantity over time, from `start` on."""
    with drawing(picture, "time (s)", label) as axis:
        axis.plot(t[t >= start], value[t >= start], label="antiosc")


CASES = [
    Case(
        "sdnd101",
        "A mass on a spring strikes a stop",
        "100 kg, spring of 1e4 N/m, stop of 1e6 N/m without a gap, 1 m/s in the rest position, "
        "which the mass is brought to by a load before",
        "code_aster SDND101, manual V5.01.101 and astest/sdnd101a.comm: data, analytical values, "
        "bounds of 1 % (times) and 0.1 %",
        oscillator,
    ),
    Case(
        "sdnd108",
        "A mass is thrown on an elastic ground",
        "1 kg, 10 m/s², 2 m high, 1 m/s downward, ground of 100 N/m",
        "code_aster SDND108, modelling A, manual V5.01.108 and astest/sdnd108a.comm: data, "
        "analytical values and bounds; modelling B has a dashpot, which antiosc's laws do not have",
        bouncing_mass,
    ),
    Case(
        "sdnd121",
        "A mass on a spring rattles against a hard stop",
        "156 kg, 2e6 N/m, stop of 1e10 N/m 1 mm away, 3000 N sin(2π 5 t) from rest",
        "code_aster SDND121, astest/sdnd121a.comm, and its 140 quasi-analytical times of contacts "
        "to 1e-9 s, sdnd121a.py; bound 1e-8 s",
        rattling,
    ),
    Case(
        "hammer",
        "A bouncing hammer and the modes that it excites",
        "a mass of 10 g at 1 m/s on the pinned beam of the article, at 0.4 of its length",
        "J. Woodhouse, Euphonics, 12.1.2, equations 1 to 5: with the pulse f(t) of unit impulse "
        "and the effective masses M_n, energy asks for m Σ |f(ω_n)|²/M_n = (v1 − v2)/(v1 + v2); "
        "bound 0.1 %",
        hammered,
    ),
    Case(
        "vm65",
        "A ball falls on a flexible surface",
        "0.5 lbf s²/in, 1973.92 lbf/in, 1 in high, 386 in/s²",
        "Ansys Verification Manual VM65 (W. T. Thomson, Vibration Theory and Applications, example "
        "4.6-1), read in the LS-DYNA verification manual of Ansys, SOLVE-061; the deepest point by "
        "the equation there; bounds: the digits printed",
        ball_on_spring,
    ),
]
