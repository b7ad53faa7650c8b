"""Meshes from everywhere: every kind of file and cell keeps its shape, its names and its groups."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import dolfinx
import gmsh
import meshio
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.errors import AntioscWarning
from antiosc.fem import compat
from mpi import run_ranks
from parts import EXPONENTS, moments
from paths import TESTS

pytestmark = pytest.mark.fem


def expected_moments(dim: int, bent: bool) -> np.ndarray:
    """The same of the unit cube or square, or of its image under the map of parts.bend."""
    t, w = np.polynomial.legendre.leggauss(6)
    t, w = (t + 1) / 2, w / 2
    grid = np.stack(np.meshgrid(*[t] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    weight = np.prod(np.stack(np.meshgrid(*[w] * dim, indexing="ij"), axis=-1), axis=-1).ravel()
    points = np.zeros((len(grid), 3))
    points[:, :dim] = grid
    if bent:  # the map keeps volumes, so the weights stay
        points = (parts.bend if dim == 3 else parts.bend_plane)(points)
    return np.array([weight @ np.prod(points**e, axis=1) for e in EXPONENTS if not any(e[dim:])])


def group_points(mesh: ao.Mesh, name: str, dim: int) -> np.ndarray:
    """Vertices (n, 3) of the entities of a group."""
    entities = mesh.group(name)[dim]
    return mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, dim)[entities]]


# --- Cells and formats ----------------------------------------------------------------------------


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", parts.CELLS)
@pytest.mark.parametrize(
    ("version", "binary"), [(2.2, False), (2.2, True), (4.1, False), (4.1, True)]
)
def test_gmsh_files_of_every_kind_keep_shape_and_groups(tmp_path, cell, order, version, binary):
    bent = order == 2
    path = parts.gmsh_cube(
        tmp_path / "cube.msh", cell, order, bent=bent, version=version, binary=binary
    )
    mesh = ao.read_mesh(path)
    dim = 3 if cell in ("tetrahedron", "hexahedron") else 2
    assert (mesh.cell, mesh.order, mesh.tdim, mesh.gdim) == (cell, order, dim, dim)
    # A wrong order of the mid-side nodes tangles the cells: some moment is then far off.
    np.testing.assert_allclose(moments(mesh), expected_moments(dim, bent), rtol=1e-12, atol=1e-14)
    assert set(mesh.groups) == {"body", "clamp", "corner"}
    assert len(mesh.group("body")[dim]) == mesh.n_cells
    clamp = group_points(mesh, "clamp", dim - 1)
    assert len(clamp) == 2 ** (dim - 1) * (2 if cell == "tetrahedron" else 1)
    if not bent:
        np.testing.assert_allclose(clamp[..., 0], 0, atol=1e-12)
    np.testing.assert_allclose(group_points(mesh, "corner", 0), np.zeros((1, 1, 3)), atol=1e-12)


def test_order_1_drops_the_mid_side_nodes(tmp_path):
    path = parts.gmsh_cube(tmp_path / "cube.msh", "hexahedron", 2)
    mesh = ao.read_mesh(path, order=1)
    assert mesh.order == 1
    assert len(mesh.dolfinx.geometry.x) == 27
    np.testing.assert_allclose(moments(mesh), expected_moments(3, False), rtol=1e-12)
    assert len(mesh.group("clamp")[2]) == 4


def written_by_meshio(path, cell: str, order: int, tmp_path, **sets):
    """The cube of parts.gmsh_cube in another format; node numbers and coordinates by meshio."""
    source = meshio.read(parts.gmsh_cube(tmp_path / "source.msh", cell, order, bent=order == 2))
    body = [b for b in source.cells if b.dim == source.cells[-1].dim]
    body = [b for b in body if b.type == source.cells[-1].type]
    cells = [(body[0].type, np.vstack([b.data for b in body]))]
    meshio.Mesh(source.points, cells, **sets).write(path)
    return path


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", parts.CELLS)
@pytest.mark.parametrize("suffix", ["vtu", "vtk"])
def test_vtk_files_of_every_kind_keep_shape(tmp_path, cell, order, suffix):
    path = written_by_meshio(tmp_path / f"cube.{suffix}", cell, order, tmp_path)
    mesh = ao.read_mesh(path)
    dim = 3 if cell in ("tetrahedron", "hexahedron") else 2
    assert (mesh.cell, mesh.order) == (cell, order)
    expected = expected_moments(dim, order == 2)
    np.testing.assert_allclose(moments(mesh), expected, rtol=1e-12, atol=1e-14)


def test_vtu_cell_data_become_groups(tmp_path):
    path = written_by_meshio(
        tmp_path / "cube.vtu", "hexahedron", 1, tmp_path,
        cell_data={"material": [np.array([7] * 4 + [9] * 4)], "pressure": [np.arange(8.0)]},
    )  # fmt: skip
    mesh = ao.read_mesh(path)
    assert {name: len(g[3]) for name, g in mesh.groups.items()} == {
        "material=7": 4,
        "material=9": 4,
    }


ABAQUS = """\
*HEADING
two tetrahedra on one face
*NODE
11, 0.0, 0.0, 0.0
12, 1.0, 0.0, 0.0
13, 0.0, 1.0, 0.0
14, 0.0, 0.0, 1.0
15, 0.0, 0.0, -1.0
*ELEMENT, TYPE=C3D4, ELSET=upper
1, 11, 12, 13, 14
*ELEMENT, TYPE=C3D4, ELSET=lower
2, 12, 11, 13, 15
*NSET, NSET=side
11, 13, 14, 15
*NSET, NSET=tip
12
"""


def test_abaqus_element_and_node_sets(tmp_path):
    path = tmp_path / "pair.inp"
    path.write_text(ABAQUS)
    mesh = ao.read_mesh(path)
    assert (mesh.cell, mesh.n_cells) == ("tetrahedron", 2)
    assert moments(mesh)[0] == pytest.approx(1 / 3, rel=1e-14)
    assert group_points(mesh, "upper", 3)[..., 2].min() == 0
    assert group_points(mesh, "lower", 3)[..., 2].max() == 0
    # The node set holds two whole facets (x = 0); a lone node stays a node.
    assert set(mesh.group("side")) == {2}
    np.testing.assert_allclose(group_points(mesh, "side", 2)[..., 0], np.zeros((2, 3)))
    np.testing.assert_allclose(group_points(mesh, "tip", 0), [[[1, 0, 0]]])


def test_abaqus_second_order_by_gmsh(tmp_path):
    mesh = ao.read_mesh(parts.gmsh_cube(tmp_path / "cube.inp", "tetrahedron", 2, bent=True))
    assert mesh.order == 2
    assert len(mesh.group("body")[3]) == mesh.n_cells
    np.testing.assert_allclose(moments(mesh), expected_moments(3, True), rtol=1e-10, atol=1e-12)


NASTRAN = """\
BEGIN BULK
GRID           1              0.      0.      0.
GRID           2              1.      0.      0.
GRID           3              1.      1.      0.
GRID           4              0.      1.      0.
GRID           5              0.      0.      1.
GRID           6              1.      0.      1.
GRID           7              1.      1.      1.
GRID           8              0.      1.      1.
GRID           9              0.      0.      3.
GRID          10              1.      0.      3.
GRID          11              1.      1.      3.
GRID          12              0.      1.      3.
CHEXA          1      21       1       2       3       4       5       6
+              7       8
CHEXA          2      22       5       6       7       8       9      10
+             11      12
ENDDATA
"""


def test_nastran_property_numbers_name_groups(tmp_path):
    path = tmp_path / "pair.bdf"
    path.write_text(NASTRAN)
    mesh = ao.read_mesh(path)
    assert (mesh.cell, mesh.n_cells) == ("hexahedron", 2)
    assert moments(mesh)[0] == pytest.approx(3.0, rel=1e-14)
    assert group_points(mesh, "21", 3)[..., 2].max() == 1
    assert group_points(mesh, "22", 3)[..., 2].min() == 1


def test_med_families_name_groups(tmp_path):
    pytest.importorskip("h5py")
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -2]], dtype=float)
    source = meshio.Mesh(
        points,
        [("tetra", np.array([[0, 1, 2, 3], [1, 0, 2, 4]])), ("triangle", np.array([[0, 2, 3]]))],
        cell_data={"cell_tags": [np.array([-6, -7]), np.array([-8])]},
        point_data={"point_tags": np.array([0, 2, 0, 0, 0])},
    )
    source.cell_tags = {-6: ["upper", "all"], -7: ["lower", "all"], -8: ["wall"]}
    source.point_tags = {2: ["tip"]}
    source.write(tmp_path / "pair.med")
    mesh = ao.read_mesh(tmp_path / "pair.med")
    assert moments(mesh)[0] == pytest.approx(1 / 2, rel=1e-14)
    sizes = {name: {d: len(e) for d, e in g.items()} for name, g in mesh.groups.items()}
    assert sizes == {
        "upper": {3: 1}, "lower": {3: 1}, "all": {3: 2}, "wall": {2: 1}, "tip": {0: 1}
    }  # fmt: skip
    assert group_points(mesh, "lower", 3)[..., 2].min() == -2
    np.testing.assert_allclose(group_points(mesh, "wall", 2)[..., 0], [[0, 0, 0]])
    np.testing.assert_allclose(group_points(mesh, "tip", 0), [[[1, 0, 0]]])


def test_a_dolfinx_mesh_with_tags():
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 4, 4)
    left = dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[0], 0))
    tags = dolfinx.mesh.meshtags(mesh, 1, left, np.array([3, 3, 5, 5], dtype=np.int32))
    adopted = ao.read_mesh(mesh, groups={"low": (tags, 3), "high": (tags, 5)})
    assert adopted.dolfinx is mesh
    assert [len(adopted.group(name)[1]) for name in ("low", "high")] == [2, 2]
    np.testing.assert_allclose(group_points(adopted, "low", 1)[..., 0], 0, atol=1e-15)


# --- Geometry -------------------------------------------------------------------------------------


def quarter_disc(path):
    """A quarter of a unit disc, 1 thick, written by gmsh as a geometry; lengths in m."""
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1, angle=np.pi / 2)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


@pytest.mark.parametrize("suffix", ["step", "brep"])
def test_solid_geometry_is_meshed_with_curved_cells(tmp_path, suffix):
    path = quarter_disc(tmp_path / f"quarter.{suffix}")
    mesh = ao.read_mesh(path, size=0.5)
    assert (mesh.cell, mesh.order) == ("tetrahedron", 2)
    extent = np.ptp(mesh.dolfinx.geometry.x, axis=0)
    np.testing.assert_allclose(extent, [1, 1, 1], rtol=1e-9)
    # Straight cells of this size miss 0.3 % of the volume.
    assert moments(mesh)[0] == pytest.approx(np.pi / 4, rel=3e-4)
    straight = ao.read_mesh(path, size=0.5, order=1)
    assert straight.order == 1
    assert moments(straight)[0] < 0.998 * np.pi / 4


def test_step_in_millimetres_becomes_metres():
    # OpenCASCADE keeps the last unit it was told for the life of the process: tell it another one.
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.importShapes("meshes/bracket.step")
        # a size that would do in either unit
        bracket = ao.read_mesh("meshes/bracket.step", size=20.0)
    finally:
        gmsh.finalize()
    extent = np.ptp(bracket.dolfinx.geometry.x, axis=0)
    np.testing.assert_allclose(extent, [0.084, 0.06, 0.086], rtol=1e-6)


def smallest_jacobian(mesh: ao.Mesh) -> float:
    """Smallest determinant over the largest of any cell, by differences of the map at its nodes."""
    nodes = compat.geometry_nodes(mesh.dolfinx)
    cmap = compat.coordinate_map(mesh.dolfinx)
    corners = np.vstack([np.zeros(3), np.eye(3)])
    X = np.vstack([corners, (corners[:, None] + corners[None])[np.triu_indices(4, 1)] / 2])
    step = 1e-3  # central differences of a quadratic map are exact
    worst = np.inf
    for x in mesh.dolfinx.geometry.x[nodes]:
        x = np.ascontiguousarray(x)
        slopes = [
            (cmap.push_forward(X + step * e, x) - cmap.push_forward(X - step * e, x)) / 2 / step
            for e in np.eye(3)
        ]
        det = np.linalg.det(np.stack(slopes, axis=1))
        det *= np.sign(det.sum())
        worst = min(worst, det.min() / det.max())
    return worst


def test_no_cell_of_a_meshed_geometry_is_folded():
    """gmsh alone leaves six of these 1900 cells inside out, at the bracket's fillets."""
    mesh = ao.read_mesh("meshes/bracket.step", size=0.01)
    assert mesh.order == 2
    assert smallest_jacobian(mesh) > 0.01


