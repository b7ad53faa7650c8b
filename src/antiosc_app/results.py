"""How the results of a scene are presented: on the terminal, in files, and on the page of a report.

Each kind of result is described once, as `Presentation`: texts, tables, and pictures over time.
"""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from antiosc import AntiOscillators, History, SceneHistory, advise
from antiosc.base import progress
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError
from antiosc.base.texts import engineering, percent, point_text as placed, prefixed, range_text
from antiosc.extension import (
    CAUSES,
    MAP_QUANTITIES,
    QUANTITIES,
    ErrorBudget,
    error_scope,
    hardest,
    trusted,
)
from antiosc.models.body import GRAVITY, info_of, site_points
from antiosc.plot.charts import (
    legend_beside,
    new_figure,
    plot_force,
    plot_model,
    plot_motion,
    save_figure,
)
from antiosc.plotting import plot_deformed, plot_map
from antiosc_app.scene_file.build import Call
from antiosc_app.scene_file.document import label
from antiosc_app.scene_file.run import Results, varied
from antiosc_app.scene_file.scene import probe_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from antiosc import Drops, Fall, PeakField, Sample


#: Most curves of one chart.
CURVES = 12


@dataclass(frozen=True)
class Picture:
    """A picture of a report.

    Attributes
    ----------
    heading, caption : what it shows, with units.
    draw : writes it to a file of this ending.
    same_view : whether it shows what the one before it does, and fails where that does.
    """

    heading: str
    caption: str
    draw: Callable[[Path], object]
    ending: str = ".png"
    same_view: bool = False


class Drawn(NamedTuple):
    """A picture with its data URL; that is empty where it cannot be drawn: the caption says why."""

    heading: str
    caption: str
    data: str


def drawn(pictures: Iterable[Picture]) -> Iterator[Drawn]:
    """Pictures as data; every rank must ask for all: fields are shared among them."""
    before = ""
    for one in pictures:
        if one.same_view and not before:
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
        ax.plot(1e3 * time, values, lw=1.2, label=escaped(name))
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


def escaped(name: str) -> str:
    """A name of the scene in a picture: not read as a formula."""
    shown = "".join(c if c.isprintable() else "?" for c in name.replace("$", r"\$"))
    return shown if len(shown) <= 60 else f"{shown[:57]}…"


#: Names and values; a table by the names of its columns.
Rows: TypeAlias = list[tuple[str, str]]
Columns: TypeAlias = dict[str, Any]
#: What stands below a heading: names and values, a table of columns, a sentence, or nothing.
Block: TypeAlias = Rows | Columns | str

#: Rows of a table of a sweep that are printed; the files hold all.
ROWS = 30
#: Units of the quantities of probes.
PROBE_UNITS = {
    **{"displacement": "m", "velocity": "m/s", "acceleration": "m/s²", "rotation": "rad"},
    **{"stress": "Pa", "von_mises": "Pa"},
}
#: Section forces with their units, by their number.
SECTION_FORCES = {
    1: {"N": "N"},
    3: {"N": "N", "V": "N", "M": "N m"},
    6: {"N": "N", "Vy": "N", "Vz": "N", "T": "N m", "My": "N m", "Mz": "N m"},
    8: dict.fromkeys(("N1", "N2", "N12"), "N/m")
    | dict.fromkeys(("M1", "M2", "M12"), "N m/m")
    | dict.fromkeys(("Q1", "Q2"), "N/m"),
}
#: How a part in space is shown: name -> (elevation, azimuth) in degrees; None: the usual view.
VIEWS = {"": None, ", from behind": (24.0, 128.0), ", from above": (75.0, -52.0)}
ENERGIES = ("kinetic", "strain", "contact", "dissipated")

# -- words and tables


def format_rows(rows: Rows) -> str:
    """Names and values in two columns."""
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join(f"{name:<{width}}  {value}".rstrip() for name, value in rows)


def format_columns(table: Columns) -> str:
    """A table with a line of names; of long ones the first rows; units with prefixes."""
    columns = with_prefixes(table)
    rows = list(zip(*columns.values(), strict=True))
    cells = [list(columns), *([format_number(value) for value in row] for row in rows[:ROWS])]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    pairs = [zip(row, widths, strict=True) for row in cells]
    text = ["  ".join(f"{cell:>{width}}" for cell, width in row).rstrip() for row in pairs]
    if len(rows) > ROWS:
        text.append(f"… and {len(rows) - ROWS} more rows (see sweep.csv)")
    return "\n".join(text)


