"""`Tie`: two surfaces, or edges, with meshes that do not match.

The displacement of one side, the follower, is the L2 projection of the other side's displacement
onto the follower's mesh (mortar method; Bernardi, Maday, Patera 1994). With the shape functions φ
of the follower and ψ of the leader, taken at nearest points and integrated over the follower's
faces,

    u_f = D⁻¹ M u_l,   D = ∫ φ φᵀ,   M = ∫ φ ψᵀ.

Linear displacements are followed exactly. A state of constant stress passes through the tie up to
the error of the quadrature, which does not resolve the kinks of ψ within a face. If nodes of the
follower are fixed or already follow another joint, their test functions are added to the adjacent
nodes' test functions, so that the sum of all stays 1.

A solid has no rotations. For an edge of a shell on its face, a straight line u(s) ≈ u₀ + s g is
fitted (least squares) to the displacement of the face through the thickness t of the shell, |s| <=
t/2 along its normal n. The edge moves by u₀, and the fibre n of the shell turns with g = θ × n:
θ − (θ·n) n = n × g. The rotation about the normal remains free.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import checked_by, point_text, positive
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import Constraints, Rows, TwoEnds
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.mesh.surface import Entities, foot_coordinates, largest_entities, pairs_within
from antiosc.fem.platform import compat
from antiosc.fem.structure import perpendiculars, skew
from antiosc.fem.structure.attachments import NAME_CHECK
from antiosc.fem.structure.meshed import Member
from antiosc.io.matrices import DISPLACEMENTS, ROTATIONS

#: Surfaces lie on each other up to this share of the mean radius of their faces (the finer side).
GAP_SHARE = 0.3
#: Fraction of a node's function that must lie on the other surface for the node to follow it.
COVERED_SHARE = 0.3
#: Areas covered that differ by less than this share are equal: then the finer side follows.
EQUAL_COVER = 0.02
#: Coefficients of a projection below this share of the largest are dropped: they decay fast.
ROUNDED_WEIGHT = 1e-13
#: A gap this share of the size of the assembly is rounding.
CLOSED_GAP = 1e-12


class Facets(Entities):
    """Entities of the largest dimension in a group of a part, in the assembly's axes."""

    def __init__(self, member: Member, group: str) -> None:
        self.member = member
        super().__init__(member.part.mesh, *largest_entities(member.part.mesh, group))
        self.corners = member.vertices[self.vertices]

    @cached_property
    def normals(self) -> Array:
        """Unit normals (faces, 3), or unit tangents of edges, at their middle."""
        _, J = self.at(np.arange(len(self)), self.middle)
        raw_normals = np.cross(J[:, :, 0], J[:, :, 1]) if self.dim == 2 else J[:, :, 0]
        return np.asarray(raw_normals / np.linalg.norm(raw_normals, axis=1, keepdims=True))

    @property
    def degree(self) -> int:
        """Total polynomial degree of the displacements on a face."""
        degree = self.member.part.form.degree
        return degree if self.simplex else 2 * degree

    def rule(self, pieces: int = 1) -> tuple[IntArray, Array, Array]:
        """(face, ξ, weight [m or m²]) of quadrature points; `pieces`: subdivisions of each edge."""
        shape = ("interval", "triangle" if self.simplex else "quadrilateral")[self.dim - 1]
        xi, w = compat.quadrature(shape, 2 * self.degree)
        xi = xi.reshape(len(w), self.dim)
        lattice = np.indices((pieces,) * self.dim).reshape(self.dim, -1).T[:, None]

        if shape == "triangle":  # upright pieces, and inverted ones between them
            inverted = lattice[lattice.sum(axis=2).ravel() < pieces - 1]
            upright = lattice[lattice.sum(axis=2).ravel() < pieces]
            xi = np.vstack([*(upright + xi), *(inverted + 1 - xi)]) / pieces
        else:
            xi = np.vstack([*(lattice + xi)]) / pieces

        w = np.tile(w, pieces**self.dim) / pieces**self.dim

        face = np.repeat(np.arange(len(self)), len(w))
        xi_of_faces = np.tile(xi, (len(self), 1))
        _, J = self.at(face, xi_of_faces)
        size = np.sqrt(np.linalg.det(np.einsum("nxd,nxe->nde", J, J)))
        return face, xi_of_faces, size * np.tile(w, len(self))

    def at(self, face: IntArray, xi: Array) -> tuple[Array, Array]:
        """(points x (n, 3) [m], dx/dξ (n, 3, dim)) at ξ (n, dim) in faces; assembly's axes."""
        x, J = super().at(face, xi)
        return self.member.at.placed(x), np.einsum("cx,nxd->ncd", self.member.at.rotation, J)

    def basis(self, face: IntArray, xi: Array) -> Sparse:
        """Values (n, nodes of the part) of the shape functions at ξ (n, dim) in faces (n,)."""
        form = self.member.part.form
        path = form.components["x"]
        weights = compat.tabulate(form.space, path, self.reference(face, xi))
        weights[np.abs(weights) < 1e-13] = 0.0
        nodes = compat.cell_dofs(form.space, path, self.cells[face]) // self.member.block
        row = np.repeat(np.arange(len(face)), nodes.shape[1])
        shape = len(face), len(self.member.nodes)
        result = scipy.sparse.csr_matrix((weights.ravel(), (row, nodes.ravel())), shape=shape)
        result.eliminate_zeros()
        return result


