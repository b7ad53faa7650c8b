"""`Site`: where and along which direction a structure is struck, as the functional b.

bᵀu is the displacement of the structure at the site along the direction of impact, and b the
load of a unit force there. `functional` makes it, on or off the nodes, for a point or for a
patch with Hertz's pressure.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from numpy.typing import ArrayLike
from petsc4py import PETSc

from antiosc.checks import array, positive
from antiosc.errors import AntioscWarning, InputError
from antiosc.fem import compat, locate
from antiosc.fem.algebra import Array, norm
from antiosc.fem.compat import IntArray
from antiosc.fem.family import WeakForm
from antiosc.fem.mesh import Mesh
from antiosc.fem.structure import Structure

#: A point counts as on the structure up to this share of the structure's size.
ON_STRUCTURE = 1e-6
#: Facets whose normal turns from the site's by more than this cosine are around an edge.
SAME_FACE = 0.5
#: Radius of a shell's patch over its thickness, where none is given.
DISC_RADIUS = 0.5
#: A patch's point that lies off the sheet by more than this share of the radius is beyond its edge.
OFF_DISC = 0.05
#: Quadrature degree for the patch pressure, whose slope is infinite on the rim.
PATCH_DEGREE = 16


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
        it has none either, a patch as wide as the shell is thick (radius half the thickness).
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
            positive("radius", self.radius, "m")
        if self.point is None:
            return
        if self.direction is None:
            raise InputError(
                "a Site at a point needs the direction of impact, as direction=(0, 0, -1)."
            )
        dim = len(self.point)
        if dim not in (2, 3) or len(self.direction) != dim:
            raise InputError(
                f"point and direction must both have 2 or 3 coordinates; got {dim} and "
                f"{len(self.direction)}."
            )
        array("point", self.point, (dim,))
        if np.linalg.norm(array("direction", self.direction, (dim,))) == 0:
            raise InputError(
                "direction must not be the zero vector: it is where the impactor pushes."
            )


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
    #: size of the element there, m
    element_size: float = 0.0


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
    if structure.mesh is None or structure.form is None:
        raise InputError("matrices have no points: use Site(dof=i) or Site(vector=b).")
    point, direction = _in_space(structure.mesh, structure.form, site)
    place = locate.closest(structure.mesh, point)
    _check_distance(structure.mesh, site, place)
    if structure.form.patch == "cells":
        result = _disc(structure, site.radius, place, direction)
    elif site.radius is None:
        result = _point_load(structure, place, direction)
    else:
        result = _patch(structure, site.radius, place, direction)
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
    owned = structure.fixed[structure.fixed < len(result.b)]
    result.b[owned] = 0.0
    if norm(structure.comm, result.b) <= 1e-9 * whole:
        raise InputError(
            f"{label} is held by the supports along the direction of impact: it cannot move; "
            "strike a point that can."
        )
    return result


def _in_space(mesh: Mesh, form: WeakForm, site: Site) -> tuple[Array, Array]:
    """Point and unit direction with three coordinates."""
    assert site.point is not None and site.direction is not None
    point, direction = np.zeros(3), np.zeros(3)
    point[: len(site.point)] = site.point
    direction[: len(site.direction)] = site.direction
    direction /= np.linalg.norm(direction)
    if "z" not in form.components and abs(direction[2]) > 1e-12:
        raise InputError(
            f"direction {tuple(site.direction)} leaves the plane of {mesh.name}, which is 2-D."
        )
    return point, direction


def _check_distance(mesh: Mesh, site: Site, place: locate.Place) -> None:
    if place.distance > ON_STRUCTURE * mesh.extent() and not site.snap:
        raise InputError(
            f"the point {_text(site.point)} is {place.distance:.3g} m off the structure; its "
            f"nearest point is {_text(place.x)}: strike that, or use Site(..., snap=True)."
        )


def _text(point: Any) -> str:
    return "(" + ", ".join(f"{c:.6g}" for c in point) + ") m"


def _point_load(structure: Structure, place: locate.Place, direction: Array) -> Functional:
    mesh, form = structure.mesh, structure.form
    assert mesh is not None and form is not None
    b = _displacement(structure, [place], np.ones(1), direction)
    size = _size_at(mesh, place)
    if form.patch and mesh.comm.rank == 0:
        warnings.warn(
            f"the compliance under a point load on a solid grows without limit as the mesh is "
            f"refined: give the site a radius, here for instance radius={_rounded(size)} (the "
            f"element there measures {size:.2g} m; its radius should not be smaller).",
            AntioscWarning,
            stacklevel=4,
        )
    return Functional(b, None, 0.0, place.x, direction, size)


def _displacement(
    structure: Structure, places: Sequence[locate.Place], weights: Array, direction: Array
) -> Array:
    """The vector of Σ w_k u(x_k)·d, on the rows of this rank."""
    mesh, form = structure.mesh, structure.form
    assert mesh is not None and form is not None
    vector = structure.K.createVecRight()
    components = [
        (i, form.components[name]) for i, name in enumerate("xyz") if name in form.components
    ]
    for axis, path in components:
        dofmap = compat.subspace(form.space, path).dofmap
        for place, weight in zip(places, weights, strict=True):
            if mesh.comm.rank == place.rank:
                dofs = compat.global_dofs(form.space, dofmap.cell_dofs(place.cell))
                values = compat.tabulate(form.space, path, place.X.reshape(1, -1))[0]
                vector.setValues(
                    dofs, weight * direction[axis] * values, addv=PETSc.InsertMode.ADD_VALUES
                )
    vector.assemble()
    b = np.array(vector.array_r)
    vector.destroy()
    return b


def _size_at(mesh: Mesh, place: locate.Place) -> float:
    size = locate.cell_size(mesh, place.cell) if mesh.comm.rank == place.rank else 0.0
    return float(mesh.comm.bcast(size, root=place.rank))


def _disc(
    structure: Structure, radius: float | None, place: locate.Place, direction: Array
) -> Functional:
    """b = Σ w φ·d over points of a disc on the sheet, with the weights of Hertz's pressure.

    The points resolve the disc and the cells, whichever are smaller: a thin sheet's patch may lie
    inside one cell.
    """
    mesh = structure.mesh
    assert mesh is not None
    if radius is None:
        radius = structure.material_at(place).thickness * DISC_RADIUS
    size = _size_at(mesh, place)
    normal = locate.sheet_normal(mesh, place)
    offsets, weights = _hertz_disc(radius, normal, min(4 + int(np.ceil(4 * radius / size)), 24))
    places = [locate.closest(mesh, place.x + offset) for offset in offsets]
    found = np.array([p.x for p in places]) - place.x
    off = found - offsets
    off -= np.outer(off @ normal, normal)
    on_sheet = np.linalg.norm(off, axis=1) < OFF_DISC * radius
    share = float(weights[on_sheet].sum())
    weights = np.where(on_sheet, weights, 0.0) / share
    if share < 0.9 and mesh.comm.rank == 0:
        warnings.warn(
            f"an edge cuts the patch of radius {radius:g} m: only {share:.0%} of its load area lies "
            "on the sheet; move the site or take a smaller radius.",
            AntioscWarning,
            stacklevel=4,
        )
    b = _displacement(structure, places, weights, direction)
    local = structure.material_at(place).half_space_compliance(float(direction @ normal)) / radius
    return Functional(b, radius, local, place.x, direction, size)


def _hertz_disc(radius: float, normal: Array, rings: int) -> tuple[Array, Array]:
    """(offsets (n, 3) in the plane across `normal`, weights of sum 1) of Hertz's pressure.

    With s² = 1 − r²/a² the pressure's weight s r dr is s² ds: a Gauss rule in s is exact for
    polynomials in r², the equidistant angles for what turns with them.
    """
    s, w = np.polynomial.legendre.leggauss(rings)
    s, w = (s + 1) / 2, w * ((s + 1) / 2) ** 2
    angles = 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    ring = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(normal, first))
    offsets = radius * np.sqrt(1 - s**2)[:, None, None] * ring
    weights = np.repeat(w / w.sum(), len(angles)) / len(angles)
    return offsets.reshape(-1, 3), weights


def _rounded(size: float) -> str:
    return f"{size:.1g}"


def _patch(
    structure: Structure, radius: float, place: locate.Place, direction: Array
) -> Functional:
    """b = ∫ w φ·d dS / ∫ w dS with w = √(1 − |x − p|²/a²) on the face around p."""
    mesh, form = structure.mesh, structure.form
    assert mesh is not None and form is not None
    if form.patch is None:
        raise InputError(
            "a radius applies to solids and shells: under a beam's point load the compliance is "
            "finite, so leave radius=None."
        )
    facets, normal, size = _face(mesh, place, radius, direction)
    tags = dolfinx.mesh.meshtags(
        mesh.dolfinx, mesh.tdim - 1, facets, np.ones(len(facets), dtype=np.int32)
    )
    ds = ufl.Measure(
        "ds",
        domain=mesh.dolfinx,
        subdomain_data=tags,
        metadata={"quadrature_degree": PATCH_DEGREE},
    )(1)
    x = ufl.SpatialCoordinate(mesh.dolfinx)
    centre = compat.constant(mesh.dolfinx, place.x[: mesh.gdim])
    along = compat.constant(mesh.dolfinx, direction[: mesh.gdim])
    a = compat.constant(mesh.dolfinx, radius)
    inside = 1 - ufl.dot(x - centre, x - centre) / a**2
    weight = ufl.sqrt(ufl.max_value(inside, 0.0))
    total = compat.integrate(weight * ds, mesh.dolfinx)
    ideal = 2 / 3 * np.pi * radius**2 if mesh.tdim == 3 else np.pi / 2 * radius
    _check_patch(mesh, radius, size, total / ideal)
    b = compat.assemble_functional(weight * form.along(along) * ds, form.space) / total
    local = structure.material_at(place).half_space_compliance(float(direction @ normal)) / radius
    return Functional(b[: compat.local_size(form.space)], radius, local, place.x, direction, size)


def _face(
    mesh: Mesh, place: locate.Place, radius: float, direction: Array
) -> tuple[IntArray, Array, float]:
    """(exterior facets of the face around the site, its outward normal, their largest size).

    The face is the facets within the radius that look the same way as the one at the site:
    not the back of a thin part, nor around its edges.
    """
    facets = np.sort(compat.exterior_facets(mesh.dolfinx))
    x = mesh.dolfinx.geometry.x[compat.entity_vertices(mesh.dolfinx, mesh.tdim - 1)[facets]]
    normals = compat.facet_normals(mesh.dolfinx, facets)
    edges = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2)
    sizes, longest = edges.mean(axis=1), edges.max(axis=1, initial=0.0)
    gap = _distances(x, place.x)
    reach = min(mesh.comm.allgather(gap.min(initial=np.inf)))
    if reach > radius:
        raise InputError(
            f"the site lies about {reach:.2g} m inside the part, deeper than its radius "
            f"{radius:g} m: a patch needs a surface; give a point on it."
        )
    # On an edge the face that the impactor meets is the one that looks toward it.
    here = np.flatnonzero(gap <= reach + 0.25 * sizes)
    facing = normals[here] @ direction
    meets = (float(facing.min()), tuple(normals[here[facing.argmin()]])) if len(here) else (2.0, ())
    normal = np.array(min(mesh.comm.allgather(meets))[1])
    same = normals @ normal > SAME_FACE
    local = max(mesh.comm.allgather(float(sizes[same & (gap < radius)].max(initial=0.0))))
    # The sampled distances are a little long: take a margin, the weight is zero there anyway.
    chosen = same & (gap < radius + 0.5 * longest)
    return facets[chosen].astype(np.int32), normal, local


def _distances(x: Array, point: Array) -> Array:
    """Distances of a point to facets x (n, vertices, 3), sampled at a few points of each."""
    samples = np.random.default_rng(0).dirichlet(np.ones(x.shape[1]), 60)
    samples = np.vstack([np.eye(x.shape[1]), samples])
    near = np.full(len(x), np.inf)
    for weights in samples:
        near = np.minimum(near, np.linalg.norm(np.einsum("v,nvk->nk", weights, x) - point, axis=1))
    return near


def _check_patch(mesh: Mesh, radius: float, size: float, share: float) -> None:
    if share <= 0:
        raise InputError(
            f"the patch of radius {radius:g} m finds no surface: the facets there measure "
            f"{size:.3g} m; refine around the site, refine=[(point, {radius:g})]."
        )
    if mesh.comm.rank:
        return
    if size > 1.2 * radius:
        warnings.warn(
            f"the facets at the site measure {size:.2g} m, more than the radius {radius:g} m: the "
            f"patch is not resolved; read the geometry with refine=[(point, {radius:g})] or take "
            f"radius={size:.1g}.",
            AntioscWarning,
            stacklevel=5,
        )
    if share < 0.9:
        warnings.warn(
            f"an edge cuts the patch: only {share:.0%} of its load area lies on the face, so its "
            "half-space compliance does not hold; move the site or take a smaller radius.",
            AntioscWarning,
            stacklevel=5,
        )
