"""What decks of public collections hold and name, beside what the manuals ask for."""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc_decks import nastran_mesh as nastran
from antiosc_decks.sources import Sources
from refusals import refused

BLOCK = bdf.GRIDS + bdf.HEXA + "PSOLID,7,1\n" + bdf.MAT1
BAR = bdf.GRIDS + bdf.MAT1 + "SPC1,1,123456,1\n"
PLATE = bdf.GRIDS + bdf.MAT1 + "CQUAD4,1,7,1,2,3,4\n"


def same(one: dict, other: dict) -> None:
    """Two models but for what is told, and for the places of their cards."""
    for key in set(one) - {"ignored", "families"}:
        inp.alike(one[key], other[key])
    inp.alike([row[:3] for row in one["families"]], [row[:3] for row in other["families"]])


PLANE = inp.CUBE.split("*ELEMENT")[0] + "*ELEMENT,TYPE=CPS3,ELSET=ALL\n1,1,2,3\n" + inp.STEEL
BUSH = BLOCK + "PBUSH,3,K,4.,5.,6.\n" + bdf.CYCLIC + "CBUSH,9,3,1,2,,,,0\n,"
RIGID = BLOCK + "RBE2,9,1,{},2\nSPC1,1,{},3\nGRID,9,,0.,0.,0.,,{}\n"
SPRING = BLOCK + "CELAS2,9,5.,1,1,77,0\nCELAS4,10,3.,77,78\nSPC,1,78,0\n"
SECTION = "*{} SECTION,ELSET=ALL,MATERIAL=M\n2.\n"
#: The same model written otherwise, and a word of what is told of the second.
SAME = [
    (RIGID.format("123", "12", "46"), RIGID.format("1 2 3", "1 2", "4 6"), ""),
    (BAR + "CROD,1,7,1,2\nPROD,7,1,3.,,,2.-9\n",
     BAR + "CBAR,1,7,1,2,0.,1.,0.\nPBAR,7,1,3.,,0.,,2.-9\n", "1 PBAR without I1 and I2"),
    (BUSH + ".5\n", BUSH + ",5,0.,0.,10.\n", ""),
    *((PLATE + "PSHELL,7,1,.4,1,,1\n", PLATE + f"PSHELL,7{given}\n", "PSHELL 7")
      for given in (",1,.4,,,1", ",,.4,1,,1")),
    (SPRING + "SPOINT,77,78\n", SPRING, ""),
    (BLOCK + "CBUSH,9,3,1,3\nPBUSH,3,K,4.\n", BLOCK + "CBUSH1D,9,3,1,3\nPBUSH1D,3,4.\n", ""),
    (PLANE + SECTION.format("SOLID"), PLANE + SECTION.format("SHELL"), ""),
]  # fmt: skip


@pytest.mark.parametrize(("plain", "other", "told"), SAME, ids=range(len(SAME)))
def test_one_model_written_otherwise(tmp_path, plain, other, told):
    read = inp.read if plain.startswith("*") else bdf.read
    models = [read(tmp_path, text)[0] for text in (plain, other)]
    same(*models)
    assert not told or any(told in text for text in models[1]["ignored"])


INCLUDES = {
    # what is included, and from which folder on: whether it is read, or what is said
    "above": ("../grids.inc", None, ""),
    "far above": ("../../grids.inc", None, "outside"),
    "below root": ("../../grids.inc", ".", ""),
    "above root": ("../../grids.inc", "sub", "(root)"),
    "a link": ("link.inc", None, "outside the folder"),
}


@pytest.mark.parametrize("case", INCLUDES)
def test_files_of_the_folder_above_and_below_root_are_included_and_no_others(tmp_path, case):
    name, root, word = INCLUDES[case]
    folder = tmp_path / "sub" / "decks"
    folder.mkdir(parents=True)
    for place in (tmp_path / "sub", tmp_path):
        (place / "grids.inc").write_text(bdf.GRIDS)
    (folder / "link.inc").symlink_to(tmp_path / "grids.inc")
    path = folder / "part.bdf"
    path.write_text(f"BEGIN BULK\nINCLUDE '{name}'\n{bdf.HEXA}")
    sources = Sources(path, "part.bdf", **({"root": str(tmp_path / root)} if root else {}))
    if not word:
        assert nastran.read_deck(sources).deck.n_elements == 1
        return
    with refused(None, word, MeshError):
        nastran.read_deck(sources)


