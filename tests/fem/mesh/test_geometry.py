"""Closest points and faces of straight and curved cells of every shape, against samples of them."""

from __future__ import annotations

from collections.abc import Callable

import basix
import numpy as np
import pytest
from mpi4py import MPI

import antiosc as ao
from antiosc.fem.mesh import excess
from antiosc.fem.mesh.surface import Faces, closest_many, size_at
from antiosc.fem.platform import compat
from parts import box, frame
from sheets import sheet

RNG = np.random.default_rng(17)


def bulged(cell: str) -> ao.Mesh:
    """One cell of order 2 that is a little bent."""
    kind = getattr(basix.CellType, cell)
    X = np.asarray(basix.create_element(basix.ElementFamily.P, kind, 2).points)
    x = X @ (np.eye(X.shape[1]) + 0.1 * RNG.normal(size=2 * X.shape[1:])) + 0.1 * X**2
    x += 0.03 * RNG.normal(size=X.shape)
    cells = np.arange(len(X))[None]
    return ao.read_mesh(compat.create_mesh(MPI.COMM_SELF, cells, x, cell, 2))


def wave(s, t):
    return s, t, 0.2 * np.sin(3 * s + t)


def ring(s, t):
    return (1 + s) * np.cos(t), (1 + s) * np.sin(t)


MESHES: dict[str, Callable[[], ao.Mesh]] = {
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
    "a curved tetrahedron": lambda: bulged("tetrahedron"),
    "a curved hexahedron": lambda: bulged("hexahedron"),
}


def lattice(cell: str, n: int) -> np.ndarray:
    kind = getattr(basix.CellType, cell)
    return np.asarray(basix.create_lattice(kind, n, basix.LatticeType.equispaced, True))


@pytest.mark.sample
@pytest.mark.parametrize("name", list(MESHES))
def test_no_point_of_the_cells_is_closer(name):
    """Of points in cells themselves, and of points beside them; the nearest of a dense sample."""
    mesh = MESHES[name]()
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
    assert excess(found.X, geometry.simplex).max() < 1e-8
    assert found.distance[: len(on)].max() < 1e-7 * size
    apart = np.linalg.norm(sample[None] - points[:, None], axis=2).min(axis=1)
    assert (found.distance <= apart + 1e-7 * size).all()
    nodes = geometry.nodes[found[0].cell]
    largest = max(np.linalg.norm(a - b) for a in nodes for b in nodes)
    assert size_at(mesh, found[0]) == pytest.approx(largest)


SOLID = [name for name in MESHES if "space" not in name]


@pytest.mark.parametrize("name", SOLID)
def test_faces_enclose_the_cells(name):
    """∮ x·n is the volume times the dimension; balls, sides and bends hold every point."""
    mesh = MESHES[name]()
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
    middle, tangents = faces.at(np.arange(len(faces.facets)), faces.middle)
    plane = middle[every] + np.einsum("nxd,nd->nx", tangents[every], at - faces.middle[every])
    off = np.linalg.norm(x - plane, axis=1) / mean[every]
    assert (off <= faces.bend[every] + 1e-9).all()
    assert (faces.bend > 0).any() == ("curved" in name)
    np.testing.assert_allclose(faces.normals, faces.across(np.arange(len(middle)), faces.middle)[1])


@pytest.mark.parametrize("name", [*SOLID, *list(MESHES)[5:9]])
def test_points_above_faces_are_brought_back(name):
    """Along the normals at the middles of the faces, from inside of them; not from too far."""
    mesh = MESHES[name]()
    faces = Faces(mesh, sheet="space" in name)
    every = np.arange(len(faces.facets))
    weights = RNG.dirichlet(np.full(faces.corners.shape[1], 3.0), len(every))
    kind = ("interval", "triangle" if faces.simplex else "quadrilateral")[faces.dim - 1]
    xi = weights @ np.asarray(basix.geometry(getattr(basix.CellType, kind)))
    x = faces.at(every, xi)[0]
    n = faces.normals
    lift = 1e-3 * faces.sizes[:, None] * n
    for sign in (1, -1):
        face, found, distance = faces.along(x + sign * lift, n, 0.1)
        np.testing.assert_allclose(faces.at(face, found)[0], x, atol=1e-9)
        np.testing.assert_allclose(distance, np.linalg.norm(lift, axis=1), rtol=1e-6)
    assert np.isinf(faces.along(x + 0.2 * n, n, 0.1)[2]).all()
