"""A scene has the same numbers and words in Python, on the terminal, on the page and by a tool."""

from __future__ import annotations

import json
import re

import pytest

from agent_calls import filled, number, one_by_one, served_here, told
from antiosc_app import commands
from antiosc_app.cli import main
from antiosc_app.edited import toml_text
from antiosc_app.headline import force_bar
from antiosc_app.opened import OpenPart
from antiosc_app.scene_file.document import read_document
from antiosc_app.scene_file.run import error_budget

pytestmark = [
    pytest.mark.fem,
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning"),
]

#: A factor by another number of threads, or in memory that is aligned otherwise, rounds otherwise.
ROUNDING = 1e-11


def of_scene(text: str) -> str:
    """A text without the seconds of the machine and the name of the file of the scene."""
    return re.sub(r"\S+\.(toml|json):\d+: |\b[\d.]+ s\b", "", text)


def test_python_command_page_and_tool_agree(tmp_path, capsys):
    folder = filled(tmp_path)
    page = OpenPart(folder / "beam.msh", unit="m")
    page.calls["look"]({})
    short = {"impactor.velocity": 1.5, "simulate.duration": 1e-2, "extract.n": 10}
    turn = page.calls["edit"]({"set": short})["turn"]
    shown = page.calls["show"]({"turn": turn})["summary"]
    sections = page._edited_scene.sections
    page.close()

    path = folder / "scene.toml"
    path.write_text(toml_text(sections), encoding="utf-8")
    capsys.readouterr()
    assert main(["run", str(path), "--verbose", "--out", str(folder / "out")]) == 0
    printed = capsys.readouterr().out
    written = json.loads((folder / "out/result.json").read_text(encoding="utf-8"))["result"]
    document = read_document(path)
    hit = commands.study_results(document, commands.compiled_for(document, "run"), "run").history
    answer = told(*served_here(folder, one_by_one([("strike", {"scene": sections})])))

    assert of_scene(answer["text"]) == of_scene(shown["text"])
    assert [(card["name"], card["text"]) for card in answer["cards"]] == [
        tuple(card[:2]) for card in shown["cards"]
    ]
    for name in ("peak_force", "impulse", "contact_time", "restitution"):
        value = number(answer, name)["value"]
        assert value == pytest.approx(written[name], rel=ROUNDING)
        assert value == pytest.approx(getattr(hit, name), rel=ROUNDING)
    assert of_scene(shown["text"]) in of_scene(printed)
    budget = error_budget(hit)
    below, above = budget.sides("peak_force")
    low, high = number(answer, "peak_force")["bar"]
    assert (low, high) == pytest.approx(
        ((1 - below) * hit.peak_force, (1 + above) * hit.peak_force), rel=1e-12
    )
    assert force_bar(budget) is not None
