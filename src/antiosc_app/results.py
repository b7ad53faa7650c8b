"""The results of a scene, each kind as one `Presentation`: for terminal, files and report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc import AntiOscillators, History, SceneHistory, advise
from antiosc.base._types import Array, IntArray
from antiosc.base.cfc import SHOCK_FILTER
from antiosc.base.errors import AntioscError, InputError, by_weight, weight
from antiosc.base.texts import (
    engineering,
    percent,
    piece_told,
    plain,
    point_text,
    range_text,
    restitution_text,
)
from antiosc.extension import (
    DEFLECTION,
    MAP_QUANTITIES,
    QUANTITIES,
    ErrorBudget,
    doubts_text,
    error_scope,
    hardest,
    trusted,
)
from antiosc.models.body import info_of, site_points
from antiosc.plot.charts import legend_beside, plot_force, plot_model, plot_motion
from antiosc.plotting import plot_deformed, plot_map
from antiosc_app.cards import (
    MOST_CAUTIONS,
    MOST_ROWS,
    bar_of_fall,
    cards_of_fall,
    cards_of_history,
    cautions,
    rows_of_fall,
    rows_of_history,
)
from antiosc_app.falls import headline_of_fall
from antiosc_app.headline import (
    caution_of,
    force_bar,
    judgement,
    largest_share,
    map_cautions,
)
from antiosc_app.presentation import (
    Block,
    Columns,
    Picture,
    Presentation,
    Rows,
    chart,
    curves,
    escaped,
    format_columns,
    format_rows,
    spaced,
    spectrum,
)
from antiosc_app.probes import Probe, draw_signals, files_of, probes_of, without_filter
from antiosc_app.scene_file.document import label
from antiosc_app.scene_file.run import Nominal, SceneResults, error_budget, varied

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from antiosc import Drops, Fall, PeakField, Sample, Structure

#: Views of a part in space: name -> (elevation, azimuth) in degrees; None: the default view.
VIEWS = {"": None, ", from behind": (24.0, 128.0), ", from above": (75.0, -52.0)}
ENERGIES = ("kinetic", "strain", "contact", "dissipated")


# -- the structure and its model


def _model(results: SceneResults) -> Presentation:
    """The structure and its reduced model; a report shows them after the pictures."""
    structure, model = results.structure, results.model
    presentation = Presentation()
    blocks: list[Block] = []
    mass: Rows = [] if structure is None else mass_of(structure)
    if structure is not None:
        presentation.text = [structure.describe(), *([] if model else [format_rows(mass)])]
        presentation.numbers["structure"] = structure.describe()
        with suppress(InputError):  # some matrices do not know it
            presentation.numbers["mass"] = structure.mass
    if model is not None:
        rows = _model_rows(model)
        presentation.text = [*presentation.text, format_rows([*mass, *rows])]
        names = ("k0", "m0", "m_st", "omega", "m", "P", "sites")
        numbers = {name: getattr(model, name, None) for name in names}
        presentation.numbers["model"] = numbers | {"points": site_points(model)}
        presentation.plotted["model"] = model
        blocks.append(rows)
        if np.ndim(model.k0) == 0:
            table: Columns = {"anti-oscillator": range(1, model.n + 1)}
            table |= {"frequency (Hz)": model.omega / (2 * np.pi), "mass (kg)": model.m}
            blocks.append(table | {"stiffness (N/m)": model.k})
        presentation.pictures = [
            chart(
                "Anti-oscillators",
                "Frequency (Hz) and mass of each anti-oscillator: in kg at one site, as share of"
                " the static mass at several.",
                partial(spectrum, model),
            ),
            Picture(
                "Dynamic stiffness",
                "|Z(ω)| (N/m) over frequency (Hz), infinite at the antiresonances, and the share of"
                " the static mass that the anti-oscillators hold.",
                partial(plot_model, model),
                ".svg",
            ),
        ]
    if blocks or structure is not None:
        presentation.sections["Model"] = blocks
    return presentation


def _model_rows(model: AntiOscillators) -> Rows:
    """Rows on the parameters of the reduced model."""
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


def mass_of(structure: Structure) -> Rows:
    """A row with the mass of a part, or why it is not known."""
    try:
        return [("mass", engineering(structure.mass, "kg", 4))]
    except InputError as error:
        return [("mass", f"not known: {error}")]


def advice_of(results: SceneResults) -> Rows:
    """Rows on the structure, and on `advise`'s choice of the family if it has one."""
    if results.structure is None:
        return []
    rows = [("structure", results.structure.describe()), *mass_of(results.structure)]
    if not hasattr(results.impactor, "hertz"):
        return rows
    with suppress(AntioscError):
        advice = advise(results.structure, results.impactor)
        rows += [
            ("sufficient element family", advice.family),
            ("elements suffice up to", engineering(advice.element_size, "m")),
            ("highest relevant frequency", engineering(advice.frequency, "Hz")),
            ("reasons", "; ".join(advice.reasons)),
        ]
    return rows


