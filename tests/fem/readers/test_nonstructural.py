"""Nonstructural mass: the mass of every kind of section, against the formula of its kind."""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc.io.deck import Block, Deck
from antiosc_decks.properties import measures_of

#: kg/m³ of a t/mm³.
UNIT = 1e12
#: Two cells of 20 x 10 mm, 2 mm thick, 8e-9 t/mm³; beams of 2 mm² along 20 mm.
SOLID = inp.CUBE + inp.SOLID
SHEET = inp.SHEET + "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n2.\n"
LAYERS = inp.SHEET + "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,,M,0\n1.5,,M,0\n"
BARS = inp.BARS + "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=RECT\n2.,1.\n0,0,1\n"
RODS = inp.BARS.replace("B31", "T3D2") + "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n2.\n"
CASES = {
    "total": (SOLID, "TOTAL MASS", 3e-6, 3e-6 / 2000),
    "per volume": (SOLID, "MASS PER VOLUME", 1e-9, 1e-9),
    "shell, per area": (SHEET, "MASS PER AREA", 3e-9, 3e-9 / 2),
    "layers, per area": (LAYERS, "MASS PER AREA", 3e-9, 3e-9 / 2),
    "shell, total": (SHEET, "TOTAL MASS,DISTRIBUTION=VOLUME PROPORTIONAL", 4e-7, 4e-7 / 400),
    "beam, per length": (BARS, "MASS PER LENGTH", 3e-9, 3e-9 / 2),
    "rods, total": (RODS, "TOTAL MASS", 8e-8, 8e-8 / 80),
}


def densities(model) -> list[float]:
    """kg/m³ of the families of a model."""
    given = [arguments for _, _, arguments, *_ in model["families"]]
    return [a.get("rho") or np.mean([layer["rho"] for layer in a["layers"]]) for a in given]


@pytest.mark.parametrize("case", CASES)
def test_nonstructural_mass_of_abaqus(tmp_path, case):
    deck, units, value, more = CASES[case]
    card = f"*NONSTRUCTURAL MASS,ELSET=ALL,UNITS={units}\n{value!r}\n"
    model, _ = inp.read(tmp_path, deck + inp.STEEL + card)
    assert densities(model) == pytest.approx([(8e-9 + more) * UNIT])


def test_mass_in_proportion_to_mass_or_volume(tmp_path):
    """Two sheets, one of twice the density."""
    sheets = inp.BENT.replace("2,2,9,10,3\n", "*ELEMENT,TYPE=S4,ELSET=B\n2,5,6,7,8\n")
    text = sheets + "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n2.\n*SHELL SECTION,ELSET=B,MATERIAL=N\n"
    text += "2.\n*MPC\nTIE,1,5\n" + inp.STEEL + inp.STEEL.replace("=M", "=N").replace("8.E", "16.E")
    text += "*ELSET,ELSET=BOTH\nALL,B\n*NONSTRUCTURAL MASS,ELSET=BOTH,UNITS=TOTAL MASS"
    by_mass, _ = inp.read(tmp_path, text + "\n9.6e-6\n")
    assert densities(by_mass) == pytest.approx([16e3, 32e3])
    by_volume, _ = inp.read(tmp_path, text + ",DISTRIBUTION=VOLUME PROPORTIONAL\n8e-6\n")
    assert densities(by_volume) == pytest.approx([18e3, 26e3])


@pytest.mark.parametrize("units", ["MASS PER LENGTH", "MASS PER AREA", "MASS PER YEAR"])
def test_masses_of_another_dimension_are_refused(tmp_path, units):
    card = f"*NONSTRUCTURAL MASS,ELSET=ALL,UNITS={units}\n1\n"
    with pytest.raises(MeshError, match=inp.line(SOLID + inp.STEEL + card, "*NONST")):
        inp.read(tmp_path, SOLID + inp.STEEL + card)


