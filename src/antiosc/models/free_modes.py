"""Anti-oscillators at any site from one set of free modes.

With J free modes of a structure (omega_j, and b_j = b'phi_j at the site), its static compliance C
and the inertia G = y'My of its static deflection y under a unit force there,

    H(x) = sum_j b_j^2/(w_j^2 - x) + h(x),      x = omega^2,
    h(0)  = C - sum_j b_j^2/w_j^2 = r,          h'(0) = G - sum_j b_j^2/w_j^4 = s,

and h, the part of the truncated modes, is approximated by one mode that matches r and s: its
frequency is w_r^2 = r/s and its weight b_r^2 = r w_r^2. (Without G it has no mass: h = r.) If there
are rigid-body modes, and hence no static deflection, C and G belong to K + shift M, and the
expansion is about x = -shift.

The truncated modes have 0 < 1/w^2 <= 1/w_J^2. At real x, h therefore lies between the value of the
one mode and the chord r (1 - p + p/(1 - x/w_J^2)), p = s w_J^2/r, which gives an error bound at
every site. (The small damping at which Z is compared changes the bound by one per cent; between two
samples it may rise by a quarter.)

In these J + 1 coordinates the stiffness is diagonal, D = diag(w_j^2). The flexibility with the site
constrained is a rank-one change of A^-1, T = A^-1 - A^-1 b b'A^-1/C with A = D + shift. Its
eigenvectors are the constraint modes; its eigenvalues theta give the antiresonances, the zeros
1/theta - shift of H.

Z of an undamped model is infinite at its poles and zero at its zeros, where relative errors are
meaningless. Z is therefore compared at complex frequencies with 1 % damping, ω(1 + 0.01 i).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ArrayLike, ComplexArray, Numbers
from antiosc.base.errors import InputError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.motion import RIGID_SHARE

#: A residual compliance below this share of C is rounding error.
RESIDUAL_ROUNDING = 1e-9
#: Largest relative increase of a bound between two samples.
MAP_SAMPLE_RISE = 0.25
#: Number of sites processed at a time: their arrays fit in the cache.
SITES_AT_ONCE = 500


@dataclass(frozen=True, eq=False)
class SiteModels:
    """Parameters of the anti-oscillator models of S sites, as arrays."""

    #: k0, m0, m_st: (S,) static stiffness [N/m], residual mass [kg], static mass [kg]
    k0: Array
    m0: Array
    m_st: Array
    #: omega, m: (S, n) ascending [rad/s], masses [kg]; missing ones: omega = inf, m = 0
    omega: Array
    m: Array

    def dynamic_stiffness(self, omega: ArrayLike, part: slice = slice(None)) -> Numbers:
        """Z (S, W) [N/m] of the sites of `part` at circular frequencies (W,) [rad/s]."""
        x = checks.spectrum("omega", omega) ** 2
        Z = self.k0[part, None] - x * self.m0[part, None]
        for w, m in zip(self.omega[part].T, self.m[part].T, strict=True):
            has_mass = m > 0
            poles = np.where(has_mass, w, 1.0)[:, None] ** 2
            Z = Z - x * m[:, None] * poles / (poles - x)
        return np.asarray(Z)

    def model(self, i: int) -> AntiOscillators:
        """The model of site i."""
        i = checks.whole("i", i, least=0, most=len(self.k0) - 1)
        has_mass = self.m[i] > 0
        return AntiOscillators(
            m0=float(self.m0[i]),
            k0=float(self.k0[i]),
            m=self.m[i, has_mass],
            omega=self.omega[i, has_mass],
        )


@checks.within_range
def from_free_modes(
    omega: ArrayLike,
    b: ArrayLike,
    compliance: float,
    inertia: float | None = None,
    n: int | None = None,
    shift: float = 0.0,
) -> AntiOscillators:
    """The anti-oscillators of one site from free modes.

    Parameters
    ----------
    omega : array_like, shape (J,)
        Free frequencies [rad/s], ascending; 0 for rigid-body modes.
    b : array_like, shape (J,)
        Displacement of the site along the impact in each mass-normalised mode [kg^-1/2].
    compliance : float
        b'y [m/N], y = (K + shift M)^-1 b: for shift = 0 the static displacement of the site under
        a unit force.
    inertia : float, optional
        y'My [kg m^2/N^2]. None: the truncated modes have no mass.
    n : int, optional
        Number of anti-oscillators, chosen for the best Z(omega), as in `extract`; default: all.
        For the n lowest zeros of H, call `truncated(n)` of the whole model.
    shift : float
        Shift [rad^2/s^2], > 0 if a frequency is 0.

    Raises
    ------
    InputError
        Arrays that do not fit; modes that are more compliant than the structure.
    """
    b = checks.floats("b", b, (None,))
    C = np.array([checks.positive("compliance", compliance, "m/N")])
    G = None if inertia is None else np.array([checks.positive("inertia", inertia, "kg m^2/N^2")])
    return site_models(omega, b[None, :], C, G, n, shift).model(0)


@checks.within_range
def site_models(
    omega: ArrayLike,
    b: ArrayLike,
    compliance: ArrayLike,
    inertia: ArrayLike | None = None,
    n: int | None = None,
    shift: float = 0.0,
) -> SiteModels:
    """Anti-oscillators of S sites as `from_free_modes`; b (S, J), compliance and inertia (S,)."""
    omega = checks.floats("omega", omega, (None,))
    if not omega.size or np.any(omega < 0) or np.any(np.diff(omega) < 0) or omega[-1] == 0:
        raise InputError("omega must ascend from 0 or above to a frequency > 0.")
    b = checks.floats("b", b, (None, omega.size))
    C = checks.floats("compliance", compliance, (len(b),))
    G = None if inertia is None else checks.floats("inertia", inertia, (len(b),))
    shift = checks.nonnegative("shift", shift, "rad^2/s^2")
    if not shift and omega[0] == 0:
        raise InputError(
            "a rigid-body mode (omega = 0) has no static compliance: give a shift > 0, and the"
            " compliance and inertia of K + shift M."
        )

    count = omega.size + 1 if n is None else min(checks.whole("n", n), omega.size + 1)
    r, s = residual_parameters(omega, b, C, G, shift)

    # sites that rigid-body modes hardly move are moved by elastic ones alone
    if shift:
        rigid = omega == 0
        share = np.sum(b[:, rigid] ** 2, axis=1) / shift / C
        b = np.where(rigid & (share <= RIGID_SHARE)[:, None], 0.0, b)

    blocks = [slice(i, i + SITES_AT_ONCE) for i in range(0, len(b), SITES_AT_ONCE)]
    parts = [model_parameters(omega, b[i], r[i], s[i], count, shift) for i in blocks]
    return SiteModels(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def residual_parameters(
    omega: Array, b: Array, C: Array, G: Array | None, shift: float = 0.0
) -> tuple[Array, Array]:
    """Compliance r (S,) [m/N] and inertia s (S,) of the truncated modes: C, G (S,) of all modes
    minus those of the modes `omega` (J,), b (S, J). s = 0 without G; r = s = 0 with all modes."""
    x = omega**2 + shift
    modal = b**2 @ (1 / x)
    heavy = b**2 @ (1 / x**2)

    r = C - modal
    if np.any(r < -RESIDUAL_ROUNDING * C):
        worst = int(np.argmin(r / C))
        raise InputError(
            f"at site {worst} the free modes have a static compliance of {modal[worst]:.6g} m/N, "
            f"above that of the structure, {C[worst]:.6g} m/N: give that of the same site."
        )

    r = np.where(r <= RESIDUAL_ROUNDING * C, 0.0, r)
    if G is None:
        return r, np.zeros_like(r)
    s = np.clip(G - heavy, 0.0, r / x[-1])  # what is left out lies above the last mode
    return r, np.where(G - heavy > RESIDUAL_ROUNDING * G, s, 0.0)


@checks.within_range
def error_bound(
    models: SiteModels,
    omega: ArrayLike,
    b: ArrayLike,
    compliance: ArrayLike,
    inertia: ArrayLike,
    band: float,
    shift: float = 0.0,
) -> tuple[Array, Array]:
    """(bounds (S,) on |dZ|/|Z| due to the truncated modes, bounds due to keeping n
    anti-oscillators) up to `band` [rad/s], below the last mode, with one per cent of damping; their
    sum bounds the error. Other arguments as for `site_models`."""
    omega = checks.floats("omega", omega, (None,))
    b = checks.floats("b", b, (None, omega.size))
    C, G = (checks.floats(name, v, (len(b),)) for name, v in (("C", compliance), ("G", inertia)))
    band = checks.positive("band", band, "rad/s")
    if not band < omega[-1]:
        raise InputError(
            f"the band must end below the last free mode, {omega[-1]:g} rad/s; got {band:g} rad/s."
        )
    r, s = (v[:, None] for v in residual_parameters(omega, b, C, G, shift))

    # what `residual_parameters` took for rounding
    missing_compliance = np.where(r > 0, 0.0, np.abs(C - b**2 @ (1 / (omega**2 + shift)))[:, None])
    slow = np.where(s > 0, 0.0, np.abs(G - b**2 @ (1 / (omega**2 + shift) ** 2))[:, None])
    theta = s / np.where(r > 0, r, 1.0)
    p = theta * (omega[-1] ** 2 + shift)
    x_band = sample_frequencies(band, min(omega[omega > 0].min(), models.omega.min(initial=np.inf)))
    x = x_band**2
    z = x + shift
    pole_distance = np.abs(1 - z / (omega[-1] ** 2 + shift))
    modal = 1 / (omega[:, None] ** 2 - x)

    left_out = np.zeros(len(b))
    reduction = np.zeros(len(b))
    for i in range(0, len(b), SITES_AT_ONCE):
        part = slice(i, i + SITES_AT_ONCE)
        response = r[part] / (1 - z * theta[part])
        chord = r[part] * (1 - p[part] + p[part] / (1 - z / (omega[-1] ** 2 + shift)))
        H = b[part] ** 2 @ modal + response
        Z = models.dynamic_stiffness(x_band, part)
        rounding = missing_compliance[part] + slow[part] * np.abs(z)
        change = np.abs(chord - response) + rounding / pole_distance
        left_out[part] = np.max(np.abs(Z) * change, axis=1)
        reduction[part] = np.max(np.abs(Z * H - 1), axis=1)

    return (1 + MAP_SAMPLE_RISE) * left_out, (1 + MAP_SAMPLE_RISE) * reduction


#: Relative norm of a new direction after orthogonalisation, below which the space is exhausted.
EXHAUSTED_NORM = 1e-10
#: Square root of the share of m_st at the site below which it is rounding.
MASSLESS_ROOT = 1e-12


def model_parameters(
    omega: Array, b: Array, r: Array, s: Array, n: int, shift: float
) -> tuple[Array, Array, Array, Array, Array]:
    """(k0 (S,), m0 (S,), m_st (S,), omega (S, n), m (S, n)) of the models of S sites, from modes
    and `residual_parameters` r, s (S,); n and shift as in `from_free_modes`."""
    heavy = s > 0
    truncated_pole = np.where(heavy, r / np.where(heavy, s, 1.0), omega[-1] ** 2 + shift)
    A = np.column_stack([np.broadcast_to(omega**2 + shift, b.shape), truncated_pole])
    b = np.column_stack([b, np.sqrt(np.where(heavy, r * truncated_pole, 0.0))])
    massless = np.where(heavy, 0.0, r)
    bAb = np.sum(b**2 / A, axis=1) + massless
    rigid = np.append(omega == 0, False)
    deflection = np.where(rigid, 0.0, b / np.where(rigid, 1.0, A - shift))
    C = np.sum(b * deflection, axis=1) + massless

    # the static mode, or the rigid-body mode in its place
    rigid_mobility = np.sum(b[:, rigid] ** 2, axis=1)
    free = rigid_mobility > 0
    swing = np.where(rigid, b, 0.0) / np.where(free, rigid_mobility, 1.0)[:, None]
    phi = np.where(free[:, None], swing, deflection / C[:, None])
    m_st = np.sum(phi**2, axis=1)
    theta, c, left = _lanczos(A, b, bAb, massless, phi, n)
    k0 = np.where(free, 0.0, 1 / C)
    m = c**2
    with np.errstate(divide="ignore"):
        x = np.where(theta > 0, 1 / theta - shift, np.inf)
    is_pole = np.isfinite(x) & (x > 0)
    lumped = left + np.sum(np.where(is_pole, 0.0, m), axis=1)
    share = shares(k0, lumped, np.where(is_pole, m, 0.0), np.where(is_pole, x, 1.0))
    observable = share > UNOBSERVABLE_SHARE
    order = np.argsort(np.where(observable, x, np.inf), axis=1, kind="stable")
    x, m, observable = (np.take_along_axis(a, order, axis=1) for a in (x, m, observable))
    m0 = left + np.sum(np.where(observable, 0.0, m), axis=1)  # what is not kept, no difference
    m0 = np.where(m0 <= MASSLESS_ROOT**2 * m_st, 0.0, m0)
    frequency = np.sqrt(np.where(observable, x, np.inf))
    return k0, m0, m_st, frequency, np.where(observable, m, 0.0)


def _lanczos(
    A: Array, b: Array, bAb: Array, massless: Array, phi: Array, n: int
) -> tuple[Array, Array, Array]:
    """(Ritz values (S, n), coefficients of phi (S, n), residual mass (S,)) by Lanczos from T phi;
    T: A^-1 with the site fixed. `massless` r > 0 adds (b'v)^2/r to v'Av; r = 0 requires b'v = 0."""
    y = b / A
    soft = massless > 0
    stiff = np.where(soft, 1 / np.where(soft, massless, 1.0), 0.0)
    pin = np.where(soft, 0.0, 1 / np.where(soft, 1.0, np.sum(b * y, axis=1)))

    def elastic_response(v: Array) -> Array:
        """T v: displacements under the load v with the site fixed."""
        return np.asarray(v / A - y * (np.sum(y * v, axis=1) / bAb)[:, None])

    def force(v: Array) -> Array:
        """(A + b b'/r) v: forces for displacements v, the massless compliance included."""
        return np.asarray(A * v + b * (stiff * np.sum(b * v, axis=1))[:, None])

    sites, size = phi.shape
    V = np.zeros((sites, n, size))
    F = np.zeros((sites, n, size))
    H = np.zeros((sites, n, n))

    w = elastic_response(phi)
    for k in range(n):
        initial_energy = np.sum(w * force(w), axis=1)
        for _ in range(2):  # twice is enough (Kahan)
            h = np.einsum("skj,sj->sk", F[:, :k], w)
            w = w - np.einsum("skj,sk->sj", V[:, :k], h)
            w = w - y * (pin * np.sum(b * w, axis=1))[:, None]
        f = force(w)
        energy = np.sum(w * f, axis=1)
        is_new = energy > EXHAUSTED_NORM**2 * initial_energy
        beta = np.sqrt(np.where(is_new, energy, 0.0))
        scale = np.where(is_new, 1 / np.where(is_new, beta, 1.0), 0.0)[:, None]
        V[:, k] = w * scale
        F[:, k] = f * scale
        H[:, : k + 1, k] = H[:, k, : k + 1] = np.einsum("skj,sj->sk", V[:, : k + 1], V[:, k])
        w = elastic_response(V[:, k])

    theta, vectors = np.linalg.eigh(H)
    theta = np.where(theta > 0, theta, 0.0)
    scale = np.where(theta > 0, 1 / np.sqrt(np.where(theta > 0, theta, 1.0)), 0.0)
    shapes = np.einsum("skj,ski->sji", V, vectors) * scale[:, None]
    energy = phi
    c = np.zeros_like(theta)
    for _ in range(2):  # twice is enough (Kahan)
        part = np.einsum("sji,sj->si", shapes, energy)
        c = c + part
        energy = energy - np.einsum("sji,si->sj", shapes, part)
    return theta, c, np.sum(energy**2, axis=1)


#: damping ratio at which Z is evaluated
DAMPING_RATIO = 0.01
#: lower end of the sampled band, over the lowest frequency of the model
BAND_START_RATIO = 0.25
#: least share in |Z| at its own frequency, where it is largest, of an observable anti-oscillator
UNOBSERVABLE_SHARE = 1e-8


StiffnessFunction = Callable[[ComplexArray], Numbers]


def sample_frequencies(top: float, lowest: float, step: float = DAMPING_RATIO) -> ComplexArray:
    """Damped frequencies (W,) [rad/s] from min(lowest, top)/4 to top in relative steps `step`."""
    start = BAND_START_RATIO * min(top, lowest)
    count = int(np.ceil(np.log(top / start) / step)) + 2
    return np.geomspace(start, top, count) * (1 + 1j * DAMPING_RATIO)


def shares(k0: ArrayLike, m0: ArrayLike, m: ArrayLike, poles: ArrayLike) -> Array:
    """Relative change |dZ|/|Z| (..., N) at each damped pole omega_i^2 if its mass m (..., N) is
    added to m0 (...,). Z is computed from m0, as the m_st term would cancel that of a large m_i."""
    k0, m0, m, poles = (np.asarray(a, dtype=float) for a in (k0, m0, m, poles))
    weight = np.where(m > 0, m * poles, 0.0)
    poles = np.where(m > 0, poles, -1.0)

    share = np.zeros(m.shape)
    for i in range(m.shape[-1]):  # one after the other: all at once take N times the memory
        pole = np.where(m[..., i] > 0, poles[..., i], 1.0)
        x = pole * (1 + 1j * DAMPING_RATIO) ** 2
        Z = k0 - x * (m0 + np.sum(weight / (poles - x[..., None]), axis=-1))
        share[..., i] = m[..., i] * np.abs(x**2 / (pole - x) / Z)

    return share


def receptance_shares(b: ArrayLike, poles: ArrayLike) -> Array:
    """Share |dH|/|H| (J,) of each mode in H = sum b^2/(poles - x) at its own damped pole."""
    weight = np.asarray(b, dtype=float) ** 2
    poles = np.asarray(poles, dtype=float)
    share = np.ones(poles.shape)  # of a rigid-body mode at its own frequency, 0
    for i in np.flatnonzero(poles > 0):
        parts = weight / (poles - poles[i] * (1 + 1j * DAMPING_RATIO) ** 2)
        share[i] = np.abs(parts[i]) / max(float(np.abs(np.sum(parts))), np.finfo(float).tiny)
    return share


def stiffness_error(
    Z: StiffnessFunction, reference: StiffnessFunction, band: float, lowest: float
) -> float:
    """Largest |Z - Z_ref|/|Z_ref| from a quarter of `lowest` up to `band` [rad/s] with one per cent
    damping; `Z` and `reference` are functions of complex frequencies."""
    s = sample_frequencies(
        checks.positive("band", band, "rad/s"), checks.positive("lowest", lowest, "rad/s")
    )
    exact = reference(s)
    return float(np.max(np.abs(Z(s) - exact) / np.abs(exact)))
