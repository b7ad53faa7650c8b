"""Time that a reader may take, and what gmsh is told to mesh (gmsh is a list of it here)."""

from __future__ import annotations

from math import log, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from antiosc.errors import MeshError
from antiosc.fem.readers import by_deck, by_gmsh, by_unv, meshing
from antiosc.fem.readers.neutral import FileMesh
from antiosc.fem.readers.request import Request


@pytest.fixture
def allowed(monkeypatch) -> list[float]:
    """Seconds that requests allow themselves."""
    found: list[float] = []
    monkeypatch.setattr(Request, "allow", lambda self, seconds: found.append(seconds))
    return found


def request(path, **more) -> Request:
    return Request(str(path), path.name, **more)


def test_decks_may_take_as_long_as_all_their_files(tmp_path, monkeypatch, allowed):
    """30 s and 30 µs a byte, of the included files too."""
    monkeypatch.setattr(by_deck, "as_mesh", lambda deck, halve_lines: (deck, halve_lines))
    grids = "GRID,1\nGRID,2,,1.\nGRID,3,,1.,1.\n"
    (tmp_path / "grids.bdf").write_text(grids)
    text = "INCLUDE 'grids.bdf'\nCTRIA3,1,1,1,2,3\n"
    (tmp_path / "part.bdf").write_text(text)
    deck, halved = by_deck.nastran(request(tmp_path / "part.bdf"))
    assert deck.n_elements == 1
    assert not halved
    sizes = [len(text), len(text) + len(grids)]
    assert allowed == pytest.approx([30 + 3e-5 * size for size in sizes])
    allowed.clear()
    text = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n*ELEMENT,TYPE=S3\n1,1,2,3\n"
    (tmp_path / "part.inp").write_text(text)
    assert by_deck.abaqus(request(tmp_path / "part.inp"))[0].n_elements == 1
    assert allowed == pytest.approx([30 + 3e-5 * len(text)])
    (tmp_path / "part.inp").write_text("*NODE\n1,0,0,0\n*ELEMENT,TYPE=MASS\n1,1\n2,1\n")
    with pytest.raises(MeshError) as caught:
        by_deck.abaqus(request(tmp_path / "part.inp"))
    assert str(caught.value) == "part.inp has no elements that are cells of a mesh: it has 2 MASS."


def test_a_deck_with_a_model_in_its_units(tmp_path, monkeypatch, allowed):
    monkeypatch.setattr(by_deck, "as_mesh", lambda deck, halve_lines: (deck, halve_lines))
    text = "*NODE\n1,0,0,0\n2,1,0,0\n*ELEMENT,TYPE=B31,ELSET=A\n1,1,2\n"
    text += "*ELEMENT,TYPE=B31,ELSET=B\n2,1,2\n"
    text += "*BEAM SECTION,ELSET=A,MATERIAL=M,SECTION=RECT\n2.,3.\n0,1,0\n"
    text += "*MATERIAL,NAME=M\n*ELASTIC\n2E5,.3\n"
    (tmp_path / "part.inp").write_text(text)
    model = {"density": 5.0, "parts": ["A"]}
    ask = request(tmp_path / "part.inp", unit=(1e-3, 1.0), model=model)
    deck, halved = by_deck.abaqus(ask)
    assert halved
    ((_, _, given, _),) = deck.model["families"]
    assert (given["E"], given["rho"]) == pytest.approx((2e11, 5.0))
    text = "GRID,1\nGRID,2,,1.\nCBAR,1,7,1,2,0.,1.,0.\nCBAR,2,8,1,2,0.,1.,0.\nMAT1,1,2.+5,,.3\n"
    text += "PBAR,7,1,1.,1.,1.,1.\nPBAR,8,1,1.,1.,1.,1.\n"
    (tmp_path / "part.bdf").write_text(text)
    model = {"density": 5.0, "parts": ["7"]}
    deck, _ = by_deck.nastran(request(tmp_path / "part.bdf", unit=(1e-3, 1.0), model=model))
    ((_, _, given, _),) = deck.model["families"]
    assert (given["E"], given["rho"]) == pytest.approx((2e11, 5.0))


