"""What supports leave free is told, in words that mechanics gives by hand."""

from __future__ import annotations

import warnings

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts

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


BODY = ao.Solid(70e9, 0.33, 2700.0)


def fixed(**where) -> np.ndarray:
    return ao.Structure(parts.box(), BODY, [ao.Support(**where)]).fixed


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    return parts.box().dolfinx.geometry.x


def test_what_lies_outside_by_a_millionth_belongs_to_it(x):
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    low = x.min(axis=0)
    exact = fixed(plane=(low, (1, 0, 0)))
    for share, same in ((0.9e-6, True), (1.1e-6, False)):
        off = low - [share * size, 0, 0]
        for where in (
            {"plane": (off, (1, 0, 0))},
            {"box": (off - size, [off[0], size, size])},
        ):
            if same:
                np.testing.assert_array_equal(fixed(**where), exact)
            else:
                with pytest.raises(ao.InputError, match="fixes nothing"):
                    fixed(**where)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ({}, "near, box or plane be given; got None"),
        ({"where": "left", "near": ((0, 0, 0), 1)}, "takes one of where, near, box, plane"),
        ({"near": (0, 0, 0)}, r"near must be a pair \(point, radius\)"),
        ({"near": ((0, 0, 0), -1)}, "the radius of near must be >= 0"),
        ({"box": ((0, 0, 1), (1, 1, 0))}, "lower corner .* above the upper corner"),
        ({"plane": ((0, 0, 0), (0, 0, 0))}, "must not be the zero vector"),
        ({"plane": ((0, 0, 0), "z")}, "normal"),
        ({"near": ((9, 9, 9), 1e-3)}, r"within 0.001 m of \(9, 9, 9\) m fixes nothing.*spans \(0"),
        ({"box": ((5, 5, 5), (6, 6, 6))}, r"in the box from \(5, 5, 5\) m to"),
        ({"plane": ((0, 0, 7), (0, 0, 1))}, r"on the plane through \(0, 0, 7\) m across"),
    ],
)
def test_bad_regions_are_refused_in_words(where, message):
    with pytest.raises(ao.InputError, match=message):
        fixed(**where)
