"""Make the tank head, surfaces from a STEP file: tank.step (in mm), tank.msh (in m) by tank.geo.

A 2:1 ellipsoidal head with a short skirt and a round manhole beside its pole. tank.geo, written
by hand, names the edges of tank.step.

        ___(  )__
     .-'         '-.
    /               \\
    |               |  skirt
"""

from __future__ import annotations

from math import pi
from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

# All lengths in mm, as in the STEP file; the axis is z, the rim lies at z = 0.
RADIUS, SKIRT = 300, 60
HOLE, OFFSET = 60, 110  # radius of the manhole, and its distance from the axis along x


def main(folder: Path = HERE) -> None:
    """Write tank.step and tank.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.write(str(folder / "tank.step"))
        gmsh.clear()
        gmsh.open(str(HERE / "tank.geo"))  # takes the tank.step beside it
        gmsh.model.mesh.generate(2)
        gmsh.write(str(folder / "tank.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build head and skirt as faces of the current gmsh model, in mm."""
    occ = gmsh.model.occ
    meridian = (1, occ.addEllipse(0, 0, 0, RADIUS, RADIUS / 2, angle1=0, angle2=pi / 2))
    occ.rotate([meridian], 0, 0, 0, 1, 0, 0, pi / 2)  # from the x-y plane to x-z
    occ.translate([meridian], 0, 0, SKIRT)
    side = (1, occ.addLine(occ.addPoint(RADIUS, 0, 0), occ.addPoint(RADIUS, 0, SKIRT)))
    head, skirt = turned(meridian), turned(side)
    drill = (3, occ.addCylinder(OFFSET, 0, SKIRT, 0, 0, RADIUS, HOLE))
    head, _ = occ.cut(head, [drill])
    occ.fragment(head, skirt)
    occ.synchronize()


def turned(curve: tuple[int, int]) -> list[tuple[int, int]]:
    """The surface that a curve sweeps around z, in two halves: meshers stumble over closed ones."""
    occ = gmsh.model.occ
    first = [e for e in occ.revolve([curve], 0, 0, 0, 0, 0, 1, pi) if e[0] == 2]
    second = occ.copy(first)
    occ.rotate(second, 0, 0, 0, 0, 0, 1, pi)
    return first + second


if __name__ == "__main__":
    main()
