"""The outline of the files that a scene names: their boxes and groups, and what lies outside them.

Finished meshes and decks are read for it (by the reader that a run takes), geometries are opened;
nothing is meshed or assembled.
"""

from __future__ import annotations

import contextlib
import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import floor, log10
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import antiosc
from antiosc.base import checks
from antiosc.base._types import Array
from antiosc.base.errors import (
    AntioscError,
    InputError,
    MissingDependencyError,
    PiecesError,
    finite_element_packages,
    without_warnings,
)
from antiosc.extension import SNAP_SHARE
from antiosc.io.neutral import SIDES
from antiosc_app import pieces
from antiosc_app.scene_file.build import Call, calls_in
from antiosc_app.scene_file.document import GEOMETRIES, Place, label, unknown
from antiosc_app.scene_file.scene import CompiledScene

if TYPE_CHECKING:
    from antiosc import Placement

#: Largest file that is read for its groups, bytes.
LARGEST = 50_000_000
#: Sections of points, and keys that hold a point or names of groups.
POINTS = ("sites", "probes", "accelerometers", "sensors")
KEYS = ("point", "at", "where")
#: Digits of a box.
DIGITS = 4
#: The number at the end of a name, such as "face 12" or "hole 6 mm (1)"; names of one run that
#: differ in it alone are shortened if there are more than this many.
NUMBER, MOST_OF_RUN = re.compile(r"\d+(?=\)?$)"), 3


#: Coordinate over the size of a part below which it is 0.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Outline:
    """Properties of a file that are known without meshing it.

    Attributes
    ----------
    name : name of the file.
    groups : names of its groups.
    low, high : (3,) corners of the box around it [m].
    element : size of its largest cell [m]; for a geometry the size that the scene gives, or 0.
    """

    name: str
    groups: list[str]
    low: Array
    high: Array
    element: float

    def text(self, most: int | None = None) -> str:
        """The box and the groups in words; `most`: number of groups that are named."""
        size = float(np.linalg.norm(self.high - self.low))
        low, high = (np.where(np.abs(x) > ROUNDING * size, x, 0.0) for x in (self.low, self.high))
        runs = [list(run) for _, run in itertools.groupby(self.groups, partial(NUMBER.sub, ""))]
        groups = ", ".join(map(_brief, runs[:most])) or "none"
        hidden = 0 if most is None else sum(map(len, runs[most:]))
        return f"from {checks.point_text(low)} to {checks.point_text(high)}; groups: {groups}" + (
            f" and {hidden} more, which the scene lists" if hidden > 0 else ""
        )

    def distance(self, point: Array) -> float:
        """Distance of a point (3,) from the box [m]; 0 up to the distance that a snap bridges."""
        distance = float(np.linalg.norm(point - np.clip(point, self.low, self.high)))
        size = float(np.linalg.norm(self.high - self.low))
        if distance > max(SNAP_SHARE * size, self.element):
            return distance
        return 0.0

    def placed(self, at: Placement) -> Outline:
        """The outline after a `Placement`: the box around the moved box."""
        corners = np.array(list(itertools.product(*zip(self.low, self.high, strict=True))))
        x = at.placed(corners)
        return replace(self, low=x.min(axis=0), high=x.max(axis=0))


def _brief(names: list[str]) -> str:
    """Names that differ in their last number alone, the first and the last of many."""
    if len(names) > MOST_OF_RUN:
        return f"{names[0]} … {names[-1]} ({len(names)})"
    return ", ".join(names)


def check(compiled: CompiledScene) -> list[str]:
    """Sentences on the box and the groups of each file, or on why it was not read.

    SceneFileError for groups that do not exist and points outside the part.
    """
    problems = compiled.document.problems
    sentences = []
    outlines_by_name: dict[str, Outline] = {}
    calls = list(dict.fromkeys(calls_in(list(vars(compiled).values()))))
    for part, call in _meshes(compiled):
        try:
            outlines_by_name[part] = shape = outline(call)
        except InputError as error:
            message = f"{_path(call).name} cannot be read: {error}"
            problems.add(call.place, message + _picture(compiled, error))
            continue
        except AntioscError as error:
            sentences.append(f"{_path(call).name} was not looked at: {error}")
            continue
        sentences.append(f"{shape.name} reaches {shape.text()}.")
        for place, group in _group_references(calls, part):
            if group not in shape.groups and group not in SIDES:
                place_text = f"{label(place)}: in {shape.name} the group"
                problems.add(place, unknown(place_text, group, shape.groups))
    if outlines_by_name and len(outlines_by_name) == sum(1 for _ in _meshes(compiled)):
        _check_points(compiled, calls, outlines_by_name)
    problems.raise_if_any()
    return sentences


def _picture(compiled: CompiledScene, error: InputError) -> str:
    """Draw the unconnected pieces of a part beside the scene; returns a sentence on the picture.

    "" for other errors.
    """
    if not isinstance(error, PiecesError) or not error.pieces:
        return ""
    path = compiled.document.path.with_suffix(pieces.ENDING)
    with contextlib.suppress(AntioscError):
        return f" A picture of them: {pieces.draw(error.pieces, path)}."
    return ""


def outlines(compiled: CompiledScene) -> list[Outline]:
    """The outlines of all files that can be read."""
    file_outlines = []
    for _, call in _meshes(compiled):
        with contextlib.suppress(AntioscError):
            file_outlines.append(outline(call))
    return file_outlines


