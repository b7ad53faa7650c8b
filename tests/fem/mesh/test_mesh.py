"""Meshes: groups, orders, geometry of cells."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from math import prod

import basix
import dolfinx
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem.mesh.surface import (
    Faces,
    closest_many,
    group_centre,
    largest_entities,
    outside_distance,
    quadrature,
    size_at,
)
from antiosc.fem.platform import compat
from mpi import START, run_ranks
from parts import EXPONENTS, box, frame, moments
from sheets import sheet


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


@pytest.mark.slow
@pytest.mark.sample(-1)
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", parts.CELLS)
@pytest.mark.parametrize(("version", "binary"), [(2.2, True), (4.1, False)])
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
    clamp = parts.group_points(mesh, "clamp", dim - 1)
    assert len(clamp) == 2 ** (dim - 1) * (2 if cell == "tetrahedron" else 1)
    if not bent:
        np.testing.assert_allclose(clamp[..., 0], 0, atol=1e-12)
    corner = parts.group_points(mesh, "corner", 0)
    np.testing.assert_allclose(corner, np.zeros((1, 1, 3)), atol=1e-12)


def test_a_dolfinx_mesh_with_tags():
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 4, 4)
    left = dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[0], 0))
    tags = dolfinx.mesh.meshtags(mesh, 1, left, np.array([3, 3, 5, 5], dtype=np.int32))
    adopted = ao.read_mesh(mesh, groups={"low": (tags, 3), "high": (tags, 5)})
    assert adopted.dolfinx is mesh
    for option in ({"unit": "mm"}, {"merge": 1e-6}):
        with pytest.raises(ao.InputError, match="unit"):
            ao.read_mesh(mesh, **option)
    assert [len(adopted.group(name)[1]) for name in ("low", "high")] == [2, 2]
    np.testing.assert_allclose(parts.group_points(adopted, "low", 1)[..., 0], 0, atol=1e-15)


READ_IN_PARALLEL = """
from dolfinx.io import XDMFFile

comm = MPI.COMM_WORLD
with XDMFFile(comm, sys.argv[1], "r") as file:
    mesh = file.read_mesh()
    mesh.topology.create_connectivity(2, 3)
    clamp = file.read_meshtags(mesh, "clamp")

