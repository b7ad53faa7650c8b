"""`Tie`: two surfaces, or edges, with meshes that do not match.

The displacement of one side, the follower, is the L2 projection of that of the other onto the
functions of its own mesh (mortar method; Bernardi, Maday, Patera 1994): with the functions φ of the
follower's nodes and ψ of the leader's, both integrated over the intersection of the surfaces,

    u_f = D⁻¹ M u_l,   D = ∫ φ φᵀ,   M = ∫ φ ψᵀ.

A state of constant stress passes through the tie, and the order of convergence is that of the
coarser side. Where nodes of the follower are fixed or follow another joint already, their test
functions are added to those of the adjacent nodes, so that the sum of all stays 1.

An edge of a shell on a face of a solid, which has no rotations: through the thickness t of the
shell, along its normal n, the displacement of the face is compared with a straight line, u(s) ≈ u₀
+ s g for |s| <= t/2 (least squares). The edge moves by u₀, and the fibre n of the shell turns with
g = θ × n: θ − (θ·n) n = n × g. The rotation about the normal is left to the shell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy.sparse
import scipy.spatial

from antiosc.base._types import Array, BoolArray, IntArray
from antiosc.base.checks import checked_by, point_text, positive
from antiosc.base.errors import InputError, warn
from antiosc.fem.assembly.joint import NAME, Constraints, Rows, TwoEnds, group_end
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.overlaps import FACING, Facets, Overlap, closest, on_faces, overlap
from antiosc.fem.structure import skew
from antiosc.io.matrices import DISPLACEMENTS, ROTATIONS

#: Surfaces lie on each other up to this share of the mean size of their faces.
GAP = 0.3
#: Fraction of a node's function that must lie on the other surface for the node to follow it.
COVERED = 0.3
#: Areas covered that differ by less than this share are equal: then the finer side follows.
EQUAL = 0.02
#: A surface that is covered more often than this has two layers.
TWICE = 1.2
#: Coefficients of a projection below this share of the largest are dropped: they decay fast.
ROUNDED_WEIGHT = 1e-13
#: A gap this share of the size of the assembly is rounding.
CLOSED = 1e-12


@dataclass(frozen=True)
class Tie(TwoEnds):
    """Two surfaces (or edges) that move together, with meshes that need not match.

    Parameters
    ----------
    a, b : str
        "part:group" of faces or of edges. Edges follow faces. Otherwise the follower is the side
        that the other covers to the larger share; if the shares are equal, the finer mesh. The
        edge of a shell on faces of a solid follows their displacement and rotation over its
        thickness; its rotation about its normal stays free.
    gap : float, optional
        Largest distance between them, m; default: 0.3 of the size of their faces. Across a gap the
        follower moves with the rotation of the other side.
    name : str, optional
        Name of the joint in messages.
    """

    gap: float | None = field(default=None, metadata=checked_by(positive, "m"))
    name: str | None = field(default=None, metadata=NAME)

    late: ClassVar[bool] = True

    def constraints(self, layout: Layout, held: Constraints, label: str) -> list[Rows]:
        """Constraints by which every free dof of the follower equals the displacement of the
        leader."""
        sides = [
            Facets(*group_end(layout, name, end)) for name, end in (("a", self.a), ("b", self.b))
        ]
        common = self._common(sides, label)
        self._warn_of_overlap(sides, common, label)
        unavailable = held.fixed.copy()
        for rows in held.rows:
            unavailable[rows.pivot[rows.pivot >= 0]] = True
        leader_side = _leader(sides, common)
        movable = [_movable(layout, side, common, k, unavailable) for k, side in enumerate(sides)]
        if not any(movable):
            unavailable = held.fixed  # both follow other joints: what is said twice is found later
        elif not movable[1 - leader_side] and sides[0].dim == sides[1].dim:
            leader_side = 1 - leader_side
        follower = sides[1 - leader_side]
        leader = sides[leader_side]
        if leader_side == 0:
            common = common.exchanged()
        return _projection(layout, follower, leader, common, unavailable, label)

    def _common(self, sides: Sequence[Facets], label: str) -> Overlap:
        dims = [side.dim for side in sides]
        if not set(dims) <= {1, 2}:
            kinds = {0: "points", 1: "edges", 2: "faces", 3: "cells"}
            raise InputError(
                f"{label} ties {kinds[dims[0]]} ({self.a!r}) to {kinds[dims[1]]} ({self.b!r}): "
                "a Tie takes groups of faces and of edges."
            )
        size = min(float(side.radii.mean()) for side in sides)
        gap = GAP * size if self.gap is None else self.gap
        if dims[0] == dims[1]:
            common = overlap(sides[0], sides[1], gap)
        else:
            edges, faces = sides if dims[0] == 1 else sides[::-1]
            common = on_faces(edges, faces, gap)
            common = common if dims[0] == 1 else common.exchanged()
        if not len(common.weight):
            distance = _distance(sides)
            raise InputError(
                f"{label} touches nothing: {self.a!r} and {self.b!r} have no area in common within "
                f"the gap of {gap:.3g} m; their faces are {distance:.3g} m apart at the nearest. "
                "Move a part (at=...) or give a larger gap."
            )
        return common

    def _warn_of_overlap(self, sides: Sequence[Facets], common: Overlap, label: str) -> None:
        """Warn of overlapping bodies: tied faces with equal outward normals."""
        a, b = (side.outward for side in sides)
        if a is None or b is None:
            return
        cosine = np.einsum("pc,pc->p", a[common.face[0]], b[common.face[1]])
        if common.weight @ cosine > FACING * common.weight.sum():
            warn(
                f"{label}: the outward normals of {self.a!r} and {self.b!r} point the same way, so "
                "that the parts overlap: move one of them (at=...), or name its opposite face."
            )


def _distance(sides: Sequence[Facets]) -> float:
    """Least distance between the corners of two sets of faces, m."""
    first, second = (side.corners.reshape(-1, 3) for side in sides)
    return float(scipy.spatial.cKDTree(first).query(second)[0].min())


def _leader(sides: Sequence[Facets], common: Overlap) -> int:
    """The leading side (0 or 1): the less covered one, or that with the larger faces."""
    if sides[0].dim != sides[1].dim:
        return int(np.argmax([side.dim for side in sides]))
    covered = common.weight.sum() / np.array([side.measure for side in sides])
    if covered.max() > TWICE:
        thick = int(np.argmax(covered))
        raise InputError(
            f"the group on {sides[1 - thick].member.name!r} lies over the one on "
            f"{sides[thick].member.name!r} twice: give one side of it, or a smaller gap."
        )
    if abs(covered[0] - covered[1]) > EQUAL:
        return int(np.argmin(covered))
    return int(np.argmax([side.radii.mean() for side in sides]))


def _movable(
    layout: Layout, side: Facets, common: Overlap, number: int, tied_dofs: BoolArray
) -> bool:
    """Whether a side (0 or 1) has a displacement that is neither fixed nor tied already."""
    phi = side.basis(common.face[number], common.xi[number])
    nodes = np.flatnonzero(np.diff(phi.tocsc().indptr))
    form = side.member.part.form
    return any(
        not tied_dofs[layout.dofs(side.member, nodes, name)].all()
        for name in DISPLACEMENTS
        if name in form.components
    )


def _projection(
    layout: Layout,
    follower: Facets,
    leader: Facets,
    common: Overlap,
    tied_dofs: BoolArray,
    label: str,
) -> list[Rows]:
    """Rows u_f − D⁻¹ M u_l = 0 for every component of the follower, by L2 projection."""
    phi = follower.basis(common.face[0], common.xi[0])
    nodes = np.flatnonzero(np.diff(phi.tocsc().indptr))
    phi = phi[:, nodes]
    weight = scipy.sparse.diags(common.weight)
    D = (phi.T @ weight @ phi).tocsr()
    full = _squared_functions(follower, nodes)
    is_covered = D.diagonal() > COVERED * full
    if not is_covered.any():
        raise InputError(
            f"{label}: too little of the surfaces lies on each other for a single node to follow "
            f"({common.weight.sum():.3g} m² in common); give groups that cover each other."
        )
    projection = _Projection(D, phi.T @ weight)
    on_solid = follower.is_edge_of_sheet and not leader.member.has_rotations
    constraints: list[Rows] = []
    if on_solid:
        displacements, rotated, normals = led_by_solid(layout, follower, leader, common, label)
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
    if not constraints:
        raise InputError(
            f"{label} does nothing: all nodes of the surface on {follower.member.name!r} are fixed "
            "or follow other joints."
        )
    return constraints


@dataclass(frozen=True, eq=False)
class _Projection:
    """The L2 projection onto the functions of the follower's nodes."""

    D: Sparse  # (nodes, nodes) ∫ φ φᵀ
    load: Sparse  # (nodes, points) φ times the weights of the points

    def component(self, free: BoolArray, motion: Sparse, layout: Layout, dofs: IntArray) -> Sparse:
        """One component of the free nodes as functionals of the leader's motion.

        `motion` (points, n): that component of the leader. The other nodes keep `dofs`, their dofs.
        """
        spread, inverse = self._inverted(free)
        right = spread @ self.load @ motion
        fixed_columns = (spread @ self.D).tocsc()[:, ~free]
        if fixed_columns.nnz:
            right = right - fixed_columns @ layout.units(dofs[~free])
        return _dense_product(inverse, right.tocsr())

    def of(self, free: BoolArray, motion: Sparse) -> Sparse:
        """The projection (3 · free nodes, n) of vectors (3 · points, n), all nodes included."""
        inverse = np.linalg.inv(self.D.toarray())[free]
        parts = [_dense_product(inverse, (self.load @ motion[c::3]).tocsr()) for c in range(3)]
        order = np.arange(3 * int(free.sum())).reshape(3, -1).T.ravel()
        return scipy.sparse.vstack(parts).tocsr()[order]

    def _inverted(self, free: BoolArray) -> tuple[Sparse, Array]:
        """(dual test functions of the free nodes, inverse of their mass matrix D)."""
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
    """[(components, the leader's motion)] at the quadrature points of the follower."""
    member = leader.member
    cell = leader.cells[common.face[1]]
    X = leader.reference(common.face[1], common.xi[1])
    displacements = layout.at_points(member, cell, X, DISPLACEMENTS)
    arm = common.x[0] - common.x[1]
    both_turn = follower.member.has_rotations and member.has_rotations
    rotations = layout.nothing(3 * len(cell))
    if np.abs(arm).max() > CLOSED * layout.size:
        rotations = (
            layout.at_points(member, cell, X, ROTATIONS)
            if member.has_rotations
            else layout.curl(member, cell, X)
        )
        levers = [Sparse(-lever) for lever in skew(arm)]  # θ → θ × r
        lever = scipy.sparse.block_diag(levers, format="csr")
        displacements = displacements + lever @ rotations
    elif both_turn:
        rotations = layout.at_points(member, cell, X, ROTATIONS)
    return [
        (DISPLACEMENTS, displacements.tocsr()),
        *([(ROTATIONS, rotations)] if both_turn else []),
    ]


