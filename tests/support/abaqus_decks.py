"""Small Abaqus decks in mm, N and t, their models, and what these must be in SI units.

Stresses are 10⁶ Pa there, densities 10¹² kg/m³.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from antiosc.io.conversion import Deck
from antiosc.io.neutral import UnitSystem
from antiosc_decks import abaqus_assembly, abaqus_model
from antiosc_decks.builder import MaterialDefaults
from antiosc_decks.sources import Sources

NODES = """\
*NODE,NSET=N
1,0,0,0
2,20,0,0
3,20,10,0
4,0,10,0
5,0,0,10
6,20,0,10
7,20,10,10
8,0,10,10
9,40,0,8
10,40,10,8
"""
STEEL = "*MATERIAL,NAME=M\n*ELASTIC\n2E5,.3\n*DENSITY\n8.E-9\n"
SHEET = NODES + "*ELEMENT,TYPE=S4,ELSET=All\n1,1,2,3,4\n"
BENT = SHEET + "2,2,9,10,3\n"
CUBE = NODES + "*ELEMENT,TYPE=C3D8,ELSET=ALL\n1,1,2,3,4,5,6,7,8\n"
SOLID = "*SOLID SECTION,ELSET=ALL,MATERIAL=M\n"
BARS = NODES + "*ELEMENT,TYPE=B31,ELSET=ALL\n1,1,2\n2,4,3\n"
E, NU, RHO = 2e11, 0.3, 8e3


def read(
    folder: Path,
    text: str,
    density: float | None = None,
    parts: list[str] | None = None,
    modulus: float | None = None,
) -> tuple[dict[str, Any], Deck]:
    """(the model of a deck as the process that reads it returns it, its nodes and sets)."""
    path = folder / "part.inp"
    path.write_text(text)
    whole = abaqus_assembly.read_deck(Sources(path, path.name))
    whole.deck.wanted_parts = parts
    model = abaqus_model.model_of(whole, UnitSystem.of("mm"), MaterialDefaults(density, modulus))
    return json.loads(json.dumps(model)), whole.deck


def column(first: int = 1, at: float = 0.0, cells: int = 2, elset: str = "ALL") -> str:
    """Bricks of 1 × 1 × 1 along z: nodes by layers of four, elements from the same number."""
    text = "*NODE\n"
    for k in range(4 * (cells + 1)):
        x, y = [(0, 0), (1, 0), (1, 1), (0, 1)][k % 4]
        text += f"{first + k},{x},{y},{at + k // 4}\n"
    text += f"*ELEMENT, TYPE=C3D8, ELSET={elset}\n"
    for k in range(cells):
        text += ",".join(map(str, [first + k, *(first + 4 * k + n for n in range(8))])) + "\n"
    return text


def alike(found: Any, expected: Any, rel: float = 1e-9) -> None:
    """Equal texts, keys and lengths; numbers to `rel`, those below 1e-14 are zeros."""
    if isinstance(expected, dict):
        assert set(found) == set(expected)
        for key, value in expected.items():
            alike(found[key], value, rel)
    elif isinstance(expected, list | tuple):
        assert len(found) == len(expected)
        for one, value in zip(found, expected, strict=True):
            alike(one, value, rel)
    elif isinstance(expected, float):
        noise = 0.0 if abs(expected) > 1e-14 else 1e-14
        assert found == pytest.approx(expected, rel=rel, abs=noise)
    else:
        assert found == expected


def line(text: str, card: str) -> str:
    """The place of the first line that begins with the card."""
    number = next(k for k, row in enumerate(text.splitlines(), 1) if row.startswith(card))
    return f"line {number} of part.inp"


def plate_deck(n: int) -> str:
    """A plate of 1 m and 2 mm, of n × n quadrilaterals, held at its edges, with a load."""
    number = {(i, j): 1 + i + (n + 1) * j for j in range(n + 1) for i in range(n + 1)}
    nodes = [f"{k}, {i / n}, {j / n}, 0." for (i, j), k in number.items()]
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    cells = [[number[i + a, j + b] for a, b in corners] for j in range(n) for i in range(n)]
    elements = [", ".join(map(str, [k + 1, *cell])) for k, cell in enumerate(cells)]
    held = [str(k) for (i, j), k in number.items() if {i, j} & {0, n}]
    lines = ["*NODE", *nodes, "*ELEMENT, TYPE=S4, ELSET=all", *elements, "*NSET, NSET=rim", *held]
    lines += ["*MATERIAL, NAME=m", "*ELASTIC", "3e9, 0.3", "*DENSITY", "1200."]
    lines += ["*SHELL SECTION, ELSET=all, MATERIAL=m", "2e-3", "*BOUNDARY", "rim, 1, 6"]
    return "\n".join([*lines, "*STEP", "*STATIC", "*CLOAD", "1, 3, 1.", "*END STEP", ""])
