"""What demos that compare structures share: numbers of an impact, their table, curves in time."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import antiosc as ao
from antiosc import plotting

#: Heading of a column -> (key of the number, factor of its unit, digits after the point or "g").
Columns = Mapping[str, tuple[str, float, str]]
#: Columns of every table.
COMMON: Columns = {
    "dofs": ("dofs", 1.0, ".0f"),
    "k0 N/m": ("k0", 1.0, ".4g"),
    "first Hz": ("first", 1.0, ".1f"),
    "peak force N": ("peak_force", 1.0, ".1f"),
}
SECONDS: Columns = {"s": ("seconds", 1.0, ".1f")}


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Put the seconds of a stage into `seconds`."""
    started = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - started


def numbers(
    part: ao.Structure, model: ao.AntiOscillators, hit: ao.History, mass: float, velocity: float
) -> dict[str, float]:
    """Structure, model and impact of a body of `mass` (kg) at `velocity` (m/s), in SI units."""
    return {
        "dofs": part.dofs,
        "mass": part.mass,
        "k0": model.k0,
        "first": float(model.omega[0]) / (2 * np.pi),
        "peak_force": hit.peak_force,
        "impulse": hit.impulse,
        "momentum": mass * (velocity - float(hit.impactor_velocity[-1])),
    }


def print_table(title: str, rows: Mapping[str, Mapping[str, float]], own: Columns) -> None:
    """A line for each structure: the common columns and its own ones."""
    table(title, rows, {**COMMON, **own})


def table(title: str, rows: Mapping[str, Mapping[str, float | None]], columns: Columns) -> None:
    """A line for each row; "-" where a number is None."""
    first = max(len(title), *(len(name) for name in rows)) + 2
    widths = [max(10, len(heading) + 2) for heading in columns]
    heads = (f"{h:>{w}}" for h, w in zip(columns, widths, strict=True))
    print(f"{title:<{first}}" + "".join(heads))
    for name, row in rows.items():
        line = f"{name:<{first}}"
        for (key, factor, digits), width in zip(columns.values(), widths, strict=True):
            value = row[key]
            line += f"{'-':>{width}}" if value is None else f"{value * factor:>{width}{digits}}"
        print(line)


def plot_hits(columns: Mapping[str, Mapping[str, ao.History]], path: Path) -> None:
    """Force and motion over time: a column for each title, a curve for each name in it."""
    figure, axes = plotting.panels(2, len(columns), size=(5 * len(columns), 6))
    for k, (title, hits) in enumerate(columns.items()):
        plotting.plot_force(hits, axes[0, k]).set_title(title)
        plotting.plot_motion(hits, axes[1, k])
    plotting.save_figure(figure, path, dpi=120)


def plot(
    times: NDArray[np.float64], lines: Mapping[str, NDArray[np.float64]], label: str, path: Path
) -> None:
    """A panel over time (s) for each structure, the others grey; `label`: quantity and unit."""
    size = (8, 2.4 * len(lines) + 0.4)
    figure, axes = plotting.panels(len(lines), 1, size=size, sharex=True, sharey=True)
    for axis, (name, values) in zip(axes.flat, lines.items(), strict=True):
        for other in lines.values():
            axis.plot(times * 1e3, other, color="0.8", linewidth=1)
        axis.plot(times * 1e3, values, linewidth=1.2)
        axis.set_title(name, fontsize=11)
    axes[-1, 0].set_xlabel("time (ms)")
    figure.supylabel(label, fontsize=11)
    plotting.save_figure(figure, path, dpi=120)
