"""The box of a file and its groups."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("dolfinx")

import antiosc as ao
from antiosc.app.scene_file import outline
from antiosc.app.scene_file.build import Call
from antiosc.base.errors import AntioscError, InputError


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
