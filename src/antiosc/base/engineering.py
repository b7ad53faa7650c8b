"""Numbers as engineers write them: 82.7 µs, 2.20 kN ± 2 %."""

from __future__ import annotations

from collections.abc import Iterable
from math import floor, isfinite, log10

#: Units that take a prefix, beside those that begin with newtons.
PREFIXED = ("m", "s", "J", "Pa", "Hz", "g")
PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


def engineering(value: float, unit: str = "", digits: int = 3) -> str:
    """A number with so many significant digits and a prefix of its unit, as "2.20 kN".

    Masses below 1 kg are written in grams. A dash for what is not finite.
    """
    value = float(value)
    if not isfinite(value):
        return "–"
    if unit == "kg" and 0 < abs(value) < 1:
        value, unit = 1e3 * value, "g"
    if value == 0:
        return f"0 {unit}".rstrip()
    rounded = float(f"{value:.{digits - 1}e}")
    prefixed = unit in PREFIXED or unit.startswith("N")
    power = 3 * floor(log10(abs(rounded)) / 3 + 1e-12) if prefixed else 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    shown = f"{rounded / 10**power:#.{digits}g}".rstrip(".")
    return f"{shown} {PREFIXES[power]}{unit}".rstrip()


def place(point: Iterable[float]) -> str:
    """A place: "(20, 40, 75) mm"."""
    own = [float(x) for x in point]
    rounding = 1e-9 * max(map(abs, own), default=0.0)
    return f"({', '.join(f'{1e3 * x if abs(x) > rounding else 0.0:.4g}' for x in own)}) mm"


def span(low: float, high: float, unit: str = "") -> str:
    """A range: "1.100 kN to 2.204 kN"."""
    return " to ".join(engineering(end, unit, 4) for end in (low, high))


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit of a column of a table whose largest value is given: (1e6, "µs")."""
    if unit == "kg" and 0 < largest < 1:
        return 1e3, "g"
    shown = engineering(largest, unit).rpartition(" ")[2] if largest else unit
    power = {f"{sign}{unit}": p for p, sign in PREFIXES.items()}.get(shown, 0)
    return 10.0**-power, shown if power else unit


def percent(share: float) -> str:
    """A share in per cent with two significant digits: "0.34 %"."""
    return f"{float(f'{100 * share:.2g}'):.12g} %" if isfinite(share) else "unknown"


def with_bar(value: float, unit: str, share: float | None) -> str:
    """A number with its relative error, where one is known: "2.20 kN ± 2 %"."""
    shown = engineering(value, unit)
    return shown if share is None else f"{shown} ± {percent(share)}"
