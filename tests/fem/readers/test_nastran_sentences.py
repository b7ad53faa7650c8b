"""Coordinate systems of Nastran decks, and whole sentences on what is refused or not taken."""

from __future__ import annotations

import math

import numpy as np
import pytest

from antiosc.errors import MeshError
from antiosc.fem.readers.decks import nastran
from nastran_decks import GRIDS, HEXA, MAT1, read


def test_systems_by_grids_and_within_each_other(tmp_path):
    """CORD1R, C and S by three grids, two in one card; CORD2 in another system."""
    text = "GRID,1,,1.,2.,3.\nGRID,2,,1.,3.,3.\nGRID,3,,1.,2.,5.\n"
    text += "CORD1R,11,1,2,3\nCORD1C,12,1,2,3,13,1,3,2\nCORD1S,14,1,2,3\n"
    text += "CORD2R,15,11,1.,2.,3.,1.,2.,5.,\n,4.,2.,3.\n"
    text += "GRID,21,11,1.,2.,3.\nGRID,22,12,2.,90.,3.\nGRID,23,13,2.,0.,1.\n"
    text += "GRID,24,14,2.,90.,90.\nGRID,25,14,2.,30.,0.\nGRID,26,15,1.,2.,3.\n"
    path = tmp_path / "part.bdf"
    path.write_text(text)
    found = nastran.read(path, path.name)
    # system 11: z is y of the deck, x is z, y is x; system 13: z is z, x is y, y is -x
    expected = [(3, 5, 4), (3, 5, 3), (1, 4, 4), (3, 2, 3), (1, 2 + math.sqrt(3), 4), (5, 8, 5)]
    np.testing.assert_allclose(found.deck.points[3:], expected, atol=1e-12)
    for wrong, message in (
        ("CORD1R,16,1,2,9\nGRID,27,16\n", "line 15 of part.bdf: there is no GRID 9."),
        ("CORD1R,16,1,2,27\nGRID,27,16\n",
         "line 16 of part.bdf: the coordinate system 16 depends on itself."),
        ("GRID,27,19\n", "line 15 of part.bdf: there is no coordinate system 19."),
        ("CORD2R,16,,0.,0.,0.,1.,0.,0.,\n,2.,0.,0.\nGRID,27,16\n",
         "line 15 of part.bdf: the three points of CORD2R lie on one line."),
    ):  # fmt: skip
        path.write_text(text + wrong)
        with pytest.raises(MeshError) as caught:
            nastran.read(path, path.name)
        assert str(caught.value) == message