def with_prefixes(table: Columns) -> dict[str, list[object]]:
    """The columns of a table, values with units in the prefix that suits the largest."""
    return dict(_column(name, list(values)) for name, values in table.items())


def _column(name: str, values: list[object]) -> tuple[str, list[object]]:
    """A column whose name ends with its unit, as "contact time (s)", in (µs) where that fits."""
    title, _, unit = name.partition(" (")
    numbers = [float(v) for v in values if isinstance(v, float | np.floating) and np.isfinite(v)]
    if not unit or len(numbers) < len(values):
        return name, values
    factor, prefixed_unit = prefixed(max(map(abs, numbers), default=0.0), unit.rstrip(")"))
    return f"{title} ({prefixed_unit})", [factor * v for v in numbers]


def format_number(value: object) -> str:
    """A number to five digits; a dash for one that is not finite."""
    if isinstance(value, float | np.floating):
        return f"{value:.5g}" if np.isfinite(value) else "–"
    return str(value)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _largest(peak: PeakField) -> str:
    value, point, time = peak.largest(1)[0]
    where = f"at {placed(point)}, {engineering(time, 's')}"
    return f"largest {engineering(value, peak.unit, 4)} {where}"


def _quantiles(many: Sample | Drops, units: Mapping[str, str]) -> Columns:
    """Quantiles of some quantities of an ensemble, with their bars."""
    rows = []
    for name, unit in units.items():
        values = [many.quantile(name, q) for q in (0.5, 0.9, 0.99)]
        rows += [
            (f"{_words(name)} ({unit})", q, one.value, one.low, one.high)
            for q, one in zip((0.5, 0.9, 0.99), values, strict=True)
        ]
    names = ("quantity", "quantile", "value", "low", "high")
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def error_budget(history: Any) -> ErrorBudget | None:
    """The error budget of a history; None where it has none."""
    try:
        budget = getattr(history, "error_budget", None)
    except AntioscError:  # the model was not extracted for it
        return None
    return budget if isinstance(budget, ErrorBudget) else None


# -- the kinds of results


@dataclass
class Presentation:
    """How one kind of result is presented; made on every rank, for ranks share fields.

    Attributes
    ----------
    text : for the terminal.
    tables : file -> its columns.
    numbers : for result.json.
    plotted : name of a file -> what has a method `plot`.
    fields : file -> what writes it.
    sections : heading of a report -> what stands below it.
    pictures : of a report.
    """

    text: Sequence[str] = ()
    tables: dict[str, Columns] = field(default_factory=dict)
    numbers: dict[str, object] = field(default_factory=dict)
    plotted: dict[str, object] = field(default_factory=dict)
    fields: dict[str, Callable[[Path], Path]] = field(default_factory=dict)
    sections: dict[str, list[Block]] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()


def _model(found: Results) -> Presentation:
    """The structure and its reduced model; in a report it stands behind the pictures."""
    shown, part, model = Presentation(), found.structure, found.model
    blocks: list[Block] = []
    if part is not None:
        shown.text = [part.describe()]
        shown.numbers["structure"] = part.describe()
    if model is not None:
        rows = _model_rows(model)
        shown.text = [*shown.text, format_rows(rows)]
        names = ("k0", "m0", "m_st", "omega", "m", "P", "sites")
        attributes = {name: getattr(model, name, None) for name in names}
        shown.numbers["model"] = attributes | {"points": site_points(model)}
        shown.plotted["model"] = model
        blocks.append(rows)
        if np.ndim(model.k0) == 0:
            table = {"anti-oscillator": range(1, model.n + 1)}
            table |= {"frequency (Hz)": model.omega / (2 * np.pi), "mass (kg)": model.m}
            blocks.append(table | {"stiffness (N/m)": model.k})
        masses = "Frequency (Hz) and mass of each anti-oscillator: in kg at one site, as share"
        stiff = "|Z(ω)| (N/m) over frequency (Hz), infinite at the antiresonances, and the share"
        shown.pictures = [
            chart("Anti-oscillators", f"{masses} of the static mass at several.",
                  partial(spectrum, model)),
            Picture("Dynamic stiffness", f"{stiff} of the static mass that the anti-oscillators"
                    " hold.", partial(plot_model, model), ".svg"),
        ]  # fmt: skip
    if blocks or part is not None:
        shown.sections["Model"] = blocks
    return shown


