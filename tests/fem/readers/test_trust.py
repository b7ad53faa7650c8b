"""A mesh is data: what a file says or does reaches neither the disk, the shell nor this process."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time

import gmsh
import numpy as np
import pytest

import antiosc as ao
from antiosc.io import isolation
from antiosc.io.by_gmsh import _node_order
from antiosc.io.isolation import checked_script
from antiosc.io.neutral import CELL_TYPES
from antiosc.io.reading import read
from mesh_files import refusal
from paths import MESHES

AFRESH = isolation._run_reader
BAR = "Point(1) = {0, 0, 0, 0.5}; Point(2) = {1, 0, 0, 0.5}; Line(1) = {1, 2};\n"


def archive(head: dict, arrays: list) -> bytes:
    """What a reader answers."""
    content = io.BytesIO()
    np.savez(content, np.frombuffer(json.dumps(head).encode(), dtype=np.uint8), *arrays)
    return content.getvalue()


@pytest.fixture(autouse=True)
def processes_of_their_own(monkeypatch):
    """Readers start as those of a user do."""
    monkeypatch.setattr(isolation, "_run_reader", AFRESH)


@pytest.fixture
def marked(tmp_path):
    """A command for a file to run, and whether it ran."""
    command = f"touch {tmp_path}/mark"
    return command, (tmp_path / "mark").exists


@pytest.mark.slow
def test_a_script_by_the_name_of_a_mesh_is_not_run(tmp_path, marked):
    command, happened = marked
    path = tmp_path / "part.msh"
    path.write_text(f'SystemCall "{command}";\n{BAR}')
    assert "does not begin as a Gmsh mesh" in refusal(path)
    assert not happened()


@pytest.mark.slow
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


@pytest.mark.slow
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
    'Include "../x.geo";',
    'Include "evil.geo";',
    'Merge "evil.geo";',
    'Include "around.geo";',
    'Merge "../part.step";',
    'Merge "/tmp/part.step";',
    'Merge StrCat("a", ".step");',
    'Merge "x.msh";',
    'MergeWithBoundingBox "x.step";',
    'Print StrCat("x", ".png");',
    'Save Sprintf("x%g.msh", 1);',
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
    'a = "SystemCall c;',
    "/* SystemCall c;",
]


@pytest.mark.parametrize("text", SNEAKY)
def test_scripts_that_do_more_than_describe_a_part(text):
    with pytest.raises(ao.MeshError, match="refused"):
        checked_script(BAR + text, "part.geo")
    with pytest.raises(ao.MeshError, match="binary"):
        checked_script(BAR + 'a = "x\0";' + text, "part.geo")


HARMLESS = [
    'Physical Curve("Return spring") = {1}; // SystemCall "x"',
    "/* Merge 'x.geo'; */ Saved = 3; Prints = Saved + 1;",
    'a = 3; Printf("%g > %g", 1, 2); If (a > 2) a = 1; EndIf',
    "Field[1] = MathEval; Field[1].F = '0.1'; Background Field = 1;",
    "Mesh.MeshSizeMax = 0.5; General.Terminal = 0; Mesh.Algorithm = 6;",
    'n~{1} = 2; Macro twice a = 2 * a; Return a = 1; Call twice;\nName = "a>b";',
    "a = 1e-3; b = .5; c = 1.; d() = {1:3}; e = a >= b || c == 1 && !a;",
]


@pytest.mark.parametrize("text", HARMLESS)
def test_scripts_that_describe_a_part_keep_their_meaning(tmp_path, session, text):
    plain, given = tmp_path / "plain.geo", tmp_path / "given.geo"
    plain.write_text(BAR + text + "\n")
    checked, merged = checked_script(BAR + text, "part.geo")
    given.write_text(checked)
    assert checked.count("\n") == (BAR + text).count("\n") + 1
    assert merged == []
    found = []
    for path in (plain, given):
        gmsh.open(str(path))
        gmsh.model.mesh.generate(1)
        names = [gmsh.model.getPhysicalName(*g) for g in gmsh.model.getPhysicalGroups()]
        found.append((names, *map(np.ndarray.tolist, gmsh.model.mesh.getNodes()[:2])))
    assert found[0] == found[1]


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
        (-signal.SIGABRT, b"PK", "broke off (SIGABRT"),
        (-signal.SIGALRM, b"", "give read_mesh a longer timeout"),
        (-signal.SIGPROF, b"", "give read_mesh a longer timeout"),
        (3, b"", "broke off (code 3; "),
        (0, b"", "gave no mesh"),
        (0, b"no archive", "is damaged"),
        (0, archive({"error": "MemoryError"}, [])[:-5], "is damaged"),
        (0, archive({"error": "MemoryError"}, []), "GiB to be read"),
    ],
)
def test_a_reader_that_breaks_is_told(tmp_path, monkeypatch, code, answer, says):
    (tmp_path / "part.msh").write_text("$MeshFormat\n")
    monkeypatch.setattr(isolation, "_run_reader", lambda request: (code, answer))
    assert says in refusal(tmp_path / "part.msh")


@pytest.mark.slow
def test_a_reader_that_hangs_is_ended_and_the_next_one_reads(tmp_path):
    path = tmp_path / "part.geo"
    path.write_text("For i In {1:1e15}\n a = i;\nEndFor\n" + BAR)
    assert "give read_mesh a longer timeout" in refusal(path, timeout=0.5)
    assert ao.read_mesh(MESHES / "lever.msh").n_cells


@pytest.mark.slow
def test_a_reader_ends_with_the_one_that_asked(tmp_path):
    path = tmp_path / "part.geo"
    path.write_text("For i In {1:1e15}\n a = i;\nEndFor\n" + BAR)
    script = f"""
import os, subprocess, threading, time
from antiosc.io.reading import read
from pathlib import Path
started, plain = [], subprocess.Popen
subprocess.Popen = lambda *a, **k: started.append(plain(*a, **k)) or started[-1]
threading.Thread(target=read, args=(Path({str(path)!r}),), daemon=True).start()
while not started:
    time.sleep(0.01)
time.sleep(0.5)
print(started[0].pid, flush=True)
os._exit(0)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    group, deadline = int(run.stdout), time.monotonic() + 30
    with contextlib.suppress(ProcessLookupError):
        while True:
            os.killpg(group, 0)
            assert time.monotonic() < deadline
            time.sleep(0.05)


@pytest.mark.slow
def test_counts_of_a_header_take_no_memory(tmp_path):
    path = tmp_path / "part.msh"
    many = 10**12
    path.write_text(f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {many} 1 {many}\n")
    refusal(path, timeout=30)


@pytest.mark.slow
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
            (kind,), _, (nodes,) = gmsh.model.mesh.getElements(raw.kind.dim, member)
            label = next(k for k, (_, _, number) in CELL_TYPES.items() if number == kind)
            rows.append(np.reshape(nodes, (-1, raw.kind.nodes))[:, _node_order(gmsh, kind, label)])
        expected = np.array([[at[t] for t in row] for row in np.vstack(rows).tolist()])
        np.testing.assert_array_equal(raw.points[raw.cells], expected)
        names = {gmsh.model.getPhysicalName(d, t) for d, t in gmsh.model.getPhysicalGroups()}
        assert set(raw.groups) == names
