"""Materials by name: the content of `materials.toml`, each number with its source."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from antiosc.base import checks
from antiosc.base.errors import InputError, name_list
from antiosc.base.texts import engineering


@dataclass(frozen=True)
class MaterialRecord:
    """A material of the table, in SI units; None or 0 if the sources give no value."""

    name: str
    E: Any  # E, nu: floats; of wood three values each, as G, in the order of `orthotropic`
    nu: Any
    rho: float
    yield_strength: float | None  # None for a material that does not yield (`brittle`)
    yield_range: tuple[float, float] | None  # lowest and highest of the sources
    brittle: bool
    #: D [1/s], q of Cowper and Symonds, and the strength that grows if it is not the yield strength
    rate: tuple[float, ...] | None
    loss: float  # loss factor
    source: str  # of the numbers: read, or from memory
    note: str  # their limits
    G: Any = None
    typical: str = ""  # numbers that no available source gives, with their range
    breaks: str = ""  # what is known on breaking, in words
    tensile: tuple[float, float] | None = None  # least and largest tensile strength, if it cracks

    @property
    def line(self) -> str:
        """The material in one line."""
        modulus = self.E if self.G is None else self.E[0]
        strength = "no yield"
        if self.tensile is not None:
            low, high = (engineering(bound, "Pa") for bound in self.tensile)
            strength = f"no yield, cracks in tension from {low} to {high} on"

        if self.yield_range is not None:
            low, high = (engineering(bound, "Pa") for bound in self.yield_range)
            strength = f"{engineering(self.yield_strength or 0.0, 'Pa')} ({low} to {high})"

        return f"{engineering(modulus, 'Pa')}, {self.rho:g} kg/m³, {strength}"


def record(name: object) -> MaterialRecord:
    """The material of this name, or the only one whose name contains it; else InputError."""
    all_names = names()
    wanted = checks.text("material", name)
    words = _words_of_name(wanted)
    matches = [
        n for n in all_names if all(any(x.startswith(w) for x in _words_of_name(n)) for w in words)
    ]
    exact = [name for name in all_names if _words_of_name(name) == words]
    for candidates in (exact, matches):
        if len(candidates) == 1:
            return _record_of_row(candidates[0], _table()["material"][candidates[0]])

    fault = f"no material; {name_list(wanted, all_names, 'the materials')}"
    if matches:
        fault = f"the name of several materials: take one of {', '.join(map(repr, matches))}"

    raise InputError(f"{wanted!r} is {fault}, or give the constants E, nu, rho and yield_strength.")


def yielding_record(name: str) -> MaterialRecord:
    """The material that `record` finds for `name`; InputError if it does not yield."""
    found = record(name)
    if found.yield_strength is None:
        raise InputError(f"{found.name} has no yield strength.")
    return found


def names() -> list[str]:
    """The names of all materials."""
    return list(_table()["material"])


def strength_at(rate: tuple[float, ...], strength: float, strain_rate: float) -> float:
    """The strength [Pa] at a strain rate [1/s]; `rate`: D, q and S, or D, q with S = `strength`.

    S (1 + (strain rate/D)^(1/q)), P. S. Symonds and G. R. Cowper, Brown University Applied
    Mathematics Report 28 (1957).
    """
    D, q, *of_rate = rate
    static = of_rate[0] if of_rate else strength
    return static * (1 + (strain_rate / D) ** (1 / q))


def _words_of_name(name: str) -> list[str]:
    return re.findall(r"[\w.%]+", name.lower())


@cache
def _table() -> dict[str, Any]:
    import tomllib  # takes long to load

    with Path(__file__).with_name("materials.toml").open("rb") as stream:
        return tomllib.load(stream)


def _record_of_row(name: str, row: Mapping[str, Any]) -> MaterialRecord:
    brittle = row["yield_strength"] == "none"
    low_high = row.get("range")
    rate = row.get("rate")
    return MaterialRecord(
        name=name,
        E=row["E"],
        nu=row["nu"],
        rho=float(row["rho"]),
        yield_strength=None if brittle else row["yield_strength"],
        yield_range=None if low_high is None else (low_high[0], low_high[1]),
        brittle=brittle,
        rate=None if rate is None else tuple(map(float, rate)),
        loss=row.get("loss", 0.0),
        source="; ".join(map(_spelled_out, row["source"])),
        note=row.get("note", ""),
        G=row.get("G"),
        typical=row.get("typical", ""),
        breaks=row.get("breaks", ""),
        tensile=tuple(row["tensile"]) if "tensile" in row else None,
    )


def _spelled_out(source: str) -> str:
    """A source with its key replaced by the title of the work."""
    key, _, place = source.partition(" ")
    title = _table()["sources"][key]
    page = _table()["read"].get(key)
    origin_text = "recalled" if page is None else f"read at {page}"
    return f"{title} {place}".rstrip() + f" ({origin_text})"
