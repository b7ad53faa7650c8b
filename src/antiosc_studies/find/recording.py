"""Sensors, and the band, noise and filter of their signals."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike
from scipy import signal

from antiosc import Structure
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc.base.files import check_readable
from antiosc.base.texts import FieldsRepr
from antiosc.recovery import source
from antiosc.recovery.place import Reach, place
from antiosc.reduce.site.site import located_point
from antiosc_studies.measured.tables import MOTION_UNITS, STRAIN_UNITS, TIME_UNITS, columns_of_table

#: Quantity of a sensor -> order of the time derivative of displacement.
DERIVATIVE_ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2, "strain": 0}
#: Number of Gauss–Legendre points along a strain gauge.
GAUGE_POINT_COUNT = 6


@dataclass(frozen=True)
class Sensor(FieldsRepr):
    """A sensor on a structure: an accelerometer, a vibrometer, a strain gauge.

    Parameters
    ----------
    point : sequence of 3 (2) floats, or str
        Coordinates [m], or the name of a group, as for `probe`.
    direction : sequence of 3 (2) floats
        Direction in which the sensor measures; for strains, direction of the gauge.
    quantity : "acceleration" m/s², "velocity" m/s, "displacement" m or "strain"
    length : float, optional
        Length [m] over which a strain gauge averages; default: the strain at the point.
    surface : "top", "bottom", "middle" or sequence of 3 floats
        For a shell: the surface with the gauge, as for `probe`.
    part : str, optional
        For an assembly: the part with the sensor.
    """

    point: Sequence[float] | str
    direction: Sequence[float]
    quantity: str = "acceleration"
    length: float | None = None
    surface: str | Sequence[float] = "top"
    part: str | None = None

    def __post_init__(self) -> None:
        checks.choice("quantity", self.quantity, tuple(DERIVATIVE_ORDERS))
        if isinstance(self.point, str):
            checks.text("point", self.point)
        else:
            checks.store(self, point=checks.coordinates("point", self.point))

        direction = checks.coordinates("direction", self.direction, "")
        if not np.linalg.norm(direction):
            raise InputError("direction must not be the zero vector: the sensor measures along it.")
        checks.store(self, direction=direction)
        if self.length is not None:
            checks.store(self, length=checks.positive("length", self.length, "m"))
            if self.quantity != "strain":
                raise InputError(f"a length is that of a strain gauge, not of {self.quantity}.")

        place(self.surface, None, (0.0, 0.0), "global")
        if self.part is not None:
            checks.text("part", self.part)

    @property
    def derivative(self) -> int:
        """Order of the time derivative of displacement that the sensor measures."""
        return DERIVATIVE_ORDERS[self.quantity]


def sensor_shapes(sensor: Sensor, structure: Structure, shapes: Array) -> Array:
    """Displacement along a sensor, or its strain, (J,) for shapes (rows of this rank, J)."""
    d = np.pad(sensor.direction, (0, 3 - len(sensor.direction)))
    d = d / np.linalg.norm(d)
    x, part, end = located_point(structure, sensor.point, sensor.part)
    if end is not None:
        raise InputError(f"{sensor.point!r} has no mesh: a sensor sits on the mesh of a part.")

    fields = source(structure)
    reach = Reach("the point of the sensor")
    if sensor.quantity != "strain":
        columns = fields.at_point(structure, shapes, x, part, reach)
        return d[: len(columns)] @ columns

    nodes = np.zeros(1)
    weights = np.full(1, 2.0)
    if sensor.length is not None:
        nodes, weights = np.polynomial.legendre.leggauss(GAUGE_POINT_COUNT)

    points = x + np.outer(nodes, d) * (sensor.length or 0.0) / 2
    surface_place = place(sensor.surface, None, (0.0, 0.0), "global")
    strain = fields.recovered(structure, shapes, points, part, "strain", surface_place, reach)
    return np.einsum("p,i,pijk,j->k", weights / 2, d, strain, d, optimize=True)


#: Units of a sensor's quantity, with factors to SI.
SENSOR_UNITS = {
    "displacement": MOTION_UNITS["receptance"],
    "velocity": MOTION_UNITS["mobility"],
    "acceleration": MOTION_UNITS["accelerance"],
    "strain": STRAIN_UNITS,
}
#: Least number of samples.
MIN_SAMPLES = 32
#: Largest number of values of all signals.
MAX_SIGNAL_VALUES = 200_000
#: Share of a signal's power above the noise that its band contains.
BAND_POWER_SHARE = 0.995
#: Largest relative deviation of a table's time steps.
MAX_STEP_DEVIATION = 0.01
#: Least highest frequency of the band over the inverse of the record's length.
MIN_BAND_PERIODS = 4
#: Width of the filter's transition over its band.
TRANSITION_WIDTH = 0.3
#: Attenuation of the filter [dB]: to 0.1 %, the least noise of a signal.
FILTER_ATTENUATION = 60.0
#: Least noise of a signal over its root mean square.
MIN_RELATIVE_NOISE = 1e-3


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals of m sensors, prepared for comparison with a model."""

    values: Array  # (n, m)
    dt: float  # sampling interval [s]
    noise_sigma: Array  # (m,) standard deviation of the noise of a sample
    band: float  # circular frequency (rad/s) up to which they are compared
    #: (n', n) low-pass filter with decimation; it preserves a sample's noise level
    filter_matrix: scipy.sparse.csr_matrix

    @property
    def time(self) -> Array:
        """(n,) from the first sample [s]."""
        return self.dt * np.arange(len(self.values))

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return self.dt * len(self.values)

    @cached_property
    def scaled_signals(self) -> Array:
        """(n', m) the filtered signals divided by their noise."""
        return self.filter_matrix @ (self.values / self.noise_sigma)


