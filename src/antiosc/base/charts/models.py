"""Charts of models, dynamic stiffness and masses, and of the errors of a study."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from antiosc.base import checks
from antiosc.base._types import Array, Numbers
from antiosc.base.charts.figures import (
    axes_or_new,
    by_name,
    check_drawn,
    few_log_ticks,
    finished,
    legend,
    panels,
    widths,
)
from antiosc.base.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Points of a dynamic stiffness between two neighbouring antiresonances, and in total.
POINTS_BETWEEN, MOST_POINTS = 160, 20_000


class Reduced(Protocol):
    """What the charts of a model read; an `AntiOscillators` has it."""

    @property
    def n(self) -> int: ...
    @property
    def labels(self) -> tuple[str, ...]: ...
    @property
    def mass_shares(self) -> Array: ...
    @property
    def omega(self) -> Array: ...
    def dynamic_stiffness(self, omega: ArrayLike) -> Numbers: ...


def plot_dynamic_stiffness(
    models: Reduced | Mapping[str, Reduced],
    omega: ArrayLike,
    ax: Axes | None = None,
) -> Axes:
    """|Z| over frequency: poles at the antiresonances, zeros at the free frequencies.

    `omega` [rad/s], (n,). Of several sites one curve for each entry of the matrix on and above its
    diagonal.
    """
    named = by_name(models, Reduced, "AntiOscillators")
    ax = axes_or_new(ax)
    w = checks.array("omega", omega, (None,))
    for (name, model), width in zip(named.items(), widths(named), strict=True):
        for entry, stiffness in _entries(model, w):
            label = ": ".join(filter(None, (name, entry)))
            ax.semilogy(w / (2 * np.pi), stiffness, lw=width, label=label or None)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("|dynamic stiffness| (N/m)")
    return legend(ax)


def _entries(model: Reduced, omega: Array) -> list[tuple[str, Array]]:
    """Names and absolute values (n,) of the entries of Z on and above the diagonal."""
    Z, names = np.abs(model.dynamic_stiffness(omega)), model.labels
    if Z.ndim == 1:
        return [("", Z)]
    rows, columns = np.triu_indices(len(names))
    return [
        (names[i] if i == j else f"{names[i]}, {names[j]}", Z[:, i, j])
        for i, j in zip(rows, columns, strict=True)
    ]


def plot_masses(model: Reduced, ax: Axes | None = None) -> Axes:
    """Share of the static mass held by the first anti-oscillators, as Article Figs. 7 and 8.

    Of several sites it is the mean share of all of them (`AntiOscillators.mass_shares`).
    """
    _with_anti_oscillators(model)
    ax = axes_or_new(ax)
    number = np.arange(1, model.n + 1)
    ax.bar(number, model.mass_shares, label="each")
    ax.step(number, np.cumsum(model.mass_shares), where="mid", color="k", label="together")
    ax.set_ylim(0, 1.08)
    ax.set_xlim(0.4, model.n + 0.6)
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlabel("anti-oscillator")
    ax.set_ylabel("share of the static mass")
    return legend(ax)


def plot_model(model: Reduced, path: str | os.PathLike[str] | None = None) -> Figure | Path:
    """|Z| up to the last antiresonance, and below it the masses of the anti-oscillators.

    `path` and the result as for `plot_history`. InputError for a model without anti-oscillators.
    """
    _with_anti_oscillators(model)
    figure, axes = panels(2, 1, size=(7.0, 5.0), shown=path is None)
    edges = np.unique(np.concatenate(([0.0], model.omega, [1.1 * model.omega[-1]])))
    each = max(2, min(POINTS_BETWEEN, MOST_POINTS // edges.size))
    # denser near the ends, where the poles are
    share = (1 - np.cos(np.pi * np.arange(1, each) / each)) / 2
    omega = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
    plot_dynamic_stiffness(model, omega, axes[0, 0])
    axes[0, 0].set_xlim(0, 1.1 * model.omega[-1] / (2 * np.pi))
    plot_masses(model, axes[1, 0])
    return finished(figure, path)


def _with_anti_oscillators(model: Any) -> None:
    check_drawn("model", model, Reduced, "AntiOscillators")
    if model.n == 0:
        raise InputError("this model has no anti-oscillator whose mass could be drawn.")


def plot_errors(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]],
    ax: Axes | None = None,
    *,
    styles: Mapping[str, str] | None = None,
) -> Axes:
    """Relative errors against costs of several methods, on logarithmic axes.

    Parameters
    ----------
    series : mapping of name to (cost (n,), error (n,)); points that are not > 0 are omitted.
    ax : matplotlib axes, optional
    styles : mapping of name to a matplotlib format such as "C0o-", optional
    """
    ax = axes_or_new(ax)
    checks.instance("series", series, Mapping, "a mapping of names to (cost, error)")
    styles = {} if styles is None else styles
    checks.instance("styles", styles, Mapping, "a mapping of names to formats")
    for k, (name, pair) in enumerate(series.items()):
        if not isinstance(pair, Sequence) or len(pair) != 2:
            raise InputError(f"series[{name!r}] must be (cost, error); got {checks.shown(pair)}.")
        cost = checks.array("cost", pair[0], (None,))
        error = checks.array("error", pair[1], cost.shape)
        known = (cost > 0) & (error > 0)
        # large open markers below small ones: equal errors of two methods remain visible
        size = 8 - 4 * k / max(len(series) - 1, 1)
        style = checks.text("a format", styles.get(name, "o-"))
        ax.loglog(cost[known], error[known], style, ms=size, mfc="none", lw=1.2, label=name)
    ax.grid(alpha=0.3)
    return few_log_ticks(ax)