def advice_of(found: Results) -> Rows:
    """The structure, and what `advise` says of the family, where it can."""
    if found.structure is None:
        return []
    rows = [("structure", found.structure.describe())]
    if not hasattr(found.impactor, "hertz"):
        return rows
    try:
        advice = advise(found.structure, found.impactor)
    except AntioscError as error:
        return [*rows, ("element family", f"no advice: {error}")]
    return [
        *rows,
        ("sufficient element family", advice.family),
        ("largest element", f"{1e3 * advice.element_size:.3g} mm"),
        ("highest relevant frequency", engineering(advice.frequency, "Hz")),
        ("reasons", "; ".join(advice.reasons)),
    ]


def _model_rows(model: AntiOscillators) -> Rows:
    """The parameters of the reduced model."""
    rows = [(f"site {name}".rstrip(), placed(point)) for name, point in site_points(model).items()]
    several = bool(np.ndim(model.k0))
    if several:
        rows.append(("sites", ", ".join(model.sites)))
    else:
        rows.append(("static stiffness k0", engineering(model.k0, "N/m", 4)))
        rows.append(("static mass m_st", engineering(model.m_st, "kg", 4)))
    rows.append(("anti-oscillators", f"{model.n}"))
    if not several and model.m_st > 0:
        rows.append(("captured mass", f"{1 - model.m0 / model.m_st:.2%} of m_st"))
    first = ", ".join(f"{w / (2 * np.pi):.5g}" for w in model.omega[:5])
    more = ", …" if len(model.omega) > 5 else ""
    return [*rows, ("antiresonances", f"{first or 'none'}{more} Hz")]


def _impact(found: Results) -> Presentation:
    """A history with its probes and its largest stresses."""
    hit, peaks = found.history, found.stresses or {}
    probes = [Probe(found, name) for name in found.probes or ()]
    asked, stresses, budget = _probe_rows(probes), _stress_rows(peaks), error_budget(hit)
    columns = {n.replace("[", "(").replace("]", ")"): v for n, v in hit.columns().items()}
    columns |= {f"{name} energy (J)": getattr(hit.energy, name) for name in ENERGIES}
    groups: list[Columns] = []  # of probes with equal times
    for probe in probes:
        same = (each for each in groups if np.array_equal(each["time (s)"], probe.times))
        group = next(same, None)
        if group is None:
            groups.append(group := {"time (s)": probe.times})
        group |= probe.table()
    names = (f"probes_{k + 1}.csv" if k else "probes.csv" for k in range(len(groups)))
    bars = {}
    for name, bar in (budget or {}).items():
        bars[name] = {cause: getattr(bar, cause) for cause in (*CAUSES, "total")}
    several = isinstance(hit, SceneHistory)
    return Presentation(
        text=[hit.summary(), str(budget or ""), format_rows([*asked, *stresses])],
        tables={"history.csv": columns, **dict(zip(names, groups, strict=True))},
        numbers={
            "result": hit.numbers() | ({"error_budget": bars} if bars else {}),
            "probes": {probe.name: probe.peak() for probe in probes},
            "stress": _stress_numbers(peaks),
        },
        plotted={**({} if several else {"force": hit}), **peaks},
        fields={f"{name}.vtu": peak.write for name, peak in peaks.items()},
        sections={
            "Results": [_facts(hit), hit.explanation, asked, stresses],
            "Errors": _errors(hit),
        },
        pictures=_of_impact(found, probes),
    )


def _facts(hit: History) -> Block:
    if contacts := _contacts(hit):
        hits = contacts.values()
        table: Columns = {"contact": [f"{a} – {b}" for a, b in contacts]}
        for n, unit in QUANTITIES.items():
            table[f"{_words(n)} ({unit})"] = [getattr(each, n) for each in hits]
        return table | {"contacts": [len(each.contacts) for each in hits]}
    e = "not defined" if hit.restitution is None else f"{hit.restitution:.4f}"
    numbers = [(_words(n), engineering(getattr(hit, n), u, 4)) for n, u in QUANTITIES.items()]
    return [*numbers, ("contacts", f"{len(hit.contacts)}"), ("coefficient of restitution", e)]


