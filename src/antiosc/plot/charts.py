"""Charts of forces, motions, stiffnesses and errors, with their axes, legends and picture files.

matplotlib is imported only here, and when a chart is drawn.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antiosc.base import checks, files
from antiosc.base._types import Array, ArrayLike, NDArray
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.base.packages import loading
from antiosc.base.texts import engineering, percent, unit_prefix
from antiosc.plot.model_picture import draw_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: a `History`, or several by name
HistoryLike: TypeAlias = Any
#: `AntiOscillators`, or several by name
ModelLike: TypeAlias = Any


def panels(
    rows: int, columns: int, size: tuple[float, float], *, shown: bool = False, **options: object
) -> tuple[Figure, NDArray[np.object_]]:
    """A figure of `size` (inches) and its axes (rows, columns); `options` as for `subplots`.

    With `shown`, the figure is registered in pyplot, so that `pyplot.show()` and notebooks show it.
    """
    rows = checks.whole("rows", rows, most=20)
    columns = checks.whole("columns", columns, most=20)
    width, height = checks.floats("size", size, (2,))
    if not (0.5 <= width <= 100 and 0.5 <= height <= 100):
        raise InputError(
            f"size must be two lengths from 0.5 to 100 inches; got {checks.shown(size)}."
        )

    figure = new_figure((float(width), float(height)), checks.flag("shown", shown))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


#: Dots per inch of raster pictures: enough for print.
PICTURE_DPI = 200


def save_figure(figure: Figure, path: str | os.PathLike[str], **options: object) -> None:
    """Write a matplotlib figure to a file that is complete or absent; `options` as for `savefig`.

    InputError if `path` does not have the extension of a picture, or cannot be written.
    """
    formats = figure.canvas.get_supported_filetypes()
    path = checks.path("path", path)
    if path.suffix.lower().removeprefix(".") not in formats:
        raise InputError(
            f"a picture's name ends with one of .{', .'.join(sorted(formats))}; got {path!s}."
        )

    with files.atomic_file(path, "the picture") as part:
        render(figure, part, **options)


def render(figure: Figure, target: object, **options: object) -> None:
    """`figure.savefig`; InputError if matplotlib cannot draw the figure."""
    try:
        figure.savefig(target, **options)
    except (RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200].rstrip(".")
        raise InputError(
            f"the picture cannot be drawn ({reason}): choose other names or options."
        ) from error


def figure_or_path(figure: Figure, path: str | os.PathLike[str] | None) -> Figure | Path:
    """The figure, or with `path` the path of the file that was written."""
    if path is None:
        return figure
    save_figure(figure, path, dpi=PICTURE_DPI, bbox_inches="tight", pad_inches=0.1)
    return checks.path("path", path)


def new_figure(size: tuple[float, float], shown: bool) -> Figure:
    """A new figure; if `shown`, it is registered in pyplot, except in a notebook.

    pyplot keeps registered figures alive; a notebook draws the figure that a cell returns.
    """
    if shown:
        pyplot = _matplotlib("pyplot")
        if "inline" not in pyplot.get_backend().lower():
            return pyplot.figure(figsize=size, layout="constrained")
        _let_notebook_draw()
    return _matplotlib("figure").Figure(figsize=size, layout="constrained")


def _let_notebook_draw() -> None:
    """Make IPython draw a figure that a cell returns, also before pyplot was first used."""
    with contextlib.suppress(ImportError, AttributeError):  # no notebook, or a strange one
        shell = importlib.import_module("IPython").get_ipython()
        if _matplotlib("figure").Figure not in shell.display_formatter.formatters["image/png"]:
            tools = importlib.import_module("IPython.core.pylabtools")
            tools.select_figure_formats(shell, {"png"})


def _matplotlib(module: str = "") -> ModuleType:
    """matplotlib, or one of its modules."""
    try:
        if "matplotlib" not in sys.modules:
            with loading():
                importlib.import_module("matplotlib")
        return importlib.import_module(f"matplotlib.{module}".rstrip("."))
    except ImportError:
        raise MissingDependencyError(
            "charts need matplotlib: apt install python3-matplotlib, or pip install matplotlib."
        ) from None


def legend_beside(ax: Axes) -> Axes:
    """Place the legend right of the axes, since many names would hide data."""
    ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), fontsize=8)
    return ax


def few_log_ticks(ax: Axes) -> Axes:
    """Label logarithmic axes at 1, 2, 5, 10, … below 1.5 decades, else at decades."""
    ticker = _matplotlib("ticker")
    for axis, (low, high) in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        axis.set_minor_formatter(ticker.NullFormatter())
        if low > 0 and high < 10**1.5 * low:
            axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))

    return ax


def axes_or_new(ax: Axes | None) -> Axes:
    if ax is None:
        return new_figure((6.4, 4.8), shown=True).subplots()
    if isinstance(ax, type) or not callable(getattr(ax, "get_figure", None)):
        raise InputError(f"ax must be matplotlib axes; got {checks.shown(ax)}.")
    return ax


#: Kind of object that charts draw -> attributes that they read.
CHART_ATTRIBUTES = {
    "History": ("time", "force", "displacement", "indentation", "contacts", "cumulative_impulse"),
    "AntiOscillators": ("m0", "k0", "omega", "labels", "mass_shares", "dynamic_stiffness"),
}


def objects_by_name(items: Any, kind: str) -> Mapping[str, Any]:
    """Objects of `kind` by name; a single object gets the name "". InputError for others."""
    objects = items if isinstance(items, Mapping) else {"": items}
    if not objects:
        raise InputError(f"nothing to draw: give at least one {kind}.")

    for drawn in objects.values():
        is_known = not isinstance(drawn, type)
        try:
            [getattr(drawn, name) for name in CHART_ATTRIBUTES[kind]]
        except AttributeError as error:
            if isinstance(error, InputError):  # a history of several contacts says why
                raise
            is_known = False
        if not is_known:
            raise InputError(f"what is drawn must be a {kind}; got {checks.shown(drawn)}.")

    return objects


def line_widths(named: Mapping[str, object]) -> Array:
    """Line widths (n,) in points, decreasing, so that no curve hides another."""
    if len(named) > 1:
        return np.linspace(2.6, 1.0, len(named))
    return np.array([1.5])


def padded_range(values: ArrayLike, below: float, above: float) -> tuple[float, float]:
    """The range of `values`, extended by the shares `below` and `above` of its length."""
    low = float(np.min(values))
    high = float(np.max(values))
    size = (high - low) or max(abs(high), 1.0)
    return low - below * size, high + above * size


def legend(ax: Axes) -> Axes:
    """Place a legend at the best location if a curve has a name."""
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best")
    return ax


#: Share of the impulse after the end of the time axis: weak contacts long afterwards.
LATE_IMPULSE = 0.01
#: Estimated relative error of a force from which it is drawn as a band.
VISIBLE_ERROR = 0.005


def _peak_error(hit: HistoryLike) -> tuple[float, str]:
    """(relative error of the largest force, text on it), from the error budget if known."""
    budget = getattr(hit, "__dict__", {}).get("error_budget")
    if budget and not budget.no_bar and np.isfinite(total := max(budget.sides("peak_force"))):
        return total, f"error{{}}{budget.condition}"
    error = hit.error.get("peak", 0.0) + hit.error.get("truncation peak_force", 0.0)
    return error, "numerical error{}"


def plot_force(hits: HistoryLike, ax: Axes | None = None) -> Axes:
    """Contact force over time for one history or several by name; the largest force is marked.

    The time axis ends when 99 % of the impulse has been transferred. A band shows the estimated
    error of the peak force (from the error budget, if known) if it is at least 0.5 %.
    """
    runs = objects_by_name(hits, "History")
    ax = axes_or_new(ax)
    spans = [_contact_span(hit) for hit in runs.values()]
    start = min(s for s, _ in spans)
    end = max(e for _, e in spans)
    factor, unit = unit_prefix(end, "s")

    tops = [0.0]
    for (name, hit), width in zip(runs.items(), line_widths(runs), strict=True):
        (line,) = ax.plot(factor * hit.time, hit.force, label=name or None, lw=width)
        error, words = _peak_error(hit)
        tops.append(hit.peak_force * (1 + min(error, 1.0) * (error >= VISIBLE_ERROR)))
        if error >= VISIBLE_ERROR:
            bounds = (hit.force * (1 - error), hit.force * (1 + error))
            shade = {"color": line.get_color(), "alpha": 0.2, "lw": 0}
            label = words.format(f" ± {percent(error)}")
            ax.fill_between(factor * hit.time, *bounds, label=label, **shade)

        for proved in getattr(hit, "enclosures", ())[:1]:
            upper = np.minimum(proved.upper, 2 * hit.peak_force)
            shade = {"color": line.get_color(), "alpha": 0.35, "lw": 0}
            ax.fill_between(factor * proved.time, proved.lower, upper, label="proved", **shade)
        if hit.peak_force > 0:
            top = int(np.argmax(hit.force))
            ax.plot(factor * hit.time[top], hit.peak_force, "o", ms=5, color=line.get_color())

    margin = 0.06 * (end - start)
    ax.set_xlim(factor * (start - margin), factor * (end + margin))
    ax.set_ylim(*padded_range(tops, 0.05, 0.14))
    if len(runs) == 1:
        hit = next(iter(runs.values()))
        _mark_peak(ax, hit, 0.5 * (start + end), factor)

    ax.set_xlabel(f"time ({unit})")
    ax.set_ylabel("contact force (N)")
    return legend(ax)


def plot_motion(hits: HistoryLike, ax: Axes | None = None) -> Axes:
    """Displacements of the site and (dashed) of the striker over time; contacts are shaded.

    The dashed curve begins at the gap, so that the curves meet at the touch. The displacement axis
    covers the site's motion, and the other body's motion during contact or if it is at rest.
    """
    runs = objects_by_name(hits, "History")
    ax = axes_or_new(ax)
    factor, unit = unit_prefix(max(float(hit.time[-1]) for hit in runs.values()), "s")
    besides = [hit.displacement + hit.indentation for hit in runs.values()]

    curves = [hit.displacement for hit in runs.values()]
    for hit, neighbour in zip(runs.values(), besides, strict=True):
        first, last = _contact_span(hit)
        during = (hit.time >= first) & (hit.time <= last) | (not hit.impactor_displacement.any())
        curves.append(neighbour[during])

    values = np.concatenate(curves)
    long, length = unit_prefix(float(np.abs(values).max(initial=0.0)) or 1e-3, "m")
    for (name, hit), neighbour, width in zip(runs.items(), besides, line_widths(runs), strict=True):
        label, other_label = (name, None) if name else _body_names(hit)
        (line,) = ax.plot(factor * hit.time, long * hit.displacement, lw=width, label=label)
        dashes = {"ls": "--", "lw": width, "color": line.get_color() if name else "C1"}
        ax.plot(factor * hit.time, long * neighbour, label=other_label, **dashes)
        if len(runs) == 1 and hit.contacts:
            spans = [(factor * start, factor * (end - start)) for start, end in hit.contacts]
            full_height = {"transform": ax.get_xaxis_transform(), "zorder": 0}
            ax.broken_barh(spans, (0, 1), color="0.9", lw=0, label="contact", **full_height)

    if all(runs):
        ax.set_title("dashed: what strikes", loc="right", fontsize="small")

    ax.set_ylim(*padded_range(long * values, 0.08, 0.08))
    ends = [factor * hit.time[-1] for hit in runs.values()]
    ax.set_xlim(*padded_range([0.0, *ends], 0.02, 0.02))
    ax.set_xlabel(f"time ({unit})")
    ax.set_ylabel(f"displacement ({length})")
    return legend(ax)


def plot_history(hits: HistoryLike, path: str | os.PathLike[str] | None = None) -> Figure | Path:
    """The force during contact of a history (or several by name), and motions of the whole run.

    With `path` (PNG, PDF, SVG, …) the picture is written and the path returned, else the figure.
    """
    runs = objects_by_name(hits, "History")
    figure, axes = panels(2, 1, size=(7.0, 5.0), shown=path is None)
    plot_force(runs, axes[0, 0])
    plot_motion(runs, axes[1, 0])
    return figure_or_path(figure, path)


def _body_names(hit: HistoryLike) -> tuple[str, str]:
    """The names of the bodies at the two ends of the contact."""
    contacts = getattr(hit, "contact_histories", ())
    first, second = contacts[0].ends if contacts else ("structure", "impactor")
    return f"{first}, at the site", str(second)


def _contact_span(hit: HistoryLike) -> tuple[float, float]:
    """(time of the first touch, time of the release after which little impulse remains)."""
    contacts = np.reshape(hit.contacts, (-1, 2))
    impulse = hit.cumulative_impulse
    if not contacts.size or impulse[-1] <= 0:
        return float(hit.time[0]), float(hit.time[-1])
    so_far = np.interp(contacts[:, 1], hit.time, impulse) / impulse[-1]
    return float(contacts[0, 0]), float(contacts[int(np.argmax(so_far >= 1 - LATE_IMPULSE)), 1])


def _mark_peak(ax: Axes, hit: HistoryLike, middle: float, factor: float) -> None:
    """Mark the largest force and write it on the side with more space."""
    if hit.peak_force <= 0:
        return

    peak_time = float(hit.time[int(np.argmax(hit.force))])
    text = f"{engineering(hit.peak_force, 'N', 4)} at {engineering(peak_time, 's')}"
    side, align = (9, "left") if peak_time <= middle else (-9, "right")
    ax.annotate(
        text, (factor * peak_time, hit.peak_force), (side, 4), textcoords="offset points", ha=align
    )


#: Points of a dynamic stiffness between two neighbouring antiresonances, and in total.
POINTS_PER_INTERVAL = 160
MAX_CURVE_POINTS = 20_000
#: Lowest frequency of the picture of a model, over its first antiresonance.
LOWEST_FREQUENCY = 0.2


def plot_dynamic_stiffness(models: ModelLike, omega: ArrayLike, ax: Axes | None = None) -> Axes:
    """Dynamic stiffness |Z| over frequency: poles at antiresonances, zeros at free frequencies.

    `omega` [rad/s], (n,). A model of several sites has one curve for each entry of the matrix on
    and above its diagonal.
    """
    models_by_name = objects_by_name(models, "AntiOscillators")
    ax = axes_or_new(ax)

    w = checks.floats("omega", omega, (None,))
    widths = line_widths(models_by_name)
    for (name, model), width in zip(models_by_name.items(), widths, strict=True):
        for entry, stiffness in _stiffness_entries(model, w):
            label = ": ".join(filter(None, (name, entry)))
            ax.semilogy(w / (2 * np.pi), stiffness, lw=width, label=label or None)

    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("|dynamic stiffness| (N/m)")
    return legend(ax)


def _stiffness_entries(model: ModelLike, omega: Array) -> list[tuple[str, Array]]:
    """Names and absolute values (n,) of the entries of Z on and above the diagonal."""
    Z = np.abs(model.dynamic_stiffness(omega))
    names = model.labels
    if Z.ndim == 1:
        return [("", Z)]

    rows, columns = np.triu_indices(len(names))

    return [
        (names[i] if i == j else f"{names[i]}, {names[j]}", Z[:, i, j])
        for i, j in zip(rows, columns, strict=True)
    ]


def plot_masses(model: ModelLike, ax: Axes | None = None) -> Axes:
    """Share of the static mass held by the first anti-oscillators, as Article Figs. 7 and 8.

    For several sites it is their mean share (`AntiOscillators.mass_shares`).
    """
    _require_anti_oscillators(model)
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


def plot_model(model: ModelLike, path: str | os.PathLike[str] | None = None) -> Figure | Path:
    """Springs and masses of a model, |Z| up to 1.1 times its last antiresonance, mass shares.

    The first picture is drawn only for one site. `path` and the result are as for `plot_history`.
    InputError for a model without anti-oscillators.
    """
    _require_anti_oscillators(model)
    one = np.ndim(model.k0) == 0
    figure, axes = panels(2 + one, 1, size=(7.0, 5.0 + 3.2 * one), shown=path is None)
    if one:
        draw_model(axes[0, 0], model.m0, model.k0, model.m, model.omega)

    ends = LOWEST_FREQUENCY * model.omega[0], 1.1 * model.omega[-1]
    edges = np.unique(np.concatenate((ends, model.omega)))
    count = max(2, min(POINTS_PER_INTERVAL, MAX_CURVE_POINTS // edges.size))

    # denser near the ends, where the poles are
    share = (1 - np.cos(np.pi * np.arange(1, count) / count)) / 2
    omega = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
    plot_dynamic_stiffness(model, omega, axes[-2, 0])
    axes[-2, 0].set(xscale="log", xlim=(omega[0] / (2 * np.pi), omega[-1] / (2 * np.pi)))
    few_log_ticks(axes[-2, 0])
    plot_masses(model, axes[-1, 0])
    return figure_or_path(figure, path)


def _require_anti_oscillators(model: ModelLike) -> None:
    objects_by_name(model, "AntiOscillators")
    if model.n == 0:
        raise InputError("this model has no anti-oscillator whose mass could be drawn.")
