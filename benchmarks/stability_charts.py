"""The maps of `stability.py`: kinds of runs over the number of anti-oscillators and the step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import error_charts
import numpy as np
from matplotlib.colors import ListedColormap

from antiosc import plotting

METHODS = ("exact", "newmark")
CLASSES = ("good", "energy", "wrong")
COLOURS = ListedColormap(["#4c9f70", "#f2c14e", "#e07a3f"])


def chart_numbers(
    table: list[dict[str, Any]],
    numbers: np.ndarray,
    times: np.ndarray,
    limits: list[float],
    path: Path,
) -> None:
    fig, grid = plotting.panels(1, len(METHODS), size=(8, 4), sharex=True, sharey=True)
    axes = grid.ravel()
    edges_n, edges_h = _edges(numbers), _edges(times)
    for ax, method in zip(axes, METHODS, strict=True):
        kinds = np.full((times.size, numbers.size), np.nan)
        for row in table:
            if row["method"] == method:
                i = int(np.argmin(np.abs(times - row["step"])))
                kinds[i, int(np.flatnonzero(numbers == row["n"])[0])] = CLASSES.index(row["kind"])
        image = ax.pcolormesh(edges_n, edges_h, kinds, cmap=COLOURS, vmin=-0.5, vmax=2.5)
        ax.plot(numbers, limits, "k-", label=r"$h\,\omega_{max} = 2$: central differences end")
        ax.set(xscale="log", yscale="log", title=method, ylim=(edges_h[0], edges_h[-1]))
    _finish(fig, grid, image)
    error_charts.legend_below(fig, {line.get_label(): line for line in axes[0].lines}, 1)
    plotting.save_figure(fig, path, dpi=120)


def _finish(fig: Any, grid: np.ndarray, image: Any) -> None:
    """Labels of the outer axes, and the classes beside them."""
    for ax in grid[-1]:
        ax.set_xlabel("anti-oscillators N")
    for ax in grid[:, 0]:
        ax.set_ylabel("step h (s)")
    bar = fig.colorbar(image, ax=grid, ticks=range(3), aspect=40, pad=0.02)
    bar.ax.set_yticklabels(CLASSES, rotation=90, va="center")


def _edges(values: np.ndarray) -> np.ndarray:
    """Cell edges half-way between values on a logarithmic axis."""
    logs = np.log(values)
    if logs.size == 1:
        return np.exp(np.array([logs[0] - 0.5, logs[0] + 0.5]))
    inner = 0.5 * (logs[1:] + logs[:-1])
    first, last = 2 * logs[0] - inner[0], 2 * logs[-1] - inner[-1]
    return np.exp(np.concatenate(([first], inner, [last])))
