"""The sites of a map on one part of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse.linalg

from antiosc._types import IntArray
from antiosc.checks import coordinates, shown
from antiosc.errors import InputError
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.mpi import on_root
from antiosc.fem.site.map_sites import only, sites_of
from antiosc.fem.site.site import LEAST_FREE_SHARE
from antiosc.fem.site.sites import Sites


def sites_on_part(
    structure: AssembledMatrices,
    where: Any,
    direction: Sequence[float] | None,
    radius: float | None,
) -> tuple[Sites, IntArray, int, int]:
    """The sites on the surface of a part ("part"), or on a group of it ("part:group").

    Returns (sites, elements between them, number of sites before those that are fixed went,
    dimension of the cells); `sites_of` has the rest.
    """
    if not isinstance(where, str):
        raise InputError(
            "a map of an assembly needs the part that is struck: where='part:group', or "
            f"where='part' for its whole surface; got {shown(where)}."
        )
    name, _, group = where.partition(":")
    (member,) = structure.members(name)
    R = member.at.rotation
    if direction is not None:
        given = coordinates("direction", direction, "")
        direction = (np.pad(given, (0, 3 - len(given))) @ R).tolist()

    def work() -> tuple[Sites, IntArray, int]:
        found, elements, count = sites_of(member.part, group or None, direction, radius)
        loads = (structure.T[member.rows].T @ found.loads).tocsr()
        size = scipy.sparse.linalg.norm(loads, axis=0)
        moves = size > LEAST_FREE_SHARE * scipy.sparse.linalg.norm(found.loads, axis=0)
        if not moves.any():
            raise InputError(f"no site of the map on {where!r} can move: all of it is held.")
        placed = replace(
            found,
            points=member.at.placed(found.points),
            directions=found.directions @ R.T,
            loads=loads,
        )
        return *only(placed, elements, moves), count

    sites, elements, count = on_root(structure.comm, work)
    own = replace(sites, loads=structure.share.own(sites.loads))
    return own, elements, count, member.part.mesh.tdim
