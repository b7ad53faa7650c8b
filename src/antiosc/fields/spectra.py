"""Shock response spectra of signals."""

from __future__ import annotations

import os
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.texts import CompletedResult, engineering, range_text
from antiosc.plot.charts import figure_or_path, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Oscillators in a decade, as standards of shock tests have it (MIL-STD-810, IEC 60068-2-81), …
FREQUENCIES_PER_DECADE = 48
#: … and the lowest frequency [Hz]; lower ones are taken for signals that last longer only.
DEFAULT_LOWEST_FREQUENCY = 10.0
#: Samples of an oscillator's period: extremes by parabolas are within 0.02 % of a sine's.
SAMPLES_PER_PERIOD = 20
#: Unequal steps are replaced by this share of their lower decile.
DECILE_FRACTION = 0.5
#: Deviation of a step from the mean one, over it, up to which samples are taken as equally spaced.
STEP_TOLERANCE = 1e-6
#: Most samples of a signal after interpolation.
MAX_SAMPLES = 5_000_000


@dataclass(frozen=True, eq=False, repr=False)
class ShockSpectrum(CompletedResult):
    """Extreme responses of oscillators to one signal, in its unit.

    Attributes
    ----------
    frequency : (m,) natural frequencies, Hz.
    positive, negative : (m,) largest positive response, and the size of the largest negative one.
    Q : quality factor 1/(2ζ).
    """

    frequency: Array
    positive: Array
    negative: Array
    Q: float

    @property
    def maximax(self) -> Array:
        """(m,) largest absolute response."""
        return np.maximum(self.positive, self.negative)

    def plot(self, path: str | os.PathLike[str] | None = None, unit: str = "m/s²") -> Figure | Path:
        """The spectrum over the frequency, both logarithmic; written to `path` if it is given.

        `unit` is the unit of the signal.
        """
        unit = checks.text("unit", unit)
        figure = new_figure((7.0, 4.0), shown=path is None)
        axes = figure.subplots()

        for name, style in (("maximax", "-"), ("positive", "--"), ("negative", ":")):
            axes.loglog(self.frequency, getattr(self, name), style, label=name)
        axes.set(xlabel="natural frequency (Hz)", ylabel=f"largest response ({unit})")
        axes.set_title(f"shock response spectrum, Q = {self.Q:g}")
        axes.grid(visible=True, which="both", alpha=0.3)
        axes.legend()
        return figure_or_path(figure, path)

    def _facts(self) -> list[tuple[str, str]]:
        k = int(np.argmax(self.maximax))
        top = f"{self.maximax[k]:.4g}, at {engineering(self.frequency[k], 'Hz')}"
        return [
            ("frequency", range_text(self.frequency[0], self.frequency[-1], "Hz")),
            ("maximax", f"at most {top}"),
            ("Q", f"{self.Q:g}"),
        ]


@checks.within_range
def srs(
    t: ArrayLike,
    a: ArrayLike,
    frequencies: ArrayLike | None = None,
    Q: float = 10.0,
    *,
    signal: str = "acceleration",
    resolved: float = inf,
) -> ShockSpectrum:
    """Shock response spectrum: extreme absolute accelerations of oscillators on a moving base.

    Each oscillator has the natural frequency f and the damping ratio ζ = 1/(2Q) and rests at the
    start. The base has the acceleration `a`, linear between samples, for which the response is
    exact (ramp-invariant filter of D. O. Smallwood, Shock and Vibration Bulletin 51 (1981)
    279-288). The response is computed until one period of the oscillator after the signal. The
    signal is interpolated to at least 20 samples per period of each oscillator; parabolas give the
    extremes between samples (to about 1e-4).

    The accelerations of a struck structure contain its highest natural frequencies, which samples
    at usual steps do not resolve: their spectrum is then wrong at low frequencies too. Give
    velocities instead: between two samples the mean acceleration is exact.

    Parameters
    ----------
    t : array_like (n,)
        Ascending times, s. Unequal steps are replaced by equal ones of half their lower decile,
        with linear interpolation; at most 5 million samples.
    a : array_like (n,)
        The signal, for instance m/s²; with `signal="velocity"` the velocity, for instance m/s.
    frequencies : array_like (m,), optional
        Natural frequencies, Hz; default: 48 per decade, from the lower of 10 Hz and 1/duration to
        the lower of a twentieth of the sampling rate and `resolved`.
    Q : float
        1/(2ζ), above 0.5.
    signal : "acceleration" or "velocity"
        The quantity of `a`. For a velocity, the acceleration is constant between samples and zero
        after the last one: a velocity that still oscillates there makes the spectrum too large.
    resolved : float
        Frequency in Hz up to which the signal is known (`resolved_frequency` of its model).

    Raises
    ------
    InputError
        Times that do not ascend, frequencies that are not positive, too many samples.
    """
    t, a = _checked_signal(t, a)
    Q = checks.positive("Q", Q)
    if Q <= 0.5:
        raise InputError(f"Q must be above 0.5 (Q = 1/(2 ζ), and ζ below 1); got {Q:g}.")
    checks.choice("signal", signal, ("acceleration", "velocity"))
    if not checks.is_rigid(resolved):
        resolved = checks.nonnegative("resolved", resolved, "Hz")

    if frequencies is None:
        f = _default_frequencies(t, resolved)
    else:
        f = checks.column("frequencies", frequencies)
    if not f.size or f.min() <= 0:
        raise InputError("frequencies must be > 0 Hz, at least one.")

    extremes = np.array([_extreme_responses(t, a, each, Q, signal) for each in f.tolist()])
    return ShockSpectrum(f, extremes[:, 0], extremes[:, 1], Q)


