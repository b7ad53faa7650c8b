"""Fields at the nodes of every kind of cells, in the order of VTK."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.fem.platform import compat
from antiosc.fem.structure import Placement
from antiosc.fem.structure.structure import on_mesh
from antiosc.fields.fields import outer_faces
from antiosc.recovery import mesh_fields
from antiosc.recovery.place import Reach
from assemblies import BEAM, SOLID, box, line
from sheets import SHEET, sheet

pytestmark = pytest.mark.filterwarnings("ignore:the compliance under a point load")


#: Simplices that fill a cell, by its vertices.
SIMPLICES: dict[str, list[tuple[int, ...]]] = {
    "quadrilateral": [(0, 1, 2), (0, 2, 3)],
    "hexahedron": [
        *((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6)),
        *((0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),
    ],
}


PLANE = ao.Solid(70e9, 0.3, 2700.0, plane="stress", thickness=0.01)
TURNED = Placement((0.3, -0.2, 0.4), (1, 2, -1), 1.1, about=(0.1, 0.0, 0.2))


def square(cell: str, order: int, gdim: int):
    return sheet(2, lambda s, t: (0.3 * s, 0.2 * t, 0 * s)[:gdim], cell, order)


#: (structure, measure of all cells, measure of the outer faces: of sheets the cells)
PARTS = {
    "hexahedra": lambda: ao.Structure(box((0, 0, 0), (0.3, 0.2, 0.1), (3, 2, 1)), SOLID, order=1),
    "tetrahedra": lambda: ao.Structure(
        box((0, 0, 0), (0.3, 0.2, 0.1), (3, 2, 1), "tetrahedron"), SOLID, order=2
    ),
    "triangles": lambda: ao.Structure(square("triangle", 1, 2), PLANE, order=1),
    "curved triangles": lambda: ao.Structure(square("triangle", 2, 2), PLANE),
    "curved quadrilaterals": lambda: ao.Structure(square("quadrilateral", 2, 2), PLANE),
    "shell": lambda: ao.Structure(square("triangle", 2, 3), SHEET),
    "quadrilateral shell": lambda: ao.Structure(square("quadrilateral", 1, 3), SHEET),
    "beam": lambda: ao.Structure(line((0, 0, 0), (0.3, 0.2, 0.1), 3), BEAM),
}
KINDS = {
    "hexahedra": "hexahedron", "tetrahedra": "tetra", "triangles": "triangle",
    "curved triangles": "triangle6", "curved quadrilaterals": "quad9", "shell": "triangle6",
    "quadrilateral shell": "quad", "beam": "line",
}  # fmt: skip
#: Ends of the edges between which VTK's mid-side nodes lie, after the corners.
MIDDLES = {"triangle6": [(0, 1), (1, 2), (2, 0)], "quad9": [(0, 1), (1, 2), (2, 3), (3, 0)]}


def field(x: np.ndarray) -> np.ndarray:
    """An affine displacement (n, 3)."""
    A = np.array([[1.0, 2.0, -1.0], [0.5, -1.0, 3.0], [2.0, 1.0, 1.0]])
    return x @ A.T + [0.1, -0.2, 0.3]


def shapes(part: ao.Structure, turn: np.ndarray) -> np.ndarray:
    """Dofs (rows, 2) of `field`, along the axes of a part that stands turned, and of zero."""
    form = on_mesh(part).form
    u = np.zeros((part.rows, 2))
    for axis, name in enumerate("xyz"):
        if name in form.components:
            dofs, x = compat.dof_coordinates(form.space, form.components[name])
            u[dofs, 0] = (field(x) @ turn)[:, axis]
    return u


def volume(points: np.ndarray, cells: np.ndarray, shape: str, corners: int) -> float:
    """Of cells by their corners in turn, cut into simplices; all of one orientation."""
    cut = SIMPLICES.get(shape, [tuple(range(corners))])
    x = points[cells[:, np.array(cut)]].reshape(-1, len(cut[0]), 3)
    sides = x[:, 1:] - x[:, :1]
    if sides.shape[1] == 3:
        signed = np.linalg.det(sides) / 6
        assert (signed > 0).all() or (signed < 0).all() or shape == "tetrahedron"
        return float(np.abs(signed).sum())
    return float(np.sqrt(np.linalg.det(sides @ sides.transpose(0, 2, 1))).sum() / sides.shape[1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the supports leave:antiosc.base.errors.AntioscWarning")
@pytest.mark.parametrize("name", list(PARTS))
def test_nodes_and_cells_in_the_order_of_vtk(name):
    part = PARTS[name]()
    mesh = on_mesh(part).mesh
    flat = mesh.gdim == 2
    points, ((kind, cells),), found = mesh_fields.at_nodes(part, shapes(part, np.eye(3)))
    assert kind == KINDS[name]
    exact = field(points) * (np.arange(3) < mesh.gdim)
    np.testing.assert_allclose(found[:, :, 0], exact, atol=1e-12)
    assert not found[:, :, 1].any()
    corners = len(mesh.geometry.corners)
    size = volume(points, cells, mesh.cell, corners)
    exact_size = {1: np.sqrt(0.14), 2: 0.06, 3: 0.006}[mesh.tdim]
    assert size == pytest.approx(exact_size)
    for k, (i, j) in enumerate(MIDDLES.get(kind, [])):
        middle = (points[cells[:, i]] + points[cells[:, j]]) / 2
        np.testing.assert_allclose(points[cells[:, corners + k]], middle, atol=1e-12)
    with pytest.raises(ao.InputError, match="part"):
        mesh_fields.at_nodes(part, shapes(part, np.eye(3)), "a")
    if mesh.tdim == 1:
        return
    points, blocks, moved = mesh_fields.at_nodes(part, shapes(part, np.eye(3)))
    faces = outer_faces(blocks)
    shape = "triangle" if faces.shape[1] == 3 else "quadrilateral"
    outer = volume(points, faces, shape, faces.shape[1])
    assert outer == pytest.approx(0.22 if mesh.tdim == 3 else 0.06)
    assert moved.shape == (len(points), 3, 2)
    x = np.array([0.11, 0.07, 0.0 if mesh.tdim == 2 else 0.05])
    at = mesh_fields.at_point(part, shapes(part, np.eye(3)), x, None, Reach("the point"))
    np.testing.assert_allclose(at[:, 0], field(x[None])[0][: 2 if flat else 3], atol=1e-12)


@pytest.mark.slow
def test_parts_of_an_assembly_lie_in_their_places():
    """A turned block: points and vectors of all parts, or of the one named."""
    both = ao.assemble({"block": PARTS["hexahedra"]()}, at={"block": TURNED})
    R = TURNED.rotation
    u = np.zeros((both.size, 1))
    member = both.layout.members["block"]
    form = member.part.form
    for axis, name in enumerate("xyz"):
        dofs, x = compat.dof_coordinates(form.space, form.components[name])
        u[dofs, 0] = (field(TURNED.placed(x)) @ R)[:, axis]
    for name in (None, "block"):
        points, ((kind, _),), found = mesh_fields.at_nodes(both, u, name)
        assert kind == "hexahedron"
        np.testing.assert_allclose(found[:, :, 0], field(points), atol=1e-12)
    x = TURNED.placed(np.array([[0.1, 0.1, 0.05]]))[0]
    at = mesh_fields.at_point(both, u, x, None, Reach("the point"))
    np.testing.assert_allclose(at[:, 0], field(x[None])[0], atol=1e-12)
