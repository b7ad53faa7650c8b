"""What strikes and what is struck, in quadratic tetrahedra. Lengths in mm, masses in t."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path

import gmsh
import numpy as np
from numpy.typing import NDArray

from antiosc.fem.mesh.reading import straightened

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

ROOT = Path(__file__).resolve().parents[2]
#: nodes of a quadratic tetrahedron of gmsh in the order of C3D10
C3D10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
#: corners of the faces S1 to S4 of C3D10
FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
#: growth of the elements with the distance from the contact
GROWTH = 0.28


@dataclass(frozen=True)
class Material:
    """Young's modulus (MPa), Poisson's ratio, density (t/mm^3)."""

    E: float
    nu: float
    rho: float


STEEL = Material(210e3, 0.3, 7.85e-9)
ALUMINIUM = Material(70e3, 0.33, 2.7e-9)


@dataclass(frozen=True)
class Body:
    """A meshed body.

    Attributes
    ----------
    x : (n, 3), nodes in mm.
    cells : (m, 10), quadratic tetrahedra in the order of C3D10.
    material : of all cells.
    touched : (n,), nodes of the surface that may touch.
    held : nodes (n,) and the numbers of the first and the last direction held there, from 1.
    """

    x: Array
    cells: Index
    material: Material
    touched: Mask
    held: list[tuple[Mask, int, int]]

    def faces(self) -> list[list[int]]:
        """Elements with a face that may touch: one list for each of the faces S1 to S4."""
        corners = np.stack([self.cells[:, face] for face in FACES], axis=1)  # (m, 4, 3)
        _, index, count = np.unique(
            np.sort(corners.reshape(-1, 3), axis=1), axis=0, return_inverse=True, return_counts=True
        )
        outside = (count[index.ravel()] == 1).reshape(-1, 4)
        chosen = outside & self.touched[corners].all(axis=2)
        return [np.flatnonzero(chosen[:, face]).tolist() for face in range(4)]


@dataclass(frozen=True)
class Blow:
    """A steel sphere strikes a part.

    Attributes
    ----------
    part, ball : the bodies; or one of several equal pieces of each, cut by planes of symmetry.
    pieces : their number.
    point, direction : where the sphere strikes (mm), and along which unit vector.
    radius, speed : of the sphere, mm and mm/s.
    other_radii : principal radii of the struck surface there, mm.
    patch : radius over which antiosc spreads the force, mm.
    """

    part: Body
    ball: Body
    pieces: int
    point: Array
    direction: Array
    radius: float
    speed: float
    other_radii: tuple[float, float]
    patch: float


def plate(near: float, *, half: float = 50.0, thickness: float = 6.0) -> Blow:
    """A quarter of a clamped square steel plate, struck at its centre by a sphere of 10 mm, 1 m/s.

    `near` is the size of the elements at the contact, mm.
    """
    radius, small = 10.0, 1e-6

    def box() -> None:
        gmsh.model.occ.addBox(0, 0, -thickness, half, half, thickness)

    def quarter() -> None:
        occ = gmsh.model.occ
        ball = occ.addSphere(0, 0, radius, radius)
        occ.intersect([(3, ball)], [(3, occ.addBox(0, 0, 0, *(2 * radius,) * 3))])

    point = np.zeros(3)
    with meshing():
        x, cells = meshed(box, point, near, far=6.0, zone=0.7)
        planes = [(np.abs(x[:, i]) < small, i + 1, i + 1) for i in (0, 1)]
        rim = x[:, :2].max(axis=1) > half - small
        top = (np.linalg.norm(x, axis=1) < 1.5) & (np.abs(x[:, 2]) < small)
        part = Body(x, cells, STEEL, top, [*planes, (rim, 1, 3)])
        x, cells = meshed(quarter, point, near, far=4.0, zone=0.7)
        planes = [(np.abs(x[:, i]) < small, i + 1, i + 1) for i in (0, 1)]
        ball = Body(x, cells, STEEL, on_sphere(x, point, np.array([0, 0, radius]), 1.5), planes)
    down = np.array([0.0, 0.0, -1.0])
    return Blow(part, ball, 4, point, down, radius, 1000.0, (np.inf, np.inf), 1.0)


def bracket(near: float, *, angle: float = 35.0) -> Blow:
    """The aluminium bracket, struck on its eye along the normal by a sphere of 10 mm at 2 m/s.

    The eye is a cylinder of 18 mm along x through (0, 30, 60) mm; `angle` (degrees) is that of the
    struck point from its top, at x = 25 mm, where the sphere clears the wall. `near` is the
    size of the elements at the contact, mm.
    """
    radius, eye, axis = 10.0, 18.0, np.array([30.0, 60.0])
    outward = np.array([0.0, sin(radians(angle)), cos(radians(angle))])
    point = np.array([25.0, *axis]) + eye * outward
    centre = point + radius * outward
    clamped = np.zeros(0, dtype=bool)

    def whole() -> None:
        gmsh.open(str(ROOT / "meshes" / "bracket.geo"))  # in metres

    with meshing():
        x, cells = meshed(whole, point, near, far=18 * near, zone=1.0, unit=1e3)
        (clamp,) = (
            tag
            for d, tag in gmsh.model.getPhysicalGroups(2)
            if gmsh.model.getPhysicalName(d, tag) == "clamp"
        )
        clamped = np.isin(tags_of_nodes(), gmsh.model.mesh.getNodesForPhysicalGroup(2, clamp)[0])
        outside = np.abs(np.linalg.norm(x[:, 1:] - axis, axis=1) - eye) < 1e-4 * eye
        near_point = np.linalg.norm(x - point, axis=1) < 1.2
        part = Body(x, cells, ALUMINIUM, outside & near_point, [(clamped, 1, 3)])

        def sphere() -> None:
            gmsh.model.occ.addSphere(*centre, radius)

        x, cells = meshed(sphere, point, near, far=18 * near, zone=1.0)
        ball = Body(x, cells, STEEL, on_sphere(x, point, centre, 1.2), [])
    return Blow(part, ball, 1, point, -outward, radius, 2000.0, (eye, np.inf), 2.0)


def on_sphere(x: Array, point: Array, centre: Array, within: float) -> Mask:
    """Nodes on the surface of the sphere through the point, not farther from it than `within`."""
    radius = np.linalg.norm(centre - point)
    surface = np.abs(np.linalg.norm(x - centre, axis=1) - radius) < 1e-6 * radius
    return np.asarray(surface & (np.linalg.norm(x - point, axis=1) < within))


@contextmanager
def meshing() -> Iterator[None]:
    """A session of gmsh that says nothing."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield
    finally:
        gmsh.finalize()


