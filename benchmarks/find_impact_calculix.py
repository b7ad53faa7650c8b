"""A blow in signals that CalculiX computed: `*DYNAMIC` of a plate of solid elements.

The plate is clamped at one side and struck by a half-sine force at a node; CalculiX prints the
velocities of four nodes. `find_impact` has the plate as a shell on a mesh of its own. Needs `ccx`
(Debian: calculix-ccx); the deck and its results stay in a temporary folder.

    .venv/bin/python benchmarks/find_impact_calculix.py --help
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
from pathlib import Path

import meshio
import numpy as np

import antiosc as ao
from antiosc.base._types import Array

E, NU, RHO, THICKNESS = 70e9, 0.33, 2700.0, 6e-3
SIDES, CELLS = (0.4, 0.3), (8, 6)
#: Half-sine force: peak [N], duration and start [s]; sampling interval, samples.
PEAK, LASTING, START, DT, SAMPLES = 500.0, 1.2e-3, 6e-4, 5e-5, 120
#: Struck and measured nodes, in cells from the corner.
STRUCK, MEASURED = (5, 3), ((3, 1), (7, 1), (7, 5), (3, 5))
SIGMA = 0.03


def deck(folder: Path) -> tuple[Path, list[int]]:
    """The deck, and the numbers of the measured nodes."""
    n, m = (2 * c + 1 for c in CELLS)  # nodes along the sides, mid-side nodes included
    number = np.arange(1, 3 * n * m + 1).reshape(3, m, n)
    z, y, x = np.meshgrid(
        (np.arange(3) - 1) * THICKNESS / 2, np.linspace(0, SIDES[1], m),
        np.linspace(0, SIDES[0], n), indexing="ij",
    )  # fmt: skip
    used: set[int] = set()
    elements = []
    for j in range(0, m - 1, 2):
        for i in range(0, n - 1, 2):
            c = number[:, j : j + 3, i : i + 3]
            around = [(0, 0), (0, 2), (2, 2), (2, 0)]
            sides = [(0, 1), (1, 2), (2, 1), (1, 0)]
            nodes = [c[k, a, b] for k in (0, 2) for a, b in around]
            nodes += [c[k, a, b] for k in (0, 2) for a, b in sides]
            nodes += [c[1, a, b] for a, b in around]
            elements.append(nodes)
            used.update(int(v) for v in nodes)

    def at(cell: tuple[int, int]) -> int:
        return int(number[2, 2 * cell[1], 2 * cell[0]])

    measured = [at(cell) for cell in MEASURED]
    t = np.linspace(0, LASTING, 61)
    pulse = np.column_stack([t + START, np.sin(np.pi * t / LASTING)])
    pulse = np.vstack([[0.0, 0.0], pulse, [1.0, 0.0]])
    lines = ["*NODE, NSET=ALL"]
    coordinates = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    lines += [f"{k},{','.join(f'{v:.9g}' for v in coordinates[k - 1])}" for k in sorted(used)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=PLATE")
    for k, nodes in enumerate(elements, start=1):
        text = [str(v) for v in (k, *nodes)]
        lines += [",".join(text[:12]) + ",", ",".join(text[12:])]
    clamp = [k for k in sorted(used) if coordinates[k - 1, 0] == 0]
    lines += ["*NSET, NSET=CLAMP", *map(str, clamp), "*NSET, NSET=EYES", *map(str, measured)]
    lines += ["*BOUNDARY", "CLAMP,1,3", "*MATERIAL, NAME=AL", "*ELASTIC", f"{E},{NU}"]
    lines += ["*DENSITY", f"{RHO}", "*SOLID SECTION, ELSET=PLATE, MATERIAL=AL"]
    lines += ["*AMPLITUDE, NAME=PULSE", *(f"{a:.9g},{b:.9g}" for a, b in pulse)]
    lines += [f"*STEP, INC={SAMPLES + 1}", "*DYNAMIC, DIRECT, ALPHA=0", f"{DT},{DT * SAMPLES}"]
    lines += ["*CLOAD, AMPLITUDE=PULSE", f"{at(STRUCK)},3,{-PEAK}"]
    lines += ["*NODE PRINT, NSET=EYES, FREQUENCY=1", "V", "*END STEP"]
    path = folder / "plate.inp"
    path.write_text("\n".join(lines) + "\n")
    return path, measured


def computed(folder: Path) -> Array:
    """Velocities along z (samples, 4) of the measured nodes, by CalculiX."""
    path, measured = deck(folder)
    subprocess.run(["ccx", path.stem], cwd=folder, check=True, capture_output=True, timeout=3000)
    found = []
    for block in path.with_suffix(".dat").read_text().split("velocities")[1:]:
        rows = [line.split() for line in block.splitlines() if re.match(r"\s+\d+\s", line)]
        values = {int(row[0]): float(row[3]) for row in rows}
        found.append([values[k] for k in measured])
    return np.array(found)


def plate(folder: Path) -> ao.Structure:
    """The plate as a shell, on triangles that know nothing of the deck."""
    n, m = 24, 18
    grid = np.meshgrid(np.linspace(0, SIDES[0], n + 1), np.linspace(0, SIDES[1], m + 1))
    x = np.column_stack([grid[0].ravel(), grid[1].ravel(), np.zeros(grid[0].size)])
    a = (np.arange(n) + (n + 1) * np.arange(m)[:, None]).ravel()
    halves = [[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]
    path = folder / "shell.vtu"
    triangles = np.concatenate([np.transpose(half) for half in halves])
    meshio.Mesh(x, [("triangle", triangles)]).write(path)
    shell = ao.Shell(E, NU, RHO, THICKNESS)
    return ao.Structure(ao.read_mesh(path), shell, [ao.Support(lambda x: x[0] < 1e-9)])


def main() -> dict[str, float]:
    """Compute the signals, find the blow, print and return the errors."""

    def point(cell: tuple[int, int]) -> tuple[float, float, float]:
        return cell[0] * SIDES[0] / CELLS[0], cell[1] * SIDES[1] / CELLS[1], 0.0

    with tempfile.TemporaryDirectory() as name:
        signals, part = computed(Path(name)), plate(Path(name))
    spread = SIGMA * signals.std(axis=0)
    signals += spread * np.random.default_rng(0).standard_normal(signals.shape)
    sensors = [ao.Sensor(point(cell), (0, 0, 1), "velocity") for cell in MEASURED]
    # the first increment is printed at its end
    found = ao.find_impact(part, sensors, signals, 1 / DT, direction=(0, 0, -1), modes=40)
    print(found.summary())
    errors = {
        "place over the side": float(np.linalg.norm(found.place - point(STRUCK))) / SIDES[0],
        "peak force": found.peak_force / PEAK - 1,
        "impulse": found.impulse / (PEAK * LASTING * 2 / np.pi) - 1,
        "start [s]": found.start + DT - START,
    }
    print(", ".join(f"{name} {value:.2e}" for name, value in errors.items()))
    return errors


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    main()
