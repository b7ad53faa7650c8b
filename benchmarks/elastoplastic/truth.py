"""Tables of an elastoplastic sphere on a half-space by small-strain finite elements.

Writes `small_strain.csv`: for each case (Poisson's ratio, hardening, elastic sphere) the force
over that at first yield against x = indentation over that at first yield, and unloading from some
depths. One curve of x serves all E*/Y as long as strains are small. A case takes some minutes.

    python benchmarks/elastoplastic/truth.py [names of cases]
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import numpy as np
from half_space import Case, Grid, Pressed

PATH = Path(__file__).parent / "small_strain.csv"
HEAD = ("case", "row", "from_x", "x", "force", "radius2", "volume")
CASES = {
    "rigid": Case(),
    "alike": Case(sphere=1.0),
    "hardening": Case(hardening=0.02),
    "nu 0.45": Case(nu=0.45),
    "nu 0.2": Case(nu=0.2),
    "steel on aluminium": Case(nu=0.33, sphere=3.0),
    "hardening alike": Case(sphere=1.0, hardening=0.02),
    "nu 0.4": Case(nu=0.4),
    "soft sphere": Case(sphere=0.35),
    "hardening E/200": Case(hardening=0.005),
}
#: ranges of x, each with its own grid, and the depths from which it is unloaded
RANGES = [
    (0.7, 3.0, (1.5, 2.0, 3.0)),
    (2.5, 30.0, (6.0, 10.0, 30.0)),
    (25.0, 300.0, (60.0, 100.0, 300.0)),
]
BEYOND = (250.0, 1000.0, (1000.0,))
CELLS, STEPS = 48, 1.13
DEPTH = 1e-8  # at first yield


def widest(x: float) -> float:
    """Squared contact radius over R and the indentation, a little above what is found."""
    return min(2.4, 1.0 + 0.16 * np.log(x + 1) ** 1.15)


class Rows:
    """Rows of the table of a case."""

    def __init__(self, name: str, cells: int) -> None:
        self.case, self.name, self.cells = CASES[name], name, cells
        self.scale = 4 / 3 * self.case.modulus * DEPTH**1.5
        self.rows: list[tuple[object, ...]] = []

    def add(self, kind: str, *numbers: float) -> None:
        self.rows.append((self.name, kind, *(f"{number:.5g}" for number in numbers)))

    def press(self, low: float, high: float, depths: tuple[float, ...]) -> None:
        grid = Grid(np.sqrt(widest(high) * high * DEPTH), self.cells)
        body = Pressed(self.case, grid, self.case.yield_strength(DEPTH))
        many = int(np.log(high / 0.7) / np.log(STEPS)) + 1
        for x in np.unique(np.append(np.geomspace(0.7, high, many), depths)):
            force = body.press(x * DEPTH) / self.scale
            radius = (int(body.state.pressing.sum()) - 0.5) * grid.r[1]
            if x >= low:
                self.add("load", x, x, force, radius**2 / DEPTH, 0.0)
            if x in depths:
                self.unload(body, x, force)

    def unload(self, body: Pressed, top: float, force: float) -> None:
        """Unload, and come back to the state of before."""
        kept = body.state, body.depth, body.force
        for share in np.arange(0.05, 1.6, 0.06):
            x = top - share * top**0.72
            if x <= 0:
                break
            try:
                now = body.press(x * DEPTH, 3) / self.scale
            except ArithmeticError:  # next to nothing presses any more
                break
            if now < 0.01 * force:
                break
            radius, volume = body.crater()
            self.add("unload", top, x, now, radius**2 / DEPTH, volume / DEPTH**2)
        body.state, body.depth, body.force = kept


def curves(name: str, cells: int = CELLS) -> list[tuple[object, ...]]:
    rows = Rows(name, cells)
    for each in [*RANGES, *([BEYOND] if name == "rigid" else [])]:
        rows.press(*each)
        print(name, each[1], f"{time.process_time():.0f} s", flush=True)
    return rows.rows


def replaced(
    name: str,
    rows: list[tuple[object, ...]],
    path: Path = PATH,
    head: tuple[str, ...] = HEAD,
) -> None:
    """Write the rows of a case into the file, in place of its old ones."""
    kept: list[tuple[object, ...]] = []
    if path.exists():
        with path.open() as file:
            kept = [tuple(row) for row in csv.reader(file) if row[0] not in ("case", name)]
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(kept + rows)


def main(names: list[str]) -> None:
    for name in names:
        replaced(name, curves(name))


if __name__ == "__main__":
    main(sys.argv[1:] or list(CASES))