def test_folded_cells_of_a_file_are_told(tmp_path):
    path = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron", 2)
    cube = meshio.read(path)
    cells = next(b.data for b in cube.cells if b.type == "tetra10")
    cube.points[cells[5, 4]] += 3 * (cube.points[cells[5, 2]] - cube.points[cells[5, 4]])
    meshio.Mesh(cube.points, [("tetra10", cells)]).write(tmp_path / "bad.vtu")
    with pytest.warns(
        AntioscWarning, match=r"of 48 cells of bad.vtu fold over themselves.*order=1"
    ):
        ao.read_mesh(tmp_path / "bad.vtu")
    assert ao.read_mesh(tmp_path / "bad.vtu", order=1).order == 1


GEO = """\
Point(1) = {0, 0, 0, 0.25}; Point(2) = {1, 0, 0, 0.25};
Point(3) = {1, 1, 0, 0.25}; Point(4) = {0, 1, 0, 0.25};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
Physical Surface("sheet") = {1}; Physical Curve("foot") = {1}; Physical Curve(17) = {3};
"""


def longest_edges_near(mesh: ao.Mesh, point, radius: float) -> np.ndarray:
    """Longest edge of every cell that has a vertex within `radius` of the point."""
    vertices = mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, mesh.tdim)]
    near = np.linalg.norm(vertices - np.resize(point, 3), axis=2).min(axis=1) <= radius
    edges = np.linalg.norm(vertices[:, :, None] - vertices[:, None], axis=3)
    return edges.max(axis=(1, 2))[near]


