"""The results of a scene as names with values and as tables, for the terminal, files and pages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from antiosc.app.scene_file.run import Results
from antiosc.base._types import Array
from antiosc.base.engineering import engineering, place as placed, prefixed, span
from antiosc.base.errors import AntioscError
from antiosc.models.body import places_of
from antiosc.simulation.history import SceneHistory
from antiosc.simulation.named_impactors import GRAVITY
from antiosc.studies.map_results import hardest

#: Names and values.
Rows = list[tuple[str, str]]
#: Rows of a table of a sweep that are printed; the files hold all.
ROWS = 30
#: Units of what a probe tells.
PROBE_UNITS = {
    **{"displacement": "m", "velocity": "m/s", "acceleration": "m/s²", "rotation": "rad"},
    **{"stress": "Pa", "von_mises": "Pa"},
}
#: Vectors, whose magnitude is told; section forces with their units, by their number.
VECTORS = ("displacement", "velocity", "acceleration", "rotation")
SECTION_FORCES = {
    1: {"N": "N"},
    3: {"N": "N", "V": "N", "M": "N m"},
    6: {"N": "N", "Vy": "N", "Vz": "N", "T": "N m", "My": "N m", "Mz": "N m"},
    8: dict.fromkeys(("N1", "N2", "N12"), "N/m")
    | dict.fromkeys(("M1", "M2", "M12"), "N m/m")
    | dict.fromkeys(("Q1", "Q2"), "N/m"),
}
#: Quantities of an ensemble of falls or impacts with their units, and quantiles that are told.
FALL_UNITS = {"peak_force": "N", "impulse": "N s", "contact_time": "s", "lost": "J"}
SAMPLE_UNITS = {"peak_force": "N", "impulse": "N s", "contact_time": "s"}
QUANTILES = (0.5, 0.9, 0.99)
#: Units of the quantities of a map.
MAP_UNITS = {
    **{"k0": "N/m", "m_st": "kg", "omega_1": "rad/s", "peak_force": "N", "contact_time": "s"},
    **{"impulse": "N s", "peak_deflection": "m", "peak_stress": "Pa"},
}


def text(found: Results) -> str:
    """Title, structure, model, and what the simulation, the sweep or the map found."""
    pieces = [found.compiled.title]
    if found.structure is not None:
        pieces.append(found.structure.describe())
    if found.model is not None:
        pieces.append(lines(model_rows(found.model)))
    if found.history is not None:
        pieces += [found.history.summary(), str(error_budget(found.history) or "")]
        pieces.append(lines([*probe_rows(found), *stress_rows(found)]))
    if found.fall is not None:
        pieces += [fall_text(found.fall), lines(fall_rows(found))]
    if found.found is not None:
        pieces.append(found.found.summary())
    if found.batch is not None:
        pieces.append(columns(sweep_columns(found)))
    if found.sample is not None:
        pieces.append(columns(sample_columns(found.sample)))
    if found.map is not None:
        pieces.append(lines(map_rows(found.map)))
    return "\n\n".join(piece for piece in pieces if piece)


def lines(rows: Rows) -> str:
    """Names and values in two columns."""
    width = max((len(name) for name, _ in rows), default=0)
    return "\n".join(f"{name:<{width}}  {value}".rstrip() for name, value in rows)


def columns(table: Mapping[str, Any]) -> str:
    """A table with a line of names; of long ones the first rows; units with prefixes."""
    own = with_prefixes(table)
    rows = list(zip(*own.values(), strict=True))
    cells = [list(own), *([shown(value) for value in row] for row in rows[:ROWS])]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    pairs = [zip(row, widths, strict=True) for row in cells]
    told = ["  ".join(f"{cell:>{width}}" for cell, width in row).rstrip() for row in pairs]
    if len(rows) > ROWS:
        told.append(f"… and {len(rows) - ROWS} more rows (see sweep.csv)")
    return "\n".join(told)


def with_prefixes(table: Mapping[str, Any]) -> dict[str, list[Any]]:
    """The columns of a table, values with units in the prefix that suits the largest."""
    return dict(_column(name, list(values)) for name, values in table.items())


def _column(name: str, values: list[Any]) -> tuple[str, list[Any]]:
    """A column whose name ends with its unit, as "contact time (s)", in (µs) where that fits."""
    title, _, unit = name.partition(" (")
    numbers = [float(v) for v in values if isinstance(v, float | np.floating) and np.isfinite(v)]
    if not unit or len(numbers) < len(values):
        return name, values
    factor, own = prefixed(max(map(abs, numbers), default=0.0), unit.rstrip(")"))
    return f"{title} ({own})", [factor * v for v in values]


def shown(value: Any) -> str:
    """A number to five digits; a dash for one that is not finite."""
    if isinstance(value, float | np.floating):
        return f"{value:.5g}" if np.isfinite(value) else "–"
    return str(value)


def contacts_of(history: Any) -> dict[tuple[str, str], Any]:
    """The contacts of a scene of several, by their ends; none of a single impact."""
    if not isinstance(history, SceneHistory):
        return {}
    ends = [(contact.a, contact.b) for contact in history.assembly.scene.contacts]
    return {pair: history[pair] for pair in ends}


def model_rows(model: Any) -> Rows:
    """The parameters of the reduced model."""
    rows = [(f"site {name}".rstrip(), placed(point)) for name, point in places_of(model).items()]
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


def error_budget(history: Any) -> Any:
    """The error budget of a history; empty where it has none."""
    try:
        budget = getattr(history, "error_budget", None)
    except AntioscError:  # the model was not extracted for it
        return {}
    return budget if isinstance(budget, Mapping) else {}


def probe_components(found: Results, name: str) -> dict[str, str]:
    """The components of a probe with their units, one for each column; "" of a scalar."""
    quantity = found.compiled.probes[name].arguments.get("quantity", "displacement")
    values, unit = np.asarray(found.probes[name]), PROBE_UNITS.get(quantity, "")
    if values.ndim == 1:
        return {"": unit}
    if values.ndim == 3:
        upper = zip(*np.triu_indices(values.shape[1]), strict=True)
        return {f"{'xyz'[i]}{'xyz'[j]}": unit for i, j in upper}
    count = values.shape[1]
    if quantity == "section_forces":
        return SECTION_FORCES[count]
    return dict.fromkeys("z" if (quantity, count) == ("rotation", 1) else "xyz"[:count], unit)


def probe_columns(found: Results, name: str) -> Array:
    """Components (n, c) of a probe over time; six of a symmetric tensor."""
    values = np.asarray(found.probes[name])
    if values.ndim == 3:
        return np.asarray(values[:, *np.triu_indices(values.shape[1])])
    return values.reshape(len(values), -1)


def probe_peak(found: Results, name: str) -> dict[str, Any]:
    """The largest value of a probe: of a vector its magnitude; else of one component.

    Keys: quantity, component ("magnitude", "" of a scalar), value, unit, time, of an acceleration
    also g.
    """
    asked = found.compiled.probes[name].arguments
    quantity = asked.get("quantity", "displacement")
    values, units = probe_columns(found, name), probe_components(found, name)
    if quantity in VECTORS and len(units) > 1:
        values = np.linalg.norm(values, axis=1)[:, None]
        units = {"magnitude": next(iter(units.values()))}
    at, k = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    times = np.asarray(asked.get("times", found.history.time), dtype=float)
    component, unit = list(units.items())[k]
    peak = {"quantity": quantity, "component": component, "value": float(values[at, k])}
    peak |= {"unit": unit, "time": float(times.reshape(-1)[at])}
    return peak | ({"g": peak["value"] / GRAVITY} if quantity == "acceleration" else {})


def probe_rows(found: Results) -> Rows:
    """The largest value of each probe with its component and time."""
    rows = []
    for name in found.probes or {}:
        p = probe_peak(found, name)
        what = f"{p['quantity'].replace('_', ' ')} {p['component']}".rstrip()
        value = engineering(p["value"], p["unit"], 4)
        g = f" ({p['g']:.4g} g)" if "g" in p else ""
        time = engineering(p["time"], "s")
        rows.append((f"probe {name}", f"{what}: largest {value}{g} at {time}"))
    return rows


def stress_rows(found: Results) -> Rows:
    """The verdicts on the largest stresses, or the values where no strength is known."""
    rows = []
    for name, peak in (found.stresses or {}).items():
        value, place, time = peak.largest(1)[0]
        told = _largest(value, peak.unit, place, time)
        if peak.exposure is not None:
            told = peak.margin().sentence
        rows.append((name.replace("_", " "), told))
        if peak.mesh_error is not None and value:
            share = peak.mesh_error[np.argmax(peak.values)] / value
            rows.append(("", f"estimated error by the mesh: {share:.1%} of it"))
        if peak.doubt:
            rows.append(("", peak.doubt))
    return rows


def _largest(value: float, unit: str, place: Any, time: float) -> str:
    where = f"at {placed(place)}, {engineering(time, 's')}"
    return f"largest {engineering(value, unit, 4)} {where}"


def stress_numbers(found: Results) -> dict[str, Any]:
    """Quantity -> its largest value with place and time, and the margin; as JSON values."""
    content: dict[str, Any] = {}
    for name, peak in (found.stresses or {}).items():
        value, place, time = peak.largest(1)[0]
        content[name] = {"value": value, "unit": peak.unit, "point": place, "time": time}
        content[name]["doubt"] = peak.doubt
        if peak.mesh_error is not None:
            content[name]["mesh_error"] = peak.mesh_error[np.argmax(peak.values)]
        if peak.exposure is not None:
            worst = peak.margin()
            own = {key: getattr(worst, key) for key in ("criterion", "exposure", "margin")}
            own |= {"reached": worst.reached, "layer": worst.layer, "sentence": worst.sentence}
            content[name]["margin"] = own | {"point": worst.point, "time": worst.time}
    return content


def sweep_columns(found: Results) -> dict[str, Any]:
    """What was varied, and the results of each impact."""
    names = ("peak force (N)", "impulse (N s)", "contact time (s)", "restitution", "contacts")
    keys = (name.partition(" (")[0].replace(" ", "_") for name in (*names, "status"))
    results = (getattr(found.batch, key) for key in keys)
    varied = {name: list(values) for name, values in found.compiled.varied.items()}
    return varied | dict(zip((*names, "status"), results, strict=True))


def fall_text(fall: Any) -> str:
    """The table of the impacts of a fall, or the quantiles of an ensemble."""
    return str(fall.summary()) if hasattr(fall, "summary") else columns(fall_columns(fall))


def fall_columns(fall: Any) -> dict[str, Any]:
    """The impacts of a fall, or quantiles of the largest values of an ensemble of falls."""
    if hasattr(fall, "impacts") and hasattr(fall.impacts, "columns"):
        return dict(fall.impacts.columns())
    return quantile_columns(fall, FALL_UNITS)


def sample_columns(sample: Any) -> dict[str, Any]:
    """Quantiles of a Monte Carlo study."""
    return quantile_columns(sample, SAMPLE_UNITS)


def run_columns(sample: Any) -> dict[str, Any]:
    """The inputs and the results of each of its runs."""
    failed = [sample.failed.get(i, "") for i in range(len(sample))]
    return {**sample.inputs, **sample.values, "error": failed}


def quantile_columns(many: Any, units: Mapping[str, str]) -> dict[str, Any]:
    """Quantiles of some quantities of an ensemble, with their bars."""
    table: dict[str, Any] = {"quantity": [], "quantile": [], "value": [], "low": [], "high": []}
    for name, unit in units.items():
        for q in QUANTILES:
            one = many.quantile(name, q)
            row = (f"{name.replace('_', ' ')} ({unit})", q, one.value, one.low, one.high)
            for column, value in zip(table.values(), row, strict=True):
                column.append(value)
    return table


def fall_rows(found: Results) -> Rows:
    """The peaks of the accelerometers, and the largest stress."""
    rows = [
        (f"accelerometer {name}", f"at most {peak.g:.5g} g, in impact {peak.impact + 1}")
        for name, peak in (found.peaks or {}).items()
    ]
    if found.worst is not None:
        value, place, time = found.worst.largest(1)[0]
        told = _largest(value, found.worst.unit, place, time)
        rows.append((found.worst.quantity.replace("_", " "), told))
    return rows


def named(quantity: str) -> str:
    """A quantity of a map with its unit: "peak_force (N)"."""
    return f"{quantity} ({MAP_UNITS[quantity]})" if quantity in MAP_UNITS else quantity


def map_rows(found: Any) -> Rows:
    """The range of each quantity of a map, and the hardest impact of each of several surfaces."""
    rows = [("sites", f"{len(found)}" + (f", {found.skipped} left out" if found.skipped else ""))]
    for name, values in found.quantities().items():
        known = values[np.isfinite(values)]
        if known.size:
            unit = MAP_UNITS.get(name, "")
            rows.append((name.replace("_", " "), span(known.min(), known.max(), unit)))
    surfaces = found.surfaces()
    for name, own in surfaces.items() if len(surfaces) > 1 else ():
        text = f"{len(own)} sites"
        if found.peak_force is not None:
            i = hardest(found, own)
            force = engineering(found.peak_force[i], "N", 4)
            text += f", at most {force} at {placed(found.points[i])}"
        rows.append((name, text))
    return rows
