"""Makes a `Presentation` of each result of a scene, for terminal, files and report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc import AntiOscillators, History, SceneHistory
from antiosc.base._types import Array
from antiosc.base.cfc import SHOCK_FILTER
from antiosc.base.errors import InputError, message_weight, sorted_by_weight
from antiosc.base.texts import engineering, percent, plain_number, point_text, range_text
from antiosc.fields.pictures import MAP_QUANTITIES
from antiosc.impact.histories import error_scope
from antiosc.impact.histories.bars import QUANTITIES, ErrorBudget
from antiosc.models.body import info_of, site_points
from antiosc.plot.charts import plot_force, plot_model, plot_motion
from antiosc.plotting import plot_deformed, plot_map
from antiosc.strikes.map_results import doubts_text, hardest, trusted
from antiosc_app import cards, falls, headline
from antiosc_app.presentation import (
    Block,
    Columns,
    Picture,
    Presentation,
    Rows,
    chart_picture,
    draw_curves,
    escaped_name,
    format_rows,
    spaced_name,
)
from antiosc_app.probes import ProbeResult, csv_files_of, draw_signals, probes_of, without_filter
from antiosc_app.scene_file.document import place_text
from antiosc_app.scene_file.run import NominalImpact, SceneResults, error_budget, varied_values

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from antiosc import Fall, Many, PeakField, Structure

#: Heading of the structure and its model.
MODEL_HEADING = "Model"
ENERGY_NAMES = ("kinetic", "strain", "contact", "dissipated")


# -- the structure and its model


def _present_model(results: SceneResults) -> Presentation:
    """Present the structure and its reduced model."""
    structure, model = results.structure, results.model
    presentation = Presentation()
    rows: Rows = []
    if structure is not None:
        rows += [("structure", structure.describe()), *mass_row(structure)]
        presentation.numbers["structure"] = structure.describe()
        with suppress(InputError):  # some matrices do not know it
            presentation.numbers["mass"] = structure.mass
    if model is not None:
        rows += _model_rows(model)
        names = ("k0", "m0", "m_st", "omega", "m", "P", "sites")
        numbers = {name: getattr(model, name, None) for name in names}
        presentation.numbers["model"] = numbers | {"points": site_points(model)}
        presentation.plotted["model"] = model
        caption = (
            "|Z(ω)| (N/m) over frequency (Hz), infinite at the antiresonances, and the share of the"
            " static mass that the anti-oscillators hold."
        )
        draw = partial(plot_model, model)
        presentation.pictures = [Picture("Dynamic stiffness", caption, draw, ".svg")]
    if rows:
        presentation.sections[MODEL_HEADING] = [rows]
    return presentation


def _model_rows(model: AntiOscillators) -> Rows:
    """Rows (name, text) on the sites, stiffness, mass and frequencies of a reduced model."""
    rows = [
        (f"site {name}".rstrip(), point_text(point)) for name, point in site_points(model).items()
    ]
    point = model.info.get("expansion")
    about = f", expanded about {engineering(point, 'Hz')}" if point else ""
    count = ("anti-oscillators", f"{model.n}{about}")
    if np.ndim(model.k0):
        rows += [("sites", ", ".join(model.sites)), count]
    else:
        rows += [
            ("static stiffness k0", engineering(model.k0, "N/m", 4)),
            ("static mass m_st", engineering(model.m_st, "kg", 4)),
            count,
        ]
        if model.m_st > 0:
            rows.append(("captured mass", f"{100 * (1 - model.m0 / model.m_st):.2f} % of m_st"))
    lowest = ", ".join(f"{w / (2 * np.pi):.5g}" for w in model.omega[:5])
    more = ", …" if len(model.omega) > 5 else ""
    return [*rows, ("frequencies" if point else "antiresonances", f"{lowest or 'none'}{more} Hz")]


def mass_row(structure: Structure) -> Rows:
    """One row (name, text): the mass of a structure, or the reason why it is unknown."""
    try:
        return [("mass", engineering(structure.mass, "kg", 4))]
    except InputError as error:
        return [("mass", f"not known: {error}")]


# -- an impact


def _present_impact(results: SceneResults) -> Presentation:
    """Present an impact, or the contacts of a scene, with probes and largest stresses."""
    hit = results.history
    peaks = results.stresses or {}
    probes = probes_of(results)
    budget = error_budget(hit)
    single = not isinstance(hit, SceneHistory)

    columns = hit.columns()
    columns |= {f"{name} energy (J)": getattr(hit.energy, name) for name in ENERGY_NAMES}
    numbers: Columns = hit.numbers()
    if budget is not None:
        numbers["error_budget"] = {name: budget.shares(name) for name in budget}
        if budget.no_bar:
            numbers["no_error_bar"] = budget.footnote

    plotted: dict[str, object] = {**({"force": hit} if single else {}), **peaks}
    found = [probe.shock for probe in probes if probe.shock is not None]
    shocks = [shock.spectra[shock.component] for shock in found]
    plotted |= {f"srs_{k + 1}" if k else "srs": shock for k, shock in enumerate(shocks)}
    facts = [("striker", headline.striker_text(hit.impactor))] if single else _contact_table(hit)
    return Presentation(
        cards=cards.cards_of_history(hit, budget, peaks) if single else [],
        asked=[probe.peak_row() for probe in probes],
        rows=cards.rows_of_history(hit, budget, peaks) if single else [],
        caution=headline.caution_of_impact(hit, budget),
        sentences=headline.sentences_of_history(hit, budget, peaks),
        tables={"history.csv": columns, **csv_files_of(probes)},
        numbers={
            "result": numbers,
            "probes": {probe.name: probe.numbers() for probe in probes},
            "stress": _stress_numbers(peaks),
        },
        plotted=plotted,
        fields={f"{name}.vtu": peak.write for name, peak in peaks.items()},
        sections={
            "Results": [facts, [row for probe in probes for row in probe.rows()]],
            "Errors": _error_blocks(hit, budget),
        },
        pictures=_impact_pictures(results, probes),
    )


def _contact_table(hit: History) -> Columns:
    """Table of numbers of a scene's contacts, one row for each."""
    contacts = _contacts_by_ends(hit)
    table: Columns = {"contact": [f"{a} – {b}" for a, b in contacts]}
    for name, unit in QUANTITIES.items():
        values = [getattr(contact, name) for contact in contacts.values()]
        table[f"{spaced_name(name)} ({unit})"] = values
    return table | {"contacts": [len(contact.contacts) for contact in contacts.values()]}


