"""Decks of quadrilaterals with a few triangles: both stay, and a blow on their seam feels both."""

from __future__ import annotations

from pathlib import Path

import pytest

import antiosc as ao

pytestmark = pytest.mark.fem
LONG, WIDE, SIZE = 10, 6, 0.02
#: The cell that is halved in one of the decks, and its first corner.
HALVED, CORNER = (6, 3), (6 * SIZE, 3 * SIZE, 0.0)


def plate(folder: Path, halved: bool) -> ao.Structure:
    """A plate of S4 that is clamped at x = 0; one cell may be two S3."""
    lines = ["*NODE"]
    lines += [
        f"{1 + i + j * (LONG + 1)}, {i * SIZE}, {j * SIZE}, 0."
        for j in range(WIDE + 1)
        for i in range(LONG + 1)
    ]
    quads, triangles = [], []
    for i in range(LONG):
        for j in range(WIDE):
            a = 1 + i + j * (LONG + 1)
            around = (a, a + 1, a + LONG + 2, a + LONG + 1)
            if halved and (i, j) == HALVED:
                triangles += [around[:3], (around[0], *around[2:])]
            else:
                quads.append(around)
    count = 0
    for kind, cells in (("S4", quads), ("S3", triangles)):
        lines += [f"*ELEMENT, TYPE={kind}, ELSET=ALL"] * bool(cells)
        for nodes in cells:
            count += 1
            lines.append(", ".join(map(str, (count, *nodes))))
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "2e11, 0.3", "*DENSITY", "7800."]
    lines += ["*SHELL SECTION, ELSET=ALL, MATERIAL=STEEL", "0.004", "*BOUNDARY"]
    lines += [f"{1 + j * (LONG + 1)}, 1, 6" for j in range(WIDE + 1)]
    path = folder / "plate.inp"
    path.write_text("\n".join(lines))
    return ao.read_model(path)


@pytest.mark.slow
def test_triangles_beside_quadrilaterals_stay(tmp_path):
    """As few dofs as quadrilaterals alone; mass, k0 on the seam and the first frequency agree."""
    whole, mixed = plate(tmp_path, False), plate(tmp_path, True)
    assert mixed.dofs <= 1.1 * whole.dofs
    assert mixed.mass == pytest.approx(whole.mass)
    site = ao.Site(CORNER, (0, 0, 1.0))
    k0, same = (ao.extract(part, site, n=4).k0 for part in (mixed, whole))
    assert k0 == pytest.approx(same, rel=1e-3)
    first, other = (ao.natural_modes(part, 1).frequency[0] for part in (mixed, whole))
    assert first == pytest.approx(other, rel=1e-4)
