"""Text tables: a line with the names of columns and units in brackets, then rows of numbers."""

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

#: Units as `plain_unit` writes them -> factor to SI, and for frequencies to Hz.
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
FREQUENCY_UNITS = {"Hz": 1.0, "kHz": 1e3, "rad/s": 0.5 / pi}
FORCE_UNITS = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "lbf": 4.4482216152605}
STRAIN_UNITS = {"-": 1.0, "m/m": 1.0, "um/m": 1e-6, "µm/m": 1e-6}
#: The same of motions, by the quantity that they are per force.
MOTION_UNITS: dict[Quantity, dict[str, float]] = {
    "receptance": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254},
    "mobility": {"m/s": 1.0, "mm/s": 1e-3, "in/s": 0.0254},
    "accelerance": {"m/s2": 1.0, "mm/s2": 1e-3, "g": 9.80665, "in/s2": 0.0254},
}
#: A name and a unit in brackets.
_HEADER_CELL = re.compile(r"^(.*?)\s*(?:[\[(](.*)[\])])?$")


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a table: its name and unit in the header, and its numbers."""

    name: str
    unit: str
    values: Array

    def in_si(self, units: Mapping[str, float]) -> Array:
        """The numbers in SI units, frequencies in Hz; InputError for units not in `units`."""
        if not self.unit:
            return self.values
        if plain_unit(self.unit) not in units:
            raise unknown_unit_error(self, ", ".join(units))
        return units[plain_unit(self.unit)] * self.values


def unknown_unit_error(column: Column, known: str) -> InputError:
    """The error for an unknown unit in a header."""
    return InputError(
        f"the unit {checks.shown(column.unit)} of the column {checks.shown(column.name)} is not"
        f" known: write one of {known}, and the numbers in it."
    )


def plain_unit(unit: object) -> str:
    """A unit without blanks, brackets and signs of powers."""
    text = re.sub(r"[\s()\[\]^]|\*\*", "", str(unit or "")).replace("²", "2").replace("μ", "µ")
    return "" if text.lower() in ("none", "unknown") else text


def response_unit(numerator: str, denominator: str = "") -> tuple[float | None, Quantity | None]:
    """(factor to SI, quantity) for the plain unit of a response; None for unknown units."""
    motion, force = numerator, denominator
    if not denominator:
        motion, _, force = numerator.rpartition("/")

    if force not in FORCE_UNITS:
        if denominator:
            return None, None
        motion, force = numerator, "N"

    for quantity, units in MOTION_UNITS.items():
        if motion.lower() in units:
            return units[motion.lower()] / FORCE_UNITS[force], quantity
    return None, None


def columns_of_table(path: Path) -> list[Column]:
    """The columns of a table, separated by commas, whose first line names them."""
    try:
        header, *lines = path.read_text(encoding="utf-8-sig").splitlines()
        rows = [line for line in lines if line.partition("#")[0].strip()]
        values = np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.zeros((0, 0))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path.name} is no table in text: its first line names the columns, each perhaps with"
            " its unit in brackets, and rows of numbers follow, all separated by commas"
            f" ({str(error).rstrip('.')})."
        ) from error

    cells = header.lstrip("#% ").split(",")
    if len(cells) != values.shape[1]:
        raise InputError(
            f"the first line of {path.name} names {len(cells)} columns, separated by commas; its"
            f" rows have {values.shape[1]}."
        )

    columns = []
    for cell, numbers in zip(cells, values.T, strict=True):
        match = _HEADER_CELL.match(cell.strip())
        assert match is not None
        columns.append(Column(match[1].lower(), match[2] or "", numbers))
    return columns


def columns_by_name(path: Path, *names: str) -> dict[str, Column]:
    """The columns of a table by name, which must include the given names."""
    found = {column.name: column for column in columns_of_table(path)}
    if missing := [name for name in names if name not in found]:
        raise InputError(
            f"{path.name} has no column {missing[0]}: name its columns {', '.join(names)}, each"
            " perhaps with its unit in brackets."
        )

    return found
