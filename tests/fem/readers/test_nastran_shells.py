"""Shell properties of Nastran decks as the stiffnesses that the cards define, by hand.

A quadrilateral and a triangle of an oblique plane, in mm, N and t.
"""

from __future__ import annotations

import numpy as np
import pytest

import nastran_decks as bdf
from antiosc.base.errors import MeshError

RNG = np.random.default_rng(31)
ORIGIN, E1, E2 = np.round(RNG.uniform(-1, 1, (3, 3)), 3)
NORMAL = np.cross(E1, E2) / np.linalg.norm(np.cross(E1, E2))
#: Corners of the quadrilateral, then those of the triangle beside it, then middle nodes.
FLAT = np.array([(0, 0), (2, 0.3), (2.2, 1.7), (-0.1, 1.5), (3.4, 0.6)])
X = ORIGIN + FLAT @ np.stack([E1, E2])
QUAD, TRIA = (1, 2, 3, 4), (2, 5, 3)


def grids() -> str:
    """Numbers in large fields, which hold all digits."""
    text = ""
    for k, x in enumerate(X, 1):
        a, b, c = (f"{value:16.13f}" for value in x)
        text += f"GRID*   {k:16d}{'':16}{a}{b}\n*       {c}\n"
    return text


MAT1 = "MAT1,1,2.+5,,.25,8.-9\n"
MAT8 = "MAT8,2,9.+4,2.+4,.3,5.+3,4.+3,3.+3,2.-9\n"
MAT2 = "MAT2,3,100.,20.,3.,80.,4.,50.,3.-9\n"
#: Plane stress of MAT1 and MAT8, MPa.
Q1 = 2e5 / (1 - 0.25**2) * np.array([[1, 0.25, 0], [0.25, 1, 0], [0, 0, 0.375]])
Q2 = np.linalg.inv([[1 / 9e4, -0.3 / 9e4, 0], [-0.3 / 9e4, 1 / 2e4, 0], [0, 0, 1 / 5e3]])
Q3 = np.array([[100.0, 20, 3], [20, 80, 4], [3, 4, 50]])


@pytest.fixture
def families(tmp_path):
    def of(cards: str) -> tuple[list, list[str]]:
        model, _ = bdf.read(tmp_path, grids() + cards)
        return [(kind, given) for _, kind, given, _ in model["families"]], model["ignored"]

    return of


QUAD_CARD = "CQUAD4,1,7,1,2,3,4,30.\n"


def turned(angle: float, nodes=QUAD) -> np.ndarray:
    """The first side rotated about the normal by an angle in degrees."""
    side = X[nodes[1] - 1] - X[nodes[0] - 1]
    side = side / np.linalg.norm(side)
    a = np.radians(angle)
    return np.cos(a) * side + np.sin(a) * np.cross(NORMAL, side)


GIVEN = {
    # MID1, MID2, 12I/T3, MID3, TS/T: A, D per (T, T3/12), S per T
    "bending ratio": ("1,.4,1,2.5,1", Q1, 2.5 * Q1, 5 / 6 * 8e4 * np.eye(2)),
    "shear ratio": ("1,.4,1,,1,.7", Q1, Q1, 0.7 * 8e4 * np.eye(2)),
    "a core": ("1,.4,1,1.5,3,.6", Q1, 1.5 * Q1, 0.6 * Q3[:2, :2]),
    "no shear": ("2,.4,2,1.5", Q2, 1.5 * Q2, 5 / 6 * np.diag([4e3, 3e3])),
    "anisotropic": ("3,.4,3,1.2,3", Q3, 1.2 * Q3, 5 / 6 * Q3[:2, :2]),
}
DENSITY = {"1": 8e3, "2": 2e3, "3": 3e3}


@pytest.mark.parametrize("case", GIVEN)
def test_a_shell_of_stiffnesses(families, case):
    """A = T Q, D = (12I/T³) T³/12 Q, S = TS G of the core; the mass per area with NSM."""
    fields, A, D, S = GIVEN[case]
    words = fields.split(",") + [""] * (6 - len(fields.split(",")))
    cards = QUAD_CARD + f"PSHELL,7,{','.join(words)},6.-9\n"
    (((kind, given),), ignored) = families(cards + MAT1 + MAT2 + MAT8)
    assert kind == "GivenSheet"
    t = 4e-4
    np.testing.assert_allclose(given["A"], A * 1e6 * t, rtol=1e-9)
    np.testing.assert_allclose(given["D"], D * 1e6 * t**3 / 12, rtol=1e-9)
    np.testing.assert_allclose(given["S"], S * 1e6 * t, rtol=1e-9)
    mass = DENSITY[words[0]] * t + 6e-9 * 1e9  # t/mm² in kg/m²
    assert given["mass"] == pytest.approx(mass)
    ratio = float(words[3] or 1)
    assert given["inertia"] == pytest.approx(mass * ratio * t**2 / 12)
    assert given["thickness"] == pytest.approx(t)
    np.testing.assert_allclose(given["axis"], turned(30), atol=1e-9)
    np.testing.assert_allclose(given["top"], NORMAL, atol=1e-9)
    assert any("no MID3" in text for text in ignored) == (case == "no shear")


