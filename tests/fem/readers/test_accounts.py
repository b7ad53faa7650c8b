"""Every card of a deck is accounted for: read, harmless, ignored, refused, or told as unknown."""

from __future__ import annotations

import re
from collections import Counter

import pytest

import abaqus_decks as inp
import nastran_decks as bdf
from antiosc.base.errors import MeshError
from antiosc_decks import (
    abaqus_assembly,
    nastran_mesh as nastran,
)
from antiosc_decks.sources import Sources
from paths import DECKS

SECTION = inp.CUBE + inp.SOLID + inp.STEEL
BLOCK = bdf.GRIDS + bdf.HEXA + "PSOLID,7,1\n" + bdf.MAT1
READERS = {".inp": abaqus_assembly, ".bdf": nastran}
#: Decks that others include, with nodes or materials alone.
PARTS = ("include_grids.bdf", "include_material.inp", "include_nodes.inp")
FILES = sorted(p.name for p in DECKS.iterdir() if p.suffix in READERS and p.name not in PARTS)


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
            found[card[1].replace(" ", "") if card else ""] += 1
        elif started:
            card = re.match(r"([A-Z]\w*)", line)
            found[card[1] if card else ""] += 1
        started = started or line.startswith("BEGIN BULK")
    return found - Counter({"": found[""], "ENDDATA": 1})


@pytest.mark.sample
@pytest.mark.parametrize("name", FILES)
def test_as_many_cards_come_out_as_go_in(name):
    path = DECKS / name
    account = READERS[path.suffix].read(Sources(path, name)).account
    assert Counter(card.lstrip("*") for card, _, _ in account.cards) == written(name)
    counts = Counter(fate.kind for _, _, fate in account.cards)
    assert set(counts) <= {"read", "harmless", "ignored"}
    assert counts.total() == written(name).total()


@pytest.mark.parametrize(
    ("deck", "read", "card"), [(SECTION, inp.read, "*FOOBAR"), (BLOCK, bdf.read, "FOOBAR")]
)
def test_unknown_cards_are_told_with_their_lines(tmp_path, deck, read, card):
    """In one sentence; a mesh tells them, too."""
    first = deck.count("\n") + 1
    model, found = read(tmp_path, f"{deck}{card},1,2\n{card},3\n")
    (told,) = (sentence for sentence in found.told if card in sentence)
    assert f"2 {card} (lines {first}, {first + 1} of" in told
    assert not any(card in text for text in model["ignored"])


def test_cards_of_steps(tmp_path):
    """Later steps are ignored; a card of the model has no place in the first."""
    later = "*STEP\n*STATIC\n*END STEP\n*STEP\n*CONTACT PAIR,INTERACTION=I\nA,B\n*END STEP\n"
    model, _ = inp.read(tmp_path, SECTION + later)
    assert any("*CONTACTPAIR of later steps" in text for text in model["ignored"])
    with pytest.raises(MeshError, match="MATERIAL is in a step"):
        inp.read(tmp_path, SECTION + "*STEP\n*MATERIAL,NAME=N\n*END STEP\n")


def test_options_are_told_or_refused(tmp_path):
    _, deck = inp.read(tmp_path, SECTION.replace("*SOLID SECTION", "*SOLID SECTION,NOVEL=3"))
    assert any("SOLIDSECTION, NOVEL=" in text for text in deck.told)
    sheet = inp.SHEET + "*SHELL SECTION,ELSET=ALL,COMPOSITE{}\n1,,M,0\n" + inp.STEEL
    inp.read(tmp_path, sheet.format(""))
    for text in (
        sheet.format(",SYMMETRIC"), SECTION + "*EQUATION,REMOVE\n",
        SECTION + "*TIE,CYCLIC SYMMETRY\nA,B\n",
    ):  # fmt: skip
        with pytest.raises(MeshError, match="would change the result"):
            inp.read(tmp_path, text)


def test_damping_of_materials_is_told(tmp_path):
    model, _ = bdf.read(tmp_path, BLOCK.replace("8.-9", "8.-9,,,.02") + "PARAM,G,.04\n")
    assert [text.partition(" (")[0] for text in model["ignored"]] == [
        "1 GE of MAT1, damping", "1 PARAM,G, damping",
    ]  # fmt: skip
