"""What every reader returns: packed for a pipe, merged, selected."""

from __future__ import annotations

import json

import numpy as np
import pytest

from antiosc.io import reading
from antiosc.io.neutral import FileMesh, packed, unpacked
from antiosc.io.reading import selected
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


def test_nodes_at_one_place_become_the_first_of_them():
    """Two cubes with nodes of their own at their common face; the joints follow."""
    points = np.vstack([POINTS[:8], POINTS[[1, 8, 9, 2, 5, 10, 11, 6]] + 1e-4])
    mesh = FileMesh(points, {"hexahedron": np.arange(16).reshape(2, 8)}, "vtk")
    mesh.node_sets = {"a": np.array([1, 8, 11]), "b": np.array([9])}
    mesh.fixed = {"f": {1: np.array([[8, 11]]), 0: np.array([[15]])}}
    terms = [(8, 0, 1.5), (9, 3, -2.0), (-1, 4, 1.0)]
    mesh.model = {"apart": [], "x": 1, "joints": {
        "equations": [terms], "springs": [(terms, 7.0)], "dampers": [(terms, 8.0)],
        "masses": [([terms, terms], [[1.0]], 2.0)], "among": [(15, [(8, 0.5), (9, 0.5)])],
        "points": [[1.0, 2.0, 3.0]],
    }}  # fmt: skip
    found = reading.merged(mesh, 1e-3)
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
    assert len(reading.merged(mesh, 1e-3).points) == 13
    assert len(reading.merged(mesh, 1e-5).points) == 16


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