def test_universal_files_and_geometries(tmp_path, monkeypatch, allowed):
    path = tmp_path / "part.unv"
    path.write_text("    -1\n")
    with pytest.raises(MeshError):
        by_unv.read(request(path))
    monkeypatch.setattr(by_gmsh, "_through_gmsh", lambda ask, source: source)
    (tmp_path / "own").mkdir()
    monkeypatch.chdir(tmp_path / "own")
    for suffix, base in ((".step", 30), (".geo", 120), (".stl", 30)):
        part = tmp_path / f"a{suffix}"
        part.write_text("Point(1) = {0, 0, 0};\n" * 100)
        copy = by_gmsh.generate(request(part))
        assert (copy.name, copy.is_absolute()) == (f"mesh{suffix}", False)
        assert by_gmsh.generate(request(part, trust=True)) == part
        assert allowed[-2:] == pytest.approx([base + 1e-5 * 2200] * 2)
    assert allowed[0] == pytest.approx(30 + 3e-5 * 7)
    (tmp_path / "a.msh").write_text("$MeshFormat\n" + 10**6 * " ")
    assert by_gmsh.read(request(tmp_path / "a.msh")).name == "mesh.msh"
    assert allowed[-1] == pytest.approx(30 + 2e-6 * (10**6 + 12))
    (tmp_path / "b.geo").write_text('Merge "a.step";\n')
    by_gmsh.generate(request(tmp_path / "b.geo"))
    assert (tmp_path / "own/a.step").read_bytes() == (tmp_path / "a.step").read_bytes()
    (tmp_path / "b.geo").write_text('Merge "c.step";\n')
    with pytest.raises(MeshError) as caught:
        by_gmsh.generate(request(tmp_path / "b.geo"))
    assert str(caught.value) == "b.geo merges c.step, but there is no such file in its folder."


# --- Meshing --------------------------------------------------------------------------------------


class Gmsh:
    """A box of 2 × 3 × 4 in gmsh's units, and what gmsh is told."""

    def __init__(self, dim: int = 3, masses: bool = True) -> None:
        self.told: list[tuple] = []
        self.fields: list[str] = []

        def tell(name: str):
            return lambda *arguments: self.told.append((name, *arguments))

        def mass(d: int, tag: int) -> float:
            if not masses:
                raise ValueError("not of OpenCASCADE")
            return {1: 10.0, 2: 20.0, 3: 24.0}[d]

        def add(kind: str) -> int:
            self.fields.append(kind)
            return len(self.fields)

        field = SimpleNamespace(
            add=add, setString=tell("string"), setNumbers=tell("numbers"), setNumber=tell("number"),
            setAsBackgroundMesh=tell("background"),
        )  # fmt: skip
        mesh = SimpleNamespace(field=field, generate=tell("generate"), clear=tell("clear"))
        self.option = SimpleNamespace(setNumber=tell("option"))
        self.view = SimpleNamespace(add=lambda name: 77, addListData=tell("list"))
        self.model = SimpleNamespace(
            getDimension=lambda: dim,
            getBoundingBox=lambda d, tag: (1.0, 1.0, 1.0, 3.0, 4.0, 5.0),
            getEntities=lambda d: [(d, k) for k in range({1: 3, 2: 2, 3: 1}[d])],
            occ=SimpleNamespace(getMass=mass),
            getParametrizationBounds=lambda d, tag: ([0.0], [2.0]),
            getValue=lambda d, tag, t: np.stack([3 * t, 4 * t, 0 * t], axis=1).ravel(),
            mesh=mesh,
        )

    def of(self, name: str) -> list[tuple]:
        return [one[1:] for one in self.told if one[0] == name]


def ask_for(**more) -> Request:
    return Request("a.step", "a.step", **more)


def test_sizes_orders_and_time(allowed):
    """Sizes are in metres, gmsh's model here in millimetres."""
    gmsh = Gmsh()
    meshing.generate(gmsh, ask_for(size=1e-4), 1e-3)
    assert gmsh.of("option") == [("Mesh.ElementOrder", 1), ("Mesh.MeshSizeMax", pytest.approx(0.1)),
                                 ("Mesh.ElementOrder", 2)]  # fmt: skip
    assert gmsh.of("generate") == [(3,)]
    # regular tetrahedra of edge 0.1 in a volume of 24 are the most
    cells = 6 * sqrt(2) * 24 / 0.1**3
    assert allowed == pytest.approx([600, 30 + 2e-3 * cells])
    allowed.clear()
    meshing.generate(Gmsh(), ask_for(size=1.0), 1.0)
    assert allowed == pytest.approx([600, 30 + 20])
    orders = ((1, None, False, 1), (3, None, True, 1), (3, 1, False, 1), (1, 2, False, 2))
    for dim, order, solid, wanted in orders:
        gmsh = Gmsh(dim)
        meshing.generate(gmsh, ask_for(order=order, solid=solid), 1.0)
        assert gmsh.of("option")[-1] == ("Mesh.ElementOrder", wanted)
        assert gmsh.of("background") == []
        assert gmsh.of("generate") == [(dim,)]
    with pytest.raises(MeshError) as caught:
        meshing.generate(Gmsh(0), ask_for(), 1.0)
    assert str(caught.value) == "a.step contains no geometry (curves, surfaces or volumes)."


