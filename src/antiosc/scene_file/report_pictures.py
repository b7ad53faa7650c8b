"""The pictures of a report, as data of a page; a sentence replaces what cannot be drawn."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from antiosc import progress
from antiosc.charts.figures import legend_beside, new_figure, save_figure
from antiosc.charts.histories import plot_force, plot_motion
from antiosc.charts.models import plot_model
from antiosc.errors import AntioscError
from antiosc.plotting.parts import plot_deformed, plot_map
from antiosc.scene_file import result_tables
from antiosc.scene_file.output import ends
from antiosc.scene_file.run import Results
from antiosc.simulation.scene_history import SceneHistory

#: Inches of a chart.
SIZE = (7.0, 3.4)
#: Most curves of one chart.
CURVES = 12
DEFORMED = (
    "The structure at the time of the largest displacement of its site, or of the largest force;"
    " displacements are drawn larger by the factor stated."
)
#: How a part in space is shown: name -> (elevation, azimuth) in degrees; None: the usual view.
VIEWS = {"": None, ", from behind": (24.0, 128.0), ", from above": (75.0, -52.0)}


@dataclass(frozen=True)
class Picture:
    """A picture of the page.

    Attributes
    ----------
    heading, caption : what it shows, with units.
    data : a data URL; empty where it could not be drawn, and the caption says why.
    """

    heading: str
    caption: str
    data: str


def pictures(found: Results) -> Iterator[Picture]:
    """All pictures of a result. Every rank must ask for all: fields are shared among them."""
    if found.history is not None:
        yield from _of_history(found)
    if found.model is not None:
        yield _chart(
            "Anti-oscillators",
            "Frequency (Hz) and mass of each anti-oscillator: in kg at one site, as share of the"
            " static mass at several.",
            lambda figure: _spectrum(found.model, figure.subplots()),
        )
        yield _drawn(
            "Dynamic stiffness",
            "|Z(ω)| (N/m) over frequency (Hz), infinite at the antiresonances, and the share of the"
            " static mass that the anti-oscillators hold.",
            lambda path: plot_model(found.model, path),
            ".svg",
        )
    if found.batch is not None:
        yield _chart(
            "Sweep",
            "Peak force (N) of each impact, over the first value that varies.",
            lambda figure: _swept(found, figure.subplots()),
        )
    if found.map is not None:
        for quantity in ("peak_force", "contact_time", "k0"):
            if quantity in found.map.quantities():
                yield _drawn(
                    f"Map: {quantity.replace('_', ' ')}",
                    f"{result_tables.named(quantity)} over the surface.",
                    partial(plot_map, found.map, quantity=quantity),
                    ".png",
                )


def _of_history(found: Results) -> Iterator[Picture]:
    hit = found.history
    scene = isinstance(hit, SceneHistory)
    force = _forces if scene else plot_force
    yield _chart(
        "Contact force",
        "Force (N) over time (ms); an estimated error of 0.5 % or more is drawn as a band.",
        lambda figure: force(hit, figure.subplots()),
    )
    if not scene:
        yield _chart(
            "Displacements",
            "Displacements (mm) of the site and of the impactor over time (ms).",
            lambda figure: plot_motion(hit, figure.subplots()),
        )
    yield _chart(
        "Energies",
        "Energies (J) of both bodies, of the contact and of what is dissipated, over time (ms).",
        lambda figure: _energies(hit, figure.subplots()),
    )
    if found.probes:
        yield _chart(
            "Probes",
            "The signals of the probes, each divided by its largest value (in the legend).",
            lambda figure: _probes(found, figure.subplots()),
        )
    if found.structure is not None:
        yield from _of_structure(found)


def _of_structure(found: Results) -> Iterator[Picture]:
    """The deformed structure, from several sides where the site is known."""
    point, direction = _struck(found)
    for name, view in (VIEWS if point is not None else {"": None}).items():
        options = {"point": point, "direction": direction, "view": view}
        picture = _drawn(
            f"Deformed structure{name}", DEFORMED, partial(_deformed, found, **options), ".png"
        )
        yield picture
        if not picture.data:  # it cannot be drawn from another side either
            return


def _deformed(found: Results, path: Path, **options: Any) -> None:
    plot_deformed(found.structure, found.history, path, **options)


def _struck(found: Results) -> tuple[Any, Any]:
    """Point and direction of the one site, for the arrow of the impact; None where not known."""
    sites = list(found.compiled.document.data.get("sites", {}).values())
    one = sites[0] if len(sites) == 1 else {}
    point, direction = one.get("point"), one.get("direction")
    known = isinstance(point, list) and isinstance(direction, list) and len(point) == 3
    return (point, direction) if known else (None, None)


# -- charts


def _forces(hit: SceneHistory, ax: Any) -> None:
    for a, b in ends(hit)[:CURVES]:
        contact = hit[a, b]
        ax.plot(1e3 * contact.time, contact.force, lw=1.2, label=_plain(f"{a} – {b}"))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel("contact force (N)")
    legend_beside(ax)


def _energies(hit: Any, ax: Any) -> None:
    energy = hit.energy
    for name in ("kinetic", "strain", "contact", "dissipated"):
        ax.plot(1e3 * hit.time, getattr(energy, name), lw=1.2, label=name)
    ax.set_xlabel("time (ms)")
    ax.set_ylabel("energy (J)")
    legend_beside(ax)


def _spectrum(model: Any, ax: Any) -> None:
    several = np.ndim(model.k0) > 0
    height = model.mass_shares if several else model.m
    ax.vlines(model.omega / (2 * np.pi), 0, height, lw=1.5)
    ax.plot(model.omega / (2 * np.pi), height, "o", ms=4)
    if model.n and np.max(model.omega) > 30 * np.min(model.omega[model.omega > 0], initial=np.inf):
        ax.set_xscale("log")
    ax.set_ylim(bottom=0)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("share of the static mass" if several else "mass (kg)")


def _swept(found: Results, ax: Any) -> None:
    name, values = next(iter(found.compiled.varied.items()))
    numbers = [v for v in values if isinstance(v, int | float)]
    x = numbers if len(numbers) == len(values) else range(len(values))
    ax.plot(x, found.batch.peak_force, "o-", ms=4, lw=1)
    ax.set_xlabel(_plain(f"{name} (SI)"))
    ax.set_ylabel("peak force (N)")


def _probes(found: Results, ax: Any) -> None:
    for name, values in list(found.probes.items())[:CURVES]:
        times = found.compiled.probes[name].arguments.get("times", found.history.time)
        flat = np.asarray(values).reshape(len(values), -1)
        largest = np.abs(flat).max(axis=0)
        column = flat[:, int(np.argmax(largest))]
        size = float(largest.max())
        unit = result_tables.probe_unit(found, name)
        label = _plain(f"{name}, at most {size:.3g} {unit}")
        ax.plot(1e3 * np.asarray(times), column / (size or 1.0), lw=1.2, label=label)
    ax.set_xlabel("time (ms)")
    ax.set_ylabel("share of the largest value")
    legend_beside(ax)


def _plain(name: str) -> str:
    """A name of the scene in a picture: not read as a formula."""
    shown = "".join(c if c.isprintable() else "?" for c in name.replace("$", r"\$"))
    return shown if len(shown) <= 60 else f"{shown[:57]}…"


# -- as data


def _chart(heading: str, caption: str, fill: Callable[[Any], Any]) -> Picture:
    """A chart that a function draws into a new figure."""

    def draw(path: Path) -> None:
        figure = new_figure(SIZE, shown=False)
        fill(figure)
        save_figure(figure, path)

    return _drawn(heading, caption, draw, ".svg")


def _drawn(heading: str, caption: str, draw: Callable[[Path], Any], ending: str) -> Picture:
    kinds = {".svg": "image/svg+xml", ".png": "image/png"}
    with progress.doing(f"drawing: {heading}"), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"picture{ending}"
        try:
            draw(path)
        except (AntioscError, ValueError) as error:  # ValueError: a name read as a formula
            return Picture(heading, f"Not drawn: {error}", "")
        content = base64.b64encode(path.read_bytes()).decode("ascii")
    return Picture(heading, caption, f"data:{kinds[ending]};base64,{content}")