def recording_of(
    signals: ArrayLike | str | os.PathLike[str],
    sensors: Sequence[Sensor],
    rate: float | None,
    noise: ArrayLike | None,
    band: float | None,
    max_band: float,
) -> Recording:
    """Checked signals (n, m) of m sensors with their noise and band; InputError if unsound."""
    count = len(sensors)
    if isinstance(signals, str | os.PathLike):
        signals, rate = _signals_of_table(checks.path("signals", signals), sensors, rate)
    rate = checks.positive("rate", rate, "Hz")
    values = checks.floats("signals", signals, None)
    if values.ndim == 1 and count == 1:
        values = values[:, None]

    if values.ndim != 2 or values.shape[1] != count:
        raise InputError(
            f"signals must have one column for each of the {count} sensors; got shape"
            f" {values.shape}."
        )
    if len(values) < MIN_SAMPLES or values.size > MAX_SIGNAL_VALUES:
        raise InputError(
            f"signals need {MIN_SAMPLES} samples or more, and at most {MAX_SIGNAL_VALUES} values;"
            f" got {len(values)} of {count} sensors: cut them to the time of the blow."
        )

    size = np.sqrt(np.mean(values**2, axis=0))
    if np.any(size == 0):
        raise InputError(f"the signal of sensor {int(np.argmin(size))} is zero throughout.")
    lowest = MIN_BAND_PERIODS * rate / len(values)
    if band is not None and not lowest <= band / (2 * np.pi) <= rate / 2:
        raise InputError(
            f"band must hold {MIN_BAND_PERIODS} periods of the record, {lowest:.4g} Hz, and end at"
            f" half the rate, {rate / 2:.4g} Hz; got {band / (2 * np.pi):.4g} Hz."
        )

    top = min(max_band, _signal_band(values, rate), np.pi * rate) if band is None else band
    if noise is None:
        sigma = np.maximum(_noise_sigma(values, rate, top), MIN_RELATIVE_NOISE * size)
    else:
        sigma = checks.positives("noise", noise)
        if sigma.size not in (1, count):
            raise InputError(
                f"noise is one standard deviation or one for each of {count} sensors; got"
                f" {sigma.size}."
            )
        sigma = np.broadcast_to(sigma, (count,))

    low_pass = _low_pass_matrix(len(values), top / (np.pi * rate))
    return Recording(values, 1 / rate, sigma, top, low_pass)


