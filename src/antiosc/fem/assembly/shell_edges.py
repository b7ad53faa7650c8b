"""An edge of a shell tied to a face of a solid, which has no rotations.

Through the thickness t of the shell, along its normal n, the displacement of the face is compared
with a straight line, u(s) ≈ u₀ + s g for |s| <= t/2 (least squares). The edge moves by u₀, and the
fibre n of the shell turns with g = θ × n: θ − (θ·n) n = n × g. The rotation about the normal is
left to the shell.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse

from antiosc.base._types import Array, IntArray
from antiosc.base.checks import in_words
from antiosc.base.errors import InputError
from antiosc.fem.assembly.joint import Rows
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.assembly.overlaps import Facets, Overlap, closest
from antiosc.fem.structure.meshed import DISPLACEMENTS, ROTATIONS
from antiosc.fem.structure.placement import skew

#: Points through the thickness.
LAYERS = 5
#: Part of the thickness by which a point may lie off the face.
OFF = 0.05
#: Least share of the second moment of the whole thickness that must lie on the face.
ENOUGH = 0.1


def led_by_solid(
    layout: Layout, edge: Facets, face: Facets, common: Overlap, label: str
) -> tuple[Sparse, Sparse, Array]:
    """(u₀ (3Q, n), n × g (3Q, n), normals (Q, 3)) at the points of an edge."""
    normals, thickness = _sheet(edge, common)
    s, w = np.polynomial.legendre.leggauss(LAYERS)
    points, count = common.x[0], len(common.weight)
    height = thickness[:, None] / 2 * s
    x = points[:, None] + height[..., None] * normals[:, None]
    apart = np.linalg.norm(common.x[0] - common.x[1], axis=1)
    reach = float(apart.max() + OFF * thickness.max())
    on, xi, y = closest(face, x.reshape(-1, 3), reach)
    beside = np.where(np.isfinite(y), y, 0.0).reshape(x.shape) - x
    along = np.abs(np.einsum("qld,qd->ql", beside, normals))
    there = np.isfinite(y[:, 0]).reshape(count, LAYERS)
    weight = w / 2 * (there & (along <= OFF * thickness[:, None]))
    total = weight.sum(axis=1)
    middle = (weight * height).sum(axis=1) / np.where(total > 0, total, 1.0)
    second = (weight * (height - middle[:, None]) ** 2).sum(axis=1)
    if (second < ENOUGH * thickness**2 / 12).any():
        k = int(np.argmin(second / thickness**2))
        raise InputError(
            f"{label}: at {in_words(points[k])} too little of the shell's thickness of "
            f"{thickness[k]:.3g} m lies on the face of {face.member.name!r} to hold its rotation; "
            "give all faces that it ends on."
        )
    slope = weight * (height - middle[:, None]) / second[:, None]
    mean = weight / total[:, None] - middle[:, None] * slope
    moved = layout.at_points(face.member, face.cells[on], face.reference(on, xi), DISPLACEMENTS)
    u0 = _combined(mean, np.broadcast_to(np.eye(3), (count, 3, 3))) @ moved
    rotated = _combined(slope, skew(normals)) @ moved
    return u0.tocsr(), rotated.tocsr(), normals


def _sheet(edge: Facets, common: Overlap) -> tuple[Array, Array]:
    """(unit normals (Q, 3), thickness (Q,)) of the shell at points of its edge."""
    member, mesh = edge.member, edge.member.part.mesh
    cells = edge.cells[common.face[0]]
    _, J = mesh.geometry.at(cells, edge.reference(common.face[0], common.xi[0]))
    across = np.cross(J[:, :, 0], J[:, :, 1]) @ member.at.rotation.T
    normals = across / np.linalg.norm(across, axis=1, keepdims=True)
    own = np.array([material.section.thickness for material, _ in member.part.parts])
    return normals, own[member.part.part_of_cells()[cells]]


def _combined(factors: Array, matrices: Array) -> Sparse:
    """Σ_j factor_qj · (matrix_q) u_j for points q with layers j, as a matrix (3Q, 3QL)."""
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
    led: Array | Sparse,
    label: str,
) -> Rows:
    """Two rotations of each node follow `led` (3 functionals of each node, n × g)."""
    member = edge.member
    dofs = np.column_stack([layout.dofs(member, nodes, name) for name in ROTATIONS])
    rows, pivots = [], []
    for i, normal in enumerate(normals):
        unit = normal / np.linalg.norm(normal)
        least = np.eye(3)[np.argmin(np.abs(unit))]
        first = np.cross(unit, least)
        E = np.vstack([first / np.linalg.norm(first), np.cross(unit, first)])
        own = E @ member.at.rotation  # on the components of the part
        drilling = int(np.argmax(np.abs(unit @ member.at.rotation)))
        others = [c for c in range(3) if c != drilling]
        inverse = np.linalg.inv(own[:, others])
        left = scipy.sparse.csr_matrix(inverse @ own) @ layout.units(dofs[i])
        right = scipy.sparse.csr_matrix(inverse @ E) @ led[3 * i : 3 * i + 3]
        rows.append(left - right)
        pivots += list(dofs[i, others])
    matrix = scipy.sparse.vstack(rows).tocsr()
    matrix.data[np.abs(matrix.data) < 1e-14 * np.abs(matrix.data).max()] = 0.0
    matrix.eliminate_zeros()
    return Rows(matrix, np.array(pivots), label)
