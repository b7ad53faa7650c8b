"""How a part by others is read: its unit, its pieces, what its surface encloses, its densities.

Nothing of this stands in most files, so it is tried: the first way that gives a mesh, or a model
whose materials are real ones.
"""

from __future__ import annotations

import contextlib
import importlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

import antiosc
from antiosc.base.errors import (
    InputError,
    PiecesError,
    finite_element_packages,
    warnings_to,
    without_warnings,
)
from antiosc_app.scene_file.outline import GEOMETRIES
from antiosc_app.units import UNITS, unit_of

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.io.neutral import FileMesh
    from antiosc.io.reading import Piece

#: Arguments of `read_mesh` or `read_model` besides the file.
Read: TypeAlias = dict[str, Any]
#: A file without a unit whose longest side is this or more is taken as one in millimetres.
LONGEST_IN_METRES = 3.0
#: Elements along the longest side of a geometry that is meshed.
ELEMENTS = 20
#: A geometry of more cells is meshed by larger elements, so that it is struck in about a minute.
MOST_CELLS = 30_000
#: Distance [m] of nodes that are joined, where a mesh falls into pieces.
MERGE_DISTANCE = 1e-6
#: More solids than this are not cut at each other: the largest is taken.
MOST_SOLIDS = 40
#: The material of a new scene, of the part and of the ball.
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Endings of decks, which describe materials and supports themselves.
DECK_ENDINGS = {".inp", ".bdf", ".nas", ".fem", ".dat", ".cdb"}
#: Cards of decks that give elements a material.
MODEL_CARD = re.compile(
    rb"^\s*(\*(material|\w+ ?\w* section)\b|mat(1|2|8|9)\b[*,\s]|(mp|mpdata),)", re.I | re.M
)


@dataclass(frozen=True)
class ForeignPart:
    """A part, and how it was read.

    Attributes
    ----------
    read : arguments of `read_mesh`, or of `read_model`, besides the file.
    structure : of a deck with a model.
    notes : what was decided, one sentence each.
    pieces : of a part that falls apart, the largest first.
    """

    mesh: Mesh
    read: Read
    structure: Structure | None = None
    notes: list[str] = field(default_factory=list)
    pieces: Sequence[Piece] = ()


def foreign_part(path: Path, free: bool = False, unit: str | None = None) -> ForeignPart:
    """Read or mesh a part; `free`: a deck without its supports; `unit`: of the file, if known.

    Raises
    ------
    AntioscError
        In no way.
    """
    with finite_element_packages():
        importlib.import_module("antiosc.fem.mesh")
    if path.suffix.lower() in DECK_ENDINGS and MODEL_CARD.search(path.read_bytes()):
        return _of_deck(path, free, UNITS if unit is None else (unit,))
    with without_warnings():
        return _of_mesh(path, unit)


# --- Meshes and geometries ------------------------------------------------------------------------


def _of_mesh(path: Path, unit: str | None) -> ForeignPart:
    from antiosc.io.cad import STATES_UNIT
    from antiosc.io.facets import CLOSED, SURFACES
    from antiosc.io.neutral import UnitSystem
    from antiosc.io.reading import outline

    suffix = path.suffix.lower()
    read: Read = {} if unit is None else {"unit": unit}
    notes: list[str] = []
    ways: list[Read] = [{}]
    looked = None
    if suffix in GEOMETRIES or suffix in SURFACES:
        looked = outline(path)
        length = float(np.ptp(looked.points, axis=0).max())
        if unit is None and length >= LONGEST_IN_METRES and suffix not in STATES_UNIT:
            read["unit"] = "mm"
        length *= UnitSystem.of(read.get("unit", "m")).length
        size = float(f"{length / ELEMENTS:.1g}")
        if suffix in GEOMETRIES:
            read["size"] = size
            ways = _of_solids(looked, notes)
        elif CLOSED in looked.groups:
            notes.append("its surface is closed: it is filled as a solid (solid).")
            ways = [{"solid": True, "size": size}]
    else:
        ways += [{"cells": dim} for dim in (3, 2, 1)]
    mesh, way, pieces = _first(path, read, ways)
    read |= way
    if "size" in read and mesh.n_cells > MOST_CELLS:
        larger = float(f"{read['size'] * (mesh.n_cells / MOST_CELLS) ** (1 / mesh.tdim):.2g}")
        notes.append(f"elements of {read['size']:g} m would be {mesh.n_cells} cells: larger ones "
                     "are taken (size).")  # fmt: skip
        read["size"] = larger
        mesh = antiosc.read_mesh(str(path), **read)
    if mesh.tdim == 1 and mesh.order > 1:  # bars are straight
        read["order"] = 1
        mesh = antiosc.read_mesh(str(path), **read)
    if "size" not in read and "unit" not in read:
        length = float(np.ptp(mesh.dolfinx.geometry.x, axis=0).max())
        if length >= LONGEST_IN_METRES and suffix not in STATES_UNIT:
            read["unit"] = "mm"
            pieces = [one._replace(low=1e-3 * one.low, high=1e-3 * one.high) for one in pieces]
    if "piece" in way:
        notes += _described(pieces)
    if mesh.tdim < 3 and mesh.gdim == 2:  # a plate, struck on its face
        read["gdim"] = 3
    if {"unit", "gdim"} & set(read):
        mesh = antiosc.read_mesh(str(path), **read)
    if looked is not None and suffix in GEOMETRIES:
        pieces = _solids(looked)
    return ForeignPart(mesh, read, None, [*notes, *_of_way(read)], pieces)


