"""What every reader returns: packed for a pipe, merged, selected; kinds of files, other readers."""

from __future__ import annotations

import json
import resource
import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import antiosc as ao
from antiosc.io import mesh_files, reading
from antiosc.io.isolation import Request
from antiosc.io.mesh_files import is_deck
from antiosc.io.neutral import FileMesh, UnitSystem, packed, unpacked
from antiosc.io.reading import selected_mesh
from refusals import refused

CUBE = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
#: Two cubes along x, a free node, and the quadrilaterals around the first.
POINTS = np.array([*CUBE, *((2, y, z) for z in (0, 1) for y in (0, 1)), (9, 9, 9)], dtype=float)
HEXAHEDRA = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [1, 8, 9, 2, 5, 10, 11, 6]])
SIDES = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [1, 2, 6, 5]])


def cubes(**more) -> FileMesh:
    given = {"groups": {}, "node_sets": {}, **more}
    cells = {"hexahedron": HEXAHEDRA, "quad": SIDES, "line": np.array([[0, 1], [1, 2]])}
    cells |= {"vertex": np.array([[0]])}
    return FileMesh(POINTS.copy(), {k: v.copy() for k, v in cells.items()}, **given)


def whole() -> FileMesh:
    groups = {"a": {"hexahedron": np.array([1]), "quad": np.array([0, 2])}}
    groups |= {"b": {"line": np.array([1])}}
    nodes = {"n": np.array([0, 1, 2, 3]), "m": np.array([8, 9, 10, 11, 12])}
    fixed = {"f": {0: np.array([[3], [5]]), 2: np.array([[0, 1, 2, 3]])}}
    fixed |= {"g": {1: np.array([[1, 2]])}}
    told, model = ["one", "two"], {"families": [["x", 1.5, None]]}
    return cubes(
        groups=groups,
        node_sets=nodes,
        fixed=fixed,
        remarks=told,
        model=model,
        has_construction_aids=True,
    )


def same(one: FileMesh, other: FileMesh) -> None:
    np.testing.assert_array_equal(one.points, other.points)
    assert one.has_construction_aids == other.has_construction_aids
    assert (one.remarks, one.model) == (other.remarks, other.model)
    for key in ("cells", "node_sets"):
        assert {n: r.tolist() for n, r in getattr(one, key).items()} == {
            n: r.tolist() for n, r in getattr(other, key).items()
        }
    for key in ("groups", "fixed"):
        assert {n: {k: r.tolist() for k, r in p.items()} for n, p in getattr(one, key).items()} == {
            n: {k: r.tolist() for k, r in p.items()} for n, p in getattr(other, key).items()
        }


def test_a_mesh_comes_back_through_json_and_arrays():
    head, arrays = packed(whole())
    same(unpacked(json.loads(json.dumps(head)), arrays), whole())


def test_nodes_at_one_place_become_the_first_of_them():
    """Two cubes with nodes of their own at their common face; the joints follow."""
    points = np.vstack([POINTS[:8], POINTS[[1, 8, 9, 2, 5, 10, 11, 6]] + 1e-4])
    mesh = FileMesh(points, {"hexahedron": np.arange(16).reshape(2, 8)})
    mesh.node_sets = {"a": np.array([1, 8, 11]), "b": np.array([9])}
    mesh.fixed = {"f": {1: np.array([[8, 11]]), 0: np.array([[15]])}}
    terms = [(8, 0, 1.5), (9, 3, -2.0), (-1, 4, 1.0)]
    mesh.model = {"apart": [], "x": 1, "joints": {
        "equations": [terms], "springs": [(terms, 7.0)], "dampers": [(terms, 8.0)],
        "masses": [([terms, terms], [[1.0]], 2.0)], "among": [(15, [(8, 0.5), (9, 0.5)])],
        "points": [[1.0, 2.0, 3.0]],
    }}  # fmt: skip
    found = reading.with_merged_nodes(mesh, 1e-3)
    np.testing.assert_array_equal(found.points, np.vstack([points[:8], points[[9, 10, 13, 14]]]))
    assert found.cells["hexahedron"].tolist() == [list(range(8)), [1, 8, 9, 2, 5, 10, 11, 6]]
    assert {n: r.tolist() for n, r in found.node_sets.items()} == {"a": [1, 2], "b": [8]}
    assert found.fixed["f"][1].tolist() == [[1, 2]]
    assert found.fixed["f"][0].tolist() == [[6]]
    new = [(1, 0, 1.5), (8, 3, -2.0), (-1, 4, 1.0)]
    assert found.model == {"apart": [], "x": 1, "joints": {
        "equations": [new], "springs": [(new, 7.0)], "dampers": [(new, 8.0)],
        "masses": [([new, new], [[1.0]], 2.0)], "among": [(6, [(1, 0.5), (8, 0.5)])],
        "points": [[1.0, 2.0, 3.0]],
    }}  # fmt: skip
    mesh.model = {**mesh.model, "apart": [8, 3]}
    assert len(reading.with_merged_nodes(mesh, 1e-3).points) == 13
    assert len(reading.with_merged_nodes(mesh, 1e-5).points) == 16