def _errors(hit: History) -> list[Block]:
    budget = error_budget(hit)
    rows = [(f"time integration: {name}", percent(value)) for name, value in hit.error.items()]
    rows.append(("these errors cover", error_scope(hit)))
    rows.append(("energy drift over the run, of the energy", percent(hit.energy.drift)))
    rows += [("details", text) for text in hit.details]
    if budget is None:
        return [rows]
    table: Columns = {"Error budget": [_words(name) for name in budget]}
    table["value"] = [engineering(bar.value, QUANTITIES[n], 4) for n, bar in budget.items()]
    for cause in budget.causes:
        table[cause] = [percent(getattr(bar, cause)) for bar in budget.values()]
    table["numerical" if budget.law else "total"] = [
        percent(bar.without_law + (bar.law or 0.0)) for bar in budget.values()
    ]
    return [rows, table, *filter(None, [budget.law]), *budget.notes]


def _probe_rows(probes: Sequence[Probe]) -> Rows:
    """The largest value of each probe with its component and time."""
    rows = []
    for probe in probes:
        p = probe.peak()
        what = f"{_words(p['quantity'])} {p['component']}".rstrip()
        value, time = engineering(p["value"], p["unit"], 4), engineering(p["time"], "s")
        g = f" ({p['g']:.4g} g)" if "g" in p else ""
        rows.append((f"probe {probe.name}", f"{what}: largest {value}{g} at {time}"))
    return rows


def _stress_rows(peaks: Mapping[str, PeakField]) -> Rows:
    """The verdicts on the largest stresses, or the values where no strength is known."""
    rows = []
    for name, peak in peaks.items():
        sentence = _largest(peak) if peak.exposure is None else peak.margin().sentence
        rows.append((_words(name), sentence))
        if peak.mesh_error is not None and (value := peak.values.max()):
            share = peak.mesh_error[np.argmax(peak.values)] / value
            rows.append(("", f"estimated error by the mesh: {share:.1%} of it"))
        if peak.doubt:
            rows.append(("", peak.doubt))
    return rows


def _stress_numbers(peaks: Mapping[str, PeakField]) -> Columns:
    """Quantity -> its largest value with place and time, and the margin."""
    content: Columns = {}
    for name, peak in peaks.items():
        value, point, time = peak.largest(1)[0]
        content[name] = {"value": value, "unit": peak.unit, "point": point, "time": time}
        content[name]["doubt"] = peak.doubt
        if peak.mesh_error is not None:
            content[name]["mesh_error"] = peak.mesh_error[np.argmax(peak.values)]
        content[name] |= _margin_numbers(peak)
    return content


def _margin_numbers(peak: PeakField) -> Columns:
    """The verdict where a strength is known."""
    if peak.exposure is None:
        return {}
    keys = ("criterion", "exposure", "margin", "reached", "layer", "sentence", "point", "time")
    return {"margin": {key: getattr(peak.margin(), key) for key in keys}}


def _of_impact(found: Results, probes: Sequence[Probe]) -> list[Picture]:
    hit, contacts = found.history, _contacts(found.history)
    forces = [(f"{a} – {b}", one.time, one.force) for (a, b), one in contacts.items()]
    several = partial(curves, forces, "contact force (N)")
    about = "Force (N) over time; an estimated error of 0.5 % or more is drawn as a band."
    shown = [chart("Contact force", about, several if contacts else partial(plot_force, hit))]
    if not contacts:
        about = "Displacements of the site and of the impactor over time."
        shown.append(chart("Displacements", about, partial(plot_motion, hit)))
    energies = [(name, hit.time, getattr(hit.energy, name)) for name in ENERGIES]
    about = "Energies (J) of both bodies, of the contact and of what is dissipated, over time."
    shown.append(chart("Energies", about, partial(curves, energies, "energy (J)")))
    if probes:
        about = "The component of each probe with the largest value; of probes with several units"
        about += " each is divided by its largest value, which the legend states."
        shown.append(chart("Probes", about, partial(_signals, probes)))
    if found.structure is not None:
        about = "The structure at the time of the largest displacement of its site, or of the"
        about += " largest force; displacements are drawn larger by the factor stated."
        arrow = _struck(found.model)
        for name, view in (VIEWS if arrow else {"": None}).items():
            draw = partial(plot_deformed, found.structure, hit, view=view, **arrow)
            shown.append(Picture(f"Deformed structure{name}", about, draw, same_view=bool(name)))
    for name, peak in (found.stresses or {}).items():
        about = f"The largest value at each node over the run: {_words(name)}."
        shown.append(Picture("Largest stress", about, peak.plot))
    return shown


