"""Tables of a sphere on an elastoplastic half-space with large strains, by CalculiX.

Writes `finite_strain.csv`, with columns of `small_strain.csv`: forces over that at first yield
against x = indentation over that at first yield, of a rigid sphere for several E*/Y; `unlike.csv`
the same of a sphere that is as stiff and yields too, so many times as strong. Axisymmetric
quadrilaterals of degree two with NLGEOM; the rigid sphere is one (no paraboloid) and its nodes move
as they are told.
Needs `ccx` (Debian: calculix-ccx).

    python benchmarks/elastoplastic/finite_strain.py [names of cases]
    python benchmarks/elastoplastic/finite_strain.py elastic    Hertz's force, printed
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from half_space import Case, graded, yield_factor
from truth import HEAD, replaced, widest

HERE = Path(__file__).parent
NU = 0.3
#: E*/Y, and the deepest x
CASES = {
    "E*/Y 50": (50.0, 100.0),
    "E*/Y 100": (100.0, 100.0),
    "E*/Y 244": (244.0, 300.0),
    "E*/Y 500": (500.0, 100.0),
    "E*/Y 1000": (1000.0, 100.0),
    "E*/Y 2000": (2000.0, 100.0),
}
#: Strength of the sphere over that of the half-space, at `SMALL` E*/Y and to the first range.
UNLIKE = {"strength 1.2": 1.2, "strength 1.5": 1.5}
SMALL = 1000.0
#: ranges of x, each with its own grid; it is unloaded from the end of each
RANGES = ((7.0, 100.0), (80.0, 300.0))
START, STEPS = 0.004, 25  # over the end of a range
CELLS, GROWTH, REACH = 14, 1.5, 300.0
#: Of the contact: E over the size of a cell, times this. Pressures of 3 Y take 0.1 % of the depths
#: that are kept; 40 and more did not converge.
STIFF = 10.0
#: Radius of the contact and modulus in the units of the deck: with lengths over the sphere's radius
#: and stresses over E, 0.04 to 0.2 and 1, E*/Y = 500 and more did not converge.
WIDTH, MODULUS = 10.0, 1e5
UNLOADED = np.arange(0.1, 1.6, 0.18)  # over x^0.72
INCREMENTS = 200
CONTROLS = (
    "*CONTROLS, PARAMETERS=TIME INCREMENTATION\n30, 50, 30, 60, 50, 10, , 60, ,\n"
    "0.25, 0.5, 0.75, 0.85, , , 1.5, \n"
)


@dataclass
class Mesh:
    """Nodes (n, 2) and quadrilaterals of eight nodes (m, 8), numbered from 0."""

    points: np.ndarray
    cells: np.ndarray

    @classmethod
    def of_grid(cls, r: np.ndarray, z: np.ndarray) -> Mesh:
        """Rectangles between the lines of r and z, both ascending."""
        fine_r, fine_z = halved(r), halved(z)
        index = np.arange(len(fine_r) * len(fine_z)).reshape(len(fine_z), len(fine_r))
        points = np.stack(np.meshgrid(fine_r, fine_z), -1).reshape(-1, 2)
        corners = [(0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0)]
        rows, columns = 2 * (len(z) - 1), 2 * (len(r) - 1)
        cells = [index[i : rows + i : 2, j : columns + j : 2].ravel() for i, j in corners]
        return cls(points, np.stack(cells, -1))


def halved(lines: np.ndarray) -> np.ndarray:
    middle = 0.5 * (lines[1:] + lines[:-1])
    return np.sort(np.concatenate([lines, middle]))


def sphere(radius: float, width: float, cells: int) -> Mesh:
    """A thin shell that ends with the sphere below, which touches (0, 0)."""
    mesh = Mesh.of_grid(np.linspace(0, width, cells + 1), np.array([0.0, 0.02 * radius]))
    r = mesh.points[:, 0]
    mesh.points[:, 1] += radius - np.sqrt(radius**2 - r**2)
    return mesh


def half_space(widths: np.ndarray, radius: float) -> Mesh:
    """A half-space above whose surface is a paraboloid up to a radius, and flat beyond."""
    mesh = Mesh.of_grid(widths, widths)
    mesh.points[:, 1] += 0.5 * np.minimum(mesh.points[:, 0], radius) ** 2
    return mesh


def lines(rows: np.ndarray, first: int) -> str:
    return "".join(
        f"{first + i}, " + ", ".join(f"{value:.12g}" for value in row) + "\n"
        for i, row in enumerate(rows)
    )


def faces(cells: np.ndarray, side: int) -> str:
    """One side of each of some elements."""
    return "".join(f"{cell}, S{side}\n" for cell in cells)


def deck(strength: float, depths: np.ndarray, radius: float, stronger: float = 0.0) -> str:
    """The input of a press to depths in turn; `radius` is the largest of the contact.

    `strength` is over E; the sphere is so many times `stronger`, 0: rigid.
    """
    size = WIDTH / radius
    widths = graded(1.25 * radius, round(1.25 * CELLS), GROWTH, REACH * radius)
    body, ball = Mesh.of_grid(widths, -widths[::-1]), sphere(1.0, *ball_size(radius))
    moved, under = np.full(len(ball.points), True), np.arange(len(ball.cells))
    if stronger:
        ball = half_space(widths, 2 * radius)
        moved = (ball.points[:, 0] >= widths[-1]) | (ball.points[:, 1] >= widths[-1])
        under = np.arange(round(1.25 * CELLS) + 2)
    n, m = len(body.points), len(body.cells)
    far, deep = body.points[:, 0] >= widths[-1], body.points[:, 1] <= -widths[-1]
    fixed = [f"{i + 1}, 1, 1\n" for i in np.flatnonzero((body.points[:, 0] == 0) | far)]
    fixed += [f"{i + 1}, 2, 2\n" for i in np.flatnonzero(far | deep)]
    axis = np.flatnonzero((ball.points[:, 0] == 0) & ~moved)
    fixed += [f"{n + i + 1}, 1, 1\n" for i in axis]
    top = m - len(widths) + 2 + np.arange(round(1.25 * CELLS) + 2)
    steps = "".join(
        f"*STEP, NLGEOM, INC={INCREMENTS}\n*STATIC\n1., 1., 1e-6, 1.\n{CONTROLS}*BOUNDARY\n"
        f"MOVED, 2, 2, {-size * depth:.12g}\n*NODE PRINT, NSET=MOVED, TOTALS=ONLY,"
        " FREQUENCY=100000\nRF\n*END STEP\n"
        for depth in depths
    )
    return (
        f"*NODE, NSET=BODY\n{lines(size * body.points, 1)}"
        f"*NODE\n{lines(size * ball.points, n + 1)}"
        f"*NSET, NSET=MOVED\n{listed(n + 1 + np.flatnonzero(moved))}"
        f"*ELEMENT, TYPE=CAX8, ELSET=BODY\n{lines(body.cells + 1, 1)}"
        f"*ELEMENT, TYPE=CAX8, ELSET=BALL\n{lines(ball.cells + n + 1, m + 1)}"
        f"{material('BODY', strength)}{material('BALL', stronger * strength)}"
        "*SOLID SECTION, ELSET=BODY, MATERIAL=BODY\n*SOLID SECTION, ELSET=BALL, MATERIAL=BALL\n"
        f"*SURFACE, NAME=LOW\n{faces(top, 3)}"
        f"*SURFACE, NAME=UP\n{faces(m + 1 + under, 1)}"
        "*SURFACE INTERACTION, NAME=TOUCH\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
        f"{MODULUS * STIFF * CELLS / WIDTH:.10g}\n"
        "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\nLOW, UP\n"
        f"*BOUNDARY\n{''.join(fixed)}MOVED, 1, 1\n{steps}"
    )


def listed(nodes: np.ndarray) -> str:
    return "".join(f"{node},\n" for node in nodes)


def material(name: str, strength: float) -> str:
    """A material whose strength is over its modulus, 0: elastic."""
    yields = f"*PLASTIC\n{MODULUS * strength:.10g}, 0\n" if strength else ""
    return f"*MATERIAL, NAME={name}\n*ELASTIC\n{MODULUS}, {NU}\n{yields}"


def ball_size(radius: float) -> tuple[float, int]:
    """Width of the sphere's shell, over its radius, and its cells."""
    width = min(1.6 * radius, 0.95)
    return width, round(2 * CELLS * width / radius)


