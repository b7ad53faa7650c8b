"""What every reader returns: packed for a pipe, merged, selected."""

from __future__ import annotations

import json

import numpy as np
import pytest

from antiosc.errors import MeshError
from antiosc.fem.readers import _alone, merging
from antiosc.fem.readers.neutral import FileMesh, of_dimension, packed, unpacked
from antiosc.fem.readers.selection import selected
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
    return FileMesh(POINTS.copy(), {k: v.copy() for k, v in cells.items()}, "vtk", **given)


def whole() -> FileMesh:
    groups = {"a": {"hexahedron": np.array([1]), "quad": np.array([0, 2])}}
    groups |= {"b": {"line": np.array([1])}}
    nodes = {"n": np.array([0, 1, 2, 3]), "m": np.array([8, 9, 10, 11, 12])}
    fixed = {"f": {0: np.array([[3], [5]]), 2: np.array([[0, 1, 2, 3]])}}
    fixed |= {"g": {1: np.array([[1, 2]])}}
    told, model = ["one", "two"], {"families": [["x", 1.5, None]]}
    return cubes(groups=groups, node_sets=nodes, fixed=fixed, told=told, model=model, aids=True)


def same(one: FileMesh, other: FileMesh) -> None:
    np.testing.assert_array_equal(one.points, other.points)
    assert (one.convention, one.aids) == (other.convention, other.aids)
    assert (one.told, one.model) == (other.told, other.model)
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


DAMAGED = {
    "points": (2, POINTS[:, :2], None, "points"),
    "flat": (2, POINTS.ravel(), None, "points"),
    "whole": (2, POINTS.astype(int), None, "points"),
    "cells": (3, HEXAHEDRA[:, :7], None, "hexahedron"),
    "a row": (3, HEXAHEDRA[0], None, "hexahedron"),
    "nodes": (3, HEXAHEDRA + 2, None, "name"),
    "negative": (4, SIDES - 1, None, "quad"),
    "numbers": (4, SIDES.astype(float), None, "float64"),
    "rows": (0, np.array([2, 0, 2, 1]), None, "group"),
    "rows of b": (0, np.array([1, 0, 2, 2]), None, "line"),
    "sets": (1, np.full(18, 13), None, "node"),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGED)
def test_what_is_not_consistent_is_refused(case):
    k, wrong, line, word = DAMAGED[case]
    head, arrays = packed(whole())
    with refused(line, word, ValueError):
        unpacked(head, [*arrays[:k], wrong, *arrays[k + 1 :]])


# --- Merging --------------------------------------------------------------------------------------


def test_nodes_at_one_place_become_the_first_of_them():
    """Two cubes with nodes of their own at their common face; the joints follow."""
    points = np.vstack([POINTS[:8], POINTS[[1, 8, 9, 2, 5, 10, 11, 6]] + 1e-4])
    mesh = FileMesh(points, {"hexahedron": np.arange(16).reshape(2, 8)}, "vtk")
    mesh.node_sets = {"a": np.array([1, 8, 11]), "b": np.array([9])}
    mesh.fixed = {"f": {1: np.array([[8, 11]]), 0: np.array([[15]])}}
    terms = [[8, 0, 1.5], [9, 3, -2.0], [-1, 4, 1.0]]
    mesh.model = {"apart": [], "x": 1, "joints": {
        "equations": [terms], "springs": [[terms, 7.0]], "dampers": [[terms, 8.0]],
        "masses": [[[terms, terms], [[1.0]], 2.0]], "among": [(15, [(8, 0.5), (9, 0.5)])],
        "points": [[1.0, 2.0, 3.0]],
    }}  # fmt: skip
    found = merging.merged(mesh, 1e-3)
    np.testing.assert_array_equal(found.points, np.vstack([points[:8], points[[9, 10, 13, 14]]]))
    assert found.cells["hexahedron"].tolist() == [list(range(8)), [1, 8, 9, 2, 5, 10, 11, 6]]
    assert {n: r.tolist() for n, r in found.node_sets.items()} == {"a": [1, 2], "b": [8]}
    assert found.fixed["f"][1].tolist() == [[1, 2]]
    assert found.fixed["f"][0].tolist() == [[6]]
    new = [[1, 0, 1.5], [8, 3, -2.0], [-1, 4, 1.0]]
    assert found.model == {"apart": [], "x": 1, "joints": {
        "equations": [new], "springs": [[new, 7.0]], "dampers": [[new, 8.0]],
        "masses": [[[new, new], [[1.0]], 2.0]], "among": [(6, [(1, 0.5), (8, 0.5)])],
        "points": [[1.0, 2.0, 3.0]],
    }}  # fmt: skip
    mesh.model = {"apart": [8, 3], "joints": {}}
    assert len(merging.merged(mesh, 1e-3).points) == 13
    assert len(merging.merged(mesh, 1e-5).points) == 16


