"""Decks as structures: materials, sections, units and supports against closed forms and solves."""

from __future__ import annotations

import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from mpi import run_ranks
from paths import DECKS

pytestmark = pytest.mark.fem


#: A cantilever of 200 mm whose centroid lies 30 mm above its nodes.
EXCENTRIC = """BEGIN BULK
GRID,1,,0.,0.,0.,,123456
GRID,2,,100.,0.,0.
GRID,3,,200.,0.,0.
CBAR,1,1,1,2,0.,0.,1.,GGG
,,,0.,0.,30.,0.,0.,30.
CBAR,2,1,2,3,0.,0.,1.,GGG
,,,0.,0.,30.,0.,0.,30.
PBAR,1,1,200.,6666.,1666.,4000.
MAT1,1,210000.,,.3,7.85-9
ENDDATA
"""


def test_of_separate_pieces_one_is_read(tmp_path):
    """The error names what chooses one."""
    other = "GRID,4,,0.,900.,0.\nGRID,5,,9.,900.,0.\nCBAR,9,2,4,5,0.,0.,1.\n"
    other += "PBAR,2,1,200.,6666.,1666.,4000.\n"
    (tmp_path / "bar.bdf").write_text(EXCENTRIC.replace("ENDDATA", other))
    with pytest.raises(ao.MeshError, match=r"2 pieces.*piece=1.*'2'"):
        ao.read_model(tmp_path / "bar.bdf", unit="mm")
    bar = ao.read_model(tmp_path / "bar.bdf", unit="mm", piece=1)
    assert bar.mass == pytest.approx(7850 * 0.2 * 200e-6)
    with pytest.raises(ao.InputError, match="piece"):
        ao.read_model(tmp_path / "bar.bdf", piece=0)


@pytest.mark.mpi
def test_ranks_share_the_structure_of_a_deck():
    script = """
        import sys, warnings
        import antiosc as ao
        from mpi4py import MPI
        warnings.simplefilter("ignore")
        plate = ao.read_model(sys.argv[1] + "/plate.bdf", unit="mm")
        model = ao.extract(plate, ao.Site((0.25, 0.05, 0), (0, 0, 1)), n=4)
        print(plate.dofs, f"{plate.mass:.9g} {model.k0:.9g}")
        try:
            ao.read_model(sys.argv[1] + "/mixed.inp")
        except ao.MeshError as error:
            print(error)
    """
    one, two = run_ranks(1, script, str(DECKS)), run_ranks(2, script, str(DECKS))
    assert two == [*one, *one]
    assert "have no section" in one[0]


WRONG = [("unit", "km"), ("merge", 0.0), ("density", -1.0), ("timeout", 0.0), ("comm", 3)]
WRONG += [("supports", ["clamp"]), ("attached", 3), ("parts", []), ("parts", "A"), ("root", "none")]


@pytest.mark.parametrize(("option", "value"), WRONG)
def test_wrong_arguments_are_named_before_a_deck_is_looked_for(tmp_path, option, value):
    with pytest.raises(ao.InputError, match=f"{option} must be"):
        ao.read_model(tmp_path / "part.inp", **{option: value})