def meshed(
    build: Callable[[], None],
    point: Array,
    near: float,
    far: float,
    zone: float,
    unit: float = 1.0,
) -> tuple[Array, Index]:
    """Nodes (mm) and tetrahedra of the body that `build` makes, fine around the point.

    `unit` is the unit of length of what is built, mm.
    """
    gmsh.clear()
    build()
    gmsh.model.occ.synchronize()
    field = gmsh.model.mesh.field
    near, far, zone = near / unit, far / unit, zone / unit
    distance = "+".join(f"({axis}-({c}))^2" for axis, c in zip("xyz", point / unit, strict=True))
    growth = f"{near} + {GROWTH}*Max(0, sqrt({distance}) - {zone})"
    size = field.add("MathEval")
    field.setString(size, "F", f"Min({far}, {growth})")
    field.setAsBackgroundMesh(size)
    for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", far)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.model.mesh.generate(3)
    tags = tags_of_nodes()
    x = gmsh.model.mesh.getNodes()[1].reshape(-1, 3)
    nodes = gmsh.model.mesh.getElementsByType(11)[1]
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    cells = number[nodes.reshape(-1, 10).astype(np.int64)][:, C3D10]
    return straightened(x * unit, cells, "tetrahedron"), cells


def tags_of_nodes() -> NDArray[np.uint64]:
    """Of all nodes, in the order of `meshed`."""
    return np.asarray(gmsh.model.mesh.getNodes()[0])
