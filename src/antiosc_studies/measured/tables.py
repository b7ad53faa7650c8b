"""Text tables: rows of numbers, columns named by a header, converted to SI by its units."""

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

#: Beginning of a column's name -> kind of the column.
COLUMNS = {
    "f": "frequency", "hz": "frequency", "re": "real", "im": "imag", "mag": "magnitude",
    "abs": "magnitude", "amp": "magnitude", "pha": "phase", "coh": "coherence", "gam": "coherence",
    "sig": "sigma", "std": "sigma", "t": "time", "force": "force",
}  # fmt: skip
#: Factors to SI, and for frequencies to Hz.
TIMES = {
    **{"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "min": 60.0},
    **dict.fromkeys(("us", "µs", "μs", "usec"), 1e-6),
    "ns": 1e-9,
}
FREQUENCIES = {
    **{"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "mHz": 1e-3, "GHz": 1e9},
    **{"rad/s": 0.5 / pi, "krad/s": 500 / pi},
    **dict.fromkeys(("rpm", "1/min", "r/min", "rev/min"), 1 / 60),
}
FORCES = {
    **{"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "newton": 1.0},
    **{"lbf": 4.4482216152605, "kgf": 9.80665},
}
ANGLES = {**dict.fromkeys(("deg", "degree", "degrees", "°"), pi / 180), "rad": 1.0, "radians": 1.0}
SHARES = {"-": 1.0, "1": 1.0, "%": 0.01}
UNITS: dict[str, Mapping[str, float]] = {
    "time": TIMES, "frequency": FREQUENCIES, "force": FORCES, "phase": ANGLES, "coherence": SHARES,
}  # fmt: skip
# units: in brackets at the end of a name, but not in "Re(H)"
_BARE = ("time", "frequency", "force", "phase", "")  # "1" may be a name
_LONGEST = 200  # letters of a cell of a header
_BRACKETS = re.compile(r"^(.*?)\s*[\[({]([^\[\](){}]*(?:\([^()]*\)[^\[\](){}]*)*)[\])}]\s*$")
_FUNCTIONS = {"re", "im", "real", "imag", "abs", "mag", "phase", "arg"}


#: Units of forces in N, as `motion_label` writes them: in small letters but for MN.
FORCE_UNITS = {"n": 1.0, "kn": 1e3, "mn": 1e-3, "MN": 1e6, "lbf": 4.4482216}
#: Units of motions and forces (as `motion_label` writes them) -> factor to SI, quantity per force.
MOTIONS: dict[str, tuple[float, Quantity | None]] = {
    **{name: (f, "accelerance") for name, f in (("m/s2", 1.0), ("mm/s2", 1e-3), ("g", 9.80665))},
    **{name: (9.80665, "accelerance") for name in ("gn", "gs")},
    **{name: (0.0254, "accelerance") for name in ("in/s2", "inch/s2")},
    **{name: (f, "mobility") for name, f in (("m/s", 1.0), ("mm/s", 1e-3), ("in/s", 0.0254))},
    **{name: (f, "receptance") for name, f in (("m", 1.0), ("mm", 1e-3), ("in", 0.0254))},
    **{name: (1e-6, "receptance") for name in ("um", "µm", "μm")},
    **{name: (f, None) for name, f in FORCE_UNITS.items()},
}


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a table: kind of quantity ("" unknown), name and unit in the header, numbers."""

    kind: str
    name: str
    unit: str
    values: Array

    def in_si(self) -> Array:
        """The numbers in SI units, frequencies in Hz; InputError for unknown units."""
        if not self.unit:
            return self.values
        unit_factors = UNITS[self.kind]
        factor = factor_of(self.unit, unit_factors)
        if factor is None:
            raise unknown_unit(self, ", ".join(unit_factors))
        return factor * self.values


def unknown_unit(column: Column, known: str) -> InputError:
    """The error for an unknown unit in a header."""
    return InputError(
        f"the unit {checks.shown(column.unit)} of the column {checks.shown(column.name)} is not"
        f" known: write one of {known}, and the numbers in it."
    )


def motion_label(unit: object) -> str:
    """A unit of motion, or of motion per force, in normalised spelling."""
    text = re.sub(r"[\s()\[\]·]|\*\*|\^", "", str(unit or "")).replace("²", "2")
    mega = text.endswith("MN")
    text = text.lower().replace("/s/s", "/s2").replace("sec", "s")
    text = text[:-2] + "MN" if mega else text
    if text in ("none", "unknown"):
        return ""
    return text


def response_unit(numerator: str, denominator: str = "") -> tuple[float | None, Quantity | None]:
    """(factor to SI, quantity) for the unit of a response; None for unknown units."""
    for name in FORCE_UNITS:
        if not denominator and numerator.endswith(f"/{name}"):
            numerator = numerator.removesuffix(f"/{name}")
            denominator = name
    if numerator not in MOTIONS or MOTIONS.get(denominator or "n", (0.0, "mobility"))[1]:
        return None, None
    factor, quantity = MOTIONS[numerator]
    divisor, _ = MOTIONS[denominator or "n"]
    return factor / divisor, quantity


def factor_of(unit: str, known: Mapping[str, float]) -> float | None:
    """The factor of a unit, or None; upper and lower case count only if they are ambiguous."""
    compact = re.sub(r"\s", "", unit)
    fits = [compact] if compact in known else [k for k in known if k.lower() == compact.lower()]
    if len(fits) == 1:
        return known[fits[0]]
    return None


def table(path: Path, default: list[str]) -> dict[str, Column]:
    """The columns of a table by kind; `default` gives the kinds if it has no header."""
    return {column.kind: column for column in columns(path, default) if column.kind}


def columns(path: Path, default: list[str]) -> list[Column]:
    """All columns of a table; `default` gives the kinds if it has no header."""
    header, values = rows_of(path)
    count = values.shape[1]
    names = [*default, *[""] * count][:count]
    lines = [[_header_cell(cell) for cell in _merged_cells(line, count)] for line in header[-2:]]
    header_cells = lines[-1] if lines else []
    units = [_is_unit(name) for _, name, _ in header_cells]
    if header_cells and all(units):
        kinds_before = [kind for kind, _, _ in lines[0]]
        fits = len(kinds_before) == len(header_cells) and any(kinds_before) and len(lines) == 2
        kinds = kinds_before if fits else names
        unit_names = [_bare(name) for _, name, _ in header_cells]
        header_cells = [(kind, unit, unit) for kind, unit in zip(kinds, unit_names, strict=False)]
        names_columns = True
    else:
        names_columns = any(kind for kind, _, _ in header_cells) or not (default or any(units))
    if len(header_cells) != count or not names_columns:
        if any(unit for _, _, unit in header_cells) or any(units):
            raise InputError(
                f"the header of {path.name} has units, and does not name the {count} columns:"
                f" {checks.shown(header[-1])}."
            )
        header_cells = [(kind, kind, "") for kind in names]
    return [Column(*heading, values[:, i]) for i, heading in enumerate(header_cells)]


def rows_of(path: Path) -> tuple[list[str], Array]:
    """(lines before the numbers, numbers (rows, columns)) of a text table."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is no table in text (UTF-8).") from error
    rows: list[list[float]] = []
    header: list[str] = []
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        numbers = _numbers(_cells(text))
        if numbers is None and rows and text and not text.startswith("#"):
            raise InputError(
                f"line {number} of {path.name} is no row of numbers: {checks.shown(text)}."
            )
        if numbers is None:
            header += [text.lstrip("#%/ ")] if text.lstrip("#%/ ") and not rows else []
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
    """The cells of a row, separated by semicolons, tabs, commas or blanks."""
    for mark in (";", "\t", ","):
        if mark in text:
            cells = [cell.strip() for cell in text.split(mark)]
            if mark != ",":
                return [cell.replace(",", ".") for cell in cells]
            return cells
    return text.split()


def _merged_cells(text: str, count: int) -> list[str]:
    """The cells of a header; with blanks as separators "name [unit]" becomes one cell."""
    cells = _cells(text)
    if len(cells) <= count:
        return cells
    lines: list[str] = []
    for cell in cells:
        if lines and cell[:1] in "[({":
            lines[-1] += f" {cell}"
        else:
            lines.append(cell)
    return lines


def _numbers(cells: list[str]) -> list[float] | None:
    """The cells as numbers; None if one is not a number."""
    try:
        return [float(cell) for cell in cells] or None
    except ValueError:
        return None


def _kind(name: str) -> str:
    """The kind of a column, by the longest known beginning of its name; "" if unknown."""
    lowered = name.strip().lower()
    fits = [key for key in COLUMNS if lowered.startswith(key)]
    if fits:
        return COLUMNS[max(fits, key=len)]
    return ""


def _header_cell(cell: str) -> tuple[str, str, str]:
    """(kind, name, unit) of a header cell."""
    name = cell.strip()[:_LONGEST]
    if factor_of(name, FREQUENCIES) is not None:  # a unit is the name: "Hz", "rpm"
        return "frequency", name, name
    kind = _kind(name)
    match = _BRACKETS.match(name)
    unit = match[2].strip() if match else ""
    if match and match[1].lower() in _FUNCTIONS and name[-1] == ")" and not _is_known(kind, unit):
        unit = ""  # an argument
    if not match:
        tail = re.split(r"[\s_/]", name, maxsplit=1)[1:]
        forces = {kind, "force"} if kind == "frequency" else {kind}  # "F/kN"
        texts = (part.strip() for part in tail if any(_is_known(k, part.strip()) for k in forces))
        unit = next(texts, "")
    if kind == "phase" and not match and not unit:
        angle_unit = re.search("deg|rad|°", name.lower())
        unit = angle_unit[0] if angle_unit else ""
    if kind == "frequency" and unit and factor_of(unit, FORCES) is not None:
        kind = "force"
    return kind, name, unit


def _is_known(kind: str, unit: str) -> bool:
    """Whether a text is a unit for this kind of column."""
    if kind in UNITS:
        return factor_of(unit, UNITS[kind]) is not None
    return unit.lower().startswith("db") or response_unit(motion_label(unit))[0] is not None


def _bare(name: str) -> str:
    """The text inside brackets if the whole cell is a unit in brackets; otherwise the cell."""
    if not _BRACKETS.sub(r"\1", name).strip():
        return _BRACKETS.sub(r"\2", name)
    return name


def _is_unit(name: str) -> bool:
    """Whether a cell is only a unit."""
    unit_name = _bare(name)
    return unit_name != name or any(_is_known(kind, unit_name) for kind in _BARE)
