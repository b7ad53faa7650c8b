"""The parts of an assembly by name: their placements, and reference points, checked."""

from __future__ import annotations

from collections.abc import Mapping

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.checks import coordinates, shown
from antiosc.base.errors import InputError, name_list
from antiosc.fem.assembly.superelement import (
    Superelement,
    matrix_superelement,
    model_superelement,
)
from antiosc.fem.structure import NodalMatrices, Placement, in_space, placement
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure, on_mesh, refuse_prestress
from antiosc.models.anti_oscillators import AntiOscillators


def checked_parts(parts: object) -> dict[str, MeshedStructure | Superelement]:
    """The parts by name, checked."""
    if not isinstance(parts, Mapping) or not parts:
        raise InputError(f"parts must be a dict: name -> Structure; got {shown(parts)}.")
    for name in parts:
        _check_name("part", name)
    result = {name: _part(name, part) for name, part in parts.items()}
    if all(isinstance(part, Superelement) for part in result.values()):
        raise InputError("an assembly needs a part with a mesh; all parts are superelements.")
    return result


def _check_name(what: str, name: object) -> None:
    """InputError for a name that joints cannot refer to."""
    text = checks.name(f"a {what}'s name", name)
    if not text.strip() or ":" in text:
        raise InputError(f"a {what}'s name must be a text without a colon; got {shown(name)}.")


def _part(name: str, part: object) -> MeshedStructure | Superelement:
    if isinstance(part, AntiOscillators):
        return model_superelement(name, part)
    if not isinstance(part, Structure):
        raise InputError(
            f"the part {name!r} must be a Structure, or a model of several sites; got "
            f"{shown(part)}."
        )
    refuse_prestress(part, f"assemble, of its parts ({name!r}),")
    if part.matrices.assembled:
        raise InputError(
            f"the part {name!r} is an assembly itself: give its parts and joints instead, or a "
            "model of its sites."
        )
    if isinstance(part.matrices, NodalMatrices):
        return matrix_superelement(name, part.matrices)
    text = "the part {!r} has no mesh, and its matrices no map= of nodes, dofs and coordinates."
    meshed = on_mesh(part, text.format(name))
    if meshed.comm.size > 1:
        raise InputError(
            f"an assembly works on one rank, and the part {name!r} is spread over "
            f"{meshed.comm.size}: read its mesh with comm=MPI.COMM_SELF, or start one process."
        )
    return meshed


def checked_places(members: Mapping[str, object], at: object) -> dict[str, Placement]:
    """The placement of each part by name, checked."""
    placements = {} if at is None else at
    if not isinstance(placements, Mapping):
        raise InputError(f"at must be a dict: name -> Placement or (x, y, z); got {shown(at)}.")
    for name in placements:
        if not isinstance(name, str) or name not in members:
            parts = name_list(name, members, "the parts")
            raise InputError(f"at names {shown(name)}, which is no part; {parts}.")
    return {name: placement(name, placements.get(name)) for name in members}


def checked_points(members: Mapping[str, object], points: object) -> dict[str, Array]:
    """The coordinates (3,) [m] of each reference point by name, checked."""
    point_by_name = {} if points is None else points
    if not isinstance(point_by_name, Mapping):
        raise InputError(f"points must be a dict: name -> coordinates; got {shown(points)}.")
    result = {}
    for name, x in point_by_name.items():
        _check_name("point", name)
        if name in members:
            raise InputError(f"{name!r} names both a part and a reference point.")
        result[name] = in_space(coordinates(f"points[{name!r}]", x))
    return result
