"""The static mode of a site, or the rigid-body mode that replaces it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc._types import Array
from antiosc.errors import NotConvergedError
from antiosc.fem.linalg.algebra import by_strains, diagonal, dot, multiply
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.site.site import Functional
from antiosc.fem.structure.structure import Structure
from antiosc.models.rigid_share import HIDDEN, SMALL_SHARE

#: Relative error in energy of the static solve beside rigid-body modes: wanted, and taken where
#: rounding leaves no less (the error of the compliance is the square of it).
STATIC_TOL, STATIC_SOUND = 1e-13, 1e-8
#: Most steps of that solve, and how many without progress are rounding.
STATIC_STEPS, STATIC_IDLE = 200, 5
#: Rounding of the terms of Rᵀb: those of R, and their sum.
SUM_ROUNDING = 4 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class StaticMode:
    """The shape with unit displacement at the site on which the anti-oscillators are built.

    φ_CR if rigid-body modes have a share in the compliance of the site, otherwise φ_st; with
    rigid-body modes φ_st is that of the elastic motions, M-orthogonal to the rigid ones.
    """

    #: the shape on the rows of this rank
    phi: Array
    #: M·phi
    m_phi: Array
    #: k0 = φᵀKφ, N/m (Article (20), or (27) with a rigid-body mode)
    k0: float
    #: m_st = φᵀMφ, or m_CR, kg
    mass: float
    #: M-orthonormal rigid-body modes from which the constraint modes are kept free (rows, r)
    nodal: Array
    #: A⁻¹b and bᵀA⁻¹b with A = K + shift·M, without the contribution of the rigid modes `nodal`
    y: Array
    bAb: float
    #: b without its load on the rigid modes `nodal`: the reaction that constrains the site
    load: Array
    #: |Rᵀb|: displacement of the site in the one rigid-body mode that moves it, kg^-1/2; 0: none
    along: float
    #: rounding of `along`
    doubt: float
    #: share of the rigid-body motions in bᵀA⁻¹b
    share: float
    #: M-orthonormal rigid-body modes that do not move the site (rows, r or r - 1)
    beside: Array
    #: the one that does, of unit mass, where the elastic motions are modelled alone
    apart: Array | None = None

    @property
    def rigid(self) -> tuple[Array, float] | None:
        """(shape of unit mass, its displacement of the site) of the rigid-body mode that moves it.

        None if there is none, or if it cannot be distinguished from rounding.
        """
        if self.k0 == 0:
            return self.phi * self.along, self.along
        return None if self.apart is None else (self.apart, self.along)


def static_mode(structure: Structure, site: Functional) -> StaticMode:
    """φ_st from one static solve, or φ_CR = R Rᵀb/|Rᵀb|² of the M-orthonormal rigid modes R.

    That choice of φ_CR is M-orthogonal to the rigid-body modes that vanish at the site, so
    these have no effect at the site and drop out (Article, section 3.3). If the share of the
    rigid-body modes in the compliance of the site is very small, the static mode of the elastic
    motions is used, and the rigid-body motion is added to its anti-oscillators
    (`antiosc.models.rigid_share`).
    """
    return static_modes(structure, [site])[0]


def static_modes(structure: Structure, sites: Sequence[Functional]) -> list[StaticMode]:
    """The same for several sites, from one block of right-hand sides."""
    loads = np.column_stack([site.b for site in sites])
    shapes = structure.factorize().solve_checked(loads)
    return [
        _static_mode(structure, b, y)
        for b, y in zip(loads.T, np.asfortranarray(shapes).T, strict=True)
    ]


def _static_mode(structure: Structure, b: Array, y: Array) -> StaticMode:
    comm, factor, R = structure.comm, structure.factorize(), structure.rigid_modes
    bAb = float(dot(comm, b, y))
    a = dot(comm, R, b)
    along = float(np.linalg.norm(a))
    share = along**2 / structure.shift / bAb if R.shape[1] else 0.0
    doubt = SUM_ROUNDING * float(np.linalg.norm(dot(comm, np.abs(R), np.abs(b))))
    beside, apart = R, None
    if share > HIDDEN:
        beside = R @ np.linalg.svd(a[None, :])[2][1:].T
    if share > SMALL_SHARE:
        phi = R @ a / along**2
        nodal, load, k0 = beside, b, 0.0
    else:
        nodal, load, shape = R, b, y
        if R.shape[1]:
            load = b - multiply(structure.M, R) @ a
            y = y - R @ (a / structure.shift)
            bAb = float(dot(comm, b, y))
            shape = beside_rigid(structure, factor, b)
            doubt += float(moved_by_strain(structure, R, shape[:, None])[0])
        compliance = float(dot(comm, b, shape))
        phi, k0 = shape / compliance, 1 / compliance
        if share > HIDDEN:
            apart = R @ a / along
    m_phi = multiply(structure.M, phi)
    mass = float(dot(comm, phi, m_phi))
    return StaticMode(phi, m_phi, k0, mass, nodal, y, bAb, load, along, doubt, share, beside, apart)


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