def _error_blocks(hit: History, budget: ErrorBudget | None) -> list[Block]:
    """Blocks of the section "Errors": numerical errors, step, law, and the error budget."""
    rows = [(f"time integration: {name}", percent(value)) for name, value in hit.error.items()]
    rows.append(("these errors cover", error_scope(hit)))
    rows.append(("energy drift over the run, of the energy", percent(hit.energy.drift)))
    rows.append(("step", engineering(hit.step, "s")))
    if not isinstance(hit, SceneHistory):
        rows.append(("law", type(hit.law).__name__))
    rows += [("stretch", text) for text in hit.stretch_texts]
    rows += [("details", text) for text in hit.details]
    if budget is None:
        return [rows]

    causes = (*budget.causes, "total")
    table: Columns = {"Error budget": [*budget.causes, f"total{budget.condition}"]}
    for name in budget:
        shares = [budget.shares(name)[cause] for cause in causes]
        table[spaced_name(name)] = ["–" if share is None else percent(share) for share in shares]
    return [rows, table, *budget.notes]


#: Attributes of a margin among the numbers, and of the worst point where no strength is known.
MARGIN_KEYS = (
    "criterion", "scope", "exposure", "margin", "least_margin", "reached", "contact", "has_bar",
    "layer", "sentence", "point", "time",
)  # fmt: skip
WORST_POINT_KEYS = ("value", "scope", "has_bar", "sentence", "point", "time")


