"""Reads the file of a part and guesses values that it does not state: unit, piece, densities."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

import antiosc
from antiosc.base._types import Array, BoolArray
from antiosc.base.errors import (
    InputError,
    MeshError,
    NotTakenWarning,
    PiecesError,
    finite_element_packages,
    warnings_to,
    without_warnings,
)
from antiosc.base.plausible import GRAVITY
from antiosc.io.neutral import UnitSystem
from antiosc_app.scene_file.document import GEOMETRY_ENDINGS

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.io.neutral import FileMesh, Piece

T = TypeVar("T")
#: Arguments of `read_mesh` or `read_model` besides the file.
ReadOptions: TypeAlias = dict[str, Any]
#: A mesh that states no unit is in mm if it is longer than this, else in m.
MAX_LENGTH_IN_METRES = 3.0
#: Units of decks, in the order in which they are taken where the materials are real ones; those in
#: which densities are often weights.
GUESSED_UNITS, POUND_UNITS = ("mm", "m", "mm-kg", "in", "ft"), ("in", "ft")
#: Moduli [Pa] and densities [kg/m³] of solids, rubber to diamond and foam to osmium; in rarer units
#: those of structures alone, which no other unit makes of a steel.
MODULUS_RANGE, DENSITY_RANGE, STIFF_RANGE = (1e6, 1.3e12), (20.0, 25e3), (3e9, 1.3e12)
USUAL_UNITS = ("mm", "m")
#: What stands for constants that a deck does not state.
STEEL_CONSTANTS = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Arguments of reading that say which pieces are read, and how they are joined.
PIECE_KEYS = ("fragments", "merge", "cells", "solid", "piece", "contact")
#: Largest number of solids that are joined as fragments; of more solids the largest is read alone.
MAX_JOINED_SOLIDS = 40
#: Endings of decks, which contain materials and supports.
DECK_ENDINGS = {".inp", ".bdf", ".nas", ".fem", ".dat"}
#: Cards of decks that give elements a material.
MODEL_CARD_PATTERN = re.compile(
    rb"^\s*(\*(material|\w+ ?\w* section)\b|mat(1|2|8|9)\b[*,\s])", re.I | re.M
)
#: A card of contact between pieces.
CONTACT_CARD_PATTERN = re.compile(rb"^\s*\*contact ?pair\b", re.I | re.M)
#: Argument -> what it does to a part, in words.
OPTION_TEXTS = {
    "fragments": "its solids are joined where they touch (fragments).",
    "cells": "cells of other dimensions are left out (cells).",
    "order": "its bars are straight between their ends (order).",
    "solid": "its surface is closed: it is filled as a solid (solid).",
}


@dataclass(frozen=True)
class ForeignPart:
    """A part that was read.

    `read_options`: the arguments of `read_mesh` or `read_model` with which it was read.
    """

    mesh: Mesh
    read_options: ReadOptions
    structure: Structure | None = None  # of a deck with a model
    notes: list[str] = field(default_factory=list)  # what was decided, one sentence each
    pieces: Sequence[Piece] = ()  # the largest first
    unit_is_inferred: bool = False  # whether the unit of a deck is inferred from its materials
    is_meshed: bool = False  # whether the file is a geometry that is meshed here


def foreign_part(
    path: Path,
    free: bool = False,
    unit: str | None = None,
    size: float | None = None,
    contact: str | None = None,
    piece_options: ReadOptions | None = None,
) -> ForeignPart:
    """Read or mesh the file of a part.

    `free`: without a deck's supports; `unit`, `size` [m] of cells: None to guess them; `contact` of
    a deck: "tied" or "apart"; `piece_options`: further arguments of the reader, for a single piece.
    """
    with finite_element_packages():
        importlib.import_module("antiosc.fem.mesh")
    if is_deck(path):
        has_contact = piece_options is None and bool(CONTACT_CARD_PATTERN.search(path.read_bytes()))
        told = contact or ("tied" if has_contact else None)  # as without it, but told
        given = {"free": free or None, "contact": told, "size": size, **(piece_options or {})}
        given = {key: value for key, value in given.items() if value is not None}
        part = _part_of_deck(path, given, unit)
        if contact is None and "piece" in part.read_options:  # nothing could be tied
            part.read_options.pop("contact", None)
        return part
    if contact is not None:
        raise InputError(f"{path.name} is no deck with contact: leave contact away.")
    with without_warnings():
        return _part_of_mesh(path, unit, size, piece_options)


def is_deck(path: Path) -> bool:
    """Whether a file is a deck with materials."""
    return path.suffix.lower() in DECK_ENDINGS and bool(
        MODEL_CARD_PATTERN.search(path.read_bytes())
    )


def read_options_of_piece(read: ReadOptions, piece: int) -> ReadOptions:
    """Arguments that read one piece of a part; `read`: arguments that read the whole part."""
    joins = () if "piece" in read else ("fragments", "merge", "contact")
    kept = {key: read[key] for key in PIECE_KEYS if key in read and key not in joins}
    return {**kept, "piece": piece}


def unit_of_length(length: float) -> str:
    """Guess the unit of a file, "mm" or "m", from the length of its part in that unit."""
    return "mm" if length > MAX_LENGTH_IN_METRES else "m"


# --- Meshes and geometries ------------------------------------------------------------------------


def _part_of_mesh(
    path: Path, unit: str | None, size: float | None, piece_options: ReadOptions | None
) -> ForeignPart:
    """Read a mesh, or mesh a geometry; the arguments are those of `foreign_part`."""
    from antiosc.fem.mesh.reading import default_size, usual_size
    from antiosc.io.by_gmsh import ENDINGS_WITH_UNIT
    from antiosc.io.facets import SURFACE_ENDINGS

    suffix = path.suffix.lower()
    read: ReadOptions = {} if unit is None else {"unit": unit}
    is_unknown = unit is None and suffix not in ENDINGS_WITH_UNIT
    ways: list[ReadOptions] = [{}, *({"cells": dim} for dim in (3, 2, 1))]
    pieces: Sequence[Piece] = ()
    notes: list[str] = []

    if suffix in GEOMETRY_ENDINGS or suffix in SURFACE_ENDINGS:
        contents, read = _opened_geometry(path, read, is_unknown)
        pieces = contents.pieces
        ways = _options_to_try(contents, suffix in GEOMETRY_ENDINGS, notes)
        ways = ways if piece_options is None else [piece_options]
        piece = pieces[piece_options["piece"] - 1] if piece_options and pieces else None
        box = contents.points if piece is None else np.array([piece.low, piece.high])
        usual = usual_size(box)
        if suffix in GEOMETRY_ENDINGS or any("solid" in way for way in ways):
            read["size"] = size or usual
    elif piece_options is not None:
        ways = [piece_options]

    meshed = "size" in read
    mesh, options, found, told = _first_readable(path, read, ways)
    read |= options
    pieces = pieces or found
    changed: ReadOptions = {}
    longest = float(np.ptp(mesh.dolfinx.geometry.x, axis=0).max())
    if meshed and size is None:
        wanted = default_size(mesh, read["size"])
        if wanted != read["size"]:
            changed["size"] = wanted
    elif size is not None and not meshed:
        changed["size"] = size
    if mesh.tdim == 1 and mesh.order > 1:  # bars are straight
        changed["order"] = 1
    if mesh.tdim < 3 and mesh.gdim == 2:  # a plate, struck on its face
        changed["gdim"] = 3
    if is_unknown and "unit" not in read:
        changed["unit"] = unit_of_length(longest)
        factor = UnitSystem.of(changed["unit"]).length
        pieces = found = [piece.scaled(factor) for piece in pieces]
    if changed:
        read |= changed
        told.clear()
        with warnings_to(told.append):
            mesh = antiosc.read_mesh(str(path), **read)

    notes += [*dict.fromkeys(told), *(OPTION_TEXTS[key] for key in OPTION_TEXTS if key in read)]
    notes += _piece_sentence(read, found or pieces)
    return ForeignPart(mesh, read, None, notes, pieces, is_meshed=meshed)


def _opened_geometry(
    path: Path, read: ReadOptions, is_unknown: bool
) -> tuple[FileMesh, ReadOptions]:
    """(contents of a geometry or surface in m, `read` with its unit).

    `is_unknown`: whether the unit is to be guessed.
    """
    from antiosc.io.reading import read_outline

    contents = read_outline(path)
    if is_unknown:
        read = read | {"unit": unit_of_length(float(np.ptp(contents.points, axis=0).max()))}
    factor = UnitSystem.of(read.get("unit", "m")).length
    contents.points = contents.points * factor
    contents.pieces = [piece.scaled(factor) for piece in contents.pieces]
    return contents, read


def _options_to_try(contents: FileMesh, is_geometry: bool, notes: list[str]) -> list[ReadOptions]:
    """Options of `read_mesh` to be tried in turn; adds the reasons for them to `notes`."""
    from antiosc.io.facets import CLOSED_SURFACE_GROUP

    if not is_geometry:
        return [{"solid": True}] if CLOSED_SURFACE_GROUP in contents.groups else [{}]
    solids = len(contents.pieces)
    if not solids:
        return [{}]
    notes.append(f"it has {solids} solids.")
    return [{"fragments": True}] if solids <= MAX_JOINED_SOLIDS else [{"piece": 1}]


def _first_readable(
    path: Path, read: ReadOptions, option_sets: list[ReadOptions]
) -> tuple[Mesh, ReadOptions, Sequence[Piece], list[str]]:
    """(mesh, options, pieces, messages) by the first options in `option_sets` that work.

    `read`: further options; pieces are known if the whole part could not be read.
    """
    reason: InputError | None = None
    pieces: Sequence[Piece] = ()
    for way in option_sets:
        attempts = [way] if "piece" in way else [way, {**way, "piece": 1}]
        for options in attempts:
            told = [str(reason)] if reason and "cells" in options else []  # with its numbers
            try:
                with warnings_to(told.append):
                    return antiosc.read_mesh(str(path), **read, **options), options, pieces, told
            except InputError as error:
                reason = reason or error
                pieces = pieces or getattr(error, "pieces", ())
                if not isinstance(error, PiecesError) and "fragments" not in options:
                    break
    assert reason is not None
    raise reason


def _piece_sentence(read: ReadOptions, pieces: Sequence[Piece]) -> list[str]:
    """One sentence on the piece that is read alone; [] for a whole part."""
    from antiosc.io.reading import described_pieces

    if "piece" not in read:
        return []
    told = f" ({described_pieces(pieces)})" if pieces else ""
    which = "the largest" if read["piece"] == 1 else f"number {read['piece']}"
    return [f"of its {len(pieces) or 'several'} pieces{told} {which} is read (piece)."]


# --- Decks ----------------------------------------------------------------------------------------


def _part_of_deck(path: Path, options: ReadOptions, unit: str | None) -> ForeignPart:
    """Read the model of a deck; `unit`: None for the first with realistic materials."""
    from antiosc.fem.structure.structure import with_parts
    from antiosc_decks.from_deck import facts_of_deck

    read = dict(options)
    if read.pop("size", None) is not None:
        raise InputError(f"{path.name} keeps its elements: mesh it finer in the program it is of.")
    facts, read, pieces = _with_steel_constants(
        partial(facts_of_deck, str(path), unit or "mm"), read, []
    )
    pieces = facts.pieces or pieces
    taken = unit or unit_of_materials(facts.families, facts.length)
    told: list[str] = []
    read = {"unit": taken, **read}
    structure, read, more = _with_steel_constants(
        partial(antiosc.read_model, str(path)), read, told
    )

    members = with_parts(structure).members()
    mesh = max((m.part.mesh for m in members), key=lambda mesh: (mesh.tdim, mesh.n_cells))
    decided = (one for one in told if getattr(one, "category", None) is not NotTakenWarning)
    notes = [*structure.plausibility.get("doubts", ()), *map(str, decided)]
    pieces = pieces or more
    notes += [] if pieces else _piece_sentence(read, pieces)  # what was told lists the pieces
    return ForeignPart(mesh, read, structure, [*dict.fromkeys(notes)], pieces, unit is None)


def _with_steel_constants(
    reader: Callable[..., T], read: ReadOptions, messages: list[str]
) -> tuple[T, ReadOptions, Sequence[Piece]]:
    """(result of `reader`, its arguments, pieces of the deck), with the density and the modulus of
    steel if the deck is refused without them; `messages` gets its warnings."""
    reason: InputError | None = None
    pieces: Sequence[Piece] = ()
    pieces_read: list[ReadOptions] = [{}] if "piece" in read else [{}, {"piece": 1}]
    constants: list[ReadOptions] = [{}, {"density": STEEL_CONSTANTS["rho"]}]
    constants.append({"density": STEEL_CONSTANTS["rho"], "modulus": STEEL_CONSTANTS["E"]})
    for stated, piece in product(constants, pieces_read):
        if stated and not isinstance(reason, MeshError):
            break  # its materials were complete
        options = {**read, **piece, **stated}
        messages.clear()
        try:
            with warnings_to(messages.append):
                return reader(**options), options, pieces
        except InputError as error:
            if reason is None or isinstance(reason, MeshError) > isinstance(error, MeshError):
                reason = error  # the content of the deck is sound with steel's constants
            pieces = pieces or getattr(error, "pieces", ())
    assert reason is not None
    raise reason


def unit_of_materials(families: Sequence[Any], length: float) -> str:
    """The first unit in which most materials of a deck are realistic, else a unit by its length.

    `families`, `length` [m]: materials and length of the deck, read in mm.
    """
    values = np.array([_modulus_and_density(family) for family in families])
    read = UnitSystem.of("mm")
    values /= [read.stress, read.density]

    for needs_density in (True, False):
        for unit in GUESSED_UNITS:
            system = UnitSystem.of(unit)
            E, rho = (values * [system.stress, system.density]).T
            moduli = MODULUS_RANGE if unit in USUAL_UNITS and needs_density else STIFF_RANGE
            real = _is_within(E, moduli)
            if needs_density:
                weights = rho * system.length / GRAVITY if unit in POUND_UNITS else rho
                real &= _is_within(rho, DENSITY_RANGE) | _is_within(weights, DENSITY_RANGE)
            if 2 * real.sum() > len(real):
                return unit
    return unit_of_length(length / read.length)


def _is_within(values: Array, limits: tuple[float, float]) -> BoolArray:
    """Mask of the values between `limits`, both included."""
    return (limits[0] <= values) & (values <= limits[1])


def _modulus_and_density(material: Any) -> tuple[float, float]:
    """Young's modulus along the stiffest direction [Pa] and density [kg/m³]."""
    rho = getattr(material, "rho", np.nan)
    if layers := getattr(material, "layers", ()):
        thickness = [layer.thickness for layer in layers]
        rho = np.average([layer.rho for layer in layers], weights=thickness)
    with suppress(AttributeError):
        return rho * material.bar_speed() ** 2, rho
    return np.nan, rho
