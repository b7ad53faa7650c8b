"""`extract`: a structure and a site into anti-oscillators."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from antiosc.checks import positive, whole
from antiosc.errors import AccuracyError, InputError
from antiosc.fem import compat
from antiosc.fem.algebra import Array, dot, multiply
from antiosc.fem.family import measure
from antiosc.fem.modes import Modes, ModeSolver
from antiosc.fem.site import Functional, Site, functional
from antiosc.fem.static import StaticMode, static_mode
from antiosc.fem.structure import Structure
from antiosc.model import AntiOscillators

#: A constraint mode whose m_i is below this share of m_st cannot be seen from the site.
UNSEEN = 1e-8
#: Frequencies closer than this (relatively) are one repeated frequency: only Σm_i has a meaning.
REPEATED = 1e-6
#: Limits of the self-check, relative: residual, M-orthogonality, constraint, mass balance.
CHECK = 1e-6


@dataclass(frozen=True)
class _Oscillators:
    """Anti-oscillators with their shapes ψ_i = c_i φ_i (rows of this rank, N)."""

    omega: Array
    m: Array
    psi: Array
    unseen: int
    merged: int


def extract(
    structure: Structure,
    site: Site,
    n: int = 20,
    method: str = "modes",
    tol: float = UNSEEN,
) -> AntiOscillators:
    """The anti-oscillator model of a structure at a site.

    Parameters
    ----------
    structure : Structure
    site : Site
    n : int
        Anti-oscillators wanted: modes that carry mass at the site. Fewer come back where the
        structure has fewer.
    method : "modes"
        SLEPc on the constrained eigenproblem, as in the article.
    tol : float
        Share of m_st below which a mode counts as massless at the site; its mass stays in m0.

    Returns
    -------
    AntiOscillators
        With `shapes` for the recovery of fields and `info` on what was found and dropped.

    Raises
    ------
    InputError
        A site off the structure or held by its supports, n above the dofs.
    NotConvergedError, AccuracyError
        A solver that failed, or a result that fails its own check.

    Notes
    -----
    Article (12), (15), (20), (23); with a rigid-body mode its section 3.3.
    """
    n = whole("n", n, least=0)
    positive("tol", tol)
    if method != "modes":
        raise InputError(f"method must be 'modes'; got {method!r}.")
    if n >= structure.dofs:
        raise InputError(
            f"n must be below the structure's {structure.dofs} dofs; got {n}: refine the mesh or "
            "ask for fewer anti-oscillators."
        )
    started = time.perf_counter()
    where = functional(structure, site)
    factored = "factorization" in structure.seconds
    structure.factorization  # noqa: B018  (timed on its own)
    located = time.perf_counter()
    static = static_mode(structure, where)
    modes, found = _observable(structure, where, static, n, tol)
    worst = _check(structure, where, static, modes)
    seconds = {
        **structure.seconds,
        "site": located - started - (0.0 if factored else structure.seconds["factorization"]),
        "modes": time.perf_counter() - located,
    }
    return _model(structure, site, where, static, found, len(modes.omega), worst, seconds)


def _observable(
    structure: Structure, where: Functional, static: StaticMode, n: int, tol: float
) -> tuple[Modes, _Oscillators]:
    """Constraint modes from below until `n` of them carry mass, or none is left that could."""
    solver = ModeSolver(structure, where, static)
    asked = n + 2 if n else 0
    while True:
        modes = solver.lowest(asked)
        found = _oscillators(structure, static, modes, tol)
        held = float(found.m.sum())
        enough = len(found.m) > n or static.mass - held <= tol * static.mass
        if enough or modes.complete or asked >= solver.limit or n == 0:
            return modes, _first(found, n)
        asked = min(solver.limit, len(modes.omega) + max(8, n // 2))


def _oscillators(
    structure: Structure, static: StaticMode, modes: Modes, tol: float
) -> _Oscillators:
    """m_i = (φ_stᵀMφ_i)² of M-orthonormal modes (Article (12)), repeated frequencies merged."""
    c = dot(structure.comm, modes.phi, static.m_phi)
    m = c**2
    # ω = 0 is left only by rounding: rigid modes that vanish at the site are deflated.
    seen = (m > tol * static.mass) & (modes.omega > 0)
    omega, c = modes.omega[seen], c[seen]
    psi = modes.phi[:, seen] * c
    if not len(omega):
        return _Oscillators(omega, c**2, psi, int(np.sum(~seen)), 0)
    start = np.flatnonzero(np.diff(omega, prepend=-np.inf) > REPEATED * omega)
    masses = np.add.reduceat(c**2, start)
    stiffnesses = np.add.reduceat(c**2 * omega**2, start)
    return _Oscillators(
        np.sqrt(stiffnesses / masses),
        masses,
        np.add.reduceat(psi, start, axis=1),
        int(np.sum(~seen)),
        len(omega) - len(start),
    )


def _first(found: _Oscillators, n: int) -> _Oscillators:
    return _Oscillators(found.omega[:n], found.m[:n], found.psi[:, :n], found.unseen, found.merged)


def _check(
    structure: Structure, where: Functional, static: StaticMode, modes: Modes
) -> dict[str, float]:
    """Measure the modes against what they must satisfy; AccuracyError beyond CHECK."""
    comm, phi = structure.comm, modes.phi
    k_phi, m_phi = multiply(structure.K, phi), multiply(structure.M, phi)
    # The constraint's reaction μ b balances K φ − ω²M φ at the site: φ_stᵀb = 1 gives μ.
    residual = k_phi - m_phi * modes.omega**2
    reaction = dot(comm, static.phi, residual)
    residual = residual - np.outer(where.b, reaction)
    # Forces are measured through A⁻¹ (an energy): of size ω²/(ω² + s) for a wrong mode.
    size = comm.allreduce(np.einsum("ij,ij->j", k_phi, k_phi)) + np.finfo(float).tiny
    off = np.sqrt(comm.allreduce(np.einsum("ij,ij->j", residual, residual)) / size)
    gram = dot(comm, phi, m_phi)
    b_norm = np.sqrt(dot(comm, where.b, where.b))
    amplitudes = np.sqrt(comm.allreduce(np.einsum("ij,ij->j", phi, phi)))
    total = float(np.sum(dot(comm, phi, static.m_phi) ** 2))
    measured = {
        "residual": float(off.max(initial=0.0)),
        "orthogonality": float(np.abs(gram - np.eye(len(gram))).max(initial=0.0)),
        "constraint": float(
            (np.abs(dot(comm, phi, where.b)) / (b_norm * amplitudes)).max(initial=0.0)
        ),
        "mass": max(0.0, total / static.mass - 1),
        "stiffness": abs(
            float(dot(comm, static.phi, multiply(structure.K, static.phi))) * _compliance(static)
            - 1
        )
        if static.k0
        else 0.0,
    }
    for name, value in measured.items():
        if not value <= CHECK:
            raise AccuracyError(
                f"the constraint modes fail their own check: {name} {value:.1e}, limit {CHECK:.0e}; "
                "the matrices may be ill-conditioned (very uneven elements or materials)."
            )
    return measured


def _compliance(static: StaticMode) -> float:
    return 1 / static.k0


def _model(
    structure: Structure,
    site: Site,
    where: Functional,
    static: StaticMode,
    found: _Oscillators,
    computed: int,
    checks: dict[str, float],
    seconds: dict[str, float],
) -> AntiOscillators:
    m0 = static.mass - float(found.m.sum())
    if abs(m0) <= 1e-12 * static.mass:
        m0 = 0.0
    info: dict[str, Any] = {
        "structure": structure.describe(),
        "dofs": structure.dofs,
        "method": "modes",
        "modes_computed": computed,
        "modes_unseen": found.unseen,
        "modes_merged": found.merged,
        "rigid_modes": int(structure.rigid_modes.shape[1]),
        "checks": checks,
        "seconds": seconds,
    }
    if where.point is not None and where.direction is not None:
        info["point"] = where.point.tolist()
        info["direction"] = where.direction.tolist()
    return AntiOscillators(
        m0=m0,
        k0=static.k0,
        m=found.m,
        omega=found.omega,
        local_compliance=where.local_compliance,
        radius=site.radius,
        participation=_participation(structure, where, static, found),
        shapes=np.column_stack([static.phi, found.psi]),
        info=info,
    )


def _participation(
    structure: Structure, where: Functional, static: StaticMode, found: _Oscillators
) -> Array | None:
    """φ_0ᵀMe and ψ_iᵀMe for e, the unit uniform acceleration along the impact; Σ = φ_stᵀMe."""
    weight = uniform_inertia(structure, where)
    if weight is None:
        return None
    own = np.asarray(dot(structure.comm, found.psi, weight))
    whole_shape = float(dot(structure.comm, static.phi, weight))
    return np.concatenate([[whole_shape - own.sum()], own])


def uniform_inertia(structure: Structure, where: Functional) -> Array | None:
    """Me on the rows of this rank; None for matrices, which do not tell where e points."""
    if structure.mesh is None or structure.form is None or where.direction is None:
        return None
    direction = compat.constant(structure.mesh.dolfinx, where.direction)
    load = structure.form.density * structure.form.along(direction) * measure(structure.mesh, 5)
    return compat.assemble_functional(load, structure.form.space)[: len(where.b)]
