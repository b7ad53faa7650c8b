"""Rigid-body modes that hardly move the site: their share in the compliance, and their model.

With a rigid-body mode r of unit mass and a = b'r at the site, the receptance is

    H(x) = H_e(x) - a^2/x,      x = omega^2,      H_e = 1/Z_e that of the elastic motions alone.

The article's mode phi_CR = r/a has the mass 1/a^2, beside which every other mass is lost as a -> 0.
The elastic motions alone have a static mode and anti-oscillators of ordinary size whatever a is,
and a enters as one number: with the site constrained, the rigid-body mode acts as the mass 1/a^2 at
the site of the elastic model. So the antiresonances of the whole are the free frequencies of the
elastic model with that mass added to m0. No step takes a difference of large numbers.
"""

from __future__ import annotations

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.errors import NotConvergedError


def arrow_modes(k0: float, m0: float, m: Array, poles: Array) -> tuple[Array, Array]:
    """Free modes of the anti-oscillator model, to full relative precision for any ratio of masses.

    Parameters
    ----------
    k0, m0 : stiffness [N/m] and mass [kg] of the residual system; m0 = 0 removes its mode.
    m, poles : (N,) masses > 0 [kg] and *distinct* ascending omega_i^2 > 0 [rad^2/s^2].

    Returns
    -------
    x : (J,) squared free frequencies, J = N + 1, or N if m0 = 0.
    shape : (N + 1, J) mass-normalised modes; row 0 is the site.

    Notes
    -----
    The x_j are the zeros of Z(x) = k0 - x m0 - sum_i m_i x p_i/(p_i - x), which falls from +inf
    to -inf between two neighbouring poles p_i. Each is sought as a shift from its nearest pole,
    so that p_i - x_j is never a difference of nearly equal numbers (the device of
    divide-and-conquer eigensolvers); a dense eigensolver would lose the low modes to the rounding
    of the highest as m0 -> 0.
    """
    n = poles.size
    if n == 0:
        if m0 == 0:
            return np.zeros(0), np.zeros((1, 0))
        return np.array([k0 / m0]), np.array([[1 / np.sqrt(m0)]])
    size = n + (m0 > 0)
    m, poles = (np.ascontiguousarray(each, dtype=float) for each in (m, poles))
    x, shape = np.empty(size), np.empty((n + 1, size))
    lost = march.library.aom_arrow_modes(k0, m0, n, *map(march.address, (m, poles, x, shape)))
    if lost or not (np.isfinite(x).all() and np.isfinite(shape).all()):
        raise NotConvergedError(
            f"{lost or size} of {size} free frequencies have not converged; masses or frequencies"
            f" differ too much for double precision."
        )
    return x, shape


#: Share of the rigid-body motions in the compliance b'(K + sM)^-1 b, s about a tenth of the first
#: elastic omega^2, below which the elastic motions are modelled alone and the rigid one is added.
SMALL_SHARE = 1e-4
#: Below this share it cannot be told from the rounding of the compliance: the site is one that no
#: rigid-body motion moves. The share in |H| at a lower omega^2 = x is this times s/x.
HIDDEN = 2.0**-52


def with_rigid(
    k0: float, m0: float, m: Array, omega: Array, a: float
) -> tuple[float, Array, Array, Array, Array]:
    """The elastic anti-oscillators and a rigid-body mode with the displacement a at the site.

    Parameters
    ----------
    k0, m0, m, omega : stiffness [N/m] > 0, residual mass [kg], masses (N,) [kg] and distinct
        ascending circular frequencies (N,) [rad/s] of the elastic motions alone.
    a : displacement of the site in the rigid-body mode of unit mass [kg^-1/2], > 0.

    Returns
    -------
    m0 : residual mass [kg] of the whole; its k0 is 0.
    m, omega : (N + 1,) masses and circular frequencies of the whole.
    residual : (N + 2,) the shape that moves with m0, in terms of r, phi_st, psi_1 ... psi_N.
    psi : (N + 2, N + 1) the shapes of the anti-oscillators in the same terms.
    """
    x, v = arrow_modes(a**2 * k0, 1 + a**2 * m0, a**2 * m, omega**2)
    masses = (v[0] / a) ** 2
    moved = 1 + a**2 * m0
    residual = np.concatenate([[a * m0], [1.0], -np.ones(len(m))]) / moved
    psi = v[0] * np.vstack([v[0] / a, -v[0], v[0] - v[1:]])
    return m0 / moved, masses, np.sqrt(x), residual, psi
