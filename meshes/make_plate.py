"""Make the perforated plate, a plane sheet of quadratic triangles: plate.msh (in m).

Three round holes and a slot; its four sides are the group "edges".

     ______________________
    |   _                  |
    |  (_)   (====)    _   |
    |                 (_)  |
    |______(_)_____________|
"""

from __future__ import annotations

from pathlib import Path

import gmsh

HERE = Path(__file__).resolve().parent

# All lengths in m; the origin is a corner.
LENGTH, WIDTH = 0.30, 0.20
HOLES = [(0.055, 0.140, 0.020), (0.235, 0.075, 0.025), (0.100, 0.045, 0.015)]  # x, y, radius
SLOT = (0.120, 0.200, 0.135, 0.012)  # from x to x, at y, radius of its ends
SIZE, FINE = 0.016, 0.007  # of the elements: in general; at the holes


def main(folder: Path = HERE) -> None:
    """Write plate.msh to `folder`."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 2)
        model()
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(folder / "plate.msh"))
    finally:
        gmsh.finalize()


def model() -> None:
    """Build the plate as one face of the current gmsh model, in the plane z = 0."""
    occ = gmsh.model.occ
    discs = [(2, occ.addDisk(x, y, 0, r, r)) for x, y, r in HOLES]
    left, right, y, r = SLOT
    discs += [(2, occ.addDisk(x, y, 0, r, r)) for x in (left, right)]
    discs.append((2, occ.addRectangle(left, y - r, 0, right - left, 2 * r)))
    plate = [(2, occ.addRectangle(0, 0, 0, LENGTH, WIDTH))]
    occ.cut(plate, discs)
    occ.synchronize()
    sides, holes = [], []
    for _, curve in gmsh.model.getEntities(1):
        box = gmsh.model.getBoundingBox(1, curve)
        flat = [
            abs(box[i] - at) + abs(box[i + 3] - at) < 1e-5
            for i, at in ((0, 0), (0, LENGTH), (1, 0), (1, WIDTH))
        ]
        (sides if any(flat) else holes).append(curve)
    (face,) = (tag for _, tag in gmsh.model.getEntities(2))
    for dim, name, tags in ((2, "plate", [face]), (1, "edges", sides), (1, "holes", holes)):
        gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), SIZE)
    gmsh.model.mesh.setSize(gmsh.model.getBoundary([(1, c) for c in holes], combined=False), FINE)


if __name__ == "__main__":
    main()
