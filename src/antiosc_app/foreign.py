"""How a part of unknown origin is read: its unit, pieces, closed surfaces, densities.

Most files do not state these, so alternatives are tried: the first that gives a mesh, or a model
with realistic materials, is used.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

import antiosc
from antiosc.base.errors import (
    AntioscWarning,
    InputError,
    NotTakenWarning,
    PiecesError,
    finite_element_packages,
    warnings_to,
    without_warnings,
)
from antiosc.base.materials import density_like
from antiosc.base.texts import rounded_up
from antiosc.io.cad_volume import CUT, FOLLOW
from antiosc.io.remade import ANEW
from antiosc_app.scene_file.document import GEOMETRIES
from antiosc_app.units import (
    OF_KILOGRAMS_FORCE,
    UNITS,
    UNITS_OF_MESHES,
    UNITS_OF_SURFACES,
    UNREAL,
    are_real,
    unit_of,
    unit_of_length,
)

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.io.neutral import FileMesh, Piece

T = TypeVar("T")

#: Arguments of `read_mesh` or `read_model` besides the file.
Read: TypeAlias = dict[str, Any]
#: Elements along the longest side of a geometry that is meshed.
ELEMENTS = 20
#: Largest number of cells of a geometry, so that an impact takes about a minute.
MOST_CELLS = 30_000
#: Nodes of a mesh in pieces are joined up to this distance [m].
MERGE_DISTANCE = 1e-6
#: Arguments of reading that say which pieces are read, and how they are joined.
OF_PIECES = ("fragments", "merge", "cells", "solid", "piece", "contact")
#: What becomes of contact of a deck if nothing is said: a joint under a light blow stays pressed.
TIED = "tied"
#: Words of the warnings of a mesh whose pieces meet, but not at faces of their cells: joined at the
#: few nodes that coincide, one would turn about the others.
UNJOINED = ("overlap others", "lie on cells that they do not belong to")
#: Largest number of solids that are joined as fragments; of more solids the largest is read alone.
MOST_SOLIDS = 40
#: Default material of the part and of the ball.
STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
#: Words of the error of a deck that does not state a property -> the key of its guess.
UNSTATED = {"no density": "density", "no constants of elasticity": "modulus"}
#: Words of the error of a deck whose supports leave nothing to move; it is read without them.
ALL_HELD = "fix every dof"
#: Endings of decks, which contain materials and supports.
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
    meshed : whether the file is a geometry that is meshed here.
    kept : why the elements of a deck cannot be halved; "" if they can.
    divided : elements of a deck that are divided into simplices, in words.
    structure : structure of a deck with a model.
    notes : decisions that were made, one sentence each.
    pieces : if the mesh is in several pieces, these, the largest first.
    inferred : whether the unit of a deck is inferred; modulus : from this Young's modulus in it, or
        from its size and densities (None).
    """

    mesh: Mesh
    read: Read
    structure: Structure | None = None
    notes: list[str] = field(default_factory=list)
    pieces: Sequence[Piece] = ()
    inferred: bool = False
    modulus: float | None = None
    meshed: bool = False
    kept: str = ""
    divided: str = ""


def foreign_part(
    path: Path,
    free: bool = False,
    unit: str | None = None,
    timeout: float | None = None,
    size: float | None = None,
    contact: str | None = None,
    alone: Read | None = None,
) -> ForeignPart:
    """Read or mesh a part; `free`: a deck without supports; `unit`: unit of the file, if known.

    `timeout` [s]: limit of each reading; None: by kind and size of the file. `size` [m]: largest
    cell; None: by the size of a geometry, that of the cells of a mesh or a deck. `contact`: what
    becomes of the contact of a deck, "tied" or "apart"; None: tied, if it can be. `alone`: how one
    piece is read (`way_of_piece`), in place of all alternatives.

    Raises
    ------
    AntioscError
        No alternative can read it.
    """
    with finite_element_packages():
        importlib.import_module("antiosc.fem.mesh")
    limit: Read = {} if timeout is None else {"timeout": timeout}
    if is_deck(path):
        options = limit | ({"free": True} if free else {}) | (alone or {})
        options |= {"contact": contact} if contact else {}
        return _of_deck(path, options, UNITS if unit is None else (unit,), size)
    if contact is not None:
        raise InputError(f"{path.name} is no deck with contact: leave contact away.")
    with without_warnings():
        return _of_mesh(path, unit, limit, size, alone)