def _of_solids(looked: FileMesh, notes: list[str]) -> list[Read]:
    """Options of reading the solids of a CAD file, in the order in which they are tried."""
    from antiosc.io.reading import described_pieces

    solids = _solids(looked)
    if not solids:
        return [{}]
    notes.append(f"it has {len(solids)} solids ({described_pieces(solids)}).")
    largest: Read = {"piece": 1}
    return [{"fragments": True}, largest] if len(solids) <= MOST_SOLIDS else [largest]


def _solids(looked: FileMesh) -> list[Piece]:
    """The solids of a CAD file, if there are several."""
    from antiosc.io.reading import Piece

    boxes = looked.points[looked.cells["line"]]
    several = boxes if len(boxes) > 1 else boxes[:0]
    return [Piece("", box.min(axis=0), box.max(axis=0)) for box in several]


def _described(pieces: Sequence[Piece]) -> list[str]:
    """A sentence on the pieces of a part that falls apart."""
    from antiosc.io.reading import described_pieces

    if not pieces:
        return []
    return [f"it falls into {len(pieces)} pieces ({described_pieces(pieces)})."]


def _first(path: Path, read: Read, ways: list[Read]) -> tuple[Mesh, Read, Sequence[Piece]]:
    """(mesh, way, pieces) of the first way that gives a mesh; the error of the first if none."""
    pieces: Sequence[Piece] = ()
    reason: InputError | None = None
    for way in _with_pieces(ways):
        if reason is not None and way.get("of_pieces") and not isinstance(reason, PiecesError):
            continue
        own = {key: value for key, value in way.items() if key != "of_pieces"}
        try:
            return antiosc.read_mesh(str(path), **read, **own), own, pieces
        except InputError as error:
            reason = reason or error
            pieces = pieces or getattr(error, "pieces", ())
    assert reason is not None
    raise reason


def _with_pieces(ways: list[Read]) -> Iterator[Read]:
    """Each way, then with its pieces joined, or with the largest of them alone."""
    for way in ways:
        yield way
        if "piece" not in way:
            joined: list[Read] = [{"piece": 1}]
            if not {"size", "fragments", "solid"} & set(way):
                joined.insert(0, {"merge": MERGE_DISTANCE})
            yield from ({**way, **one, "of_pieces": True} for one in joined)


def _of_way(read: Read) -> list[str]:
    """What the options of reading mean, in sentences."""
    words = {
        "fragments": "its solids are joined where they touch (fragments).",
        "piece": "of its pieces the largest is read (piece).",
        "merge": "its pieces are joined at nodes that coincide (merge).",
        "cells": "cells of other dimensions are left out (cells).",
        "order": "its bars are straight between their ends (order).",
    }
    return [sentence for key, sentence in words.items() if key in read]


# --- Decks ----------------------------------------------------------------------------------------


def _of_deck(path: Path, free: bool, units: Sequence[str]) -> ForeignPart:
    """The model of a deck in that of some units in which its materials are real ones.

    One model that can be read says what the others would be.
    """
    from antiosc.extension import with_parts

    reason: InputError | None = None
    for unit in units:
        try:
            structure, read, pieces = _model(path, unit, free)
        except InputError as error:
            reason = reason or error
            continue
        best = unit_of(structure, unit, units, "density" in read)
        if best != unit:
            with contextlib.suppress(InputError):
                structure, read, pieces = _model(path, best, free)
        members = [m for m, _ in with_parts(structure).fields(np.zeros((structure.rows, 0)), None)]
        mesh = max((m.part.mesh for m in members), key=lambda mesh: (mesh.tdim, mesh.n_cells))
        notes = [*_described(pieces), *_of_way(read), *structure.plausibility.get("doubts", ())]
        return ForeignPart(mesh, read, structure, notes, pieces)
    assert reason is not None
    raise reason


def _model(path: Path, unit: str, free: bool) -> tuple[Structure, Read, Sequence[Piece]]:
    """The structure of a deck, how it was read (a density, one piece if needed), its pieces."""
    pieces: Sequence[Piece] = ()
    read: Read = {"unit": unit, **({"free": True} if free else {})}
    while True:
        try:
            with warnings_to(list[str]().append):
                return antiosc.read_model(str(path), **read), read, pieces
        except PiecesError as error:
            if "piece" in read:
                raise
            read["piece"], pieces = 1, error.pieces
        except InputError as error:
            if "no density" not in str(error) or "density" in read:
                raise
            read["density"] = STEEL["rho"]
