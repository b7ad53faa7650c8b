"""`FoundImpact`: what `find_impact` returns."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from antiosc.base._types import Array
from antiosc.base.charts import finished, panels
from antiosc.base.texts import Brief
from antiosc.simulation.histories.history import History

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Values of `FoundImpact.status`.
FOUND, UNDETERMINED, UNEXPLAINED = 0, 1, 2


@dataclass(frozen=True, eq=False, repr=False)
class FoundImpact(Brief):
    """A blow found from measured signals.

    Attributes
    ----------
    place, direction : (3,) struck point [m], and unit vector of the blow.
    mass [kg], velocity [m/s], stiffness (of the contact law; None of a law without one) : of the
        impactor.
    start : time of the first touch after the first sample [s], perhaps negative.
    E : factor of the stiffness of the structure; 1 unless it was unknown.
    bars : name -> half the width of the interval that holds the error with 95 %: "place" [m],
        "start" [s]; relative for "mass", "velocity", "stiffness", "E", "peak_force", "impulse".
        inf: the signals do not tell it. 0 of what was known.
    chi2 : squared difference of the signals over what the noise explains, 1 for a sound fit.
    rank, unknowns : how many of the unknowns the signals determine, and how many there are.
    status : 0: found; 1: not all unknowns are determined, or other places are as probable; 2: the
        model does not explain the signals.
    message : the status in words.
    history : the impact, from the first touch on; its shapes are not known.
    time : (n,) samples [s]; force : (n,) contact force there [N].
    measured, computed : (n', m) signals in their units, in the compared band, at `compared_time`.
    band : the band that is compared [rad/s].
    points, explained : (P, 3) sites of the scan [m], and (P,) the share of the signals that the
        best pulse at each explains.
    others : places [m] that explain the signals as well.
    info : seconds, numbers of sites and modes.
    """

    place: Array
    direction: Array
    mass: float
    velocity: float
    stiffness: float | None
    start: float
    E: float
    bars: Mapping[str, float]
    chi2: float
    rank: int
    unknowns: int
    status: int
    message: str
    history: History
    time: Array
    force: Array
    compared_time: Array
    measured: Array
    computed: Array
    band: float
    points: Array
    explained: Array
    others: Array
    info: dict[str, object] = field(default_factory=dict)

    @property
    def peak_force(self) -> float:
        """Largest contact force [N]."""
        return self.history.peak_force

    @property
    def impulse(self) -> float:
        """Time integral of the contact force [N s]."""
        return self.history.impulse

    def summary(self) -> str:
        """A table of what was found with its bars, and the message."""
        return "\n".join([*(f"{name:<12}{value}" for name, value in self.rows()), self.message])

    def rows(self) -> list[tuple[str, str]]:
        """Names and values of what was found, with their bars."""
        place = ", ".join(f"{c:.5g}" for c in self.place)
        rows = [
            ("place", f"{place} m  ± {self.bars['place']:.2g} m"),
            ("start", f"{self.start:.5g} s  ± {self.bars['start']:.2g} s"),
        ]
        for name in ("peak_force", "impulse", "mass", "velocity", "stiffness", "E"):
            value = getattr(self, name)
            if value is None:
                continue
            bar = self.bars[name]
            told = "known" if bar == 0 else "not told" if np.isinf(bar) else f"± {bar:.2%}"
            unit = {"peak_force": " N", "impulse": " N s", "mass": " kg", "velocity": " m/s"}
            rows.append((name, f"{value:.5g}{unit.get(name, '')}  {told}"))
        return [*rows, ("chi2", f"{self.chi2:.3g}")]

    def numbers(self) -> dict[str, object]:
        """What was found, in SI units, with its bars, status and message."""
        names = ("place", "direction", "mass", "velocity", "stiffness", "start", "E", "peak_force")
        more = ("impulse", "bars", "chi2", "rank", "unknowns", "status", "message", "others")
        return {name: getattr(self, name) for name in (*names, *more)}

    def _facts(self) -> list[tuple[str, str]]:
        place, _, *rows = self.rows()
        return [place, *rows[:2], ("status", f"{self.status}: {self.message}")]

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """The measured and the computed signals, the force, and the scan of the places.

        With `path` (PNG, PDF, SVG, …) the picture is written, and the path returned.
        """
        count = self.measured.shape[1]
        figure, axes = panels(1, 2, (9.5, 1.2 + 1.1 * max(count, 3)), shown=path is None)
        left, right = axes[0]
        step = 2.2 * float(np.abs(self.measured / np.abs(self.measured).max(axis=0)).max())
        for s in range(count):
            size, at = float(np.abs(self.measured[:, s]).max()), -step * s
            t = 1e3 * self.compared_time
            left.plot(t, at + self.measured[:, s] / size, color="0.75", lw=4)
            left.plot(t, at + self.computed[:, s] / size, color="C0", lw=1)
        left.set(xlabel="time (ms)", title="measured (grey), computed", yticks=[])
        left.set_ylabel("sensors, the first on top")
        end = min(1.5 * max(self.history.contact_time, 1e-9), float(self.history.run.time[-1]))
        t = np.linspace(0.0, end, 400)
        right.plot(1e3 * (t + self.start), self.history.force_at(t), color="C3")
        right.set(xlabel="time (ms)", ylabel="force (N)", ylim=(0, None), title="contact force")
        return finished(figure, path)
