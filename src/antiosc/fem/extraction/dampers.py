"""Dampers of a structure in the free modes of its models.

A damper is C = Gᵀ c G. In the mass-normalised free modes φ_j the matrix D = ΦᵀCΦ takes its place,
and models have room for its diagonal: modes that decay each for itself, d_j = D_jj/2. In resonance
mode i carries a share |D_ij| ω_i/|ω_i² − ω_j²| of mode j, by perturbation, and its frequency shifts
by D_ij² ω_i/|ω_i² − ω_j²| of the width D_ii of its peak. Both are summed over j,

    κ = max_i Σ_j max(|D_ij|, D_ij²/D_ii) ω_i / |ω_i² − ω_j²|,

the relative error of a peak (Warburton and Soni, *Earthquake Eng. Struct. Dyn.* 5 (1977) 157). It
is small for light dampers and frequencies that lie apart. A model does not have all modes, and what
moves at the other end of a damper it may not have at all: the compliance of the dampers' ends
that its modes leave, G(K + sM)⁻¹Gᵀ − Σ_j Gφ_j(Gφ_j)ᵀ/(ω_j² + s), must be a small share of it all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse

from antiosc.base._types import Array
from antiosc.base.errors import AccuracyError, InputError
from antiosc.fem.linalg.algebra import dot
from antiosc.fem.structure.structure import Structure
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.modal import Damping

#: Largest coupling of two free modes by the dampers.
COUPLING = 0.1
#: Share of the largest entry of D that rounding leaves of a motion that no damper brakes.
UNBRAKED = 1e-9
#: Share of the compliance at the ends of dampers that a model may leave out.
UNOBSERVED_SHARE = 0.1
TINY = np.finfo(float).tiny


def refuse_dampers(structure: Structure, what: str) -> None:
    """InputError for a structure with dampers, which `what` does not take."""
    if structure.matrices.dampers():
        raise InputError(
            f"{what} does not take the dampers of an assembly: leave them out, or use extract."
        )


def damped(
    structure: Structure, model: AntiOscillators, given: Damping | None = None
) -> AntiOscillators:
    """The model with the damping `given`, or that of the structure's dampers in its free modes.

    Raises
    ------
    AccuracyError
        The dampers couple the modes too much.
    InputError
        A damper brakes a rigid-body motion; a model without shapes.
    """
    if given is not None:
        return replace(model, damping=given)
    dampers = structure.matrices.dampers()
    if not dampers:
        return model
    if model.shapes is None:
        raise InputError("the dampers of an assembly need the shapes of the model: shapes=True.")
    G = scipy.sparse.vstack([one for one, _ in dampers]).tocsr()
    c = scipy.linalg.block_diag(*(own for _, own in dampers))
    body = model.site_modes() if model.sites else model.modal()
    assert body.shape is not None
    phi = body.field(body.shape.T).T
    moved = np.asarray(structure.comm.allreduce(G @ phi))
    _check_seen(structure, G, c, moved, body.omega)
    D = moved.T @ c @ moved
    rigid = body.omega == 0
    if np.abs(D[rigid]).max(initial=0.0) > UNBRAKED * np.abs(D).max(initial=0.0):
        raise InputError(
            "a damper brakes a rigid-body motion, which has no frequency for a damping ratio: put "
            "a spring beside it that holds the motion."
        )
    D, omega = D[~rigid][:, ~rigid], body.omega[~rigid]
    converged = min(model.info.converged or 0, model.n)
    reliable = omega <= np.append(0.0, model.omega)[converged]
    coupling = _coupling(D[reliable][:, reliable], omega[reliable])
    if coupling > COUPLING:
        raise AccuracyError(
            f"the dampers couple the free modes by {coupling:.2g} (limit {COUPLING:g}): a damping "
            "ratio for each mode does not describe them; take weaker dampers, or damping ratios of "
            "the model, Damping(ratio=...)."
        )
    ratio = D.diagonal() / (2 * omega)
    ends = np.asarray(structure.comm.allreduce(G @ model.shapes))
    info = replace(
        model.info,
        damper_coupling=coupling,
        dampers={"ends": ends.tolist(), "damping": c.tolist()},
    )
    return replace(model, info=info, damping=Damping(ratio=np.maximum(ratio, 0.0).tolist()))


def _check_seen(structure: Structure, G: Any, c: Array, moved: Array, omega: Array) -> None:
    """AccuracyError where the model leaves out too much of the motion of the dampers' ends."""
    factor, load = structure.factorize(), G.T.toarray()
    whole = dot(structure.comm, load, factor.solve_block(load))
    seen = (moved / (omega**2 + structure.shift)) @ moved.T
    root = np.sqrt(c.diagonal())
    whole, seen = (root[:, None] * one * root for one in (whole, seen))
    share = 1 - np.trace(seen) / np.trace(whole)
    if share > UNOBSERVED_SHARE:
        raise AccuracyError(
            f"the model leaves out {share:.0%} of the compliance at the ends of the dampers (limit "
            f"{UNOBSERVED_SHARE:.0%}): raise n, or extract these ends as sites too, "
            "extract(structure, {name: Site, ...})."
        )


def _coupling(D: Array, omega: Array) -> float:
    """κ of the modes (module)."""
    x = omega**2
    apart = np.abs(x[:, None] - x)
    np.fill_diagonal(apart, np.inf)
    own = np.maximum(D.diagonal(), UNBRAKED * np.abs(D).max(initial=0.0))
    moved = np.abs(D) * np.maximum(1.0, np.abs(D) / np.maximum(own, TINY)[:, None])
    ratio = moved * omega[:, None] / np.maximum(apart, TINY)
    return float(ratio.sum(axis=1).max(initial=0.0))
