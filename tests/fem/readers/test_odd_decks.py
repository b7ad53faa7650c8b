"""Decks as editors, mails, other systems and mistakes leave them: the right model, or a sentence.

`SAME` are the deck of a cube written otherwise; `REFUSED` name the line at fault.
"""

from __future__ import annotations

import numpy as np
import pytest

import abaqus_decks as inp
import antiosc as ao
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc.io.neutral import UnitSystem
from antiosc_decks import (
    abaqus_assembly as abaqus,
    abaqus_model,
    nastran_mesh as nastran,
    nastran_model,
)
from antiosc_decks.sources import Sources
from refusals import refused

FACE = "*NSET,NSET=FIX\n1,2,3,4\n"
CUBE = inp.CUBE + inp.SOLID + inp.STEEL + FACE + "*BOUNDARY\nFIX,1,3\n"
BLOCK = bdf.GRIDS + bdf.HEXA + "PSOLID,7,1\n" + bdf.MAT1 + "SPC1,1,123,1,THRU,4\n"
#: Files that others include.
BESIDE = {
    "sub/a.inp": "*include,input = b.inp\n",
    "sub/b.inp": inp.CUBE,
    "sub/loop.inp": "*INCLUDE,INPUT=loop.inp\n",
    "sub/a.bdf": f"INCLUDE 'b.bdf'\n{bdf.HEXA}",
    "sub/b.bdf": bdf.GRIDS,
    "sub/loop.bdf": "INCLUDE 'loop.bdf'\n",
}


def read(folder, name: str, text: str | bytes):
    """(the model of a deck, its nodes and sets, what is told)."""
    for file, content in BESIDE.items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_text(content)
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    reader, model_of = (
        (abaqus, abaqus_model.model_of)
        if name.endswith("inp")
        else (nastran, nastran_model.model_of)
    )
    found = reader.read(Sources(path, path.name))
    return model_of(found, UnitSystem.of("mm"), None), found.deck


def otherwise(text: str, *changes: tuple[str, str]) -> str:
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