def _stress_numbers(peaks: Mapping[str, PeakField]) -> Columns:
    """Quantity -> largest value, place, time and margin of its stress field, for result.json."""
    content: Columns = {}
    for name, peak in peaks.items():
        value, point, time = peak.largest(1)[0]
        content[name] = {"value": value, "unit": peak.unit, "point": point, "time": time}
        content[name] |= _margin_numbers(peak)
        if peak.largest_mesh_error:
            content[name]["mesh_error"] = peak.largest_mesh_error
    return content


def _margin_numbers(peak: PeakField) -> Columns:
    """{"margin": …} of a stress field with a strength, {"outside": …} without a strength, for
    result.json; {} if neither is known.
    """
    margin = peak.worst_point
    if margin is None:
        return {}
    if peak.exposure is None:
        return {"outside": {key: getattr(margin, key) for key in WORST_POINT_KEYS}}
    return {"margin": {key: getattr(margin, key) for key in MARGIN_KEYS}}


def _impact_pictures(results: SceneResults, probes: Sequence[ProbeResult]) -> list[Picture]:
    """Pictures of an impact: force, motion, energies, probes, spectra, structure, stress."""
    hit = results.history
    contacts = _contacts_by_ends(hit)
    if contacts:
        forces = [(f"{a} – {b}", one.time, one.force) for (a, b), one in contacts.items()]
        draw = partial(draw_curves, forces, "contact force (N)")
        pictures = [chart_picture("Contact force", "Force (N) over time.", draw)]
    else:
        pictures = [
            chart_picture(
                "Contact force", "Force (N) over time; its bar as a band.", partial(plot_force, hit)
            ),
            chart_picture(
                "Displacements",
                "Displacements of the site and of the impactor over time.",
                partial(plot_motion, hit),
            ),
        ]
    energies = [(name, hit.time, getattr(hit.energy, name)) for name in ENERGY_NAMES]
    caption = "Energies (J) of both bodies, of the contact and of what is dissipated, over time."
    pictures.append(
        chart_picture("Energies", caption, partial(draw_curves, energies, "energy (J)"))
    )
    if probes:
        caption = (
            "The component of each probe with the largest value; of probes with several units each"
            " is divided by its largest value, which the legend states."
        )
        pictures.append(chart_picture("Probes", caption, partial(draw_signals, probes)))
    for probe in probes:
        if probe.shock is not None:
            caption = f"Probe {probe.name}: {probe.shock.sentence}."
            draw_shock = probe.shock.spectra[probe.shock.component].plot
            pictures.append(Picture("Shock response spectrum", caption, draw_shock, ".svg"))
    if results.structure is not None:
        caption = (
            "The structure at the time of the largest displacement of its site, or of the largest"
            " force; displacements are drawn larger by the factor stated."
        )
        shape = partial(plot_deformed, results.structure, hit, **_impact_arrow(results.model))
        pictures.append(Picture("Deformed structure", caption, shape))
    for name, peak in (results.stresses or {}).items():
        caption = f"The largest value at each node over the run: {spaced_name(name)}."
        pictures.append(Picture("Largest stress", caption, peak.plot))
    return pictures


def _impact_arrow(model: AntiOscillators) -> Columns:
    """Arguments `point` and `direction` of `plot_deformed` for the only site; {} if unknown."""
    points = list(site_points(model).values())
    direction = info_of(model).direction
    if len(points) == 1 and len(points[0]) == 3 and direction is not None:
        return {"point": points[0], "direction": direction}
    return {}


def _contacts_by_ends(history: History) -> dict[tuple[str, str], Any]:
    """(end, end) -> contact of a scene of several contacts; {} for a single impact."""
    if not isinstance(history, SceneHistory):
        return {}
    return {(c.a, c.b): history[c.a, c.b] for c in history.assembly.scene.contacts}


# -- falls


