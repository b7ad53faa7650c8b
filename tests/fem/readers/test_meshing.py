"""Sizes of elements, damaged files, CAD, and several kinds of cells in one mesh."""

from __future__ import annotations

import random
import re
import warnings
from itertools import product
from pathlib import Path

import gmsh
import meshio
import numpy as np
import pytest

import antiosc as ao
import parts
from antiosc.io import by_gmsh
from antiosc.io.by_gmsh import _node_order
from antiosc.io.neutral import CELL_TYPES, EDGES, quadrilateral_faces
from parts import gmsh_session
from paths import MESHES


def cube(session, path: Path, kernel: str) -> Path:
    if kernel == "occ":
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path.with_suffix(".brep")))
        return path.with_suffix(".brep")
    path = path.with_suffix(".geo")
    path.write_text(
        "Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {1, 1, 0}; Point(4) = {0, 1, 0};"
        "Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};"
        "Curve Loop(1) = {1:4}; Plane Surface(1) = {1}; Extrude {0, 0, 1} { Surface{1}; }\n"
        f"Mesh.ElementOrder = {2 if kernel == 'own, order 2' else 1};\n"
    )
    return path


def damaged(content: bytes, rng: random.Random) -> bytes:
    """The bytes cut, flipped, with huge counts, or rearranged."""
    b = bytearray(content)
    kind = rng.random()
    i, j = sorted(rng.randrange(len(b)) for _ in range(2))
    if kind < 0.2:
        return bytes(b[:i])
    if kind < 0.5:
        for _ in range(rng.choice([1, 3, 30])):
            b[rng.randrange(len(b))] ^= 1 << rng.randrange(8)
        return bytes(b)
    numbers = list(re.finditer(rb"\d+", bytes(b)))
    if kind < 0.8 and numbers:
        m = rng.choice(numbers[: rng.choice([10, len(numbers)])])
        huge = rng.choice([b"999999999999", b"-1", b"0", b"2147483647", b"nan", b"1e300"])
        return bytes(b[: m.start()]) + huge + bytes(b[m.end() :])
    return bytes(b[:i] + b[j:]) if kind < 0.9 else bytes(b[:j] + b[i:])


@pytest.mark.slow
def test_damaged_files_are_refused_or_read(tmp_path):
    rng = random.Random(0)
    files = [MESHES / "bracket.step", MESHES / "lever.msh"]
    for version in (2.2, 4.1):
        for binary in (False, True):
            name = tmp_path / f"cube{version}{binary}.msh"
            files.append(parts.gmsh_cube(name, "tetrahedron", 1, version=version, binary=binary))
    source = meshio.read(files[2])
    body = meshio.Mesh(source.points, [("tetra", source.get_cells_type("tetra"))])
    for suffix in ("inp", "bdf", "vtu", "vtk", "med", "xdmf"):
        body.write(tmp_path / f"cube.{suffix}")
        files.append(tmp_path / f"cube.{suffix}")
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(files[2]))
    for suffix in ("stl",):
        gmsh.write(str(tmp_path / f"cube.{suffix}"))
        files.append(tmp_path / f"cube.{suffix}")
    files += [cube(gmsh, tmp_path / "cube", kernel) for kernel in ("occ", "own")]
    gmsh.finalize()
    told = []
    for k in range(15):
        file = rng.choice(files)
        path = tmp_path / f"damaged{k}{file.suffix}"
        path.write_bytes(damaged(file.read_bytes(), rng))
        geometry = file.suffix in by_gmsh.GEOMETRY_ENDINGS
        with warnings.catch_warnings(action="ignore"):
            try:
                ao.read_mesh(path, size=0.5 if geometry else None, timeout=5)
            except ao.InputError as error:
                told.append(str(error))
    assert len(told) > 4
    assert not [t for t in told if "\n" in t or not t.endswith(".")]


STEEL = ao.Solid(210e9, 0.3, 7850.0)


def stl(path: Path, skipped: int = 0) -> Path:
    """A box of 40 × 20 × 10, its first triangles left out."""
    corners = np.array(list(product((0, 40), (0, 20), (0, 10))), dtype=float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))][skipped:]
    text = "solid box\n"
    for triangle in triangles:
        text += "facet normal 0 0 0\nouter loop\n"
        for k in triangle:
            text += "vertex {:g} {:g} {:g}\n".format(*corners[k])
        text += "endloop\nendfacet\n"
    path.write_text(text + "endsolid box\n")
    return path


def write_brep(path: Path, axis: bool = False) -> None:
    """A cube of edge 10, with a line through it if `axis`."""
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        kernel.addBox(0, 0, 0, 10, 10, 10)
        if axis:
            kernel.addLine(kernel.addPoint(-5, 5, 5), kernel.addPoint(15, 5, 5))
        kernel.synchronize()
        gmsh.write(str(path))