#: Faces whose normals have a smaller cosine do not lie on each other.
FACING_COSINE = 0.5
#: Pieces of an edge with a rule each: functions of the leader have kinks within them.
EDGE_PIECES, FACE_PIECES = 4, 3
#: Share of the radius of a face by which a point may lie beside the other surface.
BESIDE_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Overlap:
    """n quadrature points x on the follower of a tie, nearest points y on its leader."""

    face: IntArray  # (n,) of the follower
    xi: Array  # (n, dim) coordinates in it
    x: Array  # (n, 3) [m]
    leader_face: IntArray  # (n,)
    eta: Array  # (n, dim) coordinates in it
    y: Array  # (n, 3) [m]
    weight: Array  # (n,) [m or m²]
    share: float  # of the follower's length or area that lies on the leader, 0 to 1


def overlap(follower: Facets, leader: Facets, gap: float) -> Overlap:
    """The points of the follower that lie on the leader, at most `gap` [m] away."""
    face, xi, weight = follower.rule(EDGE_PIECES if follower.dim == 1 else FACE_PIECES)
    x = follower.at(face, xi)[0]
    leader_face, eta, y = nearest_on_faces(leader, x, gap)
    lies = np.linalg.norm(x - y, axis=1) <= gap

    if follower.dim == leader.dim:
        n = follower.normals[face]
        lies &= np.abs(np.einsum("nc,nc->n", n, leader.normals[leader_face])) > FACING_COSINE
        offset = np.where(lies[:, None], x - y, 0.0)
        along = np.linalg.norm(np.einsum("nc,nc->n", offset, n)[:, None] * n, axis=1)
        total = np.linalg.norm(offset, axis=1)
        beside = along if follower.dim == 1 else np.sqrt(np.maximum(total**2 - along**2, 0.0))
        lies &= beside <= BESIDE_SHARE * follower.radii[face]

    share = float(weight[lies].sum() / weight.sum())
    of_leader = leader_face[lies], eta[lies], y[lies]
    return Overlap(face[lies], xi[lies], x[lies], *of_leader, weight[lies], share)


def nearest_on_faces(faces: Facets, points: Array, reach: float) -> tuple[IntArray, Array, Array]:
    """(face (n,), ξ (n, dim), point (n, 3) [m]) nearest to each of `points` (n, 3). The point is
    infinite if no face is near; within `reach` [m] the nearest one is always found."""
    item, point = pairs_within(faces.centres, faces.radii + reach, points)
    xi = foot_coordinates(faces, item, points[point])
    x = faces.at(item, xi)[0]
    order = np.argsort(-np.linalg.norm(x - points[point], axis=1), kind="stable")
    face = np.zeros(len(points), dtype=int)
    xi_start = np.zeros((len(points), faces.dim))
    nearest = np.full((len(points), 3), np.inf)
    face[point[order]] = item[order]  # the nearest is written last
    xi_start[point[order]] = xi[order]
    nearest[point[order]] = x[order]
    return face, xi_start, nearest