def is_deck(path: Path) -> bool:
    """Whether a file is a deck with materials."""
    return path.suffix.lower() in DECK_ENDINGS and bool(MODEL_CARD.search(path.read_bytes()))


def usual_size(length: float) -> float:
    """Size [m] that is asked of the cells of a geometry of this length [m] if none is given."""
    return float(f"{length / ELEMENTS:.1g}")


def way_of(read: Read) -> Read:
    """How a part was read, with its piece: another reading of it tries nothing else."""
    return {key: read[key] for key in OF_PIECES if key in read}


def way_of_piece(read: Read, piece: int) -> Read:
    """How a piece of a part is read alone; `read`: how the part was read, with its pieces."""
    joins = () if "piece" in read else ("fragments", "merge", "contact")
    kept = {key: read[key] for key in OF_PIECES if key in read and key not in joins}
    return {**kept, "piece": piece}


# --- Meshes and geometries ------------------------------------------------------------------------


def _of_mesh(
    path: Path, unit: str | None, limit: Read, given: float | None, alone: Read | None
) -> ForeignPart:
    """Read a mesh, or mesh a geometry; `limit`: the timeout, `given`: the size, if there is one;
    `alone`: as in `foreign_part`.
    """
    from antiosc.io.cad import STATES_UNIT
    from antiosc.io.facets import CLOSED, SURFACES
    from antiosc.io.neutral import UnitSystem
    from antiosc.io.reading import outline

    suffix = path.suffix.lower()
    read: Read = limit | ({} if unit is None else {"unit": unit})
    notes: list[str] = []
    ways: list[Read] = [{}]
    file_outline = None
    if suffix in GEOMETRIES or suffix in SURFACES:
        file_outline = outline(path, **limit)
        length = float(np.ptp(file_outline.points, axis=0).max())
        if unit is None and suffix not in STATES_UNIT:
            choices = UNITS_OF_SURFACES if suffix in SURFACES else UNITS_OF_MESHES
            read["unit"] = unit_of_length(length, choices)
        factor = UnitSystem.of(read.get("unit", "m")).length
        file_outline.pieces = [piece.scaled(factor) for piece in file_outline.pieces]
        size = given or usual_size(_longest(file_outline, factor * length, alone))
        if suffix in GEOMETRIES:
            read["size"] = size
            ways = _of_solids(file_outline, notes)
        elif CLOSED in file_outline.groups:
            notes.append("its surface is closed: it is filled as a solid (solid).")
            ways = [{"solid": True, "size": size}]
    else:
        ways += [{"cells": dim} for dim in (3, 2, 1)]
    if alone is not None:
        ways = [{**alone, "size": size} if alone.get("solid") else alone]
    mesh, options, pieces, told = _first(path, read, ways)
    read |= options
    made_with = dict(read)
    meshed = "size" in read
    if meshed and given is None and mesh.n_cells > MOST_CELLS:
        larger = rounded_up(read["size"] * (mesh.n_cells / MOST_CELLS) ** (1 / mesh.tdim))
        notes.append(
            f"elements of {read['size']:g} m would be {mesh.n_cells} cells: those of {larger:g} m"
            " are taken (size)."
        )
        read["size"] = larger
        told_again: list[str] = []
        with warnings_to(told_again.append):
            mesh = antiosc.read_mesh(str(path), **read)
        made_with = dict(read)
        of_first = (one for one in told if not _of_surface(one))
        told = told_again if "solid" in read else [*of_first, *filter(_of_surface, told_again)]
    notes += told
    if mesh.tdim == 1 and mesh.order > 1:  # bars are straight
        read["order"] = 1
    if not meshed and "unit" not in read:
        length = float(np.ptp(mesh.dolfinx.geometry.x, axis=0).max())
        if suffix not in STATES_UNIT:
            read["unit"] = unit_of_length(length, UNITS_OF_MESHES)
            factor = UnitSystem.of(read["unit"]).length
            pieces = [piece.scaled(factor) for piece in pieces]
    if file_outline is not None and not {"piece", "fragments"} <= options.keys():
        pieces = file_outline.pieces or pieces
    if "piece" in options:
        notes += _described(pieces)
    if mesh.tdim < 3 and mesh.gdim == 2:  # a plate, struck on its face
        read["gdim"] = 3
    if given is not None and not meshed:
        read["size"] = given
    if read != made_with:
        mesh = antiosc.read_mesh(str(path), **read)
    all_notes = [*notes, *_option_notes(read)]
    return ForeignPart(mesh, read, None, all_notes, pieces, meshed=meshed)


