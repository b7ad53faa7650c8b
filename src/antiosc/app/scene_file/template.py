"""The commented scene that `antiosc new` writes."""

from __future__ import annotations

import json
import os
import secrets
from pathlib import Path

import antiosc
from antiosc.app.scene_file.build import Call, in_keys
from antiosc.app.scene_file.group_names import Outline, outline
from antiosc.app.scene_file.pages import rendered
from antiosc.base import checks
from antiosc.base.errors import AntioscError, InputError

#: Endings of decks, which describe materials and supports themselves.
DECK_ENDINGS = {".inp", ".bdf", ".nas", ".fem", ".dat"}

#: Endings of files of CAD, which are meshed here.
CAD_ENDINGS = {".step", ".stp", ".iges", ".igs", ".brep", ".geo"}


def text(name: str, part: str | None, around: Outline | None = None, drop: bool = False) -> str:
    """The scene as a text; `part` is the file of the structure, as the scene names it.

    `around`: its box; the site lies in the middle of its upper side. `drop`: it falls.
    """
    source = part or "part.step"
    ending = Path(source).suffix.lower()
    point, plane = [0.0, 0.0, 0.1], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    if around is not None:
        low, high = around.low.tolist(), around.high.tolist()
        point = [*(float(f"{c:.4g}") for c in (around.low + around.high)[:2] / 2), high[2]]
        plane = [low, [1.0, 0.0, 0.0] if low[2] == high[2] else [0.0, 0.0, 1.0]]
    return rendered(
        "scene.toml",
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        deck=ending in DECK_ENDINGS,
        cad=ending in {*CAD_ENDINGS, ".stl"},
        closed=ending == ".stl",
        point=point,
        plane=plane,
        drop=drop,
    )


def _outline(part: str) -> tuple[Outline | None, list[str]]:
    """The outline of a file, and a sentence that tells it or why it is not known."""
    name = Path(part).name
    deck = Path(part).suffix.lower() in DECK_ENDINGS
    made = {"path": part, "unit": "mm"} if deck else {"source": part}
    call = Call(antiosc.read_model if deck else antiosc.read_mesh, made)
    try:
        found = outline(call)
    except (AntioscError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else in_keys(error, call).rstrip(".")
        return None, [f"the box of {name} is not known: {why}."]
    return found, [f"{name} reaches {found.text()}."]


def write(
    path: str | os.PathLike[str], part: str | None = None, drop: bool = False
) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; its path, and what is told of the part.

    InputError if it exists.
    """
    target = checks.new_file("the scene file", path)
    around: Outline | None = None
    told: list[str] = []
    if part is not None:
        checks.path("the file of the part", part)
        around, told = _outline(part)
        part = os.path.relpath(part, target.parent)
    if not f"{target.name}{part or ''}".isprintable():
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    content = text(target.name, part, around, drop)
    beside = target.with_name(f".antiosc-{secrets.token_hex(6)}.toml")
    try:
        with beside.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            os.link(beside, target)  # fails if the target exists; a rename would replace it
        finally:
            beside.unlink()
    except FileExistsError:
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        ) from None
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    return target, told
