"""Extraction. This module computes shapes of unit displacement at p sites, static or rigid.

With B (n, p) the loads of the sites, A = K + sM and C = BᵀA⁻¹B, the limit s → 0 of A⁻¹B C⁻¹ is
φ_st, φ_CR, or a mixture of both, whatever the supports. It is computed in the basis of loads
B W = B L⁻ᵀU, with C = L Lᵀ and the singular value decomposition RᵀB L⁻ᵀ/√s = V Σ Uᵀ of the
M-orthonormal rigid-body modes R. In this basis C is the identity. Each load excites at most one
rigid-body mode, which no other load excites; this mode makes up a share σ² of its compliance:

    Φ_r = R V₁/(√s Σ₁)                        q loads that excite a rigid-body mode: no solve;
    K Y₀ = B₀ - M R RᵀB₀,  C₀ = B₀ᵀY₀         the other loads B₀, self-equilibrated;
    Φ = [Φ_r, Y₀C₀⁻¹ - Φ_r(B₁ᵀY₀C₀⁻¹)],       K0 = diag(0, C₀⁻¹).

With one site, Φ is φ_st = A⁻¹b/(bᵀA⁻¹b) or φ_CR = R Rᵀb/|Rᵀb|². φ_CR is M-orthogonal to the
rigid-body modes that vanish at the site, so that these drop out (Article, section 3.3). A
rigid-body mode with a share below `RIGID_SHARE` is left out of Φ_r, since its mass 1/(sσ²) would
hide all other masses; the static modes then contain elastic motions only.
Displacements u of the sites become Wᵀu in this basis; a matrix Z in it is W Z Wᵀ at the sites.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg

from antiosc.base._types import Array, IntArray
from antiosc.base.errors import NotConvergedError
from antiosc.fem.linalg.algebra import conjugate_gradients, dot, multiply
from antiosc.fem.linalg.solver import Solver
from antiosc.fem.structure.structure import Structure
from antiosc.models.motion import RIGID_SHARE

if TYPE_CHECKING:
    from mpi4py import MPI


#: Relative error in energy of the static solve beside rigid-body modes that is aimed at.
STATIC_TOL = 1e-13
#: The largest such error accepted if rounding allows no less; that of the compliance is its square.
STATIC_ACCEPTED = 1e-8
#: Most steps of that solve.
STATIC_STEPS = 200
#: Number of steps without progress after which only rounding is left.
STATIC_IDLE_STEPS = 5
#: Least share of a site's compliance independent of others: Z = H⁻¹ loses digits by its square.
LEAST_INDEPENDENT = 1e-10
#: Pivots above this share of the largest one are equally good.
EQUAL_PIVOTS = 0.5


@dataclass(frozen=True)
class SiteShapes:
    """Shapes Φ of unit displacements at p ≥ 1 independent sites, in a basis of unit compliances."""

    kept: IntArray  # (p,) numbers of the independent columns of B
    #: (c, p) displacements at all columns for unit displacements at the independent ones
    dependence: Array
    W: Array  # (p, p) transformation to the basis (see the module)
    #: (rows, p) reactions that fix the sites: BW without its load on the rigid modes `nodal`
    load: Array
    #: phi, m_phi: (rows, p) the shapes, and M times them
    phi: Array
    m_phi: Array
    k0: Array  # (p, p) ΦᵀKΦ
    mass: Array  # (p, p) ΦᵀMΦ
    #: (p,) displacement of each site in its rigid-body mode of unit mass [kg^-½ of the basis], or 0
    moved: Array
    #: (rows, h) M-orthonormal rigid-body modes to which the constraint modes are orthogonal
    nodal: Array
    missed: Array  # (h, p) displacements of the sites in these modes, which the model omits
    #: y, compliance: (rows, p) A⁻¹ load, and (p, p) loadᵀ A⁻¹ load
    y: Array
    compliance: Array
    share: float  # largest share σ² of a rigid-body mode in the compliances
    #: solver, shift: solver of A = K + sM, and s [rad²/s²]
    solver: Solver
    shift: float

    @cached_property
    def _inverse_compliance(self) -> Array:
        """Inverse (p, p) of `compliance`."""
        return np.linalg.inv(self.compliance)

    def constrained(self, comm: MPI.Comm, x: Array) -> Array:
        """x (rows, k) plus the response to forces at the sites that bring the sites to rest."""
        return np.asarray(x - self.y @ (self._inverse_compliance @ dot(comm, self.load, x)))

    def at(self, solver: Solver, shift: float) -> SiteShapes:
        """These shapes with the `solver` of A = K + sM at another `shift` s [rad²/s²]."""
        y = solver.solve_checked(self.load)
        compliance = dot(solver.comm, self.load, y)
        return replace(self, y=y, compliance=compliance, solver=solver, shift=shift)

    @property
    def rigid(self) -> Array:
        """Displacements (p, q) [kg^-½] of the sites in the q rigid-body modes that move them."""
        rigid_columns = np.flatnonzero(self.moved)
        return np.asarray(np.linalg.solve(self.W.T, np.diag(self.moved)[:, rigid_columns]))

    @property
    def rigid_shapes(self) -> Array:
        """M-orthonormal rigid-body modes (rows, q + h): those that move the sites, then `nodal`."""
        rigid_columns = np.flatnonzero(self.moved)
        return np.hstack([self.phi[:, rigid_columns] * self.moved[rigid_columns], self.nodal])


def site_shapes(structure: Structure, solver: Solver, B: Array) -> SiteShapes:
    """Shapes of unit displacements at the sites with loads B (rows of this rank, c)."""
    comm = structure.comm
    columns, dependence, W, Y, V, sigma = _site_basis(structure, solver, B)
    B = B[:, columns] @ W

    # rigid-body modes: those that move the sites, and others
    R = structure.rigid_modes @ V
    root = np.sqrt(structure.shift) or 1.0
    q = int(np.sum(sigma**2 > RIGID_SHARE))
    moved = np.where(np.arange(len(sigma)) < q, root * sigma, 0.0)
    strong, nodal = R[:, :q], R[:, q:]
    slides = dot(comm, nodal, B)
    load = B - multiply(structure.M, nodal) @ slides if nodal.shape[1] else B
    y = Y - nodal @ (slides / root**2)

    # unit displacements
    phi = strong / moved[:q]
    k0 = np.zeros_like(W)
    if q < len(columns):
        y0 = elastic_response(structure, solver, B[:, q:]) if R.shape[1] else y[:, q:]
        C0 = dot(comm, B[:, q:], y0)
        k0[q:, q:] = np.linalg.inv((C0 + C0.T) / 2)
        elastic = y0 @ k0[q:, q:]
        elastic = elastic - phi @ dot(comm, B[:, :q], elastic)
        phi = np.hstack([phi, elastic])

    m_phi = multiply(structure.M, phi)

    return SiteShapes(
        kept=columns,
        dependence=dependence,
        W=W,
        load=load,
        phi=phi,
        m_phi=m_phi,
        k0=(k0 + k0.T) / 2,
        mass=dot(comm, phi, m_phi),
        moved=moved,
        nodal=nodal,
        missed=slides,
        y=y,
        compliance=dot(comm, load, y),
        share=float(sigma.max(initial=0.0) ** 2),
        solver=solver,
        shift=structure.shift,
    )


def _site_basis(
    structure: Structure, solver: Solver, B: Array
) -> tuple[IntArray, Array, Array, Array, Array, Array]:
    """(independent columns, dependence, W, A⁻¹BW, V, σ): WᵀBᵀA⁻¹BW = 1, RᵀBW = √s V diag(σ)."""
    comm = structure.comm
    R = structure.rigid_modes
    root = np.sqrt(structure.shift) or 1.0
    Y = solver.solve_checked(B)
    C = dot(comm, B, Y)
    columns, dependence = independent_loads((C + C.T) / 2)
    B = B[:, columns]
    Y = Y[:, columns]

    W = np.eye(len(columns))
    for again in range(min(len(columns), 2)):
        if again:  # differences of nearly equal loads are solved for anew
            Y = solver.solve_block(B @ W)
        C = dot(comm, B @ W, Y)
        L = np.linalg.cholesky((C + C.T) / 2)
        coupling = dot(comm, R, B @ W).T / root
        coupling = scipy.linalg.solve_triangular(L, coupling, lower=True).T
        V, sigma, U = np.linalg.svd(coupling)
        inverse_LT = scipy.linalg.solve_triangular(L, U.T, lower=True, trans="T")
        W = W @ inverse_LT
        Y = Y @ inverse_LT

    sigma = np.append(sigma, np.zeros(len(columns) - len(sigma)))
    return columns, dependence, W, Y, V, sigma


def independent_loads(C: Array) -> tuple[IntArray, Array]:
    """Pivoted Cholesky of a compliance C (c, c): (numbers (p,) of its independent columns,
    displacements (c, p) of all columns for unit displacements of the independent ones)."""
    size = np.sqrt(np.maximum(C.diagonal(), 0.0))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    unit = C * scale[:, None] * scale
    schur = unit.copy()
    independent_columns = []
    while schur.size and schur.diagonal().max() > LEAST_INDEPENDENT:
        pivots = schur.diagonal()
        # the first of nearly equal pivots, so that rounding does not choose between equal sites
        k = int(np.argmax(pivots > EQUAL_PIVOTS * pivots.max()))
        independent_columns.append(k)
        schur = schur - np.outer(schur[k], schur[k]) / pivots[k]
        schur[k] = 0.0
        schur[:, k] = 0.0
    columns = np.sort(np.array(independent_columns, dtype=int))
    dependence = np.linalg.solve(unit[np.ix_(columns, columns)], unit[columns]).T
    dependence = dependence * size[:, None] * scale[columns]
    dependence[columns] = np.eye(len(columns))
    return columns, dependence


def elastic_response(structure: Structure, solver: Solver, loads: Array) -> Array:
    """Elastic displacements (rows, k) under balanced `loads`, M-orthogonal to rigid motions."""
    comm = structure.comm
    R = structure.rigid_modes
    if not R.shape[1]:
        return solver.solve_checked(loads)
    MR = multiply(structure.M, R)

    def balanced(r: Array) -> Array:
        """Loads minus their components on the rigid modes."""
        return np.asarray(r - MR @ dot(comm, R, r))

    def elastic(x: Array) -> Array:
        """Shapes minus their components along the rigid modes."""
        return np.asarray(x - R @ dot(comm, MR, x))

    first = best = np.full(loads.shape[1], np.inf)
    idle_steps = 0
    steps = conjugate_gradients(
        balanced(loads),
        lambda x: balanced(multiply(structure.K, x)),
        lambda r: elastic(solver.solve_block(r)),
        lambda x, y: np.asarray(comm.allreduce(np.einsum("ij,ij->j", x, y))),
        STATIC_STEPS,
    )

    # rᵀA⁻¹r is the square of the error in energy, to the tenth that A differs from K
    for k, (x, squares, _) in enumerate(steps):
        first = squares if k == 0 else first
        idle_steps = 0 if (squares < best).any() else idle_steps + 1
        best = np.minimum(best, squares)
        goal = STATIC_ACCEPTED if idle_steps >= STATIC_IDLE_STEPS else STATIC_TOL
        if (best <= goal**2 * first).all():
            return elastic(x)

    raise NotConvergedError(
        f"the static mode of a structure with {R.shape[1]} rigid-body modes did not converge in "
        f"{STATIC_STEPS} steps: elements or materials are very uneven."
    )
