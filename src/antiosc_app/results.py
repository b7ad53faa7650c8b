"""Presentation of the results of a scene: on the terminal, in files, and in a report.

Each kind of result is described once, by a `Presentation`: texts, tables and pictures.
"""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from antiosc import AntiOscillators, History, SceneHistory, advise
from antiosc.base import progress
from antiosc.base._types import Array, IntArray
from antiosc.base.cfc import CLASSES, PASSED, SHOCK_FILTER
from antiosc.base.errors import AntioscError, InputError, by_weight, weight, without_warnings
from antiosc.base.plausible import GRAVITY
from antiosc.base.texts import (
    COMPARED,
    SMALLER_CELLS,
    capitalised,
    engineering,
    in_scene,
    percent,
    piece_told,
    plain,
    point_text as placed,
    prefixed,
    range_text,
    restitution_text,
)
from antiosc.extension import (
    MAP_QUANTITIES,
    OF_ALL_CONTACTS,
    QUANTITIES,
    ErrorBudget,
    ProbeError,
    by_laws,
    compared,
    doubts_text,
    error_of_largest,
    error_scope,
    hardest,
    linear_run,
    share_by_law,
    trusted,
    with_force,
)
from antiosc.models.body import info_of, site_points
from antiosc.plot.charts import (
    legend_beside,
    new_figure,
    padded_range,
    plot_force,
    plot_model,
    plot_motion,
    save_figure,
)
from antiosc.plotting import plot_deformed, plot_map
from antiosc_app.conditions import beside_headline, conditions
from antiosc_app.live import (
    ASKED_STRENGTH,
    COMPARED_DECKS,
    OWN_STRENGTH,
    bar_of_fall,
    caution_of,
    cautions_of,
    deflection,
    force_bar,
    halved,
    judgement,
    map_cautions,
    motion_rows,
    of_elastic_part,
    remedy_of,
    stress_note,
    stresses_of_impacts,
    without_mesh_error,
)
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.document import GEOMETRIES, label
from antiosc_app.scene_file.run import Nominal, RowFacts, SceneResults, error_budget, varied
from antiosc_app.scene_file.scene import place_of, probe_times
from antiosc_app.words import of_scenes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from antiosc import Drops, Fall, Peak, PeakField, ProbeSpectra, Sample, Structure
    from antiosc_studies.drops.fall import WorstField


#: Most curves of one chart.
CURVES = 12


@dataclass(frozen=True)
class Picture:
    """A picture of a report.

    Attributes
    ----------
    heading, caption : description of the picture, with units.
    draw : function that writes it to a file with this ending.
    same_view : whether it shows the same as the previous picture, and is left out if that failed.
    folded : whether a report shows it only when its heading is opened.
    """

    heading: str
    caption: str
    draw: Callable[[Path], object]
    ending: str = ".png"
    same_view: bool = False
    folded: bool = False


class Drawn(NamedTuple):
    """A picture with its data URL, which is empty if it could not be drawn; the caption says
    why.
    """

    heading: str
    caption: str
    data: str
    folded: bool


def drawn_pictures(pictures: Iterable[Picture]) -> Iterator[Drawn]:
    """Draw pictures as data URLs; every rank must call it, since fields are distributed."""
    data_url = ""
    for picture in pictures:
        if picture.same_view and not data_url:
            continue
        caption = picture.caption
        data_url = ""
        with progress.doing(f"drawing: {picture.heading}"), tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"picture{picture.ending}"
            try:
                picture.draw(path)
                kind = {".svg": "svg+xml"}.get(picture.ending, "png")
                content = base64.b64encode(path.read_bytes()).decode("ascii")
                data_url = f"data:image/{kind};base64,{content}"
            except (AntioscError, ValueError) as error:  # ValueError: a name read as a formula
                caption = f"Not drawn: {error}"
        yield Drawn(picture.heading, caption, data_url, picture.folded)


def chart(heading: str, caption: str, fill: Callable[[Axes], object]) -> Picture:
    """A picture that a function draws into new axes."""

    def draw(path: Path) -> None:
        figure = new_figure((7.0, 3.4), shown=False)
        fill(figure.subplots())
        save_figure(figure, path)

    return Picture(heading, caption, draw, ".svg")


def curves(series: Iterable[tuple[str, Array, Array]], y: str, ax: Axes) -> None:
    """Draw curves over time: (name, times in s, values)."""
    for name, time, values in islice(series, CURVES):
        ax.plot(1e3 * time, values, lw=1.2, label=escaped(name))
    ax.set_xlabel("time (ms)")
    ax.set_ylabel(y)
    legend_beside(ax)


def begun(fill: Callable[[Axes], object], share: float, ax: Axes) -> None:
    """Draw curves over time, the first `share` of the run; values are scaled to that part."""
    fill(ax)
    drawn = [np.array(line.get_data(), dtype=float) for line in ax.lines]
    end = share * max(time[-1] for time, _ in drawn)
    values = np.concatenate([value[time <= end] for time, value in drawn])
    ax.set_xlim(*padded_range([0.0, end], 0.02, 0.0))
    ax.set_ylim(*padded_range(values, 0.08, 0.08))


def spectrum(model: AntiOscillators, ax: Axes) -> None:
    """Draw frequency and mass of each anti-oscillator."""
    has_sites = np.ndim(model.k0) > 0
    height = model.mass_shares if has_sites else model.m
    ax.vlines(model.omega / (2 * np.pi), 0, height, lw=1.5)
    ax.plot(model.omega / (2 * np.pi), height, "o", ms=4)
    if model.n and np.max(model.omega) > 30 * np.min(model.omega[model.omega > 0], initial=np.inf):
        ax.set_xscale("log")
    ax.set_ylim(bottom=0)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("share of the static mass" if has_sites else "mass (kg)")


def escaped(name: str) -> str:
    """A name from the scene as plain text in a picture, without formulas."""
    printable = "".join(c if c.isprintable() else "?" for c in name.replace("$", r"\$"))
    if len(printable) <= 60:
        return printable
    return f"{printable[:57]}…"


#: (name, value) rows; a table as name of a column -> its values.
Rows: TypeAlias = list[tuple[str, str]]
Columns: TypeAlias = dict[str, Any]
#: A block below a heading: names and values, a table of columns, a sentence, or nothing.
Block: TypeAlias = Rows | Columns | str

#: Largest number of rows of a table that are printed; the files contain all.
ROWS = 30
#: Units of the quantities of probes.
PROBE_UNITS = {
    **{"displacement": "m", "velocity": "m/s", "acceleration": "m/s²", "rotation": "rad"},
    **{"stress": "Pa", "von_mises": "Pa"},
}
#: Number of section forces -> their names and units.
SECTION_FORCES = {
    1: {"N": "N"},
    3: {"N": "N", "V": "N", "M": "N m"},
    6: {"N": "N", "Vy": "N", "Vz": "N", "T": "N m", "My": "N m", "Mz": "N m"},
    8: dict.fromkeys(("N1", "N2", "N12"), "N/m")
    | dict.fromkeys(("M1", "M2", "M12"), "N m/m")
    | dict.fromkeys(("Q1", "Q2"), "N/m"),
}
#: Views of a part in space: name -> (elevation, azimuth) in degrees; None: the default view.
VIEWS = {"": None, ", from behind": (24.0, 128.0), ", from above": (75.0, -52.0)}
ENERGIES = ("kinetic", "strain", "contact", "dissipated")

# -- texts and tables


def format_rows(rows: Rows) -> str:
    """Names and values in two columns."""
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join(f"{name:<{width}}  {value}".rstrip() for name, value in rows)


def format_columns(table: Columns) -> str:
    """A table as text, units with prefixes; only the first rows of a long one."""
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
    """The columns of a table with units in the prefix that suits the largest value."""
    return dict(_column(name, list(values)) for name, values in table.items())


def _column(name: str, values: list[object]) -> tuple[str, list[object]]:
    """(name, values) of a column named as "contact time (s)", scaled to "(µs)" if that fits."""
    title, _, unit = name.partition(" (")
    if unit == "%)":  # error bars: their further digits mean nothing
        return name, [float(f"{value:.2g}") for value in values]
    if not unit or not all(isinstance(v, float | np.floating) for v in values):
        return name, values
    numbers = np.array(values, dtype=float)
    largest = max(np.abs(numbers[np.isfinite(numbers)]), default=0.0)
    factor, prefixed_unit = prefixed(largest, unit.rstrip(")"))
    return f"{title} ({prefixed_unit})", list(factor * numbers)


def format_number(value: object) -> str:
    """A number to five digits; a dash if it is not finite."""
    if isinstance(value, float | np.floating):
        if np.isfinite(value):
            return f"{value:.5g}"
        return "–"
    return str(value)


def _spaced(name: str) -> str:
    """The name with blanks in place of underscores."""
    return name.replace("_", " ")


