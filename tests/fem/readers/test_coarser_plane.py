"""Axisymmetric meshes that are made coarser: their boundaries, supports and materials remain."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.io.deck import Block
from antiosc_decks.coarser import Plane

pytest.importorskip("gmsh")
INNER, OUTER, HEIGHT = 1.0, 2.0, 0.6
COLUMNS, ROWS = 50, 30


def grid(bulge: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and cells of a rectangle whose upper side is bent up by an arc of a parabola."""
    r = INNER + (OUTER - INNER) * np.arange(COLUMNS + 1) / COLUMNS
    share = np.arange(ROWS + 1) / ROWS
    top = HEIGHT + bulge * 4 * (r - INNER) * (OUTER - r)
    points = np.stack(
        [
            np.repeat(r[:, None], ROWS + 1, axis=1),
            top[:, None] * share,
            np.zeros((len(r), ROWS + 1)),
        ]
    )
    number = np.arange(points[0].size).reshape(points[0].shape)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]])
    return points.reshape(3, -1).T, cells.reshape(4, -1).T


def plane_of(points: np.ndarray, cells: np.ndarray, **options: np.ndarray) -> Plane:
    none = np.zeros((len(cells), 0), dtype=np.int64)
    block = Block("quad", "CAX4", cells, none, none)
    kinds = options.get("kinds", np.zeros(len(cells), dtype=np.int64))
    marks = options.get("marks", np.zeros((len(points), 0), dtype=bool))
    return Plane.of([block], points, kinds, marks)


@pytest.mark.parametrize("bulge", [0.0, 0.5])
@pytest.mark.parametrize("turned", [False, True])
def test_fewer_cells_have_the_volume_of_its_closed_form(bulge, turned):
    points, cells = grid(bulge)
    coarse = plane_of(points, cells[:, ::-1] if turned else cells).coarser(0.15, 150)
    assert 20 <= len(coarse.cells) <= 150
    # ∫ (height + 4 bulge (r - 1) (2 - r)) r dr from 1 to 2
    exact = HEIGHT * (OUTER**2 - INNER**2) / 2 + bulge
    assert coarse.moment() == pytest.approx(exact, rel=2e-3 if bulge else 1e-12)
    sides = coarse.points[coarse.cells]
    across = np.cross(np.roll(sides, -1, axis=1) - sides, np.roll(sides, 1, axis=1) - sides)
    assert (across > 0).all()  # all corners are convex


def test_cells_stay_within_their_material():
    points, cells = grid()
    left = points[cells, 0].mean(axis=1) < 1.3
    coarse = plane_of(points, cells, kinds=left.astype(np.int64)).coarser(0.15, 200)
    assert (left[coarse.within] == (coarse.points[coarse.cells, 0].mean(axis=1) < 1.3)).all()
    corners = coarse.points[coarse.cells, 0]
    assert ((corners < 1.3 + 1e-9).all(axis=1) | (corners > 1.3 - 1e-9).all(axis=1)).all()


def test_supports_end_where_those_of_the_file_end():
    points, cells = grid()
    held = (points[:, 1] == 0) & (points[:, 0] <= 1.26 + 1e-9)
    coarse = plane_of(points, cells, marks=held[:, None]).coarser(0.15, 200)
    x = coarse.points[coarse.nodes(held)]
    assert (x[:, 1] == 0).all()
    assert (x[:, 0].min(), x[:, 0].max()) == pytest.approx((INNER, 1.26))
    below = (coarse.points[:, 1] < 1e-9) & (coarse.points[:, 0] < 1.26 + 1e-9)
    assert len(x) == below.sum() >= 3


def test_a_hole_stays_open():
    points, cells = grid()
    middle = points[cells].mean(axis=1)
    kept = np.hypot(middle[:, 0] - 1.5, middle[:, 1] - 0.3) > 0.15
    plane = plane_of(points, cells[kept])
    coarse = plane.coarser(0.1, 400)
    assert coarse.moment() == pytest.approx(plane.moment(), rel=1e-9)  # a staircase of corners
    centres = coarse.points[coarse.cells].mean(axis=1)
    assert (np.hypot(centres[:, 0] - 1.5, centres[:, 1] - 0.3) > 0.12).all()


def test_larger_cells_are_taken_where_there_would_be_too_many():
    assert len(plane_of(*grid()).coarser(0.02, 60).cells) <= 60
