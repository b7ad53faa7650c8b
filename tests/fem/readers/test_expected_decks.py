"""What the author of a deck expects to be read, and what is told of it."""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf

BAR = bdf.GRIDS + "CBAR,1,7,1,2,0.,1.,0.\n" + bdf.MAT1
PBAR = "PBAR,7,1,2.,3.,3.,4.\n"


def test_a_bar_with_one_blank_inertia_is_soft_there(tmp_path):
    """It is read, with a small stiffness in that plane, and told."""
    model, _ = bdf.read(tmp_path, BAR + "PBAR,7,1,2.,3.,,4.\n")
    ((_, kind, arguments, _),) = model["families"]
    assert kind == "Beam"
    section = arguments["section"]
    small, large = sorted((section["I"], section["I_side"]))
    assert small < 1e-5 * large
    assert any("hinge" in sentence for sentence in model["ignored"])


def test_an_include_before_the_bulk_data_may_be_missing(tmp_path):
    text = (
        "INCLUDE 'dmap.txt'\nSOL 103\nCEND\nBEGIN BULK\n" + BAR + "PBAR,7,1,2.,3.,3.,4.\nENDDATA\n"
    )
    _, deck = bdf.read(tmp_path, text)
    assert any("dmap.txt" in sentence for sentence in deck.told)


def test_the_displacement_of_nodes_on_a_line_is_their_mean(tmp_path):
    """RBE3 to a node beside the middle of two nodes, on their line: no rotation matters."""
    rbe3 = "RBE3,9,,2,1,1.,123,1,10\n"
    text = BAR + PBAR + "GRID,10,,60.,0.,0.\nCBAR,2,7,1,10,0.,1.,0.\n" + rbe3
    model, _ = bdf.read(tmp_path, text)
    (terms,) = model["joints"]["equations"]
    assert {n: c for n, m, c in terms if m == 0} == pytest.approx({1: 1.0, 0: -0.5, 8: -0.5})


CYLINDER = """*NODE
1, 5., 0., 0.
2, 0., 5., 0.
3, 0., 5., 2.
4, 5., 0., 2.
*ELEMENT, TYPE=S4, ELSET=ALL
1, 1, 2, 3, 4
*MATERIAL, NAME=M
*ELASTIC, TYPE=LAMINA
2e5, 1e4, .3, 5e3, 5e3, 4e3
*DENSITY
1e-9
*ORIENTATION, NAME=AROUND, SYSTEM=CYLINDRICAL
0., 0., 0., 0., 0., 1.
1, {}
*SHELL SECTION, ELSET=ALL, MATERIAL=M, ORIENTATION=AROUND
0.1
"""


def test_a_cylindrical_orientation_that_calculix_reads_otherwise_is_told(tmp_path):
    """Constants of a solid: CalculiX has the first along the radius."""
    nine = "TYPE=ENGINEERING CONSTANTS\n2e5, 1e4, 1e4, .3, .3, .3, 5e3, 5e3\n4e3"
    text = CYLINDER.format(0).replace("TYPE=LAMINA\n2e5, 1e4, .3, 5e3, 5e3, 4e3", nine)
    model, _ = inp.read(tmp_path, text)
    assert any("CalculiX" in text for text in model["ignored"])


def test_layers_turn_against_each_other_by_their_cylindrical_orientations(tmp_path):
    """Axes in the plane of a flat shell at ±45° to x: first directions across them."""
    rows = "*SHELL SECTION, ELSET=ALL, COMPOSITE\n.1,, M, A\n.1,, M, B\n.1,, M, A\n"
    for name, y in (("A", 1), ("B", -1)):
        rows += f"*ORIENTATION, NAME={name}, SYSTEM=CYLINDRICAL\n0, 0, 0, 1, {y}, 0\n"
    nodes = "1, 9, 0, 0\n2, 20, 0, 0\n3, 20, 5, 0\n4, 9, 5, 0\n5, 30, 0, 0\n6, 30, 5, 0\n"
    material = CYLINDER.partition("*MATERIAL")[2]
    element = "*ELEMENT, TYPE=S4, ELSET=ALL\n1, 1, 2, 3, 4\n2, 2, 5, 6, 3\n*MATERIAL"
    text = f"*NODE\n{nodes}{element}{material.partition('*ORIENTATION')[0]}{rows}"
    model, _ = inp.read(tmp_path, text)
    ((_, _, arguments, _),) = model["families"]
    assert np.abs(np.array(arguments["axis"]) @ [1, 1, 0]) < 1e-12
    angles = [layer["angle"] % 180 for layer in arguments["layers"]]
    assert angles == pytest.approx([0, 90, 0], abs=1e-9)


@pytest.mark.parametrize(("gap", "springs"), [(0.0, 1), (0.1, 0)])
def test_a_gap_stays_as_it_is_at_first(tmp_path, gap, springs):
    """Closed it is a spring along its nodes, open it is none; both are told."""
    text = (
        BAR
        + PBAR
        + f"GRID,10,,60.,0.,0.\nCBAR,2,7,2,10,0.,1.,0.\nPGAP,3,{gap},,5.\nCGAP,9,3,1,10\n"
    )
    model, _ = bdf.read(tmp_path, text)
    assert len(model["joints"]["springs"]) == springs
    assert any("CGAP" in sentence for sentence in model["ignored"])


def test_a_file_of_loads_may_be_missing(tmp_path):
    """The loads are not read either; it is told."""
    loads = "*STEP\n*STATIC\n*DLOAD\n*INCLUDE, INPUT=pressure.dlo\n*END STEP\n"
    model, _ = inp.read(tmp_path, CYLINDER.format(0) + loads)
    assert any("*INCLUDE" in sentence for sentence in model["ignored"])


@pytest.mark.parametrize(("degrees", "axis"), [(0, (-1, 1, 0)), (90, (0, 0, 1))])
def test_a_cylindrical_orientation_goes_around_its_axis(tmp_path, degrees, axis):
    """Where the radius is the normal of a shell, the first direction is that around the axis."""
    model, _ = inp.read(tmp_path, CYLINDER.format(degrees))
    ((_, _, arguments, _),) = model["families"]
    expected = np.array(axis) / np.linalg.norm(axis)
    np.testing.assert_allclose(arguments["axis"], expected, atol=1e-12)
    assert not any("CalculiX" in text for text in model["ignored"])
