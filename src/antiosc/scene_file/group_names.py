"""Whether the groups that a scene names exist in the mesh files and decks that it names.

Finished meshes and decks are read for it (by the reader that a run takes); nothing is meshed or
assembled.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from antiosc.errors import (
    AntioscError,
    InputError,
    MissingDependencyError,
    finite_element_packages,
    without_warnings,
)
from antiosc.scene_file.locations import Place
from antiosc.scene_file.problems import label, unknown
from antiosc.scene_file.program import Call, Evaluation, calls_in
from antiosc.scene_file.scene import Compiled

#: Largest file that is read for its groups, bytes.
LARGEST = 50_000_000
#: Endings of files that have to be meshed first.
GEOMETRIES = (".geo", ".geo_unrolled", ".step", ".stp", ".brep", ".iges", ".igs", ".stl")


def check(found: Compiled) -> list[str]:
    """Note groups that do not exist, and raise; return sentences on files that were not read."""
    problems, told = found.document.problems, []
    for part, call in _meshes(found):
        name = _path(call).name
        try:
            known, why = _groups(call)
        except InputError as error:
            problems.add(call.place, f"{name} cannot be read: {error}")
            continue
        if why:
            told.append(f"the groups of {name} were not checked: {why}")
            continue
        for place, group in _named(found.document.data, part):
            found_name = group.partition(":")[2] if part else group
            if found_name not in known:
                what = f"{label(place)}: in {name} the group"
                problems.add(place, unknown(what, found_name, known))
    problems.raise_if_any()
    return told


def _meshes(found: Compiled) -> Iterator[tuple[str, Call]]:
    """("" or name of a part, the call of read_mesh or read_model)."""
    for statement in found.structure:
        for call in calls_in(statement.expression):
            if call.function in ("ao.read_mesh", "ao.read_model"):
                inner = call.place[:1] == ("parts",)
                yield (str(call.place[1]) if inner else "", call)
    run = found.simulation
    if run is not None and run.expression.function == "ao.strike":
        source = run.expression.arguments["*source"]
        if isinstance(source, str):
            yield "", Call("ao.read_mesh", {"source": source}, ("geometry",))


def _path(call: Call) -> Path:
    """The file that a call of read_mesh or read_model reads."""
    return Path(str(call.arguments["path" if call.function == "ao.read_model" else "source"]))


def _groups(call: Call) -> tuple[list[str], str]:
    """(names of the groups of a mesh file, or why they are not known)."""
    path = _path(call)
    if path.suffix.lower() in GEOMETRIES:
        return [], "a geometry has them once it is meshed, by antiosc run --dry-run."
    if path.stat().st_size > LARGEST:
        return [], f"the file is larger than {LARGEST / 1e6:g} MB."

    def failed(_: Call, error: Exception) -> Exception:
        return error

    try:
        if call.function == "ao.read_model":
            return _groups_of_deck(call), ""
        mesh = Evaluation(failed).value(call)
    except MissingDependencyError as error:
        return [], f"{error}"
    except InputError:
        raise
    except AntioscError as error:
        raise InputError(str(error)) from None
    return list(mesh.groups), ""


def _groups_of_deck(call: Call) -> list[str]:
    """Names of the groups of a deck."""
    with finite_element_packages():
        from antiosc.fem.assembly.from_deck import groups_of_deck
    with without_warnings():  # a run tells what of the deck it does not take
        return groups_of_deck(**call.arguments)


def _named(data: Mapping[str, Any], part: str) -> Iterator[tuple[Place, str]]:
    """Places of a scene that name a group of a mesh, and the name; of a part "part:group"."""
    if part:
        yield from _in_joints(data, part)
    own: Mapping[str, Any] = data["parts"][part] if part else data
    start: Place = ("parts", part) if part else ()
    mark = f"{part}:" if part else ""
    material = own.get("material", {})
    if material and all(isinstance(each, dict) for each in material.values()):
        for group in material:
            yield (*start, "material", group), mark + group
    for name in ("supports", "attached"):
        for i, table in enumerate(own.get(name, ())):
            if isinstance(table.get("where"), str):
                yield (*start, name, i, "where"), mark + table["where"]
    if part:
        return
    for name in ("sites", "probes"):
        for key, table in data.get(name, {}).items():
            if isinstance(table.get("point"), str):
                yield (name, key, "point"), table["point"]
    if isinstance(data.get("map", {}).get("where"), str):
        yield ("map", "where"), data["map"]["where"]


def _in_joints(data: Mapping[str, Any], part: str) -> Iterator[tuple[Place, str]]:
    """Ends "part:group" of joints and sites of an assembly."""
    for i, table in enumerate(data.get("joints", ())):
        for key in ("a", "b", "group"):
            if isinstance(table.get(key), str) and table[key].startswith(f"{part}:"):
                yield ("joints", i, key), table[key]
    for name in ("sites", "probes"):
        for key, table in data.get(name, {}).items():
            point = table.get("point")
            if isinstance(point, str) and point.startswith(f"{part}:"):
                yield (name, key, "point"), point
