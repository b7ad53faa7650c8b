"""The lowest natural modes by block Lanczos: a block of solves is cheaper than single solves.

The recurrence for A⁻¹M, A = K + sM, in the inner product of M, with full orthogonalisation, begins
at a random block (Golub and Underwood, in *Mathematical Software III*, 1977, 361). A block of
right-hand sides reads the factor from memory once, and on large structures this determines the time
of a solve. Repeated frequencies are found if their multiplicity does not exceed the block size.
"""

from __future__ import annotations

import logging

import numpy as np

from antiosc._types import Array
from antiosc.errors import NotConvergedError
from antiosc.fem.extraction.eigenmodes import DENSE, Modes, ModeSolver
from antiosc.fem.linalg import memory
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.mpi import on_root
from antiosc.fem.structure.structure import Structure

#: Right-hand sides solved for together. On two structures of 10⁵ dofs 20 modes took half of the
#: time of SLEPc's Krylov–Schur method with 8, two thirds with 16; with 43 263 dofs (the bracket) 20
#: and 60 modes took 0.47 and 0.37 of its time (one thread).
VECTORS_PER_BLOCK = 8
#: Largest ‖A⁻¹Mφ - θφ‖ over θ of an accepted mode; the relative error of ω² is about its square.
MODE_RESIDUAL = 1e-7
#: Structures with fewer dofs for each mode are solved by `ModeSolver`.
DOFS_PER_MODE = 20
#: A direction below this share of its block (squared, in M) is rounding.
DEPENDENT = 1e-8
#: Most steps; each gives about half a mode for every vector of the block.
MOST_STEPS = 200

log = logging.getLogger(__name__)


def lowest_modes(structure: Structure, count: int, reach: float = 0.0) -> Modes:
    """At least the `count` lowest elastic modes, and all up to `reach` rad/s, ascending.

    Raises
    ------
    NotConvergedError
        The largest number of steps was not sufficient.
    """
    if structure.size <= DENSE or structure.dofs < DOFS_PER_MODE * count:
        return _one_by_one(structure, count, reach)
    run = _Lanczos(structure)
    rows = structure.size
    free = on_root(structure.comm, memory.free_memory)
    room = memory.MEMORY_SHARE * free / (8 * VECTORS_PER_BLOCK * rows)
    steps = max(1, int(min(MOST_STEPS, room - 3)))  # a block of the basis each
    for step in range(steps):
        run.advance()
        omega, turn, residual = run.ritz()
        settled = int(np.append(residual > MODE_RESIDUAL, True).argmax())
        if run.exhausted or (settled >= count and omega[settled - 1] >= reach):
            kept = len(omega) if run.exhausted else settled
            return Modes(omega[:kept], run.shapes(turn[:, :kept]), run.exhausted)
        log.debug("block Lanczos step %d: %d modes settled", step, settled)
    raise NotConvergedError(
        f"block Lanczos found {settled} of {count} modes in {steps} steps (at most {MOST_STEPS}, "
        "and as many as fit in memory): ask for fewer modes or a lower band."
    )


def _one_by_one(structure: Structure, count: int, reach: float) -> Modes:
    """By SLEPc or LAPACK, in rounds."""
    solver = ModeSolver(structure)
    found = solver.lowest(count)
    while len(found.omega) >= count and found.omega[-1] < reach and not found.complete:
        count = int(1.5 * count) + 1
        found = solver.lowest(count)
    return found


class _Lanczos:
    """The recurrence: A⁻¹M V = V T + (next block)(coupling), VᵀMV = 1."""

    def __init__(self, structure: Structure) -> None:
        self._structure, self._comm = structure, structure.comm
        #: the modes that no block may pick up, and the blocks of the basis
        self._blocks = [structure.rigid_modes] if structure.rigid_modes.shape[1] else []
        self._locked = len(self._blocks)
        self._T = np.zeros((0, 0))
        #: of the block after the last with that one
        self._coupling: Array = np.zeros((0, 0))
        self.exhausted = False
        rows = structure.rows
        random = np.random.default_rng(self._comm.rank).standard_normal((rows, VECTORS_PER_BLOCK))
        start = structure.factorize().solve_block(multiply(structure.M, random))
        self._next, self._m_next, _ = self._orthonormal(start)

    def advance(self) -> None:
        """Add one block to the basis and compute the next one."""
        V, MV = self._next, self._m_next
        width, size = V.shape[1], len(self._T)
        self._blocks.append(V)
        Y = self._structure.factorize().solve_block(MV)
        T = np.zeros((size + width, size + width))
        T[:size, :size] = self._T
        if size:
            before = self._coupling.shape[1]
            T[size:, size - before : size] = self._coupling
            T[size - before : size, size:] = self._coupling.T
        own = dot(self._comm, MV, Y)
        T[size:, size:] = (own + own.T) / 2
        self._T = T
        Y = Y - V @ own
        if size:
            Y -= self._blocks[-2] @ self._coupling.T
        self._next, self._m_next, self._coupling = self._orthonormal(Y)
        self.exhausted = self._next.shape[1] == 0

    def _orthonormal(self, Y: Array) -> tuple[Array, Array, Array]:
        """An M-orthonormal basis Q of what Y adds to the blocks, MQ, and QᵀMY."""
        M = self._structure.M
        MY = multiply(M, Y)
        scale = np.sqrt(np.maximum(dot(self._comm, Y, MY).diagonal(), np.finfo(float).tiny))
        coupling = np.eye(Y.shape[1])
        for least in (DEPENDENT**2, 0.0):  # twice is enough (Kahan)
            for block in self._blocks:
                Y = Y - block @ dot(self._comm, block, MY)
            if least:  # what the second pass takes off is rounding
                MY = multiply(M, Y)
            gram = dot(self._comm, Y, MY)
            share, turn = np.linalg.eigh(gram / scale[:, None] / scale)
            keep = share > least
            to = turn[:, keep] / np.sqrt(share[keep]) / scale[:, None]
            coupling = (to.T @ gram) @ coupling
            Y, MY, scale = Y @ to, MY @ to, np.ones(int(keep.sum()))
        return Y, MY, coupling

    def ritz(self) -> tuple[Array, Array, Array]:
        """(ω ascending, coefficients in the basis, residuals over θ)."""
        theta, turn = np.linalg.eigh(self._T)
        theta, turn = theta[::-1], turn[:, ::-1]
        last = turn[len(theta) - self._coupling.shape[1] :]
        theta = np.maximum(theta, np.finfo(float).tiny)
        residual = np.linalg.norm(self._coupling @ last, axis=0) / theta
        return np.sqrt(np.maximum(1 / theta - self._structure.shift, 0.0)), turn, residual

    def shapes(self, turn: Array) -> Array:
        """M-orthonormal shapes (rows, k) of coefficients (basis, k)."""
        phi = np.zeros((self._structure.rows, turn.shape[1]))
        first = 0
        for block in self._blocks[self._locked :]:
            phi += block @ turn[first : first + block.shape[1]]
            first += block.shape[1]
        return phi
