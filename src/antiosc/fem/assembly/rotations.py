"""The local rotation of a solid, half the curl of its displacement, as functionals."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.assembly.layout import Layout, Sparse
from antiosc.fem.structure.member import DISPLACEMENTS, Member


def curl(layout: Layout, member: Member, cell: IntArray, X: Array) -> Sparse:
    """½ ∇ × u (3P, n) in the axes of the assembly at X (P, tdim) in cells of a solid."""
    form = member.part.form
    _, J = member.part.mesh.geometry.at(cell, X)
    slopes = compat.tabulate_slopes(form.space, form.components["x"], X)  # (P, functions, tdim)
    gradient = np.einsum("pft,ptx->pfx", slopes, np.linalg.pinv(J))
    rows, columns, values = [], [], []
    first_row = 3 * np.arange(len(cell))[:, None]
    R = member.at.rotation
    for axis, name in enumerate(DISPLACEMENTS):
        path = form.components.get(name)
        if path is None:
            continue
        dofs = member.first + compat.cell_dofs(form.space, path, cell)
        # ½ ∇φ × e, turned into the axes of the assembly
        own = 0.5 * np.cross(gradient, np.eye(3)[axis]) @ R.T
        for c in range(3):
            rows.append(np.broadcast_to(first_row + c, dofs.shape).ravel())
            columns.append(dofs.ravel())
            values.append(own[:, :, c].ravel())
    where = np.concatenate(rows), np.concatenate(columns)
    result = layout.matrix(*where, np.concatenate(values), 3 * len(cell))
    result.eliminate_zeros()
    return result