def _check_points(compiled: CompiledScene, calls: list[Call], known: Mapping[str, Outline]) -> None:
    """Note sites and probes that lie outside all boxes."""
    with finite_element_packages():
        from antiosc.extension import placement
    placements = {} if compiled.structure is None else compiled.structure.arguments.get("at", {})
    boxes = {
        part: shape.placed(placement(part, placements[part].made if part in placements else None))
        for part, shape in known.items()
    }
    for call in calls:
        key = "at" if "at" in call.arguments else "point"
        point = call.arguments.get(key)
        snap = call.arguments.get("snap")
        if not isinstance(point, tuple) or call.place[:1] not in {(section,) for section in POINTS}:
            continue
        x = np.resize([*point, 0.0], 3)
        part = call.arguments.get("part")
        boxes_of_part = [boxes[part]] if part in boxes else list(boxes.values())
        nearest = min(boxes_of_part, key=lambda box: box.distance(x))
        distance = nearest.distance(x)
        place = (*call.place, key)
        if distance and (isinstance(snap, bool) or snap is None or distance > snap):
            box = f"{checks.point_text(nearest.low)} to {checks.point_text(nearest.high)}"
            sentence = (
                f"{label(place)}: the point {checks.point_text(x)} lies {distance:.3g} m outside"
            )
            sentence += f" the box of {nearest.name}, from {box}: coordinates are in metres."
            compiled.document.problems.add(place, sentence)


def _meshes(compiled: CompiledScene) -> Iterator[tuple[str, Call]]:
    """Yields (name of a part or "", its call of read_mesh or read_model)."""
    source = compiled.structure
    if source is None and compiled.history is not None and compiled.striking:
        source = compiled.history.arguments["source"]
        if isinstance(source, str):
            source = Call(antiosc.read_mesh, {"source": source}, ("geometry",))
    for call in calls_in(source):
        if call.name in ("read_mesh", "read_model"):
            yield (str(call.place[1]) if call.place[0] == "parts" else "", call)


def check_size(path: Path) -> None:
    """AntioscError for a file that is too large to be read for its outline."""
    if path.stat().st_size > LARGEST:
        raise AntioscError(f"the file is larger than {LARGEST / 1e6:g} MB.")


def _path(call: Call) -> Path:
    """The path of the file that a call of read_mesh or read_model reads."""
    return Path(str(call.arguments["path" if call.name == "read_model" else "source"]))


def outline(call: Call) -> Outline:
    """The outline of the file that a call of read_mesh or read_model reads.

    Raises
    ------
    InputError
        A file that cannot be read.
    AntioscError
        A file that is too large to be read for an outline, or whose package is missing.
    """
    path = _path(call)
    check_size(path)
    with without_warnings():  # a run warns of what it does not take
        try:
            groups, pieces = _read(call, path)
        except (MissingDependencyError, InputError):
            raise
        except AntioscError as error:
            raise InputError(str(error)) from None
    x = np.vstack([points for points, _ in pieces])
    box = np.pad([x.min(axis=0), x.max(axis=0)], ((0, 0), (0, 3 - x.shape[1])))
    longest = float(np.ptp(box, axis=0).max())
    digits = DIGITS - floor(log10(longest)) if longest else DIGITS
    low, high = np.round(box, digits) + 0.0  # gmsh's boxes are wider by 1e-7
    return Outline(path.name, groups, low, high, max(size for _, size in pieces))


def _read(call: Call, path: Path) -> tuple[list[str], list[tuple[Array, float]]]:
    """(names of groups, [(points [m], size of the largest cell [m])]) of a file."""
    with finite_element_packages():
        from antiosc.io.neutral import UnitSystem
        from antiosc.io.reading import outline as opened
        from antiosc_decks.from_deck import outline_of_deck
    if path.suffix.lower() in GEOMETRIES or call.arguments.get("solid"):
        unit = call.arguments.get("unit")
        keys = ("solid", "fragments", "piece")
        options = {key: call.arguments[key] for key in keys if key in call.arguments}
        contents = opened(path, None if unit is None else UnitSystem.of(unit), **options)
        return list(contents.groups), [(contents.points, call.arguments.get("size") or 0.0)]
    if call.name == "read_model":
        names, raws = outline_of_deck(**call.arguments)
        return names, [(raw.points, _largest(raw.points[raw.cells])) for raw in raws]

    mesh = call.make(**call.arguments)
    return list(mesh.groups), [(mesh.dolfinx.geometry.x, _largest(mesh.geometry.nodes))]


def _largest(cells: Array) -> float:
    """Largest diagonal [m] of the boxes around cells (n, nodes, d)."""
    return float(np.linalg.norm(np.ptp(cells, axis=1), axis=1).max(initial=0.0))


def _group_references(calls: list[Call], part: str) -> Iterator[tuple[Place, str]]:
    """Yields (place, name) where a scene names a group of its mesh or of the mesh of a part."""
    for call in calls:
        of_part = not part or call.place[:2] == ("parts", part)
        material = call.arguments.get("material")
        if of_part and isinstance(material, dict):
            start = call.place[:2] if part else ()
            yield from (((*start, "material", group), group) for group in material)
        group_keys = ("a", "b", "group") if call.place[:1] == ("joints",) else ()
        for key in (*KEYS, "face", *group_keys):
            value = call.arguments.get(key)
            for text in value if isinstance(value, tuple) else [value]:
                if not isinstance(text, str) or (key == "face" and text[:1] in "+-"):
                    continue
                if of_part:
                    yield (*call.place, key), text
                elif text.startswith(f"{part}:"):
                    yield (*call.place, key), text.removeprefix(f"{part}:")
