"""What decks of public collections hold, beside what the manuals ask for."""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc.io.reading import read as read_mesh, read_parts
from antiosc.io.unit_system import UnitSystem

BLOCK = bdf.GRIDS + bdf.HEXA + "PSOLID,7,1\n" + bdf.MAT1
BAR = bdf.GRIDS + bdf.MAT1 + "SPC1,1,123456,1\n"
PLATE = bdf.GRIDS + bdf.MAT1 + "CQUAD4,1,7,1,2,3,4\n"


def same(one: dict, other: dict) -> None:
    """Two models but for what is told, and for the places of their cards."""
    for key in set(one) - {"ignored", "families"}:
        inp.alike(one[key], other[key])
    inp.alike([row[:3] for row in one["families"]], [row[:3] for row in other["families"]])


def test_components_with_blanks(tmp_path):
    rigid = "RBE2,9,1,{},2\nSPC1,1,{},3\nGRID,9,,0.,0.,0.,,{}\n"
    close, apart = (
        BLOCK + rigid.format(*row) for row in (("123", "12", "46"), ("1 2 3", "1 2", "4 6"))
    )
    same(bdf.read(tmp_path, close)[0], bdf.read(tmp_path, apart)[0])
    with pytest.raises(MeshError, match="components"):
        bdf.read(tmp_path, BLOCK + "SPC1,1,1 7,3\n")


def test_bars_without_second_moments_are_rods(tmp_path):
    bars, _ = bdf.read(tmp_path, BAR + "CBAR,1,7,1,2,0.,1.,0.\nPBAR,7,1,3.,,0.,,2.-9\n")
    rods, _ = bdf.read(tmp_path, BAR + "CROD,1,7,1,2\nPROD,7,1,3.,,,2.-9\n")
    same(bars, rods)
    assert any("PBAR 7" in text for text in bars["ignored"])


def test_a_bush_at_a_place_of_its_own(tmp_path):
    given = BLOCK + "PBUSH,3,K,4.,5.,6.\n" + bdf.CYCLIC
    middle, _ = bdf.read(tmp_path, given + "CBUSH,9,3,1,2,,,,0\n,.5\n")
    placed, _ = bdf.read(tmp_path, given + "CBUSH,9,3,1,2,,,,0\n,,5,0.,0.,10.\n")
    same(middle, placed)


def test_a_rigid_body_without_a_reference_node_has_six_motions(tmp_path):
    body = inp.CUBE + inp.SOLID + inp.STEEL + "*NSET,NSET=P\n1,2,3,6\n*RIGID BODY,NSET=P\n"
    model, _ = inp.read(tmp_path, body)
    equations = model["joints"]["equations"]
    motions = sorted({(n, m) for terms in equations for n, m, _ in terms})
    rows = np.zeros((len(equations), len(motions)))
    for row, terms in zip(rows, equations, strict=True):
        for node, motion, coefficient in terms:
            row[motions.index((node, motion))] += coefficient
    assert len(motions) - np.linalg.matrix_rank(rows) == 6


@pytest.mark.parametrize("mass", ["CONM2,9,99,,1.\n", "CONM2,9,99,,1.,1.,0.,0.\n"])
def test_masses_that_nothing_joins_are_told(tmp_path, mass):
    plain, _ = bdf.read(tmp_path, BLOCK)
    model, _ = bdf.read(tmp_path, BLOCK + "GRID,99,,50.,0.,0.\n" + mass)
    same(model, plain)
    assert any("nothing joins" in text for text in model["ignored"])


@pytest.mark.parametrize("given", [",1,.4,,,1", ",,.4,1,,1"])
def test_shells_with_one_stiffness_of_two_take_the_other_and_say_it(tmp_path, given):
    both, _ = bdf.read(tmp_path, PLATE + "PSHELL,7,1,.4,1,,1\n")
    model, _ = bdf.read(tmp_path, PLATE + f"PSHELL,7{given}\n")
    same(model, both)
    assert any("PSHELL 7" in text for text in model["ignored"])


def test_files_of_the_folder_above_are_included_and_no_others(tmp_path):
    folder = tmp_path / "sub" / "decks"
    folder.mkdir(parents=True)
    for place, reads in ((tmp_path / "sub", True), (tmp_path, False)):
        (place / "grids.inc").write_text(bdf.GRIDS)
        name = "../grids.inc" if reads else "../../grids.inc"
        (folder / "part.bdf").write_text(f"BEGIN BULK\nINCLUDE '{name}'\n{bdf.HEXA}")
        if reads:
            assert len(read_mesh(folder / "part.bdf").cells) == 1
        else:
            with pytest.raises(MeshError, match="outside"):
                read_mesh(folder / "part.bdf")


def test_one_of_several_pieces(tmp_path):
    """The largest by its number of elements; what acts on the others is left out and told."""
    cubes = "".join(
        f"GRID,{10 * k + n},,{x + 50 * (k // 2)}.,{y}.,{z + 10 * (k % 2)}.\n"
        for k in (0, 2, 3)
        for n, (x, y, z) in enumerate(bdf.CORNERS, 1)
    )
    hexas = "CHEXA,1,7,1,2,3,4,5,6,\n,7,8\nCHEXA,2,8,21,22,23,24,25,26,\n,27,28\n"
    hexas += "CHEXA,3,8,25,26,27,28,35,36,\n,37,38\n"
    path = tmp_path / "part.bdf"
    path.write_text(cubes + hexas + "PSOLID,7,1\nPSOLID,8,1\n" + bdf.MAT1 + "CONM2,9,1,,1.\n")

    def piece(rank: int):
        options = {"density": None, "parts": None, "piece": rank}
        return read_parts(path, timeout=None, unit=UnitSystem(1e-3), merge=None, model=options)[3]

    assert [len(piece(rank).cells) for rank in (1, 2)] == [2, 1]
    assert [bool(piece(rank).model["masses"]) for rank in (1, 2)] == [False, True]
    with pytest.raises(MeshError, match="2 pieces"):
        piece(3)


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


def test_bulk_data_by_the_name_of_an_abaqus_deck_are_called_so(tmp_path):
    with pytest.raises(MeshError, match=r"line 1 of part\.inp.*Nastran"):
        inp.read(tmp_path, BLOCK)
