"""Directions that a part gives turn with each of its instances, or are refused."""

from __future__ import annotations

import pytest

from abaqus_decks import BARS, BENT, CUBE, SHEET, SOLID, STEEL, read
from antiosc.base.errors import MeshError

#: A rotation by 90° about the line along z through (5, 0, 0), after a shift by 100.
TURNED = "*INSTANCE,NAME=I,PART=P\n100,0,0\n5,0,0,5,0,1,90\n*END INSTANCE\n"
STRAIGHT = "*INSTANCE,NAME=J,PART=P\n0,0,50\n*END INSTANCE\n"
BEAM = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION=RECT\n2,1\n"
ORTHOTROPIC = "*MATERIAL,NAME=M\n*ELASTIC,TYPE=LAMINA\n9E4,2E4,.25,5E3,4E3,3E3\n*DENSITY\n2.E-9\n"
LAYERS = "*SHELL SECTION,ELSET=ALL,COMPOSITE{}\n.5,3,M,0.\n"
ALONG = "*ORIENTATION,NAME=O\n{}\n"


def deck(part: str, placed: str, rest: str = "", material: str = STEEL) -> str:
    """A deck of one part."""
    return f"*PART,NAME=P\n{part}*END PART\n*ASSEMBLY\n{placed}{rest}*END ASSEMBLY\n{material}"


@pytest.mark.parametrize("points", ["1,0,0,0,1,0", "3,2,1,2,3,1,2,2,1"])
def test_the_axes_of_layers(tmp_path, points):
    """By two points, and an origin if it is given."""
    part = SHEET + ALONG.format(points) + LAYERS.format(",ORIENTATION=O")
    model, _ = read(tmp_path, deck(part, TURNED + STRAIGHT, material=ORTHOTROPIC))
    found = {name: arguments["axis"] for name, _, arguments, _ in model["families"]}
    assert found["I.All"] == pytest.approx([0, 1, 0], abs=1e-12)
    assert found["J.All"] == pytest.approx([1, 0, 0], abs=1e-12)


def test_orientations_of_the_same_name_belong_to_their_parts(tmp_path):
    sheet = SHEET + ALONG + LAYERS.format(",ORIENTATION=O")
    parts = "".join(
        f"*PART,NAME={name}\n{sheet.format(points)}*END PART\n"
        for name, points in (("P", "1,0,0,0,1,0"), ("Q", "0,1,0,-1,0,0"))
    )
    placed = STRAIGHT + "*INSTANCE,NAME=K,PART=Q\n*END INSTANCE\n"
    model, _ = read(tmp_path, f"{parts}*ASSEMBLY\n{placed}*END ASSEMBLY\n{ORTHOTROPIC}")
    found = {name: arguments["axis"] for name, _, arguments, _ in model["families"]}
    assert found == {"J.All": [1, 0, 0], "K.All": [0, 1, 0]}


@pytest.mark.parametrize(
    ("transform", "fixed"),
    [
        ("*TRANSFORM,NSET=N\n0,1,0,-1,0,0\n", "fixed x"),  # 1 along y of the part
        ("*TRANSFORM,NSET=N\n1,0,0,0,1,0\n", "fixed y"),
        # 1 away from the line along z through (40, 5, 0) of the part, as seen from node 9
        ("*TRANSFORM,NSET=E,TYPE=C\n40,5,0,40,5,1\n", "fixed x"),
    ],
)
def test_supports_in_the_axes_of_their_part(tmp_path, transform, fixed):
    part = BENT + "*NSET,NSET=E\n9\n*SHELL SECTION,ELSET=ALL,MATERIAL=M\n.5\n" + transform
    _, found = read(tmp_path, deck(part, TURNED, "*BOUNDARY\nI.E,1,1\n"))
    assert {name: rows.tolist() for name, rows in found.fixed.items()} == {fixed: [8]}


@pytest.mark.parametrize(
    ("part", "material"),
    [
        (BARS + BEAM, STEEL),
        (BARS + BEAM + "0,1,0\n*BOUNDARY\n1,1,1\n", STEEL),
        (BARS + BEAM + "0,1,0\n*EQUATION\n2\n2,1,1.,3,1,-1.\n", STEEL),
        (SHEET + LAYERS.format(""), ORTHOTROPIC),
        (
            CUBE + SOLID,
            "*MATERIAL,NAME=M\n*ELASTIC,TYPE=ENGINEERING CONSTANTS\n9E4,2E4,2E4,.2,.2,.2,5E3,5E3,\n"
            "5E3\n*DENSITY\n2.E-9\n",
        ),
        (
            BARS + BEAM + "0,1,0\n*ELEMENT,TYPE=SPRING1,ELSET=K\n5,2\n*SPRING,ELSET=K\n1\n4.\n",
            STEEL,
        ),
    ],
)
def test_motions_and_axes_by_their_numbers_are_refused(tmp_path, part, material):
    read(tmp_path, deck(part, STRAIGHT, material=material))
    with pytest.raises(MeshError, match="rotated"):
        read(tmp_path, deck(part, TURNED, material=material))


def test_the_axes_of_beams(tmp_path):
    text = deck(BARS + BEAM + "0,1,0\n", TURNED + STRAIGHT)
    model, _ = read(tmp_path, text)
    found = {name: arguments["orientation"] for name, _, arguments, _ in model["families"]}
    assert found["I.ALL"] == pytest.approx([-1, 0, 0], abs=1e-12)
    assert found["J.ALL"] == [0, 1, 0]


def test_springs_along_axes_of_their_part(tmp_path):
    spring = "*ELEMENT,TYPE=SPRING1,ELSET=K\n5,2\n*SPRING,ELSET=K,ORIENTATION=O\n1\n4.\n"
    part = BARS + BEAM + "0,1,0\n" + ALONG.format("1,0,0,0,0,1") + spring
    for placed, motion in ((TURNED, "y"), (STRAIGHT, "x")):
        model, _ = read(tmp_path, deck(part, placed))
        ((_, stiffness),) = model["springs"]
        assert stiffness == {motion: pytest.approx(4e3)}
