"""Decks of Abaqus, CalculiX and Nastran as antiosc's neutral model: its entry points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from antiosc.base.errors import MeshError
from antiosc.io.conversion import counts_text
from antiosc.io.isolation import FileReader, Request
from antiosc.io.neutral import FileMesh, Model, UnitSystem
from antiosc_decks import abaqus_assembly, abaqus_model, nastran_mesh, nastran_model
from antiosc_decks.builder import MaterialDefaults
from antiosc_decks.cells import file_mesh_of
from antiosc_decks.sources import BULK_DATA_START as _BULK, Sources

F = TypeVar("F", abaqus_assembly.AbaqusDeck, nastran_mesh.NastranDeck)


def _reader(
    read: Callable[[Sources], F], model_of: Callable[[F, UnitSystem, MaterialDefaults], Model]
) -> Callable[[Request], FileMesh]:
    """A file reader from the functions that read a dialect's mesh and its model."""

    def reader(ask: Request) -> FileMesh:
        def allow(size: int) -> None:  # the time limit grows with the files that a deck includes
            ask.limit_time(30 + 3e-5 * size)

        options = ask.model or {}
        deck_and_model = read(Sources(Path(ask.path), ask.name, allow, options.get("root")))
        deck = deck_and_model.deck
        if ask.model is not None:
            deck.wanted_parts = options.get("parts")
            deck.piece = options.get("piece")
            deck.without_supports = options.get("free", False)
            deck.without_contact = deck.piece is not None or options.get("contact") == "apart"
            unstated = MaterialDefaults(*options["unstated"])
            deck.model = model_of(deck_and_model, UnitSystem(*ask.unit), unstated)

        if not deck.n_elements:
            beside = f": it has {counts_text(deck.skipped)}" if deck.skipped else ""
            none = f"{deck.name} has no elements of solids, shells, beams or rods{beside}"
            raise MeshError(f"{none}; read the deck that holds the part itself.")

        return file_mesh_of(deck)

    return reader


ABAQUS = FileReader(_reader(abaqus_assembly.read_deck, abaqus_model.model_of), model=True)
NASTRAN = FileReader(_reader(nastran_mesh.read_deck, nastran_model.model_of), model=True)
#: Files of Nastran with endings that other programs use too.
BULK = NASTRAN._replace(matches=lambda start: _BULK.search(start.decode("latin-1")) is not None)
