"""Decks as editors, mails, other systems and mistakes leave them: the right model, or a sentence.

Every card is read, harmless, refused, or ignored and told.
"""

from __future__ import annotations

import random
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import abaqus_decks as inp
import antiosc as ao
import nastran_decks as bdf
from antiosc.base.errors import AntioscError
from antiosc.io.conversion import Deck
from antiosc.io.neutral import UnitSystem
from antiosc_decks import (
    abaqus_assembly,
    abaqus_assembly as abaqus,
    abaqus_model,
    nastran_mesh as nastran,
    nastran_model,
)
from antiosc_decks.builder import MaterialDefaults
from antiosc_decks.sources import Sources
from paths import DECKS
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
    found = reader.read_deck(Sources(path, path.name))
    return model_of(found, UnitSystem.of("mm"), MaterialDefaults()), found.deck


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
    assert model["ignored"] == deck.remarks == []


BEAM = "*BEAM SECTION,ELSET=ALL,MATERIAL=M,SECTION="


MAT = "MAT1,1,1.+9,,.3,1.-9\n"
BRICK = bdf.UNIT_GRIDS + "CHEXA,1,1,1,2,3,4,5,6,\n,7,8\nPSOLID,1,1\n" + MAT
CBAR = bdf.UNIT_GRIDS + "CBAR,1,1,1,2,0.,0.,1.\n" + MAT

NASTRAN = {
    "no grids": ("BEGIN BULK\nMAT1,1,1.\nENDDATA\n", None, "nodes"),
    "no bulk": ("BEGIN BULK\nENDDATA\n", None, "contains"),
    "no shear": (CBAR.replace(",,.3", ",0.,.3") + "PBARL,1,1,,ROD\n,.1\n", 10, "G above 0"),
    "a default": ("GRDSET,,YES\n" + BRICK, 1, "not an integer"),
    "pins": (CBAR.replace("0.,0.,1.", "0.,0.,1.,,\n,17") + "PBARL,1,1,,ROD\n,.1\n", None, "from 1"),
    "a copy of nothing": ("BEGIN BULK\n=,*1\n", None, "before"),
    "mixed moment": (CBAR + "PBAR,1,1,1.,1.,1.,1.,,,\n,,,,,,,,,\n,,,1.5\n", None, "below"),
    "no width": (CBAR + "PBARL,1,1,,BAR\n,0.,1.\n", None, "dimensions"),
    "a type": (CBAR + "PBARL,1,1,,X\n,1.,1.,.1,.1\n", None, "type"),
    "does not fit": (CBAR + "PBARL,1,1,,I\n,1.,1.,1.,1.,.6,.6\n", None, "other"),
    "off the shear centre": (
        CBAR.replace("CBAR", "CBEAM") + "PBEAML,1,1,,T\n,1.,1.,.1,.1\n", None, "neutral"),
    "one constant": (BRICK.replace("1.+9,,.3", ",,.3"), None, "MAT1"),
    "no orientation": (CBAR.replace(",0.,0.,1.", "") + "PBARL,1,1,,ROD\n,.1\n", None, "missing"),
    "element's system": (
        CBAR.replace("2,0.,0.,1.\n", "2,0.,0.,1.,GOO\n,,,0.,0.,.1\n") + "PBARL,1,1,,ROD\n,.1\n",
        None, "offsets"),
    "no length": (
        CBAR.replace("2,0.,0.,1.\n", "2,0.,0.,1.,,\n,,,1.,0.,0.\n") + "PBARL,1,1,,ROD\n,.1\n",
        None, "length"),
}  # fmt: skip


@pytest.mark.parametrize("case", NASTRAN)
def test_nastran(tmp_path, case):
    text, line, word = NASTRAN[case]
    with refused(line, word, ao.MeshError):
        bdf.read(tmp_path, text)


