"""One curved layer of second-order hexahedra locks in bending, and that is told."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.fem.mesh.soundness import bends
from antiosc.fem.platform import compat

pytestmark = pytest.mark.fem

#: Nodes of a C3D20 in half cells along the arc, across it and along its axis.
NODES = np.array([
    *((0, 2, 0), (2, 2, 0), (2, 0, 0), (0, 0, 0), (0, 2, 2), (2, 2, 2), (2, 0, 2), (0, 0, 2)),
    *((1, 2, 0), (2, 1, 0), (1, 0, 0), (0, 1, 0), (1, 2, 2), (2, 1, 2), (1, 0, 2), (0, 1, 2)),
    *((0, 2, 1), (2, 2, 1), (2, 0, 1), (0, 0, 1)),
])  # fmt: skip
RADIUS, THICKNESS = 20.0, 1.0


def quarter(folder, along: int, across: int = 1):
    """(a quarter of a ring, clamped at one end, the factor of its stiffness that is told or 1)."""
    number: dict[tuple[int, ...], int] = {}
    elements = []
    for i in range(along):
        for j in range(across):
            corner = np.array([2 * i, 2 * j, 0])
            places = [tuple(map(int, corner + node)) for node in NODES]
            elements.append([number.setdefault(place, len(number) + 1) for place in places])
    text = "*NODE\n"
    for (i, j, k), n in number.items():
        angle, r = np.pi * i / along / 4, RADIUS + THICKNESS * (j / across - 1) / 2
        text += f"{n},{float(r * np.cos(angle))!r},{float(r * np.sin(angle))!r},{3 * k}\n"
    text += "*ELEMENT,TYPE=C3D20,ELSET=E\n"
    for n, nodes in enumerate(elements, 1):
        words = list(map(str, [n, *nodes]))
        text += ",".join(words[:11]) + ",\n" + ",".join(words[11:]) + "\n"
    text += (
        "*MATERIAL,NAME=M\n*ELASTIC\n2.1e5,.3\n*DENSITY\n7.85e-9\n*SOLID SECTION,ELSET=E,MATERIAL="
    )
    text += "M\n*NSET,NSET=F\n" + "".join(f"{n},\n" for p, n in number.items() if p[0] == 0)
    path = folder / "ring.inp"
    path.write_text(text + "*BOUNDARY\nF,1,3\n")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        part = ao.read_model(path, "mm")
    factors = [re.search(r"factor of up to (\S+);", str(one.message)) for one in told]
    return part, next((float(one[1]) for one in factors if one), 1.0)


def lowest(part) -> float:
    """The lowest frequency: the ring is wider than thick, and bends in its plane."""
    return float(ao.natural_modes(part, 1).frequency[0])


def test_the_factor_that_is_told_is_that_of_the_stiffness(tmp_path):
    """f² of 3 and 4 cells over that of 24, which do not lock: nothing is told of these."""
    fine, none = quarter(tmp_path, 24)
    assert none == 1.0
    for along in (3, 4):
        part, factor = quarter(tmp_path, along)
        assert (lowest(part) / lowest(fine)) ** 2 == pytest.approx(factor, rel=0.1)
    assert quarter(tmp_path, 4, across=2)[1] == 1.0


@pytest.mark.parametrize("axis", range(3))
def test_the_bend_is_the_height_of_the_arc_over_the_thickness(axis):
    corners = {(i, j, k): i + 2 * j + 4 * k for i in (0, 1) for j in (0, 1) for k in (0, 1)}
    x = np.zeros((27, 3))
    for place, v in corners.items():
        x[v] = place
    for vertices, node in compat.nodes_between("hexahedron"):
        x[node] = x[vertices].mean(axis=0)
    along = (axis + 1) % 3
    x[:, axis] += 0.3 * 4 * x[:, along] * (1 - x[:, along])
    cells = np.arange(27)[None]
    np.testing.assert_allclose(bends(x, cells), [0.3], rtol=1e-12)
    other = x + np.eye(3)[axis]  # a second layer on it
    nodes = np.vstack([x, other])
    lower, upper = np.arange(27), np.arange(27, 54)
    for n in range(27):
        same = np.flatnonzero(np.abs(other - x[n]).max(axis=1) < 1e-9)
        upper[same] = lower[n]
    assert bends(nodes, np.stack([lower, upper])).tolist() == [0.0, 0.0]
