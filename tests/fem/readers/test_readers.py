"""A mesh is data: what a file says or does reaches neither the disk, the shell nor this process."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import gmsh
import meshio
from mpi4py import MPI

import antiosc as ao
import parts
from antiosc.fem import compat
from antiosc.fem.readers import by_gmsh, geo_script, isolation, meshing, read
from antiosc.fem.readers.request import Request
from paths import DECKS, MESHES

pytestmark = pytest.mark.fem

BAR = "Point(1) = {0, 0, 0, 0.5}; Point(2) = {1, 0, 0, 0.5}; Line(1) = {1, 2};\n"


@pytest.fixture
def marked(tmp_path):
    """A command for a file to run, and whether it ran."""
    command = f"touch {tmp_path}/mark"
    return command, (tmp_path / "mark").exists


@pytest.fixture
def session():
    """A gmsh session of this process."""
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()


def refusal(path: Path, **options) -> str:
    """What `read_mesh` says of a file that it refuses: one sentence that names it."""
    with pytest.raises(ao.MeshError) as caught:
        ao.read_mesh(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert message.endswith(".")
    assert len(message) < 450
    assert path.name[:50] in message
    return message


# --- Files that run commands ----------------------------------------------------------------------


def test_a_script_by_the_name_of_a_mesh_is_not_run(tmp_path, marked):
    command, happened = marked
    path = tmp_path / "part.msh"
    path.write_text(f'SystemCall "{command}";\n{BAR}')
    assert "does not begin as a Gmsh mesh" in refusal(path)
    assert not happened()


@pytest.mark.parametrize("suffix", ["msh", "step"])
def test_options_beside_a_file_are_not_read(tmp_path, marked, suffix):
    command, happened = marked
    name = {"msh": "lever.msh", "step": "bracket.step"}[suffix]
    path = tmp_path / f"part.{suffix}"
    path.write_bytes((MESHES / name).read_bytes())
    (tmp_path / f"part.{suffix}.opt").write_text(f'SystemCall "{command}";')
    size = 0.03 if suffix == "step" else None
    assert ao.read_mesh(path, size=size).n_cells
    assert not happened()
    assert ao.read_mesh(path, size=size, trust=True).n_cells
    assert happened()


def test_a_trusted_script_runs_as_gmsh_runs_it(tmp_path, marked):
    command, happened = marked
    (tmp_path / "other.geo").write_text(BAR)
    path = tmp_path / "part.geo"
    path.write_text(f'Include "other.geo";\nSystemCall "{command}";\n')
    assert "refused for line 1 (Include" in refusal(path)
    assert not happened()
    assert ao.read_mesh(path, trust=True).n_cells == 2
    assert happened()


SNEAKY = [
    'SystemCall "x";',
    'System "x";',
    'NonBlockingSystemCall "x";',
    "SystemCall 'x';",
    'SystemCall/* */"x";',
    'SystemCall // \n\n  "x";',
    'a = "x"; SystemCall a;',
    'SystemCall StrCat("x", "y");',
    'SystemCall Sprintf("x%g", 1);',
    'StringToName["SystemCall"] "x";',
    'S2N[StrCat("System", "Call")] "x";',
    'OnelabRun("a", "x");',
    'OnelabRun "a";',
    'Include "x.geo";',
    'Merge "x.geo";',
    'Merge "../part.step";',
    'Merge "/tmp/part.step";',
    'Merge StrCat("a", ".step");',
    'Merge "x.msh";',
    'MergeWithBoundingBox "x.step";',
    'Print "x.png";',
    'Save "x.msh";',
    'Save View[0] "x.pos";',
    'CreateDir "x";',
    'ShapeFromFile("x.brep");',
    'a() = ListFromFile["x"];',
    "Plugin(MathEval).Run;",
    'Printf("a") > "x";',
    'Printf("%g", Sqrt(2)) >> "x";',
    'Error("a") > "x";',
    'Field[1] = ExternalProcess; Field[1].CommandLine = "x";',
    'Field[1].CommandLine = "x";',
    "Field[1] = Structured;",
    'Solver.Executable0 = "x";',
    'Solver[0].Name = "x";',
    'General.ErrorFileName = "x";',
    'General.LogFileName = "x";',
    'General.TmpFileName = "x";',
    'General.TextEditor = "x";',
    "General.SaveOptions = 2;",
    'Geometry.DoubleClickedPointCommand = "x";',
    "If (0)\n SystemCall 'x';\n EndIf",
    # gmsh's second scanner, for parts that are left out, may end such a part inside a string
    'If (0)\n a = "EndIf SystemCall b;";\n EndIf',
    'If (0)\n a = "EndIf"; c = " SystemCall b; "; EndIf',
    f'a = "{1100 * "x"}"; b = "SystemCall c;";',
    'a = "x\0"; b = "SystemCall c;";',
    'a = "SystemCall c;',
    "/* SystemCall c;",
]


@pytest.mark.parametrize("text", SNEAKY)
def test_scripts_that_do_more_than_describe_a_part(text):
    with pytest.raises(ao.MeshError, match=r"part\.geo is refused for line \d+ .*trust=True"):
        geo_script.harmless(BAR + text, "part.geo")


HARMLESS = [
    'Physical Curve("SystemCall") = {1};',
    'Physical Curve("Return spring") = {1}; // SystemCall "x"',
    "/* Merge 'x.geo'; */ Save = 3; Print = Save + 1; System() = {1, 2};",
    'Save = 3; Printf("%g > %g", 1, 2); If (Save > 2) Save = 1; EndIf',
    "Field[1] = MathEval; Field[1].F = '0.1'; Background Field = 1;",
    "Mesh.MeshSizeMax = 0.5; General.Terminal = 0; Mesh.Algorithm = 6;",
    'n~{1} = 2; Macro twice Save = 2 * Save; Return Save = 1; Call twice;\nName = "a>b";',
    "a = 1e-3; b = .5; c = 1.; d() = {1:3}; e = a >= b || c == 1 && !a;",
]


@pytest.mark.parametrize("text", HARMLESS)
def test_scripts_that_describe_a_part_keep_their_meaning(tmp_path, session, text):
    plain, given = tmp_path / "plain.geo", tmp_path / "given.geo"
    plain.write_text(BAR + text + "\n")
    script = geo_script.harmless(BAR + text, "part.geo")
    given.write_text(script.text)
    assert script.text.count("\n") == (BAR + text).count("\n") + 1
    found = []
    for path in (plain, given):
        gmsh.open(str(path))
        gmsh.model.mesh.generate(1)
        names = [gmsh.model.getPhysicalName(*g) for g in gmsh.model.getPhysicalGroups()]
        found.append((names, *map(np.ndarray.tolist, gmsh.model.mesh.getNodes()[:2])))
    assert found[0] == found[1]


def test_scripts_of_this_repository_are_harmless():
    for path in MESHES.glob("*.geo"):
        script = geo_script.harmless(path.read_text(), path.name)
        step = path.with_suffix(".step")  # some merge it, others draw the part themselves
        assert script.merged == ([step.name] if step.exists() else [])


def test_cad_beside_a_script_is_merged(tmp_path):
    (tmp_path / "part.geo").write_text('Merge "bracket.step";\nMesh.MeshSizeMax = 0.03;')
    assert "merges bracket.step, but there is no such file" in refusal(tmp_path / "part.geo")
    (tmp_path / "bracket.step").write_bytes((MESHES / "bracket.step").read_bytes())
    assert ao.read_mesh(tmp_path / "part.geo").n_cells > 100


@pytest.mark.parametrize("text", ["Exit;", "Macro a\n Call a;\nReturn\nCall a;"])
def test_a_script_that_ends_or_holds_its_reader(tmp_path, text):
    path = tmp_path / "part.geo"
    path.write_text(BAR + text)
    with contextlib.suppress(ao.MeshError):  # or gmsh gets over it
        ao.read_mesh(path, timeout=2)
    assert ao.read_mesh(MESHES / "lever.msh").n_cells


BEFORE = ["", "a = 1;\n\n", "/* of\nthree\nlines */\n", "b = 2; // one\n"]


@pytest.mark.parametrize("before", BEFORE)
def test_a_refusal_names_the_line(before):
    number = 1 + before.count("\n")
    with pytest.raises(ao.MeshError, match=rf"part.geo is refused for line {number} \(Include"):
        geo_script.harmless(before + 'Include "other.geo";\n', "part.geo")


# --- What is no file, or breaks its reader --------------------------------------------------------


@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "empty", "loop", "long"])
@pytest.mark.parametrize("suffix", ["msh", "step", "vtu"])
def test_what_is_no_file_is_told_at_once(tmp_path, kind, suffix):
    path = tmp_path / (f"part.{suffix}" if kind != "long" else "x" * 300 + f".{suffix}")
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "empty":
        path.touch()
    elif kind == "loop":
        path.symlink_to(path)
    says = {"folder": "is a folder", "pipe": "pipe or device", "device": "pipe or device"}
    size = 0.1 if suffix == "step" else None
    assert says.get(kind, {"empty": "is empty"}.get(kind, "cannot be opened")) in refusal(
        path, size=size
    )


@pytest.mark.parametrize(
    ("code", "answer", "says"),
    [
        (-signal.SIGSEGV, b"", "broke off (SIGSEGV; it had"),
        (-signal.SIGABRT, b"{}", "broke off (SIGABRT"),
        (-signal.SIGALRM, b"", "needs a longer timeout="),
        (3, b"", "ended with code 3"),
        (0, b"", "gave no mesh"),
        (0, b"no JSON", "is damaged"),
        (0, b'{"arrays": [["float64", [99]]]}\n', "is damaged"),
        (0, b'{"error": "MemoryError"}\n', "GiB to be read"),
    ],
)
def test_a_reader_that_breaks_is_told(tmp_path, monkeypatch, code, answer, says):
    (tmp_path / "part.msh").write_text("$MeshFormat\n")
    monkeypatch.setattr(isolation.server, "ask", lambda request: (code, answer))
    assert says in refusal(tmp_path / "part.msh")


def test_a_reader_that_hangs_is_ended_and_the_next_one_reads(tmp_path):
    path = tmp_path / "part.geo"
    path.write_text("For i In {1:1e15}\n a = i;\nEndFor\n" + BAR)
    assert "needs a longer timeout=" in refusal(path, timeout=0.5)
    assert ao.read_mesh(MESHES / "lever.msh").n_cells


def test_the_reading_process_may_be_lost(tmp_path):
    assert ao.read_mesh(MESHES / "lever.msh").n_cells
    os.kill(isolation.server._process.pid, signal.SIGKILL)
    isolation.server._process.wait()
    assert ao.read_mesh(MESHES / "lever.msh").n_cells


def test_a_reader_ends_with_the_one_that_asked(tmp_path):
    path = tmp_path / "part.geo"
    path.write_text("For i In {1:1e15}\n a = i;\nEndFor\n" + BAR)
    script = f"""