TUBE, BEAM = "CTUBE,1,7,1,2\n", "CBEAM,1,7,1,2,0.,1.,0.\n"
PLATE = "CQUAD4,1,7,1,2,3,4\n"
WITH_LINES = {
    **{f"{card} {prop}": (f"{card}{bdf.MAT1}{prop},7,1\nPARAM,7\nPELAS,7,1.\n", 9, f"as {instead}")
       for card, prop, instead in (
           (bdf.HEXA, "PLSOLID", "PSOLID"), ("CROD,1,7,1,2\n", "PTUBE2", "PROD"),
           (TUBE, "PWELD", "PTUBE"), (PLATE, "PLPLANE", "PSHELL or PCOMP"),
           ("CBAR,1,7,1,2,0.,1.,0.\n", "PBCOMP", "PBAR"))},
    "taper": (f"{TUBE}PTUBE,7,1,4.,.5,,3.\n", 10, "tapered"),
    "material": (f"{bdf.HEXA}PSOLID,7,3\n", 11, "there is no MAT1"),
    "solid of plies": (f"{bdf.HEXA}PSOLID,7,3\nMAT8,3,9.,8.,.1,3.,,,1.\n", 12, "nine constants"),
    "shell of a solid": (f"{PLATE}PSHELL,7,3,.1,3,2.,3\nMAT9,3,1.\n,,,,,,,,\n,,,,,,,1.-9\n",
                         11, "elasticity"),
    "indefinite": (f"{PLATE}PSHELL,7,3,.1,3,2.,3\nMAT2,3,1.,2.,,1.,,1.,1.-9\n", 11, "definite"),
    "spoint": (f"SPOINT,100,THRU,10000102\n{bdf.HEXA}", 9, "SPOINT from 100"),
    "mass of nothing": (f"{bdf.HEXA}PSOLID,7,1\nCMASS2,9,1.\n", 12, "no node"),
    "place of a station": (f"{BEAM}PBEAM,7,1,6.,5.,3.,,4.,,\n,NO,1.5,3.,2.\n", 10, "X/XB"),
    "place of a profile": (f"{BEAM}PBEAML,7,1,,ROD\n,.2,,NO,1.5,.1\n", 10, "X/XB"),
    "no end": (f"{BEAM}PBEAML,7,1,,ROD\n,.2,,NO,.5,.1\n", 10, "no section at X/XB = 1"),
    **{f"a bush along {k}": (
        f"{bdf.HEXA}PSOLID,7,1\nCBUSH,9,9,1,2\nPBUSH,9,K{k * ','}1.\n", 12, "CID")
       for k in (2, 3, 5, 6)},
    "contact": (f"{bdf.HEXA}BCONTACT,1\n", 11, "contact"),
    "element": (f"{bdf.HEXA}CFAST,9,9,1,2\n", 11, "CFAST"),
}  # fmt: skip


@pytest.mark.parametrize("case", WITH_LINES)
def test_nastran_by_its_line(tmp_path, case):
    text, line, word = WITH_LINES[case]
    with refused(line, word, ao.MeshError):
        bdf.read(tmp_path, bdf.GRIDS + text + bdf.MAT1)


READERS = {".inp": abaqus_assembly, ".bdf": nastran}
#: Decks that others include, with nodes or materials alone.
INCLUDED = ("include_grids.bdf", "include_material.inp", "include_nodes.inp")
FILES = sorted(p.name for p in DECKS.iterdir() if p.suffix in READERS and p.name not in INCLUDED)


def written(name: str) -> Counter[str]:
    """The cards of a deck and of what it includes, by the first letters of their lines."""
    found: Counter[str] = Counter()
    started = "BEGIN BULK" not in (DECKS / name).read_text().upper()
    for line in (DECKS / name).read_text().upper().splitlines():
        include = re.match(r"\*?INCLUDE[ ,]*(?:INPUT=)?'?([^']+)", line)
        if include:
            found += written(include[1].strip().lower())
        elif name.endswith(".inp"):
            card = re.match(r"\*([^*,][^,]*)", line)
            found[" ".join(card[1].split()) if card else ""] += 1
        elif started:
            card = re.match(r"([A-Z]\w*)", line)
            found[card[1] if card else ""] += 1
        started = started or line.startswith("BEGIN BULK")
    return found - Counter({"": found[""], "ENDDATA": 1})


@pytest.mark.parametrize("name", FILES)
def test_as_many_cards_come_out_as_go_in(name):
    path = DECKS / name
    account = READERS[path.suffix].read_deck(Sources(path, name)).account
    assert Counter(card.lstrip("*") for card, _, _ in account.cards) == written(name)
    counts = Counter(fate.kind for _, _, fate in account.cards)
    assert set(counts) <= {"read", "harmless", "ignored"}
    assert counts.total() == written(name).total()


#: Quantity -> powers of length, force and mass, where mass is force / length.
QUANTITIES = {
    "length": (1, 0), "area": (2, 0), "second": (4, 0), "stress": (-2, 1), "mass": (-1, 1),
    "density": (-4, 1), "per_length": (-2, 1), "per_area": (-3, 1), "spring": (-1, 1),
    "torsion": (1, 1), "inertia": (1, 1), "moment": (0, 1), "force": (0, 1),
}  # fmt: skip
EVERY = {name: Path(__file__).with_name(name).read_text() for name in ("every.inp", "every.bdf")}
PAIRS = {"every.inp": (abaqus_assembly, abaqus_model), "every.bdf": (nastran, nastran_model)}


