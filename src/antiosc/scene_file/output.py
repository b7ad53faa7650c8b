"""The files of a run: tables for a spreadsheet, numbers for a program, pictures, fields."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from antiosc import checks, files, info
from antiosc.errors import InputError, MissingDependencyError
from antiosc.models.body import places_of
from antiosc.scene_file import result_tables
from antiosc.scene_file.outputs import Output
from antiosc.scene_file.run import Results, on_first
from antiosc.simulation.error_bars import CAUSES
from antiosc.simulation.results import covers

#: What a history of one impact records, and its units.
_UNITS = {
    **{"force": "N", "indentation": "m", "displacement": "m", "velocity": "m/s"},
    **{"impactor displacement": "m", "impactor velocity": "m/s"},
}


def folder(path: str | os.PathLike[str]) -> Path:
    """The folder of the results, made where it is missing."""
    target = checks.path("--out", path)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make the folder {str(target)!r} for the results: {error.strerror}."
        ) from None
    return target


# -- tables


def write_table(path: Path, columns: Mapping[str, Sequence[Any]]) -> Path:
    """A CSV file whose first line has names and units; complete or absent."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(files.table_text, columns))
    writer.writerows([_cell(entry) for entry in row] for row in zip(*columns.values(), strict=True))
    files.write_text(path, stream.getvalue(), "the table")
    return path


def _cell(value: Any) -> Any:
    """Floats with all their digits; nothing for NaN; texts that are no formulas."""
    if isinstance(value, float | np.floating):
        return "" if math.isnan(value) else repr(float(value))
    return files.table_text(value) if isinstance(value, str) else value


def history_columns(history: Any) -> dict[str, Any]:
    """Name with unit -> values, of one impact or of several contacts."""
    columns = {"time (s)": history.time}
    contacts = result_tables.contacts_of(history)
    for (a, b), contact in contacts.items():
        columns[f"force {a} {b} (N)"] = contact.force
        columns[f"indentation {a} {b} (m)"] = contact.indentation
        for k in range(contact.friction.shape[1]):
            columns[f"friction {k + 1} {a} {b} (N)"] = contact.friction[:, k]
    units = {} if contacts else _UNITS
    columns |= {
        f"{name} ({u})": getattr(history, name.replace(" ", "_")) for name, u in units.items()
    }
    energies = ("kinetic", "strain", "contact", "dissipated")
    return columns | {f"{name} energy (J)": getattr(history.energy, name) for name in energies}


def probe_columns(found: Results) -> list[tuple[Any, dict[str, Any]]]:
    """Tables of probes with equal times: [(times, {name with component and unit: values})]."""
    groups: list[tuple[Any, dict[str, Any]]] = []
    for name, values in found.probes.items():
        asked = found.compiled.probes[name].arguments
        at = np.asarray(asked.get("times", found.history.time), dtype=float).reshape(-1)
        own = _components(name, np.asarray(values), result_tables.probe_unit(found, name))
        equal = next((columns for known, columns in groups if np.array_equal(known, at)), None)
        if equal is None:
            groups.append((at, own))
        else:
            equal.update(own)
    return groups


def _components(name: str, values: Any, unit: str) -> dict[str, Any]:
    """A scalar, the components of a vector, or the six of a symmetric tensor, as columns."""
    shown = f" ({unit})" if unit else ""
    if values.ndim == 1:
        return {name + shown: values}
    if values.ndim == 3:
        upper = np.triu_indices(values.shape[1])
        axes, values = (
            [f"{'xyz'[i]}{'xyz'[j]}" for i, j in zip(*upper, strict=True)],
            values[:, *upper],
        )
    else:
        count = values.shape[1]
        axes = list("xyz"[:count]) if count <= 3 else [str(k + 1) for k in range(count)]
    return {f"{name} {axis}{shown}": values[:, k] for k, axis in enumerate(axes)}


# -- numbers


def numbers(history: Any) -> dict[str, Any]:
    """The results of one run as JSON values; SI units."""
    found: dict[str, Any] = {
        "status": history.status,
        "message": history.message,
        "error": history.error,
        "error_covers": covers(history),
        "energy_drift": history.energy.drift,
    }
    budget = result_tables.error_budget(history)
    if budget:
        causes = (*CAUSES, "total")
        found["error_budget"] = {
            name: {cause: getattr(bar, cause) for cause in causes} for name, bar in budget.items()
        }
    contacts = result_tables.contacts_of(history)
    if contacts:
        found["contacts"] = {f"{a} {b}": _contact(one) for (a, b), one in contacts.items()}
    else:
        found |= _contact(history) | {"restitution": history.restitution, "step": history.step}
    return found