WRONG = {
    "no cells": (FileMesh(POINTS, {"vertex": np.array([[0]])}), None, None, "vertex"),
    "nothing": (FileMesh(POINTS, {}), None, None, "found"),
    "mixed": (
        FileMesh(POINTS, {"quad": SIDES, "triangle": SIDES[:2, :3]}), None,
        None, "mixes cell kinds"),
    "lost": (
        FileMesh(POINTS, {"hexahedron": HEXAHEDRA, "line": np.array([[0, 1], [0, 2], [3, 6]]),
                               "quad": np.array([[0, 1, 2, 5]])}), None, None, "besides"),
    "dimension": (FileMesh(POINTS, {"quad": SIDES}), 3, None, "dimension 3"),
    "group": (
        cubes(groups={"b": {"quad": np.array([0])}, "a": {"line": np.array([0])},
                            "v": {"vertex": np.array([0])}}), "v", None, "no group"),
    "no group": (cubes(), ["x"], None, "no group"),
    "infinite": (
        FileMesh(np.full((2, 3), np.inf), {"line": np.array([[0, 1]])}),
        None, None, "coordinates"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_mesh_is_told(case):
    mesh, wanted, line, word = WRONG[case]
    with refused(line, word):
        selected_mesh(mesh, wanted, None, "p.vtu")


# --- Meshes as meshio gives them: blocks of one kind become one, and every way to name groups -----


SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1)], dtype=float)


def mesh(**more) -> SimpleNamespace:
    """Triangles in two blocks, a line between them."""
    blocks = [("triangle", [[0, 1, 2]]), ("line", [[0, 1]]), ("triangle", [[0, 2, 3], [1, 4, 5]])]
    given = {"points": SQUARE, "field_data": {}, "cell_data": {}, "cell_sets": {}, "point_data": {},
             **more}  # fmt: skip
    cells = [SimpleNamespace(type=kind, data=np.array(data)) for kind, data in blocks]
    return SimpleNamespace(cells=cells, **given)


def read(monkeypatch, content) -> FileMesh:
    monkeypatch.setattr(mesh_files, "_content", lambda path, name: content)
    return mesh_files.read_by_meshio(Request("/a/part.vtu", "part.vtu"))


def groups(found: FileMesh) -> dict:
    return {n: {k: r.tolist() for k, r in parts.items()} for n, parts in found.groups.items()}


def test_every_way_in_which_files_name_groups(monkeypatch):
    """By numbers of cells with names beside them, without, by sets, and by tags of points."""
    data = {
        "gmsh:physical": [np.array([7]), np.array([7]), np.array([8, 7])],
        "gmsh:geometrical": [np.array([1]), np.array([1]), np.array([1, 1])],
        "cell_tags": [np.array([-1]), np.array([0]), np.array([-1, -2])],
        "medit:ref": [np.array([3]), np.array([3]), np.array([4, 4])],
        "part": [np.array([5]), np.array([5]), np.array([5, 6])],
        "heat": [np.array([0.5]), np.array([0.5]), np.array([0.5, 0.5])],
        "both": [np.array([[1, 2]]), np.array([[1, 2]]), np.array([[1, 2], [1, 2]])],
    }
    sets = {"chosen": [None, np.array([0]), np.array([1])], "part": [np.array([0]), None, None],
            "empty": [np.array([]), None, None]}  # fmt: skip
    content = mesh(
        field_data={"skin": (7, 2), "rim": (7, 1)}, cell_data=data, cell_sets=sets,
        cell_tags={-1: ["a", "b"]}, point_sets={"n": [1, 2]}, point_tags={9: ["tip"], 8: ["none"]},
        point_data={"point_tags": np.array([0, 9, 9, 0, 0, 0])},
    )  # fmt: skip
    found = read(monkeypatch, content)
    assert groups(found) == {
        "skin": {"triangle": [0, 2]}, "rim": {"line": [0]}, "8": {"triangle": [1]},
        "a": {"triangle": [0, 1]}, "b": {"triangle": [0, 1]},
        "3": {"triangle": [0], "line": [0]}, "4": {"triangle": [1, 2]},
        "part=5": {"triangle": [0, 1], "line": [0]}, "part=6": {"triangle": [2]},
        "chosen": {"line": [0], "triangle": [2]},
    }  # fmt: skip
    assert {name: rows.tolist() for name, rows in found.node_sets.items()} == {
        "n": [1, 2], "tip": [1, 2], "none": [],
    }  # fmt: skip


