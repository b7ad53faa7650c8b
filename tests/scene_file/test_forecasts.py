"""Rows of `--dry-run`, and places of a scene that name groups of its meshes."""

from __future__ import annotations

from types import SimpleNamespace

from antiosc.scene_file import group_names
from antiosc.scene_file.program import Call, Name, Statement

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


def test_places_that_name_groups():
    assert dict(group_names._named(DATA, "")) == {
        ("material", "a"): "a", ("material", "b"): "b", ("supports", 0, "where"): "clamp",
        ("attached", 1, "where"): "top", ("sites", "s", "point"): "eye",
        ("probes", "p", "point"): "q:tip", ("map", "where"): "skin",
    }  # fmt: skip
    assert dict(group_names._named(DATA, "q")) == {
        ("joints", 0, "a"): "q:x", ("joints", 1, "group"): "q:z", ("probes", "p", "point"): "q:tip",
        ("parts", "q", "supports", 0, "where"): "q:foot",
    }  # fmt: skip
    assert dict(group_names._named({"parts": {"q": {}}}, "q")) == {}
    assert dict(group_names._named({"map": {"where": [0]}}, "")) == {}


def test_meshes_and_decks_of_a_scene():
    mesh = Call("ao.read_mesh", {"source": "a.msh"}, ("geometry",))
    deck = Call("ao.read_model", {"path": "b.inp"}, ("parts", "q", "deck"))
    parts = Call("ao.assemble", {"*parts": {"q": deck, "r": Call("ao.Structure", {"*mesh": mesh})}})
    strike = Call("ao.strike", {"*source": "c.msh"}, ("strike",))
    for statements, run, expected in (
        ([Statement("structure", parts)], None, [("q", "b.inp"), ("", "a.msh")]),
        ([], Statement("history", strike), [("", "c.msh")]),
        ([], Statement("history", Call("ao.strike", {"*source": Name("mesh")})), []),
        ([], Statement("history", Call("ao.simulate", {})), []),
    ):
        made = SimpleNamespace(structure=statements, simulation=run)
        calls = list(group_names._meshes(made))
        assert [(part, group_names._path(call).name) for part, call in calls] == expected


def test_files_whose_groups_are_not_read(tmp_path, monkeypatch):
    path = tmp_path / "a.msh"
    path.write_bytes(b"x" * 11)
    call = Call("ao.read_mesh", {"source": str(path)})
    monkeypatch.setattr(group_names, "LARGEST", 10)
    assert group_names._groups(call) == ([], "the file is larger than 1e-05 MB.")
    for name in ("a.STEP", "b.geo", "c.stl"):
        known, why = group_names._groups(Call("ao.read_mesh", {"source": name}))
        assert known == []
        assert why.startswith("a geometry has them once it is meshed")
    monkeypatch.setattr(group_names, "LARGEST", 11)
    monkeypatch.setattr(group_names, "_groups_of_deck", lambda call: ["A", "B"])
    deck = Call("ao.read_model", {"path": str(path)})
    assert group_names._groups(deck) == (["A", "B"], "")
