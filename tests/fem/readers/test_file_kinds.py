"""Units, expected cells, kinds of files by their endings, and options that do not fit them."""

from __future__ import annotations

import numpy as np
import pytest

from antiosc.errors import InputError, MeshError
from antiosc.fem.readers import read
from antiosc.fem.readers.size_field import SizeField
from antiosc.fem.readers.table import is_bulk, is_deck, library_of
from antiosc.fem.readers.unit_system import UnitSystem
from refusals import refused


@pytest.mark.parametrize(
    ("unit", "length", "force"),
    [
        *(("m", 1, 1), ("mm", 1e-3, 1), ("cm", 1e-2, 1), (2.5, 2.5, 1)),
        ("in", 0.0254, 0.45359237 * 9.80665),
    ],
)
def test_units_follow_from_length_force_and_second(unit, length, force):
    found = UnitSystem.of(unit)
    mass = force / length  # of force = mass × length / s²
    expected = (length, force, mass, force / length**2, mass / length**3)
    own = (found.length, found.force, found.mass, found.stress, found.density)
    assert own == pytest.approx(expected, rel=1e-12)


def test_units_that_do_not_exist():
    for wrong, message in (("km", "unit must be one of 'm', 'mm', 'cm', 'in', or a number: metres"),
                           (-1.0, "unit must be > 0")):  # fmt: skip
        with pytest.raises(InputError, match=message):
            UnitSystem.of(wrong)


def test_expected_cells_are_regular_simplices_of_the_mean_size():
    """√3/4 h² and √2/12 h³, times the factors by which gmsh's meshes are finer or coarser."""
    square = SizeField([[0, 0, 0], [2, 0, 0], [2, 3, 1], [0, 3, 1]], [[0, 1, 2], [0, 2, 3]],
                       [0.1, 0.2, 0.3, 0.5])  # fmt: skip
    area = np.sqrt(10)  # of each half, 2 by √(3² + 1)
    count = sum(area / (np.sqrt(3) / 4 * h**2) for h in (0.2, 0.3))
    assert square.expected() == pytest.approx(1.35 * count)
    tetra = SizeField([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]], [[0, 1, 2, 3]], [0.5] * 4)
    assert tetra.expected() == pytest.approx(0.95 * 4 / (np.sqrt(2) / 12 * 0.5**3))


def test_decks_that_share_their_endings_with_others(tmp_path):
    texts = {"a.dat": b"$ c\n begin  bulk\n", "b.dat": b"GRID,1\n", "c.pch": b"cend\n"}
    texts |= {"d.asm": b"x\nGRID*   1\n", "e.dat": b"GRIDS\n", "f.dat": b"TITLE\n"}
    texts |= {"g.txt": b"GRID 1\n"}
    found = {}
    for name, content in texts.items():
        (tmp_path / name).write_bytes(content)
        found[name] = is_bulk(tmp_path / name)
        assert is_deck(tmp_path / name) == found[name]
        assert library_of(tmp_path / name) == ("numpy" if found[name] else "meshio")
    assert [name for name, deck in found.items() if deck] == ["a.dat", "b.dat", "c.pch", "d.asm"]
    assert not is_bulk(tmp_path / "none.dat")
    for name in ("a.inp", "a.BDF", "a.nas", "a.fem"):
        assert is_deck(name)
        assert library_of(name) == "numpy"
    assert not is_deck("a.unv")
    for suffix, library in {"unv": "numpy", "msh": "gmsh", "step": "gmsh", "vtu": "meshio"}.items():
        name = f"a.{suffix}"
        assert library_of(name) == library
    assert library_of("a.stl", solid=True) == "gmsh"


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