def test_geo_uses_its_own_sizes_unless_told(tmp_path):
    path = tmp_path / "sheet.geo"
    path.write_text(GEO)
    own, finer = ao.read_mesh(path), ao.read_mesh(path, size=0.1)
    assert (own.cell, own.order, own.gdim) == ("triangle", 2, 2)
    assert finer.n_cells > 3 * own.n_cells
    assert {name: tuple(g) for name, g in finer.groups.items()} == {
        "sheet": (2,), "foot": (1,), "17": (1,)
    }  # fmt: skip
    np.testing.assert_allclose(group_points(finer, "foot", 1)[..., 1], 0, atol=1e-15)
    np.testing.assert_allclose(group_points(finer, "17", 1)[..., 1], 1, rtol=1e-15)


@pytest.mark.parametrize("local", [0.1, 0.02])
@pytest.mark.parametrize("point", [(1.0, 0.3, 0.5), (0.31, 0.3, 1.0)])
def test_refined_elements_are_no_larger_than_asked(tmp_path, point, local):
    path = tmp_path / "cube.brep"
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.write(str(path))
    gmsh.finalize()
    mesh = ao.read_mesh(path, size=0.5, refine=[(point, local)], order=1)
    near = longest_edges_near(mesh, point, local)
    assert len(near) > 4
    assert near.max() <= local
    # and they grow away from the point
    far = longest_edges_near(mesh, (0.0, 1.0, 0.0), 0.3)
    assert far.max() > 0.25


