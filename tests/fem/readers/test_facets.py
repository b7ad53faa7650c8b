"""Surfaces of triangles: cleaned, oriented, closed, filled."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.spatial import ConvexHull

import antiosc as ao

pytest.importorskip("dolfinx")
pytest.importorskip("jinja2")

from antiosc.base.errors import ChoiceWarning, UnmeshableError
from antiosc.fem.platform import compat
from antiosc.io import facets, kept_surfaces, remade
from antiosc.io.cad import ATTEMPTS
from antiosc.io.facets import (
    SIDES,
    Filled,
    areas,
    cleaned,
    deviation,
    farthest,
    off,
    oriented,
    volumes,
)
from antiosc.io.neutral import KINDS, FileMesh, RawMesh, UnitSystem
from antiosc.io.polygons import triangles_of
from antiosc.io.reading import MESHED_OTHERWISE, Asked, _content, _meshed
from antiosc.recovery import mesh_fields
from antiosc_app.live_meshes import surface
from parts import gmsh_session

pytestmark = pytest.mark.fem
STEEL = ao.Solid(210e9, 0.3, 7850.0)


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
    ends = np.vstack([triangles[:, list(side)] for side in SIDES])
    return len(np.unique(ends, axis=0)) == len(ends)


def test_a_damaged_surface_is_cleaned_told_and_turned_outward():
    skin = cleaned(*damaged(*block()), "part.stl")
    assert consistent(skin.triangles)
    assert volumes(skin.points, skin.triangles).sum() == pytest.approx(1.0)
    assert areas(skin.points, skin.triangles).sum() == pytest.approx(6.0)
    assert (skin.closed, skin.thick) == (True, True)
    assert [s.split(": ")[2].split(" of ")[0] for s in skin.remarks] == ["3", "2"]


def test_a_small_hole_is_closed_and_a_large_one_is_not():
    points, triangles = block(30)
    middles = points[triangles].mean(axis=1)
    at = np.abs(middles - [0.5 + 0.5 / 30, 0.5 + 0.5 / 30, 1.0])
    small = (at < [0.5 / 30, 0.5 / 30, 1e-9]).all(axis=1)
    assert small.sum() == 2
    skin = cleaned(points, triangles[~small], "part.stl")
    assert skin.closed
    assert "small holes" in skin.remarks[0]
    assert volumes(skin.points, skin.triangles).sum() == pytest.approx(1.0)
    large = (at < [0.2, 0.2, 1e-9]).all(axis=1)
    skin = cleaned(points, triangles[~large], "part.stl")
    assert (skin.closed, skin.remarks) == (False, [])


def test_pieces_are_turned_each_by_itself_and_a_thin_one_is_no_solid():
    points, triangles = block(2)
    both = np.vstack([triangles[:, ::-1], triangles + len(points)])
    turned, piece = oriented(*_merged(np.vstack([points, points + 3.0]), both))
    assert sorted(np.bincount(piece)) == [48, 48]
    assert consistent(turned)
    every = np.unique(np.vstack([points, points + 3.0]), axis=0)
    np.testing.assert_allclose(np.bincount(piece, volumes(every, turned)), 1.0)
    assert not cleaned(points * [1, 1, 1e-4], triangles, "sheet.stl").thick


def _merged(points, triangles):
    points, row = np.unique(points, axis=0, return_inverse=True)
    return points, row.ravel()[triangles]


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off"])
def test_every_format_is_filled(tmp_path, ending):
    path = write(tmp_path / f"cube.{ending}", *damaged(*block(2, 10.0)))
    with pytest.warns(ao.AntioscWarning, match="left out"):
        mesh = ao.read_mesh(path, size=4e-3, unit="mm", solid=True)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-6, rel=1e-6)
    assert len([name for name in mesh.groups if name.startswith("face ")]) == 6


def test_a_cavity_and_two_bodies(tmp_path):
    points, triangles = block(2, 10.0)
    inner = points * 0.4 + 3.0
    beside = points * 0.5 + [20, 0, 0]
    every = np.vstack([triangles, triangles + len(points), triangles + 2 * len(points)])
    path = write(tmp_path / "hollow.stl", np.vstack([points, inner, beside]), every)
    for piece, volume in ((1, 1000 - 64), (2, 125)):
        with pytest.warns(ao.AntioscWarning, match="of 2 is read"):
            mesh = ao.read_mesh(path, size=3e-3, unit="mm", solid=True, piece=piece)
        assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-9 * volume, rel=1e-6)


def test_the_skin_on_a_page_is_seen_from_outside():
    mesh = ao.box_mesh((0.3, 0.2, 0.1), size=0.1)
    part = ao.Structure(mesh, STEEL)
    points, cells, _ = mesh_fields.at_nodes(part, np.zeros((part.rows, 0)))
    skin = surface(points, cells)
    assert consistent(skin.faces)
    assert volumes(skin.points, skin.faces).sum() == pytest.approx(6e-3, rel=1e-9)


def test_an_open_surface_is_no_solid(tmp_path):
    points, triangles = block(2)
    path = write(tmp_path / "open.stl", points, triangles[:-8])
    with pytest.raises(ao.MeshError, match="is not closed"):
        ao.read_mesh(path, size=0.5, solid=True)
    assert ao.read_mesh(path).cell == "triangle"


def test_bodies_that_pierce_each_other_are_told_and_one_alone_is_read(tmp_path):
    points, triangles = block(2, 10.0)
    mirrored, far = 10.0 - points, points + 4.3  # each begins within the other
    both = np.vstack([triangles[:, ::-1], triangles + len(points)])
    path = write(tmp_path / "two.stl", np.vstack([mirrored, far]), both)
    with pytest.raises(ao.MeshError, match="piece 1"):
        ao.read_mesh(path, size=3e-3, unit="mm", solid=True)
    with pytest.warns(ao.AntioscWarning, match="piece 1 of 2"):
        mesh = ao.read_mesh(path, size=3e-3, unit="mm", solid=True, piece=1)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-6, rel=1e-6)


def test_a_side_of_one_triangle_is_cut_to_the_size_of_the_elements(tmp_path):
    points = np.vstack([np.zeros(3), 10 * np.eye(3)])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    path = write(tmp_path / "corner.stl", points, triangles)
    mesh = ao.read_mesh(path, size=2e-3, unit="mm", solid=True)
    assert mesh.n_cells > 100
    assert len([name for name in mesh.groups if name.startswith("face ")]) == 4
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-6 / 6, rel=1e-6)


def tube(n: int, outer: float, inner: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of a prism over a ring of n sides, inner ones half a side behind."""
    k = np.arange(n)
    angles = 2 * np.pi / n * np.vstack([k, k, k - 0.5, k - 0.5])
    radii = np.array([outer, outer, inner, inner])[:, None]
    z = np.array([0, height, 0, height])[:, None] * np.ones(n)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles), z], axis=2).reshape(-1, 3)
    following = (k + 1) % n
    rings = [(0, 1), (1, 3), (3, 2), (0, 2)]
    triangles = []
    for a, b in rings:
        triangles.append(np.column_stack([k + a * n, following + a * n, following + b * n]))
        triangles.append(np.column_stack([k + a * n, following + b * n, k + b * n]))
    return points, np.vstack(triangles)


