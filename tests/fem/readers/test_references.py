"""What a deck names must be there: nodes, sets, instances, coordinate systems, sets of supports."""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError

CUBE = inp.CUBE + inp.SOLID + inp.STEEL
BLOCK = bdf.GRIDS + bdf.HEXA + "PSOLID,7,1\n" + bdf.MAT1
PART = "*PART,NAME=P\n" + inp.CUBE + inp.SOLID + "*END PART\n" + inp.STEEL
PLACED = PART + "*ASSEMBLY,NAME=A\n*INSTANCE,NAME=I,PART=P\n*END INSTANCE\n{}*END ASSEMBLY\n"


def held(deck) -> dict[str, list[int]]:
    """Rows of the nodes that are held, by the motion."""
    return {name.removeprefix("fixed "): rows.tolist() for name, rows in deck.fixed.items()}


@pytest.mark.parametrize(
    "row", ["NOSUCH,1,3", "999,1,3", "0,1,3", "1,1,99", "1,3,2", "1", "EMPTY,1,3", "ALL,ENCASTRE"]
)
def test_a_support_of_what_is_not_there_is_an_error(tmp_path, row):
    text = f"{CUBE}*NSET,NSET=EMPTY,GENERATE\n500,600\n*BOUNDARY\n{row}\n"
    last = text.count("\n")
    with pytest.raises(MeshError, match=f"^line {last} of part.inp: "):
        inp.read(tmp_path, text)


@pytest.mark.parametrize(
    "cards",
    [
        "*SOLID SECTION,ELSET=NOSUCH,MATERIAL=M\n",
        "*TRANSFORM,NSET=NOSUCH\n1,0,0,0,1,0\n",
        "*MASS,ELSET=NOSUCH\n1\n",
        "*SURFACE,NAME=S\nNOSUCH,S1\n",
        "*EQUATION\n2\n1,1,1.,999,1,-1.\n",
        "*NODAL THICKNESS\nNOSUCH,1.\n",
    ],
)
def test_other_cards_name_what_is_there(tmp_path, cards):
    with pytest.raises(MeshError, match="there is no"):
        inp.read(tmp_path, CUBE + cards)


def test_missing_members_of_a_set_are_told(tmp_path):
    text = f"{CUBE}*NSET,NSET=A\n1,2,77,LATER\n*NSET,NSET=LATER\n3\n*BOUNDARY\nA,1\n"
    _, deck = inp.read(tmp_path, text)
    (told,) = deck.told
    assert told.startswith(inp.line(text, "*NSET,NSET=A"))
    assert "2 of 4 members" in told
    assert held(deck) == {"x": [0, 1]}


def test_motions_that_are_none_are_told(tmp_path):
    """Temperatures and the like: 0 and 11 in CalculiX."""
    model, deck = inp.read(tmp_path, f"{CUBE}*BOUNDARY\n1,2\n2,11,11,20.\n3,0,0\n")
    assert held(deck) == {"y": [0]}
    assert any("no motion of *BOUNDARY" in text for text in model["ignored"])


def test_supports_of_the_first_step_in_place_of_those_of_the_model(tmp_path):
    text = CUBE + "*BOUNDARY\n1,1\n*STEP\n*BOUNDARY,OP={}\n2,2\n*BOUNDARY,OP={}\n3,3\n*END STEP\n"
    assert held(inp.read(tmp_path, text.format("MOD", "MOD"))[1]) == {"x": [0], "y": [1], "z": [2]}
    assert held(inp.read(tmp_path, text.format("NEW", "NEW"))[1]) == {"y": [1], "z": [2]}


