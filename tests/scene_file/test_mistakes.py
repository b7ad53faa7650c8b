"""Mistakes in scene files: one sentence each, with file, line and the nearest key."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

import antiosc as ao
from antiosc.app.scene_file.build import Call, Evaluation
from antiosc.app.scene_file.document import DEEPEST, LARGEST_FILE, Document, Problems, read
from scene_files import BEAM, BRACKET, HIT, LAW, MASS, SCENES, antiosc, written

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
        ('[contact]\nkind = "Hertz"\nstiffness = 5e8', "[contact]"),
        ('[sites.middle]\nnode = 9\ndof = "z"', "site"),
        (next(line for line in BEAM.splitlines() if line.startswith("M = ")), "'M'"),
    ],
)
def test_what_is_missing_is_named(tmp_path, capsys, lost, held):
    ((_, sentence),) = sentences(written(tmp_path, BEAM.replace(lost, "")), capsys)
    assert held in sentence


MANY = """\
titel = "twenty mistakes"
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
TWENTY = {
    1: "[title]", 3: "'missing.mtx'", 4: "file", 5: "'twelve'", 7: "whole", 8: "'direction'",
    10: "whole", 11: "relative", 12: "'method'", 15: "SI", 17: "nu", 18: "rho", 20: "'RigidMass'",
    21: "'mass'", 25: "'tip'", 26: "'ball'", 27: "stiffness", 28: "number", 32: "table",
    34: "'tip'", 36: "shape", 37: "'ball'", 40: "'duration'", 41: "tol", 42: "'eksact'",
    44: "svg", 45: "true",
}  # fmt: skip


def test_what_a_run_would_tell_is_told_before(tmp_path, capsys):
    """Units of a material, an impactor that flies away, a map without points."""
    heavy = BRACKET.replace("rho = 2700", "rho = 2.7e-9")
    ((line, sentence),) = sentences(written(tmp_path, heavy + HIT), capsys)
    assert line == 1 + heavy.splitlines().index("[material]")
    assert "rho=2700" in sentence
    empty = BRACKET + MASS + LAW + "[map]\nwhere = []\nduration = 1e-3\n"
    ((line, sentence),) = sentences(written(tmp_path, empty), capsys)
    assert line == 1 + empty.splitlines().index("where = []")
    assert "one point" in sentence
    for scene, count in (
        (BEAM.replace("velocity = 1.0", "velocity = -2.0"), 1),
        (BEAM.replace("velocity = 1.0", "velocity = -2.0") + "gravity = -9.81\n", 0),
        (BEAM, 0),
        (BRACKET.replace("E = 70e9", "E = 7e8").replace("rho = 2700", "rho = 1e6") + HIT, 1),
    ):
        assert antiosc("check", written(tmp_path, scene)) == 0
        assert capsys.readouterr().out.count("warning: ") == count


def test_twenty_mistakes_are_all_told_at_once(tmp_path, capsys):
    found = sentences(written(tmp_path, MANY), capsys)
    assert [line for line, _ in found] == sorted(line for line, _ in found)
    for line, held in TWENTY.items():
        assert any(held in sentence for at, sentence in found if at == line), (line, held)
    extra = [(line, sentence) for line, sentence in found if line not in TWENTY]
    assert len(extra) == 1  # of [motion.bal], whose velocity lacks a component
    assert len(found) == len(TWENTY) + 1


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "[" * (DEEPEST + 1) + "]" * (DEEPEST + 1),
        "x = " + "[" * 100_000,
        "# " + "x" * LARGEST_FILE,
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


@pytest.mark.sample(-1)
@pytest.mark.parametrize("line", ["[x{}]", "k{} = 1"])
def test_many_mistakes_are_not_all_told(tmp_path, capsys, line):
    path = written(tmp_path, "\n".join(line.format(i) for i in range(20_000)))
    assert antiosc("check", path) == 1
    *told, last = capsys.readouterr().err.splitlines()
    assert len(told) == 100
    assert last.endswith("and 900 more, or still more.")


@pytest.mark.fem
def test_a_deck_is_read_for_its_groups(tmp_path, capsys):
    """Names of supports, sites and probes; and a deck that cannot be read."""
    pytest.importorskip("dolfinx")
    deck = written(tmp_path, (SCENES / "bar.inp").read_text(), "bar.inp")
    right = (SCENES / "deck.toml").read_text()
    assert antiosc("check", written(tmp_path, right)) == 0
    assert "no mistakes" in capsys.readouterr().out
    text = right.replace("point = [0.3, 0.0, 0.0]", 'point = "fixed xx"')
    text += '[[supports]]\nwhere = "bar"\n[probes.b]\npoint = "fixed y"\n'
    found = dict(sentences(written(tmp_path, text), capsys))
    lines = text.splitlines()
    for key, near in {'point = "fixed xx"': "fixed x", 'where = "bar"': "BAR"}.items():
        assert f"'{near}'" in found.pop(lines.index(key) + 1)
    assert not found
    deck.write_text(deck.read_text().replace("TYPE=B31", "TYPE=B77"))
    ((line, sentence),) = sentences(written(tmp_path, right), capsys)
    assert line == right.splitlines().index("[deck]") + 1
    assert "bar.inp cannot be read: bar.inp has 10 B77 elements" in sentence


@pytest.mark.fem
def test_groups_of_a_deck_of_several_parts(tmp_path):
    pytest.importorskip("dolfinx")
    from antiosc.fem.assembly.from_deck import outline_of_deck

    text = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n*NSET,NSET=TIP\n5\n"
    text += "*ELEMENT,TYPE=S4,ELSET=SKIN\n1,1,2,3,4\n*ELEMENT,TYPE=B31,ELSET=POLE\n2,1,5\n"
    text += "*SHELL SECTION,ELSET=SKIN,MATERIAL=M\n.1\n"
    text += "*BEAM SECTION,ELSET=POLE,MATERIAL=M,SECTION=RECT\n.1,.2\n0,1,0\n"
    text += "*MATERIAL,NAME=M\n*ELASTIC\n1E9,.2\n*DENSITY\n1000\n"
    found, cells = outline_of_deck(written(tmp_path, text, "two.inp"))
    assert {"SKIN", "POLE", "TIP", "faces:SKIN", "beams:POLE", "beams:TIP"} <= set(found)
    assert "beams:SKIN" not in found
    assert [raw.points[raw.cells].shape for raw in cells] == [(1, 4, 3), (1, 2, 3)]


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


def test_the_mark_of_a_windows_editor_is_no_mistake(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + BEAM.replace("\n", "\r\n").encode())
    assert read(path).data == tomllib.loads(BEAM)


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


def test_only_wrong_input_gets_the_line_of_its_table():
    """A solver that fails is no mistake of the scene; nor is a call that no table makes."""

    def failing(error: Exception, place) -> Exception:
        def make():
            raise error

        with pytest.raises(type(error)) as told:
            evaluate(Call(make, {}, place))
        return told.value

    evaluate = Evaluation(Document(Path("s.toml"), {}, Problems("s.toml", "\n\n[simulate]\n")))
    for error in (ao.NotConvergedError("no"), ao.AccuracyError("no"), KeyError("no")):
        assert failing(error, ("simulate",)) is error
    wrong = ao.InputError("duration must be > 0.")
    assert failing(wrong, ()) is wrong
    assert str(failing(wrong, ("simulate",))).startswith("s.toml:3: simulate: duration")
