"""Mistakes between the sections of a scene, each by its line."""

from __future__ import annotations

import pytest

from antiosc.app.scene_file.document import SceneFileError, read
from antiosc.app.scene_file.scene import Compiled, compiled
from scene_files import (
    ASKED,
    BLOW,
    BODIES,
    DECK,
    FALL,
    HIT,
    MATERIAL,
    MATRICES,
    MESH,
    MODEL,
    SITE,
)

pytest.importorskip("dolfinx")

MAT = MATERIAL.format("material")


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A scene file in the working folder, beside files that are not opened."""
    monkeypatch.chdir(tmp_path)
    for name in ("part.msh", "part.inp", "model.npz", "box.geo", "plate.geo", "signals.csv"):
        (tmp_path / name).write_text("not read")

    def of(text: str) -> Compiled:
        (tmp_path / "scene.toml").write_text(text)
        return compiled(read("scene.toml"))

    return of


#: Scenes, and the line of each mistake with a word of its sentence.
WRONG = {
    "two sources": (DECK + MODEL + HIT, [(1, "point"), (3, "both")]),
    "nothing": (HIT, [(1, "matrices")]),
    "joints": (
        MODEL + HIT + '[[joints]]\nkind = "Weld"\na = "x"\nb = "y"\n[at.x]\n'
        '[points]\np = [0, 0, 0]\n[assembly]\n',
        [(12, "joints"), (16, "parts.NAME"), (17, "points"), (19, "parts.NAME")]),
    "beside deck": (
        DECK + SITE + HIT + MAT + '[structure]\norder = 1\n[[supports]]\nwhere = "x"\n',
        [(15, "materials"), (20, "materials")]),
    "beside model": (
        MODEL + HIT + MAT + '[[supports]]\nwhere = "x"\n[[attached]]\n',
        [(12, "saved"), (17, "saved"), (19, "attached")]),
    "no material": (MESH + SITE + HIT, [(1, "constants")]),
    "sites of a model": (MODEL + SITE + HIT, [(3, "belong")]),
    "no site": (DECK + HIT, [(1, "point")]),
    "two sites": (DECK + SITE + SITE.replace(".a", ".b") + HIT, [(3, "structure:SITE")]),
    "one": (
        MODEL + HIT + '[scene]\n[base]\n[[loads]]\n[motion.a]\n',
        [(12, "several"), (13, "base"), (14, "loads"), (15, "motion")]),
    "single and many": (BODIES + HIT, [(7, "describes")]),
    "no impactor": (MODEL + '[simulate]\nduration = 1e-3\n', [(1, "between"), (1, "strikes")]),
    "strike": (
        DECK + SITE + HIT + '[strike]\nduration = 1e-3\ntol = 0.1\n[extract]\nn = 3\n',
        [(13, "chooses"), (18, "extract")]),
    "strike of a model": (MODEL + HIT.replace("[simulate]", "[strike]"), [(10, "strike")]),
    "strike of two": (
        DECK + SITE + SITE.replace(".a", ".b") + HIT.replace("[simulate]", "[strike]"),
        [(16, "strike")]),
    "structure": (DECK + SITE + BODIES + '[bodies.structure]\nkind = "Obstacle"\n', [(18, "body")]),
    "ends": (
        DECK + SITE + BODIES.replace('a = "a"', 'a = "structure:x"').replace('b = "b"', 'b = "c"'),
        [(13, "contacts[0].a"), (14, "contacts[0].b")]),
    "end without site": (
        DECK + SITE + BODIES.replace('a = "a"', 'a = "structure"'), [(13, "contacts[0].a")]),
    "site of a mass": (BODIES.replace('a = "a"', 'a = "a:x"'), [(8, "none")]),
    "no run": (BODIES.replace('[run]\nduration = 1e-3\n', ''), [(1, "run")]),
    "no contacts": (
        BODIES[:BODIES.index('[[contacts]]')]+'[run]\nduration = 1e-3\n', [(1, "bodies")]),
    "law": (
        BODIES.replace('law = {kind = "Linear", stiffness = 1e6}', 'law = 3'), [(10, "stiffness")]),
    "no law": (
        BODIES.replace('law = {kind = "Linear", stiffness = 1e6}\n', ''), [(7, "stiffness")]),
    "contact": (
        'contacts = [3]\n' + BODIES[:BODIES.index('[[contacts]]')]+'[run]\nduration = 1e-3\n',
        [(1, "contacts[0")]),
    "loads": (
        BODIES + '[[loads]]\nend = "c"\ntimes = [0.0, 1.0]\nforces = [0.0, 1.0]\n'
        '[motion.c]\nvelocity = [0, 0, 1]\n', [(14, "loads[0].end"), (17, "motion.c")]),
    "probes": (MODEL + HIT + '[probes.a]\npoint = [0, 0, 0]\n', [(12, "simulation")]),
    "probes without": (DECK + SITE + '[probes.a]\npoint = [0, 0, 0]\n', [(6, "simulation")]),
    "sweep": (BODIES + '[sweep]\nimpactor.mass = [1.0]\n', [(13, "varies")]),
    "sweep kind": (
        MODEL + HIT.replace('"Hertz"\nstiffness = 5e8', '"impactor.hertz"') + '[sweep]\n'
        'contact.stiffness = [1e8]\nsimulate.n = [1]\n',
        [(7, "number"), (7, "number"), (13, "duration")]),
    "map": (MODEL + HIT + '[map]\non = "x"\n', [(12, "map"), (13, "Anti-oscillators")]),
    "parts": (
        '[parts.a]\nsource = 3\n[parts]\nb = 2\n' + SITE,
        [(1, "parts.a"), (2, "section"), (4, "parts.b")]),
    "parts2": (
        '[parts.a.deck]\npath = "part.inp"\n[parts.b.geometry]\nsource = "part.msh"\n'
        '[[joints]]\nkind = "Weld"\na = "c:x"\nb = "b:y"\n[at.d]\nshift = [0, 0, 1]\n' + SITE,
        [(3, "parts.b.material"), (7, "joints[0].a"), (9, "part")]),
    "material beside parts": (
        '[parts.a.deck]\npath = "part.inp"\n' + MAT + SITE, [(3, "parts.NAME.material")]),
    "material beside matrices": (MATRICES + 'dof = "z"\n' + MAT, [(8, "their")]),
    "fix": (
        MESH + MAT + SITE + '[[supports]]\nwhere = "x"\nfix = ["x", "w"]\n'
        '[[supports]]\nwhere = "y"\nfix = "q"\n',
        [(13, "supports[0].fix"), (16, "supports[1].fix")]),
    "fall": (FALL + "[[supports]]\nwhere = 'x'\n" + HIT, [
        (1, "site"), (16, "free"), (18, "impactor"), (22, "contact"), (25, "simulate")]),
    "falls": (FALL + "ensemble = {sigma = 2.0}\n" + ASKED, [(17, "ensemble"), (20, "ensemble")]),
    "fall's end": (FALL.replace("until = 1", 'until = "now"'), [(12, "rest")]),
    "filter": (FALL + ASKED.replace("CFC1000", "CFC100"), [(18, "CFC180")]),
    "no fall": (FALL[:FALL.index("[drop]")] + ASKED, [(9, "drop"), (12, "drop")]),
    "fall of a model": (MODEL + "[drop]\nheight = 1.0\n", [(3, "structure")]),
    "blow and sweep": (BLOW + "[sweep]\n", [
        (1, "site"), (33, "blow"), (33, "list"), (33, "simulate")]),
    "sensors alone": (BLOW[:BLOW.index("[find]")], [(13, "find")]),
    "no sensors": (BLOW.replace("[sensors.", "[sites."), [
        (13, "blow"), (19, "quantity"), (27, "sensors")]),
    "sensor": (BLOW.replace('"velocity"', '"force"'), [(19, "acceleration")]),
    "blow on a model": (MODEL + BLOW[BLOW.index("[sensors"):], [(17, "structure")]),
    "frf": (
        '[frf]\npath = "none.csv"\n[from_frf]\nband = [5.0]\ndamping = "rubber"\n' + SITE + HIT,
        [(2, "exist"), (4, "shape"), (5, "viscous"), (6, "structure")]),
    "wrong forms": (
        'title = 3\ngeometry = 1\nsupports = 2\n[[sites]]\npoint = 1\n',
        [(1, "constants"), (1, "quotes"), (2, "geometry"), (3, "tables"), (4, "names")]),
}  # fmt: skip


@pytest.mark.sample
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
    "damping": MATRICES + 'dof = "z"\n[extract]\ndamping = [0.02, 0.01]\n' + HIT,
}


@pytest.mark.parametrize("case", RUNS)
def test_a_value_is_checked_by_the_rule_of_its_function(scene, case):
    """A number of anti-oscillators may be "auto" for one function, 0 for another."""
    scene(RUNS[case])
