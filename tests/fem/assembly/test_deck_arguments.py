"""Arguments of `read_model` that are refused before anything is read, and its families."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.assembly import from_deck

pytestmark = pytest.mark.fem

WRONG = {
    "unit": ("km", "unit must be one of 'm', 'mm', 'cm', 'in', or a number"),
    "merge": (0.0, "merge must be > 0 (in m)"),
    "density": (-1.0, "density must be > 0 (in kg/m³)"),
    "timeout": (0.0, "timeout must be > 0 (in s)"),
    "comm": (3, "comm must be an MPI communicator (mpi4py)"),
    "supports": (["clamp"], "supports must be a list of Support objects; got str 'clamp'"),
    "attached": (
        3,
        "attached must be a list of PointMass, Spring, Damper and Footing objects; got int 3",
    ),
    "parts": ([], "parts must be a list of names; got []."),
}


@pytest.mark.parametrize("name", WRONG)
def test_arguments_that_are_refused(tmp_path, name):
    value, message = WRONG[name]
    with pytest.raises(ao.InputError) as caught:
        ao.read_model(tmp_path / "part.inp", **{name: value})
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("parts", ["BODY", [3], [[]], ("a", 1)])
def test_parts_are_names(tmp_path, parts):
    with pytest.raises(ao.InputError, match="parts must be a list of names; got"):
        ao.read_model(tmp_path / "part.inp", parts=parts)
    with pytest.raises(ao.MeshError, match="there is no mesh file"):
        ao.read_model(tmp_path / "part.inp", parts=("a",), supports=ao.Support("a"))


LAYER = {"E1": 9e10, "E2": 2e10, "nu12": 0.3, "G12": 5e9, "G13": 4e9, "G23": 3e9, "rho": 2e3,
         "thickness": 1e-3, "angle": 30.0}  # fmt: skip


def test_families_of_a_deck():
    """Their classes with the arguments of the deck; what they refuse is told with its line."""
    section = {"A": 1e-4, "I": 4e-9, "I_side": 2e-9, "J": 3e-9, "shear": 0.5}
    beam = from_deck._family(
        "Beam", {"E": 2e11, "nu": 0.3, "rho": 8e3, "section": section, "orientation": [0, 1, 0],
                 "offset": 0.01}, "here",
    )  # fmt: skip
    assert isinstance(beam, ao.Beam)
    assert (beam.section.A, beam.section.I, beam.offset) == (1e-4, 4e-9, 0.01)
    stack = from_deck._family(
        "Laminate", {"layers": [LAYER, LAYER], "axis": [0, 1, 0], "top": [0, 0, 1]}, "here"
    )
    assert isinstance(stack, ao.Laminate)
    assert [layer.angle for layer in stack.layers] == [30.0, 30.0]
    places = {"places": [[0.0, 0, 0], [1.0, 0, 0]], "directions": [[1.0, 0, 0], [0, 1.0, 0]]}
    turned = from_deck._family(
        "Laminate", {"layers": [LAYER], "axis": places, "top": [0, 0, 1]}, "here"
    )
    found = turned.axis(np.array([[0.9, 0.1], [0, 0], [0, 0.1]]))
    np.testing.assert_allclose(found, [[0, 1], [1, 0], [0, 0]])
    solid = from_deck._family("Solid", {"E": 2e11, "nu": 0.3, "rho": 8e3}, "here")
    assert (solid.E, solid.nu, solid.rho) == (2e11, 0.3, 8e3)
    with pytest.raises(ao.InputError, match=r"^line 7 of a deck: .*E must be > 0"):
        from_deck._family("Solid", {"E": -2e11, "nu": 0.3, "rho": 8e3}, "line 7 of a deck")


def test_masses_and_springs_at_places_and_at_points():
    model = {"masses": [[[1.0, 2.0, 3.0], 0.5, [0, 0, 0]], [-2, 0.25, [1, 2, 3]]],
             "springs": [[-1, {"x": 7.0}]]}  # fmt: skip
    first, second, spring = from_deck.attachments(model)
    assert (tuple(first.where), first.mass) == ((1, 2, 3), 0.5)
    assert (second.where, second.mass) == ("point 2", 0.25)
    assert spring.where == "point 1"