def _present_fall(results: SceneResults) -> Presentation:
    """Present a fall or an ensemble of falls, with accelerometers and largest stress."""
    fall, worst = results.fall, results.worst
    single = hasattr(fall, "flights")
    table = fall_table(fall) if single else quantile_table(fall, FALL_QUANTITIES)
    numbers: Columns = {"fall": table | {"status": fall.status, "message": fall.message}}
    peaks = results.peaks or {}
    numbers["accelerometers"] = {name: vars(peak) | {"g": peak.g} for name, peak in peaks.items()}
    pictures = []
    if single:
        caption = (
            "The part as it first touches, the heights (m), the energies (J) and the peak forces of"
            " the impacts (N)."
        )
        pictures.append(Picture("Fall", caption, fall.plot))
    if worst is not None:
        numbers["worst"] = {worst.quantity: float(worst.values.max())} | _margin_numbers(worst)
        caption = "The largest value at each node over all impacts."
        pictures.append(Picture("Largest stress", caption, worst.plot))

    presentation = Presentation(
        tables={"fall.csv": table},
        numbers=numbers,
        plotted={"fall": fall, "worst": worst},
        fields={} if worst is None else {"worst.vtu": worst.write},
        sections={"Fall": [table]},
        pictures=pictures,
    )
    if not single:
        presentation.rows = [("contact", f"yields in {fall.yields.sum()} of {len(fall)}")]
        presentation.sentences = [f"The fall ended: {fall.message}."]
        return presentation

    presentation.cards = cards.cards_of_fall(fall, worst)
    presentation.asked = _accelerometer_rows(results)
    presentation.rows = cards.rows_of_fall(fall, worst)
    presentation.caution = falls.caution_of_fall(fall)
    presentation.sentences = falls.sentences_of_fall(fall, worst)
    return presentation


def _accelerometer_rows(results: SceneResults) -> Rows:
    """Rows (name, text) of the peak acceleration of each accelerometer, filtered and not."""
    rows = []
    for name, peak in (results.peaks or {}).items():
        call = results.compiled.peaks[name]
        through = call.arguments.get("filter", "unfiltered")
        told = f"at most {plain_number(peak.g, 4)} g ({through}), in impact {peak.impact + 1}"
        if "filter" in call.arguments:
            told += f", {plain_number(without_filter(results, call).g, 4)} g unfiltered"
        rows.append((f"accelerometer {name}", told))
    return rows


def fall_table(fall: Fall) -> Columns:
    """Table of the impacts of a fall: their numbers, dents and shocks."""
    shocks = np.array([one.g for one in fall.shocks])
    columns: Columns = {"impact": np.arange(1, len(fall.impacts) + 1), **fall.impacts.columns()}
    columns["± by law (%)"] = 100 * fall.impacts.column("law_error")
    return columns | {"dent (m)": fall.dents, f"centre of mass in g, {SHOCK_FILTER}": shocks}


# -- studies

#: Quantities of an ensemble of falls, and their units.
FALL_QUANTITIES = QUANTITIES | {"lost": "J"}
#: Before the errors and verdicts of a study.
OWN_IMPACT_SENTENCE = "Errors, stresses and verdicts are those of the scene's own impact:"


def quantile_table(ensemble: Many, units: Mapping[str, str]) -> Columns:
    """Table of an ensemble's quantiles with confidence limits; `units`: quantity -> unit."""
    names = ("quantity", "quantile", "value", "low", "high")
    rows = []
    for name, unit in units.items():
        for q in ensemble.quantiles:
            found = ensemble.quantile(name, q)
            rows.append((f"{spaced_name(name)} ({unit})", q, found.value, found.low, found.high))
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def _nominal_blocks(nominal: NominalImpact | None) -> list[Block]:
    """Blocks with the answers on a study's impact at its own values, as in `antiosc run`."""
    if nominal is None:
        return []
    hit, _, fields = nominal
    budget = error_budget(hit)
    rows: Rows = [card[:2] for card in cards.cards_of_history(hit, budget, fields)]
    told = [
        headline.caution_of_impact(hit, budget),
        *headline.sentences_of_history(hit, budget, fields),
    ]
    return [
        OWN_IMPACT_SENTENCE,
        [*rows, *cards.rows_of_history(hit, budget)],
        " ".join(filter(None, told)),
    ]


