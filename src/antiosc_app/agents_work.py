"""The tools of `antiosc mcp`, which compute as `antiosc run` does, each call in its own process.

A call holds data; nothing in it is executed, and files are read and written only below one folder.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import os
import resource
import signal
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from antiosc.base import checks, materials, progress
from antiosc.base.errors import AntioscError, InputError
from antiosc_app import commands, info, live, new, opened, report, results
from antiosc_app.presentation import Picture, drawn_pictures
from antiosc_app.quantities import quantities, quantity
from antiosc_app.scene_file import schema
from antiosc_app.scene_file.build import Builder, calls_in
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import (
    Document,
    Place,
    checked_document,
    place_text,
    read_document,
)

Table: TypeAlias = dict[str, Any]
Answer: TypeAlias = tuple[Table, list[Picture]]
#: What `status` of a history or a fall means.
STATUS_TEXTS = (
    "completed",
    "completed: tol is not met",
    "stopped early",
    "completed: contact goes on",
)
#: Constants of a material that are told, and their units.
CONSTANT_UNITS = {"E": "Pa", "nu": "1", "rho": "kg/m³", "yield_strength": "Pa"}


class Refusal(InputError):
    """A refused call, with the key to give and its choices; `told`: the answer to the call."""

    def __init__(self, kind: str, sentence: str, key: str = "", choices: Iterable[Any] = ()):
        super().__init__(sentence)
        lines = sentence.splitlines() or ["refused."]
        refusal = {"kind": kind, "key": key, "choices": list(choices), "mistakes": lines}
        self.told = {"status": "refused", "text": lines[0], "quantities": [], "refusal": refusal}


def sha256_of(inputs: object) -> str:
    """SHA-256 of a JSON value."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def path_within(root: Path, name: str, base: Path | None = None) -> Path:
    """The resolved path of `name`, from `base` or `root`; raises Refusal outside of `root`."""
    try:
        path = ((base or root) / name).resolve()
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()
    except (OSError, ValueError, RuntimeError):  # a name that no system takes
        raise Refusal("path", f"{checks.shown(name)} is no path of a file.") from None
    if not path.is_relative_to(root):
        raise Refusal("path", f"{checks.shown(name)} lies outside of the folder of this server.")
    return path


def leaf_values(data: object, place: Place = ()) -> Iterator[tuple[Place, object]]:
    """Yield (place, value) of each value in nested tables and lists."""
    if not isinstance(data, dict | list):
        yield place, data
    else:
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from leaf_values(value, (*place, key))


