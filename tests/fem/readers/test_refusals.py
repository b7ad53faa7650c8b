"""Every refusal of a deck: one sentence with the line and the rule.

The parsers are called here directly, without the process that reads files for `read_model`.
"""

from __future__ import annotations

import pytest

from antiosc.base.errors import MeshError
from antiosc.io.unit_system import UnitSystem
from antiosc_decks.abaqus import assembly as abaqus_assembly, model as abaqus_model
from antiosc_decks.nastran import mesh as nastran, model as nastran_model
from refusals import refused

CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
SI = UnitSystem(1.0, 1.0)


def read_as_model(reader, model_of, path, text: str) -> None:
    path.write_text(text)
    model_of(reader(path, path.name), SI, None)


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
        read_as_model(abaqus_assembly.read, abaqus_model.model_of, tmp_path / "part.inp", text)


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
        read_as_model(nastran.read, nastran_model.model_of, tmp_path / "part.bdf", text)
