"""What element families tell of a part: its dimensions, its constants, its own indentation."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.platform import compat
from parts import STEEL, box, line, named, plate
from sheets import PLY

ROUND, OBLONG = ao.Section.circle(0.1), ao.Section.rectangle(0.1, 0.2)


def halves(mesh: ao.Mesh, at: float) -> ao.Mesh:
    """With the cells on both sides of x = `at` as groups "one" and "two"."""
    sides = {
        "one": (mesh.tdim, lambda x: x[0] < at + 1e-9),
        "two": (mesh.tdim, lambda x: x[0] > at - 1e-9),
    }
    return named(mesh.dolfinx, sides)


def arc() -> ao.Mesh:
    """One line of order 2."""
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.1, 0]])
    mesh = compat.create_mesh(MPI.COMM_SELF, np.array([[0, 1, 2]]), x, "interval", 2)
    return ao.read_mesh(mesh)


@pytest.mark.slow
def test_boxes_and_thicknesses():
    block = ao.Structure(box((2, 1, 1), (0.3, 0.1, 0.2)), ao.Solid(**STEEL), order=1)
    assert block.dimensions == pytest.approx((0.3, 0.2, 0.1))
    for thickness in (0.5, 0.01):
        flat = ao.Solid(**STEEL, plane="stress", thickness=thickness)
        part = ao.Structure(plate((2, 1), (0.1, 0.3)), flat, order=1)
        assert part.dimensions == pytest.approx((0.3, thickness, 0.1))
    thick, thin = (ao.Shell(**STEEL, thickness=t) for t in (0.02, 0.01))
    sheet = halves(plate((2, 1), (0.2, 0.3), "triangle"), 0.1)
    part = ao.Structure(sheet, {"one": thick, "two": thin})
    assert part.dimensions == pytest.approx((0.3, 0.2, 0.01))


def test_local_indentation_is_that_of_a_half_space_or_none():
    """Johnson's (3.41a) and (3.91a), weighted by the pressure; families without depth have none."""
    E, nu = STEEL["E"], STEEL["nu"]
    along, across = 0.6 * (1 - nu**2) / E, 0.3 * (2 - nu) * (1 + nu) / E
    steel = ao.Solid(**STEEL)
    for cosine in (0.0, 0.6, 1.0):
        exact = cosine**2 * along + (1 - cosine**2) * across
        assert steel.half_space_compliance(cosine) == pytest.approx(exact, rel=1e-12)
    section = ao.Section.circle(0.01)
    for other in (
        ao.Solid(**STEEL, plane="strain"),
        ao.Shell(**STEEL, thickness=0.01),
        ao.Laminate([PLY]),
        ao.Beam(**STEEL, section=section),
        ao.Truss(**STEEL, area=1e-4),
    ):
        assert other.half_space_compliance(0.6) == 0.0


@pytest.mark.parametrize(
    ("mesh", "material", "words"),
    [
        (lambda: line(1.0, 2), ao.Solid(**STEEL), "has interval cells in 2-D"),
        (lambda: plate((1, 1)), ao.Truss(**STEEL, area=1e-4), "Truss needs a mesh of lines"),
        (lambda: plate((1, 1)), ao.Beam(**STEEL, section=ROUND), "Beam needs a mesh of lines"),
        (lambda: arc(), ao.Beam(**STEEL, section=ROUND), "Beam elements are straight"),
        (lambda: arc(), ao.Truss(**STEEL, area=1e-4), "bars of a Truss are straight"),
        (lambda: line(1.0, 2), ao.Shell(**STEEL, thickness=0.1), "Shell needs a mesh of triangles"),
        (lambda: box((1, 1, 1)), ao.Laminate([PLY]), "Laminate needs a mesh of triangles"),
        (lambda: plate((1, 1)), ao.AnisotropicSolid(np.eye(6) * 1e9, 1e3), "is for 3-D meshes"),
        (
            lambda: line(1.0, 2),
            ao.Beam(**STEEL, section=OBLONG, orientation=(0, 1, 0), offset=0.1),
            "offset applies to beams in space",
        ),
        (
            lambda: line(1.0, 2, (1.0, 0, 0)),
            ao.Beam(**STEEL, section=OBLONG),
            "orientation",
        ),
    ],
)  # fmt: skip
def test_meshes_of_other_families_are_refused(mesh, material, words):
    with pytest.raises(ao.InputError, match=words):
        ao.Structure(mesh(), material)