# --- Limits of the process that reads: what the kernel is asked for, written down instead ---------


@pytest.fixture
def asked(monkeypatch) -> list[tuple]:
    found: list[tuple] = []
    monkeypatch.setattr(resource, "setrlimit", lambda *one: found.append(("limit", *one)))
    monkeypatch.setattr(signal, "signal", lambda *one: found.append(("signal", *one)))
    monkeypatch.setattr(signal, "setitimer", lambda *one: found.append(("timer", *one)))
    return found


OPTIONS = {
    ("a.msh", (("solid", True),)): (None, "solid fills"),
    ("a.msh", (("fragments", True),)): (None, "fragments joins"),
    ("a.STEP", ()): (None, "a.STEP"),
    ("a.stl", (("solid", True),)): (None, "a.stl"),
    ("a.igs", (("size", 1.0), ("unit", UnitSystem(1.0)))): (None, "states"),
    ("a.geo", (("merge", 1e-3),)): (None, "applies"),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_options_that_do_not_fit_a_file(tmp_path, case):
    name, options = case
    with refused(*OPTIONS[case], ao.MeshError):
        reading.read(tmp_path / name, **dict(options))


PROGRAM = '''
import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.neutral import FileMesh
from antiosc.io.isolation import FileReader, Request


def read(ask: Request) -> FileMesh:
    """Lines between points, one a line of the file."""
    points = np.loadtxt(ask.path, ndmin=2)
    if len(points) < 2 or points.shape[1] != 3:
        raise MeshError(f"{ask.name} must have two points of three coordinates or more.")
    lines = np.array([[k, k + 1] for k in range(len(points) - 1)])
    return FileMesh(
        points, {"line": lines}, groups={"wire": {"line": np.arange(len(lines))}}
    )


POLYLINE = FileReader(read)
'''
SHARED = "\nSHARED = FileReader(read, matches=lambda start: not start.startswith(b'*'))\n"


@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """A package that registers a reader of `.inp` and two broken ones too."""
    folder = tmp_path / "site"
    information = folder / "polylines-1.dist-info"
    information.mkdir(parents=True)
    (folder / "polylines.py").write_text(PROGRAM + SHARED)
    (information / "METADATA").write_text("Name: polylines\nVersion: 1\n")
    points = {
        "xyz": "polylines:POLYLINE",
        "inp": "polylines:SHARED",
        "bad": "polylines:read",
        "lost": "nowhere:READER",
    }
    text = "\n".join(f"{name} = {value}" for name, value in points.items())
    (information / "entry_points.txt").write_text(f"[antiosc.readers]\n{text}\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(folder)])
    return tmp_path


@pytest.mark.slow
def test_a_package_adds_a_reader(package):
    path = package / "wire.xyz"
    path.write_text("0 0 0\n1 0 0\n1 2 0\n")
    raw = reading.read(path)
    assert raw.cells.tolist() == [[0, 1], [1, 2]]
    assert set(raw.groups) == {"wire"}
    path.with_suffix(".inp").write_text(path.read_text())  # known by its content beside decks
    np.testing.assert_array_equal(reading.read(path.with_suffix(".inp")).points, raw.points)
    assert not is_deck(path.with_suffix(".inp"))
    path.with_suffix(".inp").write_text("*NODE\n1,0,0,0\n2,1,0,0\n*ELEMENT,TYPE=B31\n1,1,2\n")
    assert is_deck(path.with_suffix(".inp"))
    assert len(reading.read(path.with_suffix(".inp")).cells) == 1


@pytest.mark.slow
@pytest.mark.fem
@pytest.mark.parametrize("value", [1e300, np.nan, np.inf])
def test_coordinates_that_no_part_has(tmp_path, value):
    import meshio

    points = np.vstack([np.zeros(3), np.eye(3)])
    points[1, 0] = value
    meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])]).write(tmp_path / "a.vtu")
    with pytest.raises(ao.MeshError, match="coordinates up to"):
        ao.read_mesh(tmp_path / "a.vtu")
