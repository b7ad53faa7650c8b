"""Messages of the library in the words of a scene file."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import antiosc
from antiosc.base import materials
from antiosc.base.errors import warn
from antiosc.base.texts import SMALLER_CELLS
from antiosc.engine.contact.choice import Choice
from antiosc.engine.contact.surfaces import Matter
from antiosc_app import cli, live, results
from antiosc_app.scene_file import run
from antiosc_app.scene_file.document import SceneFileError
from antiosc_app.words import SECTIONS, of_scenes

CALL = re.compile(rf"\b({'|'.join(SECTIONS)})\(")


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ("use Site(node=…, dof=…).", "use node = …, dof = … in [sites]."),
        ("use that, Site(..., snap=True), or", "use that, snap = true in [sites], or"),
        ("a growing n in extract().", "a growing n in [extract]."),
        ("give extract(part, {a: Site(x, d)}) a", "give [extract] a"),
        ("the offsite(x) of it", "the offsite(x) of it"),
        ("Support(where=(1, 2), fix='x')", "where = (1, 2), fix = 'x' in [[supports]]"),
    ],
)
def test_calls_become_keys_and_sections(told, expected):
    assert of_scenes(told) == expected


def messages() -> list[str]:
    """The texts of the library that name such a call, but docstrings."""
    found = []
    for path in Path(antiosc.__file__).parent.rglob("*.py"):
        tree = ast.parse(path.read_text())
        expressions = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                is_message = " " in node.value and id(node) not in expressions
                found += [node.value] if is_message and CALL.search(node.value) else []
    return found


@pytest.mark.slow
def test_no_message_of_the_library_keeps_a_call():
    assert len(messages()) > 5
    for text in messages():
        assert not CALL.search(of_scenes(text)), text


def test_commands_and_reports_tell_keys(capsys):
    error = SceneFileError("scene.toml:3: sites.tip: use Site(..., snap=True).")
    cli._print_error(error)
    assert "use snap = true in [sites]." in capsys.readouterr().err
    part = results.Presentation(text=["it depends on n: take more in extract()"])
    of_run = SimpleNamespace(
        compiled=SimpleNamespace(document=SimpleNamespace(data={})), structure=None, warnings=[]
    )
    assert "take more in [extract]" in results.text(of_run, [part])
    told: list[str] = []
    with run.collected_warnings(told):
        warn("the point is no node: use Site(..., snap=True)", antiosc.AccuracyWarning)
    assert told == ["the point is no node: use snap = true in [sites]"]
    assert told[0].category is antiosc.AccuracyWarning  # by which it is weighed


def test_advice_names_no_function_of_python(monkeypatch):
    def refused(*_given):
        raise antiosc.InputError("its sides do not tell: give advise the length and the width.")

    monkeypatch.setattr(results, "advise", refused)
    monkeypatch.setattr(results, "mass_of", lambda _: [])
    monkeypatch.setattr(results, "_longest_cell", lambda _: 0.0)
    striker = SimpleNamespace(hertz=None)
    part = SimpleNamespace(describe=lambda: "a part")
    rows = results.advice_of(SimpleNamespace(structure=part, impactor=striker))
    assert rows == [("structure", "a part")]  # no advice is nothing to tell


#: Advice of each kind: cells, anti-oscillators, yield strength.
ADVICE = " ".join(
    (
        f"cells ({SMALLER_CELLS})",
        live.REMEDIES["truncation"],
        f"strength ({live.OWN_STRENGTH}), {live.ASKED_STRENGTH}.",
    )
)


@pytest.mark.parametrize(
    ("sections", "expected"),
    [
        ({"geometry": {"source": "a.step"}}, "yield_strength, yield_range in [material]"),
        ({"geometry": {"source": "a.step"}, "strike": {}}, "(a smaller tol in [strike])"),
        ({"deck": {"source": "a.inp"}}, "yield_strength, yield_range in [deck]"),
        ({"deck": {}, "impactor": {"material": "PA66"}}, "give yield_strength in [deck]."),
        (
            {"deck": {}, "impactor": {"mass": 1.0}},
            "in [deck], and yield_strength or a material in [impactor].",
        ),
        (
            {"geometry": {}, "material": {"name": "steel"}, "impactor": {"E": 2e7}},
            "give yield_strength or a material in [impactor].",
        ),
    ],
)
def test_advice_in_a_scene_names_its_own_sections_and_no_fields_of_the_page(sections, expected):
    scene = SimpleNamespace(document=SimpleNamespace(data=sections))
    told = results.with_remedy(ADVICE, SimpleNamespace(compiled=scene, structure=None))
    assert expected in told
    assert live.ASKED_STRENGTH not in told
    for words in ("page", "field", "list of materials", "Finer mesh"):
        assert words not in told
    assert ("[extract]" in told) == ("strike" not in sections)
    beside = {"extract", "impactor"} | ({"material"} if "geometry" in sections else set())
    assert {*re.findall(r"\[(\w+)\]", told)} <= {*sections, *beside}


def test_advice_on_the_law_does_not_ask_for_what_is_given(monkeypatch):
    """By what yields: of the table, with a range of its own, without one, and the striker."""
    of_table = materials.record("steel S235")
    constants = {"E": 210e9, "yield_strength": 235e6}
    ranged = {**constants, "yield_range": (235e6, 300e6)}
    table = {**constants, "yield_range": of_table.yield_range, "name": of_table.name}
    hit = SimpleNamespace(law=None, model=None, impactor=None, peak_force=1.0, deepest=1e-3)

    def ending(side="", curvature=0.0, **matter):
        soft = Matter(**matter) if matter else None
        choice = Choice(antiosc.Hertz(1e9), "", soft, curvature=curvature)
        monkeypatch.setattr(live, "choice_of", lambda *_: choice)
        monkeypatch.setattr(live, "weaker_side", lambda _: side)
        return live._end_of_law(hit)

    asks = "to narrow it, give the yield strength"
    assert ending(**table).startswith(asks)
    for given in (ranged, {**table, "yield_range": (200e6, 300e6)}):
        assert "give" not in ending(**given).replace("given", "")
        assert live.OWN_STRENGTH not in ending(**given)
    assert "taken as exact" in ending(**constants)
    assert "striker" in ending("the striker's POM", **table)
    assert live.OWN_STRENGTH not in ending("the striker", **constants)
    assert ending() == ""  # none yields: there is no strength to give
    assert "pressed in by 0.1 of its radius" in ending(curvature=100.0, **table)