def _squared_functions(side: Facets, nodes: IntArray) -> Array:
    """∫ φ² over all faces of a side, for the shape function φ of each of `nodes`: (nodes,)."""
    face, xi, weight = side.rule()
    phi = side.basis(face, xi)[:, nodes]
    return np.asarray(phi.multiply(phi).T @ weight).ravel()


def _dense_product(inverse: Array, functionals: Sparse) -> Sparse:
    """inverse · functionals, without entries that are rounding."""
    used_columns = np.unique(functionals.indices)
    values = inverse @ functionals[:, used_columns].toarray()
    values[np.abs(values) < ROUNDED_WEIGHT * np.abs(values).max(initial=0.0)] = 0.0
    row, column = np.nonzero(values)
    shape = functionals.shape
    return scipy.sparse.csr_matrix((values[row, column], (row, used_columns[column])), shape=shape)


#: Points through the thickness.
LAYERS = 5
#: Part of the thickness by which a point may lie off the face.
OFF = 0.05
#: Least share of the second moment of the whole thickness that must lie on the face.
ENOUGH = 0.1


def led_by_solid(
    layout: Layout, edge: Facets, face: Facets, common: Overlap, label: str
) -> tuple[Sparse, Sparse, Array]:
    """Displacement u₀ (3Q, n), n × g (3Q, n) and normals (Q, 3) of a solid's face along an edge of
    a shell.

    u₀ + z g is the linear fit of the face's displacement over the thickness of the shell.
    """
    normals, thickness = _sheet(edge, common)
    s, w = np.polynomial.legendre.leggauss(LAYERS)
    points = common.x[0]
    count = len(common.weight)
    height = thickness[:, None] / 2 * s
    x = points[:, None] + height[..., None] * normals[:, None]
    distances = np.linalg.norm(common.x[0] - common.x[1], axis=1)
    reach = float(distances.max() + OFF * thickness.max())
    face_of_point, xi, y = closest(face, x.reshape(-1, 3), reach)
    offset = np.where(np.isfinite(y), y, 0.0).reshape(x.shape) - x
    heights = np.abs(np.einsum("qld,qd->ql", offset, normals))
    on_face = np.isfinite(y[:, 0]).reshape(count, LAYERS)
    weight = w / 2 * (on_face & (heights <= OFF * thickness[:, None]))
    total = weight.sum(axis=1)
    middle = (weight * height).sum(axis=1) / np.where(total > 0, total, 1.0)
    second = (weight * (height - middle[:, None]) ** 2).sum(axis=1)
    if (second < ENOUGH * thickness**2 / 12).any():
        k = int(np.argmin(second / thickness**2))
        raise InputError(
            f"{label}: at {point_text(points[k])} too little of the shell's thickness of "
            f"{thickness[k]:.3g} m lies on the face of {face.member.name!r} to hold its rotation; "
            "give all faces that it ends on."
        )
    slope = weight * (height - middle[:, None]) / second[:, None]
    mean = weight / total[:, None] - middle[:, None] * slope
    displacement = layout.at_points(
        face.member, face.cells[face_of_point], face.reference(face_of_point, xi), DISPLACEMENTS
    )
    u0 = _layer_sums(mean, np.broadcast_to(np.eye(3), (count, 3, 3))) @ displacement
    rotated = _layer_sums(slope, skew(normals)) @ displacement
    return u0.tocsr(), rotated.tocsr(), normals


