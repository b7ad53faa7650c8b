"""What few decks need is refused with its line and what to do; every element is accounted for."""

from __future__ import annotations

import warnings

import pytest

import abaqus_decks as inp
import antiosc as ao
import nastran_decks as bdf
from refusals import refused

SOLID = inp.CUBE + inp.SOLID + inp.STEEL
BRICK = bdf.GRIDS + bdf.HEXA + "PSOLID,7,1\n" + bdf.MAT1

#: Cards behind a sound deck -> a word of what to do.
ABAQUS = {
    "*NGEN\n1,8\n": "write",
    "*ELGEN\n1,2\n": "write",
    "*MPC\nPLANE,1,2,3,4\n": "EQUATION",
    "*MPC\nMEANROT,1,2,3,4\n": "EQUATION",
    "*CYCLIC SYMMETRY MODEL,N=8\n0,0,0,0,0,1\n": "ring",
    "*TIE,CYCLIC SYMMETRY\nA,B\n": "ring",
    "*GAP,ELSET=G\n0.\n": "join",
    "*NONSTRUCTURAL MASS,ELSET=ALL,UNITS=TOTAL MASS\n1.\n": "density",
    "*TRANSFORM,NSET=N,TYPE=C\n0,0,0,0,0,1\n": "turn",
}
NASTRAN = {
    "CQUAD1,9,7,1,2,3,4\n": "today",
    "CRIGD1,9,1,2\n": "today",
    "CSHEAR,9,7,1,2,3,4\n": "CQUAD4",
    "CBEND,9,7,1,2,0.,0.,1.,1\n": "straight",
    "CGAP,9,7,1,2\n": "join",
    "CVISC,9,7,1,2\n": "remove",
    "CONM1,9,1,,2.\n": "CONM2",
    "NSM,3,PSOLID,7,2.-9\n": "CONM2",
    "SEBULK,1,PRIMARY\n": "write",
    "BEGIN SUPER=1\n": "write",
}


@pytest.mark.parametrize("cards", ABAQUS)
def test_cards_of_abaqus_are_refused_with_what_to_do(tmp_path, cards):
    line = SOLID.count("\n") + (2 if cards.startswith("*MPC") else 1)
    with refused(line, ABAQUS[cards], ao.MeshError):
        inp.read(tmp_path, SOLID + cards)


@pytest.mark.parametrize("cards", NASTRAN)
def test_entries_of_nastran_are_refused_with_what_to_do(tmp_path, cards):
    with refused(BRICK.count("\n") + 1, NASTRAN[cards], ao.MeshError):
        bdf.read(tmp_path, BRICK + cards)


def test_axisymmetric_elements_and_stiffnesses_of_shells_are_refused(tmp_path):
    with refused(None, "revolve", ao.MeshError):
        text = inp.SHEET.replace("TYPE=S4", "TYPE=CAX4") + inp.SOLID.replace("ALL", "All")
        inp.read(tmp_path, text + inp.STEEL)
    with refused(None, "MATERIAL", ao.MeshError):
        inp.read(tmp_path, inp.SHEET + "*SHELL GENERAL SECTION,ELSET=ALL\n1.,2.\n")


def test_rubber_needs_the_modulus_of_the_caller(tmp_path):
    text = SOLID.replace("*ELASTIC\n2E5,.3\n", "*HYPERELASTIC,NEO HOOKE\n2.,.02\n")
    with refused(None, "modulus", ao.MeshError):
        inp.read(tmp_path, text)
    model, _ = inp.read(tmp_path, text, modulus=5e6)
    assert model["families"][0][2]["E"] == pytest.approx(5e6)
    assert any("HYPERELASTIC" in told for told in model["ignored"])


def test_a_shell_that_bends_by_another_material_is_refused(tmp_path):
    plate = bdf.GRIDS + "CQUAD4,1,7,1,2,3,4\nPSHELL,7,1,.1,2\n" + bdf.MAT1
    with refused(10, "MID2", ao.MeshError):
        bdf.read(tmp_path, plate + bdf.MAT1.replace("MAT1,1", "MAT1,2"))