@dataclass(frozen=True)
class Tie(TwoEnds):
    """Two surfaces (or edges) that move together, with meshes that need not match.

    Parameters
    ----------
    a, b : str
        "part:group" of faces or of edges. Edges follow faces. Otherwise the follower is the side
        with the larger share of its area covered; if the shares are equal, the finer mesh. The edge
        of a shell on faces of a solid follows their displacement and rotation over the shell's
        thickness; rotation about the normal stays free.
    gap : float, optional
        Largest distance between `a` and `b`, m; default: 0.3 of the mean radius of the faces (from
        their middle to their corners) of the finer side. Across a gap the follower moves as on
        rigid arms from the other side.
    name : name of the joint in messages, optional
    """

    gap: float | None = field(default=None, metadata=checked_by(positive, "m"))
    name: str | None = field(default=None, metadata=NAME_CHECK)

    late: ClassVar[bool] = True

    def constraints(self, layout: Layout, earlier: Constraints, label: str) -> list[Rows]:
        """Constraints that make the free dofs of the follower equal the leader's motion."""
        ends = ("a", self.a), ("b", self.b)
        sides = [Facets(*layout.group_end(name, end)) for name, end in ends]
        if not {side.dim for side in sides} <= {1, 2}:
            kinds = {0: "points", 1: "edges", 2: "faces", 3: "cells"}
            first, second = (kinds[side.dim] for side in sides)
            raise InputError(
                f"{label} ties {first} ({self.a!r}) to {second} ({self.b!r}): a Tie takes groups "
                "of faces and of edges."
            )

        tied = earlier.fixed.copy()
        for rows in earlier.rows:
            tied[rows.pivot[rows.pivot >= 0]] = True

        # if both follow other joints, what is said twice is found later
        orders = self._orders(sides, label)
        for unavailable in (tied, earlier.fixed):
            for follower, leader, common in orders:
                made = _projection_rows(layout, follower, leader, common, unavailable, label)
                if made:
                    return made

        raise InputError(
            f"{label} does nothing: too little of {self.a!r} and {self.b!r} lies on each other for "
            "a node to follow, or all nodes there are fixed or follow other joints."
        )

    def _orders(self, sides: list[Facets], label: str) -> list[tuple[Facets, Facets, Overlap]]:
        """Possible (follower, leader, overlap), the best first; InputError if there is none."""
        size = min(float(side.radii.mean()) for side in sides)
        gap = GAP_SHARE * size if self.gap is None else self.gap
        orders = [(a, b, overlap(a, b, gap)) for a, b in (sides, sides[::-1]) if a.dim <= b.dim]
        if not any(common.share for _, _, common in orders):
            raise InputError(
                f"{label} touches nothing: {self.a!r} and {self.b!r} have no area in common within "
                f"the gap of {gap:.3g} m. Move a part (at=...) or give a larger gap."
            )

        if len(orders) == 2:
            (a, b, of_a), (_, _, of_b) = orders
            alike = abs(of_a.share - of_b.share) <= EQUAL_COVER
            finer = a.radii.mean() < b.radii.mean()
            if not (finer if alike else of_a.share > of_b.share):
                orders.reverse()

        return orders


def _projection_rows(
    layout: Layout,
    follower: Facets,
    leader: Facets,
    common: Overlap,
    tied_dofs: BoolArray,
    label: str,
) -> list[Rows]:
    """Constraints: the follower's free dofs equal the L2 projection of the leader's motion.
    `tied_dofs` (n,): mask of the dofs of u that are not free. Empty if no node can follow."""
    phi = follower.basis(common.face, common.xi)
    nodes = np.flatnonzero(np.diff(phi.tocsc().indptr))
    phi = phi[:, nodes]
    weight = scipy.sparse.diags(common.weight)
    D = (phi.T @ weight @ phi).tocsr()
    face, xi, weights = follower.rule()
    squares = follower.basis(face, xi)[:, nodes].power(2)
    is_covered = D.diagonal() > COVERED_SHARE * (squares.T @ weights)
    projection = _Projection(D, phi.T @ weight)

    constraints: list[Rows] = []

    is_edge = follower.dim == 1 and follower.member.part.kind.sheet
    if is_edge and not leader.member.has_rotations and is_covered.any():
        displacements, rotated, normals = edge_on_solid(layout, follower, leader, common, label)
        leader_motions: list[tuple[tuple[str, ...], Sparse]] = [(DISPLACEMENTS, displacements)]
        rotations = [layout.dofs(follower.member, nodes, name) for name in ROTATIONS]
        free = is_covered & ~tied_dofs[rotations].any(axis=0)
        if free.any():
            rotation_functionals = projection.of(free, rotated)
            middle = projection.load[free] @ normals
            constraints.append(
                rotation_rows(layout, follower, nodes[free], middle, rotation_functionals, label)
            )
    else:
        leader_motions = _leader_motions(layout, follower, leader, common)

    for names, motion in leader_motions:
        for name, functional in layout.of_components(follower.member, names, motion):
            dofs = layout.dofs(follower.member, nodes, name)
            free = is_covered & ~tied_dofs[dofs]
            if free.any():
                projected = projection.component(free, functional, layout, dofs)
                row = layout.units(dofs[free]) - projected
                constraints.append(Rows(row.tocsr(), dofs[free], label))

    return constraints


