"""Supports by a ball, a box and a plane."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
import parts

pytestmark = pytest.mark.fem
SOLID = ao.Solid(70e9, 0.33, 2700.0)


def fixed(**where) -> np.ndarray:
    return ao.Structure(parts.box(), SOLID, [ao.Support(**where)]).fixed


def by_function(where) -> np.ndarray:
    return ao.Structure(parts.box(), SOLID, [ao.Support(where)]).fixed


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    return parts.box().dolfinx.geometry.x


@pytest.mark.slow
def test_regions_select_what_functions_of_coordinates_do(x):
    low, high = x.min(axis=0), x.max(axis=0)
    middle = (low + high) / 2
    radius = 0.4 * float(np.linalg.norm(high - low))
    ball = by_function(lambda p: np.linalg.norm(p - low[:, None], axis=0) <= radius)
    np.testing.assert_array_equal(fixed(near=(low, radius)), ball)
    box = by_function(lambda p: (p <= middle[:, None] + 1e-12).all(axis=0))
    np.testing.assert_array_equal(fixed(box=(low, middle)), box)
    plane = by_function(lambda p: np.isclose(p[0], low[0]))
    np.testing.assert_array_equal(fixed(plane=(low, (-3, 0, 0))), plane)
    assert 0 < len(plane) < len(box)


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
