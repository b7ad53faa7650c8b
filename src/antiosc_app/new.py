"""`antiosc new`: inspect a part by its mesh, and write a commented scene for it.

Family, unit, supports and site are guessed, so that the scene runs without changes.
"""

from __future__ import annotations

import json
import os
import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from antiosc.base import checks, files, materials, progress
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError, InputError, RangeError, SiteError, warnings_to
from antiosc.models.body import coarse_at
from antiosc_app import pieces
from antiosc_app.foreign import DECK_ENDINGS
from antiosc_app.inspecting import inspect_part
from antiosc_app.inspection import (
    BALL_MATERIAL,
    FALL_HEIGHT,
    FLOOR_MATERIAL,
    FRICTION,
    LARGEST_BALL,
    MATERIAL,
    TILT,
    Inspection,
    impact_frequency,
)
from antiosc_app.report import rendered
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import read, without_line
from antiosc_app.until_parted import OSCILLATORS

#: A name with a number at its end, which may stand in brackets.
ENDING_NUMBER = re.compile(r"(.*?)(\d+)\)?")
#: Width of the comment of a scene that lists the groups, and most of its lines.
WIDTH, MOST_LINES = 96, 10
#: A part of at most so many nodes is struck before its scene is written: this took 5.7 s of
#: processor time for 5394 nodes of a solid (99 201 dofs), 65 s for 8200 nodes of a sheet.
MOST_NODES = 6000
#: Duration [s] of that impact, and on a patch, which must carry the largest force; the largest
#: number of its anti-oscillators. A vessel of 7166 shells took 32 s of processor time with 20; with
#: 150, two extractions took most of 78 s.
MOMENT, TO_PEAK, MOST_OSCILLATORS = 2e-4, 2e-3, 20
#: Number of impacts of the fall.
IMPACTS = 3
#: Views (elevation, azimuth) [degrees] from which a part is drawn: the first that sees the struck
#: face well, by this least cosine, or the one that sees it best.
VIEWS = [
    (elevation, azimuth) for elevation in (24.0, -24.0) for azimuth in (-52.0, 128.0, 38.0, -142.0)
]
WELL_SEEN = 0.3


def _view(direction: Array) -> Array:
    """The view of a part that is struck in a direction (3,)."""
    elevation, azimuth = np.radians(VIEWS).T
    level = np.cos(elevation)
    towards = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    cosines = -(direction @ np.array(towards)) / np.linalg.norm(direction)
    seen = cosines >= WELL_SEEN
    return np.array(VIEWS[int(np.argmax(seen if seen.any() else cosines))])


def draw(inspection: Inspection, path: Path, *, drop: bool = False) -> None:
    """Draw the part: its outer faces, and its supports and impact unless it is dropped."""
    from antiosc.plot.charts import save_figure
    from antiosc.plot.surfaces import Deformed, deformed_figure

    height = 1e3 * (inspection.points[:, 2] - inspection.points[:, 2].min())
    points, faces = inspection.points, inspection.faces
    if drop:
        label = "height over its lowest point (mm)"
        part = Deformed(points, points, faces, height, label, float(height.max()))
        figure = deformed_figure(part, whole_scale=True)
    else:  # each face has points of its own, so that it is held (yellow) or not (nan, grey)
        count = faces.shape[1]
        fixed = np.repeat(inspection.held[faces].any(axis=1), count)
        points = points[faces.ravel()]
        faces = np.arange(len(points)).reshape(-1, count)
        arrow = np.array(inspection.point), np.array(inspection.direction)
        shade = np.where(fixed, 1.0, np.nan)
        part = Deformed(points, points, faces, shade, "", 1.0)
        figure = deformed_figure(part, arrow=arrow, view=_view(arrow[1]), whole_scale=True)
        held_text = "yellow: held; " if fixed.any() else ""
        figure.text(0.02, 0.02, f"{held_text}red: where and how it is struck")
    save_figure(figure, path, dpi=100)


#: The geometry of a scene without a given part.
PLATE = """\
// A plate of 300 x 200 mm, held at one end; its size of elements is that of the scene.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("plate") = {1};
Physical Curve("clamp") = {4};
"""


def text(name: str, source: str, inspection: Inspection | None, drop: bool = False) -> str:
    """The scene as text; `source` is the part's file as the scene names it.

    `inspection`: that of the part, if it exists. `drop`: whether the part falls.
    """
    ending = Path(source).suffix.lower()
    deck = ending in DECK_ENDINGS if inspection is None else inspection.of_deck
    keys = (
        "unit",
        "size",
        "gdim",
        "merge",
        "density",
        "modulus",
        "piece",
        "contact",
        "fragments",
        "solid",
        "cells",
        "order",
        "timeout",
    )
    return rendered(
        Path(__file__).with_name("page") / "scene.toml",
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        part=Path(source).name,
        deck=deck,
        closed=ending == ".stl",
        look=inspection,
        read=dict.fromkeys((*keys, "free", "order")) | dict(inspection.read if inspection else {}),
        family="Solid" if inspection is None else inspection.family,
        fewest=OSCILLATORS[0],
        material=MATERIAL if inspection is None else inspection.material,
        point=[0.0, 0.0, 0.1] if inspection is None else inspection.point,
        direction=[0.0, 0.0, -1.0] if inspection is None else inspection.direction,
        band=impact_frequency(LARGEST_BALL if inspection is None else inspection.ball),
        ball=LARGEST_BALL if inspection is None else inspection.ball,
        ball_material=json.dumps(BALL_MATERIAL),
        drop=drop,
        groups=[] if inspection is None else _listed(inspection.groups),
        fall={
            "height": FALL_HEIGHT,
            "tilt": list(TILT),
            "until": IMPACTS,
            "friction": FRICTION,
            "floor": FLOOR_MATERIAL,
        },
        json=json.dumps,
    )