import os, threading, time
from antiosc.fem.readers import isolation, read
from pathlib import Path
threading.Thread(target=read, args=(Path({str(path)!r}),), daemon=True).start()
while isolation.server._process is None:
    time.sleep(0.01)
time.sleep(0.5)
print(isolation.server._process.pid, flush=True)
os._exit(0)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    group, deadline = int(run.stdout), time.monotonic() + 30
    with contextlib.suppress(ProcessLookupError):
        while True:
            os.killpg(group, 0)
            assert time.monotonic() < deadline
            time.sleep(0.05)


def test_counts_of_a_header_take_no_memory(tmp_path):
    path = tmp_path / "part.msh"
    many = 10**12
    path.write_text(f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {many} 1 {many}\n")
    refusal(path, timeout=30)


def test_the_answer_of_a_reader_is_checked(tmp_path, monkeypatch):
    good = {"cells": ["line"], "convention": "gmsh", "groups": [["a", "line", 1]]}
    good |= {"node_sets": [["n", 1]], "aids": True}
    arrays = [np.array([0]), np.array([1]), np.eye(3), np.array([[0, 1], [1, 2]])]

    def answer(head, arrays):
        head = {**head, "arrays": [[str(a.dtype), a.shape] for a in arrays]}
        line = json.dumps(head).encode() + b"\n"
        return isolation._answer("part.msh", line + b"".join(a.tobytes() for a in arrays), 1)

    assert answer(good, arrays).groups["a"]["line"].tolist() == [0]
    for k, wrong in (
        (0, np.array([2])), (1, np.array([3])), (1, np.array([-1])), (2, np.eye(2)),
        (3, np.array([[0, 3]])), (3, np.array([[0, -1]])), (3, np.array([[0, 1, 2]])),
        (0, np.array([0.0])),
    ):  # fmt: skip
        with pytest.raises(ao.MeshError, match=r"part\.msh is damaged"):
            answer(good, [*arrays[:k], wrong, *arrays[k + 1 :]])
    with pytest.raises(ao.MeshError, match="damaged"):
        answer({**good, "cells": ["wedge"]}, arrays)


def test_a_script_sees_little_of_the_environment(tmp_path, monkeypatch):
    for name in ("SECRET", "OMPI_COMM_WORLD_RANK"):
        monkeypatch.setenv(name, "told")
    isolation.server._end()  # the one that runs began before
    path = tmp_path / "part.geo"
    path.write_text(BAR + 'Physical Curve(StrCat("of ", GetEnv("SECRET"))) = {1};')
    assert set(ao.read_mesh(path).groups) == {"of "}


# --- The same mesh --------------------------------------------------------------------------------


def test_a_file_comes_back_as_gmsh_holds_it(session):
    """Coordinates, node order and groups of the child's answer, against gmsh in this process."""
    for name in ("bracket.msh", "frame.msh", "plate.msh"):
        raw = read(MESHES / name)
        gmsh.open(str(MESHES / name))
        tags, x, _ = gmsh.model.mesh.getNodes()
        at = dict(zip(tags.tolist(), np.reshape(x, (-1, 3)), strict=True))
        groups = gmsh.model.getPhysicalGroups(raw.kind.dim)
        members = {int(e) for d, t in groups for e in gmsh.model.getEntitiesForPhysicalGroup(d, t)}
        rows = []
        for member in sorted(members):
            _, _, (nodes,) = gmsh.model.mesh.getElements(raw.kind.dim, member)
            rows.append(np.reshape(nodes, (-1, raw.kind.nodes)))
        expected = np.array([[at[t] for t in row] for row in np.vstack(rows).tolist()])
        np.testing.assert_array_equal(raw.points[raw.cells], expected)
        names = {gmsh.model.getPhysicalName(d, t) for d, t in gmsh.model.getPhysicalGroups()}
        assert set(raw.groups) == names


def grid(path: Path, n: int, groups: int, extra: str = "") -> Path:
    """A square of 2 n² triangles, in as many physical groups, as a Gmsh file of version 2.2."""
    x = [(i / n, j / n) for j in range(n + 1) for i in range(n + 1)]
    lines = [f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(x)}"]
    lines += [f"{k + 1} {a!r} {b!r} 0" for k, (a, b) in enumerate(x)]
    cells = []
    for j in range(n):
        for i in range(n):
            p = j * (n + 1) + i + 1
            cells += [(p, p + 1, p + n + 2), (p, p + n + 2, p + n + 1)]
    if extra == "twice":
        cells += cells[100:140]
    rows = [
        f"{k + 1} 2 2 {k % groups + 1} {k % groups + 1} {a} {b} {c}"
        for k, (a, b, c) in enumerate(cells)
    ]
    lines += ["$EndNodes\n$Elements", str(len(rows)), *rows, "$EndElements\n"]
    path.write_text("\n".join(lines))
    return path


def test_many_groups_are_found_by_one_pass_over_the_mesh(tmp_path, monkeypatch):
    passes = []
    vertices = compat.entity_vertices
    monkeypatch.setattr(
        compat, "entity_vertices", lambda mesh, dim: passes.append(dim) or vertices(mesh, dim)
    )
    mesh = ao.read_mesh(grid(tmp_path / "many.msh", 20, 400))
    assert passes == [2]
    assert len(mesh.groups) == 400
    corners = mesh.dolfinx.geometry.x[vertices(mesh.dolfinx, 2)].min(axis=1)
    for k in (1, 37, 400):
        cells = mesh.group(str(k))[2]
        assert len(cells) == 2
        squares = [(k - 1 + 400 * half) // 2 for half in (0, 1)]
        expected = [[s % 20 / 20, s // 20 / 20, 0] for s in squares]
        np.testing.assert_allclose(sorted(corners[cells].tolist()), sorted(expected), atol=1e-15)


@pytest.mark.mpi
def test_groups_are_the_same_on_two_ranks(tmp_path):
    from mpi import run_ranks

    script = """
        import sys
        import numpy as np
        import antiosc as ao
        mesh = ao.read_mesh(sys.argv[1])
        own = mesh.dolfinx.topology.index_map(2).size_local
        sizes = [mesh.comm.allreduce(int(np.sum(mesh.group(str(k))[2] < own))) for k in range(1, 9)]
        print(sizes)
    """
    path = str(grid(tmp_path / "many.msh", 10, 8))
    assert run_ranks(2, script, path) == ["[25, 25, 25, 25, 25, 25, 25, 25]\n"] * 2


# --- Cells that cannot be, or are not meant -------------------------------------------------------


def write(path: Path, points, *cells, **data) -> Path:
    meshio.Mesh(np.asarray(points, dtype=float), list(cells), **data).write(path)
    return path


def test_repeated_cells_are_refused(tmp_path):
    told = refusal(grid(tmp_path / "grid.msh", 19, 1, "twice"))
    assert "40 of 762 cells of grid.msh repeat another one" in told


def test_cells_that_use_a_node_twice_or_share_a_side_too_often(tmp_path):
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    path = write(tmp_path / "a.vtu", square, ("quad", [[0, 1, 2, 3], [0, 1, 2, 2]]))
    assert "1 of 2 cells of a.vtu use a node twice" in refusal(path)
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 1]]
    tetra = [[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]]
    path = write(tmp_path / "b.vtu", points, ("tetra", tetra))
    assert "3 of 3 cells of b.vtu share a side with more than one other" in refusal(path)


ABAQUS_BEAMS = """\
*NODE
1, 0, 0, 0
2, 1, 0.1, 0
3, 2, 0, 0
4, 3, -0.1, 0
5, 4, 0, 0
*ELEMENT, TYPE=B32, ELSET=all
1, 1, 2, 3
2, 3, 4, 5
"""


def test_beams_of_three_nodes_in_abaqus_order(tmp_path):
    path = tmp_path / "beam.inp"
    path.write_text(ABAQUS_BEAMS)
    raw = read(path)
    assert raw.points[raw.cells][:, :, 0].tolist() == [[0, 2, 1], [2, 4, 3]]
    assert ao.read_mesh(path).order == 2
    straight = ao.read_mesh(path, order=1)
    assert straight.order == 1
    assert np.ptp(straight.dolfinx.geometry.x, axis=0).tolist() == [4, 0, 0]
    path.write_text(ABAQUS_BEAMS.replace("2, 3, 4, 5", "2, 4, 3, 5"))
    assert "in no known order" in refusal(path)


def solid_with_shell(path: Path) -> Path:
    """Two blocks, a skin on a side of them and a fin that stands off, one edge of it stiffened."""
    points = [[x, y, z] for x in (0, 1, 2) for z in (0, 1) for y in (0, 1)] + [[3, 0, 0], [3, 1, 0]]
    hexahedra = [[0, 4, 5, 1, 2, 6, 7, 3], [4, 8, 9, 5, 6, 10, 11, 7]]
    quads, lines = [[0, 1, 3, 2], [8, 9, 13, 12]], [[0, 1], [12, 13]]
    sets = {
        "blocks": [np.array([0, 1]), None, None], "skin": [None, np.array([0]), None],
        "fin": [None, np.array([1]), None], "both": [None, np.array([0, 1]), None],
        "one": [np.array([1]), None, None],
    }  # fmt: skip
    lists = {
        name: [np.zeros(0, dtype=int) if rows is None else rows for rows in blocks]
        for name, blocks in sets.items()
    }
    cells = [("hexahedron", hexahedra), ("quad", quads), ("line", lines)]
    return write(path, points, *cells, cell_sets=lists)


def test_shells_and_beams_that_are_no_sides_of_solids_are_told(tmp_path):
    path = solid_with_shell(tmp_path / "part.inp")
    told = refusal(path)
    assert "holds 2 volumes and besides 1 faces (quad) and 1 lines (line)" in told
    assert "cells=3 (dimension)" in told
    assert ao.read_mesh(path, cells=3).n_cells == 2
    assert len(ao.read_mesh(path, cells=3).group("skin")[2]) == 1
    assert not ao.read_mesh(path, cells=3).groups["fin"]
    assert ao.read_mesh(path, cells="blocks").n_cells == 2
    assert ao.read_mesh(path, cells="one").n_cells == 1
    fin = ao.read_mesh(path, cells="fin")
    assert (fin.n_cells, fin.tdim) == (1, 2)
    assert "2 pieces" in refusal(path, cells=["both"])
    with pytest.raises(ao.InputError, match=r"no group of cells 'foot' .*it has: .*'fin'"):
        ao.read_mesh(path, cells="foot")
    for wrong in (0, 4, True, [], [1], "", 2.5):
        with pytest.raises(ao.InputError, match="cells must"):
            ao.read_mesh(path, cells=wrong)


def test_a_construction_line_in_no_group_is_none_of_the_part(tmp_path):
    path = tmp_path / "part.geo"
    square = """
        Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1};
        Point(4) = {0, 1, 0, 1}; Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4};
        Line(4) = {4, 1}; Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1}; Line(5) = {1, 3};
    """
    path.write_text(square)
    assert "besides 2 lines" in refusal(path)
    path.write_text(square + 'Physical Surface("part") = {1};')
    assert ao.read_mesh(path).tdim == 2
    path.write_text(square + 'Physical Surface("part") = {1}; Physical Curve("rib") = {5};')
    assert "besides 2 lines" in refusal(path)


# --- Cells that do not fit ------------------------------------------------------------------------


def told(path: Path) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ao.read_mesh(path)
    return [str(w.message) for w in caught if issubclass(w.category, ao.AntioscWarning)]


def blocks(n: int, shift: float, shape: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Two unit squares or cubes of n cells a side, the second `shift` along x; not joined."""
    dim = 2 if shape in ("triangle", "quad") else 3
    make = {"quad": "quadrilateral", "tetra": "tetrahedron"}.get(shape, shape)
    nodes = 2**dim if shape in ("quad", "hexahedron") else dim + 1
    part = parts.box([n] * dim, [1.0] * dim, make, comm=MPI.COMM_SELF, groups={}).dolfinx
    order = np.argsort(compat.node_order(make, nodes, "vtk"))
    x, cells = part.geometry.x, compat.geometry_nodes(part)[:, order]
    return np.vstack([x, x + np.array([shift, 0, 0])]), np.vstack([cells, cells + len(x)]), shape


def bridged(points, cells, shape):
    """The same with one node of both blocks made one, so that they are one piece."""
    x = points.copy()
    half = len(x) // 2
    a = np.flatnonzero(np.isclose(x[:half], x[:half].max(axis=0)).all(axis=1))[0]
    b = half + np.argmin(np.linalg.norm(x[half:] - x[a], axis=1))
    x[b] = x[a]
    cells = np.where(cells == b, a, cells)
    return x, cells, shape


@pytest.mark.parametrize("shape", ["triangle", "quad", "tetra", "hexahedron"])
def test_cracks_and_overlaps_are_told(tmp_path, shape):
    path = tmp_path / "part.vtu"
    points, cells, _ = bridged(*blocks(2, 1.0, shape))  # coincident nodes but for one
    write(path, points, (shape, cells))
    (crack,) = told(path)
    expected = 4 if shape in ("triangle", "quad") else 16
    assert f"{expected} nodes of part.vtu lie on cells that they do not belong to" in crack
    points, cells, _ = bridged(*blocks(2, 0.75, shape))
    write(path, points, (shape, cells))
    assert any("overlap others" in t for t in told(path))
    single = len(cells) // 2
    write(path, points, (shape, cells[:single]))
    assert told(path) == []


def test_a_node_that_hangs_on_an_edge_is_told(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [1, 0.5, 0]]
    points += [[2, 0.5, 0]]
    quads = [[0, 1, 2, 3], [1, 4, 7, 6], [6, 7, 5, 2]]
    (hanging,) = told(write(tmp_path / "part.vtu", points, ("quad", quads)))
    assert "1 nodes of part.vtu lie on cells" in hanging
    assert "(1, 0.5) m" in hanging


def test_sheets_and_lines_that_touch_unjoined_are_told(tmp_path):
    skin = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    blade = [[0, 1, 0], [2, 1, 0], [2, 1, 1], [0, 1, 1]]  # its foot lies on the skin
    bridge = [[0, 2, 1]]
    triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [3, 7, 8]]
    path = write(tmp_path / "t.vtu", skin + blade + bridge, ("triangle", triangles))
    (crack,) = told(path)
    assert "2 nodes of t.vtu lie on cells" in crack
    frame = [[0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    lines = [[0, 1], [2, 3], [3, 4], [4, 0]]
    (crack,) = told(write(tmp_path / "f.vtu", frame, ("line", lines)))
    assert "1 nodes of f.vtu lie on cells" in crack
    over = [[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [2, 0, 0]]
    path = write(tmp_path / "o.vtu", over, ("line", [[0, 1], [2, 3], [0, 3]]))
    assert any("overlap others" in t for t in told(path))


def test_sound_meshes_are_told_nothing_of():
    for path in MESHES.glob("*.msh"):
        assert told(path) == []


# --- Sizes ----------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("kernel", ["occ", "own", "own, order 2"])
def test_a_size_that_would_fill_the_machine_is_refused(tmp_path, session, kernel):
    path = cube(session, tmp_path / "cube", kernel)
    for size in (1e-30, 1e-12):
        assert "below what its coordinates resolve" in refusal(path, size=size)
    assert "8.5e+07 cells at size=0.00464 m, more than 1e+07" in refusal(path, size=0.00464)
    assert "1.2e+09 lines at size=1e-08 m" in refusal(path, size=1e-8)
    assert ao.read_mesh(path, size=0.5).n_cells > 10


@pytest.mark.parametrize("kernel", ["occ", "own"])
def test_the_forecast_of_cells_is_right_by_half(tmp_path, session, kernel):
    gmsh.open(str(cube(session, tmp_path / "cube", kernel)))
    ask = Request("cube.brep", "cube.brep", size=0.12)
    told = [meshing.expected_cells(gmsh, ask, dim, 0.12, 1.0) for dim in (1, 2, 3)]
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.12)
    gmsh.model.mesh.generate(3)
    for dim, kind in ((1, 1), (2, 2), (3, 4)):
        made = len(gmsh.model.mesh.getElementsByType(kind)[0])
        assert 0.5 < told[dim - 1] / made < 2


def test_areas_and_volumes_follow_from_the_mesh_of_their_boundaries(tmp_path, session):
    """In gmsh's own kernel, which does not know them: the unit cube has 6 faces of area 1."""
    gmsh.open(str(cube(session, tmp_path / "cube", "own")))
    gmsh.model.mesh.generate(2)
    for dim, count in ((1, 12), (2, 6), (3, 1)):
        measures = [meshing.measure_of(gmsh, d, tag) for d, tag in gmsh.model.getEntities(dim)]
        assert measures == pytest.approx([1.0] * count, rel=1e-9)


# --- Damaged files --------------------------------------------------------------------------------


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
@pytest.mark.parametrize("seed", range(3))
def test_damaged_files_are_refused_or_read(tmp_path, seed):
    rng = random.Random(seed)
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
    for suffix in ("unv", "stl"):
        gmsh.write(str(tmp_path / f"cube.{suffix}"))
        files.append(tmp_path / f"cube.{suffix}")
    files += [cube(gmsh, tmp_path / "cube", kernel) for kernel in ("occ", "own")]
    gmsh.finalize()
    told = []
    for k in range(60):
        file = rng.choice(files)
        path = tmp_path / f"damaged{k}{file.suffix}"
        path.write_bytes(damaged(file.read_bytes(), rng))
        geometry = file.suffix in by_gmsh.GEOMETRY
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                ao.read_mesh(path, size=0.5 if geometry else None, timeout=20)
            except ao.InputError as error:
                told.append(str(error))
    assert len(told) > 20
    assert not [t for t in told if "\n" in t or not t.endswith(".")]


def test_the_reading_process_loads_neither_scipy_nor_dolfinx():
    script = """
import runpy, sys
from pathlib import Path
child = runpy.run_path(sys.argv[1])
child["_hollow_packages"](Path(sys.argv[1]).parents[2])
from antiosc.fem.readers.table import library_of, reader_of
print(library_of("part.step"), reader_of("part.step").__name__)
print(*{"scipy", "dolfinx", "petsc4py", "meshio"} & sys.modules.keys())
"""
    path = Path(isolation.__file__).with_name("child.py")
    arguments = [sys.executable, "-c", script, str(path)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["gmsh generate", ""]


def test_med_with_groups(tmp_path):
    """Families of cells and of nodes by their names, as Salome and Code_Aster write them."""
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("h5py")
    points = [(x, y, 0.0) for y in (0, 1) for x in (0, 1, 2)]
    cells = [("triangle", [(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4)]), ("line", [(0, 3), (2, 5)])]
    tags = [np.array([-6, -6, -7, -7]), np.array([-8, -9])]
    mesh = meshio.Mesh(points, cells, cell_data={"cell_tags": tags})
    mesh.point_data["point_tags"] = np.array([1, 0, 2, 1, 0, 2])
    mesh.cell_tags = {-6: ["left", "all"], -7: ["right", "all"], -8: ["root"], -9: ["tip"]}
    mesh.point_tags = {1: ["held"], 2: ["free"]}
    path = tmp_path / "part.med"
    meshio.write(path, mesh)
    found = ao.read_mesh(path)
    assert {name: len(found.group(name)[2]) for name in ("left", "right", "all")} == {
        "left": 2,
        "right": 2,
        "all": 4,
    }
    assert len(found.group("root")[1]) == len(found.group("tip")[1]) == 1
    assert set(found.group("held"))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("part.vtu", "<VTKFile>", "part.vtu cannot be read as VTU: it is damaged, or a variant"),
        ("part.mesh", "MeshVersionFormatted 9\nx", "cannot be read as Medit"),
        ("part.xyz", "1 2 3", "files of the type .xyz are not read; write the mesh as .msh"),
        ("part.dat", "VARIABLES = nothing\n", "cannot be read as Tecplot"),
    ],
)
def test_other_files_are_refused_in_our_own_words(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ao.MeshError, match=message) as caught:
        ao.read_mesh(path)
    assert "\n" not in str(caught.value)
    assert "meshio" not in str(caught.value)


def test_bulk_data_by_its_content(tmp_path):
    path = tmp_path / "part.dat"
    path.write_text((DECKS / "bar.bdf").read_text())
    assert ao.read_mesh(path).n_cells == ao.read_mesh(DECKS / "bar.bdf").n_cells
    assert ao.read_model(path).mass == pytest.approx(ao.read_model(DECKS / "bar.bdf").mass)