def _of_solids(file_outline: FileMesh, notes: list[str]) -> list[Read]:
    """Alternative options for reading the solids of a CAD file, in the order of trial."""
    solids = file_outline.pieces
    if not solids:
        return [{}]
    notes.append(f"it has {len(solids)} solids.")
    largest: Read = {"piece": 1}
    if len(solids) <= MOST_SOLIDS:
        return [{"fragments": True}, largest]
    return [largest]


def _longest(file_outline: FileMesh, length: float, alone: Read | None) -> float:
    """The longest side [m] of a geometry of this length, or of the piece of it that is read."""
    rank = (alone or {}).get("piece", 0)
    if not 0 < rank <= len(file_outline.pieces):
        return length
    piece = file_outline.pieces[rank - 1]
    return float((piece.high - piece.low).max())


def _described(pieces: Sequence[Piece]) -> list[str]:
    """A sentence (in a list) on the pieces of a part."""
    from antiosc.io.reading import described_pieces

    if not pieces:
        return []
    return [f"it falls into {len(pieces)} pieces ({described_pieces(pieces)})."]


def _not_joined(ways: list[Read], options: Read, reason: InputError | None) -> list[str]:
    """A sentence (in a list) on solids that could not be joined."""
    if "fragments" not in ways[0] or "fragments" in options or reason is None:
        return []
    return [f"its solids are not joined (fragments), since this failed: {reason}"]


def _first(
    path: Path, read: Read, ways: list[Read]
) -> tuple[Mesh, Read, Sequence[Piece], list[str]]:
    """(mesh, options, pieces, notes) of the first alternative that works; else the first error."""
    pieces: Sequence[Piece] = ()
    reason: InputError | None = None
    for way in _with_pieces(ways):
        if reason is not None and way.get("of_pieces") and not isinstance(reason, PiecesError):
            continue
        options = {key: value for key, value in way.items() if key != "of_pieces"}
        warned: list[str] = []
        try:
            with warnings_to(warned.append):
                mesh = antiosc.read_mesh(str(path), **read, **options)
        except InputError as error:
            reason = reason or error
            pieces = pieces or getattr(error, "pieces", ())
            continue
        touches = any(words in text for words in UNJOINED for text in warned)
        if not (touches and "merge" in options):
            failed = _not_joined(ways, options, reason)
            # what was repaired of a surface, and how it is meshed
            if "solid" not in options:
                warned = [*failed, *filter(_of_surface, warned)]
            return mesh, options, pieces, warned
    assert reason is not None
    raise reason


def _of_surface(warned: str) -> bool:
    """Whether a warning is on a surface made anew, or one that the elements cut off or follow."""
    return any(words in warned for words in (ANEW, FOLLOW, CUT))


def _with_pieces(ways: list[Read]) -> Iterator[Read]:
    """Yields each alternative, then it with its pieces joined, and with the largest piece alone."""
    for options in ways:
        yield options
        if "piece" not in options:
            joined: list[Read] = [{"piece": 1}]
            if not {"size", "fragments", "solid"} & set(options):
                joined.insert(0, {"merge": MERGE_DISTANCE})
            yield from ({**options, **option, "of_pieces": True} for option in joined)


def _ranked(piece: int) -> str:
    """Which of its pieces one is, in words."""
    return "the largest" if piece == 1 else f"number {piece}, the largest being 1,"


def _option_notes(read: Read) -> list[str]:
    """Sentences on the options of reading."""
    words = {
        "fragments": "its solids are joined where they touch (fragments).",
        "piece": f"of its pieces {_ranked(read.get('piece', 1))} is read (piece).",
        "merge": "its pieces are joined at nodes that coincide (merge).",
        "cells": "cells of other dimensions are left out (cells).",
        "free": "its supports hold all of it, and are left out (free).",
        "order": "its bars are straight between their ends (order).",
    }
    return [sentence for key, sentence in words.items() if key in read]


