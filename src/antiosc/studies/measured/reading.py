"""`read_frf`: measured frequency responses from a file."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array, ComplexArray
from antiosc.base.errors import AntioscError, InputError
from antiosc.base.files import check_readable
from antiosc.studies.measured import uff
from antiosc.studies.measured.frf import AVERAGES, FRF, Quantity, stated

#: Columns of a table, by the beginning of their names.
COLUMNS = {
    "f": "frequency", "hz": "frequency", "re": "real", "im": "imag", "mag": "magnitude",
    "abs": "magnitude", "amp": "magnitude", "pha": "phase", "coh": "coherence", "gam": "coherence",
    "sig": "sigma", "std": "sigma", "t": "time", "force": "force",
}  # fmt: skip
#: Columns of a table without a header.
DEFAULT = ["frequency", "real", "imag", "coherence"]


@checks.within_range
def read_frf(
    path: str | os.PathLike[str],
    site: str | int | Mapping[str, str | int] | None = None,
    *,
    quantity: Quantity | None = None,
    unit: float | None = None,
    averages: int = AVERAGES,
) -> FRF:
    """Measured frequency response functions from a file.

    Parameters
    ----------
    path : str or Path
        ``.uff``, ``.unv`` or ``.58``: universal files, data sets 58 and 58b (needs pyuff).
        ``.npz``: arrays `frequency`, `values`, and perhaps `coherence`, `sigma`, `quantity`.
        Anything else: a table of columns in text. Its header names them by words that begin with f
        or Hz (frequency in Hz), re and im, or mag, abs or amp and pha (degrees or rad), and perhaps
        coh or gam (coherence), sig or std (sigma); without a header frequency, real, imag,
        coherence.
    site : str, int or {name: str or int}, optional
        Universal files: the site by its entity name, node or node and axis ("12", "12z"); several
        by names of one's own. None: the one driving point in the file.
    quantity : "receptance", "mobility" or "accelerance", optional
        Of tables and arrays; universal files tell it.
    unit : float, optional
        Factor of the values to m/N, m/(s N) or m/(s^2 N); default 1, in universal files what their
        labels, or data set 164, tell.
    averages : int
        Number of averages of the coherence.

    Returns
    -------
    FRF

    Raises
    ------
    InputError
        A file that is missing, cut, damaged or holds no such measurement, in one sentence.
    MissingDependencyError
        A universal file without pyuff.
    """
    where = checks.path("path", path)
    if quantity is not None:
        checks.choice("quantity", quantity, get_args(Quantity))
    factor = 1.0 if unit is None else checks.positive("unit", unit)
    averages = checks.whole("averages", averages)
    ending = where.suffix.lower()
    try:
        check_readable(where, "a measurement")
        if ending in (".uff", ".unv", ".58"):
            found = uff.functions(where)
            return uff.chosen(found, site, quantity, unit, averages)
        if site is not None:
            raise InputError("site belongs to universal files; a table has one driving point.")
        columns = _arrays(where) if ending == ".npz" else table(where, DEFAULT)
        return _of_columns(columns, quantity, factor, averages)
    except AntioscError as error:
        if where.name in str(error):
            raise
        raise type(error)(f"{where.name}: {error}") from error


def _of_columns(
    columns: Mapping[str, Any], quantity: Quantity | None, factor: float, averages: int
) -> FRF:
    """An FRF of named arrays."""
    quantity = stated(quantity or columns.get("quantity"))
    known = set(columns)
    values: ComplexArray
    if "values" in known:
        values = checks.spectrum("values", columns["values"]).astype(complex)
    elif {"real", "imag"} <= known:
        values = columns["real"] + 1j * columns["imag"]
    elif {"magnitude", "phase"} <= known:
        turn = columns["phase"]
        in_degrees = columns.get("degrees", np.abs(turn).max(initial=0.0) > 2 * np.pi)
        values = columns["magnitude"] * np.exp(1j * (np.radians(turn) if in_degrees else turn))
    else:
        raise _missing("real and imag, or magnitude and phase", known)
    if "frequency" not in known:
        raise _missing("frequencies [Hz]", known)
    more = {name: columns[name] for name in ("coherence", "sigma") if name in known}
    if "sigma" in more:
        more["sigma"] = factor * more["sigma"]
    return FRF(columns["frequency"], factor * values, quantity, averages=averages, **more)


def _missing(what: str, known: set[str]) -> InputError:
    """The error for a table without what a measurement needs."""
    begins: dict[str, list[str]] = {}
    for key, name in COLUMNS.items():
        begins.setdefault(name, []).append(key)
    names = ("frequency", "real", "imag", "magnitude", "phase", "coherence", "sigma")
    listed = ", ".join(f"{name} ({', '.join(begins[name])}…)" for name in names)
    return InputError(
        f"the table has no column of {what}, only of {', '.join(sorted(known)) or 'nothing'}. Name"
        f" the columns in the header, by these beginnings: {listed}."
    )


def _arrays(path: Path) -> dict[str, Any]:
    """The arrays of a NumPy file."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            found: dict[str, Any] = {name: file[name] for name in file.files}
    except Exception as error:  # damaged archives raise what they like
        raise InputError(f"{path.name} is no sound NumPy file of arrays.") from error
    if "quantity" in found:
        found["quantity"] = str(found["quantity"])
    return found


def table(path: Path, default: list[str]) -> dict[str, Array]:
    """The columns of a table in text by name; `default`: names where it has no header."""
    header, values = rows_of(path)
    names = [_column(name) for name in header]
    if len(names) != values.shape[1] or not any(names):
        names, header = [*default[: values.shape[1]], *[""] * values.shape[1]], []
    found = {name: values[:, i] for i, name in enumerate(names[: values.shape[1]]) if name}
    for name in header:
        if _column(name) == "phase" and re.search("deg|rad|°", name.lower()):
            found["degrees"] = np.array("rad" not in name.lower())
    return found


def rows_of(path: Path) -> tuple[list[str], Array]:
    """The header of a table in text, and its numbers (rows, columns)."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is no table in text (UTF-8).") from error
    rows: list[list[float]] = []
    header: list[str] = []
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        cells = _cells(text)
        numbers = _numbers(cells)
        if numbers is None and rows and text and not text.startswith("#"):
            raise InputError(
                f"line {number} of {path.name} is no row of numbers: {checks.shown(text)}."
            )
        if numbers is None:
            header = _cells(text.lstrip("#%/ ")) or header
            continue
        if rows and len(numbers) != len(rows[0]):
            raise InputError(
                f"line {number} of {path.name} has {len(numbers)} columns, the first has"
                f" {len(rows[0])}: the file is cut or mixed."
            )
        rows.append(numbers)
    if not rows:
        raise InputError(f"{path.name} holds no row of numbers.")
    return header, np.array(rows)


def _cells(text: str) -> list[str]:
    """The cells of a row: between semicolons, tabs, commas or blanks."""
    for mark in (";", "\t", ","):
        if mark in text:
            cells = [cell.strip() for cell in text.split(mark)]
            return [cell.replace(",", ".") for cell in cells] if mark != "," else cells
    return text.split()


def _numbers(cells: list[str]) -> list[float] | None:
    try:
        return [float(cell) for cell in cells] or None
    except ValueError:
        return None


def _column(name: str) -> str:
    """What a column holds, by the longest beginning that fits; "" where unknown."""
    plain = name.strip().lower()
    fits = [key for key in COLUMNS if plain.startswith(key)]
    return COLUMNS[max(fits, key=len)] if fits else ""
