"""Results of the probes of a scene: signals, largest values with error bars, spectra."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from antiosc import SceneHistory
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError, without_warnings
from antiosc.base.plausible import GRAVITY
from antiosc.base.texts import engineering, plain_number, point_text, unit_prefix
from antiosc.fields.probe import ProbeError
from antiosc_app.presentation import MAX_CURVES, Columns, Rows, draw_curves, spaced_name
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.run import SceneResults
from antiosc_app.scene_file.scene import place_arguments, probe_times
from antiosc_app.scene_file.shock import ProbeShock

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: Units of the quantities of probes.
QUANTITY_UNITS = {
    "displacement": "m",
    "velocity": "m/s",
    "acceleration": "m/s²",
    "rotation": "rad",
    "stress": "Pa",
    "von_mises": "Pa",
}
#: Number of section forces -> their names and units.
SECTION_FORCE_UNITS = {
    1: {"N": "N"},
    3: {"N": "N", "V": "N", "M": "N m"},
    6: {"N": "N", "Vy": "N", "Vz": "N", "T": "N m", "My": "N m", "Mz": "N m"},
    8: dict.fromkeys(("N1", "N2", "N12"), "N/m")
    | dict.fromkeys(("M1", "M2", "M12"), "N m/m")
    | dict.fromkeys(("Q1", "Q2"), "N/m"),
}


class ProbeResult:
    """Result of one probe: values (n, c) of c components at n times [s], and their error."""

    def __init__(self, results: SceneResults, name: str) -> None:
        call = results.compiled.probes[name]
        given = call.arguments
        self.name = name
        self.shock: ProbeShock | None = results.spectra.get(name)
        self.quantity: str = given.get("quantity", "displacement")
        self.filter: str | None = given.get("filter")
        times = given.get("times", results.history.time)
        times = probe_times(results.history) if isinstance(times, Call) else times
        self.times = np.reshape(times, -1).astype(float)
        values: Array = np.asarray(results.probes[name])
        self.tensor = values.ndim == 3
        if self.tensor:  # the components of a symmetric one
            values = values[:, *np.triu_indices(values.shape[1])]
        self.scalar = values.ndim == 1
        self.values = values.reshape(len(values), -1)
        self.unfiltered = (
            None if self.filter is None else _largest_magnitude(without_filter(results, call))
        )
        self.error = _probe_error(results, call)
        self.point = _probe_point(results, call)

    @property
    def is_vector(self) -> bool:
        """Whether the quantity is a vector; its largest value is then of the magnitude."""
        return self.quantity in QUANTITY_UNITS and not self.tensor and len(self.units()) > 1

    def units(self) -> dict[str, str]:
        """Unit by component ("" for a scalar), in the order of the columns of `values`."""
        unit = QUANTITY_UNITS.get(self.quantity, "")
        count = self.values.shape[1]
        if self.scalar:
            return {"": unit}
        if self.tensor:
            names = "xx xy xz yy yz zz" if count == 6 else "xx xy yy"
            return dict.fromkeys(names.split(), unit)
        if self.quantity == "section_forces":
            return SECTION_FORCE_UNITS[count]
        in_plane = (self.quantity, count) == ("rotation", 1)
        return dict.fromkeys("z" if in_plane else "xyz"[:count], unit)

    def table(self) -> Columns:
        """Heading -> values (n,) of each component, for a CSV file."""
        columns: Columns = {}
        for (component, unit), values in zip(self.units().items(), self.values.T, strict=True):
            told = ", ".join(filter(None, (unit, self.filter)))
            heading = f"{self.name} {component}".rstrip()
            columns[f"{heading} ({told})" if told else heading] = values
        return columns

    def shock_table(self) -> Columns:
        """Heading -> values of the shock response spectrum, by frequency, for a CSV file."""
        assert self.shock is not None
        unit = ", ".join(filter(None, ("m/s²", self.filter)))
        first = next(iter(self.shock.spectra.values()))
        columns: Columns = {"frequency (Hz)": first.frequency}
        for component, spectrum in self.shock.spectra.items():
            columns[f"{self.name} {component} ({unit})"] = spectrum.maximax
        return columns

    def peak(self) -> Columns:
        """The largest value (magnitude of a vector) with time, unit and error, for result.json."""
        values, units, error = self.values, self.units(), self.error
        if self.is_vector:
            values = np.linalg.norm(values, axis=1)[:, None]
            units = {"magnitude": next(iter(units.values()))}
        component, row, value = _largest_component(values, units)
        peak: Columns = {
            "quantity": self.quantity,
            "filter": self.filter,
            "component": component,
            "value": value,
            "unit": units[component],
            "time": float(self.times[row]),
            "unfiltered": self.unfiltered,
            "error": None if error is None or not np.isfinite(error) else float(error),
        }
        for cause in ("truncation", "mesh", "force"):
            peak[cause] = None if error is None else getattr(error, cause)
        if self.quantity == "acceleration":
            peak["g"] = value / GRAVITY
        return peak

    def numbers(self) -> Columns:
        """`peak`, the probe's point [m], and its spectrum's largest values, for result.json."""
        numbers = self.peak()
        if self.point is not None:
            numbers["point"] = self.point
        if self.shock is not None:
            numbers["srs"] = self.shock.numbers()
        return numbers

    def peak_row(self) -> tuple[str, str]:
        """(name, text) of the largest value with its error bar."""
        peak = self.peak()
        name = ", ".join(filter(None, (f"{self.name}: {spaced_name(self.quantity)}", self.filter)))
        bar = "" if self.error is None else f" {self.error}"
        g = f" ({plain_number(peak['g'], 3)} g)" if "g" in peak else ""
        told = f"{engineering(peak['value'], peak['unit'])}{bar}{g}"
        if self.unfiltered is not None:  # the filter may hide a blow
            told += f", {engineering(self.unfiltered, peak['unit'])} unfiltered"
        return name, told

    def rows(self) -> Rows:
        """Rows (name, text) on the time and place of the largest value, and its spectrum."""
        peak = self.peak()
        told = [f"largest {peak['component']}".rstrip() + f" at {engineering(peak['time'], 's')}"]
        if self.point is not None:
            told.append(f"it lies at {point_text(self.point)}")

        rows = [(f"probe {self.name}", "; ".join(told))]
        return rows if self.shock is None else [*rows, ("", self.shock.sentence)]

    def signal(self) -> tuple[str, Array, Array, str]:
        """(name, times, values, unit) of the component with the largest value."""
        k = int(np.argmax(np.abs(self.values).max(axis=0)))
        component, unit = list(self.units().items())[k]
        name = " ".join(filter(None, (self.name, component, self.filter)))
        return name, self.times, self.values[:, k], unit


def probes_of(results: SceneResults) -> list[ProbeResult]:
    """The probes of a scene. All ranks must call it."""
    return [ProbeResult(results, name) for name in results.probes or ()]


def csv_files_of(probes: Sequence[ProbeResult]) -> dict[str, Columns]:
    """Name of a CSV file -> columns; signals at equal times, and spectra at equal frequencies,
    share a file.
    """
    signals = [{"time (s)": probe.times, **probe.table()} for probe in probes]
    spectra = [probe.shock_table() for probe in probes if probe.shock is not None]
    return _merged_tables("probes", signals) | _merged_tables("srs", spectra)


def draw_signals(probes: Sequence[ProbeResult], ax: Axes) -> None:
    """Draw the signals of probes; if their quantities differ, each over its largest value."""
    signals = [probe.signal() for probe in probes[:MAX_CURVES]]
    largest = [float(np.abs(values).max()) for _, _, values, _ in signals]
    kinds = {(probe.quantity, signal[3]) for probe, signal in zip(probes, signals, strict=False)}
    if len(kinds) == 1:
        ((quantity, unit),) = kinds
        factor, scaled = unit_prefix(max(largest), unit)
        series = [(name, time, factor * values) for name, time, values, _ in signals]
        draw_curves(
            series, f"{spaced_name(quantity)} ({scaled})" if scaled else spaced_name(quantity), ax
        )
        return
    shares = [
        (f"{name}, at most {engineering(most, unit)}", time, values / (most or 1.0))
        for (name, time, values, unit), most in zip(signals, largest, strict=True)
    ]
    draw_curves(shares, "share of the largest value", ax)


def _merged_tables(stem: str, tables: Iterable[Columns]) -> dict[str, Columns]:
    """Name of a CSV file, STEM.csv, STEM_2.csv, … -> columns of the tables with the same first
    column.
    """
    files: list[Columns] = []
    for table in tables:
        first = next(iter(table))
        for file in files:
            if np.array_equal(file[first], table[first]):
                file |= table
                break
        else:
            files.append(table)
    return {f"{stem}.csv" if not k else f"{stem}_{k + 1}.csv": x for k, x in enumerate(files)}


def without_filter(results: SceneResults, call: Call) -> Any:
    """The result of a probe's or accelerometer's call without its filter."""
    evaluate = Evaluation(results.compiled.document)
    for name in ("structure", "history", "fall"):
        if getattr(results.compiled, name) is not None:
            evaluate.register(getattr(results.compiled, name), getattr(results, name))
    arguments = {key: value for key, value in call.arguments.items() if key != "filter"}
    return evaluate(replace(call, arguments=arguments))


def _largest_magnitude(values: Any) -> float:
    """The largest magnitude of a signal (n,) or (n, d)."""
    rows = np.asarray(values).reshape(len(values), -1)
    return float(np.linalg.norm(rows, axis=1).max())


def _probe_error(results: SceneResults, call: Call) -> ProbeError | None:
    """The error of a probe's largest value; None if it cannot be estimated."""
    hit = results.history
    if results.structure is None or isinstance(hit, SceneHistory):
        return None
    from antiosc import probe_error  # it needs the finite elements

    evaluate = Evaluation(results.compiled.document)
    evaluate.register(results.compiled.structure, results.structure)
    evaluate.register(results.compiled.history, hit)
    with suppress(AntioscError), without_warnings():
        error: ProbeError = evaluate(replace(call, function=probe_error))
        return error
    return None


def _probe_point(results: SceneResults, call: Call) -> tuple[float, ...] | None:
    """The point [m] of the part at which a probe lies; None if it is not known."""
    if results.structure is None:
        return None
    from antiosc.fields.probe import probed_point

    with suppress(AntioscError):
        x: Any = probed_point(results.structure, **place_arguments(call))
        return None if x is None else tuple(x.tolist())
    return None


def _largest_component(values: Array, names: Iterable[str]) -> tuple[str, int, float]:
    """(component, row, value) of the largest of values (n, c)."""
    row, k = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    return list(names)[k], int(row), float(values[row, k])
