"""Unit loads as vectors b: bᵀu is the displacement of the site.

A load is a set of weighted points: one point, or the points of a rule for Hertz's pressure
√(1 − r²/a²) over a disc in the plane of the surface (over a segment, on the edge of a plane part),
projected along the normal onto the surface. All functions take arrays of P sites.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.fem.linalg import algebra
from antiosc.fem.mesh.surface import Contact, Faces
from antiosc.fem.platform import compat
from antiosc.fem.structure.meshed import MeshedStructure

#: Rings of a disc's rule beside those that its cells ask for, and the most there may be by the
#: dimension of the faces: with fewer the cells below would feel single forces.
RINGS, MOST_RINGS = 4, {1: 500, 2: 60}
#: A surface that rises by less than this share of the radius is flat; it may rise by the second.
FLAT_RISE, MOST_RISE = 1e-6, 0.5
#: Points of patches that are worked on at a time.
POINTS_AT_ONCE = 200_000


@dataclass(frozen=True, eq=False)
class Points:
    """Weighted points in cells of this rank, n of them.

    Attributes
    ----------
    site : (n,) the site to which each belongs.
    cell, X : (n,) cell of this rank and (n, tdim) reference coordinates in it.
    weight : (n,) share of the site's unit force.
    """

    site: IntArray
    cell: IntArray
    X: Array
    weight: Array

    @classmethod
    def joined(cls, parts: Sequence[Points]) -> Points:
        """All points of several sets."""
        columns = [[p.site, p.cell, p.X, p.weight] for p in parts]
        return cls(*(np.concatenate(each) for each in zip(*columns, strict=True)))


def disc(rings: int) -> tuple[Array, Array]:
    """(points (n, 2) of the unit disc, weights of sum 1) of Hertz's pressure.

    With s² = 1 − r² the weight s r dr of the pressure is s² ds: a Gauss rule in s is exact for
    polynomials in r², equidistant angles for the angular harmonics.
    """
    s, w = np.polynomial.legendre.leggauss(rings)
    s, w = (s + 1) / 2, w * ((s + 1) / 2) ** 2
    angles = np.pi * (np.arange(2 * rings) + 0.5) / rings  # none along an edge of the face
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.sqrt(1 - s**2)[:, None, None] * ring
    return points.reshape(-1, 2), np.repeat(w / w.sum(), len(angles)) / len(angles)


def segment(count: int) -> tuple[Array, Array]:
    """(points (n, 1) of [−1, 1], weights of sum 1) of the pressure √(1 − x²): Gauss–Chebyshev."""
    angles = np.pi * np.arange(1, count + 1) / (count + 1)
    weights = np.sin(angles) ** 2
    return np.cos(angles)[:, None], weights / weights.sum()


def patches(
    faces: Faces, points: Array, radii: Array, contact: Contact, taken: Sequence[Faces] = ()
) -> tuple[Points, Array]:
    """The weighted points of patches on this rank, and the share of each patch on its face (P,).

    The rules resolve the smaller of the patch and the faces under it. If an edge cuts a patch, its
    weights are scaled to a unit force. What lies on faces that are `taken` does not count.
    """
    size = np.where(np.isfinite(contact.smallest), contact.smallest, radii)
    rings = np.minimum(RINGS + np.ceil(4 * radii / size - 1e-6), MOST_RINGS[faces.dim])
    rings = rings.astype(int)
    flat = contact.rise <= FLAT_RISE * radii  # then few faces come into question for a point
    share = np.zeros(len(points))
    found = []
    for count, even in sorted({(int(n), bool(f)) for n, f in zip(rings, flat, strict=True)}):
        rule, weights = disc(count) if faces.dim == 2 else segment(4 * count)
        members = np.flatnonzero((rings == count) & (flat == even))
        rise = FLAT_RISE if even else MOST_RISE
        for part in np.array_split(members, 1 + len(members) * len(rule) // POINTS_AT_ONCE):
            own = _laid(faces, points, radii, contact.normals, part, rule, weights, rise, taken)
            share[part] = own[1]
            found.append(own[0])
    return Points.joined(found), share


def _laid(
    faces: Faces,
    points: Array,
    radii: Array,
    normals: Array,
    part: IntArray,
    rule: Array,
    weights: Array,
    rise: float,
    taken: Sequence[Faces],
) -> tuple[Points, Array]:
    """One rule laid on some of the sites; see `patches`."""
    comm = faces.mesh.comm
    normal = normals[part]
    # between axes that are equally oblique rounding must not decide how the rule is oriented
    least = np.argmin(np.abs(normal).round(6), axis=1)
    first = np.cross(normal, np.eye(3)[least])
    if rule.shape[1] == 1:
        first = np.cross(normal, [0.0, 0.0, 1.0])
    size = np.linalg.norm(first, axis=1, keepdims=True)
    first = first / np.where(size > 0, size, 1.0)
    axes = np.stack([first, np.cross(normal, first)], axis=1)[:, : rule.shape[1]]
    x = points[part, None] + radii[part, None, None] * np.einsum("qk,pkd->pqd", rule, axes)
    count = len(weights)
    line = x.reshape(-1, 3), np.repeat(normal, count, axis=0), rise * float(radii[part].max())
    face, xi, distance = faces.along(*line)
    ranks = np.array(comm.allgather(distance))
    on = np.isfinite(ranks).any(axis=0)
    for others in taken:
        on &= ~np.isfinite(comm.allgather(others.along(*line)[2])).any(axis=0)
    share = (np.tile(weights, len(part)) * on).reshape(len(part), count).sum(axis=1)
    mine = np.flatnonzero(on & (ranks.argmin(axis=0) == comm.rank))
    at = mine // count
    weight = np.tile(weights, len(part))[mine] / share[at]
    reference = faces.reference(face[mine], xi[mine])
    return Points(part[at], faces.cells[face[mine]], reference, weight), share


def loads(structure: MeshedStructure, points: Points, directions: Array) -> scipy.sparse.csr_matrix:
    """b of P sites as columns (rows of this rank, P), fixed dofs included: Σ w φ(X)·d.

    `directions` (P, 3) are the unit directions of the forces.
    """
    mesh, form = structure.mesh, structure.form
    rows, sites, values = [], [], []
    # one entry for each site and cell: the moments of its points with each basis function
    key, pair = np.unique(points.site * mesh.n_cells + points.cell, return_inverse=True)
    site, cell = key // mesh.n_cells, key % mesh.n_cells
    gather = scipy.sparse.csr_matrix(
        (points.weight, (pair.ravel(), np.arange(len(points.weight)))),
        shape=(len(key), len(points.weight)),
    )
    cells, index = np.unique(cell, return_inverse=True)
    for axis, name in enumerate("xyz"):
        force = directions[site, axis]
        if name not in form.components or not force.any():
            continue
        path = form.components[name]
        moments = gather @ compat.tabulate(form.space, path, points.X)
        rows.append(compat.cell_dofs(form.space, path, cells)[index.ravel()].ravel())
        sites.append(np.repeat(site, moments.shape[1]))
        values.append((moments * force[:, None]).ravel())
    return _columns(structure, rows, sites, values, len(directions))


def _columns(
    structure: MeshedStructure,
    rows: list[IntArray],
    sites: list[IntArray],
    values: list[Array],
    count: int,
) -> scipy.sparse.csr_matrix:
    """The sparse matrix of entries at dofs of this rank, ghosts included, sent to their owners."""
    size = algebra.rows(structure.K)
    row = np.concatenate([np.zeros(0, dtype=np.int32), *rows]).astype(np.int64)
    site = np.concatenate([np.zeros(0, dtype=int), *sites])
    value = np.concatenate([np.zeros(0), *values])
    ghost = row >= size
    sent = (compat.global_dofs(structure.form.space, row[ghost]), site[ghost], value[ghost])
    first = algebra.row_range(structure.K)[0]
    entries = [(row[~ghost], site[~ghost], value[~ghost])]
    for number, at, what in structure.comm.allgather(sent):
        mine = (number >= first) & (number < first + size)
        entries.append((number[mine] - first, at[mine], what[mine]))
    row, site, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    return scipy.sparse.csr_matrix((value, (row, site)), shape=(size, count))
