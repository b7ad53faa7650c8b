"""Rows of `--dry-run`, and places of a scene that name groups of its meshes."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.app.scene_file import outline
from antiosc.app.scene_file.build import Call
from antiosc.app.scene_file.scene import Compiled
from antiosc.base.errors import AntioscError, InputError

# --- Groups ---------------------------------------------------------------------------------------

DATA = {
    "material": {"a": {"E": 1}, "b": {"E": 2}},
    "supports": [{"where": "clamp"}, {"plane": []}],
    "attached": [{"where": [0, 0, 1]}, {"where": "top"}],
    "sites": {"s": {"point": "eye"}, "t": {"point": [0, 0, 0]}, "n": {"node": 3}},
    "probes": {"p": {"point": "q:tip"}},
    "map": {"where": "skin"},
    "parts": {"q": {"material": {"E": 1}, "supports": [{"where": "foot"}]}},
    "joints": [{"a": "q:x", "b": "r:y"}, {"group": "q:z", "a": 3}],
}


def named(data, part):
    return {place: name for place, name in outline._named(data, part) if isinstance(name, str)}


def test_places_that_name_groups():
    assert named(DATA, "") == {
        ("material", "a"): "a", ("material", "b"): "b", ("supports", 0, "where"): "clamp",
        ("attached", 1, "where"): "top", ("sites", "s", "point"): "eye",
        ("probes", "p", "point"): "q:tip", ("map", "where"): "skin",
    }  # fmt: skip
    assert named(DATA, "q") == {
        ("joints", 0, "a"): "x", ("joints", 1, "group"): "z", ("probes", "p", "point"): "tip",
        ("parts", "q", "supports", 0, "where"): "foot",
    }  # fmt: skip
    assert named({"parts": {"q": {}}}, "q") == {}
    assert named({"map": {"where": [0]}}, "") == {}


def test_meshes_and_decks_of_a_scene():
    mesh = Call(ao.read_mesh, {"source": "a.msh"}, ("geometry",))
    deck = Call(ao.read_model, {"path": "b.inp"}, ("parts", "q", "deck"))
    parts = Call(ao.assemble, {"parts": {"q": deck, "r": Call(ao.Structure, {"mesh": mesh})}})
    strikes = [Call(ao.strike, {"source": source}) for source in ("c.msh", mesh, parts)]
    for structure, run, expected in (
        (parts, None, [("q", "b.inp"), ("", "a.msh")]),
        (parts, strikes[2], [("q", "b.inp"), ("", "a.msh")]),
        (None, strikes[0], [("", "c.msh")]),
        (None, strikes[1], [("", "a.msh")]),
        (None, Call(ao.simulate, {}), []),
    ):
        made = Compiled(document=None, structure=structure, history=run)
        calls = list(outline._meshes(made))
        assert [(part, outline._path(call).name) for part, call in calls] == expected


def test_the_outline_of_a_file(tmp_path, monkeypatch):
    """The box of all cells in space, the largest of them; a file that is too large is not read."""
    path = tmp_path / "a.msh"
    path.write_bytes(b"x" * 11)
    call = Call(ao.read_mesh, {"source": str(path)})
    pieces = [(np.array([[0.0, 1.0], [3.0, -1.0]]), 0.5), (np.array([[4.0, 0.0]]), 0.7)]
    monkeypatch.setattr(outline, "_read", lambda call, path: (["A", "B"], pieces))
    monkeypatch.setattr(outline, "LARGEST", 11)
    found = outline.outline(call)
    assert (found.name, found.groups, found.element) == ("a.msh", ["A", "B"], 0.7)
    assert (found.low.tolist(), found.high.tolist()) == ([0, -1, 0], [4, 1, 0])
    assert found.distance(np.array([4.0, 1.6, 0.0])) == 0.0
    assert found.distance(np.array([7.0, 5.0, 0.0])) == pytest.approx(5.0)
    monkeypatch.setattr(outline, "LARGEST", 10)
    with pytest.raises(AntioscError, match="larger") as refused:
        outline.outline(call)
    assert not isinstance(refused.value, InputError)  # no mistake of the scene
