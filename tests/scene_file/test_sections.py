"""Mistakes between the sections of a scene, each by its line."""

from __future__ import annotations

import pytest

from antiosc.app.scene_file.document import SceneFileError, read
from antiosc.app.scene_file.scene import Compiled, compiled
from scene_files import (
    ASKED,
    BODIES,
    DECK,
    FALL,
    HIT,
    MATRICES,
    MESH,
    MODEL,
    SITE,
)

pytest.importorskip("dolfinx")


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
    "sweep kind": (
        MODEL + HIT.replace('"Hertz"\nstiffness = 5e8', '"impactor.hertz"') + '[sweep]\n'
        'contact.stiffness = [1e8]\nsimulate.n = [1]\n',
        [(7, "number"), (7, "number"), (13, "duration")]),
    "map": (MODEL + HIT + '[map]\non = "x"\n', [(12, "map"), (13, "Anti-oscillators")]),
    "parts": (
        '[parts.a]\nsource = 3\n[parts]\nb = 2\n' + SITE,
        [(1, "parts.a"), (2, "section"), (4, "parts.b")]),
    "falls": (FALL + "ensemble = {sigma = 2.0}\n" + ASKED, [(17, "ensemble"), (20, "ensemble")]),
    "frf": (
        '[frf]\npath = "none.csv"\n[from_frf]\nband = [5.0]\ndamping = "rubber"\n' + SITE + HIT,
        [(2, "exist"), (4, "shape"), (5, "viscous"), (6, "[matrices]")]),
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
