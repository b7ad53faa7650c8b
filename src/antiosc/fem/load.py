"""Unit loads as vectors b, bᵀu being the displacement that the load works on.

Three kinds: at points, over a patch of Hertz's pressure √(1 − r²/a²) on the face of a solid, and
over a disc with the same pressure on a sheet.
"""

from __future__ import annotations

from collections.abc import Sequence

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from antiosc.errors import AccuracyWarning, InputError, warn
from antiosc.fem import compat, locate
from antiosc.fem.algebra import Array
from antiosc.fem.compat import IntArray
from antiosc.fem.mesh import Mesh
from antiosc.fem.structure import Structure

#: Facets whose normal turns from the site's by more than this cosine are around an edge.
SAME_FACE = 0.5
#: A patch's point that lies off the sheet by more than this share of the radius is beyond its edge.
OFF_DISC = 0.05
#: Quadrature degree for the patch pressure, whose slope is infinite on the rim.
PATCH_DEGREE = 16


def at_points(
    structure: Structure, places: Sequence[locate.Place], weights: Array, direction: Array
) -> Array:
    """The vector of Σ w_k u(x_k)·d, on the rows of this rank."""
    mesh, form = structure.meshed()
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


def on_sheet(
    structure: Structure, radius: float, place: locate.Place, direction: Array
) -> tuple[Array, float]:
    """(b, half-space compliance in m/N) of a disc: b = Σ w φ·d over points of it.

    The points resolve the disc and the cells, whichever are smaller: a thin sheet's patch may lie
    inside one cell.
    """
    mesh, _ = structure.meshed()
    size = locate.size_at(mesh, place)
    normal = locate.sheet_normal(mesh, place)
    offsets, weights = hertz_disc(radius, normal, min(4 + int(np.ceil(4 * radius / size)), 24))
    places = [locate.closest(mesh, place.x + offset) for offset in offsets]
    found = np.array([p.x for p in places]) - place.x
    off = found - offsets
    off -= np.outer(off @ normal, normal)
    on_sheet = np.linalg.norm(off, axis=1) < OFF_DISC * radius
    share = float(weights[on_sheet].sum())
    weights = np.where(on_sheet, weights, 0.0) / share
    if share < 0.9 and mesh.comm.rank == 0:
        warn(
            f"an edge cuts the patch of radius {radius:g} m: only {share:.0%} of its load area "
            "lies on the sheet; move the site or take a smaller radius.",
            AccuracyWarning,
        )
    b = at_points(structure, places, weights, direction)
    return b, _half_space(structure, place, float(direction @ normal), radius)


def hertz_disc(radius: float, normal: Array, rings: int) -> tuple[Array, Array]:
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


def on_face(
    structure: Structure, radius: float, place: locate.Place, direction: Array
) -> tuple[Array, float]:
    """(b, half-space compliance in m/N) of a patch on the face around p.

    b = ∫ w φ·d dS / ∫ w dS with w = √(1 − |x − p|²/a²).
    """
    mesh, form = structure.meshed()
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
    own = b[: compat.local_size(form.space)]
    return own, _half_space(structure, place, float(direction @ normal), radius)


def _half_space(structure: Structure, place: locate.Place, cosine: float, radius: float) -> float:
    return float(structure.material_at(place).half_space_compliance(cosine) / radius)


def _face(
    mesh: Mesh, place: locate.Place, radius: float, direction: Array
) -> tuple[IntArray, Array, float]:
    """(exterior facets of the face around the site, its outward normal, their largest size).

    The face is the facets within the radius that look the same way as the one at the site:
    not the back of a thin part, nor around its edges.
    """
    facets, x, normals = mesh.outside
    around = [0, 1, 3, 2] if x.shape[1] == 4 else list(range(x.shape[1]))  # tensor order
    edges = np.linalg.norm(x[:, around] - np.roll(x[:, around], 1, axis=1), axis=2)
    sizes, longest = edges.mean(axis=1), edges.max(axis=1, initial=0.0)
    gap = _distances(x, place.x, radius)
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


def _distances(x: Array, point: Array, radius: float) -> Array:
    """Distances of a point to facets x (n, vertices, 3), sampled at a few points of each.

    inf for facets that lie farther off than the closest and than the radius by their own size.
    """
    centres = x.mean(axis=1)
    size = np.linalg.norm(x - centres[:, None], axis=2).max(axis=1, initial=0.0)
    away = np.linalg.norm(centres - point, axis=1)
    near = np.flatnonzero(away - 3 * size <= max(away.min(initial=np.inf), radius))
    samples = np.random.default_rng(0).dirichlet(np.ones(x.shape[1]), 60)
    samples = np.vstack([np.eye(x.shape[1]), samples])
    gap = np.full(len(x), np.inf)
    at = np.einsum("sv,nvk->nsk", samples, x[near])
    gap[near] = np.linalg.norm(at - point, axis=2).min(axis=1)
    return gap


def _check_patch(mesh: Mesh, radius: float, size: float, share: float) -> None:
    if share <= 0:
        raise InputError(
            f"the patch of radius {radius:g} m finds no surface: the facets there measure "
            f"{size:.3g} m; refine around the site, refine=[(point, {radius:g})]."
        )
    if mesh.comm.rank:
        return
    if size > 1.2 * radius:
        warn(
            f"the facets at the site measure {size:.2g} m, more than the radius {radius:g} m: the "
            f"patch is not resolved; read the geometry with refine=[(point, {radius:g})] or take "
            f"radius={size:.1g}.",
            AccuracyWarning,
        )
    if share < 0.9:
        warn(
            f"an edge cuts the patch: only {share:.0%} of its load area lies on the face, so its "
            "half-space compliance does not hold; move the site or take a smaller radius.",
            AccuracyWarning,
        )