# --- gdim -----------------------------------------------------------------------------------------


def test_the_space_a_mesh_lives_in(tmp_path):
    square = parts.gmsh_cube(tmp_path / "square.msh", "triangle")
    cube = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron")
    assert ao.read_mesh(square).gdim == 2
    assert ao.read_mesh(square, gdim=3).gdim == 3
    assert ao.read_mesh(cube).gdim == 3
    assert ao.read_mesh("meshes/beam.msh").gdim == 3
    assert ao.read_mesh("meshes/beam.msh", gdim=2).gdim == 2
    with pytest.raises(ao.MeshError, match=r"cube.msh is a mesh of volumes.*gdim=2"):
        ao.read_mesh(cube, gdim=2)
    with pytest.raises(ao.MeshError, match=r"frame.msh is not plane \(z spans 1.3 m\)"):
        ao.read_mesh("meshes/frame.msh", gdim=2)


def test_a_roof_of_triangles_lives_in_space(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]]
    meshio.Mesh(points, [("triangle", [[0, 1, 2], [1, 3, 2]])]).write(tmp_path / "roof.vtu")
    assert ao.read_mesh(tmp_path / "roof.vtu").gdim == 3


# --- gmsh's session -------------------------------------------------------------------------------


def test_the_callers_gmsh_session_survives(tmp_path, capfd):
    path = parts.gmsh_cube(tmp_path / "cube.msh", "tetrahedron")
    geo = tmp_path / "sheet.geo"
    geo.write_text(GEO)
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.123)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.add("mine")
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.add("mine too")
        gmsh.model.setCurrent("mine")
        ao.read_mesh(path)
        ao.read_mesh(geo, size=0.5)
        with pytest.raises(ao.MeshError):
            ao.read_mesh(path, gdim=2)
        assert gmsh.model.getCurrent() == "mine"
        assert len(gmsh.model.getEntities(3)) == 1
        assert gmsh.option.getNumber("Mesh.MeshSizeMax") == 0.123
        assert gmsh.option.getString("Geometry.OCCTargetUnit") == "MM"
        assert [name for name in gmsh.model.list() if name] == ["mine", "mine too"]
    finally:
        gmsh.finalize()
    assert ao.read_mesh(path).n_cells  # and one that was ended does not matter
    assert ao.read_mesh(path).n_cells
    assert "initialized" not in "".join(capfd.readouterr())