def _listed(groups: Sequence[str]) -> list[str]:
    """The names of groups as lines of a comment; of many lines the first."""
    blank = "\0"  # in place of a space in a name, at which no line may end
    quote = partial(json.dumps, ensure_ascii=False)
    runs = [[*map(quote, run)] for run in runs_of(groups)]
    words = [f"{run[0]} … {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs]
    names = ", ".join(word.replace(" ", blank).replace(f",{blank}", ", ") for word in words)
    lines = textwrap.wrap(names, WIDTH, break_long_words=False, break_on_hyphens=False)
    told = [line.replace(blank, " ") for line in lines[:MOST_LINES]]
    if len(lines) <= MOST_LINES:
        return told
    return [*told, f"… of {len(groups)} in all, which antiosc open shows: hold a face by name"]


def runs_of(groups: Sequence[str]) -> list[list[str]]:
    """Names of groups that differ in a number at their end alone as lists, if this counts on or
    stands in brackets, as in "face 7" and "hole 6 mm (2)".
    """
    runs: list[list[str]] = []
    last = ("", -1)
    for name in groups:
        found = ENDING_NUMBER.fullmatch(name)
        stem, number = (found[1], int(found[2])) if found else (name, -1)
        follows = stem == last[0] and number >= 0
        if follows and (stem.endswith("(") or number == last[1] + 1):
            runs[-1].append(name)
        else:
            runs.append([name])
        last = stem, number
    return runs


def _picture(path: Path, about: str, draw_it: Callable[[Path], object]) -> list[str]:
    """The sentence that names a picture, after drawing it, or that an existing file is kept."""
    if path.exists():
        return [
            f"{path} exists already, and is left as it is: it does not show this scene; to have its"
            " picture, remove both, then write the scene anew."
        ]
    try:
        with progress.doing(f"drawing {path.name}"):
            draw_it(path)
    except AntioscError as error:
        return [f"{path.name} is not drawn: {error}"]
    return [f"{about}: {path}"]


def write_scene(
    path: str | os.PathLike[str],
    part: str | None = None,
    drop: bool = False,
    material: str | None = None,
    unit: str | None = None,
    timeout: float | None = None,
    size: float | None = None,
    piece: int | None = None,
    contact: str | None = None,
) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; returns its path and sentences on the part.

    `material`: name of the material of a part that is no deck; `unit`: unit of the file;
    `timeout` [s]: limit of each reading of the file; `size` [m]: largest cell, if it is asked for;
    `piece`: rank of the piece of the part that is read alone; `contact`: what becomes of the
    contact of a deck, "tied" or "apart".

    Raises
    ------
    AntioscError
        The file exists, the part cannot be read, or the material is unknown: nothing is written.
    """
    metal = materials.record(MATERIAL if material is None else material)
    if metal.G is not None:
        raise InputError(
            f"{metal.name} is not isotropic: write the scene with another material, then give "
            "its orientation with the name in [material]."
        )
    target = checks.new_file("the scene file", path)
    _absent(target)
    sentences: list[str] = []
    source = target.with_suffix(".geo") if part is None else Path(part)
    if part is None:
        _absent(source)
        files.write_text(source, PLATE, "the geometry")
        sentences.append(f"{source} is a plate to begin with; put your own part in its place.")
    else:
        checks.path("the file of the part", part)
    part = os.path.relpath(source, target.parent)
    if not f"{target.name}{part or ''}".isprintable():
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    try:
        with progress.doing(f"looking at {source.name}"):
            inspection = inspect_part(source, drop, unit, timeout, size, piece, contact)
    except OSError as error:
        raise InputError(f"{source.name} could not be looked at: {error.strerror}.") from None
    if not inspection.of_deck:
        flat = None if inspection.flat is None else (metal.E, metal.nu)
        asked = material is not None
        inspection = replace(inspection, material=metal.name, flat=flat, asked=asked)
    elif material is not None:
        raise InputError(
            f"{source.name} is a deck with materials of its own: leave --material away."
        )
    content = text(target.name, part, inspection, drop)
    temporary = files.part_name(target, ".toml")
    try:
        with temporary.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            if len(inspection.points) <= MOST_NODES:
                inspection = _tried(temporary, target.name, part, inspection, drop)
                temporary.write_text(text(target.name, part, inspection, drop), encoding="utf-8")
            os.link(temporary, target)  # fails if the target exists; a rename would replace it
        finally:
            temporary.unlink()
        files.clear_parts(target)
    except FileExistsError:
        _absent(target)
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    if inspection.of_size and not drop:
        inspection = replace(inspection, notes=(*inspection.notes, _of_this_size(inspection)))
    sentences += inspection.sentences(source.name, drop)
    pictures: dict[str, tuple[str, Callable[[Path], object]]] = {
        ".png": ("a picture of it", partial(draw, inspection, drop=drop))
    }
    if "piece" in inspection.read and inspection.pieces:
        boxes = partial(pieces.draw, inspection.pieces, chosen=inspection.read.get("piece"))
        pictures[pieces.ENDING] = ("its pieces, of which piece = 2 is the second", boxes)
    for ending, (caption, draw_it) in pictures.items():
        sentences += _picture(target.with_suffix(ending), caption, draw_it)
    return target, sentences


def _of_this_size(inspection: Inspection) -> str:
    """Sentence on what depends on a size of the cells that was asked for, which is no smaller than
    the usual one.
    """
    section = "[deck]" if inspection.of_deck else "[geometry]"
    return (
        "its site and its striker are chosen on cells of this size (size), and differ with another"
        f" one: to compare sizes, change size in {section} of one scene, which keeps both."
    )


def _tried(scene: Path, name: str, part: str, inspection: Inspection, drop: bool) -> Inspection:
    """The inspection after a trial impact, at another site if the first fails; InputError if all
    fail.
    """
    reason: AntioscError | None = None
    first = inspection.point, inspection.direction, inspection.radius, inspection.room
    for point, direction, radius, edge_distance in (first, *inspection.others):
        trial = replace(
            inspection, point=point, direction=direction, radius=radius, room=edge_distance
        )
        try:
            try:
                return _tried_at(scene, name, part, trial, drop)
            except RangeError as error:  # the contact of a smaller ball is smaller in proportion
                if radius is None or error.radius is None:
                    raise
                smaller = replace(trial, room=trial.ball * radius / error.radius)
                return _tried_at(scene, name, part, smaller, drop)
        except SiteError as error:
            reason = reason or error
        except (InputError, RangeError) as error:
            reason = reason or error
            break
    raise InputError(f"the part can be read, but not struck as it is: {reason}")


def _tried_at(scene: Path, name: str, part: str, inspection: Inspection, drop: bool) -> Inspection:
    """The inspection after a trial impact at its site, without error bars if these fail."""
    reason: InputError | None = None
    for bars in (True, False)[not inspection.bars :]:
        trial = replace(inspection, bars=bars)
        short_trial = replace(trial, count=min(trial.count, MOST_OSCILLATORS))
        scene.write_text(text(name, part, short_trial, drop), encoding="utf-8")
        try:
            trial = replace(trial, cell=_try(scene, inspection))
        except SiteError:
            raise
        except InputError as error:
            reason = reason or error
            continue
        if reason is None:
            return trial
        message = f"it is struck without error bars, for otherwise {reason}"
        return replace(trial, notes=(*trial.notes, message))
    assert reason is not None
    raise reason


def _try(scene: Path, inspection: Inspection) -> float | None:
    """Strike the part for a moment, or drop it once; InputError if that is refused.

    Returns the largest allowed cell [m] at the site, if the present cells there are larger.
    The structure of its deck is not read again.
    """
    document = read(scene)
    structure = inspection.structure
    for site in document.data.get("sites", {}).values():
        if inspection.radius is not None:
            site["radius"] = inspection.radius
    if "extract" in document.data:  # second-order forces take longer, and are those of the run
        document.data["extract"]["stretch"] = False
    on_patch = any("radius" in site for site in document.data.get("sites", {}).values())
    calls = compiled(document)
    evaluate = Evaluation(calls.document)
    if structure is not None and calls.structure is not None:
        evaluate.register(calls.structure, structure)
    hit = None
    try:
        with warnings_to(list[str]().append), progress.doing("a trial of the new scene"):
            if calls.history is not None:
                moment = TO_PEAK if on_patch else MOMENT
                hit = evaluate(_with(calls.history, duration=moment))
            if calls.fall is not None:
                evaluate(_with(calls.fall, until=1))
    except AntioscError as error:
        if isinstance(error, RangeError):
            raise
        kind = SiteError if isinstance(error.__cause__, SiteError) else InputError
        raise kind(without_line(error)) from None
    if hit is None:
        return None
    without_bars = replace(hit.model, strain_error=None, strain_misfit=None)
    cell = coarse_at(without_bars, "", hit.assembly.contact_time_estimate)
    return float(f"{cell.allowed:.1g}") if cell else None


def _with(call: Call, **options: object) -> Call:
    """A call with other arguments."""
    return replace(call, arguments={**call.arguments, **options})


def _absent(target: Path) -> None:
    """Raise InputError if a file exists."""
    if os.path.lexists(target):  # `exists` raises for a name that no system takes
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        )
