"""The pictures of results: charts over time, and pictures as files or as data of a page."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antiosc.base import progress
from antiosc.base._types import Array
from antiosc.base.charts.figures import legend_beside, new_figure, save_figure
from antiosc.base.errors import AntioscError
from antiosc.models.anti_oscillators import AntiOscillators

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Most curves of one chart.
CURVES = 12


@dataclass(frozen=True)
class Picture:
    """A picture of a report.

    Attributes
    ----------
    heading, caption : what it shows, with units.
    draw : writes it to a file of this ending.
    again : whether it shows what the one before it does, and fails where that does.
    """

    heading: str
    caption: str
    draw: Callable[[Path], object]
    ending: str = ".png"
    again: bool = False


class Drawn(NamedTuple):
    """A picture with its data URL; that is empty where it cannot be drawn: the caption says why."""

    heading: str
    caption: str
    data: str


def drawn(pictures: Iterable[Picture]) -> Iterator[Drawn]:
    """Pictures as data; every rank must ask for all: fields are shared among them."""
    before = ""
    for one in pictures:
        if one.again and not before:
            continue
        caption, before = one.caption, ""
        with progress.doing(f"drawing: {one.heading}"), tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"picture{one.ending}"
            try:
                one.draw(path)
                kind = {".svg": "svg+xml"}.get(one.ending, "png")
                content = base64.b64encode(path.read_bytes()).decode("ascii")
                before = f"data:image/{kind};base64,{content}"
            except (AntioscError, ValueError) as error:  # ValueError: a name read as a formula
                caption = f"Not drawn: {error}"
        yield Drawn(one.heading, caption, before)


def chart(heading: str, caption: str, fill: Callable[[Axes], object]) -> Picture:
    """A chart that a function draws into new axes."""

    def draw(path: Path) -> None:
        figure = new_figure((7.0, 3.4), shown=False)
        fill(figure.subplots())
        save_figure(figure, path)

    return Picture(heading, caption, draw, ".svg")


def curves(given: Iterable[tuple[str, Array, Array]], y: str, ax: Axes) -> None:
    """Curves over time: (name, times in s, values)."""
    for name, time, values in islice(given, CURVES):
        ax.plot(1e3 * time, values, lw=1.2, label=plain(name))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel(y)
    legend_beside(ax)


def spectrum(model: AntiOscillators, ax: Axes) -> None:
    """Frequency and mass of each anti-oscillator."""
    several = np.ndim(model.k0) > 0
    height = model.mass_shares if several else model.m
    ax.vlines(model.omega / (2 * np.pi), 0, height, lw=1.5)
    ax.plot(model.omega / (2 * np.pi), height, "o", ms=4)
    if model.n and np.max(model.omega) > 30 * np.min(model.omega[model.omega > 0], initial=np.inf):
        ax.set_xscale("log")
    ax.set_ylim(bottom=0)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("share of the static mass" if several else "mass (kg)")


def plain(name: str) -> str:
    """A name of the scene in a picture: not read as a formula."""
    shown = "".join(c if c.isprintable() else "?" for c in name.replace("$", r"\$"))
    return shown if len(shown) <= 60 else f"{shown[:57]}…"