@pytest.mark.parametrize(
    ("given", "held"),
    [
        ("SPC1,1,123,1,2,3,11,12,13\n", True),
        ("SPC1,1,123,1,2,3,11,12\n", False),  # it turns about the line from 11 to 12
        ("SPC1,1,123,1,2,3,11,12\nCELAS2,9,5.,13,3\n", True),
        ("SPC1,1,123,1,2,3\nRBE2,9,1,123456,11\n", False),  # one body
        ("SPC1,1,123,1,2,3\nCELAS2,9,5.,11,1,1,1\n", False),
        ("SPC1,1,123,1,2,3\n", False),
    ],
)
def test_several_pieces_are_read_where_each_is_held(tmp_path, given, held):
    more = "".join(
        f"GRID,{k},,{x + 50}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(bdf.CORNERS, 11)
    )
    cubes = BLOCK + more + "CHEXA,2,7,11,12,13,14,15,16,\n,17,18\n"
    assert bdf.read(tmp_path, cubes + given)[0]["held"] is held


def test_orthotropic_solids_by_nine_constants(tmp_path):
    """MAT11: E1 to G23 as stated; with those of an isotropic material it is MAT1."""
    given = "MAT11,1,2.+5,2.+5,2.+5,.3,.3,.3,{0},\n,{0},{0},8.-9\n".format(repr(2e5 / 2.6))
    same(*(bdf.read(tmp_path, BLOCK.replace(bdf.MAT1, text))[0] for text in (bdf.MAT1, given)))
    skew = given.replace("2.+5", "1.+5", 1)
    model, _ = bdf.read(
        tmp_path, BLOCK.replace(bdf.MAT1, skew).replace("PSOLID,7,1", "PSOLID,7,1,0")
    )
    ((_, kind, arguments, _),) = model["families"]
    assert kind == "AnisotropicSolid"
    assert 1 / np.linalg.inv(arguments["stiffness"])[0, 0] == pytest.approx(1e11)


def test_layers_of_one_material_are_a_solid(tmp_path):
    layers = "PCOMPS,7\n,1,1,5.,0.\n,2,1,5.,90.\n"
    same(
        *(bdf.read(tmp_path, BLOCK.replace("PSOLID,7,1\n", p))[0] for p in ("PSOLID,7,1\n", layers))
    )
    with pytest.raises(MeshError, match="PCOMPS"):
        bdf.read(
            tmp_path, BLOCK.replace("PSOLID,7,1\n", layers + ",3,2,5.\nMAT1,2,1.+5,,.3,8.-9\n")
        )


CUBE = inp.CUBE + inp.SOLID + inp.STEEL
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


@pytest.mark.parametrize("members", ["\n1,2\n", ",GENERATE\n1,2\n"])
def test_sets_of_the_assembly_name_their_instance(tmp_path, members):
    text = PLACED.format("*NSET,NSET=F{}" + members) + "*BOUNDARY\nF,1\n"
    _, deck = inp.read(tmp_path, text.format(",INSTANCE=I"))
    assert held(deck) == {"x": [0, 1]}
    assert held(inp.read(tmp_path, text.format(""))[1]) == {"x": [0, 1]}  # of the only one
    second = "*END INSTANCE\n*INSTANCE,NAME=J,PART=P\n90,0,0\n*END INSTANCE\n"
    with pytest.raises(MeshError, match="INSTANCE="):
        inp.read(tmp_path, text.format("").replace("*END INSTANCE\n", second))


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
    (told,) = deck.remarks
    assert f"SPC set{'s' * (len(others) > 1)} {', '.join(map(str, others))}, which" in told


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


PBAR = "PBAR,7,1,2.,3.,3.,4.\n"
