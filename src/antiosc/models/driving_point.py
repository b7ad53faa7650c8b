"""Error of the dynamic stiffness Z (driving point) of a model over a band of frequencies.

Z of an undamped model is infinite at its poles and zero at its zeros, where relative errors are
meaningless. Z is therefore compared at complex frequencies with 1 % damping, ω(1 + 0.01 i).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray, Numbers

#: damping ratio at which Z is evaluated
DAMPING = 0.01
#: lower end of the sampled band, over the lowest frequency of the model
START = 0.25
#: an anti-oscillator is unobservable if its share in |Z| at its own frequency, where it is largest,
#: is below this
UNOBSERVABLE = 1e-8


Stiffness = Callable[[ComplexArray], Numbers]


def samples(top: float, lowest: float, step: float = DAMPING) -> ComplexArray:
    """Damped circular frequencies up to `top` [rad/s], dense enough to meet every peak of Z.

    `lowest`: the first frequency [rad/s] at which Z varies; below it Z is quasi-static. `step`:
    relative distance of neighbouring samples; a peak has the width of the damping.
    """
    start = START * min(top, lowest)
    count = int(np.ceil(np.log(top / start) / step)) + 2
    return np.geomspace(start, top, count) * (1 + 1j * DAMPING)


def shares(k0: ArrayLike, m0: ArrayLike, m: ArrayLike, poles: ArrayLike) -> Array:
    """|change of Z| over |Z| (..., N) at each damped pole if its mass is added to m0 instead.

    For models of one site: k0, m0 (...,) and m, poles = omega_i^2 (..., N), m = 0 for no pole. Z is
    written with m0, not with m_st = m0 + sum(m_i), since -x m_st would cancel the term of a large
    m_i.
    """
    k0, m0, m, poles = (np.asarray(a, dtype=float) for a in (k0, m0, m, poles))
    weight = np.where(m > 0, m * poles, 0.0)
    poles = np.where(m > 0, poles, -1.0)
    share = np.zeros(m.shape)
    for i in range(m.shape[-1]):  # one after the other: all at once take N times the memory
        pole = np.where(m[..., i] > 0, poles[..., i], 1.0)
        x = pole * (1 + 1j * DAMPING) ** 2
        Z = k0 - x * (m0 + np.sum(weight / (poles - x[..., None]), axis=-1))
        share[..., i] = m[..., i] * np.abs(x**2 / (pole - x) / Z)
    return share


def shares_of_receptance(b: ArrayLike, poles: ArrayLike) -> Array:
    """|change of H| over |H| (J,) at each damped pole without its mode; H = sum b^2/(poles - x)."""
    weight = np.asarray(b, dtype=float) ** 2
    poles = np.asarray(poles, dtype=float)
    share = np.ones(poles.shape)  # of a rigid-body mode at its own frequency, 0
    for i in np.flatnonzero(poles > 0):
        parts = weight / (poles - poles[i] * (1 + 1j * DAMPING) ** 2)
        share[i] = np.abs(parts[i]) / max(float(np.abs(np.sum(parts))), np.finfo(float).tiny)
    return share


def stiffness_error(Z: Stiffness, reference: Stiffness, band: float, lowest: float) -> float:
    """Largest |Z - Z_ref|/|Z_ref| over the band up to `band` [rad/s], with one per cent damping.

    Z, reference : dynamic stiffness [N/m] of complex circular frequencies. The band is sampled down
    to a quarter of `lowest` [rad/s].
    """
    s = samples(checks.positive("band", band, "rad/s"), checks.positive("lowest", lowest, "rad/s"))
    exact = reference(s)
    return float(np.max(np.abs(Z(s) - exact) / np.abs(exact)))
