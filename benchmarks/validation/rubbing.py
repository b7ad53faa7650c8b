"""Masses on springs that rub on a floor (code_aster)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from case import Case, Row, drawing
from numpy.typing import ArrayLike, NDArray

import antiosc as ao

Array = NDArray[np.float64]
SOFT = 1e-3  # N/m, holds the masses in the directions that the tests do not have


def rubbing(
    springs: ArrayLike,
    mass: float,
    pressed: float,
    pull: tuple[ArrayLike, ArrayLike],
    friction: float,
    stiffness: float,
) -> ao.Scene:
    """Equal masses in a row along x; the first is pressed on a floor, the last is pulled.

    They start at rest where springs, pressing force and the pull at t = 0 are in equilibrium.
    """
    along = np.array(springs, dtype=float)
    count = len(along)
    K = SOFT * np.diag([0.0, 1.0, 1.0] * count)
    K[::3, ::3] += along
    rows = [(node, dof) for node in range(1, count + 1) for dof in (1, 2, 3)]
    part = ao.Structure.from_matrices(K, mass * np.eye(3 * count), map=np.array(rows))
    sites = {
        "foot": ao.Site(node=1, direction=(0, 0, 1.0), tangential=True),
        "pull": ao.Site(node=count, direction=(1.0, 0, 0)),
    }
    model = ao.extract(part, sites, n=3 * count - 1)
    rubs = {"friction": friction, "tangential_stiffness": stiffness}
    contact = ao.Contact("pad:foot", "floor", ao.Linear(1e5), **rubs)
    loads = [ao.Load("pad:foot", [0.0], [-pressed]), ao.Load("pad:pull", *pull)]
    return ao.Scene({"pad": model, "floor": ao.Obstacle()}, [contact], loads=loads, preload=True)


def rubbed(hit: ao.SceneHistory) -> tuple[Array, Array]:
    """Times and the size of the friction force."""
    one = hit["pad:foot", "floor"]
    return one.time, np.linalg.norm(np.asarray(one.friction), axis=1)


def drawn(picture: Path, lines: dict[str, tuple[Array, Array]], label: str) -> None:
    """Quantities over time."""
    with drawing(picture, "time (s)", label) as axis:
        for name, (t, value) in lines.items():
            axis.plot(t, value, label=name)


#: SDND100: displacement along x + y at the ends of the half periods, bound
SWUNG = ((-4.596e-4, 1e-3), (3.182e-4, 1e-3), (-1.768e-4, 1e-3), (3.536e-5, 5e-3))


def released(picture: Path) -> list[Row]:
    """SDND100: a mass on a spring is let go and rubs until it sticks."""
    release = ([0.0, 1e-9], [8.5, 0.0])
    hit = rubbing([[1e4]], 1.0, 10.0, release, friction=0.1, stiffness=1e8).run(0.3, tol=1e-5)
    halves = np.arange(1, 5) * np.pi / 100
    moved = hit.at(halves)["pad"].displacement("pull") / np.sqrt(2)
    t = np.linspace(0.0, 0.2, 500)
    drawn(picture, {"antiosc": (t, hit.at(t)["pad"].displacement("pull") * 1e3)}, "mass (mm)")
    return [
        Row(f"displacement after {i} half periods, m", value, float(ours), bound)
        for i, ((value, bound), ours) in enumerate(zip(SWUNG, moved, strict=True), 1)
    ]


#: SDND104: amplitude of the floor's acceleration in m/s², power of wear in W, bound
WORN = ((15.0, 15.2671, 5e-4), (1.5, 0.409062, 5e-4), (1.01, 2.26164e-4, 5e-3), (0.99, 0.0, 5e-4))


def shaken(picture: Path) -> list[Row]:
    """SDND104: the floor under a mass shakes; normal force times speed of slip, 4 to 12 s."""
    rows, lines = [], {}
    t = np.linspace(0.0, 12.0, 60_001)
    for amplitude, power, bound in WORN:
        pull = (t, amplitude * np.sin(2 * np.pi * t))
        hit = rubbing([[3e-5]], 1.0, 10.0, pull, friction=0.1, stiffness=9e6).run(12.0, tol=1e-4)
        time, force = rubbed(hit)
        speed = hit.at(time)["pad"].velocity("pull")
        slips = (force > 1 - 1e-7) & (time >= 4.0)
        wear = np.where(slips, 10.0 * np.abs(speed), 0.0)
        ours = float(np.sum((wear[1:] + wear[:-1]) / 2 * np.diff(time))) / 8
        name = f"power of wear at {amplitude:g} m/s², W"
        rows.append(Row(name, power, ours, bound, absolute=power == 0))
        lines[f"{amplitude:g} m/s²"] = (time[time < 3], speed[time < 3])
    drawn(picture, lines, "speed of the mass over the floor (m/s)")
    return rows


def pulled(picture: Path) -> list[Row]:
    """SDND106: a mass pulls another by a spring until that one slips."""
    k = 1e4
    springs = [[k + SOFT, -k], [-k, k]]
    pull = ([0.0, 1e-9], [0.0, 3000.0])
    hit = rubbing(springs, 5.0, 1e4, pull, friction=0.3, stiffness=5e7).run(0.04, tol=1e-4)
    time, force = rubbed(hit)
    slips = float(time[np.argmax(force > 3000 * (1 - 1e-6))])
    drawn(picture, {"antiosc": (time, force)}, "friction (N)")
    moved = float(hit.at([0.02])["pad"].displacement("pull")[0])
    return [
        Row("pulled mass at 0.02 s, m", 0.11221, moved, 1e-4, absolute=True),
        Row("the other mass slips at, s", 0.03512, slips, 1e-4, absolute=True),
    ]


CASES = [
    Case(
        "sdnd100",
        "A mass on a spring is let go and rubs",
        "1 kg, 1e4 N/m, pressed by 10 N, friction 0.1, let go 0.85 mm from its rest position; "
        "tangential stiffness 1e8 N/m (4e5 in the source)",
        "code_aster SDND100, astest/sdnd100a.comm: data, analytical values, bounds",
        released,
    ),
    Case(
        "sdnd104",
        "A mass on a shaking floor wears",
        "1 kg, 3e-5 N/m, pressed by 10 N, friction 0.1, tangential stiffness 9e6 N/m; the floor "
        "shakes at 1 Hz; normal force times speed of slip",
        "code_aster SDND104, astest/sdnd104a.comm: data, quasi-analytical values, bounds of "
        "0.05 % and 0.5 %",
        shaken,
    ),
    Case(
        "sdnd106",
        "A mass pulls another that rubs",
        "two masses of 5 kg on a spring of 1e4 N/m; 1e4 N press the first, 3000 N pull the second; "
        "static friction 0.3. The slip that follows has a friction of 0.2: contacts of antiosc "
        "have one coefficient, so that its two displacements and its end are no rows",
        "code_aster SDND106, astest/sdnd106a.comm and .com1: data, analytical values, bounds",
        pulled,
    ),
]