# -- an impact


def _impact(results: SceneResults) -> Presentation:
    """A history with its probes and its largest stresses."""
    hit = results.history
    peaks = results.stresses or {}
    probes = probes_of(results)
    budget = error_budget(hit)
    columns = {n.replace("[", "(").replace("]", ")"): v for n, v in hit.columns().items()}
    columns |= {f"{name} energy (J)": getattr(hit.energy, name) for name in ENERGIES}
    numbers: Columns = hit.numbers()
    moved: Rows = []
    if budget is not None:
        numbers["error_budget"] = {name: budget.shares(name) for name in budget}
        if budget.no_bar:
            numbers["no_error_bar"] = budget.footnote
        if budget.deflection is not None:
            moved = [("deflection at the site", budget.shown(DEFLECTION, 3))]
    probe_rows = [row for probe in probes for row in probe.rows()]
    stresses = _stress_rows(peaks, force_bar(budget))
    summary = hit.summary()
    if budget is not None:  # its lines have the shares of the force
        shares = budget.causes_text("peak_force")
        summary = "\n".join(row for row in summary.splitlines() if shares not in row)
    accuracy = "\n".join(filter(None, (str(budget or ""), largest_share(budget))))
    single = not isinstance(hit, SceneHistory)
    cards = [card[:2] for card in cards_of_history(hit, budget, peaks)] if single else []
    asked = [probe.fact() for probe in probes]
    answers = [*cards, *asked, *rows_of_history(hit, budget)] if single else []
    shocks = [probe.shock for probe in probes if probe.shock is not None]
    return Presentation(
        text=[
            format_rows(cards),
            caution_of(hit, budget),
            summary,
            accuracy,
            format_rows([*moved, *probe_rows, *stresses]),
        ],
        answers=answers,
        caution=caution_of(hit, budget),
        asked=asked,
        tables={"history.csv": columns, **files_of(probes)},
        numbers={
            "result": numbers,
            "probes": {probe.name: probe.numbers() for probe in probes},
            "stress": _stress_numbers(peaks),
        },
        plotted={
            **({"force": hit} if single else {}),
            **peaks,
            **{f"srs_{k + 1}" if k else "srs": shock for k, shock in enumerate(shocks)},
        },
        fields={f"{name}.vtu": peak.write for name, peak in peaks.items()},
        sections={
            "Results": [
                _facts(hit),
                moved,
                hit.explanation,
                probe_rows,
                [] if single else stresses,
            ],
            "Errors": _errors(hit, budget),
        },
        pictures=_impact_pictures(results, probes),
    )


def _facts(hit: History) -> Block:
    """The numbers of a history, or of each contact of a scene."""
    if contacts := _contacts(hit):
        hits = contacts.values()
        table: Columns = {"contact": [f"{a} – {b}" for a, b in contacts]}
        for name, unit in QUANTITIES.items():
            table[f"{spaced(name)} ({unit})"] = [getattr(contact, name) for contact in hits]
        return table | {"contacts": [len(contact.contacts) for contact in hits]}
    rows = [(spaced(n), engineering(getattr(hit, n), u, 4)) for n, u in QUANTITIES.items()]
    e = "not defined" if hit.restitution is None else restitution_text(hit.restitution, 4)
    return [*rows, ("contacts", hit.count_text), ("coefficient of restitution", e)]