@dataclass(frozen=True, eq=False)
class _Projection:
    """L2 projection onto the shape functions of the follower's nodes."""

    D: Sparse  # (nodes, nodes) ∫ φ φᵀ
    load: Sparse  # (nodes, points) φ times the weights of the points

    def component(self, free: BoolArray, motion: Sparse, layout: Layout, dofs: IntArray) -> Sparse:
        """Projection (free nodes, n) of one component of the leader's `motion` (points, n) onto the
        `free` nodes; `dofs`: dofs of this component at all nodes."""
        spread, inverse = self._inverted(free)
        right = spread @ self.load @ motion
        fixed_columns = (spread @ self.D).tocsc()[:, ~free]
        if fixed_columns.nnz:
            right = right - fixed_columns @ layout.units(dofs[~free])
        return _dense_product(inverse, right.tocsr())

    def of(self, free: BoolArray, motion: Sparse) -> Sparse:
        """Project the vectors `motion` (3 · points, n) onto all nodes; return the rows of the
        `free` nodes, (3 · free nodes, n)."""
        inverse = np.linalg.inv(self.D.toarray())[free]
        parts = [_dense_product(inverse, (self.load @ motion[c::3]).tocsr()) for c in range(3)]
        order = np.arange(3 * int(free.sum())).reshape(3, -1).T.ravel()
        return scipy.sparse.vstack(parts).tocsr()[order]

    def _inverted(self, free: BoolArray) -> tuple[Sparse, Array]:
        """(test functions of free nodes as sums (free, nodes), inverse of their mass matrix)."""
        identity = scipy.sparse.identity(len(free), format="csr")
        spread = identity[free]

        if not free.all():
            # test functions of the others go to the adjacent free nodes
            adjacent = self.D[~free][:, free]
            total = np.asarray(adjacent.sum(axis=1)).ravel()
            fraction = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)
            spread = spread + (scipy.sparse.diags(fraction) @ adjacent).T @ identity[~free]

        tested = (spread @ self.D).tocsc()[:, free]
        return spread.tocsr(), np.linalg.inv(tested.toarray())


def _leader_motions(
    layout: Layout, follower: Facets, leader: Facets, common: Overlap
) -> list[tuple[tuple[str, ...], Sparse]]:
    """[(components, motion (3Q, n) of the leader)] at the follower's Q quadrature points."""
    member = leader.member
    cell = leader.cells[common.leader_face]
    X = leader.reference(common.leader_face, common.eta)
    displacements = layout.at_points(member, cell, X, DISPLACEMENTS)
    arm = common.x - common.y
    both_turn = follower.member.has_rotations and member.has_rotations
    rotations = layout.zeros(3 * len(cell))

    if np.abs(arm).max() > CLOSED_GAP * layout.size:
        rotations = (
            layout.at_points(member, cell, X, ROTATIONS)
            if member.has_rotations
            else layout.half_curl(member, cell, X)
        )
        levers = [Sparse(-lever) for lever in skew(arm)]  # θ → θ × r
        lever = scipy.sparse.block_diag(levers, format="csr")
        displacements = displacements + lever @ rotations
    elif both_turn:
        rotations = layout.at_points(member, cell, X, ROTATIONS)

    of_rotations = [(ROTATIONS, rotations)] if both_turn else []
    return [(DISPLACEMENTS, displacements.tocsr()), *of_rotations]


def _dense_product(inverse: Array, functionals: Sparse) -> Sparse:
    """inverse (r, k) · functionals (k, n), without entries that are rounding."""
    used_columns = np.unique(functionals.indices)
    values = inverse @ functionals[:, used_columns].toarray()
    values[np.abs(values) < ROUNDED_WEIGHT * np.abs(values).max(initial=0.0)] = 0.0
    row, column = np.nonzero(values)
    shape = functionals.shape
    return scipy.sparse.csr_matrix((values[row, column], (row, used_columns[column])), shape=shape)


#: Points through the thickness.
THICKNESS_POINTS = 5
#: Part of the thickness by which a point may lie off the face.
OFF_FACE_SHARE = 0.05
#: Least share of the second moment of the whole thickness that must lie on the face.
LEAST_MOMENT_SHARE = 0.1


