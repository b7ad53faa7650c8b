"""The page of a part in several pieces: each of them is opened by the list, and all joined."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from antiosc.base.errors import InputError
from antiosc_app.cli import main
from antiosc_app.opened import JOINED_TEXT, PIECE_CHANGED_TEXT, OpenPart

pytestmark = [pytest.mark.fem, pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning")]
#: Sides [mm] of two boxes, and the distance between them.
LARGE, SMALL, APART = (40.0, 12.0, 10.0), (12.0, 4.0, 3.0), 5.0


def corners(sides, start):
    return np.array([[start + x * sides[0], y * sides[1], z * sides[2]]
                     for x in (0, 1) for y in (0, 1) for z in (0, 1)])  # fmt: skip


def as_step(path, gap):
    """The small box first, since the file does not order them by size."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.model.occ.addBox(LARGE[0] + gap, 0, 0, *SMALL)
        gmsh.model.occ.addBox(0, 0, 0, *LARGE)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def as_deck(path, gap):
    """Hexahedra: two of the large box, one of the small one, with contact between them."""
    lines = ["*NODE"]
    half = (LARGE[0] / 2, *LARGE[1:])
    boxes = [(half, 0.0), (half, half[0]), (SMALL, LARGE[0] + gap)]
    nodes, cells = [], []
    for sides, start in boxes:
        x = corners(sides, start)[[0, 4, 6, 2, 1, 5, 7, 3]].tolist()
        cells.append([nodes.index(one) if one in nodes else nodes.append(one) or len(nodes) - 1
                      for one in x])  # fmt: skip
    lines += [f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(nodes, 1)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=ALL"]
    lines += [
        ", ".join(str(n) for n in (k, *(c + 1 for c in cell))) for k, cell in enumerate(cells, 1)
    ]
    lines += ["*ELSET, ELSET=SMALL", "3", "*MATERIAL, NAME=M", "*ELASTIC", "210e3, 0.3"]
    lines += ["*DENSITY", "7.85e-9", "*SOLID SECTION, ELSET=ALL, MATERIAL=M"]
    path.write_text("\n".join([*lines, "*CONTACT PAIR, INTERACTION=I", "A, B", ""]))


@pytest.fixture
def apart(tmp_path):
    as_deck(tmp_path / "two.inp", APART)
    one = OpenPart(tmp_path / "two.inp")
    yield one
    one.close()


def box_of(look):
    """Sides [mm] of what the page shows."""
    skin = look["skin"]
    return np.ptp(skin["points"].reshape(-1, 3).astype(float), axis=0) * skin["half"] / 32767 * 1e3


@pytest.mark.slow
def test_each_piece_is_opened_by_its_rank_with_its_own_scene(apart):
    first = apart.calls["look"]({})
    assert [rank for rank, _ in first["pieces"]] == [1, 2]
    for (_, text), sides in zip(first["pieces"], (LARGE, SMALL), strict=True):
        assert " × ".join(f"{side:g}" for side in sides) in text
    assert first["piece"] == 1
    assert box_of(first) == pytest.approx(LARGE, abs=0.01)
    apart.calls["take"]({"piece": 2})
    other = apart.calls["look"]({})
    assert (other["piece"], other["pieces"]) == (2, first["pieces"])
    assert box_of(other) == pytest.approx(SMALL, abs=0.01)
    told = apart.calls["edit"]({"set": {"simulate.duration": 2e-4, "extract.n": 5}})
    asked = {"turn": told["turn"]}
    assert apart.calls["settle"](asked)["blow"]["computed"]["peak_force"] > 0
    names = apart.calls["names"]({})["names"]
    apart.calls["write"]({**asked, "agreed": names})
    scene = tomllib.loads(apart._path.with_name(names[0]).read_text())
    assert scene.get("deck", scene.get("geometry"))["piece"] == 2
    with pytest.raises(InputError, match=PIECE_CHANGED_TEXT):  # a page with the piece before
        apart.calls["edit"]({"undo": True, "opening": first["opening"]})


@pytest.mark.slow
def test_pieces_that_are_joined_are_opened_alone_and_joined_again(tmp_path):
    as_step(tmp_path / "two.step", 0.0)
    one = OpenPart(tmp_path / "two.step")
    try:
        first = one.calls["look"]({})
        assert first["pieces"][0] == (0, JOINED_TEXT)
        sides = {}
        for piece in (2, 0):
            one.calls["take"]({"piece": piece})
            look = one.calls["look"]({})
            assert look["piece"] == piece
            sides[piece] = box_of(look)
    finally:
        one.close()
    assert sides[2] == pytest.approx(SMALL, abs=0.01)
    assert sides[0] == pytest.approx((LARGE[0] + SMALL[0], *LARGE[1:]), abs=0.01)


@pytest.mark.slow
def test_the_command_writes_a_scene_of_one_piece(tmp_path, capsys):
    as_deck(tmp_path / "two.inp", APART)
    scene = tmp_path / "two.toml"
    assert main(["new", str(scene), str(tmp_path / "two.inp"), "--piece", "2"]) == 0
    assert tomllib.loads(scene.read_text())["deck"]["piece"] == 2
    assert "12 × 4 × 3 mm" in capsys.readouterr().out
    assert main(["new", str(tmp_path / "b.toml"), str(tmp_path / "two.inp"), "--piece", "3"]) == 1
    assert "no piece 3" in capsys.readouterr().err
