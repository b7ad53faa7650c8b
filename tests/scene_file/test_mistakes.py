"""Mistakes in scene files: one sentence each, with file, line and the nearest key."""

from __future__ import annotations

import inspect

import pytest

import antiosc as ao
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import (
    MAX_DEPTH,
    MAX_FILE_BYTES,
    SceneFileError,
    read_document,
)
from antiosc_app.scene_file.scene import CompiledScene
from antiosc_app.scene_file.schema import FAMILY_NAMES, IMPACTOR_NAMES, JOINT_NAMES, LAW_NAMES
from scene_files import (
    ASKED,
    BEAM,
    BODIES,
    DECK,
    FALL,
    HIT,
    MATRICES,
    MESH,
    MODEL,
    SITE,
    antiosc,
    written,
)

#: line of BEAM that is replaced -> its replacement, and a word of the one sentence; further
#: mistakes stand in MANY.
ONE = {
    "a list for a number": ("mass = 0.05", "mass = [1]", "number"),
    "a number that is not finite": ("mass = 0.05", "mass = nan", "finite"),
    "a file that is a folder": ("beam_K.mtx", "", "regular"),
    "a path that is too long": ("beam_K.mtx", "x/" * 5000, "exist"),
    "a number of 400 digits": ("mass = 0.05", "mass = 1" + "0" * 400, "larger"),
    "an escape sequence of terminals": (
        'title = "a mass', 'title = "\\u001b[31ma mass', "control"),
}  # fmt: skip
#: Told with the line of its table: what the keys say together is wrong.
OF_TABLE = {"two ways to say one thing"}


def sentences(path, capsys) -> list[tuple[int, str]]:
    """(line, sentence) of each mistake that `antiosc check` tells."""
    assert antiosc("check", path) == 1
    told = capsys.readouterr()
    assert told.out == ""
    found = []
    for line in told.err.splitlines():
        assert line.startswith(f"{path}:")
        number, _, sentence = line[len(f"{path}:") :].partition(": ")
        found.append((int(number), sentence))
    return found


@pytest.mark.sample(-1)
@pytest.mark.parametrize("case", ONE)
def test_one_mistake_is_one_sentence_with_its_line(tmp_path, capsys, case):
    old, new, held = ONE[case]
    assert BEAM.count(old) == 1
    lines = BEAM.splitlines()
    expected = next(i for i, line in enumerate(lines, 1) if old in line) + new.count("\n")
    if case in OF_TABLE:
        expected = lines.index("[sites.middle]") + 1
    ((line, sentence),) = sentences(written(tmp_path, BEAM.replace(old, new)), capsys)
    assert line == expected
    assert held in sentence
    assert sentence.endswith((".", "?"))


@pytest.mark.parametrize(
    ("lost", "held"),
    [
        ("mass = 0.05", "'mass'"),
        ("duration = 2e-3", "'duration'"),
        ('kind = "Hertz"', "'kind'"),
        ('[sites.middle]\nnode = 9\ndof = "z"', "site"),
        (next(line for line in BEAM.splitlines() if line.startswith("M = ")), "'M'"),
    ],
)
def test_what_is_missing_is_named(tmp_path, capsys, lost, held):
    ((_, sentence),) = sentences(written(tmp_path, BEAM.replace(lost, "")), capsys)
    assert held in sentence


MANY = """\
titel = "many mistakes"
[matrices]
K = "missing.mtx"
M = 5
supports = { twelve = "all" }
[sites.tip]
node = "nine"
direktion = [0, 0, 1]
[extract]
n = 2.5
tol = 3
methode = "krylov"
[bodies.ball]
kind = "Sphere"
radius = "1 cm"
E = 210e9
nu = 0.7
rho = -7850
[bodies.block]
kind = "RigidMas"
[bodies.plate]
kind = "RigidMass"
velocity = 1
[[contacts]]
a = "structure:top"
b = "bal"
law = { kind = "Hertz", stiffness = -1e9 }
friction = "much"
[[contacts]]
a = "structure:tip"
b = "plate"
law = "Linear"
[[loads]]
end = "structure:tipp"
times = [0, 1]
forces = [1]
[motion.bal]
velocity = [1, 0]
[run]
durration = 1e-3
tol = 0
method = "eksact"
[output]
plot = "gif"
csv = 1
"""
#: line of MANY -> a word of its sentence
TOLD = {
    1: "[title]", 3: "'missing.mtx'", 5: "'twelve'", 8: "'direction'", 10: "whole", 11: "relative",
    12: "'method'", 15: "number", 20: "'RigidMass'", 21: "'mass'", 27: "stiffness", 28: "number",
    32: "table", 36: "shape", 40: "'duration'", 41: "tol", 42: "'eksact'", 45: "true",
}  # fmt: skip