def test_a_wall_that_larger_elements_would_pierce_keeps_its_facets(tmp_path):
    """Chords of 5 mm in one side of the wall cross its other side 0.1 mm away."""
    path = write(tmp_path / "tube.stl", *tube(24, 10.0, 9.9, 6.0))
    with pytest.warns(ao.AntioscWarning, match="with all edges from 10° on"):
        mesh = ao.read_mesh(path, size=5e-3, unit="mm", solid=True)
    ring = 12 * np.sin(2 * np.pi / 24) * (10.0**2 - 9.9**2)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-9 * 6.0 * ring, rel=1e-6)


#: A prism 1 high over an L of three unit squares, of which the corner 4 is re-entrant; its faces
#: start at different corners, and one continues on the next line.
L_PRISM = """\
v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0
v 0 0 1\nv 2 0 1\nv 2 1 1\nv 1 1 1\nv 1 2 1\nv 0 2 1
f 2 1 6 5 \\\n4 3
f 9 10 11\\\n12 7 8
f 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12
"""


def test_polygons_with_re_entrant_corners_and_lines_that_continue(tmp_path):
    path = tmp_path / "l.obj"
    path.write_text(L_PRISM)
    points, triangles = triangles_of(path.read_bytes(), "l.obj")
    assert areas(points, triangles).sum() == pytest.approx(3 + 3 + 8)
    assert volumes(points, triangles).sum() == pytest.approx(3.0)
    mesh = ao.read_mesh(path, size=0.5, solid=True)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850.0 * 3, rel=1e-6)


