"""Figures, axes, legends and picture files; matplotlib is imported only here."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from antiosc.base import checks, files
from antiosc.base._types import Array
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.base.isolation import loading

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Something that a chart draws.
D = TypeVar("D")


def panels(
    rows: int, columns: int, size: tuple[float, float], *, shown: bool = False, **options: Any
) -> tuple[Figure, NDArray[np.object_]]:
    """A figure of `size` (inches) and its axes (rows, columns); `options` as for `subplots`.

    With `shown`, pyplot knows the figure, so that `pyplot.show()` and notebooks display it.
    """
    rows, columns = checks.whole("rows", rows, most=20), checks.whole("columns", columns, most=20)
    width, height = checks.array("size", size, (2,))
    if not (0.5 <= width <= 100 and 0.5 <= height <= 100):
        raise InputError(
            f"size must be two lengths from 0.5 to 100 inches; got {checks.shown(size)}."
        )
    figure = new_figure((float(width), float(height)), checks.flag("shown", shown))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def save_figure(figure: Any, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a matplotlib figure to a file that is complete or absent; `options` as for `savefig`.

    InputError if `path` does not have the extension of a picture, or cannot be written.
    """
    known = figure.canvas.get_supported_filetypes()
    path = checks.path("path", path)
    if path.suffix.lower().removeprefix(".") not in known:
        raise InputError(
            f"a picture's name ends with one of .{', .'.join(sorted(known))}; got {path!s}."
        )
    with files.complete(path, "the picture") as part:
        render(figure, part, **options)


def render(figure: Any, target: Any, **options: Any) -> None:
    """`figure.savefig`; InputError if matplotlib, or LaTeX for it, cannot draw the figure."""
    try:
        figure.savefig(target, **options)
    except (RuntimeError, ValueError) as error:
        said = " ".join(str(error).split())[:200].rstrip(".")
        remedy = "choose other names or options"
        if _matplotlib().rcParams["text.usetex"]:
            remedy = 'install LaTeX, or set matplotlib.rcParams["text.usetex"] = False'
        raise InputError(f"the picture cannot be drawn ({said}): {remedy}.") from error


def finished(figure: Figure, path: str | os.PathLike[str] | None) -> Figure | Path:
    """The figure, or the path of the file that it was written to."""
    if path is None:
        return figure
    save_figure(figure, path, dpi=120)
    return checks.path("path", path)


def new_figure(size: tuple[float, float], shown: bool) -> Figure:
    """A new figure, registered with pyplot only if it is shown: pyplot keeps every figure alive.

    A notebook shows the figure that a cell returns; one that pyplot knows it would show twice.
    """
    if shown:
        pyplot = _matplotlib("pyplot")
        if "inline" not in pyplot.get_backend().lower():
            return pyplot.figure(figsize=size, layout="constrained")
    return _matplotlib("figure").Figure(figsize=size, layout="constrained")


def _matplotlib(module: str = "") -> ModuleType:
    """matplotlib, or a module of it."""
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
    """A legend to the right of the axes, where many names hide no data."""
    ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), fontsize=8)
    return ax


def few_log_ticks(ax: Axes) -> Axes:
    """Labels 1, 2, 5, 10, … on logarithmic axes of less than 1.5 decades, otherwise only decades.

    matplotlib would label 2, 3, 4, …, which overlap.
    """
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


def by_name(items: D | Mapping[str, D], kind: type, noun: str) -> Mapping[str, D]:
    """Name -> object; a single one has no name."""
    named = items if isinstance(items, Mapping) else {"": items}
    if not named:
        raise InputError(f"nothing to draw: give at least one {noun}.")
    for name, one in named.items():
        which = f"the {noun} named {checks.shown(name)}" if name else "what is drawn"
        check_drawn(which, one, kind, f"a {noun}")
    return named


def check_drawn(name: str, one: object, kind: type, noun: str) -> None:
    """InputError unless `one` has every attribute of the protocol `kind`."""
    needed = [attribute for attribute in vars(kind) if not attribute.startswith("_")]
    if isinstance(one, type) or not all(_has(one, attribute) for attribute in needed):
        given = "" if one is None else f"{type(one).__name__} "
        raise InputError(f"{name} must be {noun}; got {given}{checks.shown(one)}.")


def _has(one: object, attribute: str) -> bool:
    """`hasattr`; an InputError that tells why, as of a history of several contacts, is raised."""
    try:
        getattr(one, attribute)
    except InputError:
        raise
    except AttributeError:
        return False
    return True


def widths(named: Mapping[str, Any]) -> Array:
    """Line widths in points: the first of several curves is the widest, so that none is hidden."""
    return np.linspace(2.6, 1.0, len(named)) if len(named) > 1 else np.array([1.5])


def with_room(values: ArrayLike, below: float, above: float) -> tuple[float, float]:
    """The range of `values` with these shares of it below and above."""
    low, high = float(np.min(values)), float(np.max(values))
    size = (high - low) or max(abs(high), 1.0)
    return low - below * size, high + above * size


def rounded(value: float) -> str:
    """Three digits."""
    return f"{value:.3g}"


def legend(ax: Axes) -> Axes:
    """A legend at the best place, if a curve has a name."""
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best")
    return ax
