"""`Site`: where and along which direction a structure is struck, as the functional b.

bᵀu is the displacement of the structure at the site along the direction of impact, and b the
load of a unit force there. `functional` makes it, on or off the nodes, for a point or for a
patch with Hertz's pressure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc.checks import array, flag, kept, positive, store, whole
from antiosc.errors import AccuracyWarning, InputError, warn
from antiosc.fem import locate
from antiosc.fem.algebra import Array, norm
from antiosc.fem.family import WeakForm
from antiosc.fem.load import at_points, on_face, on_sheet
from antiosc.fem.mesh import Mesh
from antiosc.fem.structure import Structure

#: Share of a patch's load on supports above which it is told.
PARTLY = 0.1
#: A point counts as on the structure up to this share of the structure's size.
ON_STRUCTURE = 1e-6
#: Radius of a shell's patch over its thickness, where none is given: that at which a plate yields
#: as a solid does without what its patch has of a half-space (demos/fidelity.py compares them).
SHEET_RADIUS = 1.0


@dataclass(frozen=True)
class Site:
    """The place and direction of an impact.

    Parameters
    ----------
    point : sequence of 2 or 3 floats
        Coordinates in m; any point of the structure, on or off the nodes.
    direction : sequence of 2 or 3 floats
        The direction in which the impactor pushes; any length.
    radius : float, optional
        Radius in m of a patch with Hertz's pressure √(1 − r²/a²) on the surface around the
        point; force and displacement are both weighted by it. None: on a beam a point; on a
        solid too, though it has no compliance that converges with the mesh; on a shell, where
        it has none either, a patch with the shell's thickness as radius, where it yields as a
        solid does without its half-space compliance.
    snap : bool
        Move a point off the structure to the nearest point of it.
    dof : int
        Instead of point and direction, for matrices: the number of the struck dof.
    vector : array_like (n,)
        The same, as any vector b.
    """

    point: Sequence[float] | None = None
    direction: Sequence[float] | None = None
    radius: float | None = None
    snap: bool = False
    dof: int | None = None
    vector: ArrayLike | None = None

    def __post_init__(self) -> None:
        given = [self.point is not None, self.dof is not None, self.vector is not None]
        if sum(given) != 1:
            raise InputError("a Site needs one of: point with direction, dof, or vector.")
        if self.radius is not None:
            store(self, radius=positive("radius", self.radius, "m"))
        store(self, snap=flag("snap", self.snap))
        if self.dof is not None:
            store(self, dof=whole("dof", self.dof, least=0))
        if self.vector is not None:
            store(self, vector=kept(array("vector", self.vector, (None,))))
        if self.point is None:
            return
        if self.direction is None:
            raise InputError(
                "a Site at a point needs the direction of impact, as direction=(0, 0, -1)."
            )
        point = array("point", self.point, (None,))
        direction = array("direction", self.direction, (None,))
        if len(point) not in (2, 3) or len(point) != len(direction):
            raise InputError(
                f"point and direction must both have 2 or 3 coordinates; got {len(point)} and "
                f"{len(direction)}."
            )
        if not direction.any():
            raise InputError(
                "direction must not be the zero vector: it is where the impactor pushes."
            )
        store(self, point=tuple(point.tolist()), direction=tuple(direction.tolist()))


@dataclass(frozen=True)
class Functional:
    """A site as the solver sees it."""

    #: b on the rows of this rank, zero on fixed dofs
    b: Array
    #: radius of the patch, m; None for a point
    radius: float | None = None
    #: the half-space compliance that a patch brings along, m/N (0 for a point)
    local_compliance: float = 0.0
    #: where the site really lies (3,), m, and along which unit vector it is struck
    point: Array | None = None
    direction: Array | None = None


def functional(structure: Structure, site: Site) -> Functional:
    """The vector b of `site` on `structure`.

    Raises
    ------
    InputError
        A point off the structure, a direction that the structure does not have, a patch that
        finds no surface, a site that the supports hold.
    """
    if site.point is None:
        return _algebraic(structure, site)
    if structure.mesh is None:
        raise InputError("matrices have no points: use Site(dof=i) or Site(vector=b).")
    mesh, form = structure.meshed()
    point, direction = _in_space(mesh, form, site.point, site.direction)
    place = locate.closest(mesh, point)
    _check_distance(mesh, site, place)
    radius, local = site.radius, 0.0
    if form.patch == "cells":
        radius = radius or structure.material_at(place).thickness * SHEET_RADIUS
        b, local = on_sheet(structure, radius, place, direction)
    elif radius is not None:
        b, local = on_face(structure, radius, place, direction)
    else:
        b = at_points(structure, [place], np.ones(1), direction)
        if form.patch:
            _warn_of_point(mesh, place)
    result = Functional(b, radius, local, place.x, direction)
    return _moving(structure, result, f"the site at {_text(place.x)}")


def _algebraic(structure: Structure, site: Site) -> Functional:
    first, last = structure.K.getOwnershipRange()
    n = structure.K.getSize()[0]
    if site.radius is not None:
        raise InputError("radius needs a mesh; a site given by dof or vector has none.")
    if site.vector is not None:
        b = array("vector", site.vector, (n,))[first:last]
    else:
        if site.dof is None or not 0 <= site.dof < n:
            raise InputError(f"dof must be a number from 0 to {n - 1}; got {site.dof!r}.")
        b = np.zeros(last - first)
        if first <= site.dof < last:
            b[site.dof - first] = 1.0
    return _moving(structure, Functional(b.copy()), "the site")


def _moving(structure: Structure, result: Functional, label: str) -> Functional:
    """`result` with b zero on the fixed dofs; InputError where nothing is left."""
    whole = norm(structure.comm, result.b)
    weight = _weight(structure, result.b)
    owned = structure.fixed[structure.fixed < len(result.b)]
    result.b[owned] = 0.0
    held = 1 - _weight(structure, result.b) / weight
    if norm(structure.comm, result.b) <= 1e-9 * whole:
        raise InputError(
            f"{label} is held by the supports along the direction of impact: it cannot move; "
            "strike a point that can."
        )
    if result.local_compliance and structure.comm.rank == 0 and held > PARTLY:
        warn(
            f"supports hold {held:.0%} of the patch: its half-space compliance does not hold "
            "there; move the site or take a smaller radius.",
            AccuracyWarning,
        )
    return result


def _weight(structure: Structure, b: Array) -> float:
    """Sum of the load's parts, all taken as positive."""
    return float(structure.comm.allreduce(np.abs(b).sum()))