ELEMENTS = {
    # the fields after the nodes: THETA, ZOFFS, then TFLAG and thicknesses on the next line
    "CQUAD4": ("CQUAD4,1,7,1,2,3,4,20.,.05\n,,{},.1,.2,.3,.4\n", 0.25, QUAD),
    "CQUADR": ("CQUADR,1,7,1,2,3,4,20.,.05\n,,{},.1,.2,.3,.4\n", 0.25, QUAD),
    "CTRIA3": ("CTRIA3,1,7,2,5,3,20.,.05\n,,{},.1,.2,.6\n", 0.3, TRIA),
    "CTRIAR": ("CTRIAR,1,7,2,5,3,20.,.05\n,,{},.1,.2,.6\n", 0.3, TRIA),
}


@pytest.mark.parametrize("flag", ["", "1"])
@pytest.mark.parametrize("name", ELEMENTS)
def test_thicknesses_and_directions_of_elements(families, name, flag):
    """T1 to T4 are thicknesses or, with TFLAG = 1, shares of that of the property."""
    card, mean, nodes = ELEMENTS[name]
    cards = card.format(flag) + "PSHELL,7,2,.5,2,,2\n" + MAT8
    (((kind, given),), ignored) = families(cards)
    assert kind == "Laminate"
    (layer,) = given["layers"]
    assert layer["thickness"] == pytest.approx(1e-3 * mean * (0.5 if flag else 1))
    assert given["offset"] == pytest.approx(5e-5)
    np.testing.assert_allclose(given["axis"], turned(20, nodes), atol=1e-9)
    assert any("thickness within 1 elements of PSHELL 7" in text for text in ignored)


@pytest.mark.parametrize("name", ["PCOMP", "PCOMPG"])
@pytest.mark.parametrize("symmetric", ["", "SYM"])
@pytest.mark.parametrize("bottom", ["", "-.5", "0."])
def test_plies_from_the_bottom(families, name, symmetric, bottom):
    """Z0 is the bottom; blank materials and thicknesses are those before; NSM is spread."""
    plies = [("2", ".1", "0."), ("", "", "45."), ("2", ".3", "-30.")]
    card = f"{name},7,{bottom},9.-9,,,,,{symmetric}\n"
    words = []
    for k, ply in enumerate(plies):
        words += [str(k + 1), *ply, "", "", "", ""] if name == "PCOMPG" else [*ply, ""]
    for k in range(0, len(words), 8):
        card += "," + ",".join(words[k : k + 8]) + "\n"
    (((kind, given),), ignored) = families("CQUAD4,1,7,1,2,3,4,30.,.02\n" + card + MAT8)
    assert kind == "Laminate"
    assert f"nonstructural mass of {name} 7" in ignored[0]
    expected = [(0, 1e-4), (45, 1e-4), (-30, 3e-4)]
    if symmetric:
        expected += expected[::-1]
    total = sum(t for _, t in expected)
    found = [(layer["angle"], layer["thickness"]) for layer in given["layers"]]
    assert found == [pytest.approx(one) for one in expected]
    for layer in given["layers"]:
        assert layer["rho"] == pytest.approx(2e3 + 9e-9 * 1e9 / total)
        assert [layer[key] for key in ("E1", "E2", "nu12", "G12", "G13", "G23")] == pytest.approx(
            [9e10, 2e10, 0.3, 5e9, 4e9, 3e9]
        )
    middle = float(bottom) * 1e-3 + total / 2 if bottom else 0.0
    assert given["offset"] == pytest.approx(middle + 2e-5)
    np.testing.assert_allclose(given["axis"], turned(30), atol=1e-9)


WRONG = {
    "PSHELL,7,1,.4,-1\n": (0, "strain"),
    "PSHELL,7,1,.4,1,,1,,\n,,,1\n": (0, "MID4"),
    "PSHELL,7,1,.4,1,-1.,1\n": (0, "must be above 0"),
    "PCOMP,7\n": (0, "PCOMP with no plies"),
    "PCOMP,7\n,3,.1,0.\n": (2, "couples stretching with shear"),
}


@pytest.mark.parametrize("card", WRONG)
def test_what_is_wrong_is_told_with_its_line(families, card):
    beyond, message = WRONG[card]
    line = grids().count("\n") + 2 + beyond
    with pytest.raises(MeshError, match=rf"line {line} of .*{message}"):
        families(QUAD_CARD + card + MAT2 + MAT1 + MAT8)


def test_an_isotropic_shell(families):
    cards = QUAD_CARD + "PSHELL,7,1,.4,1,,1,,6.-9\n" + MAT1
    (((kind, given),), ignored) = families(cards)
    assert kind == "Shell"
    assert given["E"] == pytest.approx(2e11)
    assert given["nu"] == pytest.approx(0.25)
    assert given["thickness"] == pytest.approx(4e-4)
    assert given["rho"] == pytest.approx(8e3 + 6e-9 / 0.4 * 1e12)
    assert "offset" not in given
    assert not [text for text in ignored if "PSHELL 7" in text and "shear" in text]


@pytest.mark.parametrize(
    ("where", "offset"),
    [("CQUAD4,1,7,1,2,3,4,,.05\n", 0.05), ("CQUAD4,1,7,1,2,3,4,,-.05\n", -0.05)],
)
def test_an_offset_is_that_of_the_element(families, where, offset):
    (((_, given),), _) = families(where + "PSHELL,7,1,.4,1,,1\n" + MAT1)
    assert given["offset"] == pytest.approx(1e-3 * offset)