def _largest(peak: PeakField) -> str:
    """Text of the largest value of a field, its place and time."""
    value, point, time = peak.largest(1)[0]
    place_text = f"at {placed(point)}, {engineering(time, 's')}"
    return f"largest {engineering(value, peak.unit, 4)} {place_text}"


def _quantiles(ensemble: Sample | Drops, units: Mapping[str, str]) -> Columns:
    """Quantiles of an ensemble's quantities with their confidence intervals."""
    rows = []
    for name, unit in units.items():
        values = [ensemble.quantile(name, q) for q in ensemble.quantiles]
        rows += [
            (f"{_spaced(name)} ({unit})", q, quantile.value, quantile.low, quantile.high)
            for q, quantile in zip(ensemble.quantiles, values, strict=True)
        ]
    names = ("quantity", "quantile", "value", "low", "high")
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


#: Name of the column of quantiles with their whole bar.
WHOLE_BAR = "with the model's error"


def _quantiles_told(
    ensemble: Sample | Drops, units: Mapping[str, str], budget: ErrorBudget | None = None
) -> Columns:
    """The table of `_quantiles` for a reader; with a budget of the model, which all runs share,
    also from where to where a quantile may lie by both errors.
    """
    table = _quantiles(ensemble, units)
    each = [unit for unit in units.values() for _ in ensemble.quantiles]
    told = {"quantity": [text.rpartition(" (")[0] for text in table["quantity"]]}
    told["quantile"] = [percent(q) for q in table["quantile"]]
    for name in ("value", "low", "high"):
        values = zip(table[name], each, strict=True)
        told[name] = [engineering(value, unit) for value, unit in values]
    if budget is not None and not budget.no_bar:
        names = [name for name in units for _ in ensemble.quantiles]
        ends = zip(names, table["low"], table["high"], each, strict=True)
        told[WHOLE_BAR] = [_with_model_error(budget, *end) for end in ends]
    return told


def _with_model_error(budget: ErrorBudget, name: str, low: float, high: float, unit: str) -> str:
    """The ends of a quantile's bar widened by the errors of the model, as text; a dash where these
    are not known.
    """
    if name in budget.unbarred:
        return "–"
    below, above = budget.sides(name)
    ends = (1 - below) * low, (1 + above) * high
    return " to ".join(engineering(end, unit) for end in ends) + budget.condition


# -- the kinds of results


@dataclass
class Presentation:
    """The parts of a result's presentation, made on every rank since fields are distributed.

    Attributes
    ----------
    text : text for the terminal.
    caution : what must be read before the numbers.
    asked : numbers that stand beside those of the headline of a report, and a note on them.
    tables : file -> its columns.
    numbers : numbers for result.json.
    plotted : name of a file -> object with a method `plot`.
    fields : file -> function that writes it.
    sections : heading of a report -> blocks below it.
    pictures : pictures of a report.
    """

    text: Sequence[str] = ()
    caution: str = ""
    asked: tuple[Sequence[tuple[str, str]], str] = ((), "")
    tables: dict[str, Columns] = field(default_factory=dict)
    numbers: dict[str, object] = field(default_factory=dict)
    plotted: dict[str, object] = field(default_factory=dict)
    fields: dict[str, Callable[[Path], Path]] = field(default_factory=dict)
    sections: dict[str, list[Block]] = field(default_factory=dict)
    pictures: Sequence[Picture] = ()


def _model(results: SceneResults) -> Presentation:
    """The structure and its reduced model; a report shows them after the pictures."""
    presentation = Presentation()
    structure = results.structure
    model = results.model
    blocks: list[Block] = []
    mass: Rows = []
    if structure is not None:
        mass = mass_of(structure)
        presentation.text = [structure.describe(), *([] if model else [format_rows(mass)])]
        presentation.numbers["structure"] = structure.describe()
        with suppress(InputError):  # some matrices do not know it
            presentation.numbers["mass"] = structure.mass
    if model is not None:
        rows = _model_rows(model)
        presentation.text = [*presentation.text, format_rows([*mass, *rows])]
        names = ("k0", "m0", "m_st", "omega", "m", "P", "sites")
        attributes = {name: getattr(model, name, None) for name in names}
        presentation.numbers["model"] = attributes | {"points": site_points(model)}
        presentation.plotted["model"] = model
        blocks.append(rows)
        if np.ndim(model.k0) == 0:
            table = {"anti-oscillator": range(1, model.n + 1)}
            table |= {"frequency (Hz)": model.omega / (2 * np.pi), "mass (kg)": model.m}
            blocks.append(table | {"stiffness (N/m)": model.k})
        masses = "Frequency (Hz) and mass of each anti-oscillator: in kg at one site, as share"
        stiff = "|Z(ω)| (N/m) over frequency (Hz), infinite at the antiresonances, and the share"
        presentation.pictures = [
            chart(
                "Anti-oscillators",
                f"{masses} of the static mass at several.",
                partial(spectrum, model),
            ),
            Picture(
                "Dynamic stiffness",
                f"{stiff} of the static mass that the anti-oscillators hold.",
                partial(plot_model, model),
                ".svg",
            ),
        ]
    if blocks or structure is not None:
        presentation.sections["Model"] = blocks
    return presentation


def advice_of(results: SceneResults) -> Rows:
    """Rows on the structure, and on `advise`'s choice of the family if it has one."""
    if results.structure is None:
        return []
    rows = [("structure", results.structure.describe()), *mass_of(results.structure)]
    if largest := _longest_cell(results.structure):
        rows.append(("longest side or diagonal of an element", engineering(largest, "m")))
    if not hasattr(results.impactor, "hertz"):
        return rows
    try:
        advice = advise(results.structure, results.impactor)
    except AntioscError:
        return rows
    return [
        *rows,
        ("sufficient element family", f"{advice.family}{_of_simpler(results, advice.family)}"),
        ("elements suffice up to", engineering(advice.element_size, "m")),
        ("highest relevant frequency", engineering(advice.frequency, "Hz")),
        ("reasons", "; ".join(advice.reasons)),
    ]


#: Element family -> dimension of its cells.
CELLS = {"beam": 1, "shell": 2, "solid": 3}


def _of_simpler(results: SceneResults, family: str) -> str:
    """Where a run tells the error of a part of a simpler family than `family`; "" of others."""
    structure = results.structure
    if structure is None or not structure.matrices.meshed:
        return ""
    if structure.mesh.tdim >= CELLS[family]:
        return ""
    return "; the error of the present one is the share model of the run's error bars"


def _longest_cell(structure: Structure) -> float:
    """Largest length [m] of a cell of a structure, on all ranks; 0 of matrices."""
    if not (structure.matrices.meshed or structure.matrices.assembled):
        return 0.0
    from antiosc.extension import longest_cell, with_parts  # they need the finite elements

    largest = 0.0
    for member in with_parts(structure).members():
        cells = member.part.mesh.geometry
        corners = cells.nodes[:, : len(cells.corners)]
        own = longest_cell(corners) if len(corners) else 0.0
        largest = max(largest, *structure.comm.allgather(own))
    return largest


def mass_of(structure: Structure) -> Rows:
    """A row with the mass of a part, or why it is not known."""
    try:
        return [("mass", engineering(structure.mass, "kg", 4))]
    except InputError as error:
        return [("mass", f"not known: {error}")]


def _model_rows(model: AntiOscillators) -> Rows:
    """Rows on the parameters of the reduced model."""
    rows = [(f"site {name}".rstrip(), placed(point)) for name, point in site_points(model).items()]
    several_sites = bool(np.ndim(model.k0))
    if several_sites:
        rows.append(("sites", ", ".join(model.sites)))
    else:
        rows.append(("static stiffness k0", engineering(model.k0, "N/m", 4)))
        rows.append(("static mass m_st", engineering(model.m_st, "kg", 4)))
    point = model.info.expansion
    about = f", expanded about {engineering(point, 'Hz')}" if point else ""
    rows.append(("anti-oscillators", f"{model.n}{about}"))
    if not several_sites and model.m_st > 0:
        rows.append(("captured mass", f"{100 * (1 - model.m0 / model.m_st):.2f} % of m_st"))
    lowest = ", ".join(f"{w / (2 * np.pi):.5g}" for w in model.omega[:5])
    ellipsis = ", …" if len(model.omega) > 5 else ""
    name = "frequencies" if point else "antiresonances"
    return [*rows, (name, f"{lowest or 'none'}{ellipsis} Hz")]