SHELLS = bdf.GRIDS + bdf.MAT1 + "CQUAD4,1,7,1,2,3,4\nCQUAD4,2,8,5,6,7,8\nRBE2,9,1,123456,5\n"
SHELLS += "PSHELL,7,1,2.,1,,1\nPSHELL,8,1,2.,1,,1\n"
#: Entry -> densities of both shells beyond the material's, t/mm³.
ENTRIES = {
    "NSM,3,PSHELL,7,2.-9,8,4.-9": (1e-9, 2e-9),
    "NSM1,3,PSHELL,2.-9,7,THRU,8": (1e-9, 1e-9),
    "NSM1,3,PSHELL,2.-9,ALL": (1e-9, 1e-9),
    "NSM,3,ELEMENT,2,4.-9": (0, 2e-9),
    "NSML,3,PSHELL,7,4.-7,8,8.-7": (1e-9, 2e-9),
    "NSML1,3,PSHELL,8.-7,7,8": (1e-9, 1e-9),
    "NSML1,3,ELEMENT,8.-7,1": (2e-9, 0),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_nonstructural_mass_of_nastran(tmp_path, entry):
    """By properties and elements, per area (NSM) or in all (NSML); WTMASS counts."""
    for factor in (1.0, 0.5):
        text = f"{SHELLS}{entry}\nPARAM,WTMASS,{factor}\n"
        model, _ = bdf.read(tmp_path, text)
        expected = [(8e-9 + more) * UNIT * factor for more in ENTRIES[entry]]
        assert sorted(densities(model)) == pytest.approx(sorted(expected))


def test_the_case_control_selects_nonstructural_mass(tmp_path):
    text = SHELLS + "NSM,3,PSHELL,7,2.-9\nNSM,4,PSHELL,8,2.-9\nNSMADD,5,3,4\n"
    for control, more in (("NSM=4\n", (0, 1)), ("NSM=5\n", (1, 1)), ("LOAD=1\n", (0, 0))):
        model, deck = bdf.read(tmp_path, f"{control}BEGIN BULK\n{text}")
        assert densities(model) == pytest.approx([8e3 + 1e3 * k for k in more])
        assert any("NSM set" in told for told in deck.told) == (sum(more) < 2)


def test_nonstructural_mass_of_nothing_is_refused(tmp_path):
    with pytest.raises(MeshError, match="of no element"):
        bdf.read(tmp_path, SHELLS + "NSM,3,PSHELL,99,2.-9\n")
    card = "*NONSTRUCTURAL MASS,ELSET=ALL,UNITS=MASS PER AREA\n3e-9\n"
    for sheet in (SHEET.replace("2.\n", "0.\n"), LAYERS.replace("1.5,", "-.5,")):
        with pytest.raises(MeshError, match="without thickness"):
            inp.read(tmp_path, sheet + inp.STEEL + card)


def test_measures_of_cells():
    """An affine image of each reference cell has its measure times the determinant."""
    rng = np.random.default_rng(5)
    J = rng.normal(size=(3, 3))
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    up = np.array([0.0, 0.0, 1.0])
    flat, across = square[[0, 1, 3]], np.linalg.norm(np.cross(J[:, 0], J[:, 1]))
    det = abs(np.linalg.det(J))
    cells = {
        "line": (square[:2], np.linalg.norm(J[:, 0])),
        "triangle": (flat, across / 2),
        "quad": (square, across),
        "tetra": (np.vstack([flat, up]), det / 6),
        "pyramid": (np.vstack([square, up]), det / 3),
        "wedge": (np.vstack([flat, flat + up]), det / 2),
        "hexahedron": (np.vstack([square, square + up]), det),
    }
    for shape, (x, expected) in cells.items():
        none = np.zeros((1, 0), dtype=np.int64)
        deck = Deck("a", x @ J.T, [Block(shape, "", np.arange(len(x))[None], none, none)])
        assert measures_of(deck, np.array([0]))[0] == pytest.approx(expected, rel=1e-12)
