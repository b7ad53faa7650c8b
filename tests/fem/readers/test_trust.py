"""Scripts of gmsh: what they may do without trust."""

from __future__ import annotations

import sys

import numpy as np
import pytest

pytest.importorskip("dolfinx")
pytest.importorskip("gmsh")

import gmsh

import antiosc as ao
from antiosc.io import geo_script, isolation
from mesh_files import refusal
from paths import MESHES

pytestmark = pytest.mark.fem
BAR = "Point(1) = {0, 0, 0, 0.5}; Point(2) = {1, 0, 0, 0.5}; Line(1) = {1, 2};\n"


@pytest.fixture
def marked(tmp_path):
    """A command for a file to run, and whether it ran."""
    command = f"touch {tmp_path}/mark"
    return command, (tmp_path / "mark").exists


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


@pytest.mark.slow
def test_modules_in_the_working_folder_are_not_imported(tmp_path, monkeypatch):
    """The path of a notebook, or of `python -c`, has the working folder in front."""
    (tmp_path / "gmsh.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w').close()")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", *sys.path])
    isolation._end()  # the next one has to import gmsh
    assert ao.read_mesh(MESHES / "lever.msh").n_cells
    assert not (tmp_path / "mark").exists()


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
    with pytest.raises(ao.MeshError, match="refused"):
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