# --- Decks ----------------------------------------------------------------------------------------


def _of_deck(path: Path, options: Read, units: Sequence[str], size: float | None) -> ForeignPart:
    """The model of a deck in the unit in which its materials are the most realistic.

    `options`: those of reading besides the unit and the size [m] of its cells.
    """
    from antiosc.extension import with_parts
    from antiosc.io.neutral import UnitSystem
    from antiosc_decks.from_deck import materials_of_deck

    guesses = {"density": STEEL["rho"], "modulus": STEEL["E"]}
    read = dict(options)
    unit, facts, pieces = _first_unit(materials_of_deck, path, units, read, guesses)
    best, modulus, off = unit_of(facts.families, facts.length, unit, units, read)
    inferred = len(units) > 1
    if inferred and off > UNREAL:
        in_kgf = materials_of_deck(path, OF_KILOGRAMS_FORCE, **read)
        best = OF_KILOGRAMS_FORCE if are_real(in_kgf.families) else best
    if modulus is not None:
        guesses["density"] = density_like(modulus * UnitSystem.of(best).stress)
    units = list(dict.fromkeys([best, *units]))
    if size is not None:
        read["size"] = size
    told: list[str] = []
    unit, structure, more = _first_unit(antiosc.read_model, path, units, read, guesses, told)
    read = {"unit": unit, **read}
    pieces = facts.pieces or pieces or more
    members = [m for m, _ in with_parts(structure).fields(np.zeros((structure.rows, 0)), None)]
    mesh = max((m.part.mesh for m in members), key=lambda mesh: (mesh.tdim, mesh.n_cells))
    told_besides = {*options, "piece"}  # `told` lists the pieces
    notes = [
        *_option_notes({key: value for key, value in read.items() if key not in told_besides}),
        *structure.plausibility.get("doubts", ()),
    ]
    notes += [sentence for sentence in dict.fromkeys(told) if sentence not in notes]
    found = ForeignPart(mesh, read, structure, notes, pieces, inferred, modulus)
    return replace(found, kept=facts.not_halved, divided=facts.divided)


def _first_unit(
    reader: Callable[..., T],
    path: Path,
    units: Sequence[str],
    read: Read,
    guesses: Mapping[str, float],
    told: list[str] | None = None,
) -> tuple[str, T, Sequence[Piece]]:
    """(unit, what `reader` makes of a deck, pieces) in the first unit in which it is not refused.

    `told` gets what was decided while the deck was read, without what was not taken.

    Raises the first InputError; a reason that is the same in two units does not depend on the unit.
    """
    reasons: list[InputError] = []
    for unit in units:
        try:
            warned: list[str] = []
            of_unit = _read_deck(partial(reader, str(path), unit), read, guesses, warned)
            if told is not None:
                told += [str(one) for one in warned if _is_decision(one)]
            return unit, *of_unit
        except InputError as error:
            reasons.append(error)
            if len(reasons) > 1 and str(error) == str(reasons[-2]):
                break
    raise reasons[0]


def _is_decision(message: str) -> bool:
    """Whether a warning is of what was decided, not of what was not taken."""
    return not issubclass(getattr(message, "category", AntioscWarning), NotTakenWarning)


def _read_deck(
    reader: Callable[..., T], read: Read, guesses: Mapping[str, float], warned: list[str]
) -> tuple[T, Sequence[Piece]]:
    """(what `reader` makes of a deck, pieces); adds to the options `read` the piece and the guesses
    that are needed, and to `warned` the warnings.
    """
    pieces: Sequence[Piece] = ()
    chosen = "contact" in read
    while True:
        warned.clear()
        try:
            with warnings_to(warned.append):
                return reader(**read), pieces
        except PiecesError as error:
            if "piece" in read:
                raise
            pieces = error.pieces
            if "contact" not in read and not pieces:
                read["contact"] = TIED
                continue
            if not chosen:
                read.pop("contact", None)
            read["piece"] = 1
        except InputError as error:
            if ALL_HELD in str(error) and "free" not in read:
                read["free"] = True
                continue
            unstated = (key for words, key in UNSTATED.items() if words in str(error))
            key = next(unstated, None)
            if key is None or key in read:
                raise
            read[key] = guesses[key]
