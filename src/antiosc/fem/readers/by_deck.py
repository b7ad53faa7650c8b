"""Decks of Abaqus, CalculiX and Nastran."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from antiosc.errors import MeshError
from antiosc.fem.readers.conversion import as_mesh
from antiosc.fem.readers.decks import (
    abaqus_assembly,
    abaqus_model,
    nastran as nastran_deck,
    nastran_model,
)
from antiosc.fem.readers.decks.deck import Deck, listed
from antiosc.fem.readers.neutral import FileMesh
from antiosc.fem.readers.request import Request
from antiosc.fem.readers.unit_system import UnitSystem


def abaqus(ask: Request) -> FileMesh:
    """An Abaqus or CalculiX deck (`.inp`)."""
    whole = abaqus_assembly.read(Path(ask.path), ask.name, _patience(ask))
    if ask.model is not None:
        units = UnitSystem(*ask.unit)
        whole.deck.wanted = ask.model.get("parts")
        whole.deck.model = abaqus_model.model_of(whole, units, ask.model.get("density"))
    return _mesh(whole.deck)


def nastran(ask: Request) -> FileMesh:
    """Nastran bulk data (`.bdf`, `.nas`, `.fem`)."""
    found = nastran_deck.read(Path(ask.path), ask.name, _patience(ask))
    if ask.model is not None:
        units = UnitSystem(*ask.unit)
        found.deck.wanted = ask.model.get("parts")
        found.deck.model = nastran_model.model_of(found, units, ask.model.get("density"))
    return _mesh(found.deck)


def _mesh(deck: Deck) -> FileMesh:
    if not deck.n_elements:
        found = f": it has {listed(deck.left)}" if deck.left else ""
        raise MeshError(f"{deck.name} has no elements that are cells of a mesh{found}.")
    return as_mesh(deck, halve_lines=bool(deck.model and deck.model["halve"]))


def _patience(ask: Request) -> Callable[[int], None]:
    """Extend the time limit by the size of the files that a deck includes."""
    return lambda size: ask.allow(30 + 3e-5 * size)
