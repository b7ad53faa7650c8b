"""Messages of the library in the words of a scene file."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import antiosc
from antiosc.base.errors import warn
from antiosc_app import cli, results
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
    striker = SimpleNamespace(hertz=None)
    part = SimpleNamespace(describe=lambda: "a part")
    rows = results.advice_of(SimpleNamespace(structure=part, impactor=striker))
    assert rows == [("structure", "a part")]  # no advice is nothing to tell
