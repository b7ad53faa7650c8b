"""What is struck: a mesh, a deck, matrices, an assembly or a saved model, and its reduction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from antiosc.scene_file.build import Mistake
from antiosc.scene_file.kinds import NUMBER, Kind
from antiosc.scene_file.locations import Place
from antiosc.scene_file.parameters import Parameter
from antiosc.scene_file.problems import label, unknown
from antiosc.scene_file.program import Call, Name, Statement
from antiosc.scene_file.sections import SECTIONS, SOURCES
from antiosc.scene_file.tables import Tables

#: What a support may fix.
FIXED = ("all", "x", "y", "z", "rx", "ry", "rz")


def source(tables: Tables) -> str:
    """Which section says what is struck; "" for rigid bodies alone."""
    there = [name for name in SOURCES if name in tables.data]
    if len(there) > 1:
        tables.problems.add(
            (there[1],),
            f"[{there[0]}] and [{there[1]}] both say what is struck; keep one of them.",
        )
    if not there and not tables.data.get("bodies"):
        tables.problems.add(
            (),
            f"the scene does not say what is struck: give one of "
            f"{', '.join(f'[{name}]' for name in SOURCES)}.",
        )
    return there[0] if there else ""


def structure(tables: Tables, source: str) -> list[Statement]:
    """Statements that make `structure`; none for a saved model and for rigid bodies."""
    for name in ("joints", "at", "points", "assembly"):
        if name in tables.data and source != "parts":
            tables.problems.add(
                (name,), f"[{name}] belongs to an assembly; this scene has no [parts.NAME]."
            )
    if source != "geometry":
        taken = {"deck": ("supports", "attached"), "parts": ("supports", "attached")}
        for name in ("material", "structure", "supports", "attached"):
            if name in tables.data and source and name not in taken.get(source, ()):
                tables.problems.add((name,), _not_beside(name, source))
    if source == "parts":
        return [Statement("structure", _assembly(tables))]
    if source in ("geometry", "deck", "matrices"):
        return _single(tables, source)
    return []


def _not_beside(name: str, source: str) -> str:
    remedy = {
        "deck": "a deck has its own materials",
        "matrices": 'matrices have their own; fix nodes by supports = {12 = "all"} in [matrices]',
        "parts": f"each part has its own: [parts.NAME.{name}]",
        "model": "a saved model has its own",
    }[source]
    return f"[{name}] has no place beside [{source}]: {remedy}."


def _single(tables: Tables, source: str) -> list[Statement]:
    if source == "matrices":
        return [Statement("structure", tables.table("matrices"))]
    if source == "deck":
        return [Statement("structure", _deck(tables, tables.data, ()))]
    mesh, structure = _meshed(tables, tables.data, (), Name("mesh"))
    if refined(tables, source):
        return [Statement("mesh", mesh)] if set(tables.data["geometry"]) != {"source"} else []
    return [Statement("mesh", mesh), Statement("structure", structure)]


def refined(tables: Tables, source: str) -> bool:
    """Whether the mesh is chosen by [strike]: not where the structure has more than a mesh."""
    return (
        source == "geometry"
        and "strike" in tables.data
        and not ({"attached", "structure"} & set(tables.data))
    )


def to_strike(tables: Tables, source: str) -> dict[str, Any]:
    """What [strike] takes: a structure, or a file or mesh with material and supports."""
    if not refined(tables, source):
        return {"*source": Name("structure")}
    read = tables.table("geometry")
    alone = read is not None and set(read.arguments) == {"source"}
    place: Any = read.arguments["source"] if alone and read is not None else Name("mesh")
    given = {"*source": place, "material": material(tables, tables.data, ())}
    supports = tables.listed("supports")
    return {**given, "supports": supports} if supports else given


def _deck(tables: Tables, data: Mapping[str, Any], place: Place) -> Call | None:
    return tables.table("deck", data, place, given=_supported(tables, data, place))


def _supported(tables: Tables, data: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The arguments `supports` and `attached`, where there are any."""
    for i, table in enumerate(tables.part(data, "supports", list)):
        fix = table.get("fix", "all") if isinstance(table, dict) else "all"
        for name in fix if isinstance(fix, list) else [fix]:
            if isinstance(name, str) and name not in FIXED:
                at = (*place, "supports", i, "fix")
                tables.problems.add(at, unknown(f"{label(at)}: the component", name, FIXED))
    given = {name: tables.listed(name, data, place) for name in ("supports", "attached")}
    return {name: value for name, value in given.items() if value}