def _default_frequencies(t: Array, resolved: float) -> Array:
    """Default frequencies (m,) [Hz] of the spectrum of a signal known up to `resolved` [Hz]."""
    span = float(t[-1] - t[0])

    # one period after the signal must not take more samples than there may be
    low = max(min(DEFAULT_LOWEST_FREQUENCY, 1 / span), 2 / (MAX_SAMPLES * _even_step(t)[0]))
    top = max((t.size - 1) / span / SAMPLES_PER_PERIOD, 10 / span)
    top = max(min(top, resolved), 2 / span, 2 * low)

    count = int(np.ceil(FREQUENCIES_PER_DECADE * np.log10(top / low))) + 1
    return np.geomspace(low, top, max(2, count))


def _checked_signal(t: ArrayLike, x: ArrayLike) -> tuple[Array, Array]:
    """(times, values) as arrays of equal length; one of several equal times (jumps) is kept."""
    time = checks.column("t", t)
    value = checks.column("the signal", x, time.size)
    if np.any(np.diff(time) < 0):
        raise InputError("t must ascend: the times of the samples.")
    is_new = np.append(True, np.diff(time) > 0)[: time.size]
    if is_new.sum() < 2:
        raise InputError(f"the signal needs two samples or more; got {int(is_new.sum())}.")
    return time[is_new], value[is_new]


def _even_step(t: Array) -> tuple[float, bool]:
    """(step [s] of the times or of a replacement, whether the times are equally spaced)."""
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / steps.size
    if np.abs(steps - mean).max() <= STEP_TOLERANCE * mean:
        return mean, True
    return DECILE_FRACTION * float(np.quantile(steps, 0.1)), False


def _resampled(t: Array, x: Array, step: float) -> tuple[Array, Array]:
    """(times, values) at equal steps of at most `step` [s], by linear interpolation."""
    sample_step, is_even = _even_step(t)
    span = float(t[-1] - t[0])
    if is_even:
        finer = max(1.0, np.ceil(sample_step / step * (1 - STEP_TOLERANCE)))
        count = _checked_samples((t.size - 1) * finer)
    else:
        count = _checked_samples(np.ceil(span / min(step, sample_step)))
    times = np.linspace(t[0], t[-1], round(count) + 1)
    return times, np.interp(times, t, x)


def _checked_samples(samples: float) -> float:
    """Returns `samples`; InputError for more than `MAX_SAMPLES`."""
    if samples > MAX_SAMPLES:
        raise InputError(
            f"the signal would have {samples:.3g} samples, more than {MAX_SAMPLES:g}: give fewer "
            "or lower frequencies, or samples that are not as close."
        )
    return samples


def _extreme_responses(t: Array, a: Array, f: float, Q: float, signal: str) -> tuple[float, float]:
    """(largest positive, largest negative response) of an oscillator of frequency f [Hz]."""
    times, x = _resampled(t, a, 1 / (SAMPLES_PER_PERIOD * f))
    h = float(times[-1] - times[0]) / (times.size - 1)
    tail = round(_checked_samples(np.ceil(1 / (f * h)) + 1 + x.size)) - x.size

    if signal == "velocity":  # the mean acceleration of each step
        means = np.concatenate([np.diff(x) / h, np.zeros(tail + 1)])
        y = _oscillator_acceleration(f, Q, h, "zoh", means)
    else:  # the base was at rest: a signal that begins with a jump does so at its first sample
        changes = np.concatenate([x - x[0], np.full(tail, -x[0])])
        y = _oscillator_acceleration(f, Q, h, "foh", changes)
        y += x[0] * _oscillator_acceleration(f, Q, h, "zoh", np.ones(y.size))

    return _largest_response(y), _largest_response(-y)


def _oscillator_acceleration(f: float, Q: float, h: float, hold: str, x: Array) -> Array:
    """Absolute acceleration at steps of h [s]; in a step x is constant (`hold` "zoh") or linear."""
    from scipy.signal import cont2discrete, lfilter, ss2tf  # which take long to load

    w = 2 * np.pi * f
    A, B = np.array([[-w / Q, -(w**2)], [1.0, 0.0]]), np.array([[1.0], [0.0]])
    C, D = np.array([[w / Q, w**2]]), np.zeros((1, 1))
    *discrete, _ = cont2discrete((A, B, C, D), h, hold)
    numerator, denominator = ss2tf(*discrete)
    return np.asarray(lfilter(numerator.ravel(), denominator, x))


def _largest_response(y: Array) -> float:
    """Largest value of a response, at least 0, by the parabola at its largest sample."""
    k = int(np.argmax(y))
    top = float(y[k])
    if 0 < k < y.size - 1:
        curvature = 2 * top - y[k - 1] - y[k + 1]
        if curvature > 0:
            top += float((y[k + 1] - y[k - 1]) ** 2 / (8 * curvature))
    return max(0.0, top)  # of -0.0 too