@pytest.fixture(scope="module")
def assembly(tmp_path_factory) -> Path:
    """Two boxes that touch on half of a face, in a STEP file in mm."""
    path = tmp_path_factory.mktemp("cad") / "two.step"
    with gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")  # OpenCASCADE keeps the last one
        gmsh.model.occ.addBox(0, 0, 0, 40, 20, 10)
        gmsh.model.occ.addBox(0, 0, 10, 20, 20, 10)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    text = path.read_text()
    for k, name in ((1, "base"), (2, "post")):  # the names that the writer gives them
        number = text.index(f".{k}'")
        first = text.rindex("'", 0, number)
        text = text.replace(text[first : number + 3], f"'{name}'")
    path.write_text(text)
    return path


@pytest.mark.slow
def test_solids_of_an_assembly_share_nodes_and_have_their_names(assembly):
    with pytest.raises(ao.MeshError, match="falls into 2 pieces"):
        ao.read_mesh(assembly, size=8e-3)
    mesh = ao.read_mesh(assembly, size=8e-3, fragments=True)
    assert {name for name in mesh.groups if not name.startswith("face")} == {"base", "post"}
    both = {"base": STEEL, "post": ao.Solid(70e9, 0.3, 2700.0)}
    mass = 7850 * 8e-6 + 2700 * 4e-6
    assert ao.Structure(mesh, both).mass == pytest.approx(mass, rel=1e-9)
    alone = ao.read_mesh(assembly, size=8e-3, parts=["post"])
    assert ao.Structure(alone, STEEL).mass == pytest.approx(7850 * 4e-6, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "length"), [("2,2HMM", 0.1), ("6,1HM", 100), ("1,2HIN", 2.54)])
def test_an_iges_curve_is_in_metres(tmp_path, unit, length):
    """A line of 100 of the file's units, in the standard's sections S, G, D, P, T of 80 columns."""
    values = f"1H,,1H;,4Hline,4Hline,4Hnone,4Hnone,32,308,15,308,15,4Hline,1.,{unit},1,0.01,"
    values += "15H20200101.000000,1E-6,100.,4Hnone,4Hnone,11,0,15H20200101.000000;"
    lines = ["line".ljust(72) + "S      1"]
    rows = [values[k : k + 72] for k in range(0, len(values), 72)]
    lines += [row.ljust(72) + f"G{k + 1:7d}" for k, row in enumerate(rows)]
    lines.append(f"{110:8d}{1:8d}" + f"{0:8d}" * 6 + "00000000" + "D      1")
    lines.append(f"{110:8d}{0:8d}{0:8d}{1:8d}{0:8d}" + " " * 32 + "D      2")
    lines.append("110,0.,0.,0.,100.,0.,0.;".ljust(64) + f"{1:8d}" + "P      1")
    lines.append(f"S{1:7d}G{len(rows):7d}D{2:7d}P{1:7d}".ljust(72) + "T      1")
    path = tmp_path / "line.iges"
    path.write_text("\n".join(lines) + "\n")
    mesh = ao.read_mesh(path, size=0.2 * length)
    assert (mesh.cell, mesh.n_cells >= 5) == ("interval", True)
    assert mesh.extent() == pytest.approx(length, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".geo", ".brep"])
def test_geometries_without_a_unit_of_their_own_take_one(tmp_path, suffix):
    """A cube of 10 mm, refined at a corner, in gmsh's script and in OpenCASCADE's own format."""
    path = tmp_path / f"cube{suffix}"
    if suffix == ".geo":
        path.write_text('SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 10, 10, 10};\n')
    else:
        write_brep(path)
    options = {"size": 5e-3, "refine": [((0.01, 0.01, 0.01), 5e-4)], "unit": "mm"}
    mesh = ao.read_mesh(path, **options)
    assert ao.Structure(mesh, STEEL).mass == pytest.approx(7850 * 1e-6, rel=1e-9)
    assert mesh.n_cells > 1.5 * ao.read_mesh(path, size=5e-3, unit="mm").n_cells
    with pytest.raises(ao.MeshError, match=r"at a size of 1e-09 m, more than"):
        ao.read_mesh(path, size=1e-9, unit="mm")


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])


SIDES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def write(path: Path, points, *blocks) -> Path:
    meshio.write(path, meshio.Mesh(np.asarray(points, dtype=float), list(blocks)))
    return path


