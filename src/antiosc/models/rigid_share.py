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

from antiosc.base._types import Array
from antiosc.models.arrow_modes import arrow_modes

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