# --- Ranks ----------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_two_ranks_hold_the_same_mesh(tmp_path):
    paths = [
        parts.gmsh_cube(tmp_path / f"{cell}.msh", cell, 2, bent=True, n=3)
        for cell in ("tetrahedron", "quadrilateral")
    ]
    geo = tmp_path / "sheet.geo"
    geo.write_text(GEO)
    script = """
        import sys
        import numpy as np
        sys.path.insert(0, sys.argv[1])
        import antiosc as ao
        from antiosc.fem import compat
        from parts import moments
        for path in sys.argv[2:]:
            mesh = ao.read_mesh(path)
            owned = compat.cell_map(mesh.dolfinx).size_local
            sizes = {}
            for name, group in mesh.groups.items():
                for dim, entities in group.items():
                    mesh.dolfinx.topology.create_entities(dim)
                    own = mesh.dolfinx.topology.index_map(dim).size_local
                    sizes[name, dim] = mesh.comm.allreduce(int(np.sum(entities < own)))
            print(mesh.n_cells, sorted(sizes.items()), *moments(mesh).round(12) + 0.0)
            assert 0 < owned < mesh.n_cells
    """
    arguments = [str(p) for p in (TESTS, *paths, geo)]
    one, two = (
        run_ranks(1, script.replace("assert", "#"), *arguments),
        run_ranks(2, script, *arguments),
    )
    assert one[0].count("\n") == 3
    assert two == [one[0], one[0]]