def _contact(one: Any) -> dict[str, Any]:
    names = ("peak_force", "impulse", "contact_time", "contacts")
    return {name: getattr(one, name) for name in names}


def model_numbers(model: Any) -> dict[str, Any]:
    """The parameters of a reduced model as JSON values; SI units."""
    names = ("k0", "m0", "m_st", "omega", "m", "P", "sites")
    return {name: getattr(model, name, None) for name in names} | {"points": places_of(model)}


def write_numbers(path: Path, content: Mapping[str, Any]) -> Path:
    """A JSON file; NaN and infinity become null."""
    head = {"antiosc": info.version(), "units": "SI"}
    text = json.dumps(_plain({**head, **content}), indent=1, allow_nan=False)
    files.write_text(path, text + "\n", "the numbers")
    return path


def _plain(value: Any) -> Any:
    """A value of JSON."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


# -- all files of a run


def write(found: Results, target: Path) -> list[Path]:
    """The files that the scene asks for, written on the first rank; their paths."""
    asked = found.compiled.output
    wanted = Output() if asked is None else asked.made
    written: list[Path] = []
    if wanted.fields and found.history is not None and found.structure is not None:
        import antiosc

        path = antiosc.write_series(found.structure, found.history, target / "series.pvd")
        written.append(Path(path))
    # what structures tell is asked on every rank, and written on the first
    tables = _tables(found) if wanted.csv else []
    content = _numbers_of(found) if wanted.json else {}

    def files_of_first() -> tuple[list[Path], list[str]]:
        told: list[str] = []
        paths = [write_table(target / name, table) for name, table in tables]
        if wanted.json:
            paths.append(write_numbers(target / "result.json", content))
        if wanted.model and found.model is not None:
            found.model.save(target / "model.npz")
            paths.append(target / "model.npz")
        if found.map is not None and wanted.fields:
            paths.append(found.map.write(target / "map.vtu"))
        if wanted.plot is not None:
            for name, draw in _pictures(found):
                paths += _drawn(draw, target / f"{name}.{wanted.plot}", told)
        return paths, told

    paths, told = on_first(files_of_first)
    found.warnings.extend(told)
    return [*written, *paths]


def _tables(found: Results) -> list[tuple[str, dict[str, Any]]]:
    tables = []
    if found.history is not None:
        tables.append(("history.csv", history_columns(found.history)))
    if found.probes:
        for k, (at, columns) in enumerate(probe_columns(found)):
            name = "probes.csv" if k == 0 else f"probes_{k + 1}.csv"
            tables.append((name, {"time (s)": at, **columns}))
    if found.batch is not None:
        tables.append(("sweep.csv", result_tables.sweep_columns(found)))
    if found.map is not None:
        points = {f"{axis} (m)": found.map.points[:, k] for k, axis in enumerate("xyz")}
        if len(found.map.surfaces()) > 1:
            points = {"surface": found.map.names.tolist(), **points}
        named = {result_tables.named(n): v for n, v in found.map.quantities().items()}
        tables.append(("map.csv", points | named))
    return tables


def _numbers_of(found: Results) -> dict[str, Any]:
    content: dict[str, Any] = {"title": found.compiled.title, "warnings": found.warnings}
    if found.structure is not None:
        content["structure"] = found.structure.describe()
    if found.model is not None:
        content["model"] = model_numbers(found.model)
    if found.history is not None:
        content["result"] = numbers(found.history)
        content["probes"] = {n: float(np.abs(v).max()) for n, v in (found.probes or {}).items()}
    if found.batch is not None:
        content["sweep"] = result_tables.sweep_columns(found)
    if found.map is not None:
        names = found.map.names.tolist()
        content["map"] = {
            "points": found.map.points, "surface": names, **found.map.quantities()
        }  # fmt: skip
    return content


def _pictures(found: Results) -> list[tuple[str, Callable[[Path], Any]]]:
    pictures: list[tuple[str, Callable[[Path], Any]]] = []
    if found.history is not None and hasattr(found.history, "plot"):
        pictures.append(("force", found.history.plot))
    if found.model is not None:
        pictures.append(("model", found.model.plot))
    if found.map is not None:
        pictures.append(("map", found.map.plot))
    return pictures


def _drawn(draw: Callable[[Path], Any], path: Path, told: list[str]) -> list[Path]:
    """Draw a picture; if that fails, a warning says so and the other files are still written."""
    try:
        draw(path)
    except (InputError, MissingDependencyError) as error:
        told.append(f"{path.name} is not drawn: {error}")
        return []
    return [path]
