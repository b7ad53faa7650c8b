"""One tool call of `antiosc mcp`, in a process of its own: the road of `antiosc run`.

The process reads a request as JSON and writes lines of JSON: what it does, then the answer. A
request holds data; nothing in it is executed, and files are read and written only below one folder.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import os
import resource
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antiosc.base import checks, materials, progress
from antiosc.base.errors import AntioscError, InputError
from antiosc_app import commands, info, live, new, report, results
from antiosc_app.opened import summary
from antiosc_app.presentation import Picture, drawn_pictures
from antiosc_app.quantities import quantities, quantity
from antiosc_app.scene_file import schema
from antiosc_app.scene_file.build import Evaluation, calls_in
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import Document, Place, checked, label, read
from antiosc_app.scene_file.scene import STUDIES

if TYPE_CHECKING:
    from antiosc_app.scene_file.scene import CompiledScene

Table: TypeAlias = dict[str, Any]
#: What a tool answers, and its pictures.
Answer: TypeAlias = tuple[Table, list[Picture]]
#: What `status` of a history or a fall means.
STATUS = ("completed", "completed: tol is not met", "stopped early", "completed: contact goes on")
#: Why numbers of files and of materials have no bar.
AS_READ, ONE_VALUE = "it is read from the file", "its sources give one value"
#: Objects of a scene whose defaults are told.
OBJECTS = ("structure", "model", "impactor", "contact", "scene", "history", "fall", "map", "batch")


class Refusal(InputError):
    """What decides the answer is not given, or may not be: its kind, key and choices."""

    def __init__(self, kind: str, sentence: str, key: str = "", choices: Any = ()) -> None:
        super().__init__(sentence)
        self.told = {"kind": kind, "key": key, "choices": list(choices)}


def refused(sentence: str, **told: Any) -> Table:
    """The answer of a refusal: its first sentence, and all mistakes."""
    lines = sentence.splitlines() or ["refused."]
    refusal = {"message": lines[0], "mistakes": lines, "key": "", "choices": [], **told}
    return {"status": "refused", "text": lines[0], "quantities": [], "refusal": refusal}


def hash_of(inputs: object) -> str:
    """The hash of inputs that are JSON."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


# -- what is given


def within(root: Path, name: str, base: Path | None = None) -> Path:
    """The path of a file below the folder, links resolved; else Refusal."""
    try:
        path = ((base or root) / name).resolve()
    except (OSError, ValueError, RuntimeError):
        raise Refusal("path", f"{checks.shown(name)} is no path of a file.") from None
    if not path.is_relative_to(root):
        raise Refusal("path", f"{checks.shown(name)} lies outside of the folder of this server.")
    return path


def document_of(scene: Table | str, root: Path) -> Document:
    """The scene of a call, as its file is read, or from its sections."""
    if isinstance(scene, str):
        document = read(within(root, scene))
    else:
        document = checked(root / "scene.json", scene, json.dumps(scene, indent=1))
    for place, value in values_in(document.data):
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            raise Refusal("scene", f"{label(place)} is no finite number.", label(place))
        if isinstance(value, str):
            within(root, value, document.path.parent)
    return document


def values_in(data: object, place: Place = ()) -> Iterator[tuple[Place, object]]:
    """Yield (place, value) of each value in nested tables and lists."""
    if not isinstance(data, dict | list):
        yield place, data
        return
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield from values_in(value, (*place, key))


def require_decided(document: Document, root: Path) -> None:
    """Refusal if a material, a support or the unit of a file is missing, with the choices."""
    from antiosc.io.cad import STATES_UNIT
    from antiosc.io.neutral import SYSTEMS

    data = document.data
    parts = data["parts"] if isinstance(data.get("parts"), dict) else {"": data}
    free = "drop" in data or (parts is not data and "supports" in data)
    for name, part in parts.items():
        sections = part if isinstance(part, dict) else {}
        section = "deck" if "deck" in sections else "geometry"
        table = sections.get(section)
        file = table.get("path", table.get("source")) if isinstance(table, dict) else None
        if not isinstance(file, str):
            continue
        at = f"parts.{name}." if name else ""
        path = within(root, file, document.path.parent)

        if "unit" not in table and (path.suffix.lower() not in STATES_UNIT):
            sentence = f"{path.name} states no unit: give {at}{section}.unit."
            raise Refusal("unit", sentence, f"{at}{section}.unit", SYSTEMS)
        if section == "geometry" and "material" not in sections:
            sentence = f"the material decides the answer: give {at}material."
            raise Refusal("material", sentence, f"{at}material", materials.names())
        if section == "geometry" and "supports" not in sections and not free:
            choices = [*seen(path, table.get("unit"))[2].values(), []]
            sentence = f"the supports decide the answer: give {at}supports, [] of a free part."
            raise Refusal("support", sentence, f"{at}supports", choices)


