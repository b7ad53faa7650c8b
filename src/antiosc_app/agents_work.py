"""One tool call of `antiosc mcp` in a process of its own: the road of `antiosc run`.

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
import traceback
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

if TYPE_CHECKING:
    from antiosc_app.scene_file.scene import CompiledScene

Table: TypeAlias = dict[str, Any]
#: What a tool answers, and its pictures.
Answer: TypeAlias = tuple[Table, list[Picture]]
#: What `status` of a history or a fall means.
STATUS = ("completed", "completed: tol is not met", "stopped early", "completed: contact goes on")
#: Objects of a scene whose defaults are told.
OBJECTS = ("structure", "model", "impactor", "contact", "scene", "history", "fall", "map")


class Refusal(InputError):
    """What decides the answer is not given, or may not be: its kind, key and choices."""

    def __init__(self, kind: str, sentence: str, key: str = "", choices: Any = ()) -> None:
        super().__init__(sentence)
        self.told = {"kind": kind, "key": key, "choices": list(choices)}


def refused(sentence: str, **told: Any) -> Table:
    """The answer of a refusal: its first sentence, and all mistakes."""
    lines = sentence.splitlines() or ["refused."]
    refusal = {"mistakes": lines, "key": "", "choices": [], **told}
    return {"status": "refused", "text": lines[0], "quantities": [], "refusal": refusal}


def hash_of(inputs: object) -> str:
    """The hash of inputs that are JSON."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


# -- what is given


def within(root: Path, name: str, base: Path | None = None) -> Path:
    """The path of a file below the folder `root`, links resolved; else Refusal."""
    try:
        path = ((base or root) / name).resolve()
        path.exists()
    except (OSError, ValueError, RuntimeError):  # a name that no system takes
        raise Refusal("path", f"{checks.shown(name)} is no path of a file.") from None
    if not path.is_relative_to(root):
        raise Refusal("path", f"{checks.shown(name)} lies outside of the folder of this server.")
    return path


def values_in(data: object, place: Place = ()) -> Iterator[tuple[Place, object]]:
    """Yield (place, value) of each value in nested tables and lists."""
    if not isinstance(data, dict | list):
        yield place, data
        return
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield from values_in(value, (*place, key))


def document_of(scene: Table | str, root: Path) -> Document:
    """The scene of a call: a file, or sections."""
    if isinstance(scene, str):
        document = read(within(root, scene))
    else:
        document = checked(root / "scene.json", scene, json.dumps(scene, indent=1))
    for place, value in values_in(document.data):
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            raise Refusal("scene", f"{label(place)} is no finite number.", label(place))
    return document


def files_of(base: Path, data: Table, root: Path) -> Table:
    """Name -> hash of each file that a text names; Refusal of one outside of the folder."""
    hashes = {}
    for _, name in values_in(data):
        path = within(root, name, base) if isinstance(name, str) else root
        if path.is_file():
            with path.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
            hashes[str(path.relative_to(root))] = digest
    return hashes


def require_decided(document: Document, root: Path) -> None:
    """Refusal if a material, a support or the unit of a file is missing, with the choices."""
    from antiosc.io.cad import STATES_UNIT
    from antiosc.io.neutral import SYSTEMS

    parts = document.data.get("parts", {"": document.data})
    free = "drop" in document.data or ("parts" in document.data and "supports" in document.data)
    for name, part in parts.items() if isinstance(parts, dict) else ():
        section = "deck" if isinstance(part, dict) and "deck" in part else "geometry"
        table: Any = part.get(section) if isinstance(part, dict) else None
        file = table.get("path", table.get("source")) if isinstance(table, dict) else None
        if not isinstance(file, str):
            continue  # the scene itself has the sentence for it
        at = f"parts.{name}." if name else ""
        path = within(root, file, document.path.parent)

        if "unit" not in table and path.suffix.lower() not in STATES_UNIT:
            sentence = f"{path.name} states no unit: give {at}{section}.unit."
            raise Refusal("unit", sentence, f"{at}{section}.unit", SYSTEMS)
        if section == "geometry" and "material" not in part:
            sentence = f"the material decides the answer: give {at}material."
            raise Refusal("material", sentence, f"{at}material", materials.names())
        if section == "geometry" and "supports" not in part and not free:
            choices = [*seen(path, table.get("unit"))[2].values(), []]
            sentence = f"the supports decide the answer: give {at}supports, [] of a free part."
            raise Refusal("support", sentence, f"{at}supports", choices)


# -- the tools


def seen(path: Path, unit: str | None, piece: int | None = None) -> tuple[Any, Table, Table, Table]:
    """(look at a part, its first scene, name of a face -> its support, name -> where it lies)."""
    from antiosc_app.edited import EditedScene
    from antiosc_app.inspecting import inspect_part
    from antiosc_app.skin import places, skin

    if not path.is_file():
        raise Refusal("path", f"there is no file {checks.shown(path.name)}.")
    part = inspect_part(path, unit=unit, piece=piece)
    scene = EditedScene(path, part, {}, ())
    calls = compiled(scene.document())
    shape, faces, _ = skin(Evaluation(calls.document)(calls.structure), part)
    return part, scene.sections, dict(faces), places(shape, list(faces))


