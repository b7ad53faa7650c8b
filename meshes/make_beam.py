"""Make the beam, a line of 1 m along x with its middle named: beam.msh (in m)."""

from __future__ import annotations

from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

LENGTH = 1.0  # m
ELEMENTS = 20


def main(folder: Path = HERE) -> None:
    """Write beam.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.model.mesh.generate(1)
        gmsh.write(str(folder / "beam.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build the beam as two lines of the current gmsh model, so that its middle is a node."""
    geo = gmsh.model.geo
    left, middle, right = (geo.addPoint(x, 0, 0) for x in (0, LENGTH / 2, LENGTH))
    lines = [geo.addLine(left, middle), geo.addLine(middle, right)]
    geo.synchronize()
    for line in lines:
        gmsh.model.mesh.setTransfiniteCurve(line, ELEMENTS // 2 + 1)
    ends = [(0, "left", [left]), (0, "middle", [middle]), (0, "right", [right])]
    for dim, name, tags in [(1, "beam", lines), *ends]:
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)


if __name__ == "__main__":
    main()
