"""What stands in the pictures of a report: curves, labels and views, drawn into lists."""

from __future__ import annotations

import base64
from types import SimpleNamespace

import pytest

pytest.importorskip("matplotlib")

from antiosc.app.scene_file import report_pictures as drawn
from antiosc.base.errors import InputError
from antiosc.models.model_info import ModelInfo


def test_names_in_pictures_are_no_formulas():
    assert drawn._plain("$a$\n") == r"\$a\$?"
    assert drawn._plain("x" * 60) == "x" * 60
    assert drawn._plain("x" * 61) == "x" * 57 + "…"


SITE = {"point": (1.0, 2.0, 3.0), "direction": (0.0, 0.0, 1.0)}
#: What a model knows of its site -> the arrow
STRUCK = {
    "one": (ModelInfo(**SITE), tuple(SITE.values())),
    "two": (ModelInfo(points={"a": (1.0, 2.0, 3.0), "b": (0.0, 0.0, 1.0)}), (None, None)),
    "plane": (ModelInfo(point=(1.0, 2.0), direction=(0.0, 1.0)), (None, None)),
    "unknown": (ModelInfo(), (None, None)),
}


def results(info=None, **variables):
    model = None if info is None else SimpleNamespace(info=info)
    found = {"history": None, "model": model, "batch": None, "map": None, "structure": None,
             "probes": None, **variables}  # fmt: skip
    return SimpleNamespace(**found)


@pytest.mark.parametrize("case", STRUCK)
def test_the_arrow_of_the_impact(case):
    info, expected = STRUCK[case]
    assert drawn._struck(results(info)) == expected


@pytest.mark.parametrize("known", [True, False])
def test_a_structure_from_several_sides(monkeypatch, known):
    shown = []
    monkeypatch.setattr(drawn, "plot_deformed", lambda *one, **named: shown.append((one, named)))

    def draw(heading, caption, draw, ending):
        draw("path")
        return drawn.Picture(heading, caption, "data")

    monkeypatch.setattr(drawn, "_drawn", draw)
    found = results(STRUCK["one"][0] if known else None, structure="structure", history="history")
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
