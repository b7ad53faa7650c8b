"""Products with K and M of quadratic solids by the compiled actions of their forms, cell by cell.

For hexahedra and straight tetrahedra of anisotropic materials: FFCx compiles the form whose trial
function is a given displacement, and csrc/fem/cells.c calls it for each cell.
"""

from __future__ import annotations

from ctypes import byref
from dataclasses import replace
from functools import cached_property

import numpy as np
import ufl

from antiosc.base._types import Array, IntArray
from antiosc.engine import library
from antiosc.fem.elements.cell_by_cell import CellByCell
from antiosc.fem.elements.weak_form import WeakForm
from antiosc.fem.linalg.forecast import DIRECTED, HEXAHEDRA
from antiosc.fem.platform import compat, kernels


class CompiledCells(CellByCell):
    """Cells whose forms are compiled; sums are in double precision."""

    def _take(self, nodes: IntArray, order: IntArray) -> None:
        u = compat.function_of(self._form.space, np.zeros(self.rows))
        self._kernels = []
        for (form,) in (self._form.stiffness, self._form.mass):
            self._kernels.append(compat.CellKernel(ufl.action(form, u), u))
            self._kernels[-1].take(order)
        self.products = HEXAHEDRA if self._mesh.cell == "hexahedron" else DIRECTED

    @cached_property
    def _cells(self) -> list[tuple[kernels.Cells, Array]]:
        """(cells for the C library, workspace) of K and of M."""
        return [(kernel.cells(), np.empty(kernel.room + kernel.dofs)) for kernel in self._kernels]

    def product(self, x: Array, k: float, m: float) -> Array:
        """(k K + m M) x for a vector or a block of vectors (rows of this rank, columns)."""
        return super().product(np.asarray(x, float), k, m).astype(x.dtype, copy=False)

    def _add(self, group: int, k: float, m: float, u: Array, out: Array) -> None:
        for factor, (cells, memory) in zip((k, m), self._cells, strict=True):
            if factor:
                places = map(library.address, (memory, u, out))
                kernels.functions.afe_cell_products(
                    byref(cells), *self._groups[group], factor, *places
                )

    @cached_property
    def linear(self) -> WeakForm:
        """The same forms with linear elements on these cells."""
        space = compat.lagrange(self._mesh.dolfinx, 1, 3)
        linear = ufl.TestFunction(space), ufl.TrialFunction(space)

        def on_corners(form: ufl.Form) -> ufl.Form:
            return ufl.replace(form, dict(zip(form.arguments(), linear, strict=True)))

        stiffness, mass = (
            [on_corners(form) for form in forms]
            for forms in (self._form.stiffness, self._form.mass)
        )
        return replace(self._form, space=space, stiffness=stiffness, mass=mass)

    def _node_blocks(self, k: float, m: float) -> Array:
        result = np.zeros((self._dofs, 3))
        count = self._groups[-1][1]
        for factor, (cells, memory) in zip((k, m), self._cells, strict=True):
            if factor:
                places = map(library.address, (memory, result))
                kernels.functions.afe_cell_blocks(byref(cells), 0, count, factor, *places)
        return result
