"""Make the space frame, a small tower of lines: frame.msh (in m).

Four columns on feet, two storeys, each with a ring of beams at its top and one brace in every wall.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

WIDTH, DEPTH = 1.0, 0.8  # footprint along x and y, m
STOREYS = (0.0, 0.7, 1.3)  # heights of the floors, m
SIZE = 0.1  # of the elements, m


def main(folder: Path = HERE) -> None:
    """Write frame.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
        gmsh.model.mesh.generate(1)
        gmsh.write(str(folder / "frame.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build the tower as lines of the current gmsh model, joined at common points."""
    geo = gmsh.model.geo
    corners = [(0, 0), (WIDTH, 0), (WIDTH, DEPTH), (0, DEPTH)]
    floors = [[geo.addPoint(x, y, z) for x, y in corners] for z in STOREYS]
    columns, beams, braces = [], [], []
    for below, above in pairwise(floors):
        for i in range(4):
            columns.append(geo.addLine(below[i], above[i]))
            beams.append(geo.addLine(above[i - 1], above[i]))
            braces.append(geo.addLine(below[i - 1], above[i]))
    geo.synchronize()
    lines = [(1, "columns", columns), (1, "beams", beams), (1, "braces", braces)]
    points = [(0, "feet", floors[0]), (0, "top", floors[-1])]
    for dim, name, tags in lines + points:
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)


if __name__ == "__main__":
    main()
