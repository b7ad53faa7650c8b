"""NAFEMS's benchmarks of forced vibration: a beam and two plates under a load that is uniform.

A uniform load on a uniform part is that of an acceleration of its supports. One run gives the
answer to a load that sets in suddenly; its transform gives the harmonic answer H(f), and |H|² is
that to a random load of density one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from case import Case, Row, drawing
from frequencies import STEEL, compare, meshed, quadrilateral
from lines import line
from numpy.typing import NDArray

import antiosc as ao

Array = NDArray[np.float64]
PERIODS, SAMPLES = 100, 40_000  # of the first mode, until its motion has died away


class Forced(NamedTuple):
    """A part under a uniform load, where it is looked at, and the values that are printed."""

    build: Callable[[], ao.Structure]
    centre: Sequence[float]
    acceleration: Sequence[float]
    fibre: dict[str, Any]
    step: tuple[float, float, float, float]  # peak in mm, its time in s, stress in MPa, at rest
    harmonic: tuple[float, float, float]  # deflection, stress, frequency in Hz
    random: tuple[float, float]
    why: str


def beam() -> ao.Structure:
    """Test 5, in its plane: 10 m long, 2 m square, simply supported."""
    section = ao.Section.rectangle(2.0, 2.0)
    supports = [ao.Support("near", fix=("x", "y")), ao.Support("far", fix="y")]
    return ao.Structure(line(10.0, 20), ao.Beam(**STEEL, section=section), supports)


def plate(thickness: float) -> ao.Structure:
    """Tests 13 and 21: 10 m square, simply supported, no rotation about the edges' normals."""
    text = quadrilateral([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)], (16, 16))
    supports = [
        ao.Support("part", fix=("x", "y", "rz")),
        *(ao.Support(f"edge{i}", fix=("z", "rx" if i % 2 == 0 else "ry")) for i in range(1, 5)),
    ]
    return ao.Structure(meshed(text, gdim=3), ao.Shell(**STEEL, thickness=thickness), supports)


def answer(test: Forced) -> tuple[Array, Array, Array]:
    """Times, deflection (mm) and stress (MPa) at the centre after the load has set in."""
    part = test.build()
    up = np.sign(test.acceleration)[: len(test.centre)]
    model = ao.extract(part, {"centre": ao.Site(test.centre, up)}, n=30, damping=0.02)

    ground = ao.Base([0.0, 1.0], [test.acceleration] * 2)
    out_of_reach = ao.Contact("part:centre", "stop", ao.Linear(1.0), gap=1.0)
    scene = ao.Scene({"part": model, "stop": ao.Obstacle()}, [out_of_reach], base=ground)
    t = np.linspace(0.0, PERIODS / test.harmonic[2], SAMPLES + 1)
    hit = scene.run(t[-1], tol=1e-4)

    moved = ao.probe(part, hit, test.centre, "displacement", t) @ up
    stress = ao.probe(part, hit, test.centre, "stress", t, **test.fibre)[:, 0, 0]
    return t, -1e3 * moved, 1e-6 * stress * np.sign(stress[-1])


def harmonic(t: Array, values: Array, frequencies: Array) -> Array:
    """|H| (…, n) of answers to a sine, from those to a step, `values` (…, times)."""
    moving = (values - values[:, -1:]) * np.gradient(t)
    moving[:, 0] /= 2
    omega = 2j * np.pi * frequencies
    changes = omega * (moving @ np.exp(-np.outer(t, omega)))
    return np.asarray(np.abs(values[:, -1:] + changes))


def forced(test: Forced, picture: Path) -> list[Row]:
    """The printed values of the three loads."""
    t, moved, stress = answer(test)
    frequencies = test.harmonic[2] * np.linspace(0.95, 1.05, 401)
    H = harmonic(t, np.array([moved, stress]), frequencies)
    peak = int(np.argmax(moved))
    at = float(frequencies[np.argmax(H[0])])
    found = [moved[peak], t[peak], stress.max(), moved[-1], H[0].max(), H[1].max(), at]
    names = (
        *("T: peak, mm", "T: its time, s", "T: peak stress, MPa", "T: at rest, mm"),
        *("H: peak, mm", "H: peak stress, MPa", "H: frequency, Hz"),
        *("R: peak density, mm²/Hz", "R: peak density of stress, MPa²/Hz"),
    )
    values = [*test.step, *test.harmonic, *test.random]
    found += [H[0].max() ** 2, H[1].max() ** 2]

    early = t < 4 / test.harmonic[2]
    with drawing(picture, "time (s)", "deflection of the centre (mm)") as axis:
        axis.plot(t[early], moved[early], label="antiosc")
        axis.plot([test.step[1]], [test.step[0]], "ko", label="published")
        axis.axhline(test.step[3], color="k", ls=":", label="published, at rest")
    return [
        Row(name, value, float(ours), 0.04 if name.startswith("R") else 0.02, why=test.why)
        for name, value, ours in zip(names, values, found, strict=True)
    ]


