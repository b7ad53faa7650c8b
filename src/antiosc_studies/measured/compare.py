"""`compare`: comparison of a measured force history with the computed one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from antiosc.base import checks
from antiosc.base._types import Array, Figure
from antiosc.base.errors import InputError
from antiosc.base.files import check_readable
from antiosc.base.texts import CompletedResult
from antiosc.plot.charts import figure_or_path, legend, panels
from antiosc_studies.measured.tables import FORCE_UNITS, TIME_UNITS, columns_by_name

#: Number of shifts in time that are tried first.
SHIFT_COUNT = 801
#: Number of samples of the computed force.
SAMPLE_COUNT = 4001
#: Fewest samples of a measured force.
MIN_SAMPLES = 8


@runtime_checkable
class ForceHistory(Protocol):
    """The compared attributes, of a `History` or a contact's history."""

    @property
    def time(self) -> Array:
        """Times (n,) [s]."""

    @property
    def force(self) -> Array:
        """Contact force (n,) [N]."""


@dataclass(frozen=True, eq=False, repr=False)
class ForceComparison(CompletedResult):
    """A measured force compared with the computed one.

    Attributes
    ----------
    time, measured, computed : (n,) [s], [N]: the measurement, shifted to the computed impact.
    shift : added to the measured times [s]; it minimises the difference.
    L2 : relative difference of the measured history from the computed one.
    scale : factor on the computed force that minimises the difference.
    scaled_L2 : the remaining difference with that factor.
    peak, impulse : measured over computed, minus 1.
    """

    time: Array
    measured: Array
    computed: Array
    shift: float
    L2: float
    scale: float
    scaled_L2: float
    peak: float
    impulse: float

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Both forces over time, and their difference; with `path` the picture is written."""
        figure, axes = panels(2, 1, size=(7.0, 4.6), shown=path is None, sharex=True)
        force_axes, error_axes = axes[:, 0]
        force_axes.plot(1e3 * self.time, self.measured, lw=2.2, color="0.6", label="measured")
        force_axes.plot(1e3 * self.time, self.computed, lw=1.2, label="computed")
        force_axes.set_ylabel("contact force (N)")
        force_axes.set_title(
            f"L2 {100 * self.L2:.2f} %, peak {100 * self.peak:+.2f} %, "
            f"impulse {100 * self.impulse:+.2f} %, scale {self.scale:.4g}",
            fontsize=9,
        )
        legend(force_axes)
        error_axes.plot(1e3 * self.time, self.measured - self.computed, lw=1.0, color="C3")
        error_axes.set_ylabel("difference (N)")
        error_axes.set_xlabel("time (ms)")
        return figure_or_path(figure, path)


@checks.within_range
def compare(
    hit: ForceHistory, measured: str | os.PathLike[str] | tuple[ArrayLike, ArrayLike]
) -> ForceComparison:
    """Compare a measured force history with the computed one, shifted in time for the best fit.

    Parameters
    ----------
    hit : History, or a contact's history of a scene
    measured : path, or (times, forces)
        A table with the columns time [s] and force [N], or the arrays; forces > 0 press.

    Returns
    -------
    ForceComparison
        With the shift in time that minimises the difference.

    Raises
    ------
    InputError
        A file or arrays without such a history; no force in one of the two.
    """
    if isinstance(hit, type) or not isinstance(hit, ForceHistory):
        raise InputError(f"hit must be the History of an impact; got {checks.shown(hit)}.")
    t, F = _measured_history(measured)
    time = checks.floats("hit.time", hit.time, (None,))
    force = checks.floats("hit.force", hit.force, None)
    for name, values in (("computed", force), ("measured", F)):
        if not np.any(values > 0):
            raise InputError(f"the {name} force is nowhere > 0: there is no impact to compare.")
    samples = np.linspace(time[0], time[-1], SAMPLE_COUNT)
    force_at = getattr(hit, "force_at", None)
    values = force_at(samples) if force_at is not None else np.interp(samples, time, force)

    def computed_force(times: Array) -> Array:
        return np.interp(times, samples, values, left=0.0, right=0.0)

    weight = np.gradient(t)

    def squared_difference(shift: float) -> float:
        return np.sum(weight * (F - computed_force(t + shift)) ** 2)

    low = samples[0] - t[-1]
    high = samples[-1] - t[0]
    between_peaks = samples[np.argmax(values)] - t[np.argmax(F)]
    shifts = np.append(np.linspace(low, high, SHIFT_COUNT), between_peaks)
    best = float(min(shifts, key=squared_difference))
    width = (high - low) / (SHIFT_COUNT - 1)
    refined = minimize_scalar(
        squared_difference,
        bounds=(best - width, best + width),
        method="bounded",
        options={"xatol": 1e-6 * width},
    )
    shift = float(refined.x) if refined.fun < squared_difference(best) else best
    shifted = computed_force(t + shift)
    energy = float(np.sum(weight * shifted**2))
    peak = float(shifted.max())
    if energy == 0:
        raise InputError("the histories do not overlap: their times differ by more than they last.")
    scale = float(np.sum(weight * shifted * F)) / energy
    misfit = np.sqrt(np.sum(weight * (F - scale * shifted) ** 2) / energy)

    return ForceComparison(
        time=t + shift,
        measured=F,
        computed=shifted,
        shift=shift,
        L2=float(np.sqrt(squared_difference(shift) / energy)),
        scale=scale,
        scaled_L2=float(misfit),
        peak=float(F.max()) / peak - 1,
        impulse=float(np.sum(weight * F) / np.sum(weight * shifted)) - 1,
    )


def _measured_history(measured: object) -> tuple[Array, Array]:
    """Times (n,) [s] and forces (n,) [N] of a measurement: a pair of these, or a table's path."""
    if isinstance(measured, tuple | list) and len(measured) == 2:
        arrays: Mapping[str, object] = dict(zip(("time", "force"), measured, strict=True))
    else:
        path = checks.path("measured", measured)
        check_readable(path, "a measurement")
        columns = columns_by_name(path, "time", "force")
        arrays = {
            "time": columns["time"].in_si(TIME_UNITS),
            "force": columns["force"].in_si(FORCE_UNITS),
        }

    t = checks.floats("the measured times", arrays["time"], (None,))
    F = checks.floats("the measured forces", arrays["force"], (None,))
    if len(t) != len(F) or len(t) < MIN_SAMPLES or np.any(np.diff(t) <= 0):
        raise InputError(
            f"a measured force has {MIN_SAMPLES} times or more, ascending, and one force each; got"
            f" {len(t)} times and {len(F)} forces."
        )

    return t, F
