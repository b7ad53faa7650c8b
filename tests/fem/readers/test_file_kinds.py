"""Units, expected cells, kinds of files by their endings, and options that do not fit them."""

from __future__ import annotations

import pytest

from antiosc.base.errors import MeshError
from antiosc.io.neutral import UnitSystem
from antiosc.io.reading import read
from antiosc.io.table import is_deck, reader_of
from refusals import refused


def test_decks_that_share_their_endings_with_others(tmp_path):
    texts = {"a.dat": b"$ c\n begin  bulk\n", "b.dat": b"GRID,1\n", "c.pch": b"cend\n"}
    texts |= {"d.asm": b"x\nGRID*   1\n", "e.dat": b"GRIDS\n", "f.dat": b"TITLE\n"}
    texts |= {"g.txt": b"GRID 1\n"}
    found = {}
    for name, content in texts.items():
        (tmp_path / name).write_bytes(content)
        found[name] = is_deck(tmp_path / name)
        assert reader_of(tmp_path / name).library == ("numpy" if found[name] else "meshio")
    assert [name for name, deck in found.items() if deck] == ["a.dat", "b.dat", "c.pch", "d.asm"]
    assert not is_deck(tmp_path / "none.dat")
    for name in ("a.inp", "a.BDF", "a.nas", "a.fem"):
        assert is_deck(name)
        assert reader_of(name).library == "numpy"
    assert not is_deck("a.unv")
    for suffix, library in {"unv": "numpy", "msh": "gmsh", "step": "gmsh", "vtu": "meshio"}.items():
        name = f"a.{suffix}"
        assert reader_of(name).library == library
    assert reader_of("a.stl", solid=True).library == "gmsh"


OPTIONS = {
    ("a.msh", (("solid", True),)): (None, "solid=True"),
    ("a.msh", (("fragments", True),)): (None, "fragments=True"),
    ("a.STEP", ()): (None, "a.STEP"),
    ("a.stl", (("solid", True),)): (None, "a.stl"),
    ("a.vtu", (("size", 1.0),)): (None, "apply"),
    ("a.vtu", (("refine", (((0, 0, 0), 1.0),)),)): (None, "refine="),
    ("a.igs", (("size", 1.0), ("unit", UnitSystem(1.0)))): (None, "states"),
    ("a.geo", (("merge", 1e-3),)): (None, "applies"),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_options_that_do_not_fit_a_file(tmp_path, case):
    name, options = case
    with refused(*OPTIONS[case], MeshError):
        read(tmp_path / name, **dict(options))
