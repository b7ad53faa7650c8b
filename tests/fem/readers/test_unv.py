"""Universal files: data sets as a deck, element by element, and a file of gmsh."""

from __future__ import annotations

import numpy as np
import pytest

import antiosc as ao
from antiosc.io import mesh_files
from antiosc.io.neutral import CORNERS, EDGES
from antiosc.io.request import Request
from refusals import refused

RNG = np.random.default_rng(41)


@pytest.fixture
def read(tmp_path, monkeypatch):
    """The deck that a file holds, before it becomes a mesh."""
    monkeypatch.setattr(mesh_files, "as_mesh", lambda deck: deck)
    monkeypatch.setattr(Request, "allow", lambda *_: None)

    def of(text: str, unit=(1.0, 1.0)):
        path = tmp_path / "part.unv"
        path.write_text(text, encoding="latin-1")
        return mesh_files.read_universal(Request(str(path), path.name, unit=unit))

    return of


def data_set(number: int | str, *lines: str) -> str:
    return "\n".join(["    -1", f"{number:>6}", *lines, "    -1", ""])


def nodes(x, first: int = 101) -> str:
    lines = []
    for k, p in enumerate(x):
        lines += [f"{first + k:10d}{1:10d}{1:10d}{11:10d}", "".join(f"{c:25.16E}" for c in p)]
    return data_set(2411, *lines)


def element(label: int, kind: int, numbers) -> list[str]:
    """An element in lines of eight nodes; beams have a line on their orientation before."""
    lines = [f"{label:10d}{kind:10d}" + 3 * f"{1:10d}" + f"{len(numbers):10d}"]
    if kind in (21, 22, 23, 24):
        lines.append(f"{0:10d}{1:10d}{1:10d}")
    rows = [numbers[k : k + 8] for k in range(0, len(numbers), 8)]
    return lines + ["".join(f"{n:10d}" for n in row) for row in rows]


#: The nodes of a second-order element in the order of the file: corners by their number, middles by
#: the two corners between which they lie. They go round the bottom, then up, then round the top.
SECOND = {
    "line": "0 01 1",
    "triangle": "0 01 1 12 2 20",
    "quad": "0 01 1 12 2 23 3 30",
    "tetra": "0 01 1 12 2 20 03 13 23 3",
    "wedge": "0 01 1 12 2 20 03 14 25 3 34 4 45 5 53",
    "hexahedron": "0 01 1 12 2 23 3 30 04 15 26 37 4 45 5 56 6 67 7 74",
}
KINDS = {
    **dict.fromkeys((11, 21, 22), ("line", 1)), **dict.fromkeys((23, 24), ("line", 2)),
    **dict.fromkeys((41, 91), ("triangle", 1)), **dict.fromkeys((42, 92), ("triangle", 2)),
    **dict.fromkeys((44, 94), ("quad", 1)), **dict.fromkeys((45, 95), ("quad", 2)),
    111: ("tetra", 1), 118: ("tetra", 2), 112: ("wedge", 1), 113: ("wedge", 2),
    115: ("hexahedron", 1), 116: ("hexahedron", 2),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_elements_have_their_corners_and_middles(read, kind):
    """Two elements of a kind, between others that are no cells."""
    shape, order = KINDS[kind]
    count = CORNERS[shape]
    words = SECOND[shape].split() if order == 2 else list("01234567"[:count])
    cells = [RNG.normal(size=(count, 3)) for _ in range(2)]
    x = [np.mean([cell[int(c)] for c in word], axis=0) for cell in cells for word in words]
    size = len(words)
    mixed = RNG.permutation(2 * size)  # the file's own order of the nodes
    numbers = 101 + np.argsort(mixed)
    lines = element(5, 161, [101]) + element(8, kind, numbers[:size].tolist())
    lines += element(6, 136, [101, 102]) + element(7, kind, numbers[size:].tolist())
    deck = read(nodes(np.array(x)[mixed]) + data_set(2412, *lines, *element(9, 161, [102])))
    (block,) = deck.blocks
    assert (block.shape, block.type) == (shape, f"element type {kind}")
    assert deck.left == {"element type 161": 2, "element type 136": 1}
    np.testing.assert_allclose(deck.points[block.corners], cells, rtol=1e-12)
    if order == 1:
        assert block.mids.shape == (2, 0)
    else:
        ends = deck.points[block.corners][:, np.array(EDGES[shape])]
        np.testing.assert_allclose(deck.points[block.mids], ends.mean(axis=2), rtol=1e-12)
    assert block.inner.shape == (2, 0)
    assert deck.element_sets == deck.node_sets == {}


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.0)]
CELLS = data_set(780, *element(7, 91, [101, 102, 103]), *element(3, 91, [101, 103, 104]))


@pytest.mark.parametrize("number", [15, 781, 2411, "781b"])
def test_nodes_of_three_data_sets(read, number):
    lines = []
    for k, p in enumerate(SQUARE, 101):
        if number == 15:
            lines.append(f"{k:10d}{0:10d}{0:10d}{11:10d}" + "".join(f"{c:13.5E}" for c in p))
        else:
            lines += [f"{k:10d}{0:10d}{0:10d}{11:10d}", "".join(f"{c:25.16E}" for c in p)]
    deck = read(data_set(number, *lines) + CELLS + data_set(151, "a header"))
    np.testing.assert_allclose(deck.points, SQUARE)
    (block,) = deck.blocks
    assert block.corners.tolist() == [[0, 1, 2], [0, 2, 3]]


