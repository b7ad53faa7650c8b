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

from antiosc.app import info
from antiosc.app.scene_file import result_tables
from antiosc.app.scene_file.outputs import Output
from antiosc.app.scene_file.run import Results, on_first
from antiosc.base import checks, files
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.models.body import places_of
from antiosc.simulation.history import SceneHistory


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
    """Name with unit -> values: the table of the history, and the energies of all bodies."""
    own = {n.replace("[", "(").replace("]", ")"): v for n, v in history.columns().items()}
    energies = ("kinetic", "strain", "contact", "dissipated")
    return own | {f"{name} energy (J)": getattr(history.energy, name) for name in energies}


def probe_columns(found: Results) -> list[tuple[Any, dict[str, Any]]]:
    """Tables of probes with equal times: [(times, {name with component and unit: values})]."""
    groups: list[tuple[Any, dict[str, Any]]] = []
    for name in found.probes:
        asked = found.compiled.probes[name].arguments
        at = np.asarray(asked.get("times", found.history.time), dtype=float).reshape(-1)
        own = _components(found, name)
        equal = next((columns for known, columns in groups if np.array_equal(known, at)), None)
        if equal is None:
            groups.append((at, own))
        else:
            equal.update(own)
    return groups


def _components(found: Results, name: str) -> dict[str, Any]:
    """A scalar, the components of a vector, or the six of a symmetric tensor, as columns."""
    units = result_tables.probe_components(found, name)
    heads = [f"{name} {c}".rstrip() + (f" ({unit})" if unit else "") for c, unit in units.items()]
    return dict(zip(heads, result_tables.probe_columns(found, name).T, strict=True))


# -- numbers


def numbers(history: Any) -> dict[str, Any]:
    """The results of one run as JSON values; SI units."""
    budget = result_tables.error_budget(history)
    bars = {
        name: {cause: getattr(bar, cause) for cause in (*budget.causes, "total")}
        for name, bar in budget.items()
    }
    return history.numbers() | ({"error_budget": bars} if bars else {})


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
        if wanted.fields:
            fields = (found.stresses or {}).items()
            paths += [peak.write(target / f"{name}.vtu") for name, peak in fields]
        if found.worst is not None and wanted.fields:
            paths.append(found.worst.write(target / "worst.vtu"))
        if wanted.plot is not None:
            shown = {"force": found.history, "model": found.model, "map": found.map}
            shown |= {"fall": found.fall, "worst": found.worst, "found": found.found}
            shown |= {"monte_carlo": found.sample, **(found.stresses or {})}
            for name, one in shown.items():
                if hasattr(one, "plot") and not isinstance(one, SceneHistory):
                    paths += _drawn(one.plot, target / f"{name}.{wanted.plot}", told)
        return paths, told

    paths, told = on_first(files_of_first)
    found.warnings.extend(told)
    return [*written, *paths]


def _tables(found: Results) -> list[tuple[str, dict[str, Any]]]:
    tables = []
    if found.history is not None:
        tables.append(("history.csv", history_columns(found.history)))
    for k, (at, columns) in enumerate(probe_columns(found) if found.probes else ()):
        name = f"probes_{k + 1}.csv" if k else "probes.csv"
        tables.append((name, {"time (s)": at, **columns}))
    if found.fall is not None:
        tables.append(("fall.csv", result_tables.fall_columns(found.fall)))
    if found.found is not None:
        tables.append(("force.csv", {"time (s)": found.found.time, "force (N)": found.found.force}))
    if found.batch is not None:
        tables.append(("sweep.csv", result_tables.sweep_columns(found)))
    if found.sample is not None:
        tables.append(("monte_carlo.csv", result_tables.run_columns(found.sample)))
    if found.map is not None:
        several = len(found.map.surfaces()) > 1
        table = {"surface": found.map.names.tolist()} if several else {}
        table |= {f"{axis} (m)": found.map.points[:, k] for k, axis in enumerate("xyz")}
        named = {result_tables.named(n): v for n, v in found.map.quantities().items()}
        tables.append(("map.csv", table | named))
    return tables


def _numbers_of(found: Results) -> dict[str, Any]:
    content: dict[str, Any] = {"title": found.compiled.title, "warnings": found.warnings}
    if found.structure is not None:
        content["structure"] = found.structure.describe()
    if found.model is not None:
        content["model"] = model_numbers(found.model)
    if found.history is not None:
        content["result"] = numbers(found.history)
        content["probes"] = {n: result_tables.probe_peak(found, n) for n in found.probes or {}}
        content["stress"] = result_tables.stress_numbers(found)
    if found.fall is not None:
        content["fall"] = result_tables.fall_columns(found.fall)
        content["fall"] |= {"status": getattr(found.fall, "status", "")}
        content["accelerometers"] = {
            n: vars(p) | {"g": p.g} for n, p in (found.peaks or {}).items()
        }
    if found.worst is not None:
        content["worst"] = {found.worst.quantity: float(found.worst.values.max())}
    if found.found is not None:
        content["found"] = found.found.numbers()
    if found.batch is not None:
        content["sweep"] = result_tables.sweep_columns(found)
    if found.sample is not None:
        content["monte_carlo"] = result_tables.sample_columns(found.sample)
    if found.map is not None:
        content["map"] = {"points": found.map.points, "surface": found.map.names.tolist()}
        content["map"] |= found.map.quantities() | {"doubtful": found.map.doubtful}
    return content


def _drawn(draw: Callable[[Path], Any], path: Path, told: list[str]) -> list[Path]:
    """Draw a picture; if that fails, a warning says so and the other files are still written."""
    try:
        draw(path)
    except (InputError, MissingDependencyError) as error:
        told.append(f"{path.name} is not drawn: {error}")
        return []
    return [path]
