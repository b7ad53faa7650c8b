"""Make the stiffened panel, a curved skin on stringers and frames: panel.msh, skin.msh (in m).

The skin is a part of a cylinder about the x axis. Stringers run along it, frames around it, both
inside. In panel.msh they are blades, faces that share edges with the skin and with each other; in
skin.msh the groups of the same names are the lines of the skin on which they stand, for beams.

       skin     ______
            .--'      '--.
          .' |    |    |  '.      stringers: radial blades along x
         /   '    '    '    \\     frames: rings across x
"""

from __future__ import annotations

from itertools import chain
from math import cos, radians, sin
from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

# All lengths in m, angles in degrees from the z axis.
RADIUS, LENGTH, ARC = 1.2, 0.9, 36.0
STRINGERS, HEIGHT = (-10.0, 0.0, 10.0), 0.025
FRAMES, DEPTH = (0.3, 0.6), 0.040
SIZE = 0.045  # of the elements


def main(folder: Path = HERE, size: float = SIZE) -> None:
    """Write panel.msh and skin.msh to `folder`, with elements of `size` m."""
    for build, name in ((with_blades, "panel.msh"), (with_lines, "skin.msh")):
        gmsh.initialize(readConfigFiles=False)
        try:
            gmsh.option.setNumber("General.Verbosity", 2)
            build()
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)
            gmsh.option.setNumber("Mesh.ElementOrder", 2)
            gmsh.model.mesh.generate(2)
            gmsh.write(str(folder / name))
        finally:
            gmsh.finalize()


def with_blades() -> None:
    """Skin, stringers and frames as faces that share their edges."""
    occ = gmsh.model.occ
    blades = []
    for angle in STRINGERS:
        line = occ.addLine(point(0, RADIUS - HEIGHT, angle), point(0, RADIUS, angle))
        blades.append(occ.extrude([(1, line)], LENGTH, 0, 0)[1])
    for x in FRAMES:
        inner, outer = (arc(x, radius) for radius in (RADIUS - DEPTH, RADIUS))
        ends = [gmsh_ends(curve) for curve in (inner, outer)]
        sides = [occ.addLine(ends[0][k], ends[1][k]) for k in (0, 1)]
        loop = occ.addCurveLoop([outer[0], sides[1], inner[0], sides[0]])
        blades.append((2, occ.addPlaneSurface([loop])))
    groups = fragments([skin()], blades)
    name_groups(2, groups)


def with_lines() -> None:
    """The skin, cut along the lines of its stiffeners."""
    occ = gmsh.model.occ
    lines = [
        (1, occ.addLine(point(0, RADIUS, angle), point(LENGTH, RADIUS, angle)))
        for angle in STRINGERS
    ]
    lines += [(1, arc(x, RADIUS)[0]) for x in FRAMES]
    groups = fragments([skin()], lines)
    name_groups(1, groups)


def skin() -> tuple[int, int]:
    """The cylindrical face."""
    return gmsh.model.occ.extrude([(1, arc(0, RADIUS)[0])], LENGTH, 0, 0)[1]


def point(x: float, radius: float, angle: float) -> int:
    """A point of the cylinder."""
    a = radians(angle)
    return gmsh.model.occ.addPoint(x, radius * sin(a), radius * cos(a))


def arc(x: float, radius: float) -> tuple[int, int, int]:
    """(the arc around the x axis, its two end points)."""
    start, end = (point(x, radius, side * ARC / 2) for side in (-1, 1))
    centre = gmsh.model.occ.addPoint(x, 0, 0)
    return gmsh.model.occ.addCircleArc(start, centre, end), start, end


def gmsh_ends(curve: tuple[int, int, int]) -> tuple[int, int]:
    """The end points of an arc."""
    return curve[1], curve[2]


def fragments(
    sheet: list[tuple[int, int]], others: list[tuple[int, int]]
) -> tuple[list[int], list[int], list[int]]:
    """Join everything along common lines: the tags of skin, stringers and frames after that."""
    _, pieces = gmsh.model.occ.fragment(sheet, others)
    gmsh.model.occ.synchronize()
    parts = [sorted({tag for _, tag in piece}) for piece in pieces]
    count = len(STRINGERS)
    return parts[0], [*chain(*parts[1 : 1 + count])], [*chain(*parts[1 + count :])]


def name_groups(dim: int, groups: tuple[list[int], list[int], list[int]]) -> None:
    """Physical groups of the parts, and of the skin's edges: curved "ends", straight "sides"."""
    faces, stringers, frames = groups
    ends, sides = [], []
    for _, curve in gmsh.model.getBoundary([(2, face) for face in faces], oriented=False):
        box = gmsh.model.getBoundingBox(1, curve)
        if any(abs(box[0] - x) + abs(box[3] - x) < 1e-5 for x in (0, LENGTH)):
            ends.append(curve)
        elif (
            any(
                abs(box[k] - side * RADIUS * sin(radians(ARC / 2))) < 1e-5
                for k in (1, 4)
                for side in (-1, 1)
            )
            and box[4] - box[1] < 1e-5
        ):
            sides.append(curve)
    named = [(2, "skin", faces), (dim, "stringers", stringers), (dim, "frames", frames)]
    for d, name, tags in [*named, (1, "ends", ends), (1, "sides", sides)]:
        gmsh.model.setPhysicalName(d, gmsh.model.addPhysicalGroup(d, tags), name)


if __name__ == "__main__":
    main()
