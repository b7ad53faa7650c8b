"""Small Nastran decks in mm, N and t, and their models in SI units.

Stresses are 10⁶ Pa there, densities 10¹² kg/m³.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from antiosc.io.conversion import Deck
from antiosc.io.neutral import UnitSystem
from antiosc_decks import nastran_mesh as nastran, nastran_model
from antiosc_decks.builder import MaterialDefaults
from antiosc_decks.sources import Sources

CORNERS = [(x, y, z) for z in (0, 10) for x, y in ((0, 0), (20, 0), (20, 10), (0, 10))]
GRIDS = "".join(f"GRID,{k},,{x}.,{y}.,{z}.\n" for k, (x, y, z) in enumerate(CORNERS, 1))
#: The same of 1 × 1 × 1.
UNIT_GRIDS = GRIDS.replace("20.", "1.").replace("10.", "1.")
MAT1 = "MAT1,1,2.+5,,.3,8.-9\n"
HEXA = "CHEXA,1,7,1,2,3,4,5,6,\n,7,8\n"
E, NU, RHO = 2e11, 0.3, 8e3
#: Its axes are y, z and x of the deck.
CYCLIC = "CORD2R,5,,0.,0.,0.,1.,0.,0.,\n,0.,1.,0.\n"


def read(
    folder: Path, text: str, density: float | None = None, unit: str = "mm"
) -> tuple[dict[str, Any], Deck]:
    """(the model of a deck as the process that reads it returns it, its nodes and sets)."""
    path = folder / "part.bdf"
    path.write_text(text)
    found = nastran.read_deck(Sources(path, path.name))
    model = nastran_model.model_of(found, UnitSystem.of(unit), MaterialDefaults(density))
    return json.loads(json.dumps(model)), found.deck


def line(text: str, card: str) -> str:
    """The place of the first line that begins with the card."""
    number = next(k for k, row in enumerate(text.splitlines(), 1) if row.startswith(card))
    return f"line {number} of part.bdf"


def groups(model: dict[str, Any]) -> list[Any]:
    """The families of a model, by the names of their properties."""
    return [[name.partition(" (")[0], *rest] for name, *rest in model["families"]]