#: A cube of quadrilaterals whose corners have textures of their own.
OBJ = """\
# a cube
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5
f 1/1 4/2 3/3 2/4\nf 5/1 6/2 7/5 8/4\nf -8//1 -7//1 -3//1 -4//1\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""
OFF = "OFF\n# a cube\n8 6 0\n" + "".join(
    line[2:] + "\n" if line.startswith("v ") else "" for line in OBJ.splitlines()
) + "4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n"  # fmt: skip


@pytest.mark.parametrize(
    ("ending", "text"),
    [("obj", OBJ), ("off", OFF), ("off", OFF.replace("OFF\n# a cube\n", "  OFF"))],
)
def test_polygons_are_read_without_their_textures(tmp_path, ending, text):
    path = tmp_path / f"cube.{ending}"
    path.write_text(text)
    points, triangles = triangles_of(path.read_bytes(), path.name)
    assert volumes(points, triangles).sum() == pytest.approx(1.0)
    assert areas(points, triangles).sum() == pytest.approx(6.0)
    path.write_text(text.replace("4 0 3 2 1", "4 0 3 2 8").replace("1/1 4/2", "1/1 9/2"))
    with pytest.raises(ao.MeshError, match="does not hold"):
        ao.read_mesh(path)


def test_a_ply_in_text_has_polygons_and_empty_lines(tmp_path):
    points, _ = triangles_of(OBJ.encode(), "cube.obj")
    quads = OFF.splitlines()[-6:]
    axes = "".join(f"property float {name}\n" for name in "zxy")
    header = f"ply\nformat ascii 1.0\nelement vertex 8\n{axes}element face 6\n"
    rows = [" ".join(map(str, row[[2, 0, 1]])) for row in points]
    lines = [f"{header}property list uchar int vertex_index\nend_header\n", *rows, "", *quads]
    path = tmp_path / "cube.ply"
    path.write_text("\n".join(lines))
    mesh = ao.read_mesh(path)
    corners = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    assert np.ptp(corners, axis=(0, 1)) == pytest.approx([1, 1, 1])
    assert mesh.n_cells == 12
    path.write_text("\n".join(lines[:-1]))
    with pytest.raises(ao.MeshError, match="cut off"):
        ao.read_mesh(path)


@pytest.mark.parametrize("order", ["little", "big"])
def test_coloured_triangles_of_a_binary_ply_are_read(tmp_path, order):
    """meshio reads the first face alone where faces have more than corners."""
    points, triangles = triangles_of(OBJ.encode(), "cube.obj")
    sign = {"little": "<", "big": ">"}[order]
    vertices = np.zeros(8, [("x", sign + "f4", 3), ("colour", "u1", 4)])
    texture = [("size of texture", "u1"), ("texture", sign + "f4", 6)]
    corners = [("size", "u1"), ("corners", sign + "i4", 3)]
    faces = np.zeros(12, [*corners, *texture, ("colour", "u1", 4)])
    vertices["x"], faces["size"], faces["corners"], faces["colour"] = points, 3, triangles, 200
    faces["size of texture"] = 6
    colour = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "alpha"))
    axes = "".join(f"property float {name}\n" for name in "xyz")
    header = (
        f"ply\nformat binary_{order}_endian 1.0\ncomment by hand\nelement vertex 8\n{axes}{colour}"
        f"element face 12\nproperty list uchar int vertex_indices\n"
        f"property list uchar float texcoord\n{colour}end_header\n"
    )
    path = tmp_path / "cube.ply"
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())
    mesh = ao.read_mesh(path)
    assert mesh.n_cells == 12
    corners = mesh.dolfinx.geometry.x[compat.geometry_nodes(mesh.dolfinx)]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.linalg.norm(sides, axis=1).sum() / 2 == pytest.approx(6.0)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(ao.MeshError, match="cannot be read as PLY"):
        ao.read_mesh(path)


def test_a_triangle_on_a_line_takes_a_part_of_its_neighbour():
    """A corner within a side: two flat triangles in a row join the sides of both neighbours."""
    axes = [[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]]
    points = np.array([*axes, [1, 0, 0], [2, 0, 0]], dtype=float)
    whole = [[0, 2, 1], [0, 3, 2], [1, 2, 3]]
    cut = [[0, 4, 3], [4, 5, 3], [5, 1, 3]]
    skin = cleaned(points, np.array([*whole, *cut, [0, 1, 4], [4, 1, 5]]), "part")
    assert skin.closed
    assert len(skin.triangles) == 8
    assert areas(skin.points, skin.triangles).min() > 1.0
    assert volumes(skin.points, skin.triangles).sum() == pytest.approx(4.5)


@pytest.mark.slow
def test_a_mesh_off_its_surface_is_told_apart():
    """By a node beside a face, by a corner that is cut off, and by its volume."""
    skin = cleaned(*block(3), "cube")
    points = np.random.default_rng(0).uniform(-0.2, 1.2, (300, 3))
    inside = ((points > 0) & (points < 1)).all(axis=1)
    to_sides = np.minimum(points, 1 - points).min(axis=1)
    outside = np.linalg.norm(points - points.clip(0, 1), axis=1)
    distance = np.where(inside, to_sides, outside)
    assert farthest(skin, points) == pytest.approx(distance.max())
    for point, from_side in zip(points, distance, strict=True):
        assert farthest(skin, point[None]) == pytest.approx(from_side)
    filled = Filled(skin, {}, 1.0)
    cube = {"triangle": skin.triangles}
    assert off(FileMesh(skin.points, cube, "vtk"), filled) == pytest.approx(0.0, abs=1e-12)
    x = skin.points.copy()
    x[:, 2][x[:, 2] == 1.0] = 0.99
    assert off(FileMesh(x, cube, "vtk"), filled) == pytest.approx(0.01)
    x[0] -= [0.03, 0.04, 0.0]
    assert off(FileMesh(x, cube, "vtk"), filled) == pytest.approx(0.05)


def test_of_meshes_that_are_off_the_next_or_the_nearest_is_taken():
    def once(number, limit=None, told=""):
        share = offs.pop(0)
        if share is None:
            raise UnmeshableError("no")
        return replace(raw, off=share, remarks=[])

    tetrahedron = np.vstack([np.zeros(3), np.eye(3)])
    raw = RawMesh(tetrahedron, np.arange(4)[None], KINDS["tetra"], "gmsh")
    offs = [0.004, None, 0.001, 0.0]
    mesh = _meshed(once, Asked(Path("part.stl")))
    assert mesh.off == 0.001
    assert [MESHED_OTHERWISE in s and "from 1° on" in s for s in mesh.remarks] == [True]
    offs = [0.004, None, 0.001, 0.0]  # of a surface that was made anew, which is told
    assert _meshed(once, Asked(Path("part.stl"), anew=True)).remarks == []
    offs = [0.05, 0.02, *([None] * 20)]
    mesh = _meshed(once, Asked(Path("part.stl")))
    assert mesh.off == 0.02
    assert ["5 %" in mesh.remarks[0], "2 %" in mesh.remarks[1]] == [True, True]


def test_the_facets_of_a_file_may_stay_as_they_are(tmp_path):
    path = write(tmp_path / "cube.stl", *block(3, 10.0))
    (number,) = (k for k, attempt in enumerate(ATTEMPTS) if not attempt.cut)
    for size in (5e-3, 1e-3):
        mm = UnitSystem.of("mm")
        mesh = _content(path, None, mm, None, attempt=number, solid=True, size=size)
        corners = mesh.points[mesh.cells["triangle"]]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
        if size > 10e-3 * np.sqrt(2) / 3:  # the sides of the facets
            assert len(corners) == 6 * 2 * 3**2
        assert longest <= size
        assert mesh.off < 1e-9


def test_flat_facets_are_no_longer_than_asked_near_a_point(tmp_path):
    """Of a thin bar, of which cuts of all facets into four would leave long ones everywhere."""
    corners, triangles = block(1, 1.0)
    path = write(tmp_path / "bar.stl", corners * np.array([200.0, 10.0, 10.0]), triangles)
    (number,) = (k for k, one in enumerate(ATTEMPTS) if one.about == "with flat facets")
    asked = {"size": 20e-3, "refine": [((0.05, 0.005, 0.01), 1e-3)]}
    mesh = _content(path, None, UnitSystem.of("mm"), None, attempt=number, solid=True, **asked)
    sides = mesh.points[mesh.cells["triangle"]]
    longest = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).max(axis=1)
    near = np.linalg.norm(sides - np.array([0.05, 0.005, 0.01]), axis=2).min(axis=1) < 1.5e-3
    assert near.any()
    assert longest[near].max() < 1.5e-3
    assert longest.max() <= 20e-3


def drilled(size: float) -> tuple[np.ndarray, np.ndarray]:
    """Surface of a plate of 60 x 40 x 10 with holes of radius 8 and 5, in triangles of a size."""
    with gmsh_session() as gmsh:
        occ = gmsh.model.occ
        holes = [(3, occ.addCylinder(x, 20, 0, 0, 0, 10, r)) for x, r in ((18, 8), (45, 5))]
        occ.cut([(3, occ.addBox(0, 0, 0, 60, 40, 10))], holes)
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 36)
        gmsh.model.mesh.generate(2)
        tags, x, _ = gmsh.model.mesh.getNodes()
        row = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        row[tags] = np.arange(len(tags))
        triangles = row[gmsh.model.mesh.getElementsByType(2)[1]].reshape(-1, 3)
    return x.reshape(-1, 3), triangles


#: Areas of its faces: four sides, two walls, and top and bottom without the holes.
DRILLED = sorted([400, 400, 600, 600, 160 * np.pi, 100 * np.pi, *[2400 - 89 * np.pi] * 2])


def areas_of(points: np.ndarray, groups: Iterable[np.ndarray]) -> list[float]:
    """Areas of groups of triangles (n, 3), ascending."""
    return sorted(areas(points, triangles).sum() for triangles in groups)


@pytest.mark.parametrize(
    ("attempt", "near"),
    [("as it is", 0.02), ("with its facets as they are", 2e-3), ("in small patches", 0.08)],
)
def test_faces_end_at_sharp_edges_however_the_surface_is_meshed(tmp_path, attempt, near):
    """Large elements cut the holes, and small patches all edges, at which facets are inclined."""
    path = write(tmp_path / "plate.stl", *drilled(20.0))
    (number,) = (k for k, one in enumerate(ATTEMPTS) if one.about.startswith(attempt))
    mesh = _content(path, None, UnitSystem.of("m"), None, attempt=number, solid=True, size=4.0)
    faces = [mesh.cells["triangle"][parts["triangle"]] for parts in mesh.groups.values()]
    assert areas_of(mesh.points, faces) == pytest.approx(DRILLED, rel=near)


def test_a_surface_made_anew_has_the_faces_of_its_file():
    """Finer, and each point moved by up to fTetWild's envelope, 0.1 % of the diagonal of 73."""
    skin = cleaned(*drilled(20.0), "plate")
    points, triangles = drilled(1.5)
    moved = points + np.random.default_rng(0).uniform(-0.042, 0.042, points.shape)
    anew = cleaned(moved, triangles, "plate")
    kept = remade.with_faces(anew, skin, facets.by_side(facets.sides(skin)))
    of_file, faces = remade.of_file(kept, 1e-3)
    nearest = facets.nearest_triangles(of_file, 1e-3 * anew.points[anew.triangles])
    owned = [anew.triangles[np.isin(nearest, rows)] for rows in faces.values()]
    assert areas_of(anew.points, owned) == pytest.approx(DRILLED, rel=1e-2)


