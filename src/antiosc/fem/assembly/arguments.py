"""The arguments of `assemble`, checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from antiosc.base._types import Array
from antiosc.base.checks import array, shown
from antiosc.base.errors import InputError, known
from antiosc.fem.assembly.superelement import Superelement, of_matrices, of_model
from antiosc.fem.structure.matrices import NodalMatrices
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.placement import Placement, placement
from antiosc.fem.structure.structure import Structure, on_mesh
from antiosc.models.anti_oscillators import AntiOscillators


def checked_parts(parts: Any) -> dict[str, MeshedStructure | Superelement]:
    """Name -> the part."""
    if not isinstance(parts, Mapping) or not parts:
        raise InputError(f"parts must be a dict: name -> Structure; got {shown(parts)}.")
    for name in parts:
        _check_name("part", name)
    found = {name: _part(name, part) for name, part in parts.items()}
    if all(isinstance(part, Superelement) for part in found.values()):
        raise InputError("an assembly needs a part with a mesh; all parts are superelements.")
    return found


def _check_name(what: str, name: Any) -> None:
    """InputError for what no joint can name."""
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or ":" in name:
        raise InputError(
            f"a {what}'s name must be a text without a colon, on one line and not empty; got "
            f"{shown(name)}."
        )


def _part(name: str, part: Any) -> MeshedStructure | Superelement:
    if isinstance(part, AntiOscillators):
        return of_model(name, part)
    if not isinstance(part, Structure):
        raise InputError(
            f"the part {name!r} must be a Structure, or a model of several sites; got "
            f"{shown(part)}."
        )
    if part.matrices.assembled:
        raise InputError(
            f"the part {name!r} is an assembly itself: give its parts and joints instead, or a "
            "model of its sites."
        )
    if isinstance(part.matrices, NodalMatrices):
        return of_matrices(name, part.matrices)
    text = "the part {!r} has no mesh, and its matrices no map= of nodes, dofs and coordinates."
    return on_mesh(part, text.format(name))


def checked_places(members: Mapping[str, Any], at: Any) -> dict[str, Placement]:
    """Name -> placement of the part."""
    given = {} if at is None else at
    if not isinstance(given, Mapping):
        raise InputError(f"at must be a dict: name -> Placement or (x, y, z); got {shown(at)}.")
    for name in given:
        if not isinstance(name, str) or name not in members:
            parts = known(name, members, "the parts")
            raise InputError(f"at names {shown(name)}, which is no part; {parts}.")
    return {name: placement(name, given.get(name)) for name in members}


def checked_points(members: Mapping[str, Any], points: Any) -> dict[str, Array]:
    """Name -> coordinates (3,) of a reference point [m]."""
    given = {} if points is None else points
    if not isinstance(given, Mapping):
        raise InputError(f"points must be a dict: name -> coordinates; got {shown(points)}.")
    found = {}
    for name, x in given.items():
        _check_name("point", name)
        if name in members:
            raise InputError(f"{name!r} names both a part and a reference point.")
        xs = array(f"points[{name!r}]", x, None)
        if xs.shape not in ((2,), (3,)):
            raise InputError(f"points[{name!r}] must be 2 or 3 numbers in m; got {shown(x)}.")
        found[name] = np.pad(xs, (0, 3 - len(xs)))
    return found