def _meshed(
    tables: Tables, data: Mapping[str, Any], place: Place, mesh: Any
) -> tuple[Call | None, Call | None]:
    """The mesh and the structure of a part; `mesh` stands for it in the structure."""
    read = tables.table("geometry", data, place)
    given = {"*mesh": mesh or read, "*material": material(tables, data, place)}
    given |= _supported(tables, data, place)
    section = SECTIONS["structure"]
    options = tables.part(data, "structure", dict)
    made = tables.build.call(
        section.makes(), options, (*place, "structure"), given=given, withheld=section.given
    )
    return read, made


def material(tables: Tables, data: Mapping[str, Any], place: Place) -> Any:
    """One material, or a table of them by groups of cells."""
    table = data.get("material")
    if not isinstance(table, dict):
        where = label((*place, "material"))
        tables.problems.add(
            place,
            f"there is no [{where}]; it takes kind and the constants, as in `[{where}]`"
            ' `kind = "Solid"`.',
        )
        return None
    makes = tables.makes("material", (*place, "material"))
    if table and all(isinstance(each, dict) for each in table.values()):
        return {
            group: tables.build.call(makes, each, (*place, "material", group))
            for group, each in table.items()
        }
    return tables.build.call(makes, table, (*place, "material"))


def _assembly(tables: Tables) -> Call | None:
    parts = {}
    for name, data in tables.part(tables.data, "parts", dict).items():
        place: Place = ("parts", name)
        if not isinstance(data, dict):
            tables.problems.add(place, f"{label(place)} must be a table, [parts.{name}].")
            continue
        tables.known_sections(data, {**SECTIONS["parts"].inner}, place)
        if "deck" in data:
            parts[name] = _deck(tables, data, place)
        elif "geometry" in data:
            parts[name] = _meshed(tables, data, place, None)[1]
        else:
            tables.problems.add(place, f"{label(place)} lacks a geometry or a deck.")
    given: dict[str, Any] = {"*parts": parts, "joints": tables.listed("joints")}
    for call in given["joints"]:
        _joint_ends(tables, call, list(parts))
    placed = tables.named("at")
    for name in placed:
        tables.build.names("part", name, list(parts), ("at", name))
    more = {"at": placed, "points": _points(tables), **_supported(tables, tables.data, ())}
    given |= {name: value for name, value in more.items() if value}
    section = SECTIONS["assembly"]
    options = tables.part(tables.data, "assembly", dict)
    return tables.build.call(
        section.makes(), options, ("assembly",), given=given, withheld=section.given
    )


def _points(tables: Tables) -> dict[str, Any]:
    found = {}
    kind = Parameter("point", (Kind("list", items=(NUMBER,)),), True, None, "coordinates, m")
    for name, value in tables.part(tables.data, "points", dict).items():
        try:
            found[name] = tables.build.value(kind, value, ("points", name))
        except Mistake:
            continue
    return found


def _joint_ends(tables: Tables, call: Call, parts: list[str]) -> None:
    """Ends "part:group" and ("part", point) name parts that exist."""
    known = [*parts, *tables.part(tables.data, "points", dict)]
    for key in ("a", "b", "group", "point"):
        end = call.arguments.get(key)
        if isinstance(end, tuple) and end and isinstance(end[0], str):
            end = end[0]
        if isinstance(end, str) and parts:
            tables.build.names("part", end.partition(":")[0], known, (*call.place, key))


# -- the model


def sites(tables: Tables, source: str) -> dict[str, Call]:
    """Name -> site."""
    sites = tables.named("sites")
    if source in ("", "model") and tables.data.get("sites"):
        tables.problems.add(
            ("sites",), "[sites] belong to a structure; this scene has none of its own."
        )
    return sites


def model(tables: Tables, source: str, sites: Mapping[str, Call]) -> list[Statement]:
    """The statement that makes `model`, where something needs one."""
    if source == "model":
        return [Statement("model", tables.table("model"))]
    needed = bool({"extract", "simulate", "contacts", "run", "sweep"} & set(tables.data))
    if not source or "strike" in tables.data or not (needed or sites):
        return []
    given_sites = tables.data.get("sites")
    if not given_sites:
        tables.problems.add(
            (source,), "the scene has no site: give [sites.NAME] with point and direction."
        )
    several = len(given_sites or {}) > 1 or "contacts" in tables.data
    site: Any = dict(sites) if several else next(iter(sites.values()), None)
    section = SECTIONS["extract"]
    call = tables.build.call(
        section.makes(),
        tables.part(tables.data, "extract", dict),
        ("extract",),
        given={"*structure": Name("structure"), "*site": site},
        withheld=section.given,
    )
    if several and "contacts" not in tables.data and "simulate" in tables.data:
        tables.problems.add(
            ("sites",),
            "[simulate] takes one site, and there are several: give [[contacts]] between"
            ' "structure:SITE" and [bodies.NAME].',
        )
    return [Statement("model", call)]