def test_many_mistakes_are_all_told_at_once(tmp_path, capsys):
    found = sentences(written(tmp_path, MANY), capsys)
    assert [line for line, _ in found] == sorted(line for line, _ in found)
    for line, held in TOLD.items():
        assert any(held in sentence for at, sentence in found if at == line), (line, held)
    extra = [(line, sentence) for line, sentence in found if line not in TOLD]
    assert len(extra) == 1  # of [motion.bal], whose velocity lacks a component
    assert len(found) == len(TOLD) + 1


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1),
        "x = " + "[" * 100_000,
        "# " + "x" * MAX_FILE_BYTES,
        "\ufeff[matrices]",
        "a" * 1000 + " = 1",
        '"\\u0000" = 1',
        "[sites.tip]\npoint = [1e400, 0, 0]",
        "x = " + "{a=" * 3000 + "1" + "}" * 3000,
    ],
    ids=lambda text: text[:20],
)
def test_hostile_files_are_refused_in_words(tmp_path, capsys, text):
    path = written(tmp_path, text)
    assert antiosc("check", path) == 1
    told = capsys.readouterr().err
    assert "Traceback" not in told
    assert len(told) < 5000


def test_files_that_are_no_scene_are_refused(tmp_path, capsys):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    for path, held in {
        tmp_path / "none.toml": "No such file",
        tmp_path: "regular",
        "/dev/zero": "regular",
        binary: "UTF-8",
    }.items():
        assert antiosc("check", path) == 1
        assert held in capsys.readouterr().err


