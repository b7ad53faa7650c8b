"""Meshes as meshio gives them: blocks of one kind become one, and every way to name groups."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from antiosc.base.errors import MeshError
from antiosc.io import mesh_files
from antiosc.io.neutral import FileMesh
from antiosc.io.request import Request

SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1)], dtype=float)


def mesh(**more) -> SimpleNamespace:
    """Triangles in two blocks, a line between them."""
    blocks = [("triangle", [[0, 1, 2]]), ("line", [[0, 1]]), ("triangle", [[0, 2, 3], [1, 4, 5]])]
    given = {"points": SQUARE, "field_data": {}, "cell_data": {}, "cell_sets": {}, "point_data": {},
             **more}  # fmt: skip
    cells = [SimpleNamespace(type=kind, data=np.array(data)) for kind, data in blocks]
    return SimpleNamespace(cells=cells, **given)


def read(monkeypatch, content) -> FileMesh:
    monkeypatch.setattr(mesh_files, "_read", lambda path, name: content)
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


def test_fields_that_name_no_group_are_passed_over(monkeypatch):
    """MED and VTK keep fields where gmsh's formats keep (tag, dimension) of the groups' names."""
    fields = {"time": np.array([1.0]), "force": np.ones(3), "stress": {"TE4": 1}, "top": [7, 2]}
    tags = [np.array([7]), np.array([3]), np.array([7, 8])]
    content = mesh(field_data=fields, cell_data={"gmsh:physical": tags})
    assert groups(read(monkeypatch, content))["top"] == {"triangle": [0, 1]}


def test_cells_that_nothing_carries(monkeypatch):
    content = mesh()
    content.cells[0].type = "polygon"
    with pytest.raises(MeshError, match="polygon"):
        read(monkeypatch, content)


# --- Several kinds of cells -----------------------------------------------------------------------
