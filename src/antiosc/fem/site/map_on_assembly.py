"""The sites of a map on the parts of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse.linalg

from antiosc._types import Array
from antiosc.checks import coordinates
from antiosc.errors import InputError
from antiosc.fem.assembly.assembled import AssembledMatrices
from antiosc.fem.assembly.ends import group_end
from antiosc.fem.assembly.layout import Member
from antiosc.fem.mpi import on_root
from antiosc.fem.site.map_sites import (
    MapSites,
    joined,
    movable,
    on_structure,
    points_given,
    sites_on,
    targets,
)
from antiosc.fem.site.on_assembly import nearest_parts
from antiosc.fem.site.site import LEAST_FREE_SHARE


def sites_on_assembly(
    structure: AssembledMatrices,
    where: Any,
    direction: Sequence[float] | None,
    radius: float | None,
) -> MapSites:
    """The sites on surfaces of parts ("part") and on groups ("part:group"), or at points.

    None: the surfaces of all parts. InputError where none of a surface that is named can move.
    """

    def work() -> MapSites:
        names = targets(where)
        if where is None:
            members = structure.members()
            found = [_on_part(structure, m, None, direction, radius, m.name) for m in members]
            return movable(joined(found), None)
        if names is None:
            return _at_points(structure, where, direction, radius)
        return joined([movable(_named(structure, n, direction, radius), n) for n in names])

    found = on_root(structure.comm, work)
    return replace(found, sites=replace(found.sites, loads=structure.share.own(found.sites.loads)))


def _named(
    structure: AssembledMatrices,
    name: str,
    direction: Sequence[float] | None,
    radius: float | None,
) -> MapSites:
    """Sites on "part" or on "part:group"."""
    if ":" in name:
        member, group = group_end(structure.layout, "where", name)
        return _on_part(structure, member, group, direction, radius, name)
    (member,) = structure.members(name)
    return _on_part(structure, member, None, direction, radius, name)


def _at_points(
    structure: AssembledMatrices,
    where: Any,
    direction: Sequence[float] | None,
    radius: float | None,
) -> MapSites:
    """Sites at points of the assembly, each on the part that a `Site` there would strike."""
    points = points_given(where, direction)
    assert direction is not None  # points_given has seen to that
    along = _in_space(direction)
    members = structure.members()
    distance = np.min([m.closest(points).distance for m in members], axis=0)
    on_structure(points, distance, structure.layout.size)
    struck = nearest_parts(structure, points, along)
    found, order = [], []
    for member in members:
        own = np.flatnonzero([one is member for one in struck])
        if len(own):
            there = member.at.own(points[own])
            found.append(_on_part(structure, member, there, direction, radius, member.name))
            order.append(own[found[-1].kept])
    every = movable(joined(found), None)
    return every.taken(np.argsort(np.concatenate(order)))


def _on_part(
    structure: AssembledMatrices,
    member: Member,
    where: str | Array | None,
    direction: Sequence[float] | None,
    radius: float | None,
    name: str,
) -> MapSites:
    """Sites of a part, chosen in its own axes, returned in those of the assembly; perhaps none."""
    R = member.at.rotation
    if direction is None and not member.part.kind.outside:
        raise InputError(
            f"the part {member.name!r} has no outward normal, as no shell and no beam has: give "
            "the direction of impact, for instance direction=(0, 0, -1), or name other parts."
        )
    own = None if direction is None else (_in_space(direction) @ R).tolist()
    found = sites_on(member.part, where, own, radius)
    if not len(found.sites):
        return found
    sites = found.sites
    loads = (structure.T[member.rows].T @ sites.loads).tocsr()
    size = scipy.sparse.linalg.norm(loads, axis=0)
    moves = size > LEAST_FREE_SHARE * scipy.sparse.linalg.norm(sites.loads, axis=0)
    placed = replace(
        sites,
        points=member.at.placed(sites.points),
        directions=sites.directions @ R.T,
        loads=loads,
        weighted=None,
    )
    names = np.full(len(sites), name)
    return replace(found, sites=placed, names=names).only(moves)


def _in_space(direction: Sequence[float]) -> Array:
    """A direction with three components."""
    given = coordinates("direction", direction, "")
    return np.pad(given, (0, 3 - len(given)))
