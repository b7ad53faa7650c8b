"""Every refusal of a deck: one sentence with the line and the rule.

The parsers are called here directly, without the process that reads files for `read_model`.
"""

from __future__ import annotations

import pytest

from antiosc.errors import MeshError
from antiosc.fem.readers.decks import abaqus_assembly, abaqus_model, nastran, nastran_model
from antiosc.fem.readers.unit_system import UnitSystem

CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
SI = UnitSystem(1.0, 1.0)


def refused(read, model_of, path, text: str, message: str) -> None:
    path.write_text(text)
    with pytest.raises(MeshError, match=message) as caught:
        model_of(read(path, path.name), SI, None)
    assert "\n" not in str(caught.value)


# --- Abaqus and CalculiX --------------------------------------------------------------------------

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
SPRING = "*ELEMENT,TYPE=SPRINGA,ELSET=K\n"


def composite(orientation: str, layer: str = "") -> str:
    section = "*SHELL SECTION,ELSET=ALL,COMPOSITE,ORIENTATION=O\n"
    return SHEET + section + f".1,,M{layer}\n" + PLY + orientation


ABAQUS = {
    "no nodes": ("*ELEMENT,TYPE=C3D8\n", r"defines no nodes \(\*NODE\)"),
    "no set name": (CUBE + "*NSET\n1\n", r"line 12 .*\*NSET needs NSET="),
    "half a range": (CUBE + "*NSET,NSET=A,GENERATE\n8\n", "needs a first and a last number"),
    "turn": (
        f"*PART,NAME=P\n{CUBE}*END PART\n*ASSEMBLY,NAME=A\n*INSTANCE,NAME=I,PART=P\n0,0,0\n"
        "0,0,0,0,0,0,90\n*END INSTANCE\n*END ASSEMBLY\n",
        "two points of a rotation coincide",
    ),
    "half a turn": (
        f"*PART,NAME=P\n{CUBE}*END PART\n*ASSEMBLY,NAME=A\n*INSTANCE,NAME=I,PART=P\n0,0,0\n"
        "0,0,0,0,0,1\n*END INSTANCE\n*END ASSEMBLY\n",
        "two points and an angle",
    ),
    "copy of nothing": (CUBE + "*ELGEN\n7,2,1,1\n", "copies the element 7, which is not defined"),
    "copies without nodes": (CUBE + "*ELGEN\n1,2,8,1\n", "needs the node 9, which"),
    "arc": (NODES + "*NGEN,LINE=C\n1,2\n", "straight lines only"),
    "biased": (NODES + "*NFILL,BIAS=2.\nA,B,2,1\n", "equal distances only"),
    "singular": (NODES + "*NFILL,SINGULAR=1\nA,B,2,1\n", "equal distances only"),
    "one end": (NODES + "*NGEN\n1\n", "2 numbers are needed at least"),
    "unknown end": (NODES + "*NGEN\n1,99\n", "from 1 to 99: both nodes must exist"),
    "step": (NODES + "*NGEN\n1,8,2\n", "from 1 to 8 by 2 does not fit"),
    "no step": (NODES + "*NGEN\n1,8,0\n", "from 1 to 8 by 0 does not fit"),
    "backwards": (NODES + "*NGEN\n8,1\n", "from 8 to 1 by 1 does not fit"),
    "short fill": (NODES + "*NFILL\nA,B,2\n", "needs two sets, a number of lines and a step"),
    "unequal sets": (NODES + "*NFILL\nA,B,2,1\n", r"between 'A' \(0 nodes\) and 'B' \(0\)"),
    "no lines": (
        "*NODE,NSET=A\n1,0,0,0\n*NODE,NSET=B\n9,1,0,0\n*NFILL\nA,B,0,1\n",
        "over 0 lines does not fit",
    ),
    "axisymmetric": (
        SHEET.replace("S4", "CAX4R") + SOLID + MATERIAL,
        "CAX4R are axisymmetric, which is not supported",
    ),
    "turned inertia": (
        WHOLE + AXES + "1,0,0,0,1,0\n*ELEMENT,TYPE=ROTARYI,ELSET=W\n9,1\n"
        "*ROTARY INERTIA,ELSET=W,ORIENTATION=O\n1.,2.,3.\n",
        "ROTARY INERTIA in an orientation",
    ),
    "a truss without a section": (
        NODES + "*ELEMENT,TYPE=T3D2,ELSET=ALL\n1,1,2\n" + MATERIAL,
        "1 of 1 T3D2 elements have no section",
    ),
    "leftover": (
        WHOLE + "*ELEMENT,TYPE=DASHPOTA\n2,1,2\n",
        r"1 DASHPOTA elements, but \*DASHPOT cards give values to 0",
    ),
    "spring of length 0": (
        WHOLE.replace("*ELEMENT", "9,0,0,0\n*ELEMENT", 1)
        + SPRING
        + "9,1,9\n*SPRING,ELSET=K\n\n5.\n*BOUNDARY\n1,PINNED\n",
        "the ends of a spring or a dashpot coincide",
    ),
    "spring without k": (WHOLE + SPRING + "9,1,2\n*SPRING,ELSET=K\n", "without a stiffness"),
    "spring of dof 7": (
        WHOLE + "*ELEMENT,TYPE=SPRING1,ELSET=K\n9,1\n*SPRING,ELSET=K\n7\n5.\n",
        "a spring or a dashpot acts on motions from 1 to 6",
    ),
    "nonlinear spring": (WHOLE + "*SPRING,ELSET=K,NONLINEAR\n1\n", "nonlinear springs"),
    "foundation": (WHOLE + "*FOUNDATION\nALL,F1,1.\n", r"\*FOUNDATION is an elastic"),
    "submodel": (WHOLE + "*BOUNDARY,SUBMODEL\n1,1\n", "SUBMODEL is not supported"),
    "short transform": (
        WHOLE + "*NSET,NSET=ALL\n1\n*TRANSFORM,NSET=ALL\n1,0,0\n",
        "six coordinates",
    ),
    "sphere": (
        WHOLE.replace("*NODE", "*NODE,NSET=N", 1) + "*TRANSFORM,NSET=N,TYPE=S\n0,0,0,1,0,0\n",
        "TYPE=R or C",
    ),
    "parallel axes": (
        WHOLE.replace("*NODE", "*NODE,NSET=N", 1) + "*TRANSFORM,NSET=N\n1,0,0,2,0,0\n",
        "gives no axes",
    ),
    "on the axis": (
        WHOLE.replace("*NODE", "*NODE,NSET=N", 1) + "*TRANSFORM,NSET=N,TYPE=C\n0,0,0,0,0,1\n",
        "gives no axes",
    ),
    "mass without m": (WHOLE + "*ELEMENT,TYPE=MASS,ELSET=Q\n9,1\n*MASS,ELSET=Q\n", "a value"),
    "products": (
        WHOLE + "*ELEMENT,TYPE=ROTARYI,ELSET=Q\n9,1\n*ROTARY INERTIA,ELSET=Q\n1,1,1,.1\n",
        "products of inertia are not supported",
    ),
    "few constants": (CUBE + SOLID + PLY.replace(",1E9,1E9,1E9", ""), "needs 6 constants; it has"),
    "hyperelastic": (
        CUBE + SOLID + MATERIAL.replace("*ELASTIC", "*ELASTIC,TYPE=COUPLED TRACTION"),
        "TYPE=COUPLED TRACTION is not supported",
    ),
    "singular stiffness": (
        CUBE + SOLID + "*MATERIAL,NAME=M\n*ELASTIC,TYPE=ORTHO\n1,1,1,1,1,1,1,1,\n1\n",
        "stiffness of .ELASTIC is singular",
    ),
    "solid section of a shell": (SHEET + SOLID + MATERIAL, r"elements \(S4\) that no element"),
    "shell section of a solid": (CUBE + SHELL + MATERIAL, r"elements \(C3D8\) that no element"),
    "beam section of a solid": (CUBE + BEAM + "RECT\n1\n" + MATERIAL, r"\(C3D8\) that no"),
    "two kinds": (
        SHEET.replace("S4", "CPS4")
        + "*ELEMENT,TYPE=CPE4,ELSET=ALL\n3,1,2,3,4\n"
        + SOLID
        + MATERIAL,
        "one section for plane strain and plane stress elements",
    ),
    "dimensions": (BAR + BEAM + "PIPE\n1\n0,1,0\n" + MATERIAL, "PIPE needs 2 positive dim"),
    "no dimension": (BAR + BEAM + "RECT\n0.,1\n0,1,0\n" + MATERIAL, "RECT needs 1 positive dim"),
    "section": (BAR + BEAM + "I\n1\n0,1,0\n" + MATERIAL, "SECTION=I is not supported"),
    "mixed moment": (
        BAR + BEAM + "GENERAL\n1,1,.1,1,1\n0,1,0\n" + MATERIAL,
        "I12 must be 0",
    ),
    "off in both": (
        BAR + BEAM + "RECT,OFFSET1=.5,OFFSET2=.5\n1\n0,1,0\n" + MATERIAL,
        "off its nodes in both directions",
    ),
    "off the middle": (SHEET + SHELL.replace("=M", "=M,OFFSET=UP") + MATERIAL, "not a number"),
    "no orientation": (composite(""), "there is no orientation 'O'"),
    "cylindrical axes": (
        composite(AXES.replace("=O", "=O,SYSTEM=CYLINDRICAL") + "1,0,0,0,1,0\n"),
        "as RECTANGULAR, by two points",
    ),
    "axes without points": (composite(AXES), "as RECTANGULAR, by two points"),
    "no plane": (composite(AXES + "1,0,0,2,0,0\n"), "give no plane"),
    "turn about 1": (composite(AXES + "1,0,0,0,1,0\n1,30\n"), "rotation about 3 only"),
    "layers in a solid": (CUBE + SOLID + PLY, "is given for layers alone, in plane"),
    "mass beside the part": (
        WHOLE.replace("*ELEMENT", "9,0,0,0\n*ELEMENT", 1)
        + "*ELEMENT,TYPE=MASS,ELSET=Q\n9,9\n*MASS,ELSET=Q\n1.\n",
        "acts on a node of no element with a section",
    ),
    "a cell of no family": (CUBE.replace("C3D8", "DC3D8") + MATERIAL, "no element family here"),
}