def _errors(hit: History, budget: ErrorBudget | None) -> list[Block]:
    """Blocks on the errors of a history."""
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
        table[spaced(name)] = [engineering(bar.value, QUANTITIES[name], 4), *told]
    return [rows, table, *budget.notes]


def _stress_rows(peaks: Mapping[str, PeakField], force: float | None) -> Rows:
    """Rows with the verdicts on stresses, or the largest values if no strength is known."""
    rows = []
    for name, peak in peaks.items():
        sentence = _largest(peak) if peak.worst_point is None else judgement(peak, force)
        rows.append((spaced(name), sentence))
        if peak.doubt:
            rows.append(("", peak.doubt))
    return rows


def _largest(peak: PeakField) -> str:
    """Text of the largest value of a field, its place and time."""
    value, point, time = peak.largest(1)[0]
    place = f"at {point_text(point)}, {engineering(time, 's')}"
    return f"largest {engineering(value, peak.unit, 4)} {place}"


#: Attributes of a margin among the numbers, and of the worst point where no strength is known.
MARGIN_KEYS = (
    "criterion", "scope", "exposure", "margin", "least_margin", "reached", "contact", "has_bar",
    "layer", "sentence", "point", "time",
)  # fmt: skip
OUTSIDE_KEYS = ("value", "scope", "has_bar", "sentence", "point", "time")


def _stress_numbers(peaks: Mapping[str, PeakField]) -> Columns:
    """Quantity -> its largest value with place and time, and the margin."""
    content: Columns = {}
    for name, peak in peaks.items():
        value, point, time = peak.largest(1)[0]
        content[name] = {"value": value, "unit": peak.unit, "point": point, "time": time}
        content[name] |= {"doubt": peak.doubt, **_margin_numbers(peak)}
        if peak.largest_mesh_error:
            content[name]["mesh_error"] = peak.largest_mesh_error
    return content


def _margin_numbers(peak: PeakField) -> Columns:
    """The margin of a stress field if a strength is known, else its worst point; {} of neither."""
    margin = peak.worst_point
    if margin is None:
        return {}
    if peak.exposure is None:
        return {"outside": {key: getattr(margin, key) for key in OUTSIDE_KEYS}}
    return {"margin": {key: getattr(margin, key) for key in MARGIN_KEYS}}


def _impact_pictures(results: SceneResults, probes: Sequence[Probe]) -> list[Picture]:
    """Pictures of an impact."""
    hit = results.history
    contacts = _contacts(hit)
    if contacts:
        forces = [(f"{a} – {b}", one.time, one.force) for (a, b), one in contacts.items()]
        draw = partial(curves, forces, "contact force (N)")
        pictures = [chart("Contact force", "Force (N) over time.", draw)]
    else:
        pictures = [
            chart(
                "Contact force", "Force (N) over time; its bar as a band.", partial(plot_force, hit)
            ),
            chart(
                "Displacements",
                "Displacements of the site and of the impactor over time.",
                partial(plot_motion, hit),
            ),
        ]
    energies = [(name, hit.time, getattr(hit.energy, name)) for name in ENERGIES]
    caption = "Energies (J) of both bodies, of the contact and of what is dissipated, over time."
    pictures.append(chart("Energies", caption, partial(curves, energies, "energy (J)")))
    if probes:
        caption = (
            "The component of each probe with the largest value; of probes with several units each"
            " is divided by its largest value, which the legend states."
        )
        pictures.append(chart("Probes", caption, partial(draw_signals, probes)))
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
        arrow = _impact_arrow(results.model)
        for name, view in (VIEWS if arrow else {"": None}).items():
            shape = partial(plot_deformed, results.structure, hit, view=view, **arrow)
            heading = f"Deformed structure{name}"
            pictures.append(Picture(heading, caption, shape, same_view=bool(name)))
    for name, peak in (results.stresses or {}).items():
        caption = f"The largest value at each node over the run: {spaced(name)}."
        pictures.append(Picture("Largest stress", caption, peak.plot))
    return pictures