def deck_in(name: str, unit: str) -> tuple[str, UnitSystem]:
    """The deck with numbers in one system of units."""
    units = UnitSystem.of(unit)

    def number(match: re.Match[str]) -> str:
        of_length, of_force = QUANTITIES[match[1]]
        return repr(float(match[2]) / (units.length**of_length * units.force**of_force))

    return re.sub(r"<(\w+) ([^>]+)>", number, EVERY[name]), units


def read_in(path: Path, text: str, units: UnitSystem) -> tuple[dict[str, Any], Deck]:
    path.write_text(text, encoding="latin-1")
    reader, model = PAIRS[path.name]
    found = reader.read_deck(Sources(path, path.name))
    return model.model_of(found, units, MaterialDefaults()), found.deck


@pytest.mark.parametrize("unit", ["mm", "in"])
@pytest.mark.parametrize("name", EVERY)
def test_a_deck_is_the_same_in_other_units(tmp_path, name, unit):
    models, decks = [], []
    for one in ("m", unit):
        text, units = deck_in(name, one)
        model, deck = read_in(tmp_path / name, text, units)
        decks.append(deck.points * units.length)
        model["families"] = [family[1:] for family in model["families"]]
        models.append(model)
    check(models, decks)


def spoilt(text: str, rng: random.Random) -> str:
    """A cut deck, one with other or huge words, with lines twice, or without some."""
    kind = rng.randrange(6)
    lines = text.splitlines()
    at = rng.randrange(4, len(lines))
    if kind == 0:
        return text[: rng.randrange(len(text))]
    if kind == 1:
        del lines[at]
    elif kind == 2:
        lines.insert(at, lines[rng.randrange(4, len(lines))])
    else:
        words = [m.span() for m in re.finditer(r"[^,\s]+", lines[at])]
        a, b = rng.choice(words or [(0, len(lines[at]))])
        nasty = ("", "0", "-1", "1.+308", "1.-308", "99999999999999999999", "THRU", "1.5", "nan",
                 "inf", "7", "12", "=", "*5", "$", "é", "1_0", "-3.")  # fmt: skip
        lines[at] = lines[at][:a] + rng.choice(nasty) + lines[at][b:]
    return "\n".join(lines) + "\n"


def sentence_of(path: Path, text: str, units: UnitSystem) -> str:
    try:
        read_in(path, text, units)
    except AntioscError as error:
        return str(error)
    return ""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("seed", "count"), [(0, 20), *(pytest.param(k, 100, marks=pytest.mark.slow) for k in (7, 14))]
)
@pytest.mark.parametrize("name", EVERY)
def test_damaged_decks_are_read_or_refused_in_one_sentence(tmp_path, name, seed, count):
    rng, (whole, units), told = random.Random(seed), deck_in(name, "m"), 0
    for _ in range(count):
        sentence = sentence_of(tmp_path / name, spoilt(whole, rng), units)
        assert "\n" not in sentence
        told += bool(sentence)
    assert told > count / 4


def check(models: list, decks: list) -> None:
    np.testing.assert_allclose(decks[1], decks[0], rtol=1e-9, atol=1e-12)
    joints = [model["joints"] for model in models]
    for key, scaled in SCALED.items():
        found = [[numbers(scaled(one)) for one in some.pop(key)] for some in joints]
        assert len(found[0]) == len(found[1]) > 0
        for one, other in zip(*found, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-12)
    inp.alike(models[1], models[0], rel=1e-7)


def sum_of_one(terms: list) -> tuple[list, float]:
    """A sum of motions whose first large coefficient is 1, and that coefficient."""
    most = max(abs(c) for _, _, c in terms)
    largest = next(c for _, _, c in terms if abs(c) > 0.9 * most)
    return [[node, motion, c / largest] for node, motion, c in terms], largest


def spring(one: list) -> tuple:
    terms, factor = sum_of_one(one[0])
    return terms, one[1] * factor**2


def mass(one: list) -> tuple:
    rows, factors = zip(*map(sum_of_one, one[0]), strict=True)
    return rows, (np.array(one[1]) * np.outer(factors, factors)).tolist(), one[2]


#: What is joined, so that the units in which the reader keeps it do not count.
SCALED = {
    "springs": spring, "dampers": spring, "masses": mass,
    "equations": lambda terms: sum_of_one(terms)[0],
}  # fmt: skip


def numbers(value) -> list[float]:
    """All numbers of nested lists, in order."""
    if isinstance(value, list | tuple):
        return [number for one in value for number in numbers(one)]
    return [float(value)]