# --- Selection ------------------------------------------------------------------------------------


def groups_of(raw) -> dict[str, dict[int, list]]:
    return {n: {d: e.tolist() for d, e in parts.items()} for n, parts in raw.groups.items()}


def test_cells_of_the_highest_dimension_are_the_mesh():
    """The others are groups; node sets are facets on the outside, and the nodes left over."""
    mesh = whole()
    mesh.aids = False
    mesh.fixed = {"held": {1: np.array([[4, 5], [5, 12]])}, "gone": {0: np.array([[12]])}}
    raw = selected(mesh, None, None, "part.vtu")
    assert (raw.kind.shape, raw.cells.tolist()) == ("hexahedron", HEXAHEDRA.tolist())
    assert raw.points.tolist() == POINTS[:12].tolist()
    assert raw.numbers.tolist() == list(range(12))
    assert raw.told == ["one", "two"]
    assert raw.model == mesh.model
    found = groups_of(raw)
    assert [sorted(f) for f in found.pop("m")[2]] == [[8, 9, 10, 11]]
    assert found == {
        "a": {3: [HEXAHEDRA[1].tolist()], 2: [SIDES[0].tolist(), SIDES[2].tolist()]},
        "b": {1: [[1, 2]]},
        "n": {2: [[0, 1, 2, 3]]},
        "held": {1: [[4, 5]]},
        "gone": {},
    }


def test_nodes_of_a_set_that_span_no_face_are_points():
    mesh = cubes(node_sets={"n": np.array([1, 2, 5, 6, 0]), "away": np.array([12])})
    raw = selected(mesh, None, None, "part.vtu")
    # 1-2-6-5 lies between the two cells
    assert {n: {d: e.ravel().tolist() for d, e in p.items()} for n, p in raw.groups.items()} == {
        "n": {0: [0, 1, 2, 5, 6]},
    }  # fmt: skip


CHOICES = {
    2: ("quadrilateral", SIDES.tolist()),
    1: ("interval", [[0, 1], [1, 2]]),
    "a": ("hexahedron", [HEXAHEDRA[1].tolist()]),
    "b": ("interval", [[1, 2]]),
    ("b", "q"): ("quadrilateral", [SIDES[1].tolist(), SIDES[2].tolist()]),
}


@pytest.mark.parametrize("wanted", CHOICES)
def test_chosen_cells(wanted):
    shape, cells = CHOICES[wanted]
    groups = {"a": {"hexahedron": np.array([1])}, "b": {"line": np.array([1])},
              "q": {"quad": np.array([2, 1])}}  # fmt: skip
    raw = selected(cubes(groups=groups), wanted, None, "part.vtu")
    used = sorted({n for cell in cells for n in cell})
    assert raw.kind.shape == shape
    assert raw.numbers.tolist() == used
    assert [[used[n] for n in cell] for cell in raw.cells.tolist()] == cells


def test_cells_in_groups_are_the_mesh_where_others_are_aids():
    """As gmsh writes files: cells in no group were drawn to construct the rest."""
    mesh = cubes(groups={"a": {"hexahedron": np.array([1])}}, aids=True)
    assert selected(mesh, None, None, "part.msh").numbers.tolist() == [1, 2, 5, 6, 8, 9, 10, 11]
    assert len(selected(cubes(aids=True), None, None, "part.msh").cells) == 2


