"""Charts of benchmarks: errors of methods over their costs, and legends below all panels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from antiosc.plot.charts import few_log_ticks


def plot_errors(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]], ax: Axes, styles: Mapping[str, str]
) -> Axes:
    """Relative errors against costs of methods, name -> (cost (n,), error (n,)), on logarithmic
    axes; points that are not > 0 are omitted. `styles`: name -> a format of matplotlib.
    """
    for k, (name, pair) in enumerate(series.items()):
        cost, error = (np.asarray(values, dtype=float) for values in pair)
        plottable = (cost > 0) & (error > 0)
        # large open markers below small ones: equal errors of two methods remain visible
        size = 8 - 4 * k / max(len(series) - 1, 1)
        style = styles.get(name, "o-")
        ax.loglog(cost[plottable], error[plottable], style, ms=size, mfc="none", lw=1.2, label=name)
    ax.grid(alpha=0.3)
    return few_log_ticks(ax)


def legend_below(figure: Figure, curves: Mapping[str, object], columns: int) -> Figure:
    """A legend of curves (label -> handle) below all panels of a figure."""
    rows = -(-len(curves) // columns)
    height = (0.25 * rows + 0.15) / figure.get_figheight()
    layout: Any = figure.get_layout_engine()
    layout.set(rect=(0, height, 1, 1 - height))
    figure.legend(list(curves.values()), list(curves), loc="lower center", ncols=columns)
    return figure