def _in_space(
    mesh: Mesh, form: WeakForm, at: Sequence[float], along: Sequence[float] | None
) -> tuple[Array, Array]:
    """Point and unit direction with three coordinates."""
    assert along is not None  # Site has seen to that
    point, direction = np.zeros(3), np.zeros(3)
    point[: len(at)] = at
    direction[: len(along)] = along
    direction /= np.linalg.norm(direction)
    if "z" not in form.components and abs(direction[2]) > 1e-12:
        raise InputError(f"direction {tuple(along)} leaves the plane of {mesh.name}, which is 2-D.")
    return point, direction


def _check_distance(mesh: Mesh, site: Site, place: locate.Place) -> None:
    if place.distance > ON_STRUCTURE * mesh.extent() and not site.snap:
        raise InputError(
            f"the point {_text(site.point)} is {place.distance:.3g} m off the structure; its "
            f"nearest point is {_text(place.x)}: strike that, or use Site(..., snap=True)."
        )


def _text(point: Any) -> str:
    return "(" + ", ".join(f"{c:.6g}" for c in point) + ") m"


def _warn_of_point(mesh: Mesh, place: locate.Place) -> None:
    size = locate.size_at(mesh, place)
    if mesh.comm.rank == 0:
        warn(
            f"the compliance under a point load on a solid grows without limit as the mesh is "
            f"refined: give the site a radius, here for instance radius={size:.1g} (the element "
            f"there measures {size:.2g} m; its radius should not be smaller).",
            AccuracyWarning,
        )