def lines(*cells) -> FileMesh:
    x = np.array([(0, 0, 0), (2, 0, 0), (4, 1, 0), (1, 0, 0), (3, 0.5, 0)], dtype=float)
    return FileMesh(x, {"line3": np.array(cells)}, "vtk")


@pytest.mark.parametrize("order", [None, 1])
def test_the_middle_of_a_line_is_found_by_its_place(order):
    for cells in (((0, 1, 3), (1, 2, 4)), ((0, 3, 1), (1, 4, 2))):
        raw = selected(lines(*cells), None, order, "part.vtu")
        x = raw.points[raw.cells]
        assert raw.kind.nodes == (2 if order else 3)
        np.testing.assert_array_equal(x[:, :2, 0], [[0, 2], [2, 4]])
    with pytest.raises(MeshError, match="give their nodes in no known order"):
        selected(lines((3, 0, 1), (4, 1, 2)), None, None, "part.vtu")


X = ("one mesh carries one kind of cells, so say which are meant, as in cells=3 (dimension) or "
     'cells="group".')  # fmt: skip
WRONG = {
    "no cells": (FileMesh(POINTS, {"vertex": np.array([[0]])}, "vtk"), None, None, "vertex"),
    "nothing": (FileMesh(POINTS, {}, "vtk"), None, None, "found"),
    "mixed": (
        FileMesh(POINTS, {"quad": SIDES, "triangle": SIDES[:2, :3]}, "vtk"), None,
        None, "Mesh.RecombineAll"),
    "lost": (
        FileMesh(POINTS, {"hexahedron": HEXAHEDRA, "line": np.array([[0, 1], [0, 2], [3, 6]]),
                               "quad": np.array([[0, 1, 2, 5]])}, "vtk"), None, None, "carries"),
    "dimension": (FileMesh(POINTS, {"quad": SIDES}, "vtk"), 3, None, "for"),
    "group": (
        cubes(groups={"b": {"quad": np.array([0])}, "a": {"line": np.array([0])},
                            "v": {"vertex": np.array([0])}}), "v", None, "cells="),
    "no group": (cubes(), ["x"], None, "cells="),
    "serendipity": (
        FileMesh(np.eye(8, 3), {"quad8": np.arange(8)[None]}, "vtk"), None, None, "second-order"),
    "infinite": (
        FileMesh(np.full((2, 3), np.inf), {"line": np.array([[0, 1]])}, "vtk"),
        None, None, "coordinates"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_mesh_is_told(case):
    mesh, wanted, line, word = WRONG[case]
    with refused(line, word):
        selected(mesh, wanted, None, "p.vtu")


def test_straight_cells_of_curved_ones():
    mesh = FileMesh(np.eye(8, 3) + 1, {"quad8": np.arange(8)[None]}, "vtk")
    raw = selected(mesh, None, 1, "p.vtu")
    assert raw.cells.tolist() == [[0, 1, 2, 3]]
    assert (raw.kind.order, len(raw.points)) == (1, 4)


def test_curves_of_drawings_are_told_and_left_out():
    mesh = FileMesh(POINTS, {"quad": SIDES, "line": np.array([[0, 1], [0, 2]])}, "vtk")
    raw = selected(mesh, None, None, "part.STEP")
    assert raw.told == ["part.STEP holds curves that are no edges of its faces; they are left out."]


def test_cells_of_one_dimension_with_what_belongs_to_them():
    mesh = whole()
    mesh.fixed = {f"f{of_dimension('', 3)}": {2: SIDES}, f"f{of_dimension('', 1)}": {0: SIDES[:1]}}
    own = _alone(mesh, 1)
    assert list(own.cells) == ["line"]
    assert {n: list(p) for n, p in own.groups.items()} == {"b": ["line"]}
    assert {n: list(p) for n, p in own.fixed.items()} == {"f": [0]}
    assert list(_alone(mesh, 3).groups) == ["a"]
