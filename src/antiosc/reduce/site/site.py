"""`Site`: point and direction of an impact, and its load vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base._types import Array
from antiosc.base.checks import (
    flag,
    floats,
    is_rigid,
    positive,
    read_only,
    store,
    text,
    whole,
)
from antiosc.base.errors import InputError
from antiosc.base.texts import FieldsRepr
from antiosc.io.dof_map import component_of

#: The supports fix a site if less than this share of its load is on free dofs.
LEAST_FREE_SHARE = 1e-9


@dataclass(frozen=True)
class Site(FieldsRepr):
    """Point and direction of an impact on a structure.

    Parameters
    ----------
    point : sequence of 2 or 3 floats, or str
        Coordinates in m; any point of the structure, on or off the nodes. A text names a group (in
        an assembly "part:group"): its point, or the point next to the centroid of its entities. In
        an assembly it may also be a reference point, or "part:site" of a superelement.
    face : str, optional
        In place of a point: a group of faces ("face 12", "hole 6 mm (1)", in an assembly "part:face
        12"). The site is its point next to its centroid, and the direction is by default that into
        the part.
    direction : sequence of 2 or 3 floats
        The direction in which the impactor pushes; need not be a unit vector.
    radius : float, optional
        Radius in m of a patch with Hertz's pressure √(1 − r²/a²) on the surface around the
        point; force and displacement are both weighted by it. None: a point on a beam and on a
        solid (on a solid the compliance of a point then diverges with mesh refinement), and on a
        shell a patch with the thickness as radius. With this radius the shell has the compliance of
        a solid without the half-space compliance of the patch.
    snap : bool or float
        Move a point that is off the structure to the nearest point of the structure: True by at
        most 2 % of the part's size or one element, a number by at most this length in m.
    dof : int or str
        For matrices, instead of point and direction: the number of the dof at the site. With
        `node`: "x", "y", "z", "rx", "ry", "rz" or the number of the dof at the node.
    node : int
        The number of a node in the file of a mesh or a deck, with `direction`. For matrices with a
        map of their nodes and dofs, with `dof` or `direction`.
    vector : array_like (n,)
        For matrices: any load vector b.
    part : str, optional
        For assemblies: the part that is struck. By default the nearest one, and of parts that touch
        the one whose surface faces the impactor.
    tangential : bool
        For a named site (`extract(part, {name: Site})`): the model contains its displacements
        across `direction` too, two of them (one in a plane structure), as a contact with friction
        needs. They are weighted over the patch as the normal one; its compliance remains in them.
    """

    point: Sequence[float] | str | None = None
    direction: Sequence[float] | None = None
    radius: float | None = None
    snap: bool | float = False
    dof: int | str | None = None
    vector: ArrayLike | None = None
    part: str | None = None
    tangential: bool = False
    node: int | None = None
    face: str | None = None

    def __post_init__(self) -> None:
        if self.face is not None:
            if self.point is not None:
                raise InputError("a Site takes a point or a face; got both.")
            store(self, face=text("face", self.face), point=self.face)
        places_given = [self.point is not None, self.dof is not None, self.vector is not None]
        at_node = self.node is not None
        if (places_given[0] or places_given[2]) if at_node else sum(places_given) != 1:
            raise InputError("a Site needs one of: point with direction, dof, vector, or node.")
        if at_node:
            store(self, node=whole("node", self.node))
            if places_given[1] == (self.direction is not None):
                raise InputError("a Site at a node needs one of: dof, as 'z', or direction.")
        if self.radius is not None:
            store(self, radius=positive("radius", self.radius, "m"))
        if isinstance(self.snap, bool) or not isinstance(self.snap, Real):
            store(self, snap=flag("snap", self.snap))
        else:
            store(self, snap=inf if is_rigid(self.snap) else positive("snap", self.snap, "m"))
        store(self, tangential=flag("tangential", self.tangential))
        if self.tangential and self.direction is None and self.face is None:
            raise InputError("tangential directions need a Site with a direction.")
        if at_node and self.dof is not None:
            store(self, dof=component_of(self.dof))
        elif self.dof is not None:
            store(self, dof=whole("dof", self.dof, least=0))
        if self.vector is not None:
            store(self, vector=read_only(floats("vector", self.vector, (None,))))
        if self.part is not None:
            store(self, part=text("part", self.part))
            if self.point is None:
                raise InputError("part names the part of an assembly on which a point lies.")
        if self.point is None and not (at_node and self.direction is not None):
            return
        if self.direction is None and self.face is not None:
            return
        if self.direction is None:
            raise InputError("a Site at a point needs the direction of impact, as (0, 0, -1).")
        direction = floats("direction", self.direction, (None,))
        is_named = isinstance(self.point, str) or at_node
        point = direction if is_named else floats("point", self.point, (None,))
        if len(point) not in (2, 3) or len(point) != len(direction):
            raise InputError(
                f"point and direction must both have 2 or 3 coordinates; got {len(point)} and "
                f"{len(direction)}."
            )
        if not np.linalg.norm(direction):
            raise InputError(
                "direction must not be the zero vector: it is the direction in which the impactor "
                "pushes."
            )
        store(self, direction=tuple(direction.tolist()))
        if not at_node:
            store(self, point=text("point", self.point) if is_named else tuple(point.tolist()))


def tangents(directions: Array, plane: bool) -> list[Array]:
    """Unit vectors (P, 3) perpendicular to the directions (P, 3): two arrays; one in a plane."""
    if plane:
        return [np.cross([0.0, 0.0, 1.0], directions)]
    # rounded, so that rounding errors do not decide between equally oblique axes
    helper_axis = np.argmin(np.abs(directions).round(6), axis=1)
    first = np.cross(np.eye(3)[helper_axis], directions)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return [first, np.cross(directions, first)]


def constrained(label: str) -> str:
    """Message that supports fix a site."""
    return (
        f"{label} is fixed by supports along the direction of impact: it cannot move; choose "
        "another point."
    )