def _sheet(edge: Facets, common: Overlap) -> tuple[Array, Array]:
    """(unit normals (Q, 3), thickness (Q,)) of the shell at points of its edge."""
    member = edge.member
    mesh = edge.member.part.mesh
    cells = edge.cells[common.face[0]]
    _, J = mesh.geometry.at(cells, edge.reference(common.face[0], common.xi[0]))
    raw_normals = np.cross(J[:, :, 0], J[:, :, 1]) @ member.at.rotation.T
    normals = raw_normals / np.linalg.norm(raw_normals, axis=1, keepdims=True)
    thickness = np.array([material.section.thickness for material, _ in member.part.parts])
    return normals, thickness[member.part.part_of_cells()[cells]]


def _layer_sums(factors: Array, matrices: Array) -> Sparse:
    """Matrix (3Q, 3QL) of the sums Σ_j factor_qj · matrix_q · u_qj over L layers."""
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
    """Constraints by which the rotations of nodes, but those about the normals, follow `motion`.

    `motion`: n × g, three values for each node.
    """
    member = edge.member
    dofs = np.column_stack([layout.dofs(member, nodes, name) for name in ROTATIONS])
    rows, pivots = [], []
    for i, normal in enumerate(normals):
        unit = normal / np.linalg.norm(normal)
        helper_axis = np.eye(3)[np.argmin(np.abs(unit))]
        first = np.cross(unit, helper_axis)
        E = np.vstack([first / np.linalg.norm(first), np.cross(unit, first)])
        axes = E @ member.at.rotation  # on the components of the part
        drilling = int(np.argmax(np.abs(unit @ member.at.rotation)))
        components = [c for c in range(3) if c != drilling]
        inverse = np.linalg.inv(axes[:, components])
        free_rows = scipy.sparse.csr_matrix(inverse @ axes) @ layout.units(dofs[i])
        right = scipy.sparse.csr_matrix(inverse @ E) @ motion[3 * i : 3 * i + 3]
        rows.append(free_rows - right)
        pivots += list(dofs[i, components])
    matrix = scipy.sparse.vstack(rows).tocsr()
    matrix.data[np.abs(matrix.data) < 1e-14 * np.abs(matrix.data).max()] = 0.0
    matrix.eliminate_zeros()
    return Rows(matrix, np.array(pivots), label)