def edge_on_solid(
    layout: Layout, edge: Facets, face: Facets, common: Overlap, label: str
) -> tuple[Sparse, Sparse, Array]:
    """(u₀ (3Q, dofs), n × g (3Q, dofs), normals n (Q, 3)) at Q points of a shell's edge; u₀ + s g
    is fitted to the displacements of the solid's face at height s along n."""
    member = edge.member
    cells = edge.cells[common.face]
    _, J = member.part.mesh.geometry.at(cells, edge.reference(common.face, common.xi))
    normals = np.cross(J[:, :, 0], J[:, :, 1]) @ member.at.rotation.T
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    thickness = np.array([material.section.thickness for material, _ in member.part.parts])
    thickness = thickness[member.part.part_of_cells()[cells]]

    s, w = np.polynomial.legendre.leggauss(THICKNESS_POINTS)
    points = common.x
    count = len(common.weight)
    height = thickness[:, None] / 2 * s
    x = points[:, None] + height[..., None] * normals[:, None]
    distances = np.linalg.norm(common.x - common.y, axis=1)
    reach = float(distances.max() + OFF_FACE_SHARE * thickness.max())
    face_of_point, xi, y = nearest_on_faces(face, x.reshape(-1, 3), reach)
    offset = np.where(np.isfinite(y), y, 0.0).reshape(x.shape) - x
    heights = np.abs(np.einsum("qld,qd->ql", offset, normals))
    on_face = np.isfinite(y[:, 0]).reshape(count, THICKNESS_POINTS)
    weight = w / 2 * (on_face & (heights <= OFF_FACE_SHARE * thickness[:, None]))
    total = weight.sum(axis=1)
    middle = (weight * height).sum(axis=1) / np.where(total > 0, total, 1.0)

    second = (weight * (height - middle[:, None]) ** 2).sum(axis=1)
    if (second < LEAST_MOMENT_SHARE * thickness**2 / 12).any():
        k = int(np.argmin(second / thickness**2))
        raise InputError(
            f"{label}: at {point_text(points[k])} too little of the shell's thickness of "
            f"{thickness[k]:.3g} m lies on the face of {face.member.name!r} to hold its rotation; "
            "give all faces that it ends on."
        )

    slope = weight * (height - middle[:, None]) / second[:, None]
    mean = weight / total[:, None] - middle[:, None] * slope
    X = face.reference(face_of_point, xi)
    displacement = layout.at_points(face.member, face.cells[face_of_point], X, DISPLACEMENTS)
    u0 = _layer_sums(mean, np.broadcast_to(np.eye(3), (count, 3, 3))) @ displacement
    rotated = _layer_sums(slope, skew(normals)) @ displacement
    return u0.tocsr(), rotated.tocsr(), normals


def _layer_sums(factors: Array, matrices: Array) -> Sparse:
    """Matrix (3Q, 3QL) of the sums Σ_j factors_qj · matrices_q · u_qj over L layers, at Q points;
    `factors` (Q, L), `matrices` (Q, 3, 3)."""
    count, layers = factors.shape
    values = np.einsum("qj,qab->qajb", factors, matrices)
    row = 3 * np.arange(count)[:, None, None, None] + np.arange(3)[None, :, None, None]
    column = (
        3 * (layers * np.arange(count)[:, None] + np.arange(layers))[:, None, :, None]
        + np.arange(3)[None, None, None, :]
    )
    row, column = np.broadcast_arrays(row, column)
    entries = (values.ravel(), (row.ravel(), column.ravel()))
    return scipy.sparse.csr_matrix(entries, shape=(3 * count, 3 * count * layers))


def rotation_rows(
    layout: Layout,
    edge: Facets,
    nodes: IntArray,
    normals: Array,
    motion: Array | Sparse,
    label: str,
) -> Rows:
    """Constraints: the rotations of P nodes across `normals` (P, 3), of any length, follow `motion`
    (3P, n), which is n × g of `edge_on_solid`; rotations about the normals stay free."""
    member = edge.member
    dofs = np.column_stack([layout.dofs(member, nodes, name) for name in ROTATIONS])
    units = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    E = perpendiculars(units)

    # the part's component about the normal stays free
    axes = E @ member.at.rotation
    drilling = np.abs(units @ member.at.rotation).argmax(axis=1)
    led = np.array([(1, 2), (0, 2), (0, 1)])[drilling]
    inverse = np.linalg.inv(np.take_along_axis(axes, led[:, None], axis=2))

    turned, across_normals = (
        scipy.sparse.block_diag([Sparse(block) for block in blocks], "csr")
        for blocks in (inverse @ axes, inverse @ E)
    )
    rotations = turned @ layout.units(dofs.ravel())
    followed = across_normals @ Sparse(motion)
    matrix = (rotations - followed).tocsr()
    matrix.data[np.abs(matrix.data) < 1e-14 * np.abs(matrix.data).max()] = 0.0
    matrix.eliminate_zeros()
    return Rows(matrix, np.take_along_axis(dofs, led, axis=1).ravel(), label)
