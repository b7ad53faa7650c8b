"""k0 of a block on structured meshes: the estimate of its error against the true one.

The block of 120 x 60 x 20 mm is clamped at one end, the patch has a radius of 12 mm. The truth is
extrapolated from three meshes of hexahedra of degree 2 with the order that they show.
"""

from __future__ import annotations

import dolfinx
import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import antiosc as ao

SIZE = (0.12, 0.06, 0.02)
SITE = ao.Site((0.08, 0.03, 0.02), (0, 0, -1), radius=0.012)
STEEL = ao.Solid(E=210e9, nu=0.3, rho=7850.0)
#: Cells through the thickness of the meshes that are extrapolated.
NESTED = (2, 4, 6)
#: (cells, degree, cells through the thickness) of the rows of the table.
ROWS = (
    ("tetrahedron", 1, 4),
    ("hexahedron", 1, 4),
    ("tetrahedron", 2, 2),
    ("tetrahedron", 2, 3),
    ("hexahedron", 2, 2),
    ("hexahedron", 2, 3),
)


def model(cell: str, order: int, cells: int) -> ao.AntiOscillators:
    """The block with cubes, or cubes of tetrahedra, so many through the thickness."""
    kind = getattr(dolfinx.mesh.CellType, cell)
    count = [6 * cells, 3 * cells, cells]
    block = dolfinx.mesh.create_box(MPI.COMM_WORLD, [np.zeros(3), np.array(SIZE)], count, kind)
    held = ao.Support(plane=((0, 0, 0), (1, 0, 0)))
    part = ao.Structure(ao.read_mesh(block), STEEL, [held], order=order)
    return ao.extract(part, SITE, n=2, error="estimate")


def extrapolated(values: list[float], sizes: list[float]) -> tuple[float, float]:
    """(limit, order) of three values that converge as a power of the sizes."""

    def off(p: float) -> float:
        a, b, c = (size**p for size in sizes)
        return (values[0] - values[1]) * (b - c) - (values[1] - values[2]) * (a - b)

    p = brentq(off, 0.2, 8.0)
    a, b = sizes[1] ** p, sizes[2] ** p
    return (values[2] * a - values[1] * b) / (a - b), p


def table() -> str:
    """What was found, in Markdown."""
    fine = [model("hexahedron", 2, cells) for cells in NESTED]
    truth, order = extrapolated([each.k0 for each in fine], [1 / cells for cells in NESTED])
    lines = [
        f"k0 = {truth:.5g} N/m, order {order:.2g} (hexahedra of degree 2 with {NESTED} cells "
        "through the thickness).",
        "",
        "| cells | degree | dofs | k0 raw / true - 1 | effectivity |",
        "|---|---|---|---|---|",
    ]
    for cell, degree, cells in ROWS:
        found = model(cell, degree, cells)
        effectivity = (found.k0 - found.corrected().k0) / (found.k0 - truth)
        off = 100 * (found.k0 / truth - 1)
        lines.append(
            f"| {cell} | {degree} | {found.info['dofs']} | {off:.2g} % | {effectivity:.2f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