def _nominal_numbers(nominal: NominalImpact | None) -> Columns:
    """Numbers of a study's impact at its own values, for result.json; {} without one."""
    if nominal is None:
        return {}
    of_run = {"result": nominal.hit.numbers(), "stress": _stress_numbers(nominal.fields)}
    return {"nominal": of_run}


def _present_sweep(results: SceneResults) -> Presentation:
    """Present a sweep: a table with the values and results of each impact."""
    batch = results.batch
    values = {
        place_text(place): list(given) for place, given in varied_values(results.compiled).items()
    }
    table: Columns = dict(values)
    bars = [budget and budget.shares("peak_force")["total"] for budget in results.facts]
    for name, unit in QUANTITIES.items():
        table[f"{spaced_name(name)} ({unit})"] = getattr(batch, name)
        if name == "peak_force" and any(bar is not None for bar in bars):
            given = any(budget and budget.law for budget in results.facts)
            table["± without the law (%)" if given else "± (%)"] = 100 * np.array(bars, dtype=float)
    table["restitution"] = batch.restitution
    table |= {name: batch.facts[name] for name in ("contacts", "status")}
    return Presentation(
        tables={"sweep.csv": table},
        numbers={"sweep": table, **_nominal_numbers(results.nominal)},
        sections={"Sweep": [table, *_nominal_blocks(results.nominal)]},
        pictures=[
            chart_picture(
                "Sweep",
                "Peak force (N) of each impact, over the first value that varies.",
                partial(_draw_sweep, values, batch.peak_force),
            )
        ],
    )


def _draw_sweep(values: Mapping[str, list[Any]], force: Array, ax: Axes) -> None:
    """Draw peak forces (n,) [N] over the first varied value; `values`: name -> values (n,)."""
    name, first = next(iter(values.items()))
    numbers = all(isinstance(value, int | float) for value in first)
    ax.plot(first if numbers else range(len(first)), force, "o", ms=4)
    ax.set_xlabel(escaped_name(name))
    ax.set_ylabel("peak force (N)")


def _present_sample(results: SceneResults) -> Presentation:
    """Present a Monte Carlo study: quantiles, and inputs and results of each run."""
    sample = results.sample
    table = quantile_table(sample, QUANTITIES)
    caption = "Peak forces (N) of the runs, and their quantiles with the bars of their number."
    return Presentation(
        tables={"monte_carlo.csv": sample.table()},
        numbers={"monte_carlo": table, **_nominal_numbers(results.nominal)},
        plotted={"monte_carlo": sample},
        sections={"Random values": [table, *_nominal_blocks(results.nominal)]},
        pictures=[Picture("Random values", caption, sample.plot, ".svg")],
    )


def _present_found_impact(results: SceneResults) -> Presentation:
    """Present the impact found by `find_impact`."""
    blow = results.found
    caption = "Signals in the band that is compared, and the contact force (N) that was found."
    return Presentation(
        tables={"force.csv": {"time (s)": blow.time, "force (N)": blow.force}},
        numbers={"found": blow.numbers()},
        plotted={"found": blow},
        sections={"Blow": [blow.rows(), blow.message]},
        pictures=[Picture("Signals and force", caption, blow.plot)],
    )