# -- the tools


def seen(path: Path, unit: str | None, piece: int | None = None) -> tuple[Any, Any, Table, Table]:
    """(look at a part, its first scene, name of a face -> its support, name -> where it lies)."""
    from antiosc_app.edited import EditedScene
    from antiosc_app.inspecting import inspect_part
    from antiosc_app.skin import places, skin

    if not path.is_file():
        raise Refusal("path", f"there is no file {checks.shown(path.name)} in its folder.")
    look = inspect_part(path, unit=unit, piece=piece)
    scene = EditedScene(path, look, {}, ())
    calls = compiled(scene.document())
    shape, faces, _ = skin(Evaluation(calls.document)(calls.structure), look)
    return look, scene.sections, dict(faces), places(shape, list(faces))


def look(root: Path, file: str, unit: str | None = None, piece: int | None = None) -> Answer:
    """A part: pieces, faces, size, and a scene that lacks what the file does not decide."""
    path = within(root, file)
    part, scene, faces, where = seen(path, unit, piece)
    known = {"geometry", "deck", "sites", "extract", "impactor", "contact", "simulate"}
    draft = {name: dict(table) for name, table in scene.items() if name in known}
    section, key = ("deck", "path") if part.of_deck else ("geometry", "source")
    draft[section][key] = str(path.relative_to(root))
    guessed = "unit" in part.read and unit is None
    if guessed:
        del draft[section]["unit"]

    sides = zip("xyz", (part.high - part.low).tolist(), strict=True)
    missing = [f"{section}.unit"] * guessed + ["material", "supports"] * (not part.of_deck)
    drawing = partial(new.draw, replace(part, held=np.zeros_like(part.held)))
    return {
        "text": "\n".join([f"{path.name}: {part.cells}, {part.sides_text()}.", *part.notes]),
        "quantities": [quantity(f"size {axis}", size, "m", AS_READ) for axis, size in sides],
        "pieces": [{"low": one.low.tolist(), "high": one.high.tolist()} for one in part.pieces],
        "faces": [{"name": n, "at": where.get(n, ""), "support": t} for n, t in faces.items()],
        "guessed_unit": part.unit_text() if guessed else None,
        "draft": draft,
        "decide": missing,
    }, [Picture("The part", "The part; red: where it may be struck.", drawing)]


def materials_named(root: Path, query: str = "") -> Answer:
    """The materials whose name contains a text, with their sources."""
    names = materials.names()
    records = [materials.record(name) for name in names if query.lower() in name.lower()]
    if not records:
        sentence = f"no material is named {checks.shown(query)}."
        raise Refusal("material", sentence, "query", names)
    told = []
    for one in records:
        for key, unit in (("E", "Pa"), ("nu", "1"), ("rho", "kg/m³")):
            told.append(quantity(f"{one.name}: {key}", getattr(one, key), unit, ONE_VALUE))
        if one.yield_strength is not None:
            bar = one.yield_range or ONE_VALUE
            told.append(quantity(f"{one.name}: yield_strength", one.yield_strength, "Pa", bar))
    text = "\n".join(f"{one.name}: {one.line}; {one.source}" for one in records)
    return {"text": text, "quantities": told}, []


def check(root: Path, scene: Document) -> Answer:
    """The mistakes of a scene, and what can run it."""
    require_decided(scene, root)
    calls = compiled(scene)
    can = ", ".join(calls.does()) or "nothing to run"
    told = {"text": f"no mistakes found; for {can}.", "assumed": assumed(scene, calls)}
    return {**told, "cautions": list(map(str, calls.warnings))}, []


def study(command: str, root: Path, scene: Document, path: str | None = None) -> Answer:
    """A scene as `antiosc run` computes it; `path`: of its report, of the first study it has."""
    require_decided(scene, root)
    page = None if path is None else free_page(root, path)
    if command == "tradeoff":
        made = report.results_of(*commands.compared(scene))
    else:
        calls = compiled(scene)
        has = (name for name, one in STUDIES.items() if getattr(calls, one.result) is not None)
        command = command or next(has, "run")
        made = commands.made(scene, commands.of_study(scene, command), command)
    shown = summary(made)
    hit = made.history or made.fall or (made.tradeoff and made.tradeoff.hit)
    told = {
        "text": shown["text"],
        "cards": [{"name": one[0], "text": one[1]} for one in shown["cards"]],
        "quantities": quantities(made),
        "assumed": assumed(scene, made.compiled),
        "cautions": [*shown["cautions"], *shown["more"]],
        "status": STATUS[getattr(hit, "status", 0)],
    }
    parts = results.presentations(made)
    if page is not None:
        report.write_page(made, parts, page)
        told["written"] = str(page.relative_to(root))
    return told, [picture for part in parts[1:] for picture in part.pictures]


