"""What decks say of materials, masses, supports and springs, in SI units; turned instances."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc_decks.properties import (
    constants_of_stiffness,
    isotropic,
)


def ply(card: str) -> str:
    section = "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n.5\n"
    return SHEET + section + "*MATERIAL,NAME=M\n" + card + DENSITY


def fixed(deck) -> dict[str, list[int]]:
    return {name.removeprefix("fixed "): (rows + 1).tolist() for name, rows in deck.fixed.items()}


TURNED = "CORD2R,5,,0.,0.,0.,1.,0.,0.\n,0.,1.,0.\n"  # its z is x, its x is y, its y is z


CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]


@pytest.fixture
def abaqus(tmp_path):
    return partial(inp.read, tmp_path)


@pytest.fixture
def bulk(tmp_path):
    return partial(bdf.read, tmp_path)


def constants(E, nu, G) -> np.ndarray:
    """Stiffness (6, 6) of three moduli, ν12, ν13, ν23 and three shear moduli."""
    S = np.diag([*(1 / np.array(E)), *(1 / np.array(G))])
    S[0, 1] = S[1, 0] = -nu[0] / E[0]
    S[0, 2] = S[2, 0] = -nu[1] / E[0]
    S[1, 2] = S[2, 1] = -nu[2] / E[1]
    return np.linalg.inv(S)


NODES = "*NODE,NSET=N\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(CORNERS, 1))
SHEET = NODES + "*ELEMENT,TYPE=S4,ELSET=ALL\n1,1,2,3,4\n"
DENSITY = "*DENSITY\n2.E-9\n"


D = constants([9e4, 2e4, 1e4], [0.3, 0.25, 0.4], [5e3, 4e3, 3e3])
ORTHO = ",".join(repr(float(D[i, j])) for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))
CARDS = {
    "engineering": "*ELASTIC,TYPE=ENGINEERING CONSTANTS\n9E4,2E4,1E4,.3,.25,.4,5E3,4E3,\n3E3\n",
    "lamina": "*ELASTIC,TYPE=LAMINA\n9E4,2E4,.3,5E3,4E3,3E3\n",
    "ortho": f"*ELASTIC,TYPE=ORTHOTROPIC\n{ORTHO},5E3,4E3,\n3E3\n",
}


@pytest.mark.parametrize(
    ("layer", "angle"), [("", 0), (",30.", 30), (",TURNED", 40), (",SWAPPED", 90)]
)
def test_angles_of_layers_count_from_the_axis_of_the_stack(abaqus, layer, angle):
    """By a number, or by an orientation of the layer's own; the stack's own lies 20° from x."""
    axes = (
        "*ORIENTATION,NAME=O\n1,0,0,0,1,0\n3,20.\n"
        "*ORIENTATION,NAME=TURNED\n1,0,0,0,1,0\n3,60.\n"
        "*ORIENTATION,NAME=SWAPPED\n-0.3420201,0.9396926,0,1,0,0\n"
    )
    section = f"*SHELL SECTION,ELSET=ALL,COMPOSITE,ORIENTATION=O\n.5,3,M{layer}\n"
    model, _ = abaqus(SHEET + section + "*MATERIAL,NAME=M\n" + CARDS["lamina"] + DENSITY + axes)
    ((_, _, given, _),) = model["families"]
    cos, sin = np.cos(np.radians(20)), np.sin(np.radians(20))
    assert given["axis"] == pytest.approx([cos, sin, 0])
    assert given["layers"][0]["angle"] == pytest.approx(angle, abs=1e-5)


@pytest.mark.parametrize(("askew", "axis"), [(0.0, [0, 0, 1]), (0.05, [0, 0, 1]), (0.2, [1, 0, 0])])
def test_the_axis_of_a_stack_without_orientation(abaqus, askew, axis):
    """x along the surface; z where the normal lies within 0.1° of x, as Abaqus defines it."""
    deck = SHEET.replace("ELSET=ALL\n1,1,2,3,4", "ELSET=ALL\n1,11,12,13,14")
    slope = np.tan(np.radians(askew))
    corners = [(slope * z, y, z) for y, z in ((0, 0), (1, 0), (1, 1), (0, 1))]
    deck += "*NODE\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(corners, 11))
    section = "*SHELL SECTION,ELSET=ALL,COMPOSITE\n.5,3,M\n"
    model, _ = abaqus(deck + section + "*MATERIAL,NAME=M\n" + CARDS["lamina"] + DENSITY)
    ((_, _, given, _),) = model["families"]
    assert given["axis"] == axis


MAT = "MAT1,1,2.+5,,.3,2.-9\n"
QUAD = bdf.UNIT_GRIDS + "CQUAD4,1,1,1,2,3,4\nCQUAD4,2,1,5,6,7,8\nPSHELL,1,1,.1,1\n" + MAT


def test_stiffness_gives_back_the_constants():
    E, nu, G = [9e4, 2e4, 1e4], [0.3, 0.25, 0.4], [5e3, 4e3, 3e3]
    np.testing.assert_allclose(
        constants_of_stiffness(constants(E, nu, G)), [*E, *nu, *G], rtol=1e-12
    )
    steel = isotropic(2e5, 0.3)
    np.testing.assert_allclose(
        constants_of_stiffness(constants(steel[:3], steel[3:6], steel[6:])), steel
    )


@pytest.mark.parametrize("kind", CARDS)
def test_an_orthotropic_shell_is_a_laminate_of_one_layer(abaqus, kind):
    """In N and mm: moduli × 10⁶ Pa, density × 10¹² kg/m³."""
    model, _ = abaqus(ply(CARDS[kind]))
    ((name, family, given, _),) = model["families"]
    assert (name, family) == ("ALL", "Laminate")
    (layer,) = given["layers"]
    expected = {"E1": 9e10, "E2": 2e10, "nu12": 0.3, "G12": 5e9, "G13": 4e9, "G23": 3e9}
    expected |= {"rho": 2e3, "thickness": 5e-4, "angle": 0.0}
    assert layer == pytest.approx(expected)
    assert given["axis"] == pytest.approx([1, 0, 0])
    assert given["top"] == pytest.approx([0, 0, 1])


def test_springs_and_supports_follow_the_system_of_their_node(bulk):
    quad = QUAD.replace("GRID,3,,1.,1.,0.", "GRID,3,,1.,1.,0.,5") + TURNED
    model, deck = bulk(quad + "CELAS2,9,5.,3,1\nCELAS2,10,7.,3,6\nSPC1,1,2,3\nSPC,1,3,5,,4,123\n")
    assert model["springs"][0][1] == pytest.approx({"y": 5e3})
    assert model["springs"][1][1] == pytest.approx({"rx": 7e-3})
    assert fixed(deck) == {"x": [4], "y": [4], "z": [3, 4], "rz": [3]}


#: A rotation by 90° about the line along z through (5, 0, 0), after a shift by 100.
ROTATED = "*INSTANCE,NAME=I,PART=P\n100,0,0\n5,0,0,5,0,1,90\n*END INSTANCE\n"
STRAIGHT = "*INSTANCE,NAME=J,PART=P\n0,0,50\n*END INSTANCE\n"
BEAM = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=RECT\n2,1\n"
ORTHOTROPIC = "*MATERIAL,NAME=M\n*ELASTIC,TYPE=LAMINA\n9E4,2E4,.25,5E3,4E3,3E3\n*DENSITY\n2.E-9\n"
COMPOSITE = "*SHELL SECTION,ELSET=ALL,COMPOSITE{}\n.5,3,M,0.\n"
ALONG = "*ORIENTATION,NAME=O\n{}\n"


def deck(part: str, placed: str, rest: str = "", material: str = inp.STEEL) -> str:
    """A deck of one part."""
    return f"*PART,NAME=P\n{part}*END PART\n*ASSEMBLY\n{placed}{rest}*END ASSEMBLY\n{material}"


@pytest.mark.parametrize("points", ["1,0,0,0,1,0", "3,2,1,2,3,1,2,2,1"])
def test_the_axes_of_layers(tmp_path, points):
    """By two points, and an origin if it is given."""
    part = inp.SHEET + ALONG.format(points) + COMPOSITE.format(",ORIENTATION=O")
    model, _ = inp.read(tmp_path, deck(part, ROTATED + STRAIGHT, material=ORTHOTROPIC))
    found = {name: arguments["axis"] for name, _, arguments, _ in model["families"]}
    assert found["I.All"] == pytest.approx([0, 1, 0], abs=1e-12)
    assert found["J.All"] == pytest.approx([1, 0, 0], abs=1e-12)


@pytest.mark.parametrize(
    ("part", "material"),
    [
        (inp.BARS + BEAM, inp.STEEL),
        (inp.BARS + BEAM + "0,1,0\n*BOUNDARY\n1,1,1\n", inp.STEEL),
        (inp.BARS + BEAM + "0,1,0\n*EQUATION\n2\n2,1,1.,3,1,-1.\n", inp.STEEL),
        (inp.SHEET + COMPOSITE.format(""), ORTHOTROPIC),
        (
            inp.CUBE + inp.SOLID,
            "*MATERIAL,NAME=M\n*ELASTIC,TYPE=ENGINEERING CONSTANTS\n9E4,2E4,2E4,.2,.2,.2,5E3,5E3,\n"
            "5E3\n*DENSITY\n2.E-9\n",
        ),
        (
            inp.BARS + BEAM + "0,1,0\n*ELEMENT,TYPE=SPRING1,ELSET=K\n5,2\n*SPRING,ELSET=K\n1\n4.\n",
            inp.STEEL,
        ),
    ],
)
def test_motions_and_axes_by_their_numbers_are_refused(tmp_path, part, material):
    inp.read(tmp_path, deck(part, STRAIGHT, material=material))
    with pytest.raises(MeshError, match="rotated"):
        inp.read(tmp_path, deck(part, ROTATED, material=material))


def test_the_axes_of_beams(tmp_path):
    text = deck(inp.BARS + BEAM + "0,1,0\n", ROTATED + STRAIGHT)
    model, _ = inp.read(tmp_path, text)
    found = {name: arguments["orientation"] for name, _, arguments, _ in model["families"]}
    assert found["I.ALL"] == pytest.approx([-1, 0, 0], abs=1e-12)
    assert found["J.ALL"] == [0, 1, 0]
