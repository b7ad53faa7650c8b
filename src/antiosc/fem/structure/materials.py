"""Which material each cell of a mesh has, and which beams lie on the edges of a sheet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from antiosc.base._types import IntArray
from antiosc.base.errors import InputError
from antiosc.fem.elements.beam import Beam
from antiosc.fem.elements.weak_form import Family, Parts
from antiosc.fem.mesh.mesh import Mesh
from antiosc.fem.platform import compat


def divided(mesh: Mesh, material: Any) -> tuple[Any, list[tuple[str, Beam, IntArray]]]:
    """(materials of the cells, beams on edges of a sheet as (group, beam, edges))."""
    if not isinstance(material, Mapping) or mesh.tdim != 2:
        return material, []
    beams = {name: one for name, one in material.items() if isinstance(one, Beam)}
    if not beams:
        return material, []
    cells = {name: one for name, one in material.items() if name not in beams}
    if not cells or not all(_family(one).kind.sheet for one in cells.values()):
        raise InputError(
            f"a Beam on edges (group {next(iter(beams))!r}) stiffens a shell: give the cells of "
            f"{mesh.name} a Shell or Laminate; a frame of beams alone needs a mesh of lines."
        )
    found = []
    for name, beam in beams.items():
        edges = mesh.group(name).get(1)
        if edges is None:
            raise InputError(
                f"group {name!r} holds no edges of the sheet's cells, which a Beam there needs: "
                "let its lines lie in the surface that is meshed (in gmsh: BooleanFragments)."
            )
        found.append((name, beam, edges))
    return cells, found


def parts_of(mesh: Mesh, material: Any) -> Parts:
    """[(material, cells of this rank)], each cell once."""
    imap = compat.cell_map(mesh.dolfinx)
    n_cells = imap.size_local + imap.num_ghosts
    if not isinstance(material, Mapping):
        return [(_family(material), np.arange(n_cells, dtype=np.int32))]
    if not material:
        raise InputError("material is an empty dict: give {group name: material}.")
    times = np.zeros(n_cells, dtype=int)
    parts: list[tuple[Family, IntArray]] = []
    for name, given in material.items():
        one = _family(given)
        cells = mesh.group(name).get(mesh.tdim)
        if cells is None:
            raise InputError(f"group {name!r} holds no cells (dimension {mesh.tdim}).")
        times[cells] += 1
        parts.append((one, cells))
    if len({one.kind for one, _ in parts}) > 1:
        raise InputError(
            "all materials of one structure must be of one family: Solid, Beam, Truss, or Shell "
            "and Laminate."
        )
    none = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] == 0)))
    twice = mesh.comm.allreduce(int(np.sum(times[: imap.size_local] > 1)))
    if none or twice:
        raise InputError(
            f"every cell needs one material: of {mesh.n_cells} cells {none} have none and "
            f"{twice} more than one; the groups named are {', '.join(map(repr, material))}."
        )
    return parts


def _family(material: Any) -> Family:
    """`material`, or InputError for anything else."""
    if isinstance(material, type) or not isinstance(material, Family):
        raise InputError(
            "material must be a Solid, Shell, Laminate, Beam or Truss, or a dict of them; got "
            f"{type(material).__name__}."
        )
    return material