def _struck(model: AntiOscillators) -> Columns:
    """Point and direction of the one site, for the arrow of the impact, if known in space."""
    points, direction = list(site_points(model).values()), info_of(model).direction
    known = len(points) == 1 and len(points[0]) == 3 and direction is not None
    return {"point": points[0], "direction": direction} if known else {}


def _contacts(history: History) -> dict[tuple[str, str], Any]:
    """The contacts of a scene of several, by their ends; none of a single impact."""
    if not isinstance(history, SceneHistory):
        return {}
    return {(c.a, c.b): history[c.a, c.b] for c in history.assembly.scene.contacts}


class Probe:
    """One probe: its quantity, times [s], and values (n, c) by components."""

    def __init__(self, found: Results, name: str) -> None:
        asked = found.compiled.probes[name].arguments
        self.name = name
        self.quantity: str = asked.get("quantity", "displacement")
        times = asked.get("times", found.history.time)
        given = probe_times(found.history) if isinstance(times, Call) else times
        self.times = np.reshape(given, -1).astype(float)
        values: Array = np.asarray(found.probes[name])
        self.tensor = values.ndim == 3
        if self.tensor:  # the six of a symmetric one
            values = values[:, *np.triu_indices(values.shape[1])]
        self.scalar = values.ndim == 1
        self.values = values.reshape(len(values), -1)

    def units(self) -> dict[str, str]:
        """The components with their units, one for each column; "" of a scalar."""
        unit, count = PROBE_UNITS.get(self.quantity, ""), self.values.shape[1]
        if self.scalar:
            return {"": unit}
        if self.tensor:
            names = "xx xy xz yy yz zz" if count == 6 else "xx xy yy"
            return dict.fromkeys(names.split(), unit)
        if self.quantity == "section_forces":
            return SECTION_FORCES[count]
        alone = (self.quantity, count) == ("rotation", 1)
        return dict.fromkeys("z" if alone else "xyz"[:count], unit)

    def table(self) -> Columns:
        """The columns of a file."""
        heads = [
            f"{self.name} {c}".rstrip() + (f" ({unit})" if unit else "")
            for c, unit in self.units().items()
        ]
        return dict(zip(heads, self.values.T, strict=True))

    def peak(self) -> Columns:
        """The largest value: of a vector its magnitude; else of one component.

        Keys: quantity, component ("magnitude", "" of a scalar), value, unit, time, of an
        acceleration also g.
        """
        values, units = self.values, self.units()
        if self.quantity in PROBE_UNITS and not self.tensor and len(units) > 1:
            values = np.linalg.norm(values, axis=1)[:, None]
            units = {"magnitude": next(iter(units.values()))}
        at, k = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
        component, unit = list(units.items())[k]
        value, time = float(values[at, k]), float(self.times[at])
        peak = {"quantity": self.quantity, "component": component, "value": value}
        g = {"g": value / GRAVITY} if self.quantity == "acceleration" else {}
        return peak | {"unit": unit, "time": time} | g

    def signal(self) -> tuple[str, Array, Array, str]:
        """The component with the largest value: its name, times, values and unit."""
        k = int(np.argmax(np.abs(self.values).max(axis=0)))
        component, unit = list(self.units().items())[k]
        return f"{self.name} {component}".rstrip(), self.times, self.values[:, k], unit