def _present_tradeoff(results: SceneResults) -> Presentation:
    """Present a trade-off: error and cost of each method."""
    compared = results.tradeoff
    assert compared is not None
    members = (*compared.table, *compared.others)
    table: Columns = {
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

    return Presentation(
        tables={"tradeoff.csv": table},
        numbers={"tradeoff": compared.numbers()},
        plotted={"tradeoff": compared},
        sections={"Speed against accuracy": [table, compared.message, *compared.notes]},
        pictures=[chart_picture("Speed against accuracy", caption, compared.draw)],
    )


def _present_map(results: SceneResults) -> Presentation:
    """Present a map: the range of each quantity, and the hardest impact of each surface."""
    impact_map = results.map
    quantities, surfaces = impact_map.quantities(), impact_map.surfaces()
    sites = f"{len(impact_map)}"
    if impact_map.skipped:
        sites += f", {impact_map.skipped} left out"
    if impact_map.doubtful.any():
        sites += f"; {doubts_text(impact_map)}"
    rows = [("sites", sites)]
    labels = {name: MAP_QUANTITIES.get(name, (spaced_name(name), "")) for name in quantities}
    for name, values in quantities.items():
        finite = values[trusted(impact_map)]
        finite = finite[np.isfinite(finite)]
        if finite.size:
            rows.append((labels[name][0], _value_range_text(finite, labels[name][1])))
    for name, surface in surfaces.items() if len(surfaces) > 1 else ():
        text = f"{len(surface)} sites"
        if impact_map.peak_force is not None:
            i = hardest(impact_map, surface)
            force = engineering(impact_map.peak_force[i], "N", 4)
            text += f", at most {force} at {point_text(impact_map.points[i])}"
        rows.append((name, text))
    table: Columns = {"surface": impact_map.names.tolist()} if len(surfaces) > 1 else {}
    table |= {f"{axis} (m)": impact_map.points[:, k] for k, axis in enumerate("xyz")}
    for name, values in quantities.items():
        unit = labels[name][1]
        table[f"{name} ({unit})" if unit else name] = values
    numbers = {"points": impact_map.points, "surface": impact_map.names.tolist(), **quantities}
    return Presentation(
        rows=rows,
        caution=headline.caution_of_map(impact_map),
        sentences=headline.sentences_of_map(impact_map),
        tables={"map.csv": table},
        numbers={"map": numbers | {"doubtful": impact_map.doubtful}},
        plotted={"map": impact_map},
        fields={"map.vtu": impact_map.write},
        sections={"Map": []},
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


def _value_range_text(values: Array, unit: str) -> str:
    """Text "smallest to largest" of values in `unit`; values in rad/s are given in Hz."""
    values, unit = (values / (2 * np.pi), "Hz") if unit == "rad/s" else (values, unit)
    return range_text(values.min(), values.max(), unit)


# -- all of a scene

#: Object of a scene -> function that makes its presentation.
_PRESENTERS: dict[str, Callable[[SceneResults], Presentation]] = {
    **{"history": _present_impact, "fall": _present_fall, "found": _present_found_impact},
    **{
        "batch": _present_sweep,
        "sample": _present_sample,
        "map": _present_map,
        "tradeoff": _present_tradeoff,
    },
}


def presentations(results: SceneResults) -> list[Presentation]:
    """All presentations of a scene: first structure and model, then each result."""
    present = (make for name, make in _PRESENTERS.items() if getattr(results, name) is not None)
    return [_present_model(results), *(make(results) for make in present)]


def short_text(results: SceneResults, parts: Sequence[Presentation]) -> str:
    """The short text for the terminal: answers, a few rows and cautions.

    Results without answers have the text of `long_text`. `parts`: from `presentations`.
    """
    first = next((part for part in parts if part.cards), None)
    if first is None:
        return long_text(results, parts[1:])
    told = cards.listed_cautions(first.caution, results.warnings)[: cards.MAX_CAUTIONS]
    rows = first.answers[: len(first.cards) + cards.MAX_ROWS]
    title = str(results.compiled.document.data.get("title", ""))
    return "\n".join([*filter(None, [title]), format_rows(rows), *told])


def long_text(results: SceneResults, parts: Sequence[Presentation]) -> str:
    """The long text for the terminal: title, warnings that question numbers, results, model."""
    warnings = (
        f"warning: {one}" for one in sorted_by_weight(results.warnings) if not message_weight(one)
    )
    in_order = sorted(
        parts, key=lambda part: MODEL_HEADING in part.sections
    )  # the answers stand first
    title = str(results.compiled.document.data.get("title", ""))
    pieces = [title, *warnings, *(piece for part in in_order for piece in part.text)]
    return "\n\n".join(filter(None, pieces))
