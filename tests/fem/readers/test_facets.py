"""Surfaces of triangles: mended, oriented, closed, filled; files that are cut off."""

from __future__ import annotations

from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest

import antiosc as ao

pytest.importorskip("dolfinx")
pytest.importorskip("jinja2")
pytest.importorskip("trimesh")

from antiosc.base.errors import ChoiceWarning
from antiosc.io import reading
from antiosc.io.facets import (
    TRIANGLE_SIDES,
    Surface,
    read_surface,
)
from antiosc.io.isolation import Request
from mesh_files import refusal

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)


def need_ftetwild() -> None:
    """Skip the test if pytetwild is not installed; one that is there and lacks something fails."""
    if find_spec("pytetwild") is None:
        pytest.skip("not installed: pytetwild")


def block(n: int = 4, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the surface of a cube, n squares along each edge, outward."""
    grid = np.linspace(0, size, n + 1)
    u, v = np.meshgrid(grid, grid, indexing="ij")
    points, triangles = [], []
    for axis in range(3):
        for end in (0.0, size):
            x = np.empty(((n + 1) ** 2, 3))
            x[:, axis], x[:, axis - 2], x[:, axis - 1] = end, u.ravel(), v.ravel()
            start = len(points) * (n + 1) ** 2
            points.append(x)
            for i in range(n):
                for j in range(n):
                    a = start + i * (n + 1) + j
                    one = [[a, a + n + 1, a + n + 2], [a, a + n + 2, a + 1]]
                    triangles += one if end else [row[::-1] for row in one]
    return np.vstack(points), np.array(triangles)


def damaged(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same with every third triangle turned, three of no area and two twice."""
    turned = triangles.copy()
    turned[::3] = turned[::3, ::-1]
    a, b = triangles[0, :2]
    middle = len(points)
    points = np.vstack([points, points[[a, b]].mean(axis=0)])
    flat = [[a, a, b], [a, middle, b], [b, b, b]]
    return points, np.vstack([turned, flat, triangles[:2]])


def write(path: Path, points: np.ndarray, triangles: np.ndarray) -> Path:
    with np.errstate(invalid="ignore"):  # of normals of triangles without area
        meshio.Mesh(points, [("triangle", triangles)]).write(path)
    return path


def consistent(triangles: np.ndarray) -> bool:
    """Whether each edge is passed once in each direction at most."""
    ends = np.vstack([triangles[:, list(side)] for side in TRIANGLE_SIDES])
    return len(np.unique(ends, axis=0)) == len(ends)


def loaded(path: Path) -> Surface:
    return read_surface(Request(str(path), path.name))


def test_a_damaged_surface_is_mended_told_and_turned_outward(tmp_path):
    found = loaded(write(tmp_path / "part.stl", *damaged(*block())))
    assert consistent(found.triangles)
    assert found.volume == pytest.approx(1.0)
    assert np.linalg.norm(found.normals, axis=1).sum() / 2 == pytest.approx(6.0)
    assert found.open_edges == 0
    assert "left out: 5 of" in found.remarks[0]


def test_a_small_hole_is_closed_and_a_large_one_is_not(tmp_path):
    points, triangles = block(8)
    found = loaded(write(tmp_path / "small.stl", points, triangles[2:]))
    assert found.open_edges == 0
    assert "small holes" in found.remarks[0]
    assert found.volume == pytest.approx(1.0)
    found = loaded(write(tmp_path / "large.stl", points, triangles[40:]))
    assert found.open_edges > 4
    assert found.remarks == []


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off"])
def test_every_format_is_filled(tmp_path, ending):
    path = write(tmp_path / f"cube.{ending}", *damaged(*block(2, 10.0)))
    with pytest.warns(ao.AntioscWarning, match="left out"):
        mesh = ao.read_mesh(path, size=4e-3, unit="mm", solid=True)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-6, rel=1e-6)
    assert len([name for name in mesh.groups if name.startswith("face ")]) == 6


@pytest.mark.slow
def test_a_cavity_and_two_bodies(tmp_path):
    points, triangles = block(2, 10.0)
    inner = points * 0.4 + 3.0
    beside = points * 0.5 + [20, 0, 0]
    every = np.vstack([triangles, triangles + len(points), triangles + 2 * len(points)])
    path = write(tmp_path / "hollow.stl", np.vstack([points, inner, beside]), every)
    assert len(reading.read_outline(path).pieces) == 2
    for piece, volume in ((1, 1000 - 64), (2, 125)):
        with pytest.warns(ao.AntioscWarning, match="of 2 is read"):
            mesh = ao.read_mesh(path, size=3e-3, unit="mm", solid=True, piece=piece)
        assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-9 * volume, rel=1e-6)


