"""Curvature of the surface of a structure at a site."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.engine.contact.curvature import PLANE, Curvature
from antiosc.fem.assembly import with_parts
from antiosc.fem.mesh.closest import closest
from antiosc.fem.mesh.curvature import curvature
from antiosc.fem.structure import in_space
from antiosc.fem.structure.meshed import MeshedStructure
from antiosc.fem.structure.structure import Structure
from antiosc.reduce.site.at_points import nearest_parts

NO_SURFACE = "matrices have no surface: give the law of the contact."


def curvature_at(
    structure: Structure,
    point: ArrayLike,
    direction: Sequence[float] | None = None,
    lengths: bool = True,
) -> Curvature:
    """Principal curvatures of the outer surface of a structure at its point nearest to `point`.

    Parameters
    ----------
    structure : Structure
        Of meshes of solids or shells; of several the nearest one counts.
    point : array_like (2,) or (3,)
        [m]
    direction : sequence of floats, optional
        Of the impact. A shell is struck on the face that is opposite to it, half a thickness
        outside of the middle surface.
    lengths : bool
        Whether the lengths of lines are looked for, which takes most of the time.

    Raises
    ------
    InputError
        Matrices without a mesh; beams and plane parts, which have no surface in space.
    """
    matrices = with_parts(structure, NO_SURFACE)
    x, way = _checked(point, direction)

    def work() -> Curvature:
        (member,) = nearest_parts(matrices, x[None], np.zeros(3) if way is None else way)
        turn = member.at.rotation
        along = None if way is None else way @ turn
        part, own = member.part, member.at.own(x[None])[0]
        flat_sheet = part.kind.sheet and part.mesh.gdim == 2
        found = (
            _flat(own, along)
            if flat_sheet
            else curvature(part.mesh, part.faces, own, along, lengths)
        )
        if part.kind.sheet:
            found = found.beyond(_material(part, own).section.thickness / 2)
        return found.placed(turn, member.at.placed(np.zeros((1, 3)))[0])

    return matrices.decided(work)


def _flat(point: Array, along: Array | None) -> Curvature:
    """The face of a sheet in the plane z = 0 on the side of the impactor."""
    normal = np.array([0.0, 0.0, -1.0 if along is not None and along[2] > 0 else 1.0])
    on_sheet = point * [1.0, 1.0, 0.0]
    return Curvature(PLANE, np.zeros(2), 0.0, np.eye(3)[:2], on_sheet, normal)


def material_at(
    structure: Structure, point: ArrayLike, direction: Sequence[float] | None = None
) -> Any:
    """The material of a meshed structure at its point nearest to `point` [m]."""
    matrices = with_parts(structure, NO_SURFACE)
    x, way = _checked(point, direction)

    def work() -> Any:
        (member,) = nearest_parts(matrices, x[None], np.zeros(3) if way is None else way)
        return _material(member.part, member.at.own(x[None])[0])

    return matrices.decided(work)


def _checked(point: ArrayLike, direction: Sequence[float] | None) -> tuple[Array, Array | None]:
    x = in_space(checks.coordinates("point", point))
    if direction is None:
        return x, None
    way = in_space(checks.coordinates("direction", direction, ""))
    if not way.any():
        raise InputError("direction must not be the zero vector.")
    return x, way


def _material(part: MeshedStructure, point: Array) -> Any:
    """The material of a part at its point nearest to `point` (3,)."""
    if len(part.parts) == 1:
        return part.parts[0][0]
    nearest, comm = closest(part.mesh, point), part.mesh.comm
    label = int(part.part_of_cells()[nearest.cell]) if comm.rank == nearest.rank else 0
    return part.parts[comm.bcast(label, root=nearest.rank)][0]