mesh = ao.read_mesh(mesh, groups={"clamp": (clamp, 1)})
part = ao.Structure(mesh, ao.Solid(**parts.STEEL), [ao.Support("clamp")])
model = ao.extract(part, ao.Site((0.2, 0.05, 0.1), (0, 0, -1)), n=3, shapes=False)
print(json.dumps([model.k0, *model.omega]))
"""


@pytest.mark.mpi
def test_a_file_is_read_by_all_ranks_with_dolfinx(tmp_path):
    path = tmp_path / "large.xdmf"
    corners = [np.zeros(3), np.array([0.2, 0.1, 0.1])]
    mesh = dolfinx.mesh.create_box(MPI.COMM_SELF, corners, [4, 2, 2])
    mesh.topology.create_connectivity(2, 3)
    left = dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[0], 0))
    clamp = dolfinx.mesh.meshtags(mesh, 2, np.sort(left), np.ones(len(left), dtype=np.int32))
    clamp.name = "clamp"
    with dolfinx.io.XDMFFile(MPI.COMM_SELF, path, "w") as file:
        file.write_mesh(mesh)
        file.write_meshtags(clamp, *[mesh.geometry][: dolfinx.__version__ >= "0.7"])

    one, two = (json.loads(run_ranks(n, START + READ_IN_PARALLEL, str(path))[0]) for n in (1, 2))
    np.testing.assert_allclose(two, one, rtol=1e-8)


@pytest.mark.mpi
def test_two_ranks_hold_the_same_mesh(tmp_path):
    paths = [
        parts.gmsh_cube(tmp_path / f"{cell}.msh", cell, 2, bent=True, n=3)
        for cell in ("tetrahedron", "quadrilateral")
    ]
    geo = tmp_path / "sheet.geo"
    geo.write_text(parts.SHEET_SCRIPT)
    script = """
        import sys
        import numpy as np
        import antiosc as ao
        from antiosc.fem.platform import compat
        from parts import moments
        block = ao.box_mesh((0.2, 0.1, 0.1), 0.05)
        for mesh in (*map(ao.read_mesh, sys.argv[1:]), block):
            owned = compat.cell_index_map(mesh.dolfinx).size_local
            sizes = {}
            for name, group in mesh.groups.items():
                for dim, entities in group.items():
                    mesh.dolfinx.topology.create_entities(dim)
                    own = mesh.dolfinx.topology.index_map(dim).size_local
                    sizes[name, dim] = mesh.comm.allreduce(int(np.sum(entities < own)))
            print(mesh.n_cells, sorted(sizes.items()), *moments(mesh).round(12) + 0.0)
            assert 0 < owned < mesh.n_cells
    """
    arguments = [str(p) for p in (*paths, geo)]
    one = run_ranks(1, script.replace("assert", "#"), *arguments)
    two = run_ranks(2, script, *arguments)
    assert one[0].count("\n") == 4
    assert two == [one[0], one[0]]


# --- Bars, plates and blocks of given lengths: each named side is where its name says -------------


@pytest.mark.slow
@pytest.mark.parametrize("lengths", [(0.3,), (0.2, 0.1), (0.06, 0.04, 0.03)])
def test_sides_lie_where_their_names_say(lengths):
    mesh = ao.box_mesh(lengths, size=0.02)
    whole = np.zeros(3)
    whole[: len(lengths)] = lengths
    body = {1: "bar", 2: "plate", 3: "block"}[len(lengths)]
    assert quadrature(mesh, *largest_entities(mesh, body), 2).weight.sum() == pytest.approx(
        prod(lengths)
    )
    for axis, length in enumerate(lengths):
        others = prod(each for k, each in enumerate(lengths) if k != axis)
        for sign, at in (("-", 0.0), ("+", length)):
            side, middle = f"{sign}{'xyz'[axis]}", whole / 2
            middle[axis] = at
            np.testing.assert_allclose(group_centre(mesh, side), middle, atol=1e-12)
            area = quadrature(mesh, *largest_entities(mesh, side), 2).weight.sum()
            assert area == pytest.approx(others)
    if len(lengths) == 2:
        rim = quadrature(mesh, *largest_entities(mesh, "rim"), 2).weight.sum()
        assert rim == pytest.approx(2 * sum(lengths))


RNG = np.random.default_rng(17)


def bulged(cell: str, order: int = 2, noise: float = 0.03) -> ao.Mesh:
    """One cell that is a little bent or skew."""
    kind = getattr(basix.CellType, cell)
    X = np.asarray(basix.create_element(basix.ElementFamily.P, kind, order).points)
    x = X @ (np.eye(X.shape[1]) + 0.1 * RNG.normal(size=2 * X.shape[1:])) + 0.1 * X**2
    x += noise * RNG.normal(size=X.shape)
    cells = np.arange(len(X))[None]
    return ao.read_mesh(compat.create_mesh(MPI.COMM_SELF, cells, x, cell, order))


def wave(s, t):
    return s, t, 0.2 * np.sin(3 * s + t)


def ring(s, t):
    return (1 + s) * np.cos(t), (1 + s) * np.sin(t)


KINDS_OF_MESHES: dict[str, Callable[[], ao.Mesh]] = {
    "lines in space": lambda: frame([(0, 0, 0), (1, 0, 0.3), (1, 1, 0)], [(0, 1), (1, 2)], 3),
    "triangles": lambda: sheet(2, ring),
    "quadrilaterals": lambda: sheet(2, ring, "quadrilateral"),
    "curved triangles": lambda: sheet(2, ring, order=2),
    "curved quadrilaterals": lambda: sheet(2, ring, "quadrilateral", order=2),
    "triangles in space": lambda: sheet(2, wave),
    "quadrilaterals in space": lambda: sheet(2, wave, "quadrilateral"),
    "curved triangles in space": lambda: sheet(2, wave, order=2),
    "curved quadrilaterals in space": lambda: sheet(2, wave, "quadrilateral", order=2),
    "tetrahedra": lambda: box((2, 1, 1), (1.0, 0.7, 0.5), "tetrahedron"),
    "hexahedra": lambda: box((2, 1, 1), (1.0, 0.7, 0.5)),
    "a skew hexahedron": lambda: bulged("hexahedron", 1, 0.1),
    "a curved tetrahedron": lambda: bulged("tetrahedron"),
    "a curved hexahedron": lambda: bulged("hexahedron"),
}


def lattice(cell: str, n: int) -> np.ndarray:
    kind = getattr(basix.CellType, cell)
    return np.asarray(basix.create_lattice(kind, n, basix.LatticeType.equispaced, True))


@pytest.mark.parametrize("name", list(KINDS_OF_MESHES))
def test_no_point_of_the_cells_is_closer(name):
    """Of points in cells themselves, and of points beside them; the nearest of a dense sample."""
    mesh = KINDS_OF_MESHES[name]()
    geometry, n = mesh.geometry, 12
    X = lattice(mesh.cell, n)
    every = np.arange(mesh.n_cells)
    sample = geometry.at(np.repeat(every, len(X)), np.tile(X, (len(every), 1)))[0]
    low, high = sample.min(axis=0), sample.max(axis=0)
    beside = RNG.uniform(low - 0.3, high + 0.3, (12, 3)) * (np.arange(3) < mesh.gdim)
    weights = RNG.dirichlet(np.ones(len(geometry.corners)), 8)
    cells = RNG.integers(0, mesh.n_cells, 8)
    on = geometry.at(cells, weights @ geometry.corners)[0]
    points = np.vstack([on, beside])
    found = closest_many(mesh, points)
    assert len(found) == len(points)
    back = geometry.at(found.cell, found.X)[0]
    size = np.linalg.norm(high - low)
    np.testing.assert_allclose(back, found.x, atol=1e-7 * size)
    off = np.linalg.norm(found.x - points, axis=1)
    np.testing.assert_allclose(off, found.distance, atol=1e-7 * size)
    assert outside_distance(found.X, geometry.simplex).max() < 1e-8
    assert found.distance[: len(on)].max() < 1e-7 * size
    apart = np.linalg.norm(sample[None] - points[:, None], axis=2).min(axis=1)
    assert (found.distance <= apart + 1e-7 * size).all()
    nodes = geometry.nodes[found[0].cell]
    largest = max(np.linalg.norm(a - b) for a in nodes for b in nodes)
    assert size_at(mesh, found[0]) == pytest.approx(largest)


SOLID = [name for name in KINDS_OF_MESHES if "space" not in name]


@pytest.mark.parametrize("name", SOLID)
def test_faces_enclose_the_cells(name):
    """∮ x·n is the volume times the dimension; balls hold every point."""
    mesh = KINDS_OF_MESHES[name]()
    faces, dim = Faces(mesh, sheet=False), mesh.tdim
    shape = ("interval", "triangle" if faces.simplex else "quadrilateral")[faces.dim - 1]
    xi, w = basix.make_quadrature(getattr(basix.CellType, shape), 6)
    every = np.repeat(np.arange(len(faces.facets)), len(w))
    at = np.tile(np.reshape(xi, (len(w), -1)), (len(faces.facets), 1))
    x, n = faces.across(every, at)
    J = faces.at(every, at)[1]
    area = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J))) * np.tile(w, len(faces.facets))
    inner, weight = compat.quadrature(mesh.cell, 6)
    cells = np.repeat(np.arange(mesh.n_cells), len(weight))
    inner_J = mesh.geometry.at(cells, np.tile(inner, (mesh.n_cells, 1)))[1][:, :dim]
    volume = np.abs(np.linalg.det(inner_J)) @ np.tile(weight, mesh.n_cells)
    assert area @ np.einsum("nd,nd->n", x, n) / dim == pytest.approx(volume, rel=1e-6)
    assert np.abs(area @ n).max() < 1e-6 * area.sum()
    mean, ball = faces.sizes, faces.radii
    assert (np.linalg.norm(x - faces.centres[every], axis=1) <= ball[every] * (1 + 1e-9)).all()
    around = [0, 1, 3, 2] if faces.corners.shape[1] == 4 else range(faces.corners.shape[1])
    for corners, own in zip(faces.corners[:, list(around)], mean, strict=True):
        sides = corners - np.roll(corners, 1, axis=0)
        assert own == pytest.approx(np.linalg.norm(sides, axis=1).mean())
    np.testing.assert_allclose(
        faces.normals, faces.across(np.arange(len(faces.facets)), faces.middle)[1]
    )


@pytest.mark.parametrize("name", [*SOLID, *list(KINDS_OF_MESHES)[5:9]])
def test_points_above_faces_are_brought_back(name):
    """Along the normals of the middles, most points near edges; not from too far."""
    mesh = KINDS_OF_MESHES[name]()
    faces = Faces(mesh, sheet="space" in name)
    every = np.repeat(np.arange(len(faces.facets)), 10)
    weights = RNG.dirichlet(np.full(faces.corners.shape[1], 0.5), len(every))
    kind = ("interval", "triangle" if faces.simplex else "quadrilateral")[faces.dim - 1]
    xi = weights @ np.asarray(basix.geometry(getattr(basix.CellType, kind)))
    x = faces.at(every, xi)[0]
    n = faces.normals[every]
    lift = 1e-3 * faces.sizes[every, None] * n
    for sign in (1, -1):
        face, found, distance = faces.along(x + sign * lift, n, 0.1)
        np.testing.assert_allclose(faces.at(face, found)[0], x, atol=1e-9)
        np.testing.assert_allclose(distance, np.linalg.norm(lift, axis=1), rtol=1e-6)
    assert np.isinf(faces.along(x + 0.2 * n, n, 0.1)[2]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["-x", "+x", "-y", "+y", "-z", "+z"])
def test_sides_of_the_box_have_names_without_groups(name):
    """The facets of the groups that `box_mesh` makes, found by their coordinates."""
    named = ao.box_mesh((0.3, 0.2, 0.1), size=0.05)
    bare = replace(named, groups={})
    ((dim, facets),) = bare.group(name).items()
    assert dim == 2
    assert set(facets) == set(named.groups[name][2])