def _impact(results: SceneResults) -> Presentation:
    """A history with its probes and its largest stresses."""
    hit = results.history
    peaks = results.stresses or {}
    probes = [Probe(results, name) for name in results.probes or ()]
    _place(results, probes)
    budget = error_budget(hit)
    force = force_bar(budget)
    for probe in probes:
        probe.budget = budget
    _compare_with_fewer(results, probes)
    left_out = budget is not None and bool(budget.law)
    probe_rows = _probe_rows(probes, left_out)
    stresses = _stress_rows(peaks, force)
    columns = {n.replace("[", "(").replace("]", ")"): v for n, v in hit.columns().items()}
    columns |= {f"{name} energy (J)": getattr(hit.energy, name) for name in ENERGIES}
    bars = {} if budget is None else {name: budget.shares(name) for name in budget}
    is_scene = isinstance(hit, SceneHistory)
    reason = budget.footnote if budget is not None and budget.no_bar else ""
    known = {"error_budget": bars, "no_error_bar": reason, "deflection": deflection(hit, budget)}
    known = {name: value for name, value in known.items() if value}
    summary, explanation = (_untold(one, results) for one in (hit.summary(), hit.explanation))
    held = conditions(results)
    struck = format_rows([(f"{name:<{SUMMARY}}", value) for name, value in held])
    if budget is not None:  # its lines have the shares of the force
        of_force = budget.causes_text("peak_force")
        summary = "\n".join(row for row in summary.splitlines() if of_force not in row)
    told = "\n".join(filter(None, (struck, summary)))
    remedy = "" if is_scene else remedy_of(hit, budget)
    lines = (line for line in str(budget or "").splitlines() if line not in told)
    accuracy = "\n".join(filter(None, (*lines, remedy)))
    moved = [] if is_scene else motion_rows(hit, budget, results.structure)
    text = [told, accuracy, format_rows([*moved, *probe_rows, *stresses])]
    return Presentation(
        text=text,
        caution=cautions_of(hit, results.structure, budget, peaks),
        asked=([*map(_fact_of_probe, probes)], _note_on_probes(probes, left_out)),
        tables={"history.csv": columns, **_tables_of_probes(probes)},
        numbers={
            "result": hit.numbers() | known,
            "probes": {probe.name: _numbers_of_probe(probe) for probe in probes},
            "stress": _stress_numbers(peaks),
        },
        plotted={**({} if is_scene else {"force": hit}), **peaks, **_plotted_spectra(probes)},
        fields={f"{name}.vtu": peak.write for name, peak in peaks.items()},
        sections={
            "Results": [
                _facts(hit),
                beside_headline(results, held),
                moved,
                explanation,
                probe_rows,
                stresses,
            ],
            "Errors": _errors(hit),
        },
        pictures=_impact_pictures(results, probes),
    )


def _tables_of_probes(probes: Sequence[Probe]) -> dict[str, Columns]:
    """The files of probes and of their shock response spectra."""
    signals = [{"time (s)": probe.times, **probe.table()} for probe in probes]
    spectra = [probe.shock_table() for probe in probes if probe.shock]
    return _files("probes", signals) | _files("srs", spectra)


def _files(stem: str, tables: Iterable[Columns]) -> dict[str, Columns]:
    """File -> columns; tables whose first columns are equal are in one file."""
    files: list[Columns] = []
    for table in tables:
        first = next(iter(table))
        same = (file for file in files if np.array_equal(file[first], table[first]))
        file = next(same, None)
        if file is None:
            files.append(table)
        else:
            file |= table
    return {f"{stem}.csv" if not k else f"{stem}_{k + 1}.csv": x for k, x in enumerate(files)}


def _plotted_spectra(probes: Sequence[Probe]) -> dict[str, object]:
    """Name of a file -> the shock response spectra of a probe."""
    shocks = [probe.shock for probe in probes if probe.shock]
    return {f"srs_{k + 1}" if k else "srs": shock for k, shock in enumerate(shocks)}


#: Width of the names in the summary of an impact.
SUMMARY = len("contact time")


def _untold(text: str, results: SceneResults) -> str:
    """A text on an impact without the warnings that stand by themselves."""
    text = of_scenes(text)
    for sentence in results.warnings:
        text = text.replace(f". {sentence}", ".")
    return text


def _facts(hit: History) -> Block:
    """The numbers of a history, or of each contact of a scene."""
    if contacts := _contacts(hit):
        hits = contacts.values()
        table: Columns = {"contact": [f"{a} – {b}" for a, b in contacts]}
        for n, unit in QUANTITIES.items():
            table[f"{_spaced(n)} ({unit})"] = [getattr(contact, n) for contact in hits]
        return table | {"contacts": [len(contact.contacts) for contact in hits]}
    e = "not defined" if hit.restitution is None else restitution_text(hit.restitution, 4)
    numbers = [(_spaced(n), engineering(getattr(hit, n), u, 4)) for n, u in QUANTITIES.items()]
    return [*numbers, ("contacts", hit.count_text), ("coefficient of restitution", e)]


def _errors(hit: History) -> list[Block]:
    """Blocks on the errors of a history."""
    budget = error_budget(hit)
    rows = [(f"time integration: {name}", percent(value)) for name, value in hit.error.items()]
    rows.append(("these errors cover", error_scope(hit)))
    rows.append(("energy drift over the run, of the energy", percent(hit.energy.drift)))
    rows += [("details", text) for text in hit.details]
    if budget is None:
        return [rows]
    table: Columns = {"Error budget": ["value", *budget.causes, f"total{budget.condition}"]}
    for name, bar in budget.items():
        shares = budget.shares(name)
        cells = [shares[cause] for cause in (*budget.causes, "total")]
        told = ["–" if share is None else percent(share) for share in cells]
        table[_spaced(name)] = [engineering(bar.value, QUANTITIES[name], 4), *told]
    return [rows, table, *budget.notes]


#: What the bars of probes leave out: the mesh's error of a strain at a point is not estimated.
PROBE_BARS = (
    "the bars of probes are the error by the anti-oscillators, and that of the force{}, or of the"
    " value itself by the contact's law where that is more; the mesh's error at their points is not"
    " in them"
)
OF_SPECTRA = "; those of shock response spectra have it in the motion too"
WITHOUT_FORCE = (
    "probes have no error bar: they follow the force, whose error is not known; told is their error"
    " by the anti-oscillators"
)


def _probe_rows(probes: Sequence[Probe], left_out: bool) -> Rows:
    """Rows with the largest value of each probe, its component and time.

    `left_out`: whether the error of the force leaves out the contact's law.
    """
    rows = []
    for probe in probes:
        rows.append((f"probe {probe.name}", _peak_text(probe)))
        if probe.place is not None:
            rows.append(("", probe.place.text))
        if probe.still_moves:
            rows.append(("", MAY_GROW))
        if probe.is_unsettled:
            further = NOR_BY_FILTER if "filtered" in probe.peak() and not probe.settled else ""
            rows.append(("", f"this peak has not converged{further}"))
        if probe.settled:
            seen = _peak_text(probe.settled)
            rows.append(("", BY_FILTER.format(seen, probe.settled.filter, probe.name)))
        if probe.shock:
            rows.append(("", probe.shock.sentence))
            if (probe.shock.numbers()["mesh"] or 0.0) > UNSETTLED:
                rows.append(("", COARSE_FOR_SPECTRUM))
            if not probe.shock.has_converged:
                rows.append(("", "this largest response has not converged"))
    unsettled = [
        probe
        for probe in probes
        if probe.is_unsettled or not (probe.shock is None or probe.shock.has_converged)
    ]
    if unsettled:
        of_accelerations = any("filtered" in probe.peak() for probe in unsettled)
        rows.append(("", f"{NOT_CONVERGED}{OF_ACCELERATIONS * of_accelerations}"))
    note = _note_on_probes(probes, left_out)
    return [*rows, ("", note)] if note else rows


class ProbePlace(NamedTuple):
    """The point [m] of the part at which a probe lies, and its distance [m] from that given."""

    point: tuple[float, ...]
    off: float | None

    @property
    def text(self) -> str:
        """The place in words."""
        off = "" if self.off is None else f", {engineering(self.off, 'm')} from the point given"
        return f"it lies at {placed(self.point)}{off}"


#: Distance [m] of a probe from the point given that is rounding.
ON_POINT = 1e-9


def _place(results: SceneResults, probes: Sequence[Probe]) -> None:
    """Find where probes lie. All ranks must call it."""
    if results.structure is None or not probes:
        return
    from antiosc.extension import probed_point

    for probe in probes:
        asked = place_of(results.compiled.probes[probe.name])
        with suppress(AntioscError):
            x = probed_point(results.structure, **asked)
            if x is None:
                continue
            given = asked.get("point")
            off = None
            if isinstance(given, list | tuple):
                off = float(np.linalg.norm(x[: len(given)] - given))
                off = None if off < ON_POINT else off
            probe.place = ProbePlace(tuple(x.tolist()), off)


def _numbers_of_probe(probe: Probe) -> Columns:
    """The largest value of a probe, its point [m] if it is known, and that of its spectrum."""
    numbers = probe.peak()
    if probe.place is not None:
        numbers["point"] = probe.place.point
    if probe.shock:
        numbers["srs"] = probe.shock.numbers()
    return numbers