def _impact_arrow(model: AntiOscillators) -> Columns:
    """Point and direction of the only site, for the arrow of the impact; {} if unknown."""
    points = list(site_points(model).values())
    direction = info_of(model).direction
    if len(points) == 1 and len(points[0]) == 3 and direction is not None:
        return {"point": points[0], "direction": direction}
    return {}


def _contacts(history: History) -> dict[tuple[str, str], Any]:
    """The contacts of a scene by their ends; {} for a single impact."""
    if not isinstance(history, SceneHistory):
        return {}
    return {(c.a, c.b): history[c.a, c.b] for c in history.assembly.scene.contacts}


# -- falls


def _fall(results: SceneResults) -> Presentation:
    """A fall or an ensemble of falls, with accelerometers and largest stress."""
    fall, worst = results.fall, results.worst
    single = hasattr(fall, "flights")
    table = fall_table(fall) if single else quantiles(fall, FALLS)
    rows: Rows = [] if single else [("contact", f"yields in {fall.yields.sum()} of {len(fall)}")]
    scene = {} if results.compiled is None else results.compiled.document.data
    accelerometers = scene.get("accelerometers", {})
    for name, peak in (results.peaks or {}).items():
        through = accelerometers.get(name, {}).get("filter", "unfiltered")
        told = f"at most {plain(peak.g, 4)} g ({through}), in impact {peak.impact + 1}"
        if through != "unfiltered":
            raw = without_filter(results, results.compiled.peaks[name])
            told += f", {plain(raw.g, 4)} g unfiltered"
        rows.append((f"accelerometer {name}", told))
    numbers: Columns = {"fall": table | {"status": fall.status, "message": fall.message}}
    numbers["accelerometers"] = {
        name: vars(peak) | {"g": peak.g} for name, peak in (results.peaks or {}).items()
    }
    pictures = []
    if single:
        caption = (
            "The part as it first touches, the heights (m), the energies (J) and the peak forces of"
            " the impacts (N)."
        )
        pictures.append(Picture("Fall", caption, fall.plot))
    shown = list(rows)  # the verdict is in the headline of a report
    if worst is not None:
        rows += _stress_rows({worst.quantity: worst}, bar_of_fall(fall, worst))
        numbers["worst"] = {worst.quantity: float(worst.values.max())} | _margin_numbers(worst)
        caption = "The largest value at each node over all impacts."
        pictures.append(Picture("Largest stress", caption, worst.plot))
    cards = [card[:2] for card in cards_of_fall(fall, worst)] if single else []
    return Presentation(
        answers=[*cards, *shown, *rows_of_fall(fall)] if single else [],
        caution=headline_of_fall(fall, worst).caution if single else "",
        text=[
            format_rows(cards),
            fall.summary() if single else format_columns(table),
            format_rows(rows),
        ],
        tables={"fall.csv": table},
        numbers=numbers,
        plotted={"fall": fall, "worst": worst},
        fields={} if worst is None else {"worst.vtu": worst.write},
        sections={"Fall": [table, shown, f"The fall ended: {fall.message}."]},
        pictures=pictures,
    )


def fall_table(fall: Fall) -> Columns:
    """The impacts of a fall, with the deepest dent and the shock of the part in each."""
    shocks = np.array([one.g for one in fall.shocks])
    columns: Columns = {"impact": np.arange(1, len(fall.impacts) + 1), **fall.impacts.columns()}
    columns["± by law (%)"] = 100 * fall.impacts.column("law_error")
    return columns | {"dent (m)": fall.dents, f"centre of mass in g, {SHOCK_FILTER}": shocks}


# -- studies

#: Quantities of an ensemble of falls, and their units.
FALLS = QUANTITIES | {"lost": "J"}
#: Units of values that sweeps vary, by the last word of their names.
SWEPT_UNITS = {
    **{"velocity": "m/s", "mass": "kg", "rho": "kg/m³", "duration": "s"},
    **dict.fromkeys(("radius", "tip_radius", "thickness"), "m"),
    **dict.fromkeys(("E", "yield_strength"), "Pa"),
}
#: Before the errors and verdicts of a study.
OWN_IMPACT = "Errors, stresses and verdicts are those of the scene's own impact:"


