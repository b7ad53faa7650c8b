"""The pictures of a report, as data of a page; a sentence replaces what cannot be drawn."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from antiosc.app.scene_file import result_tables
from antiosc.app.scene_file.run import Results
from antiosc.base import progress
from antiosc.base.charts.figures import legend_beside, new_figure, save_figure
from antiosc.base.charts.histories import plot_force, plot_motion
from antiosc.base.charts.models import plot_model
from antiosc.base.errors import AntioscError
from antiosc.models.body import places_of
from antiosc.models.model_info import info_of
from antiosc.results.pictures import plot_deformed, plot_map

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


class Picture(NamedTuple):
    """A picture of the page.

    Attributes
    ----------
    heading, caption : what it shows, with units.
    data : a data URL; empty where it could not be drawn, and the caption says why.
    """

    heading: str
    caption: str
    data: str


def pictures(found: Results, one_view: bool = False) -> Iterator[Picture]:
    """All pictures of a result. Every rank must ask for all: fields are shared among them.

    `one_view`: the part in space from one side, for the page turns it.
    """
    if found.history is not None:
        yield from _of_history(found, one_view)
    if found.model is not None:
        yield _chart(
            "Anti-oscillators",
            "Frequency (Hz) and mass of each anti-oscillator: in kg at one site, as share of the"
            " static mass at several.",
            partial(_spectrum, found.model),
        )
        yield _drawn(
            "Dynamic stiffness",
            "|Z(ω)| (N/m) over frequency (Hz), infinite at the antiresonances, and the share of the"
            " static mass that the anti-oscillators hold.",
            partial(plot_model, found.model),
            ".svg",
        )
    if hasattr(found.fall, "plot"):
        yield _drawn(
            "Fall",
            "The part as it first touches, the heights (m), the energies (J) and the peak forces"
            " of the impacts (N).",
            found.fall.plot,
            ".png",
        )
    if found.worst is not None:
        about = "The largest value at each node over all impacts."
        yield _drawn("Largest stress", about, found.worst.plot, ".png")
    if found.found is not None:
        about = "Signals in the band that is compared, and the contact force (N) that was found."
        yield _drawn("Signals and force", about, found.found.plot, ".png")
    if found.batch is not None:
        yield _chart(
            "Sweep",
            "Peak force (N) of each impact, over the first value that varies.",
            partial(_swept, found),
        )
    if found.sample is not None:
        about = (
            "Peak forces (N) of the runs, and their quantiles with the bars of the number of runs."
        )
        yield _drawn("Random values", about, found.sample.plot, ".svg")
    quantities = {} if found.map is None else found.map.quantities()
    for quantity in ("peak_force", "contact_time", "k0"):
        if quantity in quantities:
            yield _drawn(
                f"Map: {quantity.replace('_', ' ')}",
                f"{result_tables.named(quantity)} over the surface.",
                partial(plot_map, found.map, quantity=quantity),
                ".png",
            )


def _of_history(found: Results, one_view: bool) -> Iterator[Picture]:
    hit = found.history
    contacts = result_tables.contacts_of(hit)
    yield _chart(
        "Contact force",
        "Force (N) over time (ms); an estimated error of 0.5 % or more is drawn as a band.",
        partial(_forces, contacts) if contacts else partial(plot_force, hit),
    )
    if not contacts:
        yield _chart(
            "Displacements",
            "Displacements (mm) of the site and of the impactor over time (ms).",
            partial(plot_motion, hit),
        )
    yield _chart(
        "Energies",
        "Energies (J) of both bodies, of the contact and of what is dissipated, over time (ms).",
        partial(_energies, hit),
    )
    if found.probes:
        yield _chart(
            "Probes",
            "The signals of the probes, each divided by its largest value (in the legend).",
            partial(_probes, found),
        )
    if found.structure is not None:
        yield from _of_structure(found, one_view)
    for name, peak in (found.stresses or {}).items():
        about = f"The largest value at each node over the run: {name.replace('_', ' ')}."
        yield _drawn("Largest stress", about, peak.plot, ".png")


def _of_structure(found: Results, one_view: bool = False) -> Iterator[Picture]:
    """The deformed structure, from several sides where the site is known."""
    point, direction = _struck(found)
    for name, view in ({"": None} if one_view or point is None else VIEWS).items():
        options = {"point": point, "direction": direction, "view": view}
        draw = partial(plot_deformed, found.structure, found.history, **options)
        picture = _drawn(f"Deformed structure{name}", DEFORMED, draw, ".png")
        yield picture
        if not picture.data:  # it cannot be drawn from another side either
            return


def _struck(found: Results) -> tuple[Any, Any]:
    """Point and direction of the one site, for the arrow of the impact; None where not known."""
    points, facts = list(places_of(found.model).values()), info_of(found.model)
    known = len(points) == 1 and len(points[0]) == 3 and facts.direction is not None
    return (points[0], facts.direction) if known else (None, None)


# -- charts


def _curves(ax: Any, curves: Iterable[tuple[str, Any, Any]], y: str) -> None:
    """Curves over time: (name, times in s, values)."""
    for name, time, values in islice(curves, CURVES):
        ax.plot(1e3 * np.asarray(time), values, lw=1.2, label=_plain(name))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel(y)
    legend_beside(ax)


def _forces(contacts: Mapping[tuple[str, str], Any], ax: Any) -> None:
    curves = ((f"{a} – {b}", one.time, one.force) for (a, b), one in contacts.items())
    _curves(ax, curves, "contact force (N)")


def _energies(hit: Any, ax: Any) -> None:
    names = ("kinetic", "strain", "contact", "dissipated")
    _curves(ax, ((name, hit.time, getattr(hit.energy, name)) for name in names), "energy (J)")


def _probes(found: Results, ax: Any) -> None:
    curves = (_probe(found, name) for name in found.probes)
    _curves(ax, curves, "share of the largest value")


def _probe(found: Results, name: str) -> tuple[str, Any, Any]:
    """The component with the largest value, divided by it."""
    flat = result_tables.probe_columns(found, name)
    largest = np.abs(flat).max(axis=0)
    times = found.compiled.probes[name].arguments.get("times", found.history.time)
    k = int(np.argmax(largest))
    component, unit = list(result_tables.probe_components(found, name).items())[k]
    told = f"{name} {component}".rstrip() + f", at most {largest[k]:.3g} {unit}"
    return told, times, flat[:, k] / (float(largest[k]) or 1.0)


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
    numbers = all(isinstance(v, int | float) for v in values)
    ax.plot(values if numbers else range(len(values)), found.batch.peak_force, "o-", ms=4, lw=1)
    ax.set_xlabel(_plain(f"{name} (SI)"))
    ax.set_ylabel("peak force (N)")


def _plain(name: str) -> str:
    """A name of the scene in a picture: not read as a formula."""
    shown = "".join(c if c.isprintable() else "?" for c in name.replace("$", r"\$"))
    return shown if len(shown) <= 60 else f"{shown[:57]}…"


# -- as data


def _chart(heading: str, caption: str, fill: Callable[[Any], Any]) -> Picture:
    """A chart that a function draws into new axes."""

    def draw(path: Path) -> None:
        figure = new_figure(SIZE, shown=False)
        fill(figure.subplots())
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