def _note_on_probes(probes: Sequence[Probe], left_out: bool) -> str:
    """What the bars of probes are, and leave out; "" where none has a bar."""
    barred = [probe for probe in probes if probe.fewer is not None]
    if not barred:
        return ""
    without_law = " without the contact's law" if left_out else ""
    known = all(probe.force is not None for probe in barred)
    if not known:
        return WITHOUT_FORCE
    has_mesh = any(probe.shock and probe.shock.numbers()["mesh"] for probe in barred)
    return PROBE_BARS.format(without_law) + OF_SPECTRA * has_mesh


def _fact_of_probe(probe: Probe) -> tuple[str, str]:
    """Name and largest value with its bar, of an acceleration that has not converged through the
    filter through which it has.
    """
    peak = (probe.settled or probe).peak()
    name = ", ".join(filter(None, [f"{probe.name}: {_spaced(peak['quantity'])}", peak["filter"]]))
    bar = " (no error bar)" if peak["error"] is None else f" ± {percent(peak['error'])}"
    value = f"{engineering(peak['value'], peak['unit'])}{bar}"
    later = "a larger value may follow the run" * probe.still_moves
    return name, "; ".join(filter(None, [value, _axis_text(peak), later]))


def _peak_text(probe: Probe) -> str:
    """The largest value of a probe with its bar and time, of a vector also that of a component."""
    peak = probe.peak()
    label = f"{_spaced(peak['quantity'])} {peak['component']}".rstrip()
    if peak["filter"]:
        passed = engineering(PASSED * CLASSES[peak["filter"]], "Hz")
        label += f" through {peak['filter']} (to {passed})"
    value = engineering(peak["value"], peak["unit"], 4)
    bar = "" if probe.error is None else f" {probe.error}"
    g = f" ({plain(peak['g'], 4)} g)" if "g" in peak else ""
    told = f"{label}: largest {value}{bar}{g} at {engineering(peak['time'], 's')}"
    return "; ".join(filter(None, [told, _axis_text(peak)]))


def _axis_text(peak: Columns) -> str:
    """The component of a vector with the largest value, which a sensor along its axis sees."""
    axis = peak.get("axis")
    if axis is None:
        return ""
    value = engineering(axis["value"], peak["unit"], 4)
    return f"largest component {axis['component']}, {value}"


#: Last share of the times of a probe, and the share of its largest value from which it has not died
#: down there. A corner of a carriage had 13 g in 16 ms and 42 g in 100 ms, without damping.
AT_END, STILL = 0.25, 0.5
MAY_GROW = (
    "it has not died down at the end: a larger value may follow; give a longer duration"
    " ([simulate]), and the damping of the part (damping in [extract])"
)
#: Share of a bar from which a value is said not to have converged, or the mesh to be coarse for it.
UNSETTLED = 0.1
COARSE_FOR_SPECTRUM = (
    "the mesh is coarse for this spectrum: use smaller elements of the whole part"
    f" ({SMALLER_CELLS})"
)
NOT_CONVERGED = (
    "a peak that has not converged depends on the anti-oscillators: take more (n in [extract])"
)
OF_ACCELERATIONS = (
    "; that of an acceleration consists of the highest frequencies of the mesh and may never"
    " converge: judge it by its shock spectrum (srs of the velocity), or through a filter"
)
BY_FILTER = '{}; filter = "{}" in [probes.{}] writes this signal'
NOR_BY_FILTER = f", nor has it through the filters {', '.join(reversed(CLASSES))}"