MANY = "".join(f"{1 + k % 4}\n" for k in range(200_000))
SAME = {
    "crlf.inp": CUBE.replace("\n", "\r\n"),
    "cr.inp": CUBE.replace("\n", "\r"),
    "lower.inp": CUBE.lower(),
    "tabs.inp": CUBE.replace(",", "\t,\t").replace("*", "\t*"),
    "blanks.inp": otherwise(CUBE, ("*SOLID SECTION", "* Solid  Section "), ("ELSET=", " ELSET = ")),
    "dos.inp": CUBE + "\x1a",
    "bom.inp": b"\xef\xbb\xbf" + CUBE.encode(),
    "latin.inp": otherwise(CUBE, ("NAME=M", "NAME=Stähl"), ("MATERIAL=M", "MATERIAL=STÄHL")),
    "utf.inp": otherwise(CUBE, ("NAME=M", "NAME=Stähl"), ("MATERIAL=M", "MATERIAL=STÄHL")).encode(),
    "continued.inp": otherwise(
        CUBE, ("C3D8,ELSET", "C3D8,\n ELSET"), ("1,1,2,3,4,5,6,7,8", "1,1,2,3,4,\n5,6,7,8")
    ),
    "fortran.inp": otherwise(CUBE, ("2E5", "2.D+5"), ("8.E-9", "8.d-9")),
    "generate.inp": otherwise(CUBE, ("FIX\n1,2,3,4", "FIX,GENERATE\n1,4,1")),
    "pairs.inp": otherwise(CUBE, ("FIX\n1,2,3,4", "A\n1,2\n*NSET,NSET=FIX\nA,3,4\n3")),
    "many.inp": otherwise(CUBE, ("FIX\n1,2,3,4\n", "FIX\n" + MANY)),
    "huge.inp": otherwise(
        CUBE, ("\n1,0,0,0", "\n2147483647,0,0,0"), ("1,1,2,3", "7,2147483647,2,3"),
        ("FIX\n1", "FIX\n2147483647")),
    "twice.inp": CUBE + "*NODE\n1,0.,0.,0.\n",
    "temperatures.inp": CUBE + "*EQUATION\n2\n5,11,1.,6,11,-1.\n",
    "nested.inp": otherwise(CUBE, (inp.CUBE, '*INCLUDE, INPUT="sub/a.inp"\n')),
    "crlf.bdf": BLOCK.replace("\n", "\r\n"),
    "lower.bdf": BLOCK.lower(),
    "bom.bdf": b"\xef\xbb\xbf" + BLOCK.encode(),
    "large.bdf": otherwise(BLOCK, ("GRID,1,,0.,0.,0.", "GRID*,1,,0.,0.\n*,0.")),
    "fixed.bdf": otherwise(BLOCK, (bdf.HEXA, "CHEXA   1       7       1       2       3       4"
                                   "       5       6       +A\n+A      7       8\n")),
    "far.bdf": otherwise(BLOCK, (bdf.HEXA, "CHEXA   1       7       1       2       3       4"
                                 "       5       6       +A\n")) + "+A      7       8\n",
    "tabs.bdf": otherwise(BLOCK, ("GRID,1,,0.,0.,0.", "GRID\t1\t\t0.\t0.\t0.")),
    "exponents.bdf": otherwise(BLOCK, ("2.+5", "2.0D+5"), ("8.-9", "8.0E-9$ t/mm3, steel")),
    "huge.bdf": otherwise(BLOCK, ("GRID,1,", "GRID,99999999,"), ("1,7,1", "1,7,99999999"),
                          ("123,1,THRU,4", "123,99999999,2,THRU,4")),
    "nested.bdf": otherwise(BLOCK, (bdf.GRIDS + bdf.HEXA, "INCLUDE 'sub/\na.bdf'\n")),
    "after.bdf": f"SOL 103\nCEND\nSPC = 1\nBEGIN BULK\n{BLOCK}ENDDATA,\nGRID,1,,9.,9.,9.\n",
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_the_same_deck_otherwise(tmp_path, name):
    model, deck = read(tmp_path, name, SAME[name])
    plain = "plain" + name[-4:]
    expected, whole = read(tmp_path, plain, CUBE if name.endswith("inp") else BLOCK)
    order = np.argsort(deck.points @ [1.0, 1e3, 1e6])
    sorted_as = np.argsort(whole.points @ [1.0, 1e3, 1e6])
    np.testing.assert_array_equal(deck.points[order], whole.points[sorted_as])
    for key in set(expected) - {"families"}:
        inp.alike(model[key], expected[key])
    assert model["ignored"] == deck.told == []


PART = (f"*PART,NAME=P\n{inp.CUBE}{inp.SOLID}*END PART\n*ASSEMBLY,NAME=A\n*INSTANCE,NAME=I,PART=P\n"
        "*END INSTANCE\n*INSTANCE,NAME=J,PART=P\n{}\n*END INSTANCE\n*END ASSEMBLY\n")  # fmt: skip
REFUSED = {
    "wide.inp": (CUBE.encode("utf-16"), None, "zero bytes"),
    "outside.inp": (CUBE + "*INCLUDE,INPUT=/etc/passwd\n", 24, "root="),
    "number.inp": (otherwise(CUBE, ("8,0,10,10", "8,0,nan,10")), 9, "nan"),
    "instance.inp": (PART.format("1.,0.,0.").replace("=J", "=I"), 20, "twice"),
    "loop.bdf": (BLOCK + "INCLUDE 'sub/loop.bdf'\n", 1, "itself"),
    "systems.bdf": (otherwise(BLOCK, ("GRID,1,", "GRID,1,5")) + "CORD2R,5,6,0.,0.,0.,0.,0.,1.\n"
                    ",1.,0.,0.\nCORD2R,6,5,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", None, "itself"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_sentence_with_the_line_at_fault(tmp_path, name):
    text, line, word = REFUSED[name]
    with refused(line, word, MeshError):
        read(tmp_path, name, text)


def test_surfaces_as_cgx_of_debian_writes_them(tmp_path):
    """Without the keyword line; the comment says the name, before which decks put an S."""
    node = (
        "*NODE\n99,10,5,20\n*COUPLING,SURFACE=Stop,REFNODE=99,CONSTRAINT NAME=C\n*KINEMATIC\n1,3\n"
    )
    tops = "*SURFACE,NAME=Stop\n1,S2\n", "** Surfaces based on top\n1, S2\n\n** end\n"
    with_card, as_cgx = (read(tmp_path, "a.inp", CUBE + top + node)[0] for top in tops)
    inp.alike(as_cgx["joints"], with_card["joints"])
    assert as_cgx["joints"] != read(tmp_path, "b.inp", CUBE)[0]["joints"]


@pytest.mark.fem
def test_six_equal_bars_have_each_frequency_six_times(tmp_path):
    """A Krylov space finds each frequency once: what SLEPc breaks off, LAPACK finds."""
    star = "GRID,9,,0.,0.,0.\nSPC1,1,123456,9\nPBAR,7,1,.4,4.,5.,1.5\nMAT1,1,1.+7,,.33,.1\n"
    for k in range(6):
        x, y = np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)
        star += f"GRID,{k},,{10 * x:.6f},{10 * y:.6f},0.\nCBAR,{k + 11},7,9,{k},0.,0.,1.\n"
    (tmp_path / "star.bdf").write_text(star.replace("GRID,0,", "GRID,7,").replace("9,0,", "9,7,"))
    every = ao.natural_modes(ao.read_model(tmp_path / "star.bdf"), 12).frequency
    np.testing.assert_allclose(every.reshape(2, 6).std(axis=1), 0.0, atol=1e-6 * every[0])
