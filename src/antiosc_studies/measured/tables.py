"""Text tables: a line that names the columns, with units in brackets, then rows of numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np

from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import InputError
from antiosc_studies.measured.frf import Quantity

#: Names of the columns of a measurement.
NAMES = (
    "frequency", "real", "imag", "magnitude", "phase", "coherence", "sigma", "time", "force"
)  # fmt: skip
#: Units as `plain` writes them -> factor to SI, and for frequencies to Hz.
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
FREQUENCIES = {"Hz": 1.0, "kHz": 1e3, "rad/s": 0.5 / pi}
FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "lbf": 4.4482216152605}
ANGLES = {"deg": pi / 180, "°": pi / 180, "rad": 1.0}
STRAINS = {"-": 1.0, "m/m": 1.0, "um/m": 1e-6, "µm/m": 1e-6}
#: The same of motions, by the quantity that they are per force.
MOTIONS: dict[Quantity, dict[str, float]] = {
    "receptance": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254},
    "mobility": {"m/s": 1.0, "mm/s": 1e-3, "in/s": 0.0254},
    "accelerance": {"m/s2": 1.0, "mm/s2": 1e-3, "g": 9.80665, "in/s2": 0.0254},
}
#: A name and a unit in brackets.
_CELL = re.compile(r"^(.*?)\s*(?:[\[(](.*)[\])])?$")


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a table: its name and unit in the header, and its numbers."""

    name: str
    unit: str
    values: Array

    def in_si(self, known: Mapping[str, float]) -> Array:
        """The numbers in SI units, frequencies in Hz; InputError for units that are not `known`."""
        if not self.unit:
            return self.values
        if plain(self.unit) not in known:
            raise unknown_unit(self, ", ".join(known))
        return known[plain(self.unit)] * self.values


def unknown_unit(column: Column, known: str) -> InputError:
    """The error for an unknown unit in a header."""
    return InputError(
        f"the unit {checks.shown(column.unit)} of the column {checks.shown(column.name)} is not"
        f" known: write one of {known}, and the numbers in it."
    )


def plain(unit: object) -> str:
    """A unit without blanks, brackets and signs of powers."""
    text = re.sub(r"[\s()\[\]^]|\*\*", "", str(unit or "")).replace("²", "2").replace("μ", "µ")
    return "" if text.lower() in ("none", "unknown") else text


def response_unit(numerator: str, denominator: str = "") -> tuple[float | None, Quantity | None]:
    """(factor to SI, quantity) for the plain unit of a response; None for unknown units."""
    motion, _, force = (
        numerator.rpartition("/") if not denominator else (numerator, "", denominator)
    )
    if force not in FORCES:
        motion, force = numerator, "N"
        if denominator:
            return None, None
    for quantity, units in MOTIONS.items():
        if motion.lower() in units:
            return units[motion.lower()] / FORCES[force], quantity
    return None, None


def table(path: Path) -> dict[str, Column]:
    """The columns of a table by their names; InputError if none has a name of `NAMES`."""
    found = {column.name.lower(): column for column in columns(path)}
    if not set(found) & set(NAMES):
        raise InputError(
            f"{path.name} names no column: its first line must have names of {', '.join(NAMES)},"
            " each perhaps with its unit in brackets."
        )
    return found


def columns(path: Path) -> list[Column]:
    """All columns of a table, without names if it has no header."""
    header, values = _rows(path)
    cells = _cells(header) if header else [""] * values.shape[1]
    if len(cells) != values.shape[1]:
        raise InputError(
            f"the header of {path.name} does not name the {values.shape[1]} columns, separated as"
            f" the numbers are: {checks.shown(header)}."
        )
    matches = [_CELL.match(cell) for cell in cells]
    named = [(match[1], match[2] or "") if match else ("", "") for match in matches]
    return [Column(*names, values[:, i]) for i, names in enumerate(named)]


def _rows(path: Path) -> tuple[str, Array]:
    """(line before the numbers, numbers (rows, columns)) of a text table."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is no table in text (UTF-8).") from error

    rows: list[list[float]] = []
    header = ""
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        try:
            numbers = [float(cell) for cell in _cells(text)]
        except ValueError:
            if rows and not text.startswith("#"):
                raise InputError(
                    f"line {number} of {path.name} is no row of numbers: {checks.shown(text)}."
                ) from None
            header = header if rows else text.lstrip("#%/ ")
            continue
        if numbers and rows and len(numbers) != len(rows[0]):
            raise InputError(
                f"line {number} of {path.name} has {len(numbers)} columns, the first has"
                f" {len(rows[0])}: the file is cut or mixed."
            )
        rows += [numbers] if numbers else []
    if not rows:
        raise InputError(f"{path.name} holds no row of numbers.")
    return header, np.array(rows)


def _cells(text: str) -> list[str]:
    """The cells of a row, separated by semicolons, tabs, commas or blanks."""
    for mark in ";\t,":
        if mark in text:
            decimal = "," if mark == "," else "."  # beside others a comma is a decimal point
            return [cell.strip().replace(",", decimal) for cell in text.split(mark)]
    return text.split()