def test_holes_that_chords_would_fill_keep_their_edges(tmp_path):
    """A prism over a ring of 16 sides around a hole of 16: chords of 15 mm leave it."""
    path = write(tmp_path / "ring.stl", *tube(16, 10.0, 5.0, 6.0))
    with pytest.warns(ao.AntioscWarning, match=MESHED_OTHERWISE):
        mesh = ao.read_mesh(path, size=15e-3, unit="mm", solid=True)
    ring = 8 * np.sin(2 * np.pi / 16) * (10.0**2 - 5.0**2)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850e-9 * 6.0 * ring, rel=2e-3)


def test_bodies_that_share_a_face_are_one_and_a_fold_is_left_out():
    """Twice of a triangle: of a wall none is kept, of a patch that the file repeats one."""
    points, triangles = block(3)
    beside = points + np.array([1.0, 0.0, 0.0])
    both = np.vstack([triangles, triangles + len(points)])
    skin = cleaned(np.vstack([points, beside]), both, "two.stl")
    assert (skin.closed, skin.piece.max()) == (True, 0)
    assert volumes(skin.points, skin.triangles).sum() == pytest.approx(2.0)
    assert areas(skin.points, skin.triangles).sum() == pytest.approx(10.0)
    assert "36 of" in skin.remarks[0]
    fold = np.array([[*triangles[0, :2], len(points)], [*triangles[0, 1::-1], len(points)]])
    tip = points[triangles[0]].mean(axis=0) + np.array([0.0, 0.0, 0.1])
    skin = cleaned(np.vstack([points, tip]), np.vstack([triangles, fold]), "fold.stl")
    assert (skin.closed, len(skin.triangles)) == (True, len(triangles))
    sheet = np.vstack([triangles[:18], triangles[:18, ::-1]])
    assert len(cleaned(points, sheet, "sheet.stl").triangles) == 18