def look(root: Path, file: str, unit: str | None = None, piece: int | None = None) -> Answer:
    """A part: pieces, faces, size, and a scene that lacks what the file does not decide."""
    path = within(root, file)
    part, draft, faces, where = seen(path, unit, piece)
    section, key = ("deck", "path") if part.of_deck else ("geometry", "source")
    guessed = "unit" in part.read and unit is None
    missing = [f"{section}.unit"] * guessed + ["material", "supports"] * (not part.of_deck)
    left_out = {"title", "output", *missing}
    draft = {name: x for name, x in draft.items() if name not in left_out}
    draft[section] = {**draft[section], key: str(path.relative_to(root))}
    if guessed:
        del draft[section]["unit"]

    sizes = zip("xyz", (part.high - part.low).tolist(), strict=True)
    drawing = partial(new.draw, replace(part, held=np.zeros_like(part.held)))
    return {
        "text": "\n".join([f"{path.name}: {part.cells}, {part.sides_text()}.", *part.notes]),
        "quantities": [
            quantity(f"size {axis}", size, "m", "it is read from the file") for axis, size in sizes
        ],
        "pieces": [{"low": one.low.tolist(), "high": one.high.tolist()} for one in part.pieces],
        "faces": [{"name": n, "at": where.get(n, ""), "support": t} for n, t in faces.items()],
        "guessed_unit": part.unit_text() if guessed else None,
        "draft": draft,
        "give": missing,
    }, [Picture("The part", "Red: where it may be struck.", drawing)]


def materials_named(_root: Path, query: str = "") -> Answer:
    """The materials whose name contains a text, with their sources."""
    names = [name for name in materials.names() if query.lower() in name.lower()]
    if not names:
        sentence = f"no material is named {checks.shown(query)}."
        raise Refusal("material", sentence, "query", materials.names())
    told, lines = [], []
    for one in map(materials.record, names):
        lines.append(f"{one.name}: {one.line}; {one.source}")
        for key, unit in (("E", "Pa"), ("nu", "1"), ("rho", "kg/m³"), ("yield_strength", "Pa")):
            value = getattr(one, key)
            known = key == "yield_strength" and one.yield_range
            bar = (value - known[0], known[1] - value) if known else "its sources give one value"
            if value is not None:
                told.append(quantity(f"{one.name}: {key}", value, unit, bar))
    return {"text": "\n".join(lines), "quantities": told}, []


def check(root: Path, scene: Document) -> Answer:
    """The mistakes of a scene, and what can run it."""
    require_decided(scene, root)
    calls = compiled(scene)
    text = f"no mistakes found; for {', '.join(calls.does()) or 'nothing to run'}."
    told = {"text": text, "quantities": [], "assumed": assumed(scene, calls)}
    return {**told, "cautions": list(map(str, calls.warnings))}, []


def study(command: str, root: Path, scene: Document, path: str | None = None) -> Answer:
    """A scene as `antiosc run` computes it; `path`: of its report, of the first study it has."""
    require_decided(scene, root)
    page = None if path is None else within(root, path)
    if page is not None and page.exists():
        raise Refusal("path", f"{checks.shown(path)} exists already, and is left as it is.")
    page = None if page is None else report.checked(str(page))
    if command == "tradeoff":
        made = report.results_of(*commands.compared(scene))
    else:
        has = (one.removeprefix("antiosc ") for one in compiled(scene).does())
        command = command or next(has, "run")
        made = commands.made(scene, commands.of_study(scene, command), command)

    shown, parts = summary(made), results.presentations(made)
    hit = made.history or made.fall or (made.tradeoff and made.tradeoff.hit)
    told = {
        "text": shown["text"],
        "cards": [{"name": card[0], "text": card[1]} for card in shown["cards"]],
        "quantities": quantities(made),
        "assumed": assumed(scene, made.compiled),
        "cautions": [*shown["cautions"], *shown["more"]],
        "status": STATUS[getattr(hit, "status", 0)],
    }
    if page is not None:
        report.write_page(made, parts, page)
        told["written"] = str(page.relative_to(root))
    return told, [picture for part in parts[1:] for picture in part.pictures]


def assumed(document: Document, scene: CompiledScene) -> list[Table]:
    """What was not given: each key with its value, and by what it has it."""
    given = dict(values_in(document.data))
    chosen = {
        label(place): {"value": value, "by": "the rule of auto"}
        for place, value in values_in(scene.document.data)
        if given.get(place) != value
    }
    for call in calls_in([getattr(scene, name) for name in OBJECTS]):
        section = schema.SECTIONS.get(str(call.place[0]) if call.place else "")
        kinds = () if section is None else section.makes
        function = call.name if call.name in kinds else kinds[0] if len(kinds) == 1 else ""
        if section is None or not function:
            continue
        defaults = inspect.signature(schema.resolved(function)).parameters
        keys = schema.parameters(function).keys() & defaults.keys()
        for name in keys - call.arguments.keys() - set(section.given.split()):
            value = live.plain(defaults[name].default)
            chosen[label((*call.place, name))] = {"value": value, "by": "default"}
    return [{"key": key, **one} for key, one in sorted(chosen.items())]


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
        named, base = values, root
        if "scene" in values:
            scene = values["scene"] = document_of(values["scene"], root)
            named, base = scene.data, scene.path.parent
        inputs["files"] = files_of(base, named, root)
        told, views = TOOLS[tool](root, **values)
        pngs = (view._replace(ending=".png") for view in views[:count])
        drawn = [one.data.partition(",")[2] for one in drawn_pictures(pngs) if one.data]
    except Refusal as error:
        told = refused(str(error), **error.told)
    except (AntioscError, MemoryError) as error:
        sentence = getattr(error, "sentence", "") or str(error) or "the memory was not enough."
        told = refused(sentence, kind=type(error).__name__)
    except Exception as error:
        traceback.print_exc()
        fault = f"{type(error).__name__}: {error}".splitlines()[0]
        told = refused(f"the call failed by a fault of antiosc: {fault}", kind="fault")
    common = {"tool": tool, "version": info.version(), "hash": hash_of(inputs)}
    return {"status": "completed", **told, **common}, drawn


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
