"""Simply supported rectangular laminates with shear deformation: their natural frequencies.

Navier's solution of first-order theory. With α = mπ/a, β = nπ/b the motions

    u = U cos αx sin βy    v = V sin αx cos βy    w = W sin αx sin βy
    φx = X cos αx sin βy   φy = Y sin αx cos βy

solve a cross-ply's equations on edges that hold the deflection and what runs along the edge (SS-1);
for antisymmetric angle-plies sine and cosine of u and v change places, on edges that let these
slide along but not across (SS-2). Both give one 5 × 5 eigenproblem.

J. N. Reddy, *Mechanics of Laminated Composite Plates and Shells* (2004), articles 7.3 to 7.4;
C. W. Bert and T. L. C. Chen, Int. J. Solids Struct. 14 (1978) 465-473.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError

#: Share of a stiffness below which a coupling is rounding.
COUPLING_ROUNDING = 1e-9
#: Most half waves along a side.
WAVES = 100_000


@dataclass(frozen=True, eq=False)
class SupportedLaminate:
    """A rectangular laminate 0 ≤ x ≤ a, 0 ≤ y ≤ b on simple supports.

    Parameters
    ----------
    A, B, D : array_like (3, 3)
        In-plane (N/m), coupling (N) and bending stiffness (N m) of (ε1, ε2, γ12), (κ1, κ2, 2κ12).
    S : array_like (2, 2)
        Transverse shear stiffness of (γ13, γ23), N/m, correction included.
    inertia : array_like (3,)
        ∫ ρ (1, z, z²) dz: kg/m², kg/m, kg.
    a, b : float
        Sides, m.

    Raises
    ------
    InputError
        A stack that is neither a cross-ply (A, B, D without 16 and 26) nor an antisymmetric
        angle-ply (A and D without 16 and 26, B of these alone, no ∫ρz dz): it has no such solution.
    """

    A: ArrayLike
    B: ArrayLike
    D: ArrayLike
    S: ArrayLike
    inertia: ArrayLike
    a: float
    b: float

    @checks.within_range
    def __post_init__(self) -> None:
        for name, shape in (("A", (3, 3)), ("B", (3, 3)), ("D", (3, 3)), ("S", (2, 2))):
            value = checks.kept(checks.array(name, getattr(self, name), shape))
            if name != "B" and value.max() <= 0:
                raise InputError(f"{name} must be positive definite; no entry of it is > 0.")
            checks.store(self, **{name: value})
        inertia = checks.kept(checks.array("inertia", self.inertia, (3,)))
        if inertia[0] <= 0:
            raise InputError(f"inertia must begin with a mass per area > 0; got {inertia[0]:g}.")
        checks.store(
            self,
            inertia=inertia,
            a=checks.positive("a", self.a, "m"),
            b=checks.positive("b", self.b, "m"),
        )
        A, B, D, S = (np.asarray(value) for value in (self.A, self.B, self.D, self.S))
        thickness = np.sqrt(D.max() / A.max())
        straight = [
            np.abs(A[:2, 2]).max() / A.max(),
            np.abs(D[:2, 2]).max() / D.max(),
            np.abs(S[0, 1]) / S.max(),
        ]
        scale = A.max() * thickness
        twist = np.abs(B[:2, 2]).max() / scale
        stretch = max(np.abs(B[:2, :2]).max(), np.abs(B[2, 2])) / scale
        stretch = max(
            stretch, abs(np.asarray(self.inertia)[1]) / np.asarray(self.inertia)[0] / thickness
        )
        if max(straight) > COUPLING_ROUNDING or min(twist, stretch) > COUPLING_ROUNDING:
            raise InputError(
                "Navier's solution needs a cross-ply or an antisymmetric angle-ply: A, D and S "
                "without the terms 16, 26 and 45, and B of these alone or without them."
            )

    @checks.within_range
    def frequencies(self, m: int, n: int) -> Array:
        """The five natural circular frequencies with m × n half waves, ascending, rad/s."""
        alpha = checks.whole("m", m, most=WAVES) * np.pi / self.a
        beta = checks.whole("n", n, most=WAVES) * np.pi / self.b
        # amplitudes of (ε1, ε2, γ12) of (U, V), and of (γ13, γ23) of (W, X, Y)
        E = np.array([[-alpha, 0], [0, -beta], [beta, alpha]])
        shear = np.array([[alpha, 1, 0], [beta, 0, 1]])
        A, B, D, S = (np.asarray(value) for value in (self.A, self.B, self.D, self.S))
        K = np.zeros((5, 5))
        K[:2, :2] = E.T @ A @ E
        K[:2, 3:] = E.T @ B @ E
        K[3:, :2] = K[:2, 3:].T
        K[3:, 3:] = E.T @ D @ E
        K[2:, 2:] += shear.T @ S @ shear
        I0, I1, I2 = np.asarray(self.inertia)
        M = np.diag([I0, I0, I0, I2, I2])
        M[[0, 1, 3, 4], [3, 4, 0, 1]] = I1
        high = np.sqrt(np.abs(scipy.linalg.eigh(K, M, eigvals_only=True)))
        # rounding of a thin plate's thickness-shear modes would drown its bending
        inverse = scipy.linalg.eigh(M, K, eigvals_only=True)[::-1]
        low = 1 / np.sqrt(np.maximum(inverse, 1e-30 * inverse[0]))
        return np.where(high < np.sqrt(low[0] * high[-1]), low, high)