@pytest.mark.parametrize("case", ABAQUS)
def test_abaqus(tmp_path, case):
    refused(abaqus_assembly.read, abaqus_model.model_of, tmp_path / "part.inp", *ABAQUS[case])


# --- Nastran --------------------------------------------------------------------------------------

GRIDS = "".join(f"GRID,{k},,{x}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(CORNERS, 1))
MAT = "MAT1,1,1.+9,,.3,1000.\n"
BLOCK = GRIDS + "CHEXA,1,1,1,2,3,4,5,6,\n,7,8\nPSOLID,1,1\n" + MAT
QUAD = GRIDS + "CQUAD4,1,1,1,2,3,4\n" + MAT
CBAR = GRIDS + "CBAR,1,1,1,2,0.,0.,1.\n" + MAT
SYSTEM = "CORD2R,5,,0.,0.,0.,1.,1.,0.\n,1.,0.,0.\n"

MAT9 = "MAT9,1,3.,1.,1.,0.,0.,0.,3.,\n,1.,0.,0.,0.,3.,0.,0.,0.,\n,1.,0.,0.,1.,0.,1.,1000."
NASTRAN = {
    "no grids": ("BEGIN BULK\nMAT1,1,1.\nENDDATA\n", r"defines no nodes \(GRID\)"),
    "no bulk": ("BEGIN BULK\nENDDATA\n", "contains no bulk data"),
    "continued": ("BEGIN BULK\n,1,2\n", "a continuation without an entry before it"),
    "components": (BLOCK + "SPC1,1,78,1\n", "'78' are not components from 1 to 6"),
    "letters": (BLOCK + "SPC1,1,xy,1\n", "'xy' are not components from 1 to 6"),
    "negative mass": (BLOCK + "CONM2,9,1,0,-1.\n", "the mass or the inertia of CONM2 is negative"),
    "negative inertia": (BLOCK + "CONM2,9,1,0,1.,,,,,\n,1.,5.,1.\n", "of CONM2 is negative"),
    "cylindrical mass": (
        BLOCK + SYSTEM.replace("CORD2R", "CORD2C") + "CONM2,9,1,5,1.,.1,,,,\n,1.\n",
        "CONM2 is read in rectangular systems",
    ),
    "too many fields": (
        BLOCK + "SPC1,1,123,1,2,3,4,5,6,7,8\n",
        "line 13 .*up to 8 after its name.* got 10",
    ),
    "a number as the mark": (BLOCK + "SPC1,1,123,1,2,3,4,5,6,7\n", "up to 8 .* got 9"),
    "no PMASS": (BLOCK + "CMASS1,9,7,1,1\n", "CMASS1 has no PMASS 7"),
    "no mass matrix": (BLOCK + "CONM1,9,1,,-1.\n", "CONM1 is not that of a mass"),
    "a grid as a scalar point": (BLOCK + "SPOINT,3\n", "defines 3 as a GRID and as an SPOINT"),
    "pins": (CBAR.replace("0.,0.,1.", "0.,0.,1.,,\n,17") + "PBARL,1,1,,ROD\n,.1\n", "flags '17'"),
    "a copy of nothing": ("BEGIN BULK\n=,*1\n", "a copy .=. without an entry before it"),
    "copies of no copy": (BLOCK + "=(5)\n", "repeats no copy"),
    "too many copies": (BLOCK + "=,=,=\n=(5000000)\n", "or one too often"),
    "a rod without area": (BLOCK + "CROD,9,9,1,2\nPROD,9,1\n", "PROD needs an area above 0"),
    "a bush elsewhere": (
        BLOCK + "CBUSH,9,9,1,2,,,,0,\n,,0,1.\nPBUSH,9,K,1.\n",
        "a place of its own .OCID.",
    ),
    "no component": (BLOCK + "CELAS2,9,1.,1\n", "acts on a component from 1 to 6"),
    "no stiffness": (BLOCK + "CELAS2,9,,3,4\n", "line 13 .*field 3 of CELAS2 is empty"),
    "no node": (BLOCK + "CONM2,9,,,1.\n", "line 13 .*field 3 of CONM2 is empty"),
    "component 7": (BLOCK + "CELAS2,9,1.,1,7\n", "acts on a component from 1 to 6"),
    "no constant": (BLOCK + "CELAS1,9,9,1,1\n", "CELAS1 has no PELAS"),
    "bushing turned": (
        BLOCK + "CBUSH,9,9,1,,1.,0.,0.\nPBUSH,9,K,1.\n",
        "CBUSH needs the system CID",
    ),
    "mass of a bushing": (BLOCK + "CBUSH,9,9,1\nPBUSH,9,M,1.\n", r"dampers \(B\) alone"),
    "mixed moment": (
        CBAR + "PBAR,1,1,1.,1.,1.,1.,,,\n,,,,,,,,,\n,,,1.5\n",
        "above 0, and I12² below",
    ),
    "no area": (CBAR + "PBAR,1,1,0.,1.,1.\n", "needs A, I1 and I2 above 0"),
    "no width": (CBAR + "PBARL,1,1,,BAR\n,0.,1.\n", "needs dimensions above 0"),
    "a type": (CBAR + "PBARL,1,1,,L\n,1.,1.,.1,.1\n", "of the type 'L' is not supported"),
    "does not fit": (CBAR + "PBARL,1,1,,I\n,1.,1.,1.,1.,.6,.6\n", "do not fit into each other"),
    "off the shear centre": (
        CBAR.replace("CBAR", "CBEAM") + "PBEAML,1,1,,T\n,1.,1.,.1,.1\n",
        "its neutral axis off the shear centre",
    ),
    "neutral axis": (
        CBAR.replace("CBAR", "CBEAM") + "PBEAM,1,1,1.,1.,1.,,1.,,\n,,,,,,,,,\n,,,,,,,,,\n,,,,,.1\n",
        "neutral axis off the shear centre .N1, N2.",
    ),
    "half a taper": (
        CBAR.replace("CBAR", "CBEAM") + "PBEAM,1,1,1.,1.,1.,,1.,,\n,,,,,,,,,\n,YES,.5,2.,1.,1.\n",
        "PBEAM gives no section at X/XB = 1",
    ),
    "one constant": (BLOCK.replace("1.+9,,.3", ",,.3"), "MAT1 needs E, or G and NU"),
    "membrane": (QUAD + "PSHELL,1,1,.1\n", "without bending .MID2. is a membrane"),
    "coupled": (QUAD + "PSHELL,1,1,.1,1,,,,,\n,,,1\n", "with MID4, which couples"),
    "other property": (QUAD + "PSOLID,1,1\n", "PSOLID is not a property of CQUAD4"),
    "fluid": (BLOCK.replace("PSOLID,1,1", "PSOLID,1,1,,,,,PFLUID"), "FCTN=PFLUID is not a solid"),
    "symmetric half": (QUAD + "PCOMP,1,,,,,,,SMEAR\n,1,.1,0.\n", "LAM=SMEAR is not supported"),
    "no ply": (QUAD + "PCOMP,1,0.\n", "PCOMP with no plies"),
    "own thickness of a stack": (
        QUAD.replace(",3,4\n", ",3,4,,,\n,,,.2,.2,.2,.2\n") + "PCOMP,1,,,,,,,,\n,1,.1,0.\n",
        "thicknesses of its own, which do not apply to the plies",
    ),
    "no thickness": (QUAD + "PSHELL,1,1,,1\n", "CQUAD4 1 has no thickness"),
    "ratio": (QUAD + "PSHELL,1,1,.1,1,-2.\n", "12I/T³ and TS/T of PSHELL must be above 0"),
    "elements' axes": (BLOCK.replace("MAT1,1,1.+9,,.3,1000.", MAT9), "each element's own system"),
    "a layered solid": (BLOCK.replace("PSOLID,1,1", "PCOMPS,1"), "a PCOMPS, which is not"),
    "no orientation": (CBAR.replace(",0.,0.,1.", "") + "PBARL,1,1,,ROD\n,.1\n", "is missing"),
    "along the axis": (
        CBAR.replace("0.,0.,1.", "1.,0.,0.") + "PBARL,1,1,,ROD\n,.1\n",
        "is missing, or along its axis",
    ),
    "element's system": (
        CBAR.replace("2,0.,0.,1.\n", "2,0.,0.,1.,GOO\n,,,0.,0.,.1\n") + "PBARL,1,1,,ROD\n,.1\n",
        "offsets in the element's system",
    ),
    "no length": (
        CBAR.replace("2,0.,0.,1.\n", "2,0.,0.,1.,,\n,,,1.,0.,0.\n") + "PBARL,1,1,,ROD\n,.1\n",
        "has no length",
    ),
}


@pytest.mark.parametrize("case", NASTRAN)
def test_nastran(tmp_path, case):
    refused(nastran.read, nastran_model.model_of, tmp_path / "part.bdf", *NASTRAN[case])
