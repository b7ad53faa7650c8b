"""Decks with every kind of card: the same in other units, and damaged, told in one sentence.

In `every.inp` and `every.bdf` numbers are in SI units, in brackets with their kind: <length 0.5>.
"""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from abaqus_decks import alike
from antiosc.base.errors import AntioscError
from antiosc.io.deck import Deck
from antiosc.io.neutral import UnitSystem
from antiosc_decks import abaqus_assembly, abaqus_model, nastran_mesh as nastran, nastran_model
from antiosc_decks.sources import Sources

#: Quantity -> powers of length, force and mass, where mass is force / length.
QUANTITIES = {
    "length": (1, 0), "area": (2, 0), "second": (4, 0), "stress": (-2, 1), "mass": (-1, 1),
    "density": (-4, 1), "per_length": (-2, 1), "per_area": (-3, 1), "spring": (-1, 1),
    "torsion": (1, 1), "inertia": (1, 1), "moment": (0, 1), "force": (0, 1),
}  # fmt: skip
DECKS = {name: Path(__file__).with_name(name).read_text() for name in ("every.inp", "every.bdf")}
READERS = {"every.inp": (abaqus_assembly, abaqus_model), "every.bdf": (nastran, nastran_model)}


def deck_in(name: str, unit: str) -> tuple[str, UnitSystem]:
    """The deck with numbers in one system of units."""
    units = UnitSystem.of(unit)

    def number(match: re.Match[str]) -> str:
        of_length, of_force = QUANTITIES[match[1]]
        return repr(float(match[2]) / (units.length**of_length * units.force**of_force))

    return re.sub(r"<(\w+) ([^>]+)>", number, DECKS[name]), units


def read(path: Path, text: str, units: UnitSystem) -> tuple[dict[str, Any], Deck]:
    path.write_text(text, encoding="latin-1")
    reader, model = READERS[path.name]
    found = reader.read(Sources(path, path.name))
    return model.model_of(found, units, None), found.deck


@pytest.mark.parametrize("unit", ["mm", "in"])
@pytest.mark.parametrize("name", DECKS)
def test_a_deck_is_the_same_in_other_units(tmp_path, name, unit):
    models, decks = [], []
    for one in ("m", unit):
        text, units = deck_in(name, one)
        model, deck = read(tmp_path / name, text, units)
        decks.append(deck.points * units.length)
        model["families"] = [family[1:] for family in model["families"]]
        models.append(model)
    check(models, decks)


def damaged(text: str, rng: random.Random) -> str:
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


def refusal(path: Path, text: str, units: UnitSystem) -> str:
    try:
        read(path, text, units)
    except AntioscError as error:
        return str(error)
    return ""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("seed", "count"), [(0, 20), *(pytest.param(k, 100, marks=pytest.mark.slow) for k in (7, 14))]
)
@pytest.mark.parametrize("name", DECKS)
def test_damaged_decks_are_read_or_refused_in_one_sentence(tmp_path, name, seed, count):
    rng, (whole, units), told = random.Random(seed), deck_in(name, "m"), 0
    for _ in range(count):
        sentence = refusal(tmp_path / name, damaged(whole, rng), units)
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
    alike(models[1], models[0], rel=1e-7)


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
