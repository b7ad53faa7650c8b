"""`antiosc new`: inspect a part by its mesh, and write a commented scene for it.

Family, unit, supports and site are guessed, so that the scene runs without changes.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from antiosc.base import checks, files, materials, progress
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError, InputError
from antiosc_app import inspection
from antiosc_app.inspecting import inspect_part
from antiosc_app.inspection import Inspection
from antiosc_app.report import rendered_template
from antiosc_app.scene_file.compiled import INITIAL_COUNT
from antiosc_app.scene_file.document import names_text

#: Number of impacts of the fall.
DEFAULT_IMPACTS = 3
#: Options of reading that a scene has, and None for those that it does not need.
READING_KEYS = (
    *("unit", "size", "gdim", "density", "modulus", "piece", "contact", "fragments", "solid"),
    *("cells", "order", "free", "merge"),
)
#: Views (elevation, azimuth) [degrees] from which a part is drawn: the first that sees the struck
#: face well, by this least cosine, or the one that sees it best.
VIEW_ANGLES = [
    (elevation, azimuth) for elevation in (24.0, -24.0) for azimuth in (-52.0, 128.0, 38.0, -142.0)
]
MIN_VIEW_COSINE = 0.3
#: The geometry of a scene without a given part.
PLATE_GEOMETRY = """\
// A plate of 300 x 200 mm, held at one end; its size of elements is that of the scene.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("plate") = {1};
Physical Curve("clamp") = {4};
"""


def write_scene(
    path: str | os.PathLike[str],
    part: str | None = None,
    drop: bool = False,
    material: str | None = None,
    unit: str | None = None,
    size: float | None = None,
    piece: int | None = None,
) -> tuple[Path, list[str]]:
    """Write a new scene file; returns its path and sentences on the part.

    Without `part` a plate is written as well; `drop`: a fall instead of an impact; `unit` of the
    file, `size` [m] of the cells, `piece` by rank: as for `inspect_part`.
    """
    metal = materials.record(inspection.DEFAULT_MATERIAL if material is None else material)
    if metal.G is not None:
        raise InputError(
            f"{metal.name} is not isotropic: write the scene with another material, then give "
            "its orientation with the name in [material]."
        )
    target = checks.new_file("the scene file", path)
    _require_absent(target)
    sentences: list[str] = []
    source = target.with_suffix(".geo") if part is None else Path(part)
    if part is None:
        _require_absent(source)
        files.write_text(source, PLATE_GEOMETRY, "the geometry")
        sentences.append(f"{source} is a plate to begin with; put your own part in its place.")
    else:
        checks.path("the file of the part", part)
    relative = os.path.relpath(source, target.parent)
    if not f"{target.name}{relative}".isprintable():
        raise InputError(f"the name {checks.shown(relative)} has control characters.")

    try:
        with progress.doing(f"looking at {source.name}"):
            inspected = inspect_part(source, drop, unit, size, piece)
    except OSError as error:
        raise InputError(f"{source.name} could not be looked at: {error.strerror}.") from None
    if inspected.is_deck and material is not None:
        raise InputError(
            f"{source.name} is a deck with materials of its own: leave --material away."
        )
    flat = None if inspected.flat_contact is None or inspected.is_deck else (metal.E, metal.nu)
    inspected = replace(
        inspected,
        material=metal.name,
        material_is_given=material is not None,
        flat_contact=flat or inspected.flat_contact,
    )

    _require_absent(target)
    files.write_text(target, scene_text(target.name, relative, inspected, drop), "the scene file")
    picture = _write_picture(target.with_suffix(".png"), inspected, drop)
    return target, [*sentences, *inspected.sentences(source.name, drop), picture]


def _require_absent(target: Path) -> None:
    """Raise InputError if a file exists."""
    if os.path.lexists(target):  # `exists` raises for a name that no system takes
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        )


def scene_text(name: str, source: str, inspected: Inspection, drop: bool = False) -> str:
    """The text of the scene file `name`; `source`: the part's file as the scene names it."""
    return rendered_template(
        Path(__file__).with_name("page") / "scene.toml",
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        part=Path(source).name,
        deck=inspected.is_deck,
        closed=Path(source).suffix.lower() == ".stl",
        look=inspected,
        read=dict.fromkeys(READING_KEYS) | inspected.read_options,
        family=inspected.family,
        fewest=INITIAL_COUNT,
        material=inspected.material,
        point=inspected.point,
        direction=inspected.direction,
        ball=inspected.ball_radius,
        ball_material=json.dumps(inspection.BALL_MATERIAL),
        drop=drop,
        groups=names_text(json.dumps(name, ensure_ascii=False) for name in inspected.groups),
        fall={
            "height": inspection.FALL_HEIGHT,
            "tilt": list(inspection.FALL_TILT),
            "until": DEFAULT_IMPACTS,
            "friction": inspection.FLOOR_FRICTION,
            "floor": inspection.FLOOR_MATERIAL,
        },
        json=json.dumps,
    )


# --- The picture ----------------------------------------------------------------------------------


def _write_picture(path: Path, inspected: Inspection, drop: bool) -> str:
    """Draw the part unless the file exists; returns a sentence on the picture."""
    if path.exists():
        return (
            f"{path} exists already, and is left as it is: it does not show this scene; to have its"
            " picture, remove both, then write the scene anew."
        )
    try:
        with progress.doing(f"drawing {path.name}"):
            draw_part(inspected, path, drop=drop)
    except AntioscError as error:
        return f"{path.name} is not drawn: {error}"
    return f"a picture of it: {path}"


def draw_part(inspected: Inspection, path: Path, *, drop: bool = False) -> None:
    """Draw the outer faces of a part; without `drop` also its supports and its impact."""
    from antiosc.plot.charts import save_figure
    from antiosc.plot.surfaces import DeformedSurface, deformed_figure

    points, faces = inspected.points, inspected.faces
    if drop:
        height = 1e3 * (points[:, 2] - points[:, 2].min())
        label = "height over its lowest point (mm)"
        part = DeformedSurface(points, points, faces, height, label, float(height.max()))
        figure = deformed_figure(part, whole_scale=True)
    else:  # each face has points of its own, so that it is held (yellow) or not (nan, grey)
        count = faces.shape[1]
        fixed = np.repeat(inspected.held[faces].any(axis=1), count)
        points = points[faces.ravel()]
        faces = np.arange(len(points)).reshape(-1, count)
        arrow = np.array(inspected.point), np.array(inspected.direction)
        part = DeformedSurface(points, points, faces, np.where(fixed, 1.0, np.nan), "", 1.0)
        figure = deformed_figure(part, arrow=arrow, view=_view_angles(arrow[1]), whole_scale=True)
        held_text = "yellow: held; " if fixed.any() else ""
        figure.text(0.02, 0.02, f"{held_text}red: where and how it is struck")
    save_figure(figure, path, dpi=100)


def _view_angles(direction: Array) -> Array:
    """(elevation, azimuth) [degrees] from which a face struck in `direction` (3,) is seen."""
    elevation, azimuth = np.radians(VIEW_ANGLES).T
    level = np.cos(elevation)
    towards = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    cosines = -(direction @ np.array(towards)) / np.linalg.norm(direction)
    seen = cosines >= MIN_VIEW_COSINE
    return np.array(VIEW_ANGLES[int(np.argmax(seen if seen.any() else cosines))])