def test_bodies_that_touch_along_an_edge_are_closed():
    points, triangles = block(2)
    beside = points + np.array([1.0, 1.0, 0.0])
    both = np.vstack([triangles, triangles + len(points)])
    skin = cleaned(np.vstack([points, beside]), both, "two.stl")
    assert (skin.closed, skin.piece.max()) == (True, 0)
    assert volumes(skin.points, skin.triangles).sum() == pytest.approx(2.0)


def test_a_slit_without_width_is_sewn():
    """A side of length 3 lies along sides of 1, 1 and 1 (two corners), with nothing between."""
    axes = [[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]]
    points = np.array([*axes, [1, 0, 0], [2, 0, 0]], dtype=float)
    whole = [[0, 2, 1], [0, 3, 2], [1, 2, 3]]
    cut = [[0, 4, 3], [4, 5, 3], [5, 1, 3]]
    skin = cleaned(points, np.array([*whole, *cut]), "part")
    assert (skin.closed, len(skin.triangles)) == (True, 8)
    assert volumes(skin.points, skin.triangles).sum() == pytest.approx(4.5)
    assert skin.remarks == ["part: triangles that are cut at corners of others on their sides: 1."]


def test_a_mesh_with_less_volume_than_its_surface_is_told():
    mesh = FileMesh(np.vstack([np.zeros(3), np.eye(3)]), {"tetra": np.arange(4)[None]}, "gmsh")
    assert deviation(mesh, 1 / 6) == []
    (told,) = deviation(mesh, 1.05 / 6)
    assert "4.8 % less" in told
    (told,) = deviation(mesh, 0.95 / 6)
    assert "5.3 % more" in told
    assert deviation(mesh, 0.0) == []


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
def test_a_surface_that_pierces_itself_is_made_anew(tmp_path, monkeypatch):
    file = pierced(tmp_path / "dent.stl", deep=0.3)
    monkeypatch.setattr(kept_surfaces, "_folder", lambda: tmp_path / "kept")
    with monkeypatch.context() as missing:
        missing.setattr(remade, "installed", lambda: False)
        with pytest.raises(ao.MeshError, match="pip install pytetwild"):
            ao.read_mesh(file, size=0.2, solid=True, unit="m")
    pytest.importorskip("pytetwild")
    with pytest.warns(ChoiceWarning, match="made anew by fTetWild, within 0.1 % of"):
        mesh = ao.read_mesh(file, size=0.2, solid=True, unit="m")
    held = 1 - (1.3 - 0.3**3 / 1.3**2) / 3  # the cube without the pyramid above its bottom
    with pytest.warns(ao.AntioscWarning, match="of the diagonal"):
        again = ao.read_mesh(file, size=0.1, solid=True, unit="m")
    for one in (mesh, again):
        assert ao.Structure(one, STEEL).mass == pytest.approx(7850 * held, rel=3e-3)


