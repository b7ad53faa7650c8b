"""What is struck: a mesh, a deck, matrices, an assembly, a model or a measurement, reduced."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from antiosc.app.scene_file.build import Builder, Call, Mistake
from antiosc.app.scene_file.kinds import NUMBER, Kind
from antiosc.app.scene_file.locations import Place
from antiosc.app.scene_file.parameters import Parameter
from antiosc.app.scene_file.problems import label, unknown
from antiosc.app.scene_file.sections import MODELS, SECTIONS, SOURCES

#: What a support may fix.
FIXED = ("all", "x", "y", "z", "rx", "ry", "rz")
#: Source of the structure -> the sections of a part that it takes, and what else it has in place.
_BESIDE = {
    "geometry": ("material structure supports attached", ""),
    "deck": ("supports attached", "a deck has its own materials"),
    "parts": ("supports attached", "each part has its own: [parts.NAME.{0}]"),
    "matrices": (
        "",
        'matrices have their own; fix nodes by supports = {{12 = "all"}} in [matrices]',
    ),
    "model": ("", "a saved model has its own"),
    "frf": ("", "a measurement has none"),
}


def source(build: Builder) -> str:
    """Which section says what is struck; "" for rigid bodies alone."""
    there = [name for name in SOURCES if name in build.data]
    if len(there) > 1:
        build.note(
            (there[1],),
            f"[{there[0]}] and [{there[1]}] both say what is struck; keep one of them.",
        )
    if not there and not build.data.get("bodies"):
        names = ", ".join(f"[{name}]" for name in SOURCES)
        build.note((), f"the scene does not say what is struck: give one of {names}.")
    return there[0] if there else ""


def structure(build: Builder, source: str) -> Call | None:
    """The structure; None for a saved model, for rigid bodies, and for a mesh that is refined."""
    for name in ("joints", "at", "points", "assembly"):
        if name in build.data and source != "parts":
            build.note((name,), f"[{name}] belongs to an assembly; this scene has no [parts.NAME].")
    taken, remedy = _BESIDE.get(source, ("material structure supports attached", ""))
    for name in ("material", "structure", "supports", "attached"):
        if name in build.data and name not in taken.split():
            build.note((name,), f"[{name}] has no place beside [{source}]: {remedy.format(name)}.")
    if source == "parts":
        return _assembly(build)
    if source == "matrices":
        return build.table("matrices")
    if source == "deck" or (source == "geometry" and not refined(build)):
        return _part(build, build.data, ())
    return None


def refined(build: Builder) -> bool:
    """Whether the mesh is chosen by [strike]: not where the structure has more than a mesh."""
    return (
        "geometry" in build.data
        and "strike" in build.data
        and not ({"attached", "structure"} & set(build.data))
    )


def to_strike(build: Builder, structure: Call | None) -> dict[str, Any]:
    """What [strike] takes: a structure, or a file or mesh with material and supports."""
    if not refined(build):
        return {"source": structure}
    read = build.table("geometry")
    alone = read is not None and set(read.arguments) == {"source"}
    place = read.arguments["source"] if alone and read is not None else read
    supports = _supported(build, build.data, ())
    return {"source": place, "material": material(build, build.data, ()), **supports}


def _part(build: Builder, data: Mapping[str, Any], place: Place) -> Call | None:
    """The structure of a deck, or of a mesh, in a scene or in a part of it."""
    supported = _supported(build, data, place)
    if "deck" in data:
        return build.table("deck", data, place, given=supported)
    given = {"mesh": build.table("geometry", data, place), **supported}
    given["material"] = material(build, data, place)
    options = build.part("structure", dict, data)
    at = "structure" if "structure" in data else "material"  # the section that is there
    return build.call(SECTIONS["structure"], options, (*place, at), given)


def _supported(build: Builder, data: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The arguments `supports` and `attached`, where there are any."""
    for i, table in enumerate(build.part("supports", list, data)):
        fix = table.get("fix", "all") if isinstance(table, dict) else "all"
        for name in fix if isinstance(fix, list) else [fix]:
            if isinstance(name, str) and name not in FIXED:
                at = (*place, "supports", i, "fix")
                build.note(at, unknown(f"{label(at)}: the component", name, FIXED))
    given = {name: build.listed(name, data, place) for name in ("supports", "attached")}
    return {name: value for name, value in given.items() if value}


