"""Make the arch, a plane part of quadratic quadrilaterals: arch.msh (in m).

Half a ring on two feet, in the plane z = 0 with its centre at the origin.
"""

from __future__ import annotations

from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

INNER, OUTER = 0.080, 0.100  # radii, m
ACROSS, ALONG = 3, 36  # elements across the ring and along it


def main(folder: Path = HERE) -> None:
    """Write arch.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(folder / "arch.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build the arch as two faces, each a quarter ring, of the current gmsh model."""
    geo = gmsh.model.geo
    centre = geo.addPoint(0, 0, 0)
    steps = [(1, 0), (0, 1), (-1, 0)]
    inside = [geo.addPoint(INNER * x, INNER * y, 0) for x, y in steps]
    outside = [geo.addPoint(OUTER * x, OUTER * y, 0) for x, y in steps]
    across = [geo.addLine(a, b) for a, b in zip(inside, outside, strict=True)]
    low = [geo.addCircleArc(inside[i], centre, inside[i + 1]) for i in range(2)]
    top = [geo.addCircleArc(outside[i], centre, outside[i + 1]) for i in range(2)]
    faces = []
    for i in range(2):
        loop = geo.addCurveLoop([across[i], top[i], -across[i + 1], -low[i]])
        faces.append(geo.addPlaneSurface([loop]))
    geo.synchronize()

    for curve in across:
        gmsh.model.mesh.setTransfiniteCurve(curve, ACROSS + 1)
    for curve in low + top:
        gmsh.model.mesh.setTransfiniteCurve(curve, ALONG // 2 + 1)
    for face in faces:
        gmsh.model.mesh.setTransfiniteSurface(face)
        gmsh.model.mesh.setRecombine(2, face)
    feet = [across[0], across[2]]
    for dim, name, tags in [(2, "body", faces), (1, "clamp", feet), (1, "edge", top)]:
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)


if __name__ == "__main__":
    main()
