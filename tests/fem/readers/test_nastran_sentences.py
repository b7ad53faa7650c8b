"""Coordinate systems of Nastran decks, and what is refused or not taken."""

from __future__ import annotations

import math

import numpy as np
import pytest

from antiosc.base.errors import MeshError
from antiosc_decks.nastran import mesh as nastran
from nastran_decks import GRIDS, HEXA, MAT1, read
from refusals import refused


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
    for wrong, at, word in (
        ("CORD1R,16,1,2,9\nGRID,27,16\n", 15, "GRID 9"),
        ("CORD1R,16,1,2,27\nGRID,27,16\n", 16, "itself"),
        ("GRID,27,19\n", 15, "no coordinate system"),
        ("CORD2R,16,,0.,0.,0.,1.,0.,0.,\n,2.,0.,0.\nGRID,27,16\n", 15, "on one line"),
    ):
        path.write_text(text + wrong)
        with refused(at, word, MeshError):
            nastran.read(path, path.name)


TUBE, BEAM = "CTUBE,1,7,1,2\n", "CBEAM,1,7,1,2,0.,1.,0.\n"
SHELL = "CQUAD4,1,7,1,2,3,4\n"
REFUSED = {
    **{f"{card} {prop}": (f"{card}{MAT1}{prop},7,1\nPARAM,7\nPELAS,7,1.\n", 9, f"as {instead}")
       for card, prop, instead in (
           (HEXA, "PLSOLID", "PSOLID"), ("CROD,1,7,1,2\n", "PTUBE2", "PROD"),
           (TUBE, "PWELD", "PTUBE"), (SHELL, "PLPLANE", "PSHELL or PCOMP"),
           ("CBAR,1,7,1,2,0.,1.,0.\n", "PBCOMP", "PBAR"))},
    "taper": (f"{TUBE}PTUBE,7,1,4.,.5,,3.\n", 10, "tapered"),
    "material": (f"{HEXA}PSOLID,7,3\n", 11, "there is no MAT1"),
    "solid of plies": (f"{HEXA}PSOLID,7,3\nMAT8,3,9.,8.,.1,3.,,,1.\n", 12, "nine constants"),
    "shell of a solid": (f"{SHELL}PSHELL,7,3,.1,3,2.,3\nMAT9,3,1.\n,,,,,,,,\n,,,,,,,1.\n",
                         11, "not a material of shells"),
    "indefinite": (f"{SHELL}PSHELL,7,3,.1,3,2.,3\nMAT2,3,1.,2.,,1.,,1.,1.\n", 11, "definite"),
    "spoint": (f"SPOINT,100,THRU,10000102\n{HEXA}", 9, "SPOINT from 100"),
    "mass of nothing": (f"{HEXA}PSOLID,7,1\nCMASS2,9,1.\n", 12, "no node"),
    "place of a station": (f"{BEAM}PBEAM,7,1,6.,5.,3.,,4.,,\n,NO,1.5,3.,2.\n", 10, "X/XB"),
    "place of a profile": (f"{BEAM}PBEAML,7,1,,ROD\n,.2,,NO,1.5,.1\n", 10, "X/XB"),
    "no end": (f"{BEAM}PBEAML,7,1,,ROD\n,.2,,NO,.5,.1\n", 10, "no section at X/XB = 1"),
    **{f"a bush along {k}": (
        f"{HEXA}PSOLID,7,1\nCBUSH,9,9,1,2\nPBUSH,9,K{k * ','}1.\n", 12, "CID")
       for k in (2, 3, 5, 6)},
    "contact": (f"{HEXA}BCONTACT,1\n", 11, "contact"),
    "element": (f"{HEXA}CFAST,9,9,1,2\n", 11, "CFAST"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_is_told_with_its_line(tmp_path, case):
    text, line, word = REFUSED[case]
    with refused(line, word, MeshError):
        read(tmp_path, GRIDS + text + MAT1)