def test_size_fields(allowed):
    """Small elements around a point, and sizes all over: the smallest of both counts."""
    gmsh = Gmsh(2)
    sizes = {"points": [[0.0, 0, 0], [1e-3, 0, 0], [0, 1e-3, 0]], "cells": [[0, 1, 2]],
             "sizes": [1e-5, 2e-5, 3e-5]}  # fmt: skip
    ask = ask_for(refine=[((1e-3, 2e-3, 3e-3), 1e-4)], sizes=sizes, grading=(0.35, 2.0), order=1)
    meshing.generate(gmsh, ask, 1e-3)
    assert gmsh.fields == ["MathEval", "PostView", "Min"]
    ((tag, name, formula),) = gmsh.of("string")
    assert (tag, name) == (1, "F")
    for x, y, z in ((1, 2, 3), (1, 2, 3.1), (1, 2.5, 3), (-4, 0, 9)):
        r = sqrt((x - 1) ** 2 + (y - 2) ** 2 + (z - 3) ** 2)
        known = {"Sqrt": sqrt, "Min": min, "Max": max, "x": x, "y": y, "z": z}
        value = eval(formula.replace("^", "**"), known)
        # half of the size up to two sizes away, then growing by 0.35
        assert value == pytest.approx(0.05 + 0.35 * max(0, r - 0.2))
    ((kind_of_view, kind, count, data),) = gmsh.of("list")
    assert (kind_of_view, kind, count) == (77, "ST", 1)
    # x, y, z of the three corners, then the sizes, of which gmsh's edges are 1.1 times as long
    own = np.array([0.01, 0.02, 0.03]) / 1.1
    np.testing.assert_allclose(data, [0, 1, 0, 0, 0, 1, 0, 0, 0, *own])
    assert gmsh.of("number") == [(2, "ViewTag", 77)]
    assert gmsh.of("numbers") == [(3, "FieldsList", [1, 2])]
    assert gmsh.of("background") == [(3,)]
    options = dict(gmsh.of("option"))
    assert options["Mesh.MeshSizeFromPoints"] == options["Mesh.MeshSizeExtendFromBoundary"] == 0
    assert options["Mesh.MeshSizeFromCurvature"] == 12
    cells = 1.35 * 0.5e-6 / (sqrt(3) / 4 * 2e-5**2)
    assert allowed == pytest.approx([600, 60 + 2e-3 * max(cells, 1e4)])
    gmsh = Gmsh(3)
    volume = {**sizes, "points": [*sizes["points"], [0, 0, 1e-3]], "cells": [[0, 1, 2, 3]],
              "sizes": [1e-6] * 4}  # fmt: skip
    meshing.generate(gmsh, ask_for(sizes=volume), 1e-3)
    assert gmsh.of("list")[0][1] == "SS"
    assert dict(gmsh.of("option"))["Mesh.MeshSizeFromCurvature"] == 6
    cells = 0.95 * (1e-9 / 6) / (sqrt(2) / 12 * 1e-18)
    assert allowed[-1] == pytest.approx(60 + 2e-3 * cells)


