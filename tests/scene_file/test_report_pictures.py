"""What stands in the pictures of a report: curves, labels and views, drawn into lists."""

from __future__ import annotations

import base64
from types import SimpleNamespace

import pytest

pytest.importorskip("matplotlib")

from antiosc.app.scene_file import report_pictures as drawn
from antiosc.base.errors import InputError


def test_names_in_pictures_are_no_formulas():
    assert drawn._plain("$a$\n") == r"\$a\$?"
    assert drawn._plain("x" * 60) == "x" * 60
    assert drawn._plain("x" * 61) == "x" * 57 + "…"


STRUCK = {
    "one": ({"a": {"point": [1, 2, 3], "direction": [0, 0, 1]}}, ([1, 2, 3], [0, 0, 1])),
    "two": ({"a": {"point": [1, 2, 3], "direction": [0, 0, 1]}, "b": {}}, (None, None)),
    "none": ({}, (None, None)),
    "plane": ({"a": {"point": [1, 2], "direction": [0, 1]}}, (None, None)),
    "group": ({"a": {"point": "tip", "direction": [0, 0, 1]}}, (None, None)),
    "node": ({"a": {"node": 3, "dof": "z"}}, (None, None)),
    "no direction": ({"a": {"point": [1, 2, 3]}}, (None, None)),
}


def results(sites=(), **variables):
    document = SimpleNamespace(data={"sites": sites} if sites else {})
    found = {"history": None, "model": None, "batch": None, "map": None, "structure": None,
             "probes": None, **variables}  # fmt: skip
    return SimpleNamespace(compiled=SimpleNamespace(document=document), **found)


@pytest.mark.parametrize("case", STRUCK)
def test_the_arrow_of_the_impact(case):
    sites, expected = STRUCK[case]
    assert drawn._struck(results(sites)) == expected


@pytest.mark.parametrize("known", [True, False])
def test_a_structure_from_several_sides(monkeypatch, known):
    shown = []
    monkeypatch.setattr(drawn, "plot_deformed", lambda *one, **named: shown.append((one, named)))

    def draw(heading, caption, draw, ending):
        draw("path")
        return drawn.Picture(heading, caption, "data")

    monkeypatch.setattr(drawn, "_drawn", draw)
    found = results(STRUCK["one"][0] if known else {}, structure="structure", history="history")
    headings = [one.heading for one in drawn._of_structure(found)]
    assert len(set(headings)) == len(headings) == (3 if known else 1)
    point, direction = STRUCK["one"][1] if known else (None, None)
    views = list(drawn.VIEWS.values())[: len(headings)]
    assert shown == [
        (("structure", "history", "path"), {"view": view, "point": point, "direction": direction})
        for view in views
    ]
    monkeypatch.setattr(drawn, "_drawn", lambda *_: drawn.Picture("one", "not drawn", ""))
    assert [one.heading for one in drawn._of_structure(found)] == ["one"]


def test_a_picture_is_data_or_a_sentence():
    one = drawn._drawn("a", "b", lambda path: path.write_bytes(b"<svg>"), ".svg")
    content = base64.b64encode(b"<svg>").decode()
    assert one == drawn.Picture("a", "b", f"data:image/svg+xml;base64,{content}")
    one = drawn._drawn("a", "b", lambda path: path.write_bytes(b"png"), ".png")
    assert one.data.startswith("data:image/png;base64,")
    for error in (InputError("no points."), ValueError("no formula")):

        def broken(path, error=error):
            raise error

        one = drawn._drawn("a", "b", broken, ".png")
        assert one == drawn.Picture("a", f"Not drawn: {error}", "")