def _signals(probes: Sequence[Probe], ax: Axes) -> None:
    """Draw the signals of probes in their unit, or of several units as shares of their maxima."""
    signals = [probe.signal() for probe in probes[:CURVES]]
    largest = [float(np.abs(values).max()) for _, _, values, _ in signals]
    kinds = {(probe.quantity, signal[3]) for probe, signal in zip(probes, signals, strict=False)}
    if len(kinds) == 1:
        ((quantity, unit),) = kinds
        factor, scaled_unit = prefixed(max(largest), unit)
        scaled = [(name, time, factor * values) for name, time, values, _ in signals]
        curves(
            scaled, f"{_words(quantity)} ({scaled_unit})" if scaled_unit else _words(quantity), ax
        )
        return
    shares = [
        (f"{name}, at most {engineering(most, unit)}", time, values / (most or 1.0))
        for (name, time, values, unit), most in zip(signals, largest, strict=True)
    ]
    curves(shares, "share of the largest value", ax)


def _fall(found: Results) -> Presentation:
    """A fall, or an ensemble of them; its accelerometers and largest stress."""
    fall, worst, peaks = found.fall, found.worst, found.peaks or {}
    single = hasattr(fall, "flights")
    table = dict(fall.impacts.columns()) if single else _quantiles(fall, QUANTITIES | {"lost": "J"})
    asked = found.compiled.document.data.get("accelerometers", {}) if peaks else {}
    rows = [
        (
            f"accelerometer {name}",
            f"at most {peak.g:.5g} g ({asked[name].get('filter', 'unfiltered')}),"
            f" in impact {peak.impact + 1}",
        )
        for name, peak in peaks.items()
    ]
    rows += [] if worst is None else _stress_rows({worst.quantity: worst})
    numbers: Columns = {"fall": table | {"status": fall.status, "message": fall.message}}
    numbers["accelerometers"] = {n: vars(p) | {"g": p.g} for n, p in peaks.items()}
    pictures = []
    if single:
        about = "The part as it first touches, the heights (m), the energies (J) and the peak"
        pictures.append(Picture("Fall", f"{about} forces of the impacts (N).", fall.plot))
    if worst is not None:
        numbers["worst"] = {worst.quantity: float(worst.values.max())} | _margin_numbers(worst)
        about = "The largest value at each node over all impacts."
        pictures.append(Picture("Largest stress", about, worst.plot))
    return Presentation(
        text=[fall.summary() if single else format_columns(table), format_rows(rows)],
        tables={"fall.csv": table},
        numbers=numbers,
        plotted={"fall": fall, "worst": worst},
        fields={} if worst is None else {"worst.vtu": worst.write},
        sections={
            "Fall": [narrow_table(fall) if single else table, rows, ended(fall.message)],
        },
        pictures=pictures,
    )


def narrow_table(fall: Fall) -> Columns:
    """The impacts of a fall in columns that fit on a sheet of paper."""
    each = fall.impacts
    before, after = (each.column(f"speed_{when}") for when in ("before", "after"))
    return {
        "impact": np.arange(1, len(each) + 1),
        "time (s)": each.column("time"),
        "peak force (N)": each.column("peak_force"),
        "contact time (s)": each.column("contact_time"),
        "before, after (m/s)": [f"{v:.3g}, {w:.3g}" for v, w in zip(before, after, strict=True)],
        "lost (J)": each.column("lost"),
        "at": [placed(one.place) for one in each],
    }


def ended(message: str) -> str:
    """How a fall ended, as a sentence."""
    return f"The fall ended: {message}."


def _blow(found: Results) -> Presentation:
    """A blow that was found."""
    blow = found.found
    about = "Signals in the band that is compared, and the contact force (N) that was found."
    return Presentation(
        text=[blow.summary()],
        tables={"force.csv": {"time (s)": blow.time, "force (N)": blow.force}},
        numbers={"found": blow.numbers()},
        plotted={"found": blow},
        sections={"Blow": [blow.rows(), blow.message]},
        pictures=[Picture("Signals and force", about, blow.plot)],
    )


def _sweep(found: Results) -> Presentation:
    """A sweep: what was varied, and the results of each impact."""
    batch = found.batch
    lists = {label(place): list(values) for place, values in varied(found.compiled).items()}
    table = lists | {f"{_words(n)} ({u})": getattr(batch, n) for n, u in QUANTITIES.items()}
    table |= {name: getattr(batch, name) for name in ("restitution", "contacts", "status")}

    def draw(ax: Axes) -> None:
        name, values = next(iter(lists.items()))
        numbers = all(isinstance(v, int | float) for v in values)
        ax.plot(values if numbers else range(len(values)), batch.peak_force, "o-", ms=4, lw=1)
        ax.set_xlabel(escaped(f"{name} (SI)"))
        ax.set_ylabel("peak force (N)")

    about = "Peak force (N) of each impact, over the first value that varies."
    return Presentation(
        [format_columns(table)], {"sweep.csv": table}, {"sweep": table},
        sections={"Sweep": [table]}, pictures=[chart("Sweep", about, draw)],
    )  # fmt: skip


