"""The static mode of a site, or the rigid-body mode that takes its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from antiosc.errors import NotConvergedError
from antiosc.fem.algebra import Array, Solver, dot, multiply, norm
from antiosc.fem.site import Functional
from antiosc.fem.structure import Structure

#: (Rᵀb)²·mass below which no rigid-body mode moves the site along the direction of impact.
SLIDES = 1e-12
#: Relative residual of the static solve beside rigid-body modes.
STATIC_TOL = 1e-13


@dataclass(frozen=True)
class StaticMode:
    """φ_st, or φ_CR where a rigid-body mode moves the site (then k0 = 0). Unit at the site."""

    #: the shape on the rows of this rank
    phi: Array
    #: M·phi
    m_phi: Array
    #: k0 = φᵀKφ, N/m (Article (20), or (27) with a rigid-body mode)
    k0: float
    #: m_st = φᵀMφ, or m_CR, kg
    mass: float
    #: M-orthonormal rigid-body modes that vanish at the site (rows, r)
    still: Array
    #: A⁻¹b and bᵀA⁻¹b with the structure's one factor of A = K + shift·M
    y: Array
    bAb: float


def static_mode(structure: Structure, site: Functional) -> StaticMode:
    """φ_st from one static solve, or φ_CR = R Rᵀb/|Rᵀb|² of the M-orthonormal rigid modes R.

    That choice of φ_CR is M-orthogonal to the rigid-body modes that vanish at the site, so
    these carry no mass and drop out (Article, section 3.3). A body that can slide, but not
    along the impact, has a static mode; it is taken M-orthogonal to the sliding.
    """
    return static_modes(structure, [site])[0]


def static_modes(structure: Structure, sites: Sequence[Functional]) -> list[StaticMode]:
    """The same for several sites, from one block of right-hand sides."""
    loads = np.column_stack([site.b for site in sites])
    shapes = structure.factorization.solve_checked(loads)
    return [
        _static_mode(structure, b, y)
        for b, y in zip(loads.T, np.asfortranarray(shapes).T, strict=True)
    ]


def _static_mode(structure: Structure, b: Array, y: Array) -> StaticMode:
    comm, factor = structure.comm, structure.factorization
    bAb = float(dot(comm, b, y))
    R = structure.rigid_modes
    along = dot(comm, R, b)
    inertia = float(along @ along)
    weight = inertia * _mass_scale(structure)
    if weight > SLIDES:
        phi = R @ along / inertia
        _, _, vt = np.linalg.svd(along[None, :])
        still = R @ vt[1:].T
        k0 = 0.0
    else:
        shape = y if not R.shape[1] else beside_rigid(structure, factor, b)
        compliance = float(dot(comm, b, shape))
        phi, still, k0 = shape / compliance, R, 1 / compliance
    m_phi = multiply(structure.M, phi)
    return StaticMode(phi, m_phi, k0, float(dot(comm, phi, m_phi)), still, y, bAb)


def _mass_scale(structure: Structure) -> float:
    """A mass that makes (Rᵀb)² a pure number: of the lightest rigid motion's own participation."""
    if not structure.rigid_modes.shape[1]:
        return 0.0
    # M-orthonormal columns: their largest amplitude squared is one over a mass.
    peak = max(structure.comm.allgather(float(np.abs(structure.rigid_modes).max(initial=0.0))))
    return 1 / peak**2


def beside_rigid(structure: Structure, factor: Solver, b: Array) -> Array:
    """K y = b with y M-orthogonal to the rigid modes: conjugate gradients on the one factor.

    A = K + shift·M is spectrally close to K on the elastic space, so a few steps reach rounding.
    """
    comm, K, R = structure.comm, structure.K, structure.rigid_modes
    MR = multiply(structure.M, R)

    def load(r: Array) -> Array:  # without its part on the rigid motions
        return np.asarray(r - MR @ dot(comm, R, r))

    def shape(z: Array) -> Array:
        return np.asarray(z - R @ dot(comm, MR, z))

    r = load(b)
    goal = STATIC_TOL * norm(comm, r)
    y = np.zeros_like(b)
    z = shape(factor.solve(r))
    p, rz = z, float(dot(comm, r, z))
    for _ in range(200):
        Kp = multiply(K, p)
        step = rz / float(dot(comm, p, Kp))
        y, r = y + step * p, load(r - step * Kp)
        if norm(comm, r) <= goal:
            return shape(y)
        z = shape(factor.solve(r))
        rz, before = float(dot(comm, r, z)), rz
        p = z + rz / before * p
    raise NotConvergedError(
        f"the static mode beside {R.shape[1]} rigid-body modes did not converge: relative residual "
        f"{norm(comm, r) / norm(comm, b):.1e} after 200 steps, goal {STATIC_TOL:.0e}."
    )
