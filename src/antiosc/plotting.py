"""Charts of histories and models; matplotlib is imported when one is drawn."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from antiosc import checks, files
from antiosc.errors import InputError, MissingDependencyError
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.simulation.history import History

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_force(hits: History | Mapping[str, History], ax: Axes | None = None) -> Axes:
    """Contact force over time, of one history or of several by name."""
    named = _named(hits, History)
    ax = _axes(ax)
    for name, hit in named.items():
        ax.plot(1e3 * hit.time, hit.force, label=name or None)
    ax.set_xlabel("time [ms]")
    ax.set_ylabel("contact force [N]")
    return _legend(ax, hits)


def plot_motion(hits: History | Mapping[str, History], ax: Axes | None = None) -> Axes:
    """Displacements of the site and, dashed, of the impactor over time."""
    named = _named(hits, History)
    ax = _axes(ax)
    for name, hit in named.items():
        (line,) = ax.plot(1e3 * hit.time, 1e3 * hit.displacement, label=name or None)
        ax.plot(1e3 * hit.time, 1e3 * hit.impactor_displacement, "--", color=line.get_color())
    ax.set_xlabel("time [ms]")
    ax.set_ylabel("displacement along the impact [mm]")
    return _legend(ax, hits)


def plot_dynamic_stiffness(
    models: AntiOscillators | Mapping[str, AntiOscillators],
    omega: ArrayLike,
    ax: Axes | None = None,
) -> Axes:
    """|Z| over frequency: poles at the antiresonances, zeros at the free frequencies."""
    named = _named(models, AntiOscillators)
    ax = _axes(ax)
    w = checks.array("omega", omega, (None,))
    for name, model in named.items():
        ax.semilogy(w / (2 * np.pi), np.abs(model.dynamic_stiffness(w)), label=name or None)
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("|dynamic stiffness| [N/m]")
    return _legend(ax, models)


def plot_masses(model: AntiOscillators, ax: Axes | None = None) -> Axes:
    """Share of the static mass held by the first anti-oscillators, as Article Figs. 7 and 8."""
    checks.instance("model", model, AntiOscillators, "AntiOscillators")
    if model.n == 0:
        raise InputError("this model has no anti-oscillator whose mass could be drawn.")
    ax = _axes(ax)
    number = np.arange(1, model.n + 1)
    ax.bar(number, model.m / model.m_st, label="each")
    ax.step(number, np.cumsum(model.m) / model.m_st, where="mid", color="k", label="together")
    ax.set_xlabel("anti-oscillator")
    ax.set_ylabel("share of the static mass")
    ax.legend()
    return ax


def save_figure(figure: Any, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a matplotlib figure to a file that is complete or absent; `options` as for `savefig`.

    InputError where the ending of `path` is no picture's, or the file cannot be written.
    """
    known = figure.canvas.get_supported_filetypes()
    path = checks.path("path", path)
    if path.suffix.lower().removeprefix(".") not in known:
        raise InputError(f"a picture ends with one of .{', .'.join(sorted(known))}; got {path!s}.")
    with files.complete(path, "the picture") as part:
        figure.savefig(part, **options)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        if isinstance(ax, type) or not callable(getattr(ax, "get_figure", None)):
            raise InputError(f"ax must be matplotlib axes; got {checks.shown(ax)}.")
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        raise MissingDependencyError(
            "charts need matplotlib: apt install python3-matplotlib, or pip install matplotlib."
        ) from None
    _, new = plt.subplots(layout="constrained")
    return new


def _named(items: Any, kind: type) -> Mapping[str, Any]:
    """Name -> object; a single one has no name."""
    named = items if isinstance(items, Mapping) else {"": items}
    for name, one in named.items():
        which = f"the {kind.__name__} named {checks.shown(name)}" if name else "what is drawn"
        checks.instance(which, one, kind, f"a {kind.__name__}")
    return named


def _legend(ax: Axes, items: Any) -> Axes:
    if isinstance(items, Mapping):
        ax.legend()
    return ax