def free_page(root: Path, path: str) -> Path:
    """The path of a report that is not there yet."""
    page = within(root, path)
    if page.exists():
        raise Refusal("path", f"{checks.shown(path)} exists already, and is left as it is.")
    return report.checked(str(page))


def assumed(document: Document, scene: CompiledScene) -> list[Table]:
    """What was not given: each key with the value that it has, and by what."""
    given = dict(values_in(document.data))
    told = [
        {"key": label(place), "value": value, "by": "the rule of auto"}
        for place, value in values_in(scene.document.data)
        if given.get(place) != value and place[0] != "strike"
    ]
    for call in calls_in([getattr(scene, name) for name in OBJECTS]):
        section = schema.SECTIONS.get(str(call.place[0])) if call.place else None
        kinds = () if section is None else section.makes
        function = call.name if call.name in kinds else "".join(kinds[:1])
        if not function or (len(kinds) > 1 and call.name not in kinds):
            continue
        defaults = inspect.signature(schema.resolved(function)).parameters
        for name in schema.parameters(function).keys() - call.arguments.keys():
            if name in defaults and name not in section.given.split():
                value = live.plain(defaults[name].default)
                key = label((*call.place, name))
                told.append({"key": key, "value": value, "by": "default"})
    return sorted({one["key"]: one for one in told}.values(), key=lambda one: one["key"])


#: Tool -> what answers its call.
TOOLS: dict[str, Callable[..., Answer]] = {
    **{"look": look, "materials": materials_named, "check": check, "report": partial(study, "")},
    **{"strike": partial(study, "run"), "drop": partial(study, "run")},
    **{name: partial(study, name) for name in ("map", "sweep", "tradeoff")},
}


# -- the process


def answer(root: Path, tool: str, arguments: Table) -> tuple[Table, list[str]]:
    """(answer of a tool, its pictures as PNG in base64)."""
    inputs: Table = {"tool": tool, "arguments": arguments}
    values = dict(arguments)
    count = values.pop("pictures", 1)
    drawn: list[str] = []
    try:
        if "scene" in values:
            values["scene"] = document_of(values["scene"], root)
        inputs["files"] = files_of(values, root)
        told, views = TOOLS[tool](root, **values)
        pngs = (view._replace(ending=".png") for view in views[:count])
        drawn = [one.data.partition(",")[2] for one in drawn_pictures(pngs)]
    except Refusal as error:
        told = refused(str(error), **error.told)
    except (AntioscError, MemoryError) as error:
        sentence = getattr(error, "sentence", "") or str(error) or "the memory was not enough."
        told = refused(sentence, kind=type(error).__name__)
    common = {"tool": tool, "version": info.version(), "hash": hash_of(inputs)}
    return {"status": "completed", **told, **common}, [one for one in drawn if one]


def files_of(values: Table, root: Path) -> Table:
    """Name -> hash of each file below the folder that is named."""
    scene = values.get("scene")
    base, data = (root, values) if scene is None else (scene.path.parent, scene.data)
    hashes = {}
    for _, name in values_in(data):
        path = within(root, name, base) if isinstance(name, str) else root
        if path.is_file():
            with path.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
            hashes[str(path.relative_to(root))] = digest
    return hashes


def main() -> None:
    """Answer the call on standard input."""
    wire = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what libraries print is no part of the answer
    request = json.loads(sys.stdin.readline())
    resource.setrlimit(resource.RLIMIT_AS, (request["memory"], request["memory"]))
    threading.Thread(target=end_with_server, daemon=True).start()

    def tell(content: Table) -> None:
        wire.write(json.dumps(content) + "\n")
        wire.flush()

    with progress.following(lambda doing: tell({"doing": doing})):
        told, pictures = answer(Path(request["folder"]), request["tool"], request["arguments"])
    tell({"answer": live.plain(told), "pictures": pictures})


def end_with_server() -> None:
    """End with all that was started once the server closes this process's input."""
    sys.stdin.read()
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main()
