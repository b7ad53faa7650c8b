"""A plate that stretches in CalculiX, *DYNAMIC with NLGEOM, and here: time and error of both.

A clamped steel plate of 300 × 200 × 1 mm is struck off its centre by 0.2 kg at 1.5 m/s, and
deflects by more than its thickness. In CalculiX (Debian package calculix-ccx) it has one layer of
C3D20R, the mass is a node and its law a nonlinear spring. Errors are those against CalculiX with
the finest mesh.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/peers/stretched_plate.py [--page PAGE]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))

import antiosc as ao
from sheets import sheet

Array = NDArray[np.float64]
A, B, THICK = 0.3, 0.2, 1e-3
E, NU, RHO = 210e9, 0.3, 7850.0
AT = 0.1, 0.075
MASS, SPEED, K, DURATION = 0.2, 1.5, 1e6, 8e-3
#: Cells and steps of CalculiX; the last is the reference. Cells of ours, shells.
RUNS = ((12, 8), 100), ((12, 8), 200), ((24, 16), 200)
OURS = (12, 8), (24, 16)
#: Corners of a brick in half cells, then the middles of its edges, in the order of C3D20R.
CORNERS = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)])
CORNERS = np.vstack([CORNERS, CORNERS + np.array([0, 0, 2])])
AROUND = [(0, 1), (1, 2), (2, 3), (3, 0)]
EDGES = [*AROUND, *((i + 4, j + 4) for i, j in AROUND), *((i, i + 4) for i in range(4))]
BRICK = np.vstack([CORNERS, [(CORNERS[i] + CORNERS[j]) // 2 for i, j in EDGES]])
#: Largest approach [m] of the law's table, and its points; CalculiX 2.20 reads 200 at most.
DEEPEST, POINTS = 8e-3, 150
#: Distance [m] of the striker, so that its spring does not turn.
AWAY = 1.0
HEAD = """# A plate that stretches: CalculiX beside it

Written by `benchmarks/peers/stretched_plate.py`: a clamped steel plate of 300 × 200 × 1 mm, struck
off its centre by 0.2 kg at 1.5 m/s, on one core. Errors are those against the last line of
CalculiX, itself not converged: the coarser mesh deflects by 2.4 % less. Ours: model + impact.