def _signals_of_table(
    path: Path, sensors: Sequence[Sensor], rate: float | None
) -> tuple[Array, float | None]:
    """The signals of a table, and their sampling rate if its first column contains times."""
    check_readable(path, "the signals")
    columns = columns_of_table(path)
    timed = len(columns) == len(sensors) + 1

    signals = columns[1:] if timed else columns
    if len(signals) == len(sensors):
        units = [SENSOR_UNITS[sensor.quantity] for sensor in sensors]
        values = np.column_stack([c.in_si(unit) for c, unit in zip(signals, units, strict=True)])
    else:
        values = np.column_stack([column.values for column in signals])  # refused by its shape

    if not timed:
        return values, rate
    t = columns[0].in_si(TIME_UNITS)
    if len(t) < MIN_SAMPLES:
        raise InputError(f"{path.name} has {len(t)} samples; {MIN_SAMPLES} or more are needed.")
    step = (t[-1] - t[0]) / (len(t) - 1)
    if not step > 0 or np.abs(np.diff(t) - step).max() > MAX_STEP_DEVIATION * step:
        raise InputError(f"the times in the first column of {path.name} do not ascend in one step.")
    return values, 1 / step


def _low_pass_matrix(n: int, top: float) -> scipy.sparse.csr_matrix:
    """Filter matrix (n', n) that keeps frequencies up to `top` times the highest frequency."""
    if top * (1 + TRANSITION_WIDTH) >= 1:
        return scipy.sparse.identity(n, format="csr")
    taps, beta = signal.kaiserord(FILTER_ATTENUATION, TRANSITION_WIDTH * top)
    kernel = signal.firwin(taps | 1, (1 + TRANSITION_WIDTH / 2) * top, window=("kaiser", beta))
    kernel /= np.linalg.norm(kernel)
    stride = int(1 / ((1 + TRANSITION_WIDTH) * top))
    half = len(kernel) // 2
    offsets = np.arange(-half, half + 1)
    in_window = np.abs(offsets) < n
    all_rows = scipy.sparse.diags(kernel[in_window], offsets[in_window], shape=(n, n), format="csr")
    return all_rows[::stride]


def _power_spectrum(values: Array, rate: float) -> tuple[Array, Array]:
    """Circular frequencies (F,), and the power spectrum (F, m) of each signal."""
    window = signal.windows.hann(len(values))[:, None]
    power = np.abs(np.fft.rfft(values * window, axis=0)) ** 2 / np.sum(window**2)
    return 2 * np.pi * np.fft.rfftfreq(len(values), 1 / rate), power


def _signal_band(values: Array, rate: float) -> float:
    """Frequency [rad/s] above which no signal exceeds its noise."""
    w, power = _power_spectrum(values, rate)
    floor = np.median(power[-len(w) // 4 :], axis=0) / np.log(2)
    excess = np.cumsum(power - floor, axis=0)
    ends = w[np.argmax(excess > BAND_POWER_SHARE * excess.max(axis=0), axis=0)]
    return float(max(ends.max(), w[MIN_BAND_PERIODS]))


def _noise_sigma(values: Array, rate: float, band: float) -> Array:
    """Standard deviations (m,) of the noise of one sample, from the spectrum above the band."""
    w, power = _power_spectrum(values, rate)
    noise_band = w > (1 + TRANSITION_WIDTH) * band
    if np.count_nonzero(noise_band) < MIN_SAMPLES // 4:
        noise_band = w > w[-len(w) // 4]
    return np.sqrt(np.median(power[noise_band], axis=0) / np.log(2))
