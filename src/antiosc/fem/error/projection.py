"""The L2 projection of cell-wise fields to continuous functions of degree one on some cells.

The mass matrix of degree one is consistent, and is solved by conjugate gradients: with its diagonal
as the preconditioner its condition number is at most (d + 2) on simplices and 3^d on products of
intervals, whatever the mesh (Wathen, IMA J. Numer. Anal. 7 (1987) 449). No form is compiled.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse

from antiosc._types import Array, IntArray
from antiosc.errors import NotConvergedError
from antiosc.fem import compat
from antiosc.fem.error.cell_strains import Quadrature

#: Relative residual at which the solve ends (the energies lose the square of it), and most steps.
RESIDUAL, MOST_STEPS = 1e-6, 200


class Projection:
    """Continuous functions of degree one on `cells` (of this rank, owned) of a mesh."""

    def __init__(self, quadrature: Quadrature, cells: IntArray) -> None:
        mesh = quadrature.mesh
        self._comm = mesh.comm
        self._space = compat.lagrange(mesh.dolfinx, 1, 0)
        # values of the functions at the points (points, corners)
        self._table = compat.tabulate(self._space, (), quadrature.X)
        self._corners = compat.cell_dofs(self._space, (0,), cells)
        weight = np.zeros((len(cells), len(quadrature.X)))
        for some in quadrature.slices(cells):
            weight[some] = quadrature.maps(cells[some])[1]
        products = np.einsum("cq,qa,qb->cab", weight, self._table, self._table)
        count = self._table.shape[1]
        rows = np.repeat(self._corners, count, axis=1).ravel()
        columns = np.tile(self._corners, (1, count)).ravel()
        index_map = self._space.dofmap.index_map
        #: corners of this rank, ghosts included
        self.size = int(index_map.size_local + index_map.num_ghosts)
        self._mass = scipy.sparse.coo_matrix(
            (products.ravel(), (rows, columns)), shape=(self.size, self.size)
        ).tocsr()
        own = compat.ghosts_added(self._space, self._mass.diagonal()[:, None])[:, 0]
        # corners of other cells have no function here
        self._inverse = np.divide(1.0, own, out=np.zeros_like(own), where=own > 0)[:, None]

    def loads(self, some: slice, weighted: Array) -> Array:
        """∫ f φ of the cells `some` of the given ones, to be summed up: (corners, fields).

        `weighted` (cells, points, fields): values of f times the weights of the quadrature.
        """
        parts = np.einsum("qa,cqf->caf", self._table, weighted, optimize=True)
        corners = self._corners[some]
        at = np.arange(corners.size)
        gather = scipy.sparse.csr_matrix(
            (np.ones(len(at)), (corners.ravel(), at)), shape=(self.size, len(at))
        )
        return np.asarray(gather @ parts.reshape(len(at), -1))

    def owned(self, loads: Array) -> Array:
        """Loads on this rank's corners, what other ranks' cells add included: (rows, fields)."""
        return compat.ghosts_added(self._space, loads)

    def solve(self, loads: Array) -> Array:
        """Values at the corners of this rank, (rows, fields), for loads of the same shape."""
        x = np.zeros_like(loads)
        r = np.array(loads)
        z = self._inverse * r
        p, rz = z, self._dot(r, z)
        aim = RESIDUAL**2 * rz
        for _ in range(MOST_STEPS):
            if np.all(rz <= aim):
                return x
            Ap = self._product(p)
            step = _quotient(rz, self._dot(p, Ap))
            x, r = x + step * p, r - step * Ap
            z = self._inverse * r
            rz, before = self._dot(r, z), rz
            p = z + _quotient(rz, before) * p
        raise NotConvergedError(
            f"the recovery of strains did not converge in {MOST_STEPS} steps: the mesh has cells "
            "of nearly no volume; mesh the part anew, or leave error=None."
        )

    def at_points(self, some: slice, values: Array) -> Array:
        """Values (cells, points, fields) in the cells `some`, of values with ghosts."""
        return np.asarray(
            np.einsum("qa,caf->cqf", self._table, values[self._corners[some]], optimize=True)
        )

    def with_ghosts(self, values: Array) -> Array:
        """Values at the corners of this rank, continued to its ghosts."""
        return compat.with_ghosts(self._space, values)

    def _product(self, x: Array) -> Array:
        return self.owned(self._mass @ self.with_ghosts(x))

    def _dot(self, x: Array, y: Array) -> Array:
        return np.asarray(self._comm.allreduce(np.einsum("if,if->f", x, y)))


def _quotient(a: Array, b: Array) -> Array:
    """a / b, 0 where both are: columns that are solved already."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
