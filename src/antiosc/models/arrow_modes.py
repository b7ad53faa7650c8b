"""The free modes of the anti-oscillator model of one site, whose mass matrix is an arrow."""

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
