"""Objects and numbers as short texts.

`ReprMixin` shows a result in a few lines, `FieldsRepr` an input in one; `engineering` writes a
number as engineers do: 82.7 µs, 2.20 kN ± 2 %.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sized
from math import ceil, floor, isfinite, log10
from typing import Any

import numpy as np

from antiosc.base._types import NDArray
from antiosc.base.errors import AntioscError

#: Share of the last digit by which a number may exceed one that is rounded up, or fall short of
#: one that is rounded down.
DIGIT_ROUNDING = 1e-6
#: Largest number of value lines in the `repr` of an object.
MAX_LINES = 4


def printable(text: str) -> str:
    """A text on one line, with codes instead of unprintable characters."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def piece_text(name: str, piece: int, count: int, pieces: str = "") -> str:
    """Sentence: one piece of a file of `count` pieces is read; `pieces`: text on all pieces."""
    listed = f" ({pieces})" if pieces else ""
    return f"{name}: piece {piece} of {count} is read, the others are not{listed}."


#: Arguments that make cells smaller, and that of a patch.
CELL_ARGUMENTS = "refine or size"
PATCH_ARGUMENT = "radius"
#: Most characters of one value.
MAX_VALUE_LENGTH = 72


class ReprMixin:
    """Gives an object a `repr` of at most five lines, from its `_facts` [(name, value as text)]."""

    def _facts(self) -> list[tuple[str, str]]:
        fields = [
            (f.name, getattr(self, f.name))
            for f in dataclasses.fields(self)  # type: ignore[arg-type]
            if f.repr and not f.name.startswith("_")
        ]
        facts = [(name, text) for name, value in fields if (text := value_text(value))]
        if len(facts) <= MAX_LINES:
            return facts

        hidden_names = ", ".join(name for name, _ in facts[MAX_LINES - 1 :])
        return [*facts[: MAX_LINES - 1], ("and", hidden_names)]

    def __repr__(self) -> str:
        try:
            facts = [(name, _truncated(text)) for name, text in self._facts()[:MAX_LINES]]
        except (AntioscError, AttributeError):  # an object of which not everything is known
            facts = []

        width = max((len(name) for name, _ in facts), default=0)
        rows = [f"  {name:<{width}}  {value}" for name, value in facts]
        return "\n".join([type(self).__name__, *rows])


#: Status of a run: complete; complete, but not to the tolerance; stopped before the end; complete,
#: but the bodies still touch at the end.
COMPLETED = 0
INEXACT = 1
STOPPED = 2
TOUCHING = 3


class Result(ReprMixin):
    """Base of results: text, JSON values, a status (0: completed) and a message."""

    status: Any
    message: Any

    def summary(self) -> str:
        """The results, one per line, and the message if the status is not 0."""
        facts = self._facts()
        width = max((len(name) for name, _ in facts), default=0)
        rows = [f"{name:<{width}}  {value}" for name, value in facts]
        return "\n".join([*rows, *([str(self.message)] if np.any(self.status) else [])])

    def numbers(self) -> dict[str, object]:
        """Single results in SI units, status and message, as JSON values by name."""
        names = [f.name for f in dataclasses.fields(self)]  # type: ignore[arg-type]
        values = {name: getattr(self, name) for name in names}
        single = bool, int, float, str, np.generic
        single_values = {
            name: _json_value(value) for name, value in values.items() if isinstance(value, single)
        }

        return {**single_values, "status": _json_value(self.status), "message": self.message}


class CompletedResult(Result):
    """Base of results that exist only if the computation has completed: status 0."""

    status = 0
    message = "Completed."


