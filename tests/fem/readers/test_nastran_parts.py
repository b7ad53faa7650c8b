"""Superelements (BEGIN SUPER) that number their entries anew, and that SELOC moves."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao

#: A strip of two plates of different moduli, held at its left end.
LEFT = ["GRID,1,,0.,0.,0.", "GRID,2,,1.,0.,0.", "GRID,3,,1.,1.,0.", "GRID,4,,0.,1.,0.",
        "CQUAD4,1,1,1,2,3,4", "PSHELL,1,1,.1,1,,1", "MAT1,1,2.+11,,.3,7800.",
        "SPC1,1,123456,1,4"]  # fmt: skip
RIGHT = [(1.0, 0, 0), (2.0, 0, 0), (2.0, 1.0, 0), (1.0, 1.0, 0)]
OTHER = ["PSHELL,{0},{0},.1,{0},,{0}", "MAT1,{0},7.+10,,.3,2700."]


def strip(path, parts: list[str]) -> ao.Structure:
    path.write_text("\n".join([*LEFT, *parts, "ENDDATA", ""]))
    return ao.read_model(path)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["in place", "moved"])
def test_parts_with_numbers_of_their_own_are_the_whole(tmp_path, how):
    grids = [f"GRID,{k},,{x},{y},{z}" for k, (x, y, z) in enumerate(RIGHT, 11)][1:3]
    whole = [*grids, "CQUAD4,2,2,2,12,13,3", *(line.format(2) for line in OTHER)]
    expected = strip(tmp_path / "whole.bdf", whole)
    move = np.array([5.0, 0, 7]), np.array([[0, 1.0, 0], [0, 0, 1], [1, 0, 0]])
    places = [move[0] + move[1] @ x if how == "moved" else x for x in np.array(RIGHT)]
    grids = [f"GRID,{k},,{x},{y},{z}" for k, (x, y, z) in enumerate(places, 1)]
    seloc = ["POINT,91,,1.,0.,0.", "POINT,92,,2.,0.,0.", "POINT,93,,2.,1.,0.",
             "SELOC,3,1,2,3,91,92,93"]  # fmt: skip
    own = [*grids, "CQUAD4,1,1,1,2,3,4", *(line.format(1) for line in OTHER)]
    before = seloc if how == "moved" else []
    with pytest.warns(ao.AntioscWarning, match="reduction of 1 superelement"):
        parts = strip(tmp_path / "parts.bdf", [*before, "BEGIN SUPER=3", *own])
    assert parts.mass == pytest.approx(expected.mass)
    found, wanted = (ao.natural_modes(part, 3).frequency for part in (parts, expected))
    np.testing.assert_allclose(found, wanted, rtol=1e-7)
