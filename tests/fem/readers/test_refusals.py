"""Every refusal of a deck: one sentence with the line and the rule.

The parsers are called here directly, without the process that reads files for `read_model`.
"""

from __future__ import annotations

import numpy as np
import pytest

import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc.io.deck import Deck
from antiosc_decks.constraints import one_piece
from refusals import refused

CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]


BEAM = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION="


GRIDS = "".join(f"GRID,{k},,{x}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(CORNERS, 1))
MAT = "MAT1,1,1.+9,,.3,1000.\n"
BLOCK = GRIDS + "CHEXA,1,1,1,2,3,4,5,6,\n,7,8\nPSOLID,1,1\n" + MAT
CBAR = GRIDS + "CBAR,1,1,1,2,0.,0.,1.\n" + MAT

NASTRAN = {
    "no grids": ("BEGIN BULK\nMAT1,1,1.\nENDDATA\n", None, "nodes"),
    "no bulk": ("BEGIN BULK\nENDDATA\n", None, "contains"),
    "no shear": (CBAR.replace(",,.3", ",0.,.3") + "PBARL,1,1,,ROD\n,.1\n", 10, "G above 0"),
    "a default": ("GRDSET,,YES\n" + BLOCK, 1, "not an integer"),
    "no mass matrix": (BLOCK + "CONM1,9,1,,-1.\n", None, "that"),
    "pins": (CBAR.replace("0.,0.,1.", "0.,0.,1.,,\n,17") + "PBARL,1,1,,ROD\n,.1\n", None, "from 1"),
    "a copy of nothing": ("BEGIN BULK\n=,*1\n", None, "before"),
    "mixed moment": (CBAR + "PBAR,1,1,1.,1.,1.,1.,,,\n,,,,,,,,,\n,,,1.5\n", None, "below"),
    "no width": (CBAR + "PBARL,1,1,,BAR\n,0.,1.\n", None, "dimensions"),
    "a type": (CBAR + "PBARL,1,1,,X\n,1.,1.,.1,.1\n", None, "type"),
    "does not fit": (CBAR + "PBARL,1,1,,I\n,1.,1.,1.,1.,.6,.6\n", None, "other"),
    "off the shear centre": (
        CBAR.replace("CBAR", "CBEAM") + "PBEAML,1,1,,T\n,1.,1.,.1,.1\n", None, "neutral"),
    "one constant": (BLOCK.replace("1.+9,,.3", ",,.3"), None, "MAT1"),
    "no orientation": (CBAR.replace(",0.,0.,1.", "") + "PBARL,1,1,,ROD\n,.1\n", None, "missing"),
    "element's system": (
        CBAR.replace("2,0.,0.,1.\n", "2,0.,0.,1.,GOO\n,,,0.,0.,.1\n") + "PBARL,1,1,,ROD\n,.1\n",
        None, "offsets"),
    "no length": (
        CBAR.replace("2,0.,0.,1.\n", "2,0.,0.,1.,,\n,,,1.,0.,0.\n") + "PBARL,1,1,,ROD\n,.1\n",
        None, "length"),
}  # fmt: skip


@pytest.mark.parametrize("case", NASTRAN)
def test_nastran(tmp_path, case):
    text, line, word = NASTRAN[case]
    with refused(line, word, MeshError):
        bdf.read(tmp_path, text)


def test_a_piece_of_no_elements(tmp_path):
    deck = Deck("part.inp", piece=1)
    with pytest.raises(MeshError, match=r"0 pieces .* no piece 1"):
        one_piece(deck, np.zeros(0, dtype=bool))


TUBE, BEAM = "CTUBE,1,7,1,2\n", "CBEAM,1,7,1,2,0.,1.,0.\n"
PLATE = "CQUAD4,1,7,1,2,3,4\n"
WITH_LINES = {
    **{f"{card} {prop}": (f"{card}{bdf.MAT1}{prop},7,1\nPARAM,7\nPELAS,7,1.\n", 9, f"as {instead}")
       for card, prop, instead in (
           (bdf.HEXA, "PLSOLID", "PSOLID"), ("CROD,1,7,1,2\n", "PTUBE2", "PROD"),
           (TUBE, "PWELD", "PTUBE"), (PLATE, "PLPLANE", "PSHELL or PCOMP"),
           ("CBAR,1,7,1,2,0.,1.,0.\n", "PBCOMP", "PBAR"))},
    "taper": (f"{TUBE}PTUBE,7,1,4.,.5,,3.\n", 10, "tapered"),
    "material": (f"{bdf.HEXA}PSOLID,7,3\n", 11, "there is no MAT1"),
    "solid of plies": (f"{bdf.HEXA}PSOLID,7,3\nMAT8,3,9.,8.,.1,3.,,,1.\n", 12, "nine constants"),
    "shell of a solid": (f"{PLATE}PSHELL,7,3,.1,3,2.,3\nMAT9,3,1.\n,,,,,,,,\n,,,,,,,1.\n",
                         11, "elasticity"),
    "indefinite": (f"{PLATE}PSHELL,7,3,.1,3,2.,3\nMAT2,3,1.,2.,,1.,,1.,1.\n", 11, "definite"),
    "spoint": (f"SPOINT,100,THRU,10000102\n{bdf.HEXA}", 9, "SPOINT from 100"),
    "mass of nothing": (f"{bdf.HEXA}PSOLID,7,1\nCMASS2,9,1.\n", 12, "no node"),
    "place of a station": (f"{BEAM}PBEAM,7,1,6.,5.,3.,,4.,,\n,NO,1.5,3.,2.\n", 10, "X/XB"),
    "place of a profile": (f"{BEAM}PBEAML,7,1,,ROD\n,.2,,NO,1.5,.1\n", 10, "X/XB"),
    "no end": (f"{BEAM}PBEAML,7,1,,ROD\n,.2,,NO,.5,.1\n", 10, "no section at X/XB = 1"),
    **{f"a bush along {k}": (
        f"{bdf.HEXA}PSOLID,7,1\nCBUSH,9,9,1,2\nPBUSH,9,K{k * ','}1.\n", 12, "CID")
       for k in (2, 3, 5, 6)},
    "contact": (f"{bdf.HEXA}BCONTACT,1\n", 11, "contact"),
    "element": (f"{bdf.HEXA}CFAST,9,9,1,2\n", 11, "CFAST"),
}  # fmt: skip


@pytest.mark.parametrize("case", WITH_LINES)
def test_nastran_by_its_line(tmp_path, case):
    text, line, word = WITH_LINES[case]
    with refused(line, word, MeshError):
        bdf.read(tmp_path, bdf.GRIDS + text + bdf.MAT1)
