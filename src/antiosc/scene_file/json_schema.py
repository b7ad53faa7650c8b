"""The JSON schema of scene files, for editors; from the table of sections and the signatures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from antiosc.scene_file.build import KIND
from antiosc.scene_file.kinds import Kind
from antiosc.scene_file.parameters import Parameter, parameters
from antiosc.scene_file.sections import SECTIONS, Section, constructors_of
from antiosc.scene_file.studies import VARIED

_SCHEMA_TYPES: dict[str, dict[str, Any]] = {
    "number": {"type": "number"},
    "whole": {"type": "integer"},
    "text": {"type": "string"},
    "path": {"type": "string"},
    "flag": {"type": "boolean"},
    "data": {"type": ["number", "string", "array"]},
}


def schema() -> dict[str, Any]:
    """The schema of a whole scene file (JSON Schema, draft 2020-12)."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "antiosc scene",
        "description": "An impact on a structure; all numbers are in SI units.",
        **_sections(SECTIONS),
    }


def _sections(known: Mapping[str, Section]) -> dict[str, Any]:
    properties = {name: _section(name, section) for name, section in known.items()}
    return {"type": "object", "additionalProperties": False, "properties": properties}


def _section(name: str, section: Section) -> dict[str, Any]:
    about = {"description": section.about}
    if section.form == "text":
        return {**about, "type": "string"}
    if name == "points":
        point = {"type": "array", "items": {"type": "number"}}
        return {**about, "type": "object", "additionalProperties": point}
    if name == "sweep":
        lists = {"type": "object", "additionalProperties": {"type": "array"}}
        properties = dict.fromkeys(VARIED, lists)
        return {
            **about, "type": "object", "additionalProperties": False, "properties": properties
        }  # fmt: skip
    if section.inner:
        return {**about, "type": "object", "additionalProperties": _sections(section.inner)}
    one = _one_of(section.makes(), section.given, methods=name in ("contact",))
    if section.form == "list":
        return {**about, "type": "array", "items": one}
    if section.form == "named":
        many = {"type": "object", "additionalProperties": one}
        return {**about, **({"anyOf": [one, many]} if section.alone else many)}
    return {**about, **one}


def _one_of(makes: Sequence[str], given: Iterable[str] = (), methods: bool = False) -> Any:
    """A table of one of several kinds."""
    tables = [_table(name, given, len(makes) > 1) for name in makes]
    if methods:  # laws that a body makes, as "impactor.hertz"
        tables.append(
            {
                "type": "object",
                "required": [KIND],
                "properties": {KIND: {"type": "string", "pattern": r"^[^.]+\.[a-z]\w*$"}},
            }
        )
    return tables[0] if len(tables) == 1 else {"anyOf": tables}


def _table(function: str, given: Iterable[str], several: bool) -> dict[str, Any]:
    known = {n: p for n, p in parameters(function).items() if n not in set(given)}
    properties: dict[str, Any] = {name: _parameter(p) for name, p in known.items()}
    needed = [name for name, p in known.items() if p.needed]
    if several:
        properties = {KIND: {"const": function}, **properties}
        needed = [KIND, *needed]
    table: dict[str, Any] = {
        "type": "object", "additionalProperties": False, "properties": properties
    }  # fmt: skip
    return {**table, "required": needed} if needed else table


def _parameter(one: Parameter) -> dict[str, Any]:
    found = _any(one.kinds)
    if one.about:
        found["description"] = one.about
    if isinstance(one.default, bool | int | float | str) and one.default != "":
        found["default"] = one.default
    return found


def _kind(kind: Kind) -> dict[str, Any]:
    if kind.name == "choice":
        return {"enum": list(kind.options)}
    if kind.name == "list" and kind.each:
        entries = [_any(each) for each in kind.each]
        return {"type": "array", "prefixItems": entries, "minItems": len(entries)}
    if kind.name == "list":
        return {"type": "array", "items": _any(kind.items)}
    if kind.name == "table":
        return {"type": "object", "additionalProperties": _any(kind.items)}
    if kind.name == "object":
        makes = constructors_of(kind.options[0])
        laws = any(name.startswith("Hertz") for name in makes)
        return _one_of(makes, methods=laws) if makes else {"type": "object"}  # type: ignore[no-any-return]
    return dict(_SCHEMA_TYPES[kind.name])


def _any(kinds: Sequence[Kind]) -> dict[str, Any]:
    found = [_kind(kind) for kind in kinds]
    return dict(found[0]) if len(found) == 1 else {"anyOf": found}
