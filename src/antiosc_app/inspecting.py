"""Inspects the file of a part, and guesses initial values for a new scene or the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base import progress
from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.texts import rounded_up
from antiosc_app import guessed
from antiosc_app.foreign import (
    STEEL_CONSTANTS,
    ReadOptions,
    foreign_part,
    is_deck,
    read_options_of_piece,
)
from antiosc_app.guessed import SitePlace
from antiosc_app.inspection import FAMILY_DIMENSIONS, Inspection, rounded_to
from antiosc_app.scene_file.compiled import INITIAL_COUNT

if TYPE_CHECKING:
    from antiosc import Mesh, Structure
    from antiosc.fem.mesh.surface import Faces
    from antiosc.io.neutral import Piece

#: Largest file that is looked at, bytes.
MAX_FILE_BYTES = 50_000_000
#: Least number of dofs for one anti-oscillator.
DOFS_PER_OSCILLATOR = 4


def check_size(path: Path) -> None:
    """Raise AntioscError for a file that is too large to be inspected."""
    if path.stat().st_size > MAX_FILE_BYTES:
        raise AntioscError(f"the file is larger than {MAX_FILE_BYTES / 1e6:g} MB.")


def inspect_part(
    path: Path,
    free: bool = False,
    unit: str | None = None,
    size: float | None = None,
    piece: int | None = None,
    contact: str | None = None,
    whole: Inspection | None = None,
) -> Inspection:
    """Read or mesh the file of a part and inspect it.

    `free`: without a deck's supports; `unit`, `size` [m] of cells: None to guess them; `piece`:
    rank of the only piece to read; `contact` of a deck: "tied" or "apart"; `whole`: inspection of
    the whole part, if it was made before.
    """
    check_size(path)
    options = free, unit, size, contact
    if piece is None:
        part = foreign_part(path, *options)
    elif whole is None and is_deck(path):  # one reading of it lists all pieces
        part = foreign_part(path, *options, piece_options={"piece": piece})
        _require_piece(path, piece, part.pieces)
    else:
        first = whole or foreign_part(path, *options)
        _require_piece(path, piece, first.pieces)
        part = foreign_part(
            path, *options, piece_options=read_options_of_piece(first.read_options, piece)
        )
        part = replace(part, pieces=first.pieces)

    with progress.doing("looking for a place that is struck"):
        inspection = _inspection_of(part.mesh, part.read_options, part.structure, part.is_meshed)
    notes = tuple(part.notes)
    return replace(
        inspection, notes=notes, pieces=part.pieces, unit_is_inferred=part.unit_is_inferred
    )


def _require_piece(path: Path, piece: int, pieces: Sequence[Piece]) -> None:
    """Raise InputError unless `pieces` has the rank `piece`, counted from 1."""
    if not 0 < piece <= len(pieces):
        count = f"{len(pieces)} pieces" if pieces else "one piece alone"
        raise InputError(f"{path.name} has {count}: no piece {piece}.")


def inspect_structure(part: Structure) -> Inspection:
    """Inspect the largest mesh of a structure."""
    from antiosc.fem.structure.structure import with_parts

    meshes = [member.part.mesh for member in with_parts(part).members()]
    return _inspection_of(max(meshes, key=lambda mesh: (mesh.tdim, mesh.n_cells)), {}, part)


def _inspection_of(
    mesh: Mesh, read_options: ReadOptions, structure: Structure | None, is_meshed: bool = False
) -> Inspection:
    """Inspect a mesh; `read_options`: the arguments of its reader.

    `structure`: structure of a deck; `is_meshed`: whether the mesh was made from a geometry here.
    """
    from antiosc.fem.elements.weak_form import measure
    from antiosc.fem.mesh.finer import longest_cell
    from antiosc.fem.mesh.surface import Faces
    from antiosc.fem.platform import compat
    from antiosc.strikes.defaults import default_cell_size

    x = np.array(mesh.dolfinx.geometry.x)
    nodes = compat.geometry_nodes(mesh.dolfinx)
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    outer = Faces(mesh, mesh.tdim < 3)
    faces = guessed.nodes_around(outer)

    where: tuple[str, ...] = ()
    plane: list[Array] | None = None
    held = np.zeros(x.shape, dtype=bool)
    if structure is not None:
        held = guessed.held_nodes(structure, x, size)
    elif where := guessed.groups_with(mesh, guessed.SUPPORT_WORDS)[:1]:
        held[guessed.nodes_of(mesh, where)] = True
    else:
        lowest, plane = guessed.supporting_side(x, size, faces if mesh.tdim == 3 else None)
        held[lowest] = True
    supported = guessed.supported(held)

    point, direction = _guessed_site(mesh, outer, held)
    cell = None
    if is_meshed and mesh.tdim == 3:
        behind = guessed.thickness_at(x, faces, (point, direction))
        cell = default_cell_size(float(np.ptp(x, axis=0).max()), behind)
        cell = None if cell >= read_options.get("size", inf) else cell

    # rounded within the tolerance of a plane of nodes
    held_plane = None if plane is None else [rounded_to(plane[0], 1e-2 * size), plane[1].tolist()]
    longest = longest_cell(x[nodes[:, : len(mesh.geometry.corners)]])
    # each node that is not held has three dofs or more
    dofs = 3 * int((~supported).sum()) if structure is None else structure.dofs
    return Inspection(
        family=next(name for name, dim in FAMILY_DIMENSIONS.items() if dim == mesh.tdim),
        read_options=read_options,
        box_low=np.array(rounded_to(x.min(axis=0), size)),
        box_high=np.array(rounded_to(x.max(axis=0), size)),
        groups=list(mesh.groups),
        shape=mesh.cell,
        n_cells=mesh.n_cells,
        held_groups=where,
        held_plane=held_plane,
        point=rounded_to(point, size),
        direction=rounded_to(direction),
        site_cell_size=cell,
        oscillator_count=min(INITIAL_COUNT, dofs // DOFS_PER_OSCILLATOR),
        points=x,
        faces=faces,
        held=supported,
        cell_measure=compat.integrate(1 * measure(mesh, None), mesh.dolfinx),
        structure=structure,
        flat_contact=_flat_face_material(mesh, outer, structure, (point, direction)),
        has_error_bars=mesh.n_cells > 1 if structure is None else _has_error_bars(structure),
        is_meshed=is_meshed,
        longest_cell=longest,
        radius=rounded_up(min(longest, size / 2)) if mesh.gdim == 2 and mesh.tdim == 2 else None,
    )


def _guessed_site(mesh: Mesh, outer: Faces, held: BoolArray) -> SitePlace:
    """Guess the place at which a mesh is struck.

    `held`: mask (N, 3) of the directions in which nodes are held.
    """
    from antiosc.fem.platform import compat

    x = np.array(mesh.dolfinx.geometry.x)
    struck: IntArray = guessed.nodes_of(mesh, guessed.groups_with(mesh, guessed.SITE_WORDS)[:1])
    if mesh.tdim == 1:
        return guessed.guess_on_lines(x, compat.geometry_nodes(mesh.dolfinx), held, struck)
    faces = guessed.nodes_around(outer)
    if mesh.gdim == 2:
        return guessed.guess_on_rim(x, faces, held)
    return guessed.guess_on_faces(x, faces, outer, held, struck)


def _has_error_bars(structure: Structure) -> bool:
    """Whether `extract(…, error="estimate")` accepts the structure."""
    from antiosc.fem.structure.structure import refuse_dampers
    from antiosc.reduce.error.model_errors import ModelErrors

    try:
        refuse_dampers(structure, "an error bar")
        errors = ModelErrors(structure)
        errors.check()
        return not errors.skipped
    except InputError:
        return False


def _flat_face_material(
    mesh: Mesh, outer: Faces, structure: Structure | None, place: SitePlace
) -> tuple[float, float] | None:
    """(E [Pa], nu) for contact with a flat face; None if the surface at the site is known."""
    from antiosc.reduce.site.surface import curvature, material_at, surface_at

    try:
        if structure is not None:
            surface_at(structure, *place, None)
        elif mesh.tdim > 1:
            curvature(mesh, outer, *place)
    except InputError:
        material = None if structure is None else material_at(structure, *place)
        E, nu = (getattr(material, name, None) for name in ("E", "nu"))
        if isinstance(E, float) and isinstance(nu, float):
            return E, nu
        return STEEL_CONSTANTS["E"], STEEL_CONSTANTS["nu"]
    return None