def _json_value(value: object) -> object:
    """A NumPy number or array as Python numbers."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value


class FieldsRepr:
    """Give a dataclass a one-line `repr` of the fields that differ from their defaults."""

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        if "__repr__" not in cls.__dict__ and not issubclass(cls, ReprMixin):
            cls.__repr__ = FieldsRepr.__repr__  # type: ignore[method-assign]

    def _changed_fields(self) -> list[tuple[str, str]]:
        return [
            (f.name, _field_text(getattr(self, f.name, None)))
            for f in dataclasses.fields(self)  # type: ignore[arg-type]
            if f.repr
            and not f.name.startswith("_")
            and not _is_default(f, getattr(self, f.name, None))
        ]

    def __repr__(self) -> str:
        shown_fields = (f"{name}={value}" for name, value in self._changed_fields())
        return f"{type(self).__name__}({', '.join(shown_fields)})"


def _is_default(field: dataclasses.Field[object], value: object) -> bool:
    """Whether a dataclass field has its default value; with a default factory: is empty."""
    if field.default is dataclasses.MISSING:
        is_made = field.default_factory is not dataclasses.MISSING
        return is_made and isinstance(value, Sized) and len(value) == 0
    is_simple = isinstance(value, float | int | str | tuple)
    return value is field.default or (is_simple and bool(value == field.default))


def _field_text(value: object) -> str:
    """The value of a field as one short text."""
    if isinstance(value, float) and float(f"{value:g}") == value:
        return f"{value:g}"
    if isinstance(value, np.ndarray):
        return f"[{array_text(value)}]"
    if isinstance(value, dict):
        return "{" + ", ".join(map(str, value)) + "}"
    if isinstance(value, list | tuple):
        text = ", ".join(map(_field_text, value))
        if len(text) <= MAX_VALUE_LENGTH:
            return f"({text})"
        return f"({len(value)} entries)"
    if isinstance(value, ReprMixin) or callable(value):
        return getattr(value, "__name__", type(value).__name__)

    text = repr(value)
    if len(text) <= MAX_VALUE_LENGTH and "\n" not in text:
        return text

    return type(value).__name__


def _truncated(text: str) -> str:
    """A text of at most `MAX_VALUE_LENGTH` characters."""
    if len(text) <= MAX_VALUE_LENGTH:
        return text
    return text[: MAX_VALUE_LENGTH - 1] + "…"


def value_text(value: object) -> str:
    """A value in one short line; "" for None and empty values."""
    if value is None or (isinstance(value, np.ndarray) and not value.size):
        return ""
    if isinstance(value, dict | list | tuple) and not value:
        return ""
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, float | int | np.number):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        return array_text(value)
    if isinstance(value, dict | list | tuple):
        names = ", ".join(map(str, value)) if isinstance(value, dict) else ""
        return names or f"{len(value)} entries"

    return type(value).__name__


def array_text(values: NDArray[np.generic]) -> str:
    """An array as text: its numbers if they are few, otherwise its shape and range."""
    if values.dtype.kind not in "fiub":
        return f"array {values.shape}"
    if values.size <= 3 and values.ndim == 1:
        return ", ".join(f"{v:.6g}" for v in values)

    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    if not known.size:
        return f"{values.shape}, no value"

    missing = values.size - known.size
    lacking = f", {missing} without a value" if missing else ""
    return f"{values.shape}, {np.min(known):.4g} to {np.max(known):.4g}{lacking}"


#: Units that take a prefix, beside those that begin with newtons.
PREFIXED_UNITS = ("m", "s", "J", "Pa", "Hz", "g")
PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


#: Numbers of units without a prefix that are written without an exponent: 1220 m/s².
MAX_PLAIN_NUMBER = 1e6


def engineering(value: float, unit: str = "", digits: int = 3) -> str:
    """A number with `digits` significant digits and a prefix of its unit, as "2.20 kN"."""
    value = float(value)
    if not isfinite(value):
        return "–"

    if unit == "kg" and 0 < abs(value) < 1:
        value = 1e3 * value
        unit = "g"

    if unit == "m/s" and 0 < abs(value) < 0.1:
        value = 1e3 * value
        unit = "mm/s"

    if value == 0:
        return f"0 {unit}".rstrip()

    rounded = float(f"{value:.{digits - 1}e}")
    prefixed = unit in PREFIXED_UNITS or unit.startswith("N")
    power = 3 * floor(log10(abs(rounded)) / 3 + 1e-12) if prefixed else 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    scaled = rounded / 10**power
    exponent = abs(scaled) >= 10**digits  # which two digits of 690 would have
    whole = exponent and (prefixed or abs(scaled) < MAX_PLAIN_NUMBER)
    digits_text = f"{scaled:.0f}" if whole else f"{scaled:#.{digits}g}".rstrip(".")
    return f"{digits_text} {PREFIXES[power]}{unit}".rstrip()


def restitution_text(e: float, digits: int = 3) -> str:
    """A coefficient of restitution as text, with an explanation if it is negative."""
    return f"{e:.{digits}f}{', still approaching' if e < 0 else ''}"


def point_text(point: Iterable[float]) -> str:
    """The coordinates [m] of a point as text: "(20, 40, 75) mm"."""
    coordinates = [float(x) for x in point]
    rounding = 1e-5 * max(map(abs, coordinates), default=0.0)
    return f"({', '.join(f'{1e3 * x if abs(x) > rounding else 0.0:.4g}' for x in coordinates)}) mm"


def rounded_up(value: float) -> float:
    """The smallest number of two digits >= a positive `value`, within rounding errors."""
    step = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / step - DIGIT_ROUNDING) * step:.2g}")


def rounded_down(value: float) -> float:
    """The largest number of two digits <= a positive `value`, within rounding errors."""
    step = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{floor(value / step + DIGIT_ROUNDING) * step:.2g}")


def range_text(low: float, high: float, unit: str = "") -> str:
    """Two values as text: "1.100 kN to 2.204 kN"."""
    return " to ".join(engineering(end, unit, 4) for end in (low, high))


def capitalised(sentence: str) -> str:
    """The sentence with a capital letter, unless it begins with a name of a file or a variable."""
    first = sentence.partition(" ")[0].rstrip(",:")
    if first.isalpha():
        return sentence[:1].upper() + sentence[1:]
    return sentence


def unit_prefix(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit for a table column with this largest value: (1e6, "µs")."""
    if unit == "kg" and 0 < largest < 1:
        return 1e3, "g"
    prefixed_unit = engineering(largest, unit).rpartition(" ")[2] if largest else unit
    power = {f"{sign}{unit}": p for p, sign in PREFIXES.items()}.get(prefixed_unit, 0)
    return 10.0**-power, prefixed_unit if power else unit


def exceeds(value: float, limit: float, digits: int) -> bool:
    """Whether a value, as printed with `digits` significant digits, is above a limit."""
    return float(f"{value:.{digits}g}") > limit


def plain_number(value: float, digits: int = 2) -> str:
    """A number rounded to `digits` digits, without an exponent: "250", "1800", "0.0043"."""
    return f"{float(f'{value:.{digits}g}'):.12g}" if isfinite(value) else "–"


#: Share below which a text in per cent has no digit other than 0.
MIN_PERCENT_SHARE = 1e-5


def percent(share: float) -> str:
    """A ratio in per cent with two significant digits, "0 %" below `MIN_PERCENT_SHARE`."""
    if abs(share) < MIN_PERCENT_SHARE:
        return "0 %"
    return f"{plain_number(100 * share)} %" if isfinite(share) else "unknown"


def plus_minus(bar: tuple[float, float], text: Callable[[float], str] = percent) -> str:
    """An error bar (below, above) as text: "± 12 %", or "+13 % −79 %" if its sides differ."""
    below, above = map(text, bar)
    return f"± {below}" if below == above else f"+{above} −{below}"