def _sample(found: Results) -> Presentation:
    """A Monte Carlo study: quantiles, and the inputs and results of each run."""
    sample, table = found.sample, _quantiles(found.sample, QUANTITIES)
    failed = [sample.failed.get(i, "") for i in range(len(sample))]
    about = "Peak forces (N) of the runs, and their quantiles with the bars of the number of runs."
    return Presentation(
        text=[format_columns(table)],
        tables={"monte_carlo.csv": {**sample.inputs, **sample.values, "error": failed}},
        numbers={"monte_carlo": table},
        plotted={"monte_carlo": sample},
        sections={"Random values": [table]},
        pictures=[Picture("Random values", about, sample.plot, ".svg")],
    )


def _map(results: Results) -> Presentation:
    """A map: the range of each quantity, and the hardest impact of each of several surfaces."""
    found, quantities, surfaces = results.map, results.map.quantities(), results.map.surfaces()
    sites = f"{len(found)}" + (f", {found.skipped} left out" if found.skipped else "")
    if found.doubtful.any():
        sites += f"; {found.doubtful.sum()} doubtful ones are not in these ranges"
    rows = [("sites", sites)]
    meant = {name: MAP_QUANTITIES.get(name, (_words(name), "")) for name in quantities}
    for name, values in quantities.items():
        known = values[trusted(found)]
        known = known[np.isfinite(known)]
        if known.size:
            rows.append((meant[name][0], _range(known, meant[name][1])))
    for name, surface in surfaces.items() if len(surfaces) > 1 else ():
        text = f"{len(surface)} sites"
        if found.peak_force is not None:
            i = hardest(found, surface)
            force = engineering(found.peak_force[i], "N", 4)
            text += f", at most {force} at {placed(found.points[i])}"
        rows.append((name, text))
    heads = {name: f"{name} ({unit})" if unit else name for name, (_, unit) in meant.items()}
    table = {"surface": found.names.tolist()} if len(surfaces) > 1 else {}
    table |= {f"{axis} (m)": found.points[:, k] for k, axis in enumerate("xyz")}
    numbers = {"points": found.points, "surface": found.names.tolist(), **quantities}
    return Presentation(
        text=[format_rows(rows)],
        tables={"map.csv": table | {heads[name]: values for name, values in quantities.items()}},
        numbers={"map": numbers | {"doubtful": found.doubtful}},
        plotted={"map": found},
        fields={"map.vtu": found.write},
        sections={"Map": [rows]},
        pictures=[
            Picture(f"Map: {meant[q][0]}", f"{meant[q][0].capitalize()} ({meant[q][1]}) over the"
                    " surface.", partial(plot_map, found, quantity=q))
            for q in ("peak_force", "contact_time", "k0") if q in quantities
        ],
    )  # fmt: skip


def _range(values: Array, unit: str) -> str:
    """The smallest and the largest value; angular frequencies in Hz."""
    values, unit = (values / (2 * np.pi), "Hz") if unit == "rad/s" else (values, unit)
    return range_text(values.min(), values.max(), unit)


#: Object of a scene -> how it is presented.
_KINDS: dict[str, Callable[[Results], Presentation]] = {
    **{"history": _impact, "fall": _fall, "found": _blow},
    **{"batch": _sweep, "sample": _sample, "map": _map},
}


def presentations(found: Results) -> list[Presentation]:
    """What is presented of a scene: the structure with its model first, then the results."""
    present = (one for name, one in _KINDS.items() if getattr(found, name) is not None)
    return [_model(found), *(one(found) for one in present)]


def text(found: Results, parts: Sequence[Presentation]) -> str:
    """Title, structure, model, and what the simulation, the sweep or the map found."""
    title = str(found.compiled.document.data.get("title", ""))
    pieces = [title, *(piece for one in parts for piece in one.text)]
    return "\n\n".join(piece for piece in pieces if piece)
