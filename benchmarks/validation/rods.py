"""Rods that strike a wall or another rod: waves along a line of beam elements.

The contact is a linear spring of HARD times the rod's own stiffness EA/L, so that what it lets
through differs from a rigid wall by about 1/HARD of the wave's time.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from case import Case, Row, drawing
from lines import line

import antiosc as ao

INCH, POUND = 0.0254, 4.4482216  # m, N
ELEMENTS, N, HARD = 200, 90, 200.0


def rod(length: float, E: float, rho: float, area: float, held: bool = False) -> ao.Structure:
    """A rod along x that moves along x only; its far end is held or free."""
    guided = [ao.Support("line", fix=("y", "rz"))]
    if held:
        guided.append(ao.Support("far", fix="x"))
    side = float(np.sqrt(area))
    beam = ao.Beam(E=E, nu=0.0, rho=rho, section=ao.Section.rectangle(side, side))
    return ao.Structure(line(length, ELEMENTS), beam, guided)


def end(part: ao.Structure, place: float, way: float) -> ao.AntiOscillators:
    """The rod seen from one of its ends; a contact pushes it along `way`."""
    return ao.extract(part, {"end": ao.Site((place, 0.0), (way, 0.0))}, n=N)


class Wall(NamedTuple):
    """A rod that flies against a wall, and what the source says of it; None: nothing."""

    length: float
    E: float
    rho: float
    area: float
    speed: float
    gap: float
    touch: tuple[float, float, str] | None = None  # value, relative bound, how it is known
    lasting: tuple[float, float, str] | None = None
    force: tuple[float, float, str] | None = None
    rebound: tuple[float, float, str] | None = None

    @property
    def passage(self) -> float:
        """Time of a wave along the rod, s."""
        return float(self.length / np.sqrt(self.E / self.rho))


def flown(data: Wall, model: ao.AntiOscillators | ao.SiteModes) -> ao.SceneHistory:
    """The rod, seen from its site "end" along +x, flies against the wall."""
    hard = ao.Linear(HARD * data.E * data.area / data.length)
    return ao.Scene(
        {"rod": model, "wall": ao.Obstacle()},
        [ao.Contact("rod:end", "wall", hard, gap=data.gap)],
        motion={"rod": ao.Motion(velocity=(-data.speed, 0.0, 0.0))},
    ).run(1.3 * (data.gap / data.speed + 2 * data.passage), tol=1e-2)


def at_the_wall(data: Wall, hit: ao.SceneHistory) -> list[Row]:
    """Touch, contact time, plateau of the force, speed of the centre of mass after the contact."""
    one = hit["rod:end", "wall"]
    start, stop = one.contacts[0][0], one.contacts[-1][1]
    plateau = float(np.median(one.force[one.force > 0.1 * one.peak_force]))
    momentum = hit.bodies["rod"].momentum
    found = {
        "first touch, s": (start, data.touch),
        "contact time, s": (stop - start, data.lasting),
        "force, N": (plateau, data.force),
        "rebound, m/s": (momentum[-1, 0] / (data.rho * data.area * data.length), data.rebound),
    }
    return [
        Row(name, given[0], value, given[1], given[2])
        for name, (value, given) in found.items()
        if given
    ]


def on_a_wall(data: Wall, picture: Path) -> list[Row]:
    """The rod in beam elements."""
    hit = flown(data, end(rod(data.length, data.E, data.rho, data.area), 0.0, 1.0))
    one = hit["rod:end", "wall"]
    factor, unit = (1e-6, "MN") if one.peak_force > 1e6 else (1e-3, "kN")
    with drawing(picture, "time (µs)", f"force on the wall ({unit})") as axis:
        axis.plot(one.time * 1e6, factor * one.force, label="antiosc")
        if data.force:
            axis.axhline(factor * data.force[0], color="k", ls=":", label="published")
    return at_the_wall(data, hit)


#: SDNL111: time, displacement of the struck end, bound of the source
STRUCK = [
    (2e-4, -1e-4, 0.01 * 1e-4),
    (4e-4, -2e-4, 0.035 * 2e-4),
    (6e-4, -1e-4, 0.05 * 1e-4),
    (8e-4, 0.0, 1e-5),
    (1e-3, 2e-4, 0.035 * 2e-4),
]


#: SDNL111: length, modulus, density, area of both rods
EQUAL = (1.0, 2e11, 7800.0, 4e-4)


def collided(
    one: ao.AntiOscillators | ao.SiteModes, two: ao.AntiOscillators | ao.SiteModes
) -> ao.SceneHistory:
    """SDNL111: a flying rod strikes one that is held; each is seen from its "end" along +x."""
    return ao.Scene(
        {"one": one, "two": two},
        [ao.Contact("two:end", "one:end", ao.Linear(5e9))],
        motion={"one": ao.Motion(velocity=(1.0, 0.0, 0.0))},
    ).run(1.02e-3, tol=1e-2)


def of_the_struck_end(hit: ao.SceneHistory) -> list[Row]:
    """SDNL111: the published displacements."""
    moved = -hit.at([time for time, *_ in STRUCK])["one"].displacement("end")
    return [
        Row(f"struck end at {time * 1e3:g} ms, m", value, float(ours), bound, absolute=True)
        for (time, value, bound), ours in zip(STRUCK, moved, strict=True)
    ]


def struck_rod(picture: Path) -> list[Row]:
    """SDNL111 in beam elements."""
    hit = collided(end(rod(*EQUAL), 0.0, 1.0), end(rod(*EQUAL, held=True), 0.0, 1.0))
    t = np.linspace(0.0, 1.02e-3, 500)
    times, values, bounds = (np.array(column) for column in zip(*STRUCK, strict=True))
    with drawing(picture, "time (ms)", "struck end (mm)") as axis:
        axis.plot(t * 1e3, -hit.at(t)["one"].displacement("end") * 1e3, label="antiosc")
        axis.errorbar(times * 1e3, values * 1e3, bounds * 1e3, fmt="ko", label="published")
    return of_the_struck_end(hit)


CONFINED = 2e11 * 0.7 / (1.3 * 0.4)  # E (1 - nu)/((1 + nu)(1 - 2 nu)), nu = 0.3
ABAQUS = Wall(
    2.0,
    2e11,
    7800.0,
    0.2,
    1.5,
    1e-3,
    touch=(6.67e-4, 0.01, "read"),
    lasting=(7.9e-4, 0.02, "read"),
    force=(11.8e6, 0.01, "read"),
    rebound=(1.5, 0.01, "read"),
)
VM265 = Wall(
    10 * INCH,
    3e7 * POUND / INCH**2,
    0.73e-3 * POUND / INCH**4,
    INCH**2,
    202.2 * INCH,
    0.01 * INCH,
    touch=(5e-5, 0.02, "read"),
    lasting=(9.87e-5, 0.02, "recalled"),
)
FREE = Wall(0.2, 2e11, 8000.0, 4e-4, 100.0, 2e-3, lasting=(8e-5, 0.02, "read"))
HELD = Wall(0.2, CONFINED, 8000.0, 4e-4, 100.0, 2e-3, lasting=(68.95e-6, 0.02, "read"))
AREA, SPEED, ENERGY = np.pi * 3.2e-3**2, 227.0, 239.61
COPPER = Wall(
    32.4e-3,
    117e9,
    2 * ENERGY / (SPEED**2 * AREA * 32.4e-3),
    AREA,
    SPEED,
    1e-3,
    touch=(4.405e-6, 1e-3, "read"),
    rebound=(SPEED, 1e-3, "read"),
)
WALLS = {
    "abaqus_truss": ABAQUS,
    "vm265": VM265,
    "sdnv100": FREE,
    "sdnv100_confined": HELD,
    "ansys_bar": COPPER,
}

CASES = [
    Case(
        "sdnl111",
        "A bar strikes a bar that is held at its far end",
        "both 1 m long, 2 cm square, E = 2e11 Pa, ρ = 7800 kg/m³, ν = 0; 1 m/s; contact 5e9 N/m "
        "(the dashpot of 2e4 N s/m and 0.1 % of damping of the source are left out)",
        "code_aster SDNL111, command file astest/sdnl111a.comm: data, analytical values, bounds "
        "of 1 %, 3.5 %, 5 %, 1e-5 m, 3.5 %",
        struck_rod,
    ),
    Case(
        "abaqus_truss",
        "A truss flies against a rigid wall",
        "L = 2 m, A = 0.2 m², E = 2e11 Pa, ρ = 7800 kg/m³, 1.5 m/s, 1 mm away",
        'Abaqus benchmarks, "Truss impact on a rigid wall"; bounds: the digits printed',
        partial(on_a_wall, ABAQUS),
    ),
    Case(
        "vm265",
        "A rod with a gap flies against a wall",
        "L = 10 in, A = 1 in², E = 3e7 psi, 202.2 in/s, 0.01 in away; the density, 0.73e-3 lbf "
        "s²/in⁴, is recalled",
        "Ansys Verification Manual VM265 (Carpenter, Taylor and Katona 1991); bounds: the digits "
        "printed",
        partial(on_a_wall, VM265),
    ),
    Case(
        "sdnv100",
        "A block strikes a wall, free to expand",
        "L = 0.2 m, 2 cm square, E = 2e11 Pa, ν = 0, ρ = 8000 kg/m³, 100 m/s, 2 mm away",
        "code_aster SDNV100, manual V5.03.100; bound 2 %: the rounded value",
        partial(on_a_wall, FREE),
    ),
    Case(
        "sdnv100_confined",
        "The same block, confined sideways",
        "as before with ν = 0.3 and no sideways motion: the modulus of the wave is E(1−ν)/((1+ν)"
        "(1−2ν))",
        "code_aster SDNV100; bound 2 %: contact on a spring",
        partial(on_a_wall, HELD),
    ),
    Case(
        "ansys_bar",
        "A copper bar strikes a rigid wall",
        "32.4 mm long, 3.2 mm radius, 227 m/s, 1 mm away, rigid in the source and elastic here; "
        "the density is that of the 239.61 J that are printed, E = 117 GPa is recalled",
        "Ansys Technology Demonstration Guide, chapter 17, 17.2, 17.6 and 17.7: the exact rebound, "
        "beside which its integrators without impact constraints rebound at 220 to 451 m/s; "
        "bound 0.1 %",
        partial(on_a_wall, COPPER),
    ),
]