# --- Every element is taken, told with its number, or refused -------------------------------------


def grid(count: int = 4) -> list[tuple[int, float, float]]:
    """Numbers and places of the nodes of a square of quadrilaterals, in mm."""
    row = count + 1
    return [(1 + i + row * j, 10.0 * i, 10.0 * j) for j in range(row) for i in range(row)]


def quads(count: int = 4) -> list[str]:
    row = count + 1
    cells = [(i, j) for j in range(count) for i in range(count)]
    return [f"{1 + i + row * j},{2 + i + row * j},{2 + i + row * (j + 1)},{1 + i + row * (j + 1)}"
            for i, j in cells]  # fmt: skip


#: 16 quadrilaterals of 10 mm, 1 mm thick, four beams of 2 x 4 mm and two rods of 3 mm² on their
#: edges, two masses of 3 g; t, mm, N.
MASS = 1e3 * (1600 * 1.0 * 8e-9 + 40 * 8.0 * 8e-9 + 20 * 3.0 * 8e-9 + 2 * 3e-6)


def abaqus() -> str:
    nodes = "".join(f"{k},{x},{y},0.\n" for k, x, y in grid())
    cells = "".join(f"{k},{nodes}\n" for k, nodes in enumerate(quads(), 1))
    beams = "".join(f"{100 + k},{11 + k},{12 + k}\n" for k in range(4))
    return (
        f"*NODE\n{nodes}*ELEMENT,TYPE=S4,ELSET=SKIN\n{cells}*ELEMENT,TYPE=B31,ELSET=RIB\n{beams}"
        "*ELEMENT,TYPE=T3D2,ELSET=ROD\n200,1,2\n201,2,3\n*ELEMENT,TYPE=MASS,ELSET=Q\n300,1\n301,25\n"
        "*SHELL SECTION,ELSET=SKIN,MATERIAL=M\n1.\n*MASS,ELSET=Q\n3e-6\n"
        "*BEAM SECTION,ELSET=RIB,MATERIAL=M,SECTION=RECT\n2.,4.\n0.,1.,0.\n"
        "*SOLID SECTION,ELSET=ROD,MATERIAL=M\n3.\n" + inp.STEEL
    )


def nastran() -> str:
    text = "".join(f"GRID,{k},,{x},{y},0.\n" for k, x, y in grid())
    text += "".join(f"CQUAD4,{k},1,{nodes}\n" for k, nodes in enumerate(quads(), 1))
    text += "".join(f"CBAR,{100 + k},2,{11 + k},{12 + k},0.,1.,0.\n" for k in range(4))
    text += "CROD,200,3,1,2\nCROD,201,3,2,3\nCONM2,300,1,,3.-6\nCONM2,301,25,,3.-6\n"
    text += "PSHELL,1,1,1.,1,,1\nPBARL,2,1,,BAR\n,4.,2.\nPROD,3,1,3.\n"
    return text + "MAT1,1,2.+5,,.3,8.-9\n"


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize(("name", "text"), [("a.inp", abaqus()), ("a.bdf", nastran())])
def test_a_model_has_the_mass_and_the_number_of_every_element(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        part = ao.read_model(path, unit="mm")
    assert part.mass == pytest.approx(MASS, rel=1e-9)

    cells = {m.name: m.part.mesh.n_cells for m in part.matrices.members()}
    assert cells == {"faces": 16, "beams": 4}
    told = " ".join(str(one.message) for one in caught)
    assert "2 T3D2" in told or "2 CROD" in told  # springs with masses at their ends


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize(("name", "text"), [("a.inp", abaqus()), ("a.bdf", nastran())])
def test_a_mesh_tells_the_number_of_every_element_that_is_no_cell(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = ao.read_mesh(path, unit="mm")
    told = " ".join(str(one.message) for one in caught)
    assert mesh.n_cells == 16
    assert "6 lines" in told
    assert "2 MASS" in told or "2 CONM2" in told
