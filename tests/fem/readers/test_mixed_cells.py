"""No element of a file vanishes: it is of the mesh or a group, told with its number, or refused."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np
import pytest

import antiosc as ao
from antiosc.io.isolation import Request
from antiosc.io.mesh_files import reader_of
from antiosc.io.neutral import CELL_KINDS as CELL_KINDS
from antiosc.io.reading import selected_mesh
from parts import gmsh_session

pytest.importorskip("netCDF4")
pytest.importorskip("gmsh")

#: Ending -> format of meshio, and the name of the numbers by which it keeps groups, if any.
FORMATS = {
    "vtk": ("vtk", "part"),
    "vtu": ("vtu", "part"),
    "xdmf": ("xdmf", "part"),
    "med": ("med", "cell_tags"),
    "2.msh": ("gmsh22", "gmsh:physical"),
    "4.msh": ("gmsh22", "gmsh:physical"),
    "mesh": ("medit", "medit:ref"),
    "post": ("permas", None),
    "avs": ("avsucd", "avsucd:material"),
    "e": ("exodus", None),
    "inp": ("abaqus", "sets"),
    "bdf": ("nastran", "nastran:ref"),
}


def lattice(*counts: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) of a grid of cells of size 1, and their numbers by the places along x, y, z."""
    number = np.arange(np.prod(np.array(counts) + 1)).reshape(np.array(counts) + 1)
    places = np.array(list(np.ndindex(*number.shape)), dtype=float)
    points = np.zeros((len(places), 3))
    points[:, : places.shape[1]] = places
    return points, number


def sheet():
    points, n = lattice(4, 4)
    quads = [
        (n[i, j], n[i + 1, j], n[i + 1, j + 1], n[i, j + 1]) for i in range(4) for j in range(4)
    ]
    return points, n, ("quad", quads)


def block():
    points, n = lattice(2, 2, 2)
    around = [(0, 0), (1, 0), (1, 1), (0, 1)]
    cells = [
        [n[i + a, j + b, k + c] for c in (0, 1) for a, b in around]
        for i, j, k in np.ndindex(2, 2, 2)
    ]
    return points, n, ("hexahedron", cells)


def beams_on_edges_of_shells():
    points, n, quads = sheet()
    return points, quads, ("line", [(n[i, 2], n[i + 1, 2]) for i in range(4)])


def loose_beams_beside_shells():
    points, _, quads = sheet()
    far = len(points) + np.arange(4)
    points = np.vstack([points, [[9 + i, 9, 0] for i in range(4)]])
    return points, quads, ("line", [*pairwise(far)])


def shells_on_faces_of_solids():
    points, n, cells = block()
    skin = [(n[i, j, 2], n[i + 1, j, 2], n[i + 1, j + 1, 2], n[i, j + 1, 2])
            for i, j in ((0, 0), (1, 0), (1, 1))]  # fmt: skip
    return points, cells, ("quad", skin)


def shells_inside_solids():
    points, n, cells = block()
    wall = [(n[i, j, 1], n[i + 1, j, 1], n[i + 1, j + 1, 1], n[i, j + 1, 1])
            for i, j in ((0, 0), (1, 0))]  # fmt: skip
    return points, cells, ("quad", wall)


def rods_along_edges_of_solids():
    points, n, cells = block()
    return points, cells, ("line", [(n[i, 0, 0], n[i + 1, 0, 0]) for i in range(2)])


KINDS = (
    beams_on_edges_of_shells,
    loose_beams_beside_shells,
    shells_on_faces_of_solids,
    shells_inside_solids,
    rods_along_edges_of_solids,
)


def write(path: Path, form: str, key: str | None, grouped: bool, points, *blocks) -> None:
    mesh = meshio.Mesh(points, [(kind, np.array(rows)) for kind, rows in blocks])
    numbers = [np.full(len(rows), k + 1) for k, (_, rows) in enumerate(blocks)]
    if grouped and key == "sets":
        every = [np.arange(len(rows)) for _, rows in blocks]
        none = np.zeros(0, dtype=int)
        mesh.cell_sets = {"main": [every[0], none], "others": [none, every[1]]}
    elif grouped and key == "cell_tags":
        mesh.cell_data = {key: [-value for value in numbers]}
        mesh.cell_tags = {-1: ["main"], -2: ["others"]}
    elif grouped and key:
        mesh.cell_data = {key: numbers}
        if key == "gmsh:physical":
            mesh.cell_data["gmsh:geometrical"] = numbers
    options = {"binary": False} if form in ("gmsh22", "vtk") else {}
    meshio.write(path, mesh, file_format=form, **options)
    if path.name.endswith("4.msh"):  # as gmsh itself writes it
        with gmsh_session() as gmsh:
            gmsh.open(str(path))
            gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
            gmsh.write(str(path))


@pytest.fixture
def no_limits(monkeypatch, tmp_path):
    """Readers in this process, without the limits of one of their own."""
    monkeypatch.chdir(tmp_path)
    for limit in ("limit_time", "limit_output", "limit_memory"):
        monkeypatch.setattr(Request, limit, lambda self, *arguments: None)


@pytest.mark.parametrize("grouped", [True, False], ids=["groups", "no groups"])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("ending", FORMATS)
def test_every_element_of_a_file_is_accounted_for(tmp_path, no_limits, ending, kind, grouped):
    path = tmp_path / f"part.{ending}"
    points, (main, rows), (other, others) = kind()
    write(path, *FORMATS[ending], grouped, points, (main, rows), (other, others))
    number = f"{len(others)} {'lines' if other == 'line' else 'faces'}"
    raw, refused = None, ""
    try:
        content = reader_of(path).read(Request(str(path), path.name))
        raw = selected_mesh(content, None, None, path.name)
    except ao.MeshError as error:
        refused = str(error)
    if raw is None:
        assert number in refused
        assert "cells" in refused
        return

    assert len(raw.cells) == len(rows)
    dim = CELL_KINDS[other].dim
    own = [len(parts[dim]) for parts in raw.groups.values() if set(parts) == {dim}]
    assert len(others) in own or any(number in remark for remark in raw.remarks)
    # elements of other formats than gmsh's, whose groups hold sides, are told besides
    if not ending.endswith("msh"):
        assert any(number in remark for remark in raw.remarks)
