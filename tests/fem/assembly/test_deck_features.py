"""One small deck for each feature of the formats: its mass and its stiffness in closed form.

Bars and sheets are pulled at an end that stays plane: the stress is constant, so that every element
gives E A / L, in skewed meshes too.
"""

from __future__ import annotations

import warnings

import pytest

import antiosc as ao
from assemblies import stiffness
from paths import DECKS

pytestmark = [
    pytest.mark.filterwarnings("ignore:the compliance under a point"),
    pytest.mark.filterwarnings("ignore:an edge cuts the patch"),
    pytest.mark.filterwarnings("ignore:the radius 1e-05 m of the site is less"),
    pytest.mark.filterwarnings("ignore:the 1 .* are springs"),
    pytest.mark.filterwarnings("ignore:.* a mass on a held node"),
]

E, NU, RHO = 2e11, 0.3, 7800.0


def check(name: str, mass: float, k0: float, point, direction) -> ao.Structure:
    part = ao.read_model(DECKS / name)
    assert part.mass == pytest.approx(mass, rel=1e-9)
    assert stiffness(part, ao.Site(point, direction)) == pytest.approx(k0, rel=1e-8)
    return part


#: Those of the quick tests, one for each that has a part of the code of its own.
QUICK = ("c3d20.inp", "surface_tie.inp", "chexa.bdf", "crod.bdf")


def table(names):
    slow = pytest.mark.slow
    return [name if name in QUICK else pytest.param(name, marks=slow) for name in names]


# --- Bars of 1 × 1 × 2 ----------------------------------------------------------------------------

BARS = [
    *(f"{kind}.inp" for kind in ("c3d4", "c3d6", "c3d8", "c3d8i", "c3d8r", "c3d10", "c3d10t")),
    *(f"{kind}.inp" for kind in ("c3d15", "c3d20", "c3d20r", "c3d27")),
    *(f"{kind}.bdf" for kind in ("ctetra", "cpenta", "cpyram", "chexa")),
    *(f"{kind}.bdf" for kind in ("ctetra_10", "cpenta_15", "cpyram_13", "chexa_20")),
    *("generate.inp", "include.inp", "part_instance.inp", "surface_tie.inp", "transform.inp"),
    *("mpc.inp", "include.bdf", "small_fields.bdf", "large_fields.bdf", "continuations.bdf"),
    "coupling.inp",
    *(f"cord{n}{kind}.bdf" for n in (1, 2) for kind in "rcs"),
]


#: A rigid plate struck at its corner: L/EA + 2 e² L/EI, e = 1/2; direction 2 of wood along the bar.
OTHERS = {"rigid_body.inp": E / 14, "orientation.inp": 10e9 / 2}


@pytest.mark.slow
@pytest.mark.parametrize("name", [*BARS, *OTHERS])
def test_a_bar_is_as_stiff_as_its_elements_are_filled(name):
    check(name, 2 * RHO, OTHERS.get(name, E / 2), (0.0, 0.0, 2.0), (0, 0, 1))


# --- Sheets of 1 × 2, 0.1 thick -------------------------------------------------------------------

PLANES = ("3", "4", "4r", "6", "8", "8r")


@pytest.mark.parametrize("kind", table(PLANES))
@pytest.mark.parametrize(("plane", "modulus"), [("cps", E), ("cpe", E / (1 - NU**2))])
def test_a_sheet_in_plane_stress_or_strain(plane, modulus, kind):
    check(f"{plane}{kind}.inp", 0.2 * RHO, modulus * 0.1 / 2, (0.0, 2.0), (0, 1))


SHELLS = [f"{kind}.inp" for kind in ("s3", "s3r", "s4", "s4r", "s6", "stri65", "s8", "s8r")]
SHELLS += [f"c{kind}.bdf" for kind in ("tria3", "tria6", "triar", "quad4", "quad8", "quadr")]


@pytest.mark.parametrize("name", table(SHELLS))
def test_a_strip_is_pulled_and_bent(name):
    """Bent, it is our own shell, clamped across its foot."""
    strip = ao.read_model(DECKS / name)
    assert strip.mass == pytest.approx(0.2 * RHO, rel=1e-9)
    at_end = ao.Site((0.5, 2.0, 0.0), (0, 1, 0), radius=1e-5)  # its patch lies below the end
    assert stiffness(strip, at_end) == pytest.approx(E * 0.1 / 2, rel=1e-5)
    with warnings.catch_warnings(action="ignore"):
        mesh = ao.read_mesh(DECKS / name, gdim=3)
    by_hand = ao.Structure(
        mesh,
        ao.Shell(E, NU, RHO, 0.1),
        [ao.Support(lambda x: x[1] < 1e-9)],
    )
    across = ao.Site((0.5, 1.5, 0), (0, 0, 1))
    assert stiffness(strip, across) == pytest.approx(stiffness(by_hand, across), rel=1e-8)


# --- Cantilevers of 2, 0.2 high and 0.1 wide ------------------------------------------------------

AREA, HIGH, WIDE = 0.02, 0.1 * 0.2**3 / 12, 0.2 * 0.1**3 / 12
SHEAR = 5 / 6 * E / (2 * (1 + NU)) * AREA
UP, ACROSS = (1 / (2**3 / (3 * E * second) + 2 / SHEAR) for second in (HIGH, WIDE))
TIP = (2.0, 0.0, 0.0)

BEAMS = [f"{kind}.inp" for kind in ("b31", "b31r", "b32", "b32r", "b33")]
BEAMS += [f"{kind}.bdf" for kind in ("pbar", "pbarl", "pbeam", "pbeaml")]


@pytest.mark.parametrize("name", table(BEAMS))
def test_a_cantilever(name):
    beam = check(name, 2 * AREA * RHO, UP, TIP, (0, 1, 0))
    assert stiffness(beam, ao.Site(TIP, (0, 0, 1))) == pytest.approx(ACROSS, rel=1e-7)
    assert stiffness(beam, ao.Site(TIP, (1, 0, 0))) == pytest.approx(E * AREA / 2, rel=1e-8)


#: deck -> (mass besides the cantilever's, stiffness besides it)
TIPS = {
    "mass.inp": (12.5, 0.0),
    "conm2.bdf": (12.5, 0.0),
    "springa.inp": (0.0, 5e5),
    "celas.bdf": (0.0, 5e5),
    "cbush.bdf": (0.0, 5e5),
    "rbe3.bdf": (0.0, 5e5),
    # half the mass of a rod of the length 3 moves, half lies on the held node
    "t3d2.inp": (RHO * 1e-4 * 1.5, E * 1e-4 / 3),
    "crod.bdf": (RHO * 1e-4 * 1.5, E * 1e-4 / 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", table(TIPS))
def test_what_a_cantilever_carries_at_its_end(name):
    mass, k = TIPS[name]
    check(name, 2 * AREA * RHO + mass, UP + k, TIP, (0, 1, 0))
