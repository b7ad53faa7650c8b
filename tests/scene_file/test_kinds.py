"""What a parameter may hold, from its annotation."""

from __future__ import annotations

from types import SimpleNamespace

from numpy.typing import ArrayLike

from antiosc.scene_file.kinds import kinds_of


def test_a_name_for_a_type_holds_what_the_type_holds():
    """From NumPy 2.4 ArrayLike is such a name, of which nothing but its value tells the type."""
    for annotation in (float, list[int], ArrayLike):
        named = SimpleNamespace(__value__=annotation)
        assert kinds_of(named, kinds_of) == kinds_of(annotation, kinds_of) != ()