def members(width: int, *pairs) -> list[str]:
    words = [[kind, label, *[0] * (width - 2)] for kind, label in pairs]
    per_line = 8 // width
    return ["".join(f"{n:10d}" for word in words[k : k + per_line] for n in word)
            for k in range(0, len(words), per_line)]  # fmt: skip


def group(width: int, name: str, *pairs) -> list[str]:
    head = f"{4:10d}" + 6 * f"{0:10d}" + f"{len(pairs):10d}"
    return [head, name, *members(width, *pairs)]


@pytest.mark.parametrize(
    ("number", "width"),
    [*((k, 4) for k in (2435, 2452, 2467, 2477)), *((k, 2) for k in (2429, 2430, 2432))],
)
def test_groups_of_nodes_and_elements(read, number, width):
    lines = [
        *group(width, " a group ", (8, 3), (7, 104), (7, 101), (8, 999), (7, 101)),
        *group(width, "", (8, 7)),
        *group(width, "of others", (9, 3), (8, 998), (7, 999)),
        *group(width, "a group", (8, 7), (7, 102)),
        *group(width, "empty"),
    ]
    deck = read(nodes(SQUARE) + CELLS + data_set(number, *lines))
    sets = {name: rows.tolist() for name, rows in deck.element_sets.items()}
    assert sets == {"a group": [0, 1], "4": [0]}
    assert {name: rows.tolist() for name, rows in deck.node_sets.items()} == {"a group": [0, 1, 3]}


@pytest.mark.parametrize(("factor", "unit"), [("1.0D+03", 1.0), ("1.0", 1.0), ("1.0E3", 0.01)])
def test_units_of_length(read, factor, unit):
    """Units of length in a metre; they count where no others are given."""
    text = data_set(164, "         5  mm", f" {factor} 1.0 1.0") + nodes(SQUARE) + CELLS
    deck = read(text, (unit, 1.0))
    converted = "+03" in factor
    np.testing.assert_allclose(deck.points, np.array(SQUARE) / (1000 if converted else 1))
    assert ["1000 units of length" in told for told in deck.remarks] == [True] * converted


GOOD = nodes(SQUARE) + CELLS
HEAD = data_set(2412, *element(7, 91, [101, 102, 103]))
#: What is written, and what is said.
WRONG = {
    GOOD + "\0": (None, "damaged"),
    GOOD + "    -1\n  151\n": (None, "ends"),
    "    -1\n    -1\n    -1\nwords\n    -1\n": (None, "universal"),
    data_set(164, "5 mm", "  ") + GOOD: (4, "number"),
    data_set(2411, "  101 1 1 11", "0. 0.") + CELLS: (4, "coordinates"),
    data_set(2411, "x 1 1 11", "0. 0. 0.") + CELLS: (3, "integer"),
    data_set(15, "101 0 0 11 0. 0.") + CELLS: (3, "coordinates"),
    nodes(SQUARE) + data_set(2412, "7 91 1 1 3", "101 102 103"): (14, "numbers"),
    nodes(SQUARE) + data_set(2412, "7 91 1 1 1 4", "101 102 103"): (14, "ends"),
    nodes(SQUARE) + data_set(2412, "7 91 1 1 1 4", "101 102 103 104"): (14, "must have 3"),
    nodes(SQUARE) + data_set(2412, *element(7, 91, [101, 102, 9])): (None, "define"),
    nodes(SQUARE) + data_set(2412, *element(7, 91, [101, 102, 103])) + HEAD: (None, "elements"),
    nodes(SQUARE) + nodes(SQUARE[:1]) + CELLS: (None, "two nodes"),
    CELLS: (None, "sets"),
    nodes(SQUARE): (None, "cells"),
    GOOD + data_set(2467, "4 0 0 0 0 0 0 1", "a", "7 101 0 x"): (23, "integer"),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_told_with_its_line(read, text):
    with refused(*WRONG[text], ao.MeshError):
        read(text)


@pytest.mark.fem
@pytest.mark.slow
def test_a_file_of_gmsh_is_the_mesh_that_it_was(tmp_path):
    """A cylinder with groups, as .unv and .msh, of second order."""
    from parts import gmsh_session

    with gmsh_session() as gmsh:
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1)
        gmsh.model.occ.synchronize()
        for dim, tag, name in ((3, 1, "body"), (2, 2, "top")):
            gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, [tag]), name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.8)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(3)
        for suffix in ("unv", "msh"):
            gmsh.write(str(tmp_path / f"part.{suffix}"))
    mesh, other = (ao.read_mesh(tmp_path / f"part.{suffix}") for suffix in ("unv", "msh"))
    assert (mesh.cell, mesh.order, mesh.n_cells) == (other.cell, other.order, other.n_cells)
    assert set(mesh.groups) == set(other.groups) == {"body", "top"}
    steel = ao.Solid(210e9, 0.3, 7850.0)
    mass = ao.Structure(other, steel).mass
    assert ao.Structure(mesh, steel).mass == pytest.approx(mass, rel=1e-7)  # digits of the file
