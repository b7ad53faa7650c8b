"""All sites at once: the half-sine pulse at each whose signals are nearest to the measured ones.

In the free modes the signal of sensor s is sum_j s_sj b_j g_j(t - t0), g_j being the response of
mode j to a pulse. For each duration of the pulse the best amplitude is in closed form; the products
of the measured signals with all delayed g_j come from one Fourier transform, and are the same for
all sites. Frequencies of the model are off: mode j counts with the mean of its phase,
exp(-(e w_j t)²/2) for frequencies of relative standard deviation e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from antiosc.base._types import Array
from antiosc.studies.find.forward import Struck

#: Durations of pulses: the shortest over the period of the band's top, the longest over the
#: record; how many.
SHORTEST, LONGEST, PULSES = 0.4, 0.3, 9
#: Windows at which the energy of signals that the record's end cuts is known.
WINDOWS = 9
#: Frequency that stands for a rigid-body mode, over one over the record.
SLOW = 1e-3
#: Sites at a time.
AT_ONCE = 512


@dataclass(frozen=True, eq=False)
class Scan:
    """The best pulse at each of P sites.

    Attributes
    ----------
    explained : (P,) share of the signals' weighted power that it explains.
    duration, start, amplitude : (P,) of the pulse [s], [s], [N].
    """

    explained: Array
    duration: Array
    start: Array
    amplitude: Array


def scan(model: Struck, spread: float) -> Scan:
    """The best pulses of all sites; `spread`: relative standard deviation of the frequencies."""
    data, omega, decay, b = model.data, model.omega, model.decay, model.table[:, :-2]
    n, T = len(data.values), data.duration
    size = fft.next_fast_len(2 * n, real=True)
    D = fft.rfft(data.values / data.sigma, size, axis=0)
    power = float(np.sum((data.values / data.sigma) ** 2))
    slow = SLOW / T
    lam = -decay + 1j * np.sqrt(np.maximum(omega**2 - decay**2, slow**2))
    ends = np.linspace(0, n, WINDOWS + 1).astype(int)[1:]
    longest = max(LONGEST * T, 2 * data.dt)
    shortest = min(SHORTEST * 2 * np.pi / data.band, longest)
    best = np.zeros((4, len(b)))
    for tau in np.geomspace(shortest, longest, PULSES):
        table = pulse_responses(lam, tau, data.time)
        fading = np.exp(-((spread * np.abs(lam.imag)[None] * data.time[:, None]) ** 2) / 2)
        Q = np.zeros((size // 2 + 1, len(lam)), dtype=complex)
        gram = np.zeros((WINDOWS, len(lam), len(lam)))
        for s, order in enumerate(model.orders):
            g = table[order] * fading * (model.rows[s] / data.sigma[s])
            Q += np.conj(fft.rfft(g, size, axis=0)) * D[:, s, None]
            first = 0
            for k, end in enumerate(ends):
                gram[k:] += g[first:end].T @ g[first:end]
                first = end
        products = fft.irfft(Q, size, axis=0)[: n - 1].T
        for first in range(0, len(b), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            _keep(best[:, part], b[part], products, gram, ends, tau)
    explained, duration, lag, amplitude = best
    return Scan(explained / power, duration, lag * data.dt, amplitude)


def _keep(best: Array, b: Array, products: Array, gram: Array, ends: Array, tau: float) -> None:
    """Improve the best pulses (4, P) of sites b (P, J) by those of duration tau."""
    lags = products.shape[1]
    energy = np.einsum("pj,kjl,pl->pk", b, gram, b, optimize=True)
    left = ends[-1] - np.arange(lags)
    at = np.interp(left, ends, np.arange(len(ends)))
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, len(ends) - 1)
    # the energy of the longest lags is that of the shortest window at least
    E = energy[:, low] + (at - low) * (energy[:, high] - energy[:, low])
    A = np.maximum(b @ products, 0.0)
    gain = A**2 / np.maximum(E, np.finfo(float).tiny)
    lag = np.argmax(gain, axis=1)
    row = np.arange(len(b))
    better = gain[row, lag] > best[0]
    amplitude = A[row, lag] / np.maximum(E[row, lag], np.finfo(float).tiny)
    new = np.array([gain[row, lag], np.full(len(b), tau), lag, amplitude])
    best[:, better] = new[:, better]


def pulse_responses(lam: Array, tau: float, t: Array) -> list[Array]:
    """Responses (n, J) of modes lam = -d + i w to sin(pi t/tau): q, q' and q''."""
    until, rate = np.minimum(t, tau)[:, None], np.pi / tau
    after = t[:, None] - until

    def driven(w: float) -> Array:
        # integral of exp(i w s) exp(lam (t - s)) from 0 to min(t, tau)
        return (np.exp(1j * w * until) - np.exp(lam * until)) / (1j * w - lam) * np.exp(lam * after)

    z = (driven(rate) - driven(-rate)) / 2j
    force = np.where(after > 0, 0.0, np.sin(rate * until))
    q = z.imag / lam.imag
    v = z.real + lam.real * q
    a = force - np.abs(lam) ** 2 * q + 2 * lam.real * v
    return [np.asarray(q), np.asarray(v), np.asarray(a)]
