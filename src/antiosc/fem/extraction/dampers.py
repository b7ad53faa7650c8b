"""Models of structures with dampers: the same basis for K, M and C.

A model's shapes V span what the sites and the ends of the dampers start: the Krylov space of A⁻¹M
from A⁻¹[MΦ, Gᵀ] (`antiosc.fem.extraction.krylov`), into which A⁻¹C leads too; a layer that relaxes
adds A⁻¹CV of each block. K, M and C are projected on V alike: VᵀCV is semidefinite for every number
of shapes, so that every model is passive.

Bound: the model's displacements Vy under unit forces on the sites at the complex frequency s leave
the residual ρ, the error of the receptance is ρᵀD⁻¹ρ with D = K + sC + s²M. For Re s > 0

    |xᴴDx| ≥ Re(s̄ xᴴDx)/|s| ≥ Re s/|s| (xᴴKx + |s|² xᴴMx),

since damping gives no energy: ‖ΔH‖ ≤ |s|/Re s max(1, σ/|s|²) ‖ρ‖² in the norm of A⁻¹, A = K + σM.
The residual lies in the space of the vectors that follow V in the recurrence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.fem.extraction.oscillators import Found, Kept
from antiosc.fem.extraction.site_shapes import SiteShapes
from antiosc.fem.structure.dissipation import Dissipation, projected
from antiosc.fem.structure.structure import Structure
from antiosc.models import driving_point
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.damping import DampingMatrix, of_factors
from antiosc.models.driving_point import semidefinite
from antiosc.models.modal import Damping

#: Least P of a mode at one site over the root of the static mass: dampers move it, the site hardly.
LEAST_SHARE = 1e-12
#: Share of the damping of the model by which dampers may brake motions that it has not.
UNBRAKED = 1e-12
#: Frequencies at which the residual is found at once.
AT_ONCE = 64


@dataclass(frozen=True)
class Reached:
    """The bound on the relative error of the receptance that a damped model has in its band."""

    error: float
    bottom: float


def every_mode(known: Found, n: int) -> Kept:
    """The n lowest of all modes found, whether the sites see them or the dampers alone."""
    order = np.argsort(known.poles, kind="stable")
    order = order[known.poles[order] > 0][:n]
    P = known.P[order].copy()
    if P.shape[1] == 1:
        least = LEAST_SHARE * np.sqrt(known.static.mass[0, 0])
        P = np.where(np.abs(P) < least, least, P)
    lost = np.delete(known.P, order, axis=0)
    return Kept(
        m0=semidefinite(known.m0 + lost.T @ lost),
        P=P,
        omega=known.modes.omega[order],
        residual=known.residual + np.delete(known.modes.phi, order, axis=1) @ lost,
        phi=known.modes.phi[:, order],
        unobservable=0,
        merged=0,
    )


def with_damping(
    structure: Structure, model: AntiOscillators, static: SiteShapes, terms: Sequence[Dissipation]
) -> AntiOscillators:
    """The model with the damping of the structure; InputError where it brakes a motion that the
    model does not have."""
    shapes = model.shapes
    assert shapes is not None
    V = (
        shapes
        if model.sites
        else np.column_stack([shapes[:, :1], shapes[:, 1:] / np.sqrt(model.m)])
    )
    if model.hidden is not None:
        V = np.column_stack([V, model.hidden])
    elif static.nodal.size:
        left = np.trace(projected(structure.comm, terms, static.nodal).matrix)
        whole = np.trace(projected(structure.comm, terms, V).matrix)
        if left > UNBRAKED * whole:
            raise InputError(
                "a damper brakes a rigid-body motion that the site does not see, and that matrices "
                "without coordinates do not tell: give them a map with coordinates."
            )
    return _with_losses(structure, model, projected(structure.comm, terms, V) if terms else None)


def _with_losses(
    structure: Structure, model: AntiOscillators, damping: DampingMatrix | None
) -> AntiOscillators:
    """The model with this damping and the loss factors of the materials, by modal strain energy.

    ζ_j = Σ η_m U_jm/(2 U_j) with the shares U_jm of the materials in the strain energy of mode j
    (E. Ungar, E. Kerwin, *J. Acoust. Soc. Am.* 34 (1962) 954).
    """
    body = model.free_modes
    assert body.basis is not None
    assert body.shape is not None
    losses = structure.matrices.loss_stiffness(np.column_stack(body.basis))
    if losses is None:
        return replace(model, damping=damping)
    phi = body.amplitudes(body.shape.T)
    elastic = body.omega > 0
    ratio = np.einsum("ja,ab,jb->j", phi, losses, phi)[elastic] / (2 * body.omega[elastic] ** 2)
    ratio = np.maximum(ratio, 0.0)
    if damping is None:
        return replace(model, damping=Damping(ratio=ratio.tolist()))
    # in the coordinates of the matrix: q of what moves, by the inverse of the modes
    amplitude = phi.T.copy()
    if not model.sites:
        amplitude[1 : 1 + model.n] *= np.sqrt(model.m)[:, None]
    modes = np.linalg.pinv(amplitude)[elastic]
    own = np.sqrt(2 * ratio * body.omega[elastic])[:, None] * modes
    factor = np.vstack([damping.factor, own])
    return replace(model, damping=of_factors(factor, damping.factors))


def band_error(
    structure: Structure,
    static: SiteShapes,
    vectors: Array,
    H: Array,
    c: Array,
    n: int,
    band: float,
    terms: Sequence[Dissipation],
) -> Reached:
    """The bound of the module for the first n of the vectors V; H = VᵀMV and c = VᵀMΦ of all."""
    p, k = len(static.kept), vectors.shape[1]
    shift = structure.shift
    K, M = np.zeros((p + k, p + k)), np.zeros((p + k, p + k))
    M[:p, :p], M[p:, :p], M[:p, p:] = static.mass, c, c.T
    M[p:, p:] = H
    K[:p, :p], K[p:, p:] = static.k0, np.eye(k) - shift * M[p:, p:]
    damping = projected(structure.comm, terms, np.column_stack([static.phi, vectors]))
    own = slice(0, p + n)
    theta = np.linalg.eigvalsh(M[p : p + n, p : p + n])
    poles = np.maximum(1 / theta[theta > 0][::-1] - shift, 0.0)
    lowest = driving_point.lowest_frequency_at_sites(static.k0, static.mass, poles[poles > 0])
    omega = np.conj(driving_point.samples(band, lowest))
    load, root = np.eye(p + k)[:, :p], np.linalg.cholesky(K + shift * M)
    inverse = np.linalg.inv(root)
    worst = 0.0
    for at in np.array_split(omega, -(-omega.size // AT_ONCE)):
        s = 1j * at
        D = K + s[:, None, None] ** 2 * M + damping.stiffness(at)
        y = np.linalg.solve(D[:, own, own], load[None, own])
        rest = driving_point.spectral_norms(inverse @ (load - D[:, :, own] @ y))
        Z = driving_point.spectral_norms(np.linalg.inv(y[:, :p]))
        coercive = np.abs(s) / s.real * np.maximum(1.0, shift / np.abs(s) ** 2)
        worst = max(worst, float(np.max(coercive * rest**2 * Z)))
    return Reached(worst, float(abs(omega[0])))
