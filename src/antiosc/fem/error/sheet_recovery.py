"""Strains of shapes of a shell, recovered as continuous functions of their own degree."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from antiosc._types import Array, IntArray
from antiosc.fem import compat
from antiosc.fem.error.sheet_strains import (
    BENDING,
    DRILLING,
    MEMBRANE,
    SHEAR,
    STRAINS,
    SheetStrains,
    StrainsOfSheets,
)
from antiosc.fem.error.smooth_pieces import SmoothPieces
from antiosc.fem.structure.meshed import MeshedStructure

#: Numbers of the strains of a block of cells.
BLOCK_NUMBERS = 1_000_000
#: Degree of the recovered strains.
DEGREE = 2


class Block(NamedTuple):
    """Some of the cells, their strains at all points, and what was recovered there (P, 9, k)."""

    cells: slice
    strains: SheetStrains
    recovered: Array
    #: section forces of unit strains (P, 9, 9)
    D: Array


class SheetRecovery:
    """The L2 projection (consistent mass) of the strains of shapes (rows, k), piece by piece."""

    def __init__(self, part: MeshedStructure, shapes: Array, pieces: SmoothPieces) -> None:
        self._part, self.count = part, shapes.shape[1]
        strains = StrainsOfSheets(part, shapes, pieces)
        self._space = compat.lagrange(part.mesh.dolfinx, DEGREE, 0)
        every = np.arange(compat.cell_map(part.mesh.dolfinx).size_local)
        dofs = compat.cell_dofs(self._space, (0,), every).astype(np.int64)
        # a function of its own for each piece
        known, dofs = np.unique(
            pieces.number[:, None] * (dofs.max() + 1) + dofs, return_inverse=True
        )
        self._dofs = dofs.reshape(len(every), -1)
        table, self._points = compat.tabulate(self._space, (), strains.X), len(strains.X)
        width = max(1, BLOCK_NUMBERS // (STRAINS * self._points * self.count))
        self._blocks: list[tuple[slice, SheetStrains, scipy.sparse.csr_matrix]] = []
        mass = scipy.sparse.csc_matrix((len(known), len(known)))
        loads = np.zeros((len(known), STRAINS * self.count))
        for first in range(0, len(every), width):
            some = slice(first, min(first + width, len(every)))
            own = strains.at(every[some])
            rows = len(own.weights)
            columns = np.repeat(self._dofs[some], self._points, axis=0)
            values = np.tile(table, (rows // self._points, 1))
            starts = np.arange(rows + 1) * columns.shape[1]
            at = scipy.sparse.csr_matrix(
                (values.ravel(), columns.ravel(), starts), shape=(rows, len(known))
            )
            self._blocks.append((some, own, at))
            weighted = at.T @ scipy.sparse.diags(own.weights)
            mass = mass + weighted @ at
            loads += weighted @ own.own.reshape(rows, -1)
        options = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        solver = scipy.sparse.linalg.splu(scipy.sparse.csc_matrix(mass), **options)
        used = np.flatnonzero(loads.any(axis=0))  # a plate that bends is not stretched
        self._values = np.zeros_like(loads)
        self._values[:, used] = solver.solve(loads[:, used])
        self._D = section_forces(part)

    def blocks(self) -> Iterator[Block]:
        """All cells, in blocks."""
        number = self._part.part_of_cells()
        for some, own, at in self._blocks:
            recovered = (at @ self._values).reshape(own.own.shape)
            yield Block(some, own, recovered, self._D[np.repeat(number[some], self._points)])

    def at(self, cells: IntArray, X: Array) -> tuple[Array, Array]:
        """(recovered strains (P, 9, k), D (P, 9, 9)) at X (P, 2) in cells (P,)."""
        table = compat.tabulate(self._space, (), X)
        values = self._values[self._dofs[cells]]
        found = np.einsum("pf,pfc->pc", table, values).reshape(len(cells), STRAINS, self.count)
        return found, self._D[self._part.part_of_cells()[cells]]


def section_forces(part: MeshedStructure) -> Array:
    """Section forces of unit strains (parts, 9, 9), in the axes of each sheet."""
    D = np.zeros((len(part.parts), STRAINS, STRAINS))
    for own, (material, _) in zip(D, part.parts, strict=True):
        s = material.section
        own[MEMBRANE, MEMBRANE], own[SHEAR, SHEAR] = s.A, s.S
        own[MEMBRANE, BENDING], own[BENDING, MEMBRANE] = s.B, s.B.T
        own[BENDING, BENDING] = s.bending + s.B.T @ np.linalg.solve(s.A, s.B)
        own[DRILLING, DRILLING] = s.drilling
    return D
