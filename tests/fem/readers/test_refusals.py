"""Every refusal of a deck: one sentence with the line and the rule.

The parsers are called here directly, without the process that reads files for `read_model`.
"""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc.io.deck import Deck
from antiosc_decks.constraints import one_piece
from refusals import refused

CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]


NODES = "*NODE\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(CORNERS, 1))
CUBE = NODES + "*ELEMENT,TYPE=C3D8,ELSET=ALL\n1,1,2,3,4,5,6,7,8\n"
SHEET = NODES + "*ELEMENT,TYPE=S4,ELSET=ALL\n1,1,2,3,4\n2,5,6,7,8\n"
BAR = NODES + "*ELEMENT,TYPE=B31,ELSET=ALL\n1,1,2\n"
MATERIAL = "*MATERIAL,NAME=M\n*ELASTIC\n1E9,.3\n*DENSITY\n1000.\n"
PLY = "*MATERIAL,NAME=M\n*ELASTIC,TYPE=LAMINA\n9E9,1E9,.3,1E9,1E9,1E9\n*DENSITY\n1000.\n"
SOLID = "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n"
SHELL = "*SHELL SECTION,ELSET=ALL,MATERIAL=M\n.1\n"
BEAM = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION="
WHOLE = CUBE + SOLID + MATERIAL
AXES = "*ORIENTATION,NAME=O\n"


def composite(orientation: str, layer: str = "") -> str:
    section = "*SHELL SECTION,ELSET=ALL,COMPOSITE,ORIENTATION=O\n"
    return SHEET + section + f".1,,M{layer}\n" + PLY + orientation


ABAQUS = {
    "no nodes": ("*ELEMENT,TYPE=C3D8\n", None, "defines"),
    "arc": (NODES + "*NGEN,LINE=C\n1,2\n", None, "straight"),
    "singular": (NODES + "*NFILL,SINGULAR=1\nA,B,2,1\n", None, "distances"),
    "unknown end": (NODES + "*NGEN\n1,99\n", None, "exist"),
    "unequal sets": (NODES + "*NFILL\nA,B,2,1\n", None, "nodes"),
    "axisymmetric": (SHEET.replace("S4", "CAX4R") + SOLID + MATERIAL, None, "axisymmetric"),
    "a truss without a section": (
        NODES + "*ELEMENT,TYPE=T3D2,ELSET=ALL\n1,1,2\n" + MATERIAL, None, "section"),
    "leftover": (WHOLE + "*ELEMENT,TYPE=DASHPOTA\n2,1,2\n", None, "DASHPOTA"),
    "on the axis": (
        WHOLE.replace("*NODE", "*NODE,NSET=N", 1) + "*TRANSFORM,NSET=N,TYPE=C\n0,0,0,0,0,1\n",
        None, "no axes"),
    "hyperelastic": (
        CUBE + SOLID + MATERIAL.replace("*ELASTIC", "*ELASTIC,TYPE=COUPLED TRACTION"),
        None, "TYPE=COUPLED"),
    "singular stiffness": (
        CUBE + SOLID + "*MATERIAL,NAME=M\n*ELASTIC,TYPE=ORTHO\n1,1,1,1,1,1,1,1,\n1\n",
        None, "singular"),
    "solid section of a shell": (SHEET + SOLID + MATERIAL, None, "S4"),
    "shell section of a solid": (CUBE + SHELL + MATERIAL, None, "C3D8"),
    "beam section of a solid": (CUBE + BEAM + "RECT\n1\n" + MATERIAL, None, "that"),
    "two kinds": (
        SHEET.replace("S4", "CPS4")
        + "*ELEMENT,TYPE=CPE4,ELSET=ALL\n3,1,2,3,4\n"
        + SOLID
        + MATERIAL, None, "stress"),
    "dimensions": (BAR + BEAM + "PIPE\n1\n0,1,0\n" + MATERIAL, None, "PIPE"),
    "section": (BAR + BEAM + "I\n1\n0,1,0\n" + MATERIAL, None, "SECTION=I"),
    "mixed moment": (BAR + BEAM + "GENERAL\n1,1,.1,1,1\n0,1,0\n" + MATERIAL, None, "must"),
    "off in both": (
        BAR + BEAM + "RECT,OFFSET1=.5,OFFSET2=.5\n1\n0,1,0\n" + MATERIAL, None, "directions"),
    "off the middle": (SHEET + SHELL.replace("=M", "=M,OFFSET=UP") + MATERIAL, None, "number"),
    "no orientation": (composite(""), None, "orientation"),
    "spherical axes": (
        composite(AXES.replace("=O", "=O,SYSTEM=SPHERICAL") + "1,0,0,0,1,0\n"),
        None, "RECTANGULAR"),
    "turn about 1": (composite(AXES + "1,0,0,0,1,0\n1,30\n"), None, "about"),
    "layers in a solid": (CUBE + SOLID + PLY, None, "layers"),
    "a cell of no family": (CUBE.replace("C3D8", "DC3D8") + MATERIAL, None, "family"),
}  # fmt: skip


@pytest.mark.sample(-1)
@pytest.mark.parametrize("case", ABAQUS)
def test_abaqus(tmp_path, case):
    text, line, word = ABAQUS[case]
    with refused(line, word, MeshError):
        inp.read(tmp_path, text)


GRIDS = "".join(f"GRID,{k},,{x}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(CORNERS, 1))
MAT = "MAT1,1,1.+9,,.3,1000.\n"
BLOCK = GRIDS + "CHEXA,1,1,1,2,3,4,5,6,\n,7,8\nPSOLID,1,1\n" + MAT
QUAD = GRIDS + "CQUAD4,1,1,1,2,3,4\n" + MAT
CBAR = GRIDS + "CBAR,1,1,1,2,0.,0.,1.\n" + MAT
SYSTEM = "CORD2R,5,,0.,0.,0.,1.,1.,0.\n,1.,0.,0.\n"

MAT9 = "MAT9,1,3.,1.,1.,0.,0.,0.,3.,\n,1.,0.,0.,0.,3.,0.,0.,0.,\n,1.,0.,0.,1.,0.,1.,1000."
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
    "half a taper": (
        CBAR.replace("CBAR", "CBEAM") + "PBEAM,1,1,1.,1.,1.,,1.,,\n,,,,,,,,,\n,YES,.5,2.,1.,1.\n",
        None, "section"),
    "one constant": (BLOCK.replace("1.+9,,.3", ",,.3"), None, "MAT1"),
    "elements' axes": (BLOCK.replace("MAT1,1,1.+9,,.3,1000.", MAT9), None, "each"),
    "no orientation": (CBAR.replace(",0.,0.,1.", "") + "PBARL,1,1,,ROD\n,.1\n", None, "missing"),
    "along the axis": (
        CBAR.replace("0.,0.,1.", "1.,0.,0.") + "PBARL,1,1,,ROD\n,.1\n", None, "along"),
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