| program | cells | steps | peak force | deflection | error of force | of deflection | time |
|---|---|---|---|---|---|---|---|
"""


@dataclass
class Run:
    """What one program found: N, m, s."""

    program: str
    cells: tuple[int, int]
    steps: str
    force: float
    moved: float
    spent: str

    def row(self, known: Run) -> str:
        force, moved = self.force / known.force - 1, self.moved / known.moved - 1
        return (
            f"| {self.program} | {self.cells[0]} × {self.cells[1]} | {self.steps} |"
            f" {self.force:.2f} N | {1e3 * self.moved:.4f} mm | {force:+.2%} | {moved:+.2%} |"
            f" {self.spent} |"
        )


def bricks(cells: tuple[int, int]) -> tuple[Array, NDArray[np.int64]]:
    """Nodes and quadratic bricks of the plate, one layer."""
    number: dict[tuple[int, ...], int] = {}
    elements = []
    for i in range(cells[0]):
        for j in range(cells[1]):
            keys = [tuple(map(int, BRICK[k] + (2 * i, 2 * j, 0))) for k in range(20)]
            elements.append([number.setdefault(key, len(number)) for key in keys])
    size = np.array([A / cells[0], B / cells[1], THICK]) / 2
    return np.array(list(number)) * size, np.array(elements)


def deck(cells: tuple[int, int], steps: int) -> Iterator[str]:
    """The lines of the deck; nodes of the site and the striker are AT."""
    x, elements = bricks(cells)
    top = (*AT, THICK)
    site, striker = int(np.argmin(np.linalg.norm(x - top, axis=1))) + 1, len(x) + 1
    assert np.allclose(x[site - 1], top)
    yield "*NODE, NSET=ALL"
    for i, point in enumerate([*x, (*AT, THICK + AWAY)], 1):
        yield f"{i}, " + ", ".join(f"{value:.10e}" for value in point)
    yield "*ELEMENT, TYPE=C3D20R, ELSET=PLATE"
    for i, element in enumerate(elements + 1, 1):
        yield f"{i}, " + ", ".join(map(str, element[:10])) + ","
        yield ", ".join(map(str, element[10:]))
    count = len(elements)
    yield f"*ELEMENT, TYPE=MASS, ELSET=BALL\n{count + 1}, {striker}\n*MASS, ELSET=BALL\n{MASS}"
    yield f"*ELEMENT, TYPE=SPRINGA, ELSET=LAW\n{count + 2}, {site}, {striker}"
    yield "*SPRING, ELSET=LAW, NONLINEAR"
    for deep in DEEPEST * np.linspace(1, 0, POINTS) ** 2:
        yield f"{-K * deep**1.5:.10e}, {-deep:.10e}"
    yield "0.0, 1.0"
    yield f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{E}, {NU}\n*DENSITY\n{RHO}"
    yield "*SOLID SECTION, ELSET=PLATE, MATERIAL=STEEL"
    rim = np.isclose(x[:, 0] * (A - x[:, 0]), 0) | np.isclose(x[:, 1] * (B - x[:, 1]), 0)
    yield "*NSET, NSET=RIM"
    yield from (f"{i}," for i in np.flatnonzero(rim) + 1)
    yield f"*NSET, NSET=AT\n{site}, {striker}"
    yield f"*BOUNDARY\nRIM, 1, 3\n{striker}, 1, 2"
    yield f"*INITIAL CONDITIONS, TYPE=VELOCITY\n{striker}, 3, {-SPEED}"
    yield f"*STEP, NLGEOM, INC={2 * steps}\n*DYNAMIC, DIRECT, ALPHA=-0.05"
    yield f"{DURATION / steps:.10e}, {DURATION:.10e}"
    yield "*NODE PRINT, NSET=AT, FREQUENCY=1\nU\n*END STEP"


def calculix(cells: tuple[int, int], steps: int) -> Run:
    """Run the deck; force by the law, from both displacements."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.inp"
        path.write_text("\n".join(deck(cells, steps)) + "\n", encoding="ascii")
        start = time.perf_counter()
        subprocess.run(["ccx", "-i", "plate"], cwd=folder, check=True, capture_output=True)
        spent = time.perf_counter() - start
        lines = path.with_suffix(".dat").read_text(encoding="ascii").splitlines()
    rows = [line.split() for line in lines if line.strip()[:1].isdigit()]
    z = np.array([float(row[3]) for row in rows]).reshape(-1, 2)
    site, striker = -z[:, 0], -z[:, 1]
    force = K * np.maximum(striker - site, 0.0) ** 1.5
    most = float(force.max()), float(site.max())
    return Run("CalculiX, C3D20R", cells, str(len(z)), *most, f"{spent:.0f} s")


def ours(cells: tuple[int, int]) -> Run:
    """The same blow here."""

    def rim(x: Array) -> NDArray[np.bool_]:
        return np.isclose(x[0] * (A - x[0]), 0) | np.isclose(x[1] * (B - x[1]), 0)

    start = time.perf_counter()
    mesh = sheet(cells, lambda s, t: (A * s, B * t, 0 * s))
    part = ao.Structure(mesh, ao.Shell(E, NU, RHO, THICK), [ao.Support(rim)])
    site = ao.Site((*AT, 0.0), (0, 0, -1), snap=True)
    model = ao.extract(part, site, n=40, stretch="auto")
    made = time.perf_counter() - start
    start = time.perf_counter()
    hit = ao.simulate(model, ao.RigidMass(MASS, velocity=SPEED), ao.Power(K, 1.5), DURATION)
    spent = time.perf_counter() - start
    moved = float(np.abs(hit.displacement).max())
    times = f"{made:.1f} s + {1e3 * spent:.0f} ms"
    return Run('antiosc, "auto"', cells, "", hit.peak_force, moved, times)


def main(page: Path | None) -> None:
    """Print the table, and write it."""
    ours(OURS[0])  # compiles its forms
    peers = [calculix(*run) for run in RUNS]
    found = [*peers, *(ours(cells) for cells in OURS)]
    text = HEAD + "\n".join(one.row(peers[-1]) for one in found) + "\n"
    print(text)
    if page is not None:
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--page", type=Path, help="file that the table is written to")
    warnings.simplefilter("ignore")
    main(reader.parse_args().page)
