"""The files of a run: tables for a spreadsheet, numbers for a program, pictures, fields."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import antiosc
from antiosc.app import info
from antiosc.app.report.results import told
from antiosc.app.scene_file.run import Results, on_first
from antiosc.app.scene_file.schema import Output
from antiosc.base import checks, files
from antiosc.base.errors import InputError, MissingDependencyError


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


def write_table(path: Path, columns: Mapping[str, Sequence[object]]) -> Path:
    """A CSV file whose first line has names and units; complete or absent."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(files.table_text, columns))
    writer.writerows([_cell(entry) for entry in row] for row in zip(*columns.values(), strict=True))
    files.write_text(path, stream.getvalue(), "the table")
    return path


def _cell(value: object) -> object:
    """Floats with all their digits; nothing for NaN; texts that are no formulas."""
    if isinstance(value, float | np.floating):
        return "" if math.isnan(value) else repr(float(value))
    return files.table_text(value) if isinstance(value, str) else value


def write_numbers(path: Path, content: Mapping[str, object]) -> Path:
    """A JSON file; NaN and infinity become null."""
    head = {"antiosc": info.version(), "units": "SI"}
    text = json.dumps(_plain({**head, **content}), indent=1, allow_nan=False)
    files.write_text(path, text + "\n", "the numbers")
    return path


def _plain(value: object) -> object:
    """A value of JSON."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def write(found: Results, target: Path) -> list[Path]:
    """The files that the scene asks for, written on the first rank; their paths."""
    asked = found.compiled.output
    wanted = Output() if asked is None else asked.made
    written: list[Path] = []
    if wanted.fields and found.history is not None and found.structure is not None:
        path = antiosc.write_series(found.structure, found.history, target / "series.pvd")
        written.append(Path(path))
    # what structures tell is asked on every rank, and written on the first
    parts = told(found)
    tables = {n: t for one in parts for n, t in one.tables.items()} if wanted.csv else {}
    content: dict[str, object] = {}
    if wanted.json:
        title = found.compiled.document.data.get("title", "")
        content = {"title": title, "warnings": found.warnings}
        content |= {name: value for one in parts for name, value in one.numbers.items()}

    def files_of_first() -> tuple[list[Path], list[str]]:
        warnings: list[str] = []
        paths = [write_table(target / name, table) for name, table in tables.items()]
        if content:
            paths.append(write_numbers(target / "result.json", content))
        if wanted.model and found.model is not None:
            found.model.save(target / "model.npz")
            paths.append(target / "model.npz")
        if wanted.fields:
            writers = ((n, field) for one in parts for n, field in one.fields.items())
            paths += [field(target / name) for name, field in writers]
        shown = ((n, each) for one in parts for n, each in one.plotted.items())
        for name, each in shown if wanted.plot is not None else ():
            path = target / f"{name}.{wanted.plot}"
            try:
                if hasattr(each, "plot"):
                    each.plot(path)
                    paths.append(path)
            except (InputError, MissingDependencyError) as error:
                warnings.append(f"{path.name} is not drawn: {error}")
        return paths, warnings

    paths, warnings = on_first(files_of_first)
    found.warnings.extend(warnings)
    return [*written, *paths]
