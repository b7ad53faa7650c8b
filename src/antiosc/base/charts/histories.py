"""Charts of histories: the contact force and the motions over time."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.charts.figures import (
    axes_or_new,
    by_name,
    finished,
    legend,
    panels,
    rounded,
    widths,
    with_room,
)
from antiosc.base.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Share of the impulse after the end of the time axis: weak contacts long afterwards.
LATE = 0.01
#: Number of contacts from which a running mean of the force is drawn over the pulses.
MANY_CONTACTS = 7
#: Number of contacts up to which the pulses below that mean can be told apart: drawn darker.
DISTINCT_CONTACTS = 20
#: Windows of that mean over the time shown.
WINDOWS = 25
#: Height of a row of the legend over that of the axes.
LEGEND_ROW = 0.08
#: Estimated relative error of a force from which it is drawn as a band.
VISIBLE = 0.005


class Recorded(Protocol):
    """What the charts of a history read; a `History` has it."""

    @property
    def time(self) -> Array:
        """Times (T,), s; force (N) and displacements (m) have the same shape."""

    @property
    def force(self) -> Array: ...
    @property
    def displacement(self) -> Array: ...
    @property
    def impactor_displacement(self) -> Array: ...
    @property
    def peak_force(self) -> float: ...
    @property
    def contacts(self) -> list[tuple[float, float]]: ...
    @property
    def error(self) -> Mapping[str, float]: ...
    @property
    def cumulative_impulse(self) -> Array: ...


def plot_force(hits: Recorded | Mapping[str, Recorded], ax: Axes | None = None) -> Axes:
    """Contact force over time, of one history or of several by name; the largest is marked.

    The time axis ends where 99 % of the impulse has been transferred. An estimated error of the
    peak of 0.5 % or more is drawn as a band; a history of many contacts has a running mean.
    """
    named = by_name(hits, Recorded, "History")
    ax = axes_or_new(ax)
    spans = [_contact_span(hit) for hit in named.values()]
    start, end = min(s for s, _ in spans), max(e for _, e in spans)
    for (name, hit), width in zip(named.items(), widths(named), strict=True):
        many = len(hit.contacts) >= MANY_CONTACTS
        label = None if many else name or None
        (line,) = ax.plot(1e3 * hit.time, hit.force, label=label, lw=0.6 if many else width)
        if many:
            distinct = len(hit.contacts) <= DISTINCT_CONTACTS
            line.set(alpha=0.8 if distinct else 0.35, lw=1.0 if distinct else 0.6)
            window = (end - start) / WINDOWS
            mean = f"mean over {rounded(1e3 * window)} ms"
            time, force = running_mean(hit.time, hit.force, window)
            text = f"{name}, {mean}" if name else mean
            ax.plot(1e3 * time, force, color=line.get_color(), lw=2, label=text)
        error = _force_error(hit)
        if error >= VISIBLE:
            bounds = (hit.force * (1 - error), hit.force * (1 + error))
            shade = {"color": line.get_color(), "alpha": 0.2, "lw": 0}
            ax.fill_between(1e3 * hit.time, *bounds, label=f"estimated error ±{error:.1%}", **shade)
        if hit.peak_force > 0:
            top = int(np.argmax(hit.force))
            ax.plot(1e3 * hit.time[top], hit.peak_force, "o", ms=5, color=line.get_color())
    room = 0.06 * (end - start)
    ax.set_xlim(1e3 * (start - room), 1e3 * (end + room))
    means = sum(len(hit.contacts) >= MANY_CONTACTS for hit in named.values())
    above = 0.14 + LEGEND_ROW * (means + 1 if means else 0)  # pulses all along the axis
    ax.set_ylim(*with_room([0.0, *(hit.peak_force for hit in named.values())], 0.05, above))
    if len(named) == 1:
        _mark_peak(ax, next(iter(named.values())), 0.5 * (start + end))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel("contact force (N)")
    return legend(ax)


def plot_motion(hits: Recorded | Mapping[str, Recorded], ax: Axes | None = None) -> Axes:
    """Displacements of the site and, dashed, of the impactor over time; contacts are shaded.

    The displacement axis covers the motion of the site, and that of the impactor during contact.
    """
    named = by_name(hits, Recorded, "History")
    ax = axes_or_new(ax)
    seen: list[Array] = []
    for (name, hit), width in zip(named.items(), widths(named), strict=True):
        own, other = (name, None) if name else ("structure, at the site", "impactor")
        (line,) = ax.plot(1e3 * hit.time, 1e3 * hit.displacement, lw=width, label=own)
        color = line.get_color() if name else "C1"
        dashes = {"ls": "--", "lw": width, "color": color}
        ax.plot(1e3 * hit.time, 1e3 * hit.impactor_displacement, label=other, **dashes)
        first, last = _contact_span(hit)
        during = (hit.time >= first) & (hit.time <= last)
        seen += [1e3 * hit.displacement, 1e3 * hit.impactor_displacement[during]]
        if len(named) == 1 and hit.contacts:
            spans = [(1e3 * start, 1e3 * (end - start)) for start, end in hit.contacts]
            whole = {"transform": ax.get_xaxis_transform(), "zorder": 0}
            ax.broken_barh(spans, (0, 1), color="0.9", lw=0, label="contact", **whole)
    ax.set_ylim(*with_room(np.concatenate(seen), 0.08, 0.08))
    ends = [1e3 * hit.time[-1] for hit in named.values()]
    ax.set_xlim(*with_room([0.0, *ends], 0.02, 0.02))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel("displacement (mm)")
    return legend(ax)


def plot_history(
    hits: Recorded | Mapping[str, Recorded], path: str | os.PathLike[str] | None = None
) -> Figure | Path:
    """The force during contact, and below it the motions over the whole run.

    Parameters
    ----------
    hits : History or mapping of name to History
    path : str or Path, optional
        Of a picture (PNG, PDF, SVG, …) to write.

    Returns
    -------
    matplotlib Figure, or `path` where it was given.
    """
    named = by_name(hits, Recorded, "History")
    figure, axes = panels(2, 1, size=(7.0, 5.0), shown=path is None)
    plot_force(named, axes[0, 0])
    plot_motion(named, axes[1, 0])
    return finished(figure, path)


def running_mean(time: ArrayLike, value: ArrayLike, window: float) -> tuple[Array, Array]:
    """Mean of a piecewise linear signal over `window` (s) about each of 400 times."""
    t, y = checks.column("time", time), checks.column("value", value)
    if t.size != y.size or t.size < 2 or np.any(np.diff(t) < 0):
        raise InputError("time must ascend, with one value for each of at least two times.")
    window = checks.positive("window", window, "s")
    area = np.concatenate(([0.0], np.cumsum(np.diff(t) * (y[1:] + y[:-1]) / 2)))
    at = np.linspace(t[0], t[-1], 400)
    low, high = np.maximum(at - window / 2, t[0]), np.minimum(at + window / 2, t[-1])

    def until(x: Array) -> Array:
        k = np.clip(np.searchsorted(t, x, side="right") - 1, 0, t.size - 2)
        return np.asarray(area[k] + (x - t[k]) * (y[k] + np.interp(x, t, y)) / 2)

    length = np.maximum(high - low, np.finfo(float).tiny)
    return at, np.where(high > low, (until(high) - until(low)) / length, np.interp(at, t, y))


def _contact_span(hit: Recorded) -> tuple[float, float]:
    """First touch, and the release after which less than LATE of the impulse remains [s]."""
    contacts, given = np.reshape(hit.contacts, (-1, 2)), hit.cumulative_impulse
    if not contacts.size or given[-1] <= 0:
        return float(hit.time[0]), float(hit.time[-1])
    so_far = np.interp(contacts[:, 1], hit.time, given) / given[-1]
    return float(contacts[0, 0]), float(contacts[int(np.argmax(so_far >= 1 - LATE)), 1])


def _force_error(hit: Recorded) -> float:
    """Estimated relative error of the peak force, of steps and truncation."""
    return sum(hit.error.get(key, 0.0) for key in ("peak", "truncation peak_force"))


def _mark_peak(ax: Axes, hit: Recorded, middle: float) -> None:
    """Write the largest force beside its mark, on the side with more space."""
    if hit.peak_force <= 0:
        return
    at = float(hit.time[int(np.argmax(hit.force))])
    text = f"{hit.peak_force:.4g} N at {rounded(1e3 * at)} ms"
    side, align = (9, "left") if at <= middle else (-9, "right")
    ax.annotate(text, (1e3 * at, hit.peak_force), (side, 4), textcoords="offset points", ha=align)