def material(build: Builder, data: Mapping[str, Any], place: Place) -> Any:
    """One material, or a table of them by groups of cells."""
    table, at = data.get("material"), (*place, "material")
    section = SECTIONS["material"]
    if not isinstance(table, dict):
        build.note(
            place,
            f"there is no [{label(at)}]; it takes kind and the constants, as in `[{label(at)}]`"
            ' `kind = "Solid"`.',
        )
        return None
    if table and all(isinstance(each, dict) for each in table.values()):
        made = {group: build.call(section, each, (*at, group)) for group, each in table.items()}
        return made if None not in made.values() else None
    return build.call(section, table, at)


def _assembly(build: Builder) -> Call | None:
    parts: dict[str, Call | None] = {}
    for name, data in build.part("parts").items():
        place: Place = ("parts", name)
        if not isinstance(data, dict):
            build.note(place, f"{label(place)} must be a table, [parts.{name}].")
            continue
        build.known_sections(data, SECTIONS["parts"].inner, place)
        if "deck" in data or "geometry" in data:
            parts[name] = _part(build, data, place)
        else:
            build.note(place, f"{label(place)} lacks a geometry or a deck.")
    joints, placed, points = build.listed("joints"), build.named("at"), _points(build)
    for call in joints:
        _joint_ends(build, call, list(parts))
    for name in placed:
        build.names("part", name, list(parts), ("at", name))
    more = {"at": placed, "points": points, **_supported(build, build.data, ())}
    given: dict[str, Any] = {"parts": parts if None not in parts.values() else None}
    given |= {"joints": joints} | {name: value for name, value in more.items() if value}
    return build.section("assembly", given)


def _points(build: Builder) -> dict[str, Any]:
    found = {}
    kind = Parameter("point", (Kind("list", items=(NUMBER,)),), about="coordinates, m")
    for name, value in build.part("points").items():
        try:
            found[name] = build.value(kind, value, ("points", name))
        except Mistake:
            continue
    return found


def _joint_ends(build: Builder, call: Call, parts: list[str]) -> None:
    """Ends "part:group" and ("part", point) name parts that exist."""
    known = [*parts, *build.part("points")]
    for key in ("a", "b", "group", "point"):
        end = call.arguments.get(key)
        if isinstance(end, tuple) and end and isinstance(end[0], str):
            end = end[0]
        if isinstance(end, str) and parts:
            build.names("part", end.partition(":")[0], known, (*call.place, key))


def model(build: Builder, source: str, structure: Call | None) -> Call | None:
    """The reduced model, where something needs one."""
    sites = build.named("sites")
    given = build.data.get("sites")
    if "from_frf" in build.data and source != "frf":
        build.note(("from_frf",), "[from_frf] belongs to a measurement; this scene has no [frf].")
    if source in ("", *MODELS) and given:
        build.note(("sites",), "[sites] belong to a structure; this scene has none of its own.")
    if source == "model":
        return build.table("model")
    if source == "frf":
        return build.section("from_frf", {"frf": build.table("frf")})
    needed = {"extract", "simulate", "contacts", "run", "sweep"} & set(build.data)
    if not source or "strike" in build.data or not (needed or sites):
        return None
    if not given:
        build.note((source,), "the scene has no site: give [sites.NAME] with point and direction.")
    several = len(given or {}) > 1 or "contacts" in build.data
    if several and "contacts" not in build.data and "simulate" in build.data:
        build.note(
            ("sites",),
            "[simulate] takes one site, and there are several: give [[contacts]] between"
            ' "structure:SITE" and [bodies.NAME].',
        )
    site: Any = sites if several else next(iter(sites.values()), None)
    return build.section("extract", {"structure": structure, "site": site})