@pytest.mark.parametrize("members", ["\n1,2\n", ",GENERATE\n1,2\n"])
def test_sets_of_the_assembly_name_their_instance(tmp_path, members):
    text = PLACED.format("*NSET,NSET=F{}" + members) + "*BOUNDARY\nF,1\n"
    _, deck = inp.read(tmp_path, text.format(",INSTANCE=I"))
    assert held(deck) == {"x": [0, 1]}
    assert held(inp.read(tmp_path, text.format(""))[1]) == {"x": [0, 1]}  # of the only one
    second = "*END INSTANCE\n*INSTANCE,NAME=J,PART=P\n90,0,0\n*END INSTANCE\n"
    with pytest.raises(MeshError, match="INSTANCE="):
        inp.read(tmp_path, text.format("").replace("*END INSTANCE\n", second))


def test_a_part_without_an_instance_is_told(tmp_path):
    _, deck = inp.read(tmp_path, PLACED.format("") + "*PART,NAME=Q\n*NODE\n1,0,0,0\n*END PART\n")
    assert any("'Q'" in text for text in deck.told)


SUPPORTS = "SPC1,1,1,1\nSPC1,2,2,2\nSPC,3,3,3,,4,2,.5\nSPCADD,9,1,3\n"
CONTROL = {
    "SPC=1\n": ("x", [2, 3, 9]),
    "SPC=9\n": ("xyz", [2]),
    "SPC=1\nSUBCASE 1\nSPC=2\nSUBCASE 2\nSPC=3\n": ("y", [1, 3, 9]),
    "SUBCASE 1\nLOAD=4\nSUBCASE 2\nSPC=1\n": ("", [1, 2, 3, 9]),
    "ECHO=NONE\n": ("", [1, 2, 3, 9]),
}


@pytest.mark.parametrize("control", CONTROL)
def test_the_supports_are_those_that_the_first_subcase_selects(tmp_path, control):
    motions, others = CONTROL[control]
    _, deck = bdf.read(tmp_path, f"SOL 103\nCEND\n{control}BEGIN BULK\n{BLOCK}{SUPPORTS}")
    assert set(held(deck)) == set(motions)
    (told,) = deck.told
    assert f"SPC set{'s' * (len(others) > 1)} {', '.join(map(str, others))}, which" in told


def test_a_set_of_supports_that_is_not_there(tmp_path):
    with pytest.raises(MeshError, match="SPC = 5"):
        bdf.read(tmp_path, f"SPC=5\nBEGIN BULK\n{BLOCK}{SUPPORTS}")


TWICE = {
    "coordinate system 5": bdf.CYCLIC + "CORD2R,5,,0.,0.,0.,0.,0.,1.,\n,1.,0.,0.\n",
    "material 1": "MAT1,1,1.+5,,.3,8.-9\n",
    "property 7": "PSOLID,7,2\n",
}


@pytest.mark.parametrize("what", TWICE)
def test_what_is_defined_twice_must_be_the_same(tmp_path, what):
    entries = TWICE[what]
    with pytest.raises(MeshError, match=f"{what} .*more than once"):
        bdf.read(tmp_path, BLOCK + entries)
    again = {"c": bdf.CYCLIC * 2, "m": bdf.MAT1, "p": "PSOLID,7,1\n"}[what[0]]
    bdf.read(tmp_path, BLOCK + again)


def test_springs_along_an_orientation(tmp_path):
    """A spring along direction 2 of a system turned by 30° about z is one along that direction."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turned = f"*ORIENTATION,NAME=O\n{c},{s},0,{-s},{c},0\n"
    cards = "*ELEMENT,TYPE={}2,ELSET=S\n90,1,7\n*{},ELSET=S,ORIENTATION=O\n2,2\n3.\n"
    for card, where in (("SPRING", "springs"), ("DASHPOT", "dampers")):
        model, _ = inp.read(tmp_path, CUBE + turned + cards.format(card, card))
        ((terms, _),) = model["joints"][where]
        found = {(node, motion): value for node, motion, value in terms}
        expected = {(0, 0): -s, (0, 1): c, (6, 0): s, (6, 1): -c}
        assert found == pytest.approx(expected, abs=1e-12)