def test_a_scene_cannot_reach_beyond_data(tmp_path, capsys):
    """Neither names of Python nor permissions nor other objects can be named."""
    for kind in ("__import__", "Hertz.__init__", "impactor.__class__", "os.system", "simulate"):
        path = written(tmp_path, BEAM.replace('"Hertz"', f'"{kind}"'))
        ((_, sentence),) = sentences(path, capsys)
        assert "kind" in sentence
    script = written(tmp_path, 'SystemCall "touch pwned";', "part.geo")
    text = f'[geometry]\nsource = "{script.name}"\ntrust = true\n[material]\nkind = "Solid"\n'
    text += "E = 1e9\nnu = 0.3\nrho = 1e3\n[sites.a]\npoint = [0, 0, 0]\ndirection = [0, 0, 1]\n"
    pytest.importorskip("dolfinx")
    ((_, sentence),) = sentences(written(tmp_path, text), capsys)
    assert "trust" in sentence


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A scene file in the working folder, beside files that are not opened."""
    monkeypatch.chdir(tmp_path)
    for name in ("part.msh", "part.inp", "model.npz", "box.geo", "plate.geo", "signals.csv"):
        (tmp_path / name).write_text("not read")

    def of(text: str) -> CompiledScene:
        (tmp_path / "scene.toml").write_text(text)
        return compile_document(read_document("scene.toml"))

    return of


#: Scenes, and the line of each mistake with a word of its sentence.
WRONG = {
    "two sources": (DECK + MODEL + HIT, [(1, "point"), (3, "both")]),
    "no material": (MESH + SITE + HIT, [(1, "constants")]),
    "two sites": (DECK + SITE + SITE.replace(".a", ".b") + HIT, [(3, "structure:SITE")]),
    "single and many": (BODIES + HIT, [(7, "describes")]),
    "strike of a model": (MODEL + HIT.replace("[simulate]", "[strike]"), [(10, "strike")]),
    "structure": (DECK + SITE + BODIES + '[bodies.structure]\nkind = "Obstacle"\n', [(18, "body")]),
    "no run": (BODIES.replace('[run]\nduration = 1e-3\n', ''), [(1, "run")]),
    "no contacts": (
        BODIES[:BODIES.index('[[contacts]]')]+'[run]\nduration = 1e-3\n', [(1, "bodies")]),
    "contact": (
        'contacts = [3]\n' + BODIES[:BODIES.index('[[contacts]]')]+'[run]\nduration = 1e-3\n',
        [(1, "contacts[0")]),
    "sweep": (MODEL + HIT + '[sweep]\nsimulate.n = [1]\n', [(13, "duration")]),
    "map": (MODEL + HIT + '[map]\non = "x"\n', [(12, "map"), (13, "no key")]),
    "parts": (
        '[parts.a]\nsource = 3\n[parts]\nb = 2\n' + SITE,
        [(1, "parts.a"), (2, "section"), (4, "parts.b")]),
    "falls": (FALL + "ensemble = {sigma = 2.0}\n" + ASKED, [(17, "ensemble"), (20, "ensemble")]),
    "frf": (
        '[frf]\npath = "none.csv"\n[from_frf]\nband = [5.0]\ndamping = "rubber"\n' + SITE + HIT,
        [(2, "exist"), (4, "shape"), (5, "viscous"), (6, "[matrices]")]),
}  # fmt: skip


@pytest.mark.fem
@pytest.mark.parametrize("case", WRONG)
def test_every_mistake_is_told_with_its_line(scene, case):
    text, told = WRONG[case]
    with pytest.raises(SceneFileError) as caught:
        scene(text)
    found = str(caught.value).splitlines()
    assert [one.split(": ")[0] for one in found] == [f"scene.toml:{line}" for line, _ in told]
    assert all(word in one for one, (_, word) in zip(found, told, strict=True)), found


RUNS = {
    "simulate": MODEL + HIT + 'n = "auto"\n',
    "extract": MATRICES + 'dof = "z"\n[extract]\nn = 0\n' + HIT,
    "method": MATRICES + 'dof = "z"\n[extract]\nmethod = "modes"\n' + HIT,
    "damping": MATRICES + 'dof = "z"\n[extract]\ndamping = [0.02, 0.01]\n' + HIT,
}


@pytest.mark.fem
@pytest.mark.parametrize("case", RUNS)
def test_a_value_is_checked_by_the_rule_of_its_function(scene, case):
    """A number of anti-oscillators may be "auto" for one function, 0 for another."""
    scene(RUNS[case])


#: Bodies that are no impactors.
BODIES = (ao.AntiOscillators, ao.LinearBody)


@pytest.mark.fem
def test_every_public_class_of_a_section_is_in_its_list():
    """A new material, law, impactor or joint, and each constructor of a law or an impactor."""
    public = [getattr(ao, name) for name in ao._MODULES if inspect.isclass(getattr(ao, name))]
    public = [kind for kind in public if not inspect.isabstract(kind)]
    laws = [kind for kind in public if issubclass(kind, ao.ContactLaw)]
    impactors = [kind for kind in public if callable(getattr(kind, "modal", None))]
    impactors = [kind for kind in impactors if kind not in BODIES]

    def constructors(kind: type) -> list[str]:
        names = inspect.getmembers(kind, inspect.ismethod)
        own = [n for n, method in names if method.__annotations__["return"] == kind.__name__]
        return [kind.__name__, *(f"{kind.__name__}.{n}" for n in own)]

    found = {
        FAMILY_NAMES: [kind.__name__ for kind in public if hasattr(kind, "weak_form")],
        JOINT_NAMES: [kind.__name__ for kind in public if hasattr(kind, "constraints")],
        LAW_NAMES: [name for kind in laws for name in constructors(kind)],
        IMPACTOR_NAMES: [name for kind in impactors for name in constructors(kind)],
    }
    for names, kinds in found.items():
        assert set(kinds) == set(names.split()) - {"named_impactor", "material"}
