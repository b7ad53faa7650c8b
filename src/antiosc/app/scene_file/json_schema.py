"""The JSON schema of scene files, for editors; from the table of sections and the signatures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from antiosc.app.scene_file.chance import LIGHT, OF_STRUCTURE, POINT
from antiosc.app.scene_file.kinds import Kind
from antiosc.app.scene_file.parameters import Parameter, parameters
from antiosc.app.scene_file.sections import KIND, SECTIONS, VARIED, Section, constructors_of
from antiosc.app.scene_file.variants import STRUCTURAL


def schema() -> dict[str, Any]:
    """The schema of a whole scene file (JSON Schema, draft 2020-12)."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "antiosc scene",
        "description": "An impact on a structure; all numbers are in SI units.",
        **_sections(SECTIONS),
    }


def _closed(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": False, "properties": dict(properties)}


def _many(one: Any) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": one}


def _sections(known: Mapping[str, Section]) -> dict[str, Any]:
    return _closed({name: _section(name, section) for name, section in known.items()})


def _section(name: str, section: Section) -> dict[str, Any]:
    about = {"description": section.about}
    if section.form == "text":
        return {**about, "type": "string"}
    if name == "points":
        return {**about, **_many({"type": "array", "items": {"type": "number"}})}
    if name == "sweep":
        lists = _many({"type": ["array", "object"]})  # of a named section: tables of lists
        return {**about, **_closed(dict.fromkeys((*VARIED, *STRUCTURAL), lists))}
    if name == "monte_carlo":
        own = _table(name, section.given.split(), several=False)
        points = _table("impact_map", ["structure"], several=False)
        drawn = {key: {"type": "object"} for key in (*LIGHT, *OF_STRUCTURE)} | {POINT: points}
        return {**about, **_closed(own["properties"] | drawn)}
    if section.inner:
        return {**about, **_many(_sections(section.inner))}
    one = _one_of(section.makes, section.given.split(), methods=name == "contact")
    if section.form == "list":
        return {**about, "type": "array", "items": one}
    if section.form == "named":
        return {**about, **({"anyOf": [one, _many(one)]} if section.alone else _many(one))}
    return {**about, **one}


def _one_of(makes: Sequence[str], given: Iterable[str] = (), methods: bool = False) -> Any:
    """A table of one of several kinds."""
    tables = [_table(name, given, len(makes) > 1) for name in makes]
    if methods:  # laws that a body makes, as "impactor.hertz"
        kind = {KIND: {"type": "string", "pattern": r"^[^.]+\.[a-z]\w*$"}}
        tables.append({"type": "object", "required": [KIND], "properties": kind})
    return tables[0] if len(tables) == 1 else {"anyOf": tables}


def _table(function: str, given: Iterable[str], several: bool) -> dict[str, Any]:
    known = {n: p for n, p in parameters(function).items() if n not in set(given)}
    kind = {KIND: {"const": function}} if several else {}
    needed = [*kind, *(name for name, p in known.items() if p.needed)]
    table = _closed({**kind, **{name: _parameter(p) for name, p in known.items()}})
    return {**table, "required": needed} if needed else table


def _parameter(one: Parameter) -> dict[str, Any]:
    found = _any(one.kinds)
    if one.about:
        found["description"] = one.about
    if isinstance(one.default, bool | int | float | str) and one.default != "":
        found["default"] = one.default
    return found


def _kind(kind: Kind) -> Any:
    if kind.name == "list" and kind.each:
        entries = [_any(each) for each in kind.each]
        return {"type": "array", "prefixItems": entries, "minItems": len(entries)}
    if kind.name == "list":
        return {"type": "array", "items": _any(kind.items)}
    if kind.name == "table":
        return _many(_any(kind.items))
    if kind.name == "object" and (makes := constructors_of(kind.options[0])):
        return _one_of(makes, methods="Hertz" in makes)
    return kind.schema


def _any(kinds: Sequence[Kind]) -> dict[str, Any]:
    found = [_kind(kind) for kind in kinds]
    return dict(found[0]) if len(found) == 1 else {"anyOf": found}
