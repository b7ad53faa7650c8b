"""The basis of a Krylov method, orthonormal in A = K + sM.

`antiosc.fem.extraction.krylov` applies the constrained operator T = A⁻¹M - Y(BᵀY)⁻¹BᵀA⁻¹M, which
is symmetric in the inner product of A. A `RitzBasis` orthogonalises the results against the basis,
keeps them free of the rigid-body modes that the sites do not see, and finds the Ritz pairs of T.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from antiosc.base._types import Array, ComplexArray
from antiosc.fem.extraction.eigenmodes import Modes, polish
from antiosc.fem.extraction.mode_search import Pin
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.linalg.algebra import dot, multiply
from antiosc.fem.structure.structure import Structure
from antiosc.models.batched_modes import EXHAUSTED

#: Share of the largest θ below which the smallest θ of an eigensolver are inaccurate.
WIDE_RANGE = 1e-8
#: θ over the largest below which it is rounding.
NOISE = 1e-18
#: Columns by which a basis grows.
BASIS_STEP = 16

#: Bound on the spectral norm of Z - Z_N [N/m] at complex x = ω² of shape (W,): (W,).
Remainder = Callable[[ComplexArray], Array]


def mass_above(top: float, mass: float) -> Remainder:
    """The bound for a mass [kg] that is left out, on poles above `top` [rad²/s²]."""

    def bound(x: ComplexArray) -> Array:
        nearest = np.where(x.real > top, x.imag, np.abs(top - x))
        return np.asarray(np.abs(x) ** 2 * mass / nearest)

    return bound


class RitzBasis:
    """Vectors V with VᵀAV = 1 that vanish at the sites; `room` of them at first.

    Attributes
    ----------
    steps : number of vectors.
    H : VᵀMV (steps, steps), that is T in the basis; it grows by `project`.
    """

    def __init__(self, structure: Structure, held: SiteShapes, room: int) -> None:
        self._comm, self._M, self._shift = structure.comm, structure.M, structure.shift
        self._A, self._pin = structure.factorize().A, Pin(held)
        rows, self._locked = held.nodal.shape
        self._most = structure.dofs - self._pin.load.shape[1] - self._locked
        self.steps, self.H = 0, np.zeros((0, 0))
        # V, and F = A V. In front stand the rigid-body modes that do not move the sites, which no
        # step may pick up again.
        self._V = np.empty((rows, self._locked + room), order="F")
        self._F = np.empty_like(self._V)
        if self._locked:
            scale = np.sqrt(self._shift)  # RᵀAR = s
            self._V[:, : self._locked] = held.nodal / scale
            self._F[:, : self._locked] = scale * multiply(self._M, held.nodal)

    @property
    def vectors(self) -> Array:
        """V (rows of this rank, steps)."""
        return self._V[:, self._locked : self._locked + self.steps]

    def add(self, w: Array, load: Array, size: float = 0.0) -> tuple[bool, float]:
        """Orthogonalise w = A⁻¹ load and add it: (whether anything is left of it, its length).

        `size`: what its energy wᵀ load is at least taken to be, where rounding may make it.

        Of what is left out the length is an upper bound, since it may be all rounding; it is 0 if
        the space has no more dimensions.
        """
        k = self._locked + self.steps
        V, F = self._V[:, :k], self._F[:, :k]
        w = self._constrained(w)
        before = max(float(dot(self._comm, w, load)), size)
        w = self._constrained(w - V @ dot(self._comm, F, w))
        # f = A w is computed anew: with an update f and w would diverge by a constant factor in
        # each step.
        f = multiply(self._A, w)
        h = dot(self._comm, V, f)  # twice is enough (Kahan)
        # K has no part in it for a rigid-body mode: its rounding, over s, would be a large one
        h[: self._locked] = dot(self._comm, F[:, : self._locked], w)
        w, f = self._constrained(w - V @ h), f - F @ h
        left = float(dot(self._comm, w, f))
        if self.steps == self._most:  # rounding may produce directions outside the space
            return False, 0.0
        if not left > EXHAUSTED**2 * before:
            return False, EXHAUSTED * float(np.sqrt(max(before, 0.0)))
        length = float(np.sqrt(left))
        self._append(w / length, f / length)
        return True, length

    def _append(self, v: Array, f: Array) -> None:
        k = self._locked + self.steps
        if k == self._V.shape[1]:
            self._V, self._F = (
                np.concatenate([x.T, np.empty((BASIS_STEP, len(x)))]).T for x in (self._V, self._F)
            )
        self._V[:, k], self._F[:, k] = v, f
        self.steps += 1

    def _constrained(self, w: Array) -> Array:
        return self._pin.constrained(self._comm, w)

    def project(self) -> Array:
        """M times the vectors that H does not contain yet, the next loads; then H contains them."""
        first = len(self.H)
        loads = multiply(self._M, self.vectors[:, first:])
        column = dot(self._comm, self.vectors, loads)
        H = np.zeros((self.steps, self.steps))
        H[:first, :first] = self.H
        H[:, first:], H[first:] = column, column.T
        self.H = (H + H.T) / 2
        return loads

    def H_whole(self) -> Array:
        """VᵀMV of all vectors, those that `project` has not taken included."""
        product = dot(self._comm, self.vectors, multiply(self._M, self.vectors))
        return (product + product.T) / 2

    def ritz(self, n: int) -> tuple[Array, Array]:
        """Eigenvalues θ = 1/(ω² + s), ω ascending, and eigenvectors of T on the first n vectors.

        Of far higher frequencies double precision leaves no θ: it is 0.
        """
        H = self.H[:n, :n]
        theta, turn = np.linalg.eigh(H)
        noise = int(np.sum(theta <= NOISE * theta[-1])) if n else 0
        own, vectors = theta[noise:], turn[:, noise:]
        if len(own) and own[0] < WIDE_RANGE * own[-1]:
            poles, x = polish(vectors / np.sqrt(own), lambda x: x.T @ x, lambda x: x.T @ H @ x)
            order = np.argsort(-poles)
            own, vectors = 1 / poles[order], (x / np.sqrt(poles))[:, order]
        theta = np.concatenate([np.zeros(noise), own])
        return theta[::-1], np.column_stack([turn[:, :noise], vectors])[:, ::-1]

    def resolved(self, n: int) -> tuple[Array, Array]:
        """Those of `ritz` with θ > 0."""
        theta, turn = self.ritz(n)
        return theta[theta > 0], turn[:, theta > 0]

    def modes(self, n: int, complete: bool) -> Modes:
        """The Ritz pairs of the first n vectors; M-orthonormal, and orthogonal through K too."""
        theta, turn = self.resolved(n)
        omega = np.sqrt(np.maximum(1 / theta - self._shift, 0.0))
        return Modes(omega, self.vectors[:, :n] @ (turn / np.sqrt(theta)), complete)

    def release(self) -> None:
        """Release the memory of the basis."""
        self._V = self._F = np.zeros((0, 0))
