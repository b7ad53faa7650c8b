"""Frames of `.vtu` files read again by meshio: blocks of zlib, kinds of cells, names of fields."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

from antiosc.fem.fields.series import BYTES_AT_ONCE, Frames

#: Points whose coordinates fill less than a block, exactly one, two, and a little more than two.
COUNTS = [9, BYTES_AT_ONCE // 24 + 1, 2 * BYTES_AT_ONCE // 8, 2 * BYTES_AT_ONCE // 8 + 5]


@pytest.mark.sample
@pytest.mark.parametrize("count", COUNTS)
def test_frames_are_read_again(count, tmp_path):
    rng = np.random.default_rng(count)
    points = rng.normal(size=(count, 3))
    cells = [
        ("triangle", rng.integers(0, count, (7, 3))),
        ("line", rng.integers(0, count, (count, 2))),
        ("hexahedron", rng.integers(0, count, (2, 8))),
    ]
    frames = Frames(points, cells)
    for name in ("speed", 'a "field" of <a> & b'):
        fields = {name: rng.normal(size=count), "motion": rng.normal(size=(count, 3))}
        path = tmp_path / "frame.vtu"
        path.write_bytes(frames.content(fields))
        found = meshio.read(path)
        np.testing.assert_array_equal(found.points, points)
        assert [(block.type, block.data.tolist()) for block in found.cells] == [
            (kind, rows.tolist()) for kind, rows in cells
        ]
        assert set(found.point_data) == set(fields)
        for key, values in fields.items():
            np.testing.assert_array_equal(found.point_data[key], values)
