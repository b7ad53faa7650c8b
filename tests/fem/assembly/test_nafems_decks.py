"""NAFEMS's benchmarks of frequencies from decks: wedges, pyramids, mixed cells, plane and shell.

NAFEMS, The Standard NAFEMS Benchmarks, TNSB Rev. 3 (1990): E = 200 GPa, ν = 0.3, ρ = 8000 kg/m³.
The values were read in the verification manuals that `benchmarks/validation/frequencies.py` names.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
import sheets

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:the supports leave the structure free"),
]

MATERIAL = "*MATERIAL,NAME=M\n*ELASTIC\n200E9,.3\n*DENSITY\n8000.\n"
BULK = "MAT1,1,200.+9,,.3,8000.\n"


def frequencies(part: ao.Structure, count: int, rigid: int = 0) -> np.ndarray:
    """Lowest elastic frequencies in Hz, by SciPy."""
    return sheets.frequencies(part, count + rigid)[rigid:] / (2 * np.pi)


class Grid:
    """Numbered points of a deck, each written once."""

    def __init__(self, place: Callable[[np.ndarray], np.ndarray]) -> None:
        self.place = place
        self.numbers: dict[tuple[float, ...], int] = {}

    def __call__(self, *x: float) -> int:
        return self.numbers.setdefault(tuple(np.round(x, 9)), len(self.numbers) + 1)

    def points(self) -> list[tuple[int, np.ndarray]]:
        return [(n, self.place(np.array(x))) for x, n in self.numbers.items()]

    def where(self, held: Callable[[np.ndarray], bool]) -> list[int]:
        return [n for n, x in self.points() if held(x)]


def abaqus(folder: Path, grid: Grid, cells: dict[str, list[list[int]]], more: str) -> ao.Structure:
    text = "*NODE\n" + "".join(
        f"{n}," + ",".join(f"{c:.12g}" for c in x) + "\n" for n, x in grid.points()
    )
    number = 0
    for kind, rows in cells.items():
        text += f"*ELEMENT,TYPE={kind},ELSET=ALL\n"
        for row in rows:
            number += 1
            words = [str(number), *map(str, row)]
            text += ",\n".join(",".join(words[k : k + 12]) for k in range(0, len(words), 12)) + "\n"
    path = folder / "part.inp"
    path.write_text(text + MATERIAL + more)
    return ao.read_model(path)


def middles(grid: Grid, corners: list[np.ndarray], edges: list[tuple[int, int]]) -> list[int]:
    nodes = [grid(*x) for x in corners]
    return nodes + [grid(*((corners[a] + corners[b]) / 2)) for a, b in edges]


TRIANGLE = [(0, 1), (1, 2), (2, 0)]
QUAD = [(0, 1), (1, 2), (2, 3), (3, 0)]
WEDGE = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
BRICK = [*QUAD, *((a + 4, b + 4) for a, b in QUAD), *((k, k + 4) for k in range(4))]
AROUND = [(0, 0), (1, 0), (1, 1), (0, 1)]


def flat(grid: Grid, n: tuple[int, int], kinds: str) -> tuple[list[list[int]], list[list[int]]]:
    """(quadrilaterals of 8 nodes, triangles of 6) of the unit square; kinds by turns."""
    quads, triangles = [], []
    for i, j in product(range(n[0]), range(n[1])):
        x = [np.array([(i + a) / n[0], (j + b) / n[1]]) for a, b in AROUND]
        if kinds[(i + j) % len(kinds)] == "q":
            quads.append(middles(grid, x, QUAD))
        else:
            halves = ((0, 1, 2), (0, 2, 3))
            triangles += [middles(grid, [x[k] for k in half], TRIANGLE) for half in halves]
    return quads, triangles


def solid(grid: Grid, n: tuple[int, int, int], kinds: str) -> dict[str, list[list[int]]]:
    """Bricks of 20 nodes, wedges of 15 and pyramids of 5 of the unit cube; kinds by turns."""
    cells: dict[str, list[list[int]]] = {"C3D20": [], "C3D15": [], "C3D5": []}
    faces = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
    for i, j, k in product(*map(range, n)):
        corners = [(i + a, j + b, k + c) for c in (0, 1) for a, b in AROUND]
        x = [np.array(corner) / n for corner in corners]
        kind = kinds[(i + j) % len(kinds)]
        if kind == "h":
            cells["C3D20"].append(middles(grid, x, BRICK))
        elif kind == "w":
            halves = ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))
            cells["C3D15"] += [middles(grid, [x[v] for v in half], WEDGE) for half in halves]
        else:
            top = np.mean(x, axis=0)
            cells["C3D5"] += [middles(grid, [*(x[v] for v in face), top], []) for face in faces]
    return {kind: rows for kind, rows in cells.items() if rows}


@pytest.mark.parametrize("kinds", ["t", "qt"])
def test_fv12_a_free_plate_of_triangles_beside_quadrilaterals(tmp_path, kinds):
    grid = Grid(lambda x: 10 * x)
    quads, triangles = flat(grid, (6, 6), kinds)
    text = "".join(f"GRID,{n},,{x[0]:.9f},{x[1]:.9f},0.\n" for n, x in grid.points())
    cells = [("CQUAD4", row[:4]) for row in quads] + [("CTRIA3", row[:3]) for row in triangles]
    text += "".join(
        f"{name},{k},1,{','.join(map(str, row))}\n" for k, (name, row) in enumerate(cells, 1)
    )
    path = tmp_path / "part.bdf"
    path.write_text(text + BULK + "PSHELL,1,1,.05,1,,1\n")
    found = frequencies(ao.read_model(path), 6, rigid=6)
    published = np.array([1.622, 2.360, 2.922, 4.233, 4.233, 7.416])
    np.testing.assert_allclose(found, published, rtol=0.011)


MEMBRANE = [44.623, 130.03, 162.70, 246.05, 379.90, 391.44]


@pytest.mark.parametrize("kinds", ["q", "t", "qt"])
def test_fv32_a_tapered_membrane(tmp_path, kinds):
    grid = Grid(lambda x: np.array([10 * x[0], (x[1] - 0.5) * (5 - 4 * x[0])]))
    quads, triangles = flat(grid, (16, 8), kinds)
    cells = {k: rows for k, rows in (("CPS8", quads), ("CPS6", triangles)) if rows}
    more = "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n.05\n*BOUNDARY\n"
    more += "".join(f"{n},1,2\n" for n in grid.where(lambda x: x[0] < 1e-9))
    part = abaqus(tmp_path, grid, cells, more)
    np.testing.assert_allclose(frequencies(part, 6), MEMBRANE, rtol=1e-3)


@pytest.mark.parametrize(
    ("kinds", "n", "bounds"),
    [("h", (4, 4, 1), 0.03), ("w", (8, 8, 2), 0.05), ("hwp", (8, 8, 2), 0.05)],
)
def test_fv52_a_thick_plate_of_solids(tmp_path, kinds, n, bounds):
    """Bricks on the mesh of the source; a line support of a solid has no limit, so that the finer
    mesh that wedges and pyramids need has lower frequencies of bending."""
    grid = Grid(lambda x: np.array([10, 10, 1]) * x)
    cells = solid(grid, n, kinds)

    def held(x):
        on_edge = np.isclose(x[:2], 0).any() or np.isclose(x[:2], 10).any()
        return bool(on_edge and x[2] < 1e-9)

    more = "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n*BOUNDARY\n"
    more += "".join(f"{n},3,3\n" for n in grid.where(held))
    found = frequencies(abaqus(tmp_path, grid, cells, more), 7, rigid=3)
    published = [44.762, 110.52, 110.52, 169.08, 193.93, 206.64, 206.64]
    np.testing.assert_allclose(found, published, rtol=bounds)
    assert found[0] == pytest.approx(published[0], rel=0.02)
