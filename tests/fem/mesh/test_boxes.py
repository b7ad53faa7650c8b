"""Bars, plates and blocks of given lengths: each named side is where its name says."""

from __future__ import annotations

from math import prod

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import antiosc as ao
from antiosc.fem.mesh.surface import centre, largest, quadrature
from refusals import refused

pytestmark = pytest.mark.fem


@pytest.mark.parametrize("lengths", [(0.3,), (0.2, 0.1), (0.06, 0.04, 0.03)])
def test_sides_lie_where_their_names_say(lengths):
    mesh = ao.box_mesh(lengths, size=0.02)
    whole = np.zeros(3)
    whole[: len(lengths)] = lengths
    body = {1: "bar", 2: "plate", 3: "block"}[len(lengths)]
    assert quadrature(mesh, *largest(mesh, body), 2).weight.sum() == pytest.approx(prod(lengths))
    for axis, length in enumerate(lengths):
        others = prod(each for k, each in enumerate(lengths) if k != axis)
        for sign, at in (("-", 0.0), ("+", length)):
            side, middle = f"{sign}{'xyz'[axis]}", whole / 2
            middle[axis] = at
            np.testing.assert_allclose(centre(mesh, side), middle, atol=1e-12)
            area = quadrature(mesh, *largest(mesh, side), 2).weight.sum()
            assert area == pytest.approx(others)
    if len(lengths) == 2:
        rim = quadrature(mesh, *largest(mesh, "rim"), 2).weight.sum()
        assert rim == pytest.approx(2 * sum(lengths))


def test_lengths_that_make_no_box_are_refused():
    for lengths, word in (((), "one to three"), ((1, 1, 1, 1), "one to three"), (0.1, "one to")):
        with refused(None, word, ao.InputError):
            ao.box_mesh(lengths, 0.1)
    with refused(None, "length", ao.InputError):
        ao.box_mesh((0.1, -0.1), 0.01)
    with refused(None, "is larger than", ao.MeshError):
        ao.box_mesh((0.1, 0.1), 10.0)
