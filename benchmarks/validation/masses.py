"""Single masses that strike an elastic stop (code_aster, Ansys)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Case, Row
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

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


def drawn(picture: Path, t: Array, value: Array, label: str, start: float = 0.0) -> None:
    """A quantity over time, from `start` on."""
    figure, axes = plotting.panels(1, 1, size=(7, 3.2))
    (axis,) = axes.ravel()
    axis.plot(t[t >= start], value[t >= start], label="antiosc")
    axis.set_xlabel("time (s)")
    axis.set_ylabel(label)
    plotting.save_figure(figure, picture, dpi=100)


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
        "vm65",
        "A ball falls on a flexible surface",
        "0.5 lbf s²/in, 1973.92 lbf/in, 1 in high, 386 in/s²",
        "Ansys Verification Manual VM65 (W. T. Thomson, Vibration Theory and Applications, example "
        "4.6-1), read in the LS-DYNA verification manual of Ansys, SOLVE-061; the deepest point by "
        "the equation there; bounds: the digits printed",
        ball_on_spring,
    ),
]
