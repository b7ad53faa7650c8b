"""What supports leave free is told, in words that mechanics gives by hand."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import antiosc as ao

dolfinx = pytest.importorskip("dolfinx")
pytestmark = pytest.mark.fem

from mpi4py import MPI  # noqa: E402

from antiosc.fem.platform import compat  # noqa: E402

SOLID = ao.Solid(70e9, 0.3, 2700.0)
SIZE = (0.4, 0.1, 0.2)


def box() -> ao.Mesh:
    return ao.read_mesh(dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), SIZE], [3, 1, 2]))


def at(**where: float):
    """Points with these coordinates."""
    return lambda x: np.all([np.isclose(x["xyz".index(k)], v) for k, v in where.items()], axis=0)


def told(mesh, material, supports) -> str:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        ao.Structure(mesh, material, supports)
    found = [str(one.message) for one in said if "as a rigid body" in str(one.message)]
    assert all(issubclass(one.category, ao.AntioscWarning) for one in said)
    assert len(found) <= 1
    return found[0].split(": ")[1].split(";")[0] if found else ""


CORNER = at(x=0.0, y=0.0, z=0.0)
OTHER = at(x=0.4, y=0.1, z=0.2)
EDGE = at(x=0.0, z=0.0)


@pytest.mark.sample
@pytest.mark.parametrize(
    ("supports", "words"),
    [
        ([], ""),
        ([ao.Support(at(x=0.0))], ""),
        ([ao.Support(CORNER), ao.Support(OTHER), ao.Support(EDGE)], ""),
        # a roller under a face: it slides along the face and turns about the normal
        (
            [ao.Support(at(x=0.0), "x")],
            "translation along y, translation along z and rotation about x",
        ),
        ([ao.Support(at(x=0.0), ("x", "y"))], "translation along z"),
        # a hinge along an edge that lies in y
        ([ao.Support(EDGE)], "rotation about y through (0, 0.05, 0) m"),
        (
            [ao.Support(EDGE, ("x", "z"))],
            "translation along y and rotation about y through (0, 0.05, 0) m",
        ),
        # two ball joints: it turns about the line between them
        (
            [ao.Support(CORNER), ao.Support(OTHER)],
            "rotation about (0.873, 0.218, 0.436) through (0.2, 0.05, 0.1) m",
        ),
    ],
)
def test_a_box(supports, words):
    assert told(box(), SOLID, supports) == words


@pytest.mark.sample
@pytest.mark.parametrize(
    ("held", "words"),
    [
        (("x", "y"), "rotation about z through (0, 0, 0) m"),
        ("y", "translation along x and rotation about z through (0, 0, 0) m"),
        (("y", "rz"), "translation along x"),
        ("all", ""),
    ],
)
def test_a_beam_in_a_plane(held, words):
    x = np.column_stack([np.linspace(0, 1, 5), np.zeros(5)])
    cells = np.column_stack([np.arange(4), np.arange(1, 5)])
    mesh = ao.read_mesh(compat.create_mesh(MPI.COMM_WORLD, cells, x, "interval", 1))
    beam = ao.Beam(70e9, 0.3, 2700.0, ao.Section.rectangle(0.01, 0.02))
    assert told(mesh, beam, [ao.Support(at(x=0.0), held)]) == words
