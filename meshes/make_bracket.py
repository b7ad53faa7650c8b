"""Make the machined bracket: bracket.step (in mm), and bracket.msh (in m) by way of bracket.geo.

A base plate with two bolt holes carries an upright wall with a bored boss; two ribs stiffen it.
bracket.geo, written by hand, names the faces of bracket.step.

    z
    | |==     boss along x, with a bore through it and the wall
    | |\\
    | | \\     two ribs
    |_|__\\___  base plate
    wall     x

Run it with a Python that has gmsh: `.venv/bin/python meshes/make_bracket.py`.
"""

from __future__ import annotations

from math import acos, atan2, cos, hypot, sin
from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

# All lengths in mm, as in the STEP file.
LENGTH, WIDTH, BASE = 84, 60, 10  # base plate along x, y, z
WALL = 12  # thickness of the wall, along x
EYE_Y, EYE_Z = 30, 60  # axis of boss and bore, along x
TOP, BOSS, BORE = 26, 18, 11  # radii of the wall's top, the boss, the bore
FRONT = 28  # where the boss ends, along x
BOLTS = [(64, 14), (64, 46)]  # axes of the bolt holes in x, y
HOLE, HEAD, SINK = 4.5, 9, 3  # radius of the hole; radius and depth of its counterbore
RIBS = [8, 46]  # where the ribs begin, along y
RIB, RIB_END, RIB_TOP = 6, 52, 44  # thickness of the ribs, their reach along x and z
CORNER, FILLET, BOSS_FILLET = 10, 5, 3  # radii


def main(folder: Path = HERE) -> None:
    """Write bracket.step and bracket.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")  # else that of the file read last
        gmsh.write(str(folder / "bracket.step"))
        gmsh.clear()
        gmsh.open(str(HERE / "bracket.geo"))  # takes the bracket.step beside it
        # Elastic: without it a few curved elements at the fillets fold over. `read_mesh`
        # straightens those of a geometry itself; a finished mesh is taken as it stands.
        gmsh.option.setNumber("Mesh.HighOrderOptimize", 3)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(folder / "bracket.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build the bracket as the one volume of the current gmsh model, in mm."""
    occ = gmsh.model.occ
    base = occ.addBox(0, 0, 0, LENGTH, WIDTH, BASE)
    boss = occ.addCylinder(0, EYE_Y, EYE_Z, FRONT, 0, 0, BOSS)
    body, _ = occ.fuse([(3, base)], [wall(), (3, boss)])

    inner_edge = (WALL, 0, BASE, WALL, WIDTH, BASE)
    foot_of_boss = (WALL, EYE_Y - BOSS, EYE_Z - BOSS, WALL, EYE_Y + BOSS, EYE_Z + BOSS)
    body = fillet(body, FILLET, inner_edge)
    body = fillet(body, BOSS_FILLET, foot_of_boss)
    body = fillet(body, CORNER, (LENGTH, 0, 0, LENGTH, 0, BASE))
    body = fillet(body, CORNER, (LENGTH, WIDTH, 0, LENGTH, WIDTH, BASE))

    body, _ = occ.fuse(body, [rib(y) for y in RIBS])
    drills = [occ.addCylinder(-1, EYE_Y, EYE_Z, FRONT + 2, 0, 0, BORE)]
    for x, y in BOLTS:
        drills.append(occ.addCylinder(x, y, -1, 0, 0, BASE + 2, HOLE))
        drills.append(occ.addCylinder(x, y, BASE - SINK, 0, 0, SINK + 1, HEAD))
    occ.cut(body, [(3, drill) for drill in drills])
    occ.synchronize()


def wall() -> tuple[int, int]:
    """The wall: straight flanks from the base's corners, tangent to the round top."""
    occ = gmsh.model.occ
    down, aside = BASE - EYE_Z, -EYE_Y  # from the eye to the foot of a flank
    angle = atan2(down, aside) - acos(TOP / hypot(down, aside))  # of the point of tangency
    dy, z = TOP * cos(angle), EYE_Z + TOP * sin(angle)
    outline = [(0, 0), (0, BASE), (EYE_Y + dy, z), (EYE_Y - dy, z), (WIDTH, BASE), (WIDTH, 0)]
    points = [occ.addPoint(0, y, z) for y, z in outline]
    curves = [occ.addLine(points[i], points[i + 1]) for i in (0, 1, 3, 4)]
    curves.append(occ.addLine(points[5], points[0]))
    curves.insert(2, occ.addCircleArc(points[2], occ.addPoint(0, EYE_Y, EYE_Z), points[3]))
    return extrude(curves, WALL, 0)


def rib(y: float) -> tuple[int, int]:
    """The rib that begins at `y`: a triangle that reaches into the wall and into the base."""
    occ = gmsh.model.occ
    half = WALL / 2, BASE / 2
    corners = [half, (RIB_END, half[1]), (RIB_END, BASE), (WALL, RIB_TOP), (half[0], RIB_TOP)]
    points = [occ.addPoint(x, y, z) for x, z in corners]
    return extrude([occ.addLine(points[i - 1], points[i]) for i in range(len(points))], 0, RIB)


def extrude(curves: list[int], dx: float, dy: float) -> tuple[int, int]:
    """The prism over the face that `curves` bound."""
    occ = gmsh.model.occ
    face = occ.addPlaneSurface([occ.addCurveLoop(curves)])
    return next(entity for entity in occ.extrude([(2, face)], dx, dy, 0) if entity[0] == 3)


def fillet(
    body: list[tuple[int, int]], radius: float, box: tuple[float, ...]
) -> list[tuple[int, int]]:
    """`body` with the edges that lie in `box` (x, y, z of two corners) rounded."""
    gmsh.model.occ.synchronize()
    low, high = [x - 1e-3 for x in box[:3]], [x + 1e-3 for x in box[3:]]
    edges = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*low, *high, 1)]
    return gmsh.model.occ.fillet([tag for _, tag in body], edges, [radius])


if __name__ == "__main__":
    main()