def test_the_forecast_of_cells(allowed):
    """Of masses by OpenCASCADE; refined points add the integral of their field."""
    refine = [((0.0, 0.0, 0.0), 0.01), ((0.0, 0.0, 0.0), 2.0)]
    ask = ask_for(size=0.5, refine=refine, grading=(0.4, 3.0))
    for dim, count in ((1, 1.0 * 30), (2, 4 / sqrt(3) * 40), (3, 6 * sqrt(2) * 24)):
        share = {1: 1.0, 2: 4 / sqrt(3), 3: 6 * sqrt(2)}[dim]
        more = share * 12.0**dim * sum(1 + log(1 + 0.5 / local) / 0.4 for _, local in refine)
        found = meshing.expected_cells(Gmsh(), ask, dim, 0.5, 1.0)
        assert found == pytest.approx(count / 0.5**dim + more)
    plain = ask_for(size=0.5)
    # without masses: the length of curves, the box around the rest
    for dim, bound in ((1, 3 * 10), (2, 2 * (2 * 3 + 3 * 4 + 4 * 2)), (3, 2 * 3 * 4)):
        share = {1: 1.0, 2: 4 / sqrt(3), 3: 6 * sqrt(2)}[dim]
        found = meshing.expected_cells(Gmsh(masses=False), plain, dim, 0.5, 1.0)
        assert found == pytest.approx(share * bound / 0.5**dim)


@pytest.mark.parametrize("refined", [False, True])
def test_sizes_below_the_digits_of_coordinates(allowed, refined):
    for size, wrong in ((3.9e-9, True), (4.1e-9, False)):
        more = {"refine": [((0, 0, 0), size)]} if refined else {"size": size}
        gmsh = Gmsh(1)
        try:
            meshing.generate(gmsh, ask_for(**more), 1.0)
        except MeshError as error:
            told = str(error)
        else:
            told = ""
        sentence = (
            "a.step is 4 m long: elements of 3.9e-09 m are below what its coordinates resolve, and "
            "there would be about 1e+09 along one edge; choose a larger size."
        )
        assert (told == sentence) == wrong


def test_the_mesh_of_a_model_is_taken_entity_by_entity():
    """Two lines and two triangles on nodes with numbers of their own, and physical groups."""
    cells = {(1, 4): ([1], [[50, 30]]), (1, 5): ([1], [[30, 20]]), (2, 1): ([2], [[50, 30, 20]]),
             (2, 2): ([2], [[50, 20, 40]]), (0, 9): ([15], [[40]])}  # fmt: skip
    groups = {(1, 4): [7], (1, 5): [7, 8], (2, 2): [-3]}
    names = {(1, 7): "edge", (1, 8): "", (2, 3): "face", (2, 6): "none"}
    coordinates = np.arange(12.0)

    def elements(dim, tag):
        kinds, nodes = cells[dim, tag]
        return kinds, None, [np.array(n) for n in nodes]

    gmsh = SimpleNamespace(model=SimpleNamespace(
        mesh=SimpleNamespace(getNodes=lambda: (np.array([50, 20, 30, 40]), coordinates, None),
                             getElements=elements),
        getEntities=lambda: list(cells),
        getPhysicalGroupsForEntity=lambda d, t: groups.get((d, t), []),
        getPhysicalGroups=lambda: list(names),
        getPhysicalName=lambda d, t: names[d, t],
    ))  # fmt: skip
    found = by_gmsh._arrays(gmsh, "a.msh", {(2, 1): ["solid"]})
    assert isinstance(found, FileMesh)
    assert found.points.tolist() == coordinates.reshape(4, 3).tolist()
    assert {label: block.tolist() for label, block in found.cells.items()} == {
        "vertex": [[3]], "line": [[0, 2], [2, 1]], "triangle": [[0, 2, 1], [0, 1, 3]],
    }  # fmt: skip
    assert {n: {k: r.tolist() for k, r in parts.items()} for n, parts in found.groups.items()} == {
        "solid": {"triangle": [0]}, "edge": {"line": [0, 1]}, "8": {"line": [1]},
        "face": {"triangle": [1]},
    }  # fmt: skip
    assert (found.aids, found.convention) == (True, "gmsh")
    names[2, 6], names[2, 3] = "face", "face"
    groups[2, 1] = [6]
    with pytest.raises(MeshError) as caught:
        by_gmsh._arrays(gmsh, "a.msh", {})
    assert str(caught.value) == (
        "a.msh gives two groups of dimension 2 the name 'face': name them apart."
    )
    cells[2, 1] = ([2], [[50, 30, 99]])
    with pytest.raises(MeshError) as caught:
        by_gmsh._arrays(gmsh, "a.msh", {})
    assert str(caught.value) == "a.msh has cells on nodes that it does not hold: it is damaged."
    cells[2, 1] = ([2], [[50, 30, 25]])
    with pytest.raises(MeshError, match="on nodes that it does not hold"):
        by_gmsh._arrays(gmsh, "a.msh", {})
