"""Make the bell-crank lever, a plane part of quadratic triangles: lever.msh (in m).

Two arms at a right angle turn about the hub; the long one ends in a round nose.

     _   end
    | |
    | |__________
    | o          )  edge
    '------------
"""

from __future__ import annotations

from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

# All lengths in m; the origin is the axis of the hub.
ARM = 0.120  # from the hub to the centre of the nose, along x
RISE = 0.080  # from the hub to the end of the short arm, along y
HALF = 0.015  # half the width of the arms, and the radius of the nose
HOLE = 0.008  # radius of the hole in the hub
FILLET = 0.012  # radius in the inner corner
SIZE, FINE = 0.005, 0.002  # of the elements: in general; at hole and nose


def main(folder: Path = HERE) -> None:
    """Write lever.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(folder / "lever.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build the lever as one face of the current gmsh model, in the plane z = 0."""
    geo = gmsh.model.geo

    def points(*places: tuple[float, float], size: float = SIZE) -> list[int]:
        return [geo.addPoint(x, y, 0, size) for x, y in places]

    turn = HALF + FILLET
    hub, tip, bend = points((0, 0), (ARM, 0), (turn, turn))
    nose = points((ARM, -HALF), (ARM + HALF, 0), (ARM, HALF), size=FINE)
    inner = points((turn, HALF), (HALF, turn))
    outer = points((HALF, RISE), (-HALF, RISE), (-HALF, -HALF))
    ring = points((HOLE, 0), (0, HOLE), (-HOLE, 0), (0, -HOLE), size=FINE)

    edge = [geo.addCircleArc(nose[i], tip, nose[i + 1]) for i in range(2)]
    end = geo.addLine(outer[0], outer[1])
    hole = [geo.addCircleArc(ring[i - 1], hub, ring[i]) for i in range(4)]
    outline = [
        *edge,
        geo.addLine(nose[2], inner[0]),
        geo.addCircleArc(inner[0], bend, inner[1]),
        geo.addLine(inner[1], outer[0]),
        end,
        geo.addLine(outer[1], outer[2]),
        geo.addLine(outer[2], nose[0]),
    ]
    face = geo.addPlaneSurface([geo.addCurveLoop(outline), geo.addCurveLoop(hole)])
    geo.synchronize()
    groups = [(2, "body", [face]), (1, "clamp", hole), (1, "edge", edge), (1, "end", [end])]
    for dim, name, tags in groups:
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)


if __name__ == "__main__":
    main()
