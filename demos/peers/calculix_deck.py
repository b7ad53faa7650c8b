"""A quarter of a plate and of a sphere as a deck of CalculiX with contact between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: nodes of a quadratic tetrahedron of gmsh in the order of C3D10
C3D10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
#: corners of the faces S1 to S4 of C3D10
FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))


@dataclass(frozen=True)
class Blow:
    """A steel sphere on a square plate, clamped along its edges. Lengths in mm, speed in mm/s."""

    half: float = 50.0
    thickness: float = 6.0
    radius: float = 10.0
    speed: float = 1000.0
    E: float = 210e3  # MPa
    nu: float = 0.3
    rho: float = 7.85e-9  # t/mm^3


@dataclass(frozen=True)
class Part:
    """Nodes (n, 3) in mm and quadratic tetrahedra (m, 10), in the order of C3D10."""

    x: Array
    cells: Index

    def faces(self, chosen: NDArray[np.bool_]) -> list[list[int]]:
        """Elements with a face whose corners are all chosen: one list for each of S1 to S4."""
        found = []
        for corners in FACES:
            inside = chosen[self.cells[:, corners]].all(axis=1)
            found.append(np.flatnonzero(inside).tolist())
        return found


def meshed(blow: Blow, kind: str, near: float, far: float, zone: float) -> Part:
    """The quarter of the plate (below z = 0) or of the sphere (above), fine around the origin."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        if kind == "plate":
            occ.addBox(0, 0, -blow.thickness, blow.half, blow.half, blow.thickness)
        else:
            ball = occ.addSphere(0, 0, blow.radius, blow.radius)
            box = occ.addBox(0, 0, 0, *(2 * blow.radius,) * 3)
            occ.intersect([(3, ball)], [(3, box)])
        occ.synchronize()
        field = gmsh.model.mesh.field
        growth = f"{near} + 0.28*Max(0, sqrt(x*x+y*y+z*z) - {zone})"
        one = field.add("MathEval")
        field.setString(one, "F", f"Min({far}, {growth})")
        field.setAsBackgroundMesh(one)
        for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints"):
            gmsh.option.setNumber(f"Mesh.{option}", 0)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(3)
        tags, x, _ = gmsh.model.mesh.getNodes()
        _, nodes = gmsh.model.mesh.getElementsByType(11)
    finally:
        gmsh.finalize()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    cells = number[nodes.reshape(-1, 10).astype(np.int64)][:, C3D10]
    return Part(x.reshape(-1, 3), cells)


def deck(
    blow: Blow, plate: Part, ball: Part, path: Path, *, step: float, duration: float, k: float
) -> None:
    """Write the deck: implicit dynamics in equal steps, linear penalty contact of k N/mm^3."""
    lines: list[str] = []
    shift = len(plate.x)
    for name, part, first in (("PLATE", plate, 0), ("BALL", ball, shift)):
        lines.append(f"*NODE, NSET=N{name}")
        lines += [
            f"{first + i + 1}, {a:.9e}, {b:.9e}, {c:.9e}" for i, (a, b, c) in enumerate(part.x)
        ]
    start = {"PLATE": 0, "BALL": len(plate.cells)}
    for name, part, first in (("PLATE", plate, 0), ("BALL", ball, shift)):
        lines.append(f"*ELEMENT, TYPE=C3D10, ELSET=E{name}")
        for i, cell in enumerate(part.cells):
            lines.append(", ".join(str(n) for n in (start[name] + i + 1, *(cell + first + 1))))
    size = 1e-6
    zone = 0.15 * blow.radius
    for name, part in (("PLATE", plate), ("BALL", ball)):
        near = np.linalg.norm(part.x, axis=1) < zone
        if name == "PLATE":
            surface = near & (np.abs(part.x[:, 2]) < size)
        else:
            distance = np.linalg.norm(part.x - [0, 0, blow.radius], axis=1)
            surface = near & (np.abs(distance - blow.radius) < 1e-6 * blow.radius)
        lines.append(f"*SURFACE, NAME=S{name}, TYPE=ELEMENT")
        for face, elements in enumerate(part.faces(surface), 1):
            lines += [f"{start[name] + i + 1}, S{face}" for i in elements]
    both = np.vstack([plate.x, ball.x])
    sets = {
        "X0": np.abs(both[:, 0]) < size,
        "Y0": np.abs(both[:, 1]) < size,
        "RIM": (both[:, :2].max(axis=1) > blow.half - size) & (np.arange(len(both)) < shift),
    }
    for name, chosen in sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{i + 1}," for i in np.flatnonzero(chosen))]
    lines += [
        "*MATERIAL, NAME=STEEL",
        f"*ELASTIC\n{blow.E}, {blow.nu}",
        f"*DENSITY\n{blow.rho}",
        "*SOLID SECTION, ELSET=EPLATE, MATERIAL=STEEL",
        "*SOLID SECTION, ELSET=EBALL, MATERIAL=STEEL",
        "*BOUNDARY\nX0, 1\nY0, 2\nRIM, 1, 3",
        f"*INITIAL CONDITIONS, TYPE=VELOCITY\nNBALL, 3, {-blow.speed}",
        "*SURFACE INTERACTION, NAME=TOUCH",
        f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{k:g}",
        "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\nSBALL, SPLATE",
        f"*STEP, NLGEOM, INC={int(duration / step) + 10}",
        f"*DYNAMIC, DIRECT, ALPHA=-0.05\n{step:g}, {duration:g}",
        "*CONTACT PRINT, SLAVE=SBALL, MASTER=SPLATE\nCF",
        "*END STEP",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def forces(path: Path) -> tuple[Array, Array]:
    """Times (s) and forces (N) on the quarter that the `.dat` file of CalculiX prints."""
    times, values = [0.0], [0.0]
    lines = path.read_text(encoding="ascii").splitlines()
    for i, line in enumerate(lines):
        if line.strip().startswith("statistics for slave set"):
            times.append(float(line.split()[-1]))
        if line.strip().startswith("total surface force (fx,fy,fz)"):
            values.append(abs(float(lines[i + 2].split()[2])))
    return np.array(times), np.array(values)
