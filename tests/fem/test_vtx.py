"""Fields at the nodes of every kind of cells, in the orders of VTK and of VTX files."""

from __future__ import annotations

import os

import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.fem.platform import compat
from antiosc.fem.reach import Reach
from antiosc.fem.structure import Placement
from antiosc.fem.structure.structure import on_mesh
from antiosc.recovery import mesh_fields
from assemblies import BEAM, SOLID, box, line
from mpi import run_ranks
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
installed = pytest.mark.skipif(not compat.writes_vtx(), reason="dolfinx without ADIOS2")
TIMES = [0.0, 1e-4, 3e-4]
PROGRAM = """
import sys
import antiosc as ao
held = [ao.Support("clamp")]
part = ao.Structure(ao.read_mesh(sys.argv[2]), ao.Solid(E=210e9, nu=0.3, rho=7850.0), held)
site = ao.Site((1.2, 1.0, 1.0), (0.2, -1, 0.3), snap=True)
hit = ao.simulate(ao.extract(part, site, 4), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), duration=3e-4)
times = [0.0, 1e-4, 3e-4]
for _ in range(2):  # the second takes the place of the first
    print(ao.write_series(part, hit, sys.argv[1] + "/run.bp", times).name)
ao.write_series(part, hit, sys.argv[1] + "/run.pvd", times)
"""


def struck(part):
    site = ao.Site((0.13, 0.06), (0.2, -1), radius=0.035)
    return ao.simulate(ao.extract(part, site, 4), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 3e-4)


def read(path) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """(times, points, displacements at each time) of a `.bp` folder."""
    os.environ["ADIOS2_ALWAYS_USE_MPI"] = "1"  # the library that dolfinx has loaded
    adios2 = pytest.importorskip("adios2")
    with adios2.FileReader(str(path)) as file:
        steps = file.num_steps()
        blocks = range(len(file.all_blocks_info("geometry")[0]))
        time = file.read("step", step_selection=[0, steps])
        points = np.vstack([file.read("geometry", block_id=b) for b in blocks])
        fields = [
            np.vstack(
                [
                    file.read("displacement", block_id=b, step_selection=[k, 1]).reshape(-1, 3)
                    for b in blocks
                ]
            )
            for k in range(steps)
        ]
    return time.ravel(), points, fields


def compare(folder) -> None:
    meshio = pytest.importorskip("meshio")
    time, points, fields = read(folder / "run.bp")
    np.testing.assert_allclose(time, TIMES, atol=1e-12)
    scale = np.abs(fields[-1]).max()
    assert scale > 0
    for k, field in enumerate(fields):
        frame = meshio.read(folder / f"run_{k:04d}.vtu")
        for x, moved in zip(points, field, strict=True):
            nearest = np.argmin(((frame.points - x) ** 2).sum(axis=1))
            expected = frame.point_data["displacement"][nearest]
            np.testing.assert_allclose(moved, expected, atol=1e-9 * scale)


@installed
@pytest.mark.mpi
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_folder_holds_what_the_frames_hold(ranks, tmp_path):
    """Curved cells: their nodes inside edges have an order of their own."""
    cube = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron", 2, bent=True)
    assert run_ranks(ranks, PROGRAM, str(tmp_path), str(cube)) == ["run.bp\nrun.bp\n"] * ranks
    assert not list(tmp_path.glob(".antiosc*"))
    compare(tmp_path)


@installed
def test_a_plane_part_and_a_name_that_is_taken(tmp_path):
    part = parts.held_sheet()
    hit = struck(part)
    ao.write_series(part, hit, tmp_path / "run.bp", TIMES)
    ao.write_series(part, hit, tmp_path / "run.pvd", TIMES)
    compare(tmp_path)
    for name, make in (("file.bp", lambda path: path.write_text("mine")), ("folder.bp", mkdir)):
        make(tmp_path / name)
        with pytest.raises(ao.InputError, match="no series of ADIOS2; choose another name"):
            ao.write_series(part, hit, tmp_path / name, TIMES)
        assert (tmp_path / name).exists()
    assert not list(tmp_path.glob(".antiosc*"))


def mkdir(path) -> None:
    path.mkdir()


def test_where_it_cannot_be_written_it_says_so(tmp_path, monkeypatch):
    part = parts.held_sheet()
    hit = struck(part)
    monkeypatch.setattr(compat, "writes_vtx", lambda: False)
    with pytest.raises(ao.MissingDependencyError, match=r"needs dolfinx with ADIOS2.*\.pvd"):
        ao.write_series(part, hit, tmp_path / "run.bp", TIMES)
    block = ao.Structure(box((0, 0, 0), (0.1, 0.1, 0.1), (1, 1, 1)), ao.Solid(**parts.STEEL))
    pair = ao.assemble({"a": block, "b": block}, [ao.Tie("a:x1", "b:x0")], at={"b": (0.1, 0, 0)})
    site = ao.Site((0.0, 0.0, 0.0), (1, 1, 1), part="a")
    both = ao.simulate(ao.extract(pair, site, 2), ao.RigidMass(0.1, 1.0), ao.Hertz(1e8), 1e-4)
    with pytest.raises(ao.InputError, match="holds one mesh"):
        ao.write_series(pair, both, tmp_path / "run.bp", TIMES[:2])
    assert not list(tmp_path.iterdir())


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
        with pytest.raises(ao.InputError, match="surface"):
            mesh_fields.surface(part, found)
        return
    points, faces, moved = mesh_fields.surface(part, shapes(part, np.eye(3)))
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