def quantiles(ensemble: Sample | Drops, units: Mapping[str, str]) -> Columns:
    """Quantiles of an ensemble with the bars of the number of its runs."""
    names = ("quantity", "quantile", "value", "low", "high")
    rows = []
    for name, unit in units.items():
        for q in ensemble.quantiles:
            found = ensemble.quantile(name, q)
            rows.append((f"{spaced(name)} ({unit})", q, found.value, found.low, found.high))
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def _own_rows(nominal: Nominal | None) -> Rows:
    """The error bars of a study's run without varied values, its contact and its stress."""
    if nominal is None:
        return []
    budget = error_budget(nominal.hit)
    lines = (caution_of(nominal.hit, budget) or str(budget)).splitlines()
    rows = [("" if i else "errors", line) for i, line in enumerate(lines)]
    rows += [("contact", nominal.hit.verdict)] if nominal.hit.verdict else []
    return rows + _stress_rows(nominal.fields, force_bar(budget))


def _own_numbers(nominal: Nominal | None) -> Columns:
    """The numbers of a study's run without varied values; {} if there is none."""
    if nominal is None:
        return {}
    of_run = {"result": nominal.hit.numbers(), "stress": _stress_numbers(nominal.fields)}
    return {"nominal": of_run}


def _sweep(results: SceneResults) -> Presentation:
    """A sweep: the varied values, and the results of each impact with the bar of its force."""
    batch = results.batch
    values = {label(place): list(given) for place, given in varied(results.compiled).items()}
    table: Columns = dict(values)
    bars = [budget and budget.shares("peak_force")["total"] for budget in results.facts]
    for name, unit in QUANTITIES.items():
        table[f"{spaced(name)} ({unit})"] = getattr(batch, name)
        if name == "peak_force" and any(bar is not None for bar in bars):
            given = any(budget and budget.law for budget in results.facts)
            table["± without the law (%)" if given else "± (%)"] = 100 * np.array(bars, dtype=float)
    table |= {name: getattr(batch, name) for name in ("restitution", "contacts", "status")}
    own = _own_rows(results.nominal)
    shown: Columns = {with_unit(name): given for name, given in table.items()}
    verdict: list[Block] = [OWN_IMPACT, own] if own else []
    caption = "Peak force (N) of each impact, over the first value that varies"
    caption += ", a line for each combination of the others." if len(values) > 1 else "."
    return Presentation(
        text=[format_columns(table), *([OWN_IMPACT, format_rows(own)] if own else [])],
        tables={"sweep.csv": table},
        numbers={"sweep": table, **_own_numbers(results.nominal)},
        sections={"Sweep": [shown, *verdict]},
        pictures=[chart("Sweep", caption, partial(_draw_sweep, values, batch.peak_force))],
    )


def _draw_sweep(values: Mapping[str, list[Any]], force: Array, ax: Axes) -> None:
    """Draw the forces of a sweep over its first value."""
    (name, first), *others = values.items()
    numbers = all(isinstance(value, int | float) for value in first)
    x = np.asarray(first if numbers else range(len(first)))
    for told, rows in _lines(others, len(x)).items():
        rows = rows[np.argsort(x[rows], kind="stable")]
        ax.plot(x[rows], force[rows], "o-", ms=4, lw=1, label=escaped(told) or None)
    if others:
        ax.legend(fontsize="small")
    ax.set_xlabel(escaped(with_unit(name)))
    ax.set_ylabel("peak force (N)")


def _lines(others: Sequence[tuple[str, list[object]]], count: int) -> dict[str, IntArray]:
    """Text of the other values of a sweep -> the rows that have them; one line of all rows where
    the values are no grid.
    """
    lines: dict[str, list[int]] = {}
    for row in range(count):
        told = ", ".join(f"{with_unit(name)} {values[row]}" for name, values in others)
        lines.setdefault(told, []).append(row)
    if min(map(len, lines.values())) < 2:  # no grid
        lines = {"": list(range(count))}
    return {told: np.array(rows) for told, rows in lines.items()}