@pytest.mark.slow
def test_an_open_surface_is_no_solid(tmp_path):
    points, triangles = block(2)
    path = write(tmp_path / "open.stl", points, triangles[:-8])
    with pytest.raises(ao.MeshError, match="open edges"):
        ao.read_mesh(path, size=0.5, solid=True)
    assert ao.read_mesh(path).cell == "triangle"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the closed surfaces of two.stl pierce each other")
def test_bodies_that_pierce_each_other_are_united_and_one_alone_is_read(tmp_path):
    points, triangles = block(2, 10.0)
    mirrored, far = 10.0 - points, points + 4.3  # each begins within the other
    both = np.vstack([triangles[:, ::-1], triangles + len(points)])
    path = write(tmp_path / "two.stl", np.vstack([mirrored, far]), both)
    need_ftetwild()
    with pytest.warns(ChoiceWarning, match="fTetWild"):
        mesh = ao.read_mesh(path, size=3e-3, unit="mm", solid=True)
    united = 2 * 10.0**3 - 5.7**3
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-9 * united, rel=1e-2)
    with pytest.warns(ao.AntioscWarning, match="piece 1 of 2"):
        mesh = ao.read_mesh(path, size=3e-3, unit="mm", solid=True, piece=1)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-6, rel=1e-6)


#: A cube of quadrilaterals whose corners have textures of their own.
OBJ = """\
# a cube
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5
f 1/1 4/2 3/3 2/4\nf 5/1 6/2 7/5 8/4\nf -8//1 -7//1 -3//1 -4//1\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""


def test_a_ply_whose_triangles_have_textures_is_whole(tmp_path):
    """Its corners are read once for each texture: more than its header announces."""
    path = tmp_path / "skin.ply"
    meshio.Mesh(block()[0], [("triangle", block()[1])]).write(path, binary=False)
    header, body = path.read_text().split("end_header\n")
    header += "property list uchar float texcoord\nend_header\n"
    rows = [
        line + f" 6 {k} 0 {k} 1 0 1" * line.startswith("3 ")
        for k, line in enumerate(body.splitlines())
    ]
    path.write_text(header + "\n".join(rows) + "\n")
    found = loaded(path)
    corners = np.unique(block()[0], axis=0)
    assert (len(found.points), len(found.triangles)) == (len(corners), len(block()[1]))


def test_a_surface_without_triangles_is_refused(tmp_path):
    path = tmp_path / "none.stl"
    path.write_text("solid none\nendsolid none\n")
    assert "none.stl is empty or damaged: it has 0 triangles" in refusal(path)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_a_file_that_is_cut_off_is_refused(tmp_path, ending):
    """By its own counts; of OBJ, which has none, by corners of no face, or a face that ends."""
    path = tmp_path / f"cube.{ending}"
    mesh = meshio.Mesh(block(3)[0], [("triangle", block(3)[1])])
    if ending == "text.stl":
        mesh.write(path, binary=False)
    else:
        mesh.write(path)
    content = path.read_bytes()
    assert ao.read_mesh(path, merge=1e-6).n_cells
    for share in (0.3, 0.99):
        path.write_bytes(content[: int(share * len(content))])
        assert path.name in refusal(path)


def pierced(path: Path, deep: float) -> Path:
    """A unit cube whose top is a pyramid that points down and ends `deep` below the bottom."""
    x = np.array([*np.ndindex(2, 2, 2), (0.5, 0.5, -deep)], dtype=float)
    around = [0, 4, 6, 2, 0]  # the corners of the bottom; those of the top follow them
    triangles = [(0, 2, 4), (2, 6, 4)]
    for a, b in pairwise(around):
        triangles += [(a, b, b + 1), (a, b + 1, a + 1), (a + 1, b + 1, 8)]
    meshio.write(path, meshio.Mesh(x, [("triangle", np.array(triangles))]), binary=True)
    return path


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:gmsh cannot mesh dent.stl")
def test_a_surface_that_pierces_itself_is_filled_by_ftetwild(tmp_path, monkeypatch):
    file = pierced(tmp_path / "dent.stl", deep=0.3)
    with monkeypatch.context() as missing:
        missing.setattr(reading, "find_spec", lambda name: None)
        with pytest.raises(ao.MeshError, match="pip install"):
            ao.read_mesh(file, size=0.2, solid=True, unit="m")
    need_ftetwild()
    with pytest.warns(ChoiceWarning, match="filled by fTetWild"):
        mesh = ao.read_mesh(file, size=0.2, solid=True, unit="m")
    held = 1 - (1.3 - 0.3**3 / 1.3**2) / 3  # the cube without the pyramid above its bottom
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850 * held, rel=2e-2)
    assert sum(name.startswith("face ") for name in mesh.groups) >= 9
