"""The peak force of a soft ball on a rigid flat over that of Hertz's law, at equal work.

Half a ball is pressed on by its middle plane, by CalculiX: a hemisphere bonded to a rigid mass, and
half of a ball between two flats, whose middle plane slides. The rubber is neo-Hookean (volumetric
part K/2 (J - 1)²), or linear in the strain of Green, which does not converge far. Axisymmetric
triangles of degree two with NLGEOM. The depths are those at which Hertz's law has taken the same
work. Takes ten minutes; needs `ccx` (Debian: calculix-ccx).

    python benchmarks/elastoplastic/soft_ball.py [size of the cells at the contact, over the radius]
"""

from __future__ import annotations

import sys

import gmsh
import numpy as np
from finite_strain import forces, lines, listed

DEPTHS = np.array([0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45])
#: Radius in the units of the deck, in which Young's modulus is 1.
RADIUS = 100.0
#: Thickness and width of the flat, over the radius, and its cells.
THICK, WIDE, CELLS = 0.05, 1.3, 80
#: Of the contact: E over the size of a cell, times this.
STIFF = 30.0


def half_ball(size: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 2) and triangles (m, 6) of the lower half of a ball of radius 1 on (0, 0)."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    occ = gmsh.model.occ
    middle, pole, rim = occ.addPoint(0, 1, 0), occ.addPoint(0, 0, 0), occ.addPoint(1, 1, 0)
    sides = [
        occ.addLine(middle, pole),
        occ.addCircleArc(pole, middle, rim),
        occ.addLine(rim, middle),
    ]
    occ.addPlaneSurface([occ.addCurveLoop(sides)])
    occ.synchronize()
    field = gmsh.model.mesh.field
    field.add("MathEval", 1)
    field.setString(1, "F", f"{size} * (1 + 6 * Max(0, Sqrt(x*x + y*y) - 0.3))")
    field.setAsBackgroundMesh(1)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)
    tags, points, _ = gmsh.model.mesh.getNodes()
    _, _, (nodes,) = gmsh.model.mesh.getElements(2)
    gmsh.finalize()
    used, cells = np.unique(nodes, return_inverse=True)
    points = points.reshape(-1, 3)[np.searchsorted(tags, used), :2]
    cells = cells.reshape(-1, 6)
    edges = points[cells[:, 1:3]] - points[cells[:, :1]]
    clockwise = np.linalg.det(edges) < 0
    cells[clockwise] = cells[clockwise][:, [0, 2, 1, 5, 4, 3]]
    return points, cells


def flat(first: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and quadrilaterals (m, 8) of the flat, whose node numbers begin at `first`."""
    across = np.linspace(0, WIDE, 2 * CELLS + 1)
    points = np.array([(x, y) for y in (-THICK, -THICK / 2, 0.0) for x in across])
    row = len(across)
    corners = [0, 2, 2 * row + 2, 2 * row, 1, row + 2, 2 * row + 1, row]
    return points, first + 2 * np.arange(CELLS)[:, None] + np.array(corners)


def rubber(kind: str, nu: float) -> str:
    if kind == "linear":
        return f"*ELASTIC\n1., {nu}\n"
    shear, bulk = 0.5 / (1 + nu), 1 / (3 - 6 * nu)
    return f"*HYPERELASTIC, NEO HOOKE\n{shear / 2:.10g}, {2 / bulk:.10g}\n"


def deck(kind: str, nu: float, bonded: bool, size: float) -> str:
    """The input of a press to `DEPTHS` in turn."""
    points, cells = half_ball(size)
    n, m = len(points), len(cells)
    flat_points, flat_cells = flat(n + 1)
    middle = np.flatnonzero(points[:, 1] > 1 - 1e-9)
    axis = np.flatnonzero(points[:, 0] < 1e-9)
    held = np.union1d(middle, axis) if bonded else axis
    round_ = (np.abs(np.hypot(points[:, 0], points[:, 1] - 1) - 1) < 1e-6) & (points[:, 1] < 0.95)
    under = "".join(
        f"{cell + 1}, S{side + 1}\n"
        for side, ends in enumerate([(0, 1, 3), (1, 2, 4), (2, 0, 5)])
        for cell in np.flatnonzero(round_[cells[:, ends]].all(axis=1))
    )
    top = "".join(f"{m + 1 + i}, S3\n" for i in range(CELLS))
    steps = "".join(
        f"*STEP, NLGEOM, INC=500\n*STATIC\n0.1, 1., 1e-7, 1.\n*BOUNDARY\n"
        f"MIDDLE, 2, 2, {-RADIUS * depth:.10g}\n"
        "*NODE PRINT, NSET=MIDDLE, TOTALS=ONLY, FREQUENCY=100000\nRF\n*END STEP\n"
        for depth in DEPTHS
    )
    return (
        f"*NODE, NSET=BALL\n{lines(RADIUS * points, 1)}"
        f"*NODE, NSET=FLAT\n{lines(RADIUS * flat_points, n + 1)}"
        f"*NSET, NSET=MIDDLE\n{listed(middle + 1)}"
        f"*ELEMENT, TYPE=CAX6, ELSET=BALL\n{lines(cells + 1, 1)}"
        f"*ELEMENT, TYPE=CAX8, ELSET=FLAT\n{lines(flat_cells, m + 1)}"
        f"*MATERIAL, NAME=RUBBER\n{rubber(kind, nu)}*MATERIAL, NAME=HARD\n*ELASTIC\n1., 0.3\n"
        "*SOLID SECTION, ELSET=BALL, MATERIAL=RUBBER\n*SOLID SECTION, ELSET=FLAT, MATERIAL=HARD\n"
        f"*SURFACE, NAME=UP\n{under}*SURFACE, NAME=LOW\n{top}"
        "*SURFACE INTERACTION, NAME=TOUCH\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
        f"{STIFF / (size * RADIUS):.6g}\n"
        "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\nUP, LOW\n"
        f"*BOUNDARY\nFLAT, 1, 2\n{''.join(f'{node + 1}, 1, 1' + chr(10) for node in held)}{steps}"
    )


def more(forces_over_hertz: np.ndarray) -> list[str]:
    """Change of the peak force at equal work, at the depths that Hertz's law has there."""
    depths = DEPTHS[: len(forces_over_hertz)]
    fine = np.linspace(0, depths[-1], 4001)
    force = np.interp(fine, np.append(0, depths), np.append(1, forces_over_hertz)) * fine**1.5
    work = np.append(0, np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(fine)))
    reached = depths[depths**2.5 / 2.5 <= work[-1]]
    peaks = np.interp(reached**2.5 / 2.5, work, force) / reached**1.5
    return [
        f"{depth:g}: {100 * (peak - 1):+.1f} %" for depth, peak in zip(reached, peaks, strict=True)
    ]


def main() -> None:
    size = float(sys.argv[1]) if sys.argv[1:] else 0.03
    for nu in (0.3, 0.48):
        for kind in ("neo-Hookean", "linear"):
            for bonded in (True, False):
                found = np.array(forces(deck(kind, nu, bonded, size)))
                hertz = 4 / 3 * DEPTHS[: len(found)] ** 1.5 / (1 - nu**2) * RADIUS**2
                case = f"nu {nu}, {kind}, {'on a rigid mass' if bonded else 'between flats'}"
                print(f"{case}: {', '.join(more(found / hertz))}", flush=True)


if __name__ == "__main__":
    main()