def test_flattening_turns_over_no_tetrahedron():
    points = np.array([[0, 0, 0.0], [1, 0, 0], [0, 1, 0], [0, 0, 0.05], [0, 0, 1.0]])
    cells = np.array([[0, 1, 2, 3], [3, 1, 2, 4]])
    moved = points.copy()
    moved[3, 2] = 0.0  # flattens the first
    moved[4, 2] = 1.01
    result = remade._unfolded(points, moved, cells)
    assert result[3].tolist() == points[3].tolist()
    assert result[4].tolist() == moved[4].tolist()


def test_tetrahedra_that_touch_along_an_edge_alone_are_left_out():
    """Two about the edge 0-1 that share a face, and a thinner one that shares the edge alone."""
    points = np.array(
        [[0, 0, 0.0], [0, 0, 1], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 0, 0], [-1, -0.2, 0]]
    )
    cells = np.array([[0, 1, 2, 3], [0, 1, 3, 4], [0, 1, 5, 6]])
    assert remade.without_pinches(points, cells).tolist() == cells[:2].tolist()
    assert remade.without_pinches(points, cells[:2]).tolist() == cells[:2].tolist()


def test_surfaces_wind_around_what_several_solids_have_in_common_twice():
    """Two cubes of side 1, the second shifted by half; tetrahedra count once in the union."""
    corner = np.array(list(product((0.0, 1.0), repeat=3)))
    sides = np.array(
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    )
    triangles = np.vstack([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]])
    both = np.vstack([corner[triangles], corner[triangles] + (0.5, 0, 0)])
    places = np.array([(0.1, 0.4, 0.3), (0.8, 0.6, 0.7), (1.4, 0.5, 0.5), (0.5, 0.5, 1.1)])
    np.testing.assert_allclose(remade.winding(places, both), [1, 2, 1, 0], atol=1e-12)