THIN, THICK = 0.05, 1.0
CENTRE = (5.0, 5.0, 0.0)
FIRST_TERM = (
    "The book takes the first term of Navier's series alone: at rest 1.8174 mm and 1.281 MPa, "
    "where the series has 1.7745 mm and 1.149 MPa. Its harmonic stress of 30.03 MPa is a "
    "misprint: the density of its random test is 32.02²."
)
STATIC = (
    "The book multiplies the deflection at rest by one dynamic factor, that of the first mode. Of "
    "2.333 mm at rest the first term of Navier's series with shear is 2.400 mm, which resounds."
)
TESTS = {
    "r0016_5": Forced(
        beam, (5.0, 0.0), (0.0, 1e6 / (4 * 8000), 0.0), {"fibre": (1.0, 0.0)},
        (1.043, 0.0117, 18.76, 0.538), (13.45, 241.9, 42.65), (180.90, 58516.0), "",
    ),
    "r0016_13": Forced(
        partial(plate, THIN), CENTRE, (0.0, 0.0, 100 / (THIN * 8000)), {},
        (3.523, 0.210, 2.484, 1.817), (45.42, 30.03, 2.377), (2063.20, 1025.44), FIRST_TERM,
    ),
    "r0016_21": Forced(
        partial(plate, THICK), CENTRE, (0.0, 0.0, 1e6 / (THICK * 8000)), {},
        (4.524, 0.0108, 62.11, 2.333), (58.33, 800.8, 45.90), (3401.81, 641200.0), STATIC,
    ),
}  # fmt: skip


def seen(thickness: float) -> tuple[ao.Structure, ao.Site]:
    """A plate and a site that all its modes move."""
    return plate(thickness), ao.Site((9.0, 7.7, 0.0), (0.0, 0.0, 1.0))


MODES = ("1", "2, 3", "4", "5, 6", "7, 8")
R0016 = "NAFEMS, Selected Benchmarks for Forced Vibration, R0016"
READ = "the values of T, H and R read in {}; bound 2 %, of densities 4 %"
GIVEN = (
    "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³, 2 % of critical damping; {}. T: it sets in suddenly; "
    "H: it is harmonic; R: it is random, of density one"
)
SQUARE = "10 m square, {} m thick, simply supported, no rotation about the edges' normals; {} on it"


def frequencies(name: str, thickness: float, values: Sequence[float], read: str) -> Case:
    """The frequencies of a plate."""
    published = list(zip(MODES, values, strict=True))
    run = partial(compare, partial(seen, thickness), published, 0.002)
    title = f"NAFEMS test {name}: frequencies of a simply supported plate of {thickness:g} m"
    given = "E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³; 10 m square, no rotation about edges' normals"
    source = f"{R0016}; closed form, read in {read}; bound 0.2 %"
    return Case(f"r0016_{name}_modes", title, given, source, run)


CASES = [
    frequencies(
        "13", THIN, (2.377, 5.942, 9.507, 11.884, 15.449), "CATIA's analysis guide (elfugbt0204)"
    ),
    frequencies(
        "21", THICK, (45.897, 109.44, 167.89, 204.51, 256.50), "the OptiStruct manual, OS-V 0470"
    ),
    Case(
        "r0016_5",
        "NAFEMS tests 5T, 5H and 5R: a deep beam under a uniform load",
        GIVEN.format("10 m long, 2 m square, simply supported; 1 MN/m on it"),
        f"{R0016}; {READ.format('the Abaqus benchmark manual, 4.5.2 and 4.5.3, and its test 5R')}",
        partial(forced, TESTS["r0016_5"]),
    ),
    Case(
        "r0016_13",
        "NAFEMS tests 13T, 13H and 13R: a thin plate under a uniform load",
        GIVEN.format(SQUARE.format(THIN, "100 Pa")),
        f"{R0016}; {READ.format('the OptiStruct manual, OS-V 0365, 0340 and 0396')}",
        partial(forced, TESTS["r0016_13"]),
    ),
    Case(
        "r0016_21",
        "NAFEMS tests 21T, 21H and 21R: a thick plate under a uniform load",
        GIVEN.format(SQUARE.format(f"{THICK:g}", "1 MPa")),
        f"{R0016}; {READ.format('the Abaqus benchmark manual, 4.5.11, and OS-V 0370 and 0395')}",
        partial(forced, TESTS["r0016_21"]),
    ),
]