def with_unit(name: str) -> str:
    """The name of a varied value with its unit: "impactor.velocity (m/s)"."""
    unit = SWEPT_UNITS.get(name.rpartition(".")[2])
    return f"{name} ({unit})" if unit else name


def _sample(results: SceneResults) -> Presentation:
    """A Monte Carlo study: quantiles, and inputs and results of each run."""
    sample = results.sample
    table = quantiles(sample, QUANTITIES)
    own = _own_rows(results.nominal)
    failed = [sample.failed.get(i, "") for i in range(len(sample))]
    caption = "Peak forces (N) of the runs, and their quantiles with the bars of their number."
    return Presentation(
        text=[format_columns(table), OWN_IMPACT, format_rows(own)],
        tables={"monte_carlo.csv": {**sample.inputs, **sample.values, "error": failed}},
        numbers={"monte_carlo": table, **_own_numbers(results.nominal)},
        plotted={"monte_carlo": sample},
        sections={"Random values": [table, OWN_IMPACT, own]},
        pictures=[Picture("Random values", caption, sample.plot, ".svg")],
    )


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


def _tradeoff(results: SceneResults) -> Presentation:
    """Methods that were compared for an impact."""
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
    quantities, surfaces = impact_map.quantities(), impact_map.surfaces()
    sites = f"{len(impact_map)}"
    if impact_map.skipped:
        sites += f", {impact_map.skipped} left out"
    if impact_map.doubtful.any():
        sites += f"; {doubts_text(impact_map)}"
    rows = [("sites", sites)]
    labels = {name: MAP_QUANTITIES.get(name, (spaced(name), "")) for name in quantities}
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
            text += f", at most {force} at {point_text(impact_map.points[i])}"
        rows.append((name, text))
    table: Columns = {"surface": impact_map.names.tolist()} if len(surfaces) > 1 else {}
    table |= {f"{axis} (m)": impact_map.points[:, k] for k, axis in enumerate("xyz")}
    for name, values in quantities.items():
        unit = labels[name][1]
        table[f"{name} ({unit})" if unit else name] = values
    numbers = {"points": impact_map.points, "surface": impact_map.names.tolist(), **quantities}
    return Presentation(
        text=[*map_cautions(impact_map), format_rows(rows)],
        tables={"map.csv": table},
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


# -- all of a scene

#: Object of a scene -> function that makes its presentation.
_KINDS: dict[str, Callable[[SceneResults], Presentation]] = {
    **{"history": _impact, "fall": _fall, "found": _blow},
    **{"batch": _sweep, "sample": _sample, "map": _map, "tradeoff": _tradeoff},
}


def presentations(results: SceneResults) -> list[Presentation]:
    """The presentations of a scene: structure with model first, then the results."""
    present = (make for name, make in _KINDS.items() if getattr(results, name) is not None)
    return [_model(results), *(make(results) for make in present)]


#: Number of answers that stand first.
CARDS = 4


def answer(results: SceneResults, parts: Sequence[Presentation]) -> str:
    """The short text: of an impact or a fall its answers, a few rows and cautions."""
    first = next((part for part in parts if part.answers), None)
    if first is None:
        return text(results, parts[1:])
    told = cautions(first.caution, results.warnings)[:MOST_CAUTIONS]
    rows = first.answers[: CARDS + MOST_ROWS]
    return "\n".join([*filter(None, [_title(results)]), format_rows(rows), *told])


def _title(results: SceneResults) -> str:
    """The title of a scene, and which piece of a file is struck."""
    title = str(results.compiled.document.data.get("title", ""))
    return ", ".join(filter(None, (title, piece_told(results.warnings))))


def text(results: SceneResults, parts: Sequence[Presentation]) -> str:
    """Text of title, warnings that question the numbers, results, structure and model."""
    title = _title(results)
    warnings = (f"warning: {one}" for one in by_weight(results.warnings) if not weight(one))
    after = [part for part in parts if "Model" in part.sections]  # the answers stand first
    parts = [*(part for part in parts if part not in after), *after]
    pieces = [title, *warnings, *(piece for part in parts for piece in part.text)]
    return "\n\n".join(filter(None, pieces))