def test_facets_near_a_point_are_cut_to_its_size_and_keep_their_surface():
    """A cube of twelve triangles: closed, of the same volume, and small near the point alone."""
    corners = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
    hull = ConvexHull(corners)
    turned, piece = facets.oriented(corners, hull.simplices.astype(np.int64))
    skin = facets.FacetSkin(corners, turned, piece)
    point = np.array([0.3, 0.4, 1.0])
    finer = facets.finer_near(skin, point, 0.02)
    assert facets._unpaired(finer.triangles) == 0
    assert facets.volumes(finer.points, finer.triangles).sum() == pytest.approx(1.0)
    assert facets.areas(finer.points, finer.triangles).min() > 0
    sides = finer.points[finer.triangles]
    lengths = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).max(axis=1)
    away = np.linalg.norm(sides.mean(axis=1) - point, axis=1)
    assert lengths[away < 0.04].max() <= 0.02
    assert len(finer.triangles) < 1500
    shortest = np.linalg.norm(sides - np.roll(sides, 1, axis=1), axis=2).min(axis=1)
    assert (shortest > 0.3 * lengths).all()


def test_facets_of_any_size_are_cut_into_so_many_at_most(monkeypatch):
    """Each round cuts a triangle into four at most."""
    monkeypatch.setattr(facets, "MOST_KEPT", 1000)
    skin = cleaned(*block(3), "cube.stl")
    assert 1000 <= len(facets.no_longer(skin, 1e-9).triangles) < 4000


def test_small_closed_surfaces_are_no_part_of_a_solid():
    """A crumb beside a tetrahedron, and a hollow in it that touches it at a corner."""
    large = np.array([[0, 0, 0.0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    points = np.vstack([large, 0.1 * large + 2, 0.1 * large])
    hollow = np.array([0, 9, 10, 11])[sides][:, ::-1]
    alone = remade.without_crumbs(points, np.vstack([sides, sides + 4, hollow]))
    assert alone.tolist() == sides.tolist()
    points[5:8] = 0.5 * large[1:] + 2  # an eighth of the volume
    both = np.vstack([sides, sides + 4])
    assert remade.without_crumbs(points, both).tolist() == both.tolist()