def _compare_with_fewer(results: SceneResults, probes: Sequence[Probe]) -> None:
    """Compare probes with those of the same impact with half the anti-oscillators, if it can be
    repeated, and find what accelerations are through a filter where they depend on this number.
    """
    model, scene = results.model, results.compiled
    if not probes or not isinstance(model, AntiOscillators) or model.n < 2 or scene.model is None:
        return
    fewer = replace(model, stretch=None).truncated(model.n // 2)
    own, of_fewer = (_on(results, one) for one in (model, fewer))
    own.register(scene.history, results.history)
    with suppress(AntioscError), without_warnings():
        for probe in probes:
            probe.fewer = _evaluated(of_fewer, results, probe, probe.filter)
        for probe in probes:
            if "filtered" in probe.peak():
                probe.settled = _settled((own, of_fewer), results, probe)
        changed = [[_with(results, hit) for hit in cause] for cause in by_laws(results.history)]
        reference = own if model.stretch is None else _with(results, linear_run(results.history))
        for probe in probes if changed else ():
            values = [
                [_evaluated(one, results, probe, probe.filter).values for one in cause]
                for cause in changed
            ]
            linear = _evaluated(reference, results, probe, probe.filter).values
            probe.by_law = share_by_law(linear, values, probe.is_vector)
        corrected = None
        if model.strain_error is not None and any(probe.shock for probe in probes):
            corrected = _on(results, model.corrected())
        for probe in probes:
            if probe.shock:
                _compare_spectra(results, probe, of_fewer, corrected, changed)


def _with(results: SceneResults, hit: History) -> Evaluation:
    """The scene of the results with another history, in which its probes are evaluated."""
    evaluate = _on(results, hit.model)
    evaluate.register(results.compiled.history, hit)
    return evaluate


def _on(results: SceneResults, model: AntiOscillators) -> Evaluation:
    """The scene of the results with another model, in which its probes are evaluated."""
    scene = results.compiled
    evaluate = Evaluation(scene.document)
    evaluate.register(scene.structure, results.structure)
    evaluate.register(scene.model, model)
    return evaluate


def _compare_spectra(
    results: SceneResults,
    probe: Probe,
    fewer: Evaluation,
    corrected: Evaluation | None,
    changed: Sequence[Sequence[Evaluation]],
) -> None:
    """Give the shock response spectra of a probe their bars."""
    call = results.compiled.spectra[probe.name]

    def on(evaluate: Evaluation, **asked: Array) -> ProbeSpectra:
        other: ProbeSpectra = evaluate(replace(call, arguments=call.arguments | asked))
        return other

    assert probe.shock is not None
    of_corrected = None if corrected is None else partial(on, corrected)
    by_law = [[partial(on, one) for one in cause] for cause in changed]
    probe.shock = compared(probe.shock, partial(on, fewer), of_corrected, probe.budget, by_law)


def _evaluated(
    evaluate: Evaluation, results: SceneResults, probe: Probe, filter: str | None
) -> Probe:
    """A probe at its times, in a scene that has been made in part, through a filter."""
    call = results.compiled.probes[probe.name]
    arguments = call.arguments | {"times": probe.times, "filter": filter}
    signal = evaluate(replace(call, arguments=arguments))
    evaluated = Probe(replace(results, probes={probe.name: signal}), probe.name)
    evaluated.filter = filter
    return evaluated


def _settled(
    evaluations: tuple[Evaluation, Evaluation], results: SceneResults, probe: Probe
) -> Probe | None:
    """A probe through the widest filter through which it has converged; None without one."""
    for name in reversed(CLASSES):
        seen, fewer = (_evaluated(one, results, probe, name) for one in evaluations)
        seen.fewer, seen.budget = fewer, probe.budget
        if not seen.is_unsettled:
            return seen
    return None


def _stress_rows(peaks: Mapping[str, PeakField], force: float | None) -> Rows:
    """Rows with the verdicts on stresses, or the largest values if no strength is known.

    `force`: relative error of the force, if it is known.
    """
    rows = []
    for name, peak in peaks.items():
        largest = f"{_largest(peak)}{without_mesh_error(peak)}"
        sentence = largest if peak.worst_point is None else judgement(peak, force)
        rows.append((_spaced(name), sentence))
        if note := stress_note(peak, force):
            rows.append(("", note))
        if peak.yield_speeds is not None and (told := peak.yield_speeds.sentence):
            rows.append(("", told))
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
        if peak.largest_mesh_error:
            content[name]["mesh_error"] = peak.largest_mesh_error
        if peak.yield_speeds is not None:
            content[name]["yield_speeds"] = peak.yield_speeds._asdict()
        content[name] |= _margin_numbers(peak)
    return content


#: Attributes of a margin among the numbers.
MARGIN_KEYS = (
    "criterion", "scope", "exposure", "margin", "least_margin", "reached", "contact", "beyond",
    "spread", "edge_stress", "thin", "layer", "sentence", "point", "time",
)  # fmt: skip


#: The same where no strength is known.
OUTSIDE_KEYS = ("stress", "scope", "spread", "edge_stress", "sentence", "point", "time")


def _margin_numbers(peak: PeakField) -> Columns:
    """The margin of a stress field if a strength is known, else {}."""
    margin = peak.worst_point
    if margin is None:
        return {}
    if peak.exposure is None:
        return {"outside": {key: getattr(margin, key) for key in OUTSIDE_KEYS}}
    numbers = {key: getattr(margin, key) for key in MARGIN_KEYS}
    if margin.sharp is None or margin.away is None:
        return {"margin": numbers}
    keys = ("value", "exposure", "reached", "point", "time")
    sharp = {key: getattr(margin.sharp, key) for key in keys}
    sharp |= {"names": margin.away.names, "distances": margin.away.distances}
    return {"margin": {**numbers, "sharp": sharp}}


#: End of the caption of a force.
BAND = "; an estimated error of 0.5 % or more is drawn as a band."


def _impact_pictures(results: SceneResults, probes: Sequence[Probe]) -> list[Picture]:
    """Pictures of an impact."""
    hit = results.history
    contacts = _contacts(results.history)
    forces = [(f"{a} – {b}", contact.time, contact.force) for (a, b), contact in contacts.items()]
    several = partial(curves, forces, "contact force (N)")
    caption = "Force (N) over time" + ("." if contacts else BAND)
    pictures = [chart("Contact force", caption, several if contacts else partial(plot_force, hit))]
    if not contacts:
        caption = "Displacements of the site and of the impactor over time."
        pictures += _of_run(hit, "Displacements", caption, partial(plot_motion, hit))
    energies = [(name, hit.time, getattr(hit.energy, name)) for name in ENERGIES]
    caption = "Energies (J) of both bodies, of the contact and of what is dissipated, over time."
    pictures += _of_run(hit, "Energies", caption, partial(curves, energies, "energy (J)"))
    if probes:
        caption = "The component of each probe with the largest value; of probes with several units"
        caption += " each is divided by its largest value, which the legend states."
        pictures.append(chart("Probes", caption, partial(_signals, probes)))
    for probe in probes:
        if probe.shock:
            caption = f"Probe {probe.name}: {probe.shock.sentence}."
            draw = probe.shock.plot
            pictures.append(Picture("Shock response spectrum", caption, draw, ".svg"))
    if results.structure is not None:
        caption = "The structure at the time of the largest displacement of its site, or of the"
        caption += " largest force; displacements are drawn larger by the factor stated."
        arrow = _impact_arrow(results.model)
        for name, view in (VIEWS if arrow else {"": None}).items():
            draw = partial(plot_deformed, results.structure, hit, view=view, **arrow)
            pictures.append(
                Picture(f"Deformed structure{name}", caption, draw, same_view=bool(name))
            )
    for name, peak in (results.stresses or {}).items():
        caption = f"The largest value at each node over the run: {_spaced(name)}.{_marked(peak)}"
        pictures.append(Picture("Largest stress", caption, peak.plot))
    return pictures


def _marked(peak: PeakField) -> str:
    """Sentence on the marked value, where it is not the stress that is judged."""
    value = float(peak.values[peak.judged])
    margin = peak.worst_point
    if margin is None or peak.unit != "Pa" or not margin.at_edge:
        return ""
    marked, judged = (engineering(one, peak.unit) for one in (value, margin.stress))
    return (
        f" Marked is the largest of the nodes that are judged, {marked}; the largest stress,"
        f" {judged}, is that of Hertz's pressure between them."
    )


#: A run is shown whole unless its contacts end before this share of it; else to twice their end.
SHORT = 0.25


def _of_run(
    hit: History, heading: str, caption: str, fill: Callable[[Axes], object]
) -> list[Picture]:
    """A chart over the time of a run; of one that goes on long after its contacts two: the time of
    these, and the whole run, folded.
    """
    whole = chart(heading, caption, fill)
    releases = [one.contacts[-1][1] for one in _contacts(hit).values() or [hit] if one.contacts]
    share = max(releases, default=hit.time[-1]) / hit.time[-1]
    if share > SHORT:
        return [whole]
    shown = f"{caption} The run goes on to {engineering(hit.time[-1], 's')}."
    first = chart(heading, shown, partial(begun, fill, 2 * share))
    return [first, replace(whole, heading=f"{heading} over the whole run", folded=True)]


def _impact_arrow(model: AntiOscillators) -> Columns:
    """Point and direction of the only site, for the arrow of the impact; {} if unknown."""
    points = list(site_points(model).values())
    direction = info_of(model).direction
    has_direction = len(points) == 1 and len(points[0]) == 3 and direction is not None
    if has_direction:
        return {"point": points[0], "direction": direction}
    return {}


def _contacts(history: History) -> dict[tuple[str, str], Any]:
    """The contacts of a scene by their ends; {} for a single impact."""
    if not isinstance(history, SceneHistory):
        return {}
    return {(c.a, c.b): history[c.a, c.b] for c in history.assembly.scene.contacts}


class Probe:
    """One probe: its quantity, times [s], and values (n, c) by component.

    `filter` : the channel frequency class of its filter, or None.
    `fewer` : the same probe with half the anti-oscillators; None if it is not known.
    `budget` : the errors of the force, which its values follow; None if they are not known.
    `by_law` : relative change of its largest value by the error of the contact's law.
    `place` : where it lies; None if it is not known.
    `shock` : its shock response spectra, if the scene asks for them.
    `settled` : the probe through the widest filter through which it has converged, if it has not
        without one.
    """

    fewer: Probe | None = None
    budget: ErrorBudget | None = None
    by_law: float = 0.0
    settled: Probe | None = None
    place: ProbePlace | None = None

    def __init__(self, results: SceneResults, name: str) -> None:
        arguments = results.compiled.probes[name].arguments
        self.name = name
        self.shock: ProbeSpectra | None = results.spectra.get(name)
        self.quantity: str = arguments.get("quantity", "displacement")
        self.filter: str | None = arguments.get("filter")
        times = arguments.get("times", results.history.time)
        times_given = probe_times(results.history) if isinstance(times, Call) else times
        self.times = np.reshape(times_given, -1).astype(float)
        values: Array = np.asarray(results.probes[name])
        self.tensor = values.ndim == 3
        if self.tensor:  # the six of a symmetric one
            values = values[:, *np.triu_indices(values.shape[1])]
        self.scalar = values.ndim == 1
        self.values = values.reshape(len(values), -1)

    @property
    def is_vector(self) -> bool:
        """Whether its largest value is that of the magnitude."""
        return self.quantity in PROBE_UNITS and not self.tensor and len(self.units()) > 1

    def units(self) -> dict[str, str]:
        """Component -> unit, one for each column; "" is the component of a scalar."""
        unit = PROBE_UNITS.get(self.quantity, "")
        count = self.values.shape[1]
        if self.scalar:
            return {"": unit}
        if self.tensor:
            names = "xx xy xz yy yz zz" if count == 6 else "xx xy yy"
            return dict.fromkeys(names.split(), unit)
        if self.quantity == "section_forces":
            return SECTION_FORCES[count]
        is_plane = (self.quantity, count) == ("rotation", 1)
        return dict.fromkeys("z" if is_plane else "xyz"[:count], unit)

    def table(self) -> Columns:
        """The components as columns of a file."""
        headings = []
        for component, unit in self.units().items():
            told = ", ".join(one for one in (unit, self.filter) if one)
            headings.append(f"{self.name} {component}".rstrip() + (f" ({told})" if told else ""))
        return dict(zip(headings, self.values.T, strict=True))

    def shock_table(self) -> Columns:
        """The frequencies and the largest absolute responses as columns of a file."""
        assert self.shock is not None
        spectra = self.shock.spectra
        table: Columns = {"frequency (Hz)": self.shock.largest.frequency}
        unit = ", ".join(filter(None, ("m/s²", self.filter)))
        table |= {f"{self.name} {c} ({unit})": s.maximax for c, s in spectra.items()}
        bars = {f"{self.name} {c} ± ({unit})": s.bar for c, s in spectra.items()}
        return table | {name: bar for name, bar in bars.items() if bar is not None}

    @property
    def force(self) -> float | None:
        """Relative error of the force beside that by the anti-oscillators; None if not known."""
        return None if self.budget is None else self.budget.rest_of_force

    @property
    def error(self) -> ProbeError | None:
        """The error of the largest value; None if nothing of it is known."""
        if self.fewer is None:
            return None
        share = error_of_largest(self.values, self.fewer.values, self.is_vector)
        return None if share is None else with_force(share, self.budget, by_law=self.by_law)

    def peak(self) -> Columns:
        """The largest value: for a vector its magnitude, for other quantities that of one
        component.

        Keys: quantity, filter, component ("magnitude"; "" for a scalar), value, unit, time, g for
        accelerations, axis: component, value and time of the largest component of a vector,
        truncation: the largest difference of this signal to that of half the
        anti-oscillators, over the value; force: what the error of the force adds; error: both; None
        if unknown. (On the bracket, at 8 points with n = 20,
        40 and 80, it was above the error of the largest velocity, against n = 160, in 24 of 24
        cases, and of the largest acceleration in 22; the differences of the peaks in 14 and 17.)
        Of an acceleration that has not converged also filtered: that of `settled`, or None.
        """
        values = self.values
        units = self.units()
        if self.is_vector:
            values = np.linalg.norm(values, axis=1)[:, None]
            units = {"magnitude": next(iter(units.values()))}
        component, row, value = _largest_of(values, units)
        error = self.error
        peak: Columns = {"quantity": self.quantity, "filter": self.filter}
        peak |= {"component": component, "value": value}
        peak |= {"truncation": error and error.truncation, "force": self.force}
        peak["error"] = None if error is None or error.force is None else float(error)
        peak |= {"unit": units[component], "time": float(self.times[row])}
        if self.is_vector:
            axis, row, value_along = _largest_of(self.values, self.units())
            time = float(self.times[row])
            peak["axis"] = {"component": axis, "value": value_along, "time": time}
        if self.quantity == "acceleration":
            peak["g"] = value / GRAVITY
            if not self.filter and (peak["truncation"] or 0.0) > UNSETTLED:
                peak["filtered"] = self.settled and self.settled.peak()
        return peak

    @property
    def is_unsettled(self) -> bool:
        """Whether its largest value depends on the number of anti-oscillators."""
        return (self.peak()["truncation"] or 0.0) > UNSETTLED

    @property
    def still_moves(self) -> bool:
        """Whether the value is nearly as large at the end of its times as ever, so that a larger
        one may follow.
        """
        size = np.linalg.norm(self.values, axis=1)
        last = size[self.times >= self.times[-1] - AT_END * np.ptp(self.times)]
        return bool(last.max() > STILL * size.max())

    def signal(self) -> tuple[str, Array, Array, str]:
        """(name, times, values, unit) of the component with the largest value."""
        k = int(np.argmax(np.abs(self.values).max(axis=0)))
        component, unit = list(self.units().items())[k]
        name = " ".join(filter(None, (self.name, component, self.filter)))
        return name, self.times, self.values[:, k], unit


def _largest_of(values: Array, names: Iterable[str]) -> tuple[str, int, float]:
    """(component, row, value) of the largest of values (n, c)."""
    row, k = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    return list(names)[k], int(row), float(values[row, k])


def _signals(probes: Sequence[Probe], ax: Axes) -> None:
    """Draw the signals of probes in their unit; with several units as shares of their maxima."""
    signals = [probe.signal() for probe in probes[:CURVES]]
    largest = [float(np.abs(values).max()) for _, _, values, _ in signals]
    kinds = {(probe.quantity, signal[3]) for probe, signal in zip(probes, signals, strict=False)}
    if len(kinds) == 1:
        ((quantity, unit),) = kinds
        factor, scaled_unit = prefixed(max(largest), unit)
        scaled = [(name, time, factor * values) for name, time, values, _ in signals]
        curves(
            scaled, f"{_spaced(quantity)} ({scaled_unit})" if scaled_unit else _spaced(quantity), ax
        )
        return
    shares = [
        (f"{name}, at most {engineering(maximum, unit)}", time, values / (maximum or 1.0))
        for (name, time, values, unit), maximum in zip(signals, largest, strict=True)
    ]
    curves(shares, "share of the largest value", ax)


def _fall(results: SceneResults) -> Presentation:
    """A fall or an ensemble of falls, with accelerometers and largest stress."""
    fall = results.fall
    worst = results.worst
    peaks = results.peaks or {}
    is_single = hasattr(fall, "flights")
    table = (
        fall.impacts.columns() | _dents_and_shocks(fall)
        if is_single
        else _quantiles(fall, UNITS_OF_FALLS)
    )
    told = {} if is_single else _quantiles_told(fall, UNITS_OF_FALLS)
    accelerometers = results.compiled.document.data.get("accelerometers", {}) if peaks else {}
    rows = [
        (
            f"accelerometer {name}",
            f"at most {plain(peak.g, 4)} g ({accelerometers[name].get('filter', 'unfiltered')}),"
            f" in impact {peak.impact + 1}{_bar_of_reading(fall, peak) if is_single else ''}",
        )
        for name, peak in peaks.items()
    ]
    if worst is not None:
        rows += _stress_rows({worst.quantity: worst}, bar_of_fall(fall, worst))
    if not is_single:
        rows.append(("contact", f"yields in {fall.yields.sum()} of {len(fall)} falls"))
        rows.append(("low, high", BARS_OF_FALLS))
    numbers: Columns = {"fall": table | {"status": fall.status, "message": fall.message}}
    numbers["accelerometers"] = {n: vars(p) | {"g": p.g} for n, p in peaks.items()}
    pictures = []
    if is_single:
        caption = "The part as it first touches, the heights (m), the energies (J) and the peak"
        pictures.append(Picture("Fall", f"{caption} forces of the impacts (N).", fall.plot))
    if worst is not None:
        numbers["worst"] = {worst.quantity: float(worst.values.max())} | _margin_numbers(worst)
        if is_single:
            of_impacts = [one._asdict() for one in stresses_of_impacts(fall, worst)]
            numbers["worst"]["impacts"] = of_impacts
        caption = "The largest value at each node over all impacts."
        pictures.append(Picture("Largest stress", caption, worst.plot))
    caution = ""
    if is_single:
        from antiosc_app.fall_caution import caution_of_fall  # it needs the finite elements

        caution = caution_of_fall(fall)
    return Presentation(
        text=[
            *(_fall_text(fall, worst) if is_single else [format_columns(told)]),
            format_rows(rows),
        ],
        caution=caution,
        tables={"fall.csv": table},
        numbers=numbers,
        plotted={"fall": fall, "worst": worst},
        fields={} if worst is None else {"worst.vtu": worst.write},
        sections={
            "Fall": [
                *([narrow_table(fall, worst), touches_text(fall)] if is_single else [told]),
                rows,
                how_it_ended(fall.message),
            ],
        },
        pictures=pictures,
    )


def _fall_text(fall: Fall, worst: WorstField | None) -> list[str]:
    """The impacts of a fall as text; dent, acceleration and largest stress of each."""
    numbers = {"impact": np.arange(1, len(fall.impacts) + 1)}
    further = _dents_and_shocks_told(fall) | _stress_columns(fall, worst)
    return [fall.summary(), *([format_columns(numbers | further)] if fall.impacts else [])]


#: Name of the column of the largest accelerations of the centre of mass.
SHOCKS = f"centre of mass in g, {SHOCK_FILTER}"


def _bar_of_reading(fall: Fall, peak: Peak) -> str:
    """The bar of the largest reading of an accelerometer in a fall, as the end of a sentence."""
    by_force = fall.impacts[peak.impact].law_error
    if by_force is None:
        return " (no error bar: that of the force is not known)"
    return f" (± {percent(by_force)} by the force; that by the part's motions is not known)"


def _dents_and_shocks(fall: Fall) -> Columns:
    """The deepest dent of each impact, and the acceleration of the centre of mass."""
    shocks = _shocks(fall).items()
    return {"dent (m)": fall.dents} | {name: np.array([one.g for one in p]) for name, p in shocks}


def _shocks(fall: Fall) -> dict[str, tuple[Peak, ...]]:
    """Heading -> accelerations of the centre of mass; without a filter only where that cuts one."""
    return {SHOCKS: fall.shocks}


def _dents_and_shocks_told(fall: Fall) -> Columns:
    """The same for a reader: the accelerations with the digits that their force has."""
    told = {name: [plain(one.g, 3) for one in peaks] for name, peaks in _shocks(fall).items()}
    return _dents_and_shocks(fall) | told


def narrow_table(fall: Fall, worst: WorstField | None = None) -> Columns:
    """The impacts of a fall as a table that fits on paper, with what each does to the part."""
    impacts = fall.impacts
    before, after = (impacts.column(f"speed_{when}") for when in ("before", "after"))
    return {
        "impact": np.arange(1, len(impacts) + 1),
        "time (s)": impacts.column("time"),
        "peak force (N)": impacts.column("peak_force"),
        "± by law (%)": 100 * impacts.column("law_error"),
        **_dents_and_shocks_told(fall),
        **_stress_columns(fall, worst),
        "contact time (s)": impacts.column("contact_time"),
        "speed before, after (m/s)": [
            f"{v:.3g}, {w:.3g}" for v, w in zip(before, after, strict=True)
        ],
        "lost (J)": impacts.column("lost"),
        "at": [placed(impact.place) for impact in impacts],
    }


def touches_text(fall: Fall) -> str:
    """Sentence on the impacts in which the part touches several times; "" if there are none."""
    told = [
        f"impact {k + 1} has {impact.touches} touches, the hardest of"
        f" {engineering(impact.hardest_touch, 's')}"
        for k, impact in enumerate(fall.impacts)
        if impact.touches > 1
    ]
    if not told:
        return ""
    return f"{capitalised(', '.join(told))}: the contact time is that {OF_ALL_CONTACTS}."


def _stress_columns(fall: Fall, worst: WorstField | None) -> Columns:
    """The largest stress of each impact with its bar; {} where none is judged by yield."""
    stresses = stresses_of_impacts(fall, worst)
    if not stresses:
        return {}
    return {
        "largest stress (Pa)": [one.stress for one in stresses],
        "its error, %": [one.bar_text.replace(" %", "") for one in stresses],
    }


def how_it_ended(message: str) -> str:
    """Sentence on how a fall ended."""
    return f"The fall ended: {message}."


def _blow(results: SceneResults) -> Presentation:
    """The result of `find_impact`."""
    blow = results.found
    caption = "Signals in the band that is compared, and the contact force (N) that was found."
    return Presentation(
        text=[blow.summary()],
        tables={"force.csv": {"time (s)": blow.time, "force (N)": blow.force}},
        numbers={"found": blow.numbers()},
        plotted={"found": blow},
        sections={"Blow": [blow.rows(), blow.message]},
        pictures=[Picture("Signals and force", caption, blow.plot)],
    )


#: Units of values that sweeps vary, by the last word of their names.
SWEPT_UNITS = {
    **{"velocity": "m/s", "mass": "kg", "rho": "kg/m³", "duration": "s"},
    **dict.fromkeys(("radius", "tip_radius", "thickness"), "m"),
    **dict.fromkeys(("E", "yield_strength"), "Pa"),
}
#: What the bars of a sweep hold.
BARS_OF_SWEEP = (
    "± is the error bar of the peak force: mesh, truncation, time steps, patch, and the contact law"
    " with the range of the yield strength (yield_range), but for what the name of the column"
    " leaves out. The elastic constants and the striker have no error in it."
)


#: Before the verdicts of a sweep.
OWN_IMPACT = "Stresses and verdicts are those of the scene's own impact, without the sweep:"


def _sweep(results: SceneResults) -> Presentation:
    """A sweep: the varied values, and the results of each impact."""
    batch = results.batch
    varied_values = {
        label(place): list(values) for place, values in varied(results.compiled).items()
    }
    table: Columns = dict(varied_values)
    budgets = [row.budget for row in results.facts]
    bars = _bar_column(budgets)
    notes = [*[BARS_OF_SWEEP] * bool(bars), *_without_bars(budgets)]
    for name, unit in QUANTITIES.items():
        table[f"{_spaced(name)} ({unit})"] = getattr(batch, name)
        if name == "peak_force":
            table |= bars
    table |= _yield_columns(results.facts)
    table |= {name: getattr(batch, name) for name in ("restitution", "contacts", "status")}

    def draw(ax: Axes) -> None:
        (name, values), *others = varied_values.items()
        numbers = all(isinstance(v, int | float) for v in values)
        x = np.asarray(values if numbers else range(len(values)))
        shares = [np.nan_to_num(bar) / 100 for bar in bars.values()]
        errors = batch.peak_force * shares[0] if shares else np.zeros(len(x))
        for told, rows in _lines(others, len(x)).items():
            rows = rows[np.argsort(x[rows], kind="stable")] if told else rows
            ax.errorbar(
                x[rows], batch.peak_force[rows], errors[rows], fmt="o-", ms=4, lw=1, capsize=3,
                label=escaped(told) or None,
            )  # fmt: skip
            if told:
                ax.legend(fontsize="small")
        ax.set_xlabel(escaped(with_unit(name)))
        ax.set_ylabel("peak force (N)")

    own = nominal_rows(results.nominal)
    caution = ""
    if results.nominal is not None:
        drawn = {name: np.asarray(values) for name, values in varied_values.items()}
        own += [("", shares)] if (shares := yielding_share(drawn, results.nominal)) else []
        force = force_bar(error_budget(results.nominal.hit))
        if yields := of_elastic_part(results.nominal.fields, force):
            caution = f"{yields} That is of the scene's own impact; the sweep has no stresses."
    verdict: list[Block] = [OWN_IMPACT, own] if own else []
    caption = "Peak force (N) of each impact with its bar, over the first value that varies"
    caption += ", a line for each combination of the others." if len(varied_values) > 1 else "."
    shown = {with_unit(name): values for name, values in varied_values.items()}
    shown |= {name: values for name, values in table.items() if name not in varied_values}
    return Presentation(
        text=[
            format_columns(table),
            *_without_bars(budgets),
            *([OWN_IMPACT, format_rows(own)] if own else []),
        ],
        caution=caution,
        tables={"sweep.csv": table},
        numbers={"sweep": table, **_nominal_numbers(results.nominal)},
        sections={"Sweep": [shown, *notes, *verdict]},
        pictures=[chart("Sweep", caption, draw)],
    )


def _lines(others: Sequence[tuple[str, list[object]]], count: int) -> dict[str, IntArray]:
    """Text of the other values of a sweep -> the rows that have them, at least two of each; one
    line of all rows where the values are no grid.
    """
    lines: dict[str, list[int]] = {}
    for row in range(count):
        told = ", ".join(f"{with_unit(name)} {values[row]}" for name, values in others)
        lines.setdefault(told, []).append(row)
    if min(map(len, lines.values())) < 2:
        lines = {"": list(range(count))}
    return {told: np.array(rows) for told, rows in lines.items()}


def with_unit(name: str) -> str:
    """The name of a varied value with its unit: "impactor.velocity (m/s)"."""
    unit = SWEPT_UNITS.get(name.rpartition(".")[2])
    return f"{name} ({unit})" if unit else name


def _bar_column(budgets: Sequence[ErrorBudget | None]) -> Columns:
    """The column of the bars of peak forces; NaN in the rows without one."""
    shares = [budget and budget.shares("peak_force")["total"] for budget in budgets]
    if not any(share is not None for share in shares):
        return {}
    given = any(budget.law for budget in budgets if budget is not None and not budget.no_bar)
    name = "± without the law (%)" if given else "± (%)"
    return {name: 100 * np.array(shares, dtype=float)}


def _without_bars(budgets: Sequence[ErrorBudget | None]) -> list[str]:
    """Why rows of a sweep have no bar, each reason once."""
    told = [budget.footnote for budget in budgets if budget is not None and budget.no_bar]
    return list(dict.fromkeys(told))


def _yield_columns(rows: Sequence[RowFacts]) -> Columns:
    """The columns of forces over that of first yield, and of dents, where one is known."""
    columns = {
        "peak/yield force": [row.yield_share for row in rows],
        "dent (m)": [row.dent for row in rows],
    }
    return {
        name: np.array(values, dtype=float)
        for name, values in columns.items()
        if any(value is not None for value in values)
    }


#: Quantities of an ensemble of falls, and their units.
UNITS_OF_FALLS = QUANTITIES | {"lost": "J"}
#: What the bars of quantiles hold.
BARS_OF_FALLS = (
    "the bar of a quantile by the number of falls alone: the errors of the model and of the"
    " contact's law, which all falls have, are not in it"
)
BARS_OF_QUANTILES = (
    "low, high: the bar of a quantile by the number of runs alone; with the model's error: both"
    " together. The errors of the model, which all runs have, and the verdicts are those of the run"
    " without random values:"
)


def nominal_rows(nominal: Nominal | None) -> Rows:
    """The error bars of a study's run without random values, its contact and its stress."""
    if nominal is None:
        return []
    hit = nominal.hit
    budget = error_budget(hit)
    bars = caution_of(hit, None, nominal.structure) if budget is None else str(budget)
    first, *others = bars.splitlines()
    rows = [("errors", first), *(("", line) for line in others)]
    rows += [("contact", hit.verdict)] if hit.verdict else []
    return rows + _stress_rows(nominal.fields, force_bar(budget))


#: The drawn input by which blows are compared with the speeds of yield.
SPEED = "impactor.velocity"


def yielding_share(inputs: Mapping[str, Array], nominal: Nominal) -> str:
    """Sentence on the share of the drawn blows that are faster than the speeds from which the part
    yields; "" where the speed is not drawn, or those are not known.
    """
    if SPEED not in inputs:
        return ""
    speeds = np.abs(inputs[SPEED])
    told = []
    for name, peak in nominal.fields.items():
        found = peak.yield_speeds
        ends = (
            {} if found is None else {"may be reached": found.possible, "is certain": found.certain}
        )
        shares = [
            f"{percent(float(np.mean(speeds >= limit)))} are at or above"
            f" {engineering(limit, 'm/s', 2)}, from where yield {what}"
            for what, limit in ends.items()
            if limit is not None
        ]
        told += [f"{_spaced(name)}: of the {speeds.size} blows {' and '.join(shares)}"] * bool(
            shares
        )
    note = " (by their speeds alone: what else varies shifts these limits)"
    return f"{'; '.join(told)}{note}" if told else ""


def _nominal_numbers(nominal: Nominal | None) -> Columns:
    """The numbers of a study's run without random values; {} if there is none."""
    if nominal is None:
        return {}
    of_run = {"result": nominal.hit.numbers(), "stress": _stress_numbers(nominal.fields)}
    return {"nominal": of_run}


def _sample(results: SceneResults) -> Presentation:
    """A Monte Carlo study: quantiles, and inputs and results of each run."""
    sample = results.sample
    nominal_run = results.nominal
    budget = None if nominal_run is None else error_budget(nominal_run.hit)
    told = _quantiles_told(sample, QUANTITIES, budget)
    failed = [sample.failed.get(i, "") for i in range(len(sample))]
    caption = (
        "Peak forces (N) of the runs, and their quantiles with the bars of the number of runs."
    )
    nominal = nominal_rows(nominal_run)
    if nominal_run is not None and (shares := yielding_share(sample.inputs, nominal_run)):
        nominal.append(("", shares))
    return Presentation(
        text=[format_columns(told), BARS_OF_QUANTILES, format_rows(nominal)],
        tables={"monte_carlo.csv": {**sample.inputs, **sample.values, "error": failed}},
        numbers={
            "monte_carlo": _quantiles(sample, QUANTITIES),
            **_nominal_numbers(results.nominal),
        },
        plotted={"monte_carlo": sample},
        sections={"Random values": [told, BARS_OF_QUANTILES, nominal]},
        pictures=[Picture("Random values", caption, sample.plot, ".svg")],
    )


def _tradeoff(results: SceneResults) -> Presentation:
    """Methods that were compared for an impact."""
    compared = results.tradeoff
    assert compared is not None
    members = (*compared.table, *compared.others)
    table = {
        "method": [member.method for member in members],
        "dofs": [member.dofs for member in members],
        "N": [member.n for member in members],
        "time (s)": [member.seconds for member in members],
        "peak (N)": [member.peak_force for member in members],
        "force ±": [percent(member.force_bar) for member in members],
        "all ±": [percent(member.bar) for member in members],
        "to finest": [percent(member.difference) for member in members],
    }
    caption = (
        "Error bars of methods with coarse and fine meshes, with few and many anti-oscillators, and"
        " their differences to the finest one, over the time of each."
    )

    def draw(ax: Axes) -> None:
        compared.draw(ax)
        legend_beside(ax)

    return Presentation(
        text=[compared.summary()],
        tables={"tradeoff.csv": table},
        numbers={"tradeoff": compared.numbers()},
        plotted={"tradeoff": compared},
        sections={"Speed against accuracy": [table, compared.message, *compared.notes]},
        pictures=[chart("Speed against accuracy", caption, draw)],
    )


def _map(results: SceneResults) -> Presentation:
    """A map: the range of each quantity, and the hardest impact of each surface."""
    impact_map = results.map
    quantities = results.map.quantities()
    surfaces = results.map.surfaces()
    sites = f"{len(impact_map)}" + (
        f", {impact_map.skipped} left out" if impact_map.skipped else ""
    )
    if impact_map.doubtful.any():
        ranges = "these ranges are of" if impact_map.doubtful.all() else "not in these ranges:"
        sites += f"; {ranges} {doubts_text(impact_map)}"
    rows = [("sites", sites)]
    labels = {name: MAP_QUANTITIES.get(name, (_spaced(name), "")) for name in quantities}
    for name, values in quantities.items():
        finite = values[trusted(impact_map)]
        finite = finite[np.isfinite(finite)]
        if finite.size:
            rows.append((labels[name][0], _range(finite, labels[name][1])))
    for name, surface in surfaces.items() if len(surfaces) > 1 else ():
        text = f"{len(surface)} sites"
        if impact_map.peak_force is not None:
            i = hardest(impact_map, surface)
            force = engineering(impact_map.peak_force[i], "N", 4)
            text += f", at most {force} at {placed(impact_map.points[i])}"
        rows.append((name, text))
    headings = {name: f"{name} ({unit})" if unit else name for name, (_, unit) in labels.items()}
    table = {"surface": impact_map.names.tolist()} if len(surfaces) > 1 else {}
    table |= {f"{axis} (m)": impact_map.points[:, k] for k, axis in enumerate("xyz")}
    numbers = {"points": impact_map.points, "surface": impact_map.names.tolist(), **quantities}
    return Presentation(
        text=[format_rows(rows)],
        caution=" ".join(map_cautions(impact_map)),
        tables={"map.csv": table | {headings[name]: values for name, values in quantities.items()}},
        numbers={"map": numbers | {"doubtful": impact_map.doubtful}},
        plotted={"map": impact_map},
        fields={"map.vtu": impact_map.write},
        sections={"Map": [rows]},
        pictures=[
            Picture(
                f"Map: {labels[q][0]}",
                f"{labels[q][0].capitalize()} ({labels[q][1]}) over the surface.",
                partial(plot_map, impact_map, quantity=q),
            )
            for q in ("peak_force", "contact_time", "k0")
            if q in quantities
        ],
    )


def _range(values: Array, unit: str) -> str:
    """Text of the smallest and the largest value; angular frequencies in Hz."""
    values, unit = (values / (2 * np.pi), "Hz") if unit == "rad/s" else (values, unit)
    return range_text(values.min(), values.max(), unit)


#: Object of a scene -> function that makes its presentation.
_KINDS: dict[str, Callable[[SceneResults], Presentation]] = {
    **{"history": _impact, "fall": _fall, "found": _blow},
    **{"batch": _sweep, "sample": _sample, "map": _map, "tradeoff": _tradeoff},
}


def presentations(results: SceneResults) -> list[Presentation]:
    """The presentations of a scene: structure with model first, then the results."""
    present = (make for name, make in _KINDS.items() if getattr(results, name) is not None)
    return [_model(results), *(make(results) for make in present)]


def text(results: SceneResults, parts: Sequence[Presentation]) -> str:
    """Text of title, what questions the numbers, structure, model and results."""
    title = str(results.compiled.document.data.get("title", ""))
    title = ", ".join(filter(None, (title, piece_told(results.warnings))))
    warnings = (f"warning: {one}" for one in beside(results, parts) if not weight(one))
    cautions = (part.caution for part in parts)
    pieces = [title, *cautions, *warnings, *(piece for part in parts for piece in part.text)]
    return of_scenes(with_remedy("\n\n".join(piece for piece in pieces if piece), results))


def with_remedy(text: str, results: SceneResults) -> str:
    """A text with the keys of the scene of its results in place of those of any scene, and without
    the fields of the page.
    """
    if results.compiled is None:
        return text
    data = results.compiled.document.data
    if "strike" in data:  # which makes mesh and model
        tighter = "a smaller tol in [strike]"
        text = text.replace(SMALLER_CELLS, tighter).replace("n in [extract]", tighter)
    section = next((name for name in ("deck", "geometry") if name in data), None)
    if section is not None and results.structure is not None:
        text = _with_cells_of(text, section, data[section], results.structure)
    material = {"deck": "[deck]", "geometry": "[material]"}.get(section or "", "")
    if material:
        text = text.replace(ASKED_STRENGTH, f"give {_asked_strength(data, material)}")
        text = text.replace(OWN_STRENGTH, f"yield_strength, yield_range in {material}")
    return in_scene(text)


def _asked_strength(data: Mapping[str, Any], material: str) -> str:
    """What gives the strength that a contact lacks, by the keys of a scene; `material`: the section
    of the part's.
    """
    striker = data.get("impactor", {}).keys()
    missing = []
    if not {"name", "yield_strength"} & data.get(material.strip("[]"), {}).keys():
        missing.append(f"yield_strength in {material}")
    if not {"material", "name", "yield_strength"} & striker:
        missing.append("yield_strength or a material in [impactor]")
    return ", and ".join(missing) or f"yield_strength in {material}"


def _with_cells_of(text: str, section: str, keys: dict[str, Any], structure: Structure) -> str:
    """A text with what makes the cells of a deck or a geometry smaller, by keys of its section."""
    from antiosc.extension import with_parts
    from antiosc_decks.from_deck import kept_elements  # it needs the finite elements

    size = f"size in [{section}]"
    source = str(keys.get("source")).lower()
    remedy = f"refine, or {size}"
    kept = section == "deck" and bool(kept_elements(structure))
    if kept:
        text = text.replace(COMPARED, COMPARED_DECKS)
    if not source.endswith(GEOMETRIES) and not keys.get("solid"):
        dims = {member.part.mesh.tdim for member in with_parts(structure).members()}
        remedy = halved(size, 0 if kept else max(dims))
        if max(dims) < 3:  # solids are not divided around a point
            remedy = f"refine in [{section}]" + f", or {remedy}" * (not kept)
    return text.replace(SMALLER_CELLS, remedy)


def beside(results: SceneResults, parts: Sequence[Presentation]) -> list[str]:
    """The warnings of a scene by weight, without those that its cautions contain."""
    return by_weight(results.warnings, " ".join(part.caution for part in parts))