def hashes_of(base: Path, data: Table, root: Path) -> Table:
    """SHA-256, by path, of each file named by a text in `data`, relative to the folder `base`.

    Raises Refusal for a file outside of `root`, and for null, NaN or infinity.
    """
    hashes = {}
    for place, value in leaf_values(data):
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            raise Refusal("scene", f"{place_text(place)} is no finite number.", place_text(place))
        path = path_within(root, value, base) if isinstance(value, str) else root
        if path.is_file():
            hashes[str(path.relative_to(root))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return hashes


def require_decided(document: Document, root: Path) -> None:
    """Raise Refusal with the choices if the unit, material or supports of a part are missing."""
    from antiosc.io.by_gmsh import ENDINGS_WITH_UNIT
    from antiosc.io.neutral import UNIT_SYSTEMS

    build = Builder(document)
    parts = build.section("parts")
    tables = {f"parts.{name}.": build.section(name, dict, parts) for name in parts}
    free = "drop" in build.data or ("parts" in build.data and "supports" in build.data)
    for at, part in (tables or {"": build.data}).items():
        section, key = ("deck", "path") if "deck" in part else ("geometry", "source")
        table = build.section(section, dict, part)
        if not isinstance(table.get(key), str):
            continue  # the scene itself has the sentence for it
        path = path_within(root, table[key], document.path.parent)

        choices: list[Any]
        if "unit" not in table and path.suffix.lower() not in ENDINGS_WITH_UNIT:
            kind, name, choices = "unit", f"{section}.unit", list(UNIT_SYSTEMS)
        elif section == "geometry" and "material" not in part:
            kind, name, choices = "material", "material", materials.names()
        elif section == "geometry" and "supports" not in part and not free:
            faces = look(root, str(path), table.get("unit"))[0]["faces"]
            kind, name, choices = "support", "supports", [*(one["support"] for one in faces), []]
        else:
            continue
        sentence = f"the {kind} of {path.name} decides the answer: give {at}{name}."
        raise Refusal(kind, sentence, f"{at}{name}", choices)


def look(root: Path, file: str, unit: str | None = None, piece: int | None = None) -> Answer:
    """Inspect a part: its pieces, faces, size, and a draft of a scene without guesses."""
    from antiosc_app.inspecting import inspect_part
    from antiosc_app.skin import face_places

    path = path_within(root, file)
    if not path.is_file():
        raise Refusal("path", f"there is no file {checks.shown(path.name)}.")
    part = inspect_part(path, unit=unit, piece=piece)
    scene, (shape, faces, _) = opened.first_scene(path, part)
    draft, at = scene.sections, face_places(shape, list(faces))
    section, key = ("deck", "path") if part.is_deck else ("geometry", "source")
    draft[section][key] = str(path.relative_to(root))
    guessed = "unit" in part.read_options and unit is None
    if guessed:
        del draft[section]["unit"]
    own = () if part.is_deck else ("material", "supports")
    sides = zip("xyz", (part.box_high - part.box_low).tolist(), strict=True)
    drawing = partial(new.draw_part, replace(part, held=np.zeros_like(part.held)))
    return {
        "text": "\n".join([f"{path.name}: {part.cells_text}, {part.sides_text()}.", *part.notes]),
        "quantities": [quantity(f"size {x}", d, "m", "it is read from the file") for x, d in sides],
        "pieces": [{"low": one.low.tolist(), "high": one.high.tolist()} for one in part.pieces],
        "faces": [{"name": n, "at": at.get(n, ""), "support": one} for n, one in faces.items()],
        "guessed_unit": part.unit_text() if guessed else None,
        "draft": {k: x for k, x in draft.items() if k not in ("title", "output", *own)},
        "give": [*([f"{section}.unit"] if guessed else []), *own],
    }, [Picture("The part", "Red: where it may be struck.", drawing)]


def materials_named(_root: Path, query: str = "") -> Answer:
    """The named materials whose name contains `query`, with their sources."""
    found = [materials.record(n) for n in materials.names() if query.lower() in n.lower()]
    if not found:
        sentence = f"no material is named {checks.shown(query)}."
        raise Refusal("material", sentence, "query", materials.names())
    told = []
    for one, (key, unit) in product(found, CONSTANT_UNITS.items()):
        value = getattr(one, key)
        ends = one.yield_range if key == "yield_strength" else None
        bar = (value - ends[0], ends[1] - value) if ends else "its sources give one value"
        told += [] if value is None else [quantity(f"{one.name}: {key}", value, unit, bar)]
    text = "\n".join(f"{one.name}: {one.line}; {one.source}" for one in found)
    return {"text": text, "quantities": told}, []


def check(root: Path, scene: Document) -> Answer:
    """Check a scene: the commands that can run it; a mistake raises SceneFileError."""
    require_decided(scene, root)
    calls = compile_document(scene)
    text = f"no mistakes found; for {', '.join(calls.runnable_commands()) or 'nothing to run'}."
    told = {"text": text, "quantities": [], "assumed": assumptions(scene, calls)}
    return {**told, "cautions": list(map(str, calls.warnings))}, []


def study(
    command: str, root: Path, scene: Document, pictures: int = 1, page: Path | None = None
) -> Answer:
    """Compute a scene as `antiosc` does by `command`, by default the first that can run it.

    `pictures`: their largest number; `page`: the report to be written.
    """
    require_decided(scene, root)
    if command == "tradeoff":
        made = report.results_of(*commands.compare_methods(scene))
    else:
        command = (
            command or [*compile_document(scene).runnable_commands(), "antiosc run"][0].split()[1]
        )
        made = commands.study_results(scene, commands.compiled_for(scene, command), command)

    shown, parts = opened.summary_data(made), results.presentations(made)
    hit = made.history or made.fall or (made.tradeoff and made.tradeoff.hit)
    told = {
        "text": shown["text"],
        "cards": [{"name": card[0], "text": card[1]} for card in shown["cards"]],
        "quantities": quantities(made),
        "assumed": assumptions(scene, made.compiled),
        "cautions": [*shown["cautions"], *shown["more"]],
        "status": STATUS_TEXTS[getattr(hit, "status", 0)],
    }
    if page is not None:
        report.write_page(made, parts, page)
        told["written"] = str(page.relative_to(root))
    return told, [picture for part in parts[1:] for picture in part.pictures][:pictures]


def report_of(root: Path, scene: Document, path: str, pictures: int = 1) -> Answer:
    """Compute a scene and write its report to the new file `path`."""
    page = path_within(root, path)
    if page.exists():
        raise Refusal("path", f"{checks.shown(path)} exists already, and is left as it is.")
    return study("", root, scene, pictures, report.writable_report_path(str(page)))


def explain(answers: dict[str, Table], result: str, quantity: str) -> tuple[Table, list[str]]:
    """The causes of the error bar of a number.

    `answers`: hash -> earlier answer; `result`: the hash of one; `quantity`: the number's name.
    """
    numbers = answers.get(result, {}).get("quantities", [])
    found = [one for one in numbers if one["name"] == quantity]
    if not found:
        key = "quantity" if numbers else "result"
        known = dict.fromkeys(one["name"] for one in numbers) or answers
        raise Refusal(key, "no answer with this hash has a number of this name.", key, known)
    form = "{cause}: -{below:.2g} / +{above:.2g}; {narrowed_by}."
    told = [form.format(**one) for entry in found for one in entry["causes"]]
    text = "\n".join(told or [found[0]["bar"]])
    return {"status": "completed", "text": text, "quantities": found, "of": result}, []


def assumptions(document: Document, scene: Any) -> list[Table]:
    """Each key that `document` leaves open, with the value used and its origin."""
    given = dict(leaf_values(document.data))
    chosen = {
        place_text(place): {"value": value, "by": "the rule of auto"}
        for place, value in leaf_values(scene.document.data)
        if given.get(place) != value
    }
    for call in calls_in([*vars(scene).values()]):
        section = schema.SECTIONS[str(call.place[0]) if call.place else "title"]
        kinds = section.callables
        for kind in kinds if len(kinds) == 1 else {call.name} & set(kinds):
            defaults = inspect.signature(schema.callable_of(kind)).parameters
            keys = schema.parameters_of(kind).keys() & defaults.keys()
            for name in keys - call.arguments.keys() - set(section.given.split()):
                value = live.plain_json(defaults[name].default)
                chosen[place_text((*call.place, name))] = {"value": value, "by": "default"}
    return [{"key": key, **one} for key, one in sorted(chosen.items())]


#: Tool -> what answers its call, by the folder and the arguments, and what it does.
TOOLS: dict[str, tuple[Callable[..., Any], str]] = {
    "look": (look, "A part (mesh, CAD, deck): pieces, faces, their supports, size, unit, a draft."),
    "materials": (materials_named, "Materials whose name contains the query, with sources."),
    "check": (check, "Look for mistakes in a scene, without meshing."),
    "strike": (partial(study, "run"), "Compute the impact of a scene."),
    "drop": (partial(study, "run"), "Compute the fall of a part: a scene with the section drop."),
    "map": (partial(study, "map"), "Compute an impact at many points: the section map."),
    "sweep": (partial(study, "sweep"), "Compute an impact for several values: the section sweep."),
    "tradeoff": (partial(study, "tradeoff"), "Error against seconds and memory of an impact."),
    "report": (report_of, "Compute a scene and write its report, a new .html file."),
    "explain": (explain, "The causes of a number's bar, and what narrows each."),
}  # fmt: skip


def answer(root: Path, tool: str, arguments: Table) -> tuple[Table, list[str]]:
    """(answer of a tool, its pictures as PNG in base64); errors become refusals."""
    inputs: Table = {"tool": tool, "arguments": arguments}
    values, named, base = dict(arguments), arguments, root
    drawn: list[str] = []
    try:
        if "scene" in values:
            given = values["scene"]
            table = root / "scene.json", given, json.dumps(given, indent=1)
            scene = (
                read_document(path_within(root, given))
                if isinstance(given, str)
                else checked_document(*table)
            )
            values["scene"], named, base = scene, scene.data, scene.path.parent
        inputs["files"] = hashes_of(base, named, root)
        told, views = TOOLS[tool][0](root, **values)
        pngs = (view._replace(ending=".png") for view in views)
        drawn = [one.data.partition(",")[2] for one in drawn_pictures(pngs) if one.data]
    except Refusal as refusal:
        told = refusal.told
    except (AntioscError, MemoryError) as error:
        sentence = getattr(error, "sentence", "") or str(error) or "the memory was not enough."
        told = Refusal(type(error).__name__, sentence).told
    except Exception as error:
        traceback.print_exc()
        fault = f"{type(error).__name__}: {error}".splitlines()[0]
        told = Refusal("fault", f"the call failed by a fault of antiosc: {fault}").told
    common = {"tool": tool, "version": info.antiosc_version(), "hash": sha256_of(inputs)}
    whole: Table = {"status": "completed"} | told | common
    return {name: live.plain_json(value) for name, value in whole.items()}, drawn


def run_call(wire: Connection, root: Path, memory: int, tool: str, arguments: Table) -> None:
    """Main function of a call's process: send progress texts, and last the answer."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    threading.Thread(target=kill_when_closed, args=(wire,), daemon=True).start()
    with progress.following_progress(wire.send):
        told = answer(root, tool, arguments)
    wire.send(told)


def kill_when_closed(wire: Connection) -> None:
    """Kill the process group of this call when the server closes its end of `wire`."""
    wire.poll(None)
    os.killpg(0, signal.SIGKILL)