def forces(text: str, threads: int = 1) -> list[float]:
    """Forces at the depths that were reached."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "press.inp").write_text(text)
        done = subprocess.run(
            ["ccx", "press"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            env={"OMP_NUM_THREADS": str(threads), "PATH": "/usr/bin:/bin"},
        )
        found = (Path(folder) / "press.dat").read_text().splitlines()
        if done.returncode:
            print(done.stdout[-300:], flush=True)
    heads = [i for i, line in enumerate(found) if "total force" in line]
    return [180 * abs(float(found[i + 2].split()[1])) for i in heads]  # of a wedge of 2 degrees


def curves(name: str) -> list[tuple[object, ...]]:
    """Rows of a case."""
    ratio, deepest = CASES.get(name, (SMALL, RANGES[0][1]))
    stronger = UNLIKE.get(name, 0.0)
    modulus = Case(NU, sphere=float(stronger > 0)).modulus
    unit = (np.pi * yield_factor(NU) / (2 * ratio)) ** 2  # indentation at first yield
    scale = 4 / 3 * modulus * unit**1.5
    rows: list[tuple[object, ...]] = []
    for low, high in RANGES:
        if high > deepest:
            break
        back = high - UNLOADED * high**0.72
        x = np.append(np.geomspace(START * high, high, STEPS), back[back > 0])
        radius = np.sqrt(widest(high) * high * unit)
        found = np.array(forces(deck(modulus / ratio, x * unit, radius, stronger)))
        found *= (radius / WIDTH) ** 2 / MODULUS / scale
        for i, (at, force) in enumerate(zip(x, found, strict=False)):
            if i < STEPS and at >= low:
                rows.append(row(name, "load", at, at, force))
            elif i >= STEPS and force > 0.01 * found[STEPS - 1]:
                rows.append(row(name, "unload", high, at, force))
        print(name, high, f"{len(found)} depths, {time.process_time():.0f} s", flush=True)
    return rows


def row(name: str, kind: str, *numbers: float) -> tuple[object, ...]:
    return (name, kind, *(f"{number:.5g}" for number in numbers))


def print_elastic() -> None:
    """Force of a rigid sphere on an elastic half-space over Hertz's, at indentations over R."""
    for depths in ([0.0005, 0.001, 0.002], [0.01, 0.02, 0.04], [0.02, 0.05, 0.1]):
        indentation = np.array(depths)
        radius = 1.15 * np.sqrt(indentation[-1])
        force = np.array(forces(deck(0.0, indentation, radius))) * (radius / WIDTH) ** 2 / MODULUS
        hertz = 4 / 3 * Case(NU).modulus * indentation[: len(force)] ** 1.5
        for at, share in zip(depths, force / hertz, strict=False):
            print(f"{at:g} R: {share:.4f} of Hertz's force", flush=True)


if __name__ == "__main__":
    if sys.argv[1:] == ["elastic"]:
        sys.exit(print_elastic())
    for one in sys.argv[1:] or [*CASES, *UNLIKE]:
        path = HERE / ("unlike.csv" if one in UNLIKE else "finite_strain.csv")
        replaced(one, curves(one), path, HEAD[:5])