REFUSED = {
    "no property": (GRIDS + HEXA + MAT1,
                    "line 9 of part.bdf: CHEXA 1 has the property 7, which is none of PSOLID, "
                    "PROD, PTUBE, PSHELL, PCOMP, PCOMPG, PBAR, PBARL, PBEAM, PBEAML in the deck."),
    **{f"{card} {prop}": (GRIDS + f"{card}{MAT1}{prop},7,1\nPARAM,7\nPELAS,7,1.\n",
                          f"line 9 of part.bdf: {card.partition(',')[0]} 1 has the property 7, a "
                          f"{prop}, which is not supported; give it as {instead}.")
       for card, prop, instead in (
           (HEXA, "PLSOLID", "PSOLID"), ("CROD,1,7,1,2\n", "PTUBE2", "PROD"),
           ("CTUBE,1,7,1,2\n", "PSHEAR", "PTUBE"), ("CQUAD4,1,7,1,2,3,4\n", "PLPLANE",
                                                   "PSHELL or PCOMP"),
           ("CBAR,1,7,1,2,0.,1.,0.\n", "PBEND", "PBAR or PBEAM"))},
    "taper": (GRIDS + "CTUBE,1,7,1,2\nPTUBE,7,1,4.,.5,,3.\n" + MAT1,
              "line 10 of part.bdf: tapered tubes (PTUBE with OD2) are not supported."),
    "area": (GRIDS + "CONROD,1,1,2,1\n" + MAT1,
             "line 9 of part.bdf: CONROD needs an area above 0."),
    "material": (GRIDS + HEXA + "PSOLID,7,3\n" + MAT1,
                 "line 11 of part.bdf: there is no MAT1, MAT2, "
                 "MAT8 or MAT9 with the number 3."),
    "solid of plies": (GRIDS + HEXA + "PSOLID,7,3\nMAT8,3,9.,8.,.1,3.,,,1.\n",
                       "line 12 of part.bdf: the material 'MAT8 3' is given for layers alone, in "
                       "plane stress, and cannot fill solids; give all nine constants."),
    "shell of a solid": (GRIDS + "CQUAD4,1,7,1,2,3,4\nPSHELL,7,3,.1,3,2.,3\nMAT9,3,1.\n"
                         ",,,,,,,,\n,,,,,,,1.\n",
                         "line 11 of part.bdf: MAT9 3 is not a material of shells."),
    "indefinite": (GRIDS + "CQUAD4,1,7,1,2,3,4\nPSHELL,7,3,.1,3,2.,3\nMAT2,3,1.,2.,,1.,,1.,1.\n",
                   "line 11 of part.bdf: the stiffness of MAT2 3 is not positive definite."),
    "spoint": (GRIDS + "SPOINT,100,THRU,10000102\n" + HEXA,
               "line 9 of part.bdf: SPOINT from 100 to 10000102."),
    "mass of nothing": (GRIDS + HEXA + "PSOLID,7,1\nCMASS2,9,1.\n" + MAT1,
                        "line 12 of part.bdf: CMASS2 acts on no node."),
    "place of a station": (GRIDS + "CBEAM,1,7,1,2,0.,1.,0.\nPBEAM,7,1,6.,5.,3.,,4.,,\n,NO,1.5,3.,2."
                           "\n" + MAT1, "line 10 of part.bdf: X/XB of PBEAM lies between 0 and 1."),
    "place of a profile": (GRIDS + "CBEAM,1,7,1,2,0.,1.,0.\nPBEAML,7,1,,ROD\n,.2,,NO,1.5,.1\n"
                           + MAT1,
                           "line 10 of part.bdf: X/XB of PBEAML lies between 0 and 1."),
    "no end": (GRIDS + "CBEAM,1,7,1,2,0.,1.,0.\nPBEAML,7,1,,ROD\n,.2,,NO,.5,.1\n" + MAT1,
               "line 10 of part.bdf: PBEAML gives no section at X/XB = 1."),
    **{f"a bush along {k}": (
        GRIDS + HEXA + f"PSOLID,7,1\nCBUSH,9,9,1,2\nPBUSH,9,K{k * ','}1.\n" + MAT1,
        "line 12 of part.bdf: CBUSH needs the system CID at coincident nodes or to the ground, and "
        "CID or an orientation between nodes apart, unless it acts along their line alone.")
       for k in (2, 3, 5, 6)},
    "contact": (GRIDS + HEXA + "BCONTACT,1\n", "line 11 of part.bdf: BCONTACT is contact, which is "
                "not supported here and would change the result; remove it from the deck, or model "
                "the part without it."),
    "element": (GRIDS + HEXA + "CGAP,9,9,1,2\n", "line 11 of part.bdf: CGAP is not supported here "
                "and would change the result; remove it from the deck, or model the part without "
                "it."),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_is_told_with_its_line(tmp_path, case):
    text, message = REFUSED[case]
    with pytest.raises(MeshError) as caught:
        read(tmp_path, text)
    assert str(caught.value) == message


def test_what_of_a_deck_is_not_taken_is_counted(tmp_path):
    text = GRIDS + HEXA + "PSOLID,7,1\n" + MAT1 + "MATT1,1,2\nMATT1,1,3\nCREEP,1\nFORCE,1,2\n"
    text += "PLOAD4,1,2\nPLOAD4,1,3\nGRAV,3\nCHBDYE,1,2\nPLOTEL,77,1,2\n"
    model, deck = read(tmp_path, text)
    assert model["ignored"] == [
        "1 CHBDYE (line 20 of part.bdf)", "1 CREEP (line 15 of part.bdf)",
        "1 FORCE (line 16 of part.bdf)", "1 GRAV (line 19 of part.bdf)",
        "2 MATT1 (lines 13, 14 of part.bdf)", "2 PLOAD4 (lines 17, 18 of part.bdf)",
    ]  # fmt: skip
    assert deck.left == {}
    path = tmp_path / "part.bdf"
    assert nastran.read(path, path.name).deck.left == {"CHBDYE": 1}
