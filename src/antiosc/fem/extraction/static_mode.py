"""Static deflections beside rigid-body modes, and the rounding of the latter."""

from __future__ import annotations

import numpy as np

from antiosc._types import Array
from antiosc.errors import NotConvergedError
from antiosc.fem.linalg.algebra import by_strains, diagonal, dot, multiply
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.structure.structure import Structure

#: Relative error in energy of the static solve beside rigid-body modes: wanted, and taken where
#: rounding leaves no less (the error of the compliance is the square of it).
STATIC_TOL, STATIC_SOUND = 1e-13, 1e-8
#: Most steps of that solve, and how many without progress are rounding.
STATIC_STEPS, STATIC_IDLE = 200, 5


def moved_by_strain(structure: Structure, R: Array, Y: Array) -> Array:
    """Bound on the displacement of sites by the error of rigid-body modes R (rows, r): (p,).

    Such an error strains, and moves a site whose deflection under its load is y, a column of
    Y (rows, p), by yᵀKR. That is known to the rounding of KR, |y|ᵀ|K||R| ε; the diagonal of K
    bounds its entries, and products by strains have a rounding of their own.
    """
    comm, K = structure.comm, structure.K
    entries = diagonal(K)
    forces = multiply(K, Y) if by_strains(K) else entries[:, None] * Y
    sizes = comm.allreduce(np.einsum("ij,ij->j", Y, forces))
    sizes = sizes * comm.allreduce(np.einsum("ij,i,ij->", R, entries, R))
    strained = np.linalg.norm(dot(comm, Y, multiply(K, R)), axis=1)
    return np.asarray(strained + np.sqrt(sizes) * np.finfo(float).eps)


def beside_rigid(structure: Structure, factor: Solver, b: Array) -> Array:
    """K y = b with y M-orthogonal to the rigid modes: conjugate gradients with the factor of A.

    A = K + shift·M is spectrally close to K on the elastic space, so a few steps reach rounding.
    """
    comm, K, R = structure.comm, structure.K, structure.rigid_modes
    MR = multiply(structure.M, R)

    def load(r: Array) -> Array:  # without its part on the rigid motions
        return np.asarray(r - MR @ dot(comm, R, r))

    def shape(z: Array) -> Array:
        return np.asarray(z - R @ dot(comm, MR, z))

    r = load(b)
    y = np.zeros_like(b)
    z = p = shape(factor.solve(r))
    rz = first = best = float(dot(comm, r, z))
    idle = 0
    # rᵀz is the square of the error in energy, to the tenth that A differs from K.
    for _ in range(STATIC_STEPS):
        Kp = multiply(K, p)
        step = rz / float(dot(comm, p, Kp))
        y, r = y + step * p, load(r - step * Kp)
        z = shape(factor.solve(r))
        rz, before = float(dot(comm, r, z)), rz
        idle = 0 if rz < best else idle + 1
        best = min(best, rz)
        if rz <= STATIC_TOL**2 * first or (idle == STATIC_IDLE and best <= STATIC_SOUND**2 * first):
            return shape(y)
        p = z + rz / before * p
    raise NotConvergedError(
        f"the static mode of a structure with {R.shape[1]} rigid-body modes did not converge: "
        f"relative error in energy {np.sqrt(best / first):.1e} after {STATIC_STEPS} steps, goal "
        f"{STATIC_TOL:.0e}: the matrices are ill-conditioned (very uneven elements or materials)."
    )