def mixed_box(path: Path, n: int, kinds: str) -> Path:
    """A unit cube of n³ bricks: whole, of two wedges, or of six pyramids."""
    number = {p: k for k, p in enumerate(product(range(n + 1), repeat=3))}
    points = [np.array(p) / n for p in number]
    cells: dict[str, list[list[int]]] = {"hexahedron": [], "wedge": [], "pyramid": []}
    for i, j, k in product(range(n), repeat=3):
        around = [(0, 0), (1, 0), (1, 1), (0, 1)]
        c = [number[i + a, j + b, k + d] for d in (0, 1) for a, b in around]
        kind = kinds[(i + j) % len(kinds)]
        if kind == "h":
            cells["hexahedron"].append(c)
        elif kind == "w":
            halves = ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))
            cells["wedge"] += [[c[v] for v in half] for half in halves]
        else:
            points.append((np.array([i, j, k]) + 0.5) / n)
            middle = len(points) - 1
            for face in SIDES:
                cells["pyramid"].append([*(c[v] for v in face), middle])
    return write(path, points, *((kind, rows) for kind, rows in cells.items() if rows))


def rollers() -> list[ao.Support]:
    """No motion across the sides of the unit cube."""
    return [
        ao.Support(fix="xyz"[axis], plane=(corner, np.eye(3)[axis]))
        for axis in range(3)
        for corner in ((0, 0, 0), (1, 1, 1))
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kinds", ["h", "hw", "wp"])
def test_every_mix_converges_with_order_four(tmp_path, kinds):
    """A cube between rollers: ω² = 2 π² μ/ρ, u = (sin πx cos πy, −cos πx sin πy, 0)."""
    import scipy.sparse as sp
    from scipy.sparse.linalg import eigsh

    exact = 2 * np.pi**2 * STEEL.E / (2 * (1 + STEEL.nu)) / STEEL.rho
    errors = []
    for n in (3, 5):
        mesh = ao.read_mesh(mixed_box(tmp_path / f"{n}.vtu", n, kinds))
        part = ao.Structure(mesh, STEEL, rollers())
        assert part.mass == pytest.approx(STEEL.rho, rel=1e-12)
        K, M = (sp.csr_matrix(A.getValuesCSR()[::-1]) for A in (part.K, part.M))
        free = np.setdiff1d(np.arange(K.shape[0]), part.fixed)
        K, M = (A[free][:, free].tocsc() for A in (K, M))
        found = eigsh(K, 3, M, sigma=0.5 * exact, which="LM")[0]
        errors.append(found.min() / exact - 1)
    assert 0 < errors[1] < errors[0] < 0.1
    order = np.log(errors[0] / errors[1]) / np.log(5 / 3)
    assert order > 3.4, (order, errors)


@pytest.mark.parametrize("name", ["tetra10", "hexahedron27", "wedge15", "wedge18", "pyramid14"])
def test_gmshs_second_order_nodes_are_put_in_order(name):
    gmsh = pytest.importorskip("gmsh")
    shape, nodes, _ = CELL_TYPES[name]
    family = {"tetra": "Tetrahedron", "wedge": "Prism", "pyramid": "Pyramid"}
    gmsh.initialize()
    try:
        serendipity = name == "wedge15"
        kind = gmsh.model.mesh.getElementType(family.get(shape, "Hexahedron"), 2, serendipity)
        _, dim, _, n, x, corners = gmsh.model.mesh.getElementProperties(kind)
        order = _node_order(gmsh, kind, name)
    finally:
        gmsh.finalize()
    assert n == nodes
    x = np.reshape(x, (n, dim))[order]
    edges = np.array(EDGES[shape])
    middles = x[corners : corners + len(edges)]
    np.testing.assert_allclose(x[edges].mean(axis=1), middles, atol=1e-12)
    if n > corners + len(edges):
        for face, node in zip(quadrilateral_faces(shape), x[corners + len(edges) :], strict=False):
            np.testing.assert_allclose(x[list(face)].mean(axis=0), node, atol=1e-12)


@pytest.mark.slow
def test_serendipity_cells_get_their_nodes(tmp_path):
    bulge = [(SQUARE[a] + SQUARE[b]) / 2 for a, b in EDGES["quad"]]
    bulge[0][1] -= 0.3  # a parabola of 2/3 · 0.3
    path = write(tmp_path / "a.vtu", [*SQUARE, *bulge], ("quad8", [range(8)]))
    mesh = ao.read_mesh(path)
    assert (mesh.cell, mesh.order) == ("quadrilateral", 2)
    part = ao.Structure(mesh, ao.Solid(210e9, 0.3, 1000.0, plane="stress"))
    assert part.mass == pytest.approx(1200, rel=1e-12)
    assert ao.read_mesh(path, order=1).order == 1
