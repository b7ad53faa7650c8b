"""The commented scene that `antiosc new` writes."""

from __future__ import annotations

import json
import os
import secrets
from pathlib import Path

from antiosc.app.new.look import STEEL, Look, draw, look, look_at_deck
from antiosc.app.report.report import rendered
from antiosc.base import checks, files, progress
from antiosc.base.errors import AntioscError, InputError
from antiosc.simulation.bodies import Sphere
from antiosc.simulation.two_bodies import impact_band

#: Endings of decks, which describe materials and supports themselves.
DECK_ENDINGS = {".inp", ".bdf", ".nas", ".fem", ".dat"}

#: The geometry of a scene for which no part is given.
PLATE = """\
// A plate of 300 x 200 mm, held at one end; its size of elements is that of the scene.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 0.3, 0.2};
Physical Surface("plate") = {1};
Physical Curve("clamp") = {4};
"""


def text(name: str, source: str, found: Look | None, drop: bool = False) -> str:
    """The scene as a text; `source` is the file of the part as the scene names it.

    `found`: what is known of the part. `drop`: it falls.
    """
    ending = Path(source).suffix.lower()
    return rendered(
        Path(__file__).with_name("scene.toml"),
        name=name,
        source=json.dumps(source, ensure_ascii=False),
        deck=ending in DECK_ENDINGS,
        closed=ending == ".stl",
        look=found,
        read=dict.fromkeys(("unit", "size", "gdim", "merge")) | dict(found.read if found else {}),
        family="Solid" if found is None else found.family,
        point=[0.0, 0.0, 0.1] if found is None else found.point,
        direction=[0.0, 0.0, -1.0] if found is None else found.direction,
        band=_band(),
        drop=drop,
        json=json.dumps,
    )


def _band() -> float:
    """Highest circular frequency [rad/s] that the impact of the scene excites, two digits."""
    ball = Sphere(radius=0.01, **STEEL, velocity=1.0)
    return float(f"{impact_band(ball, ball.hertz(STEEL['E'], STEEL['nu'])):.1e}")


def _looked(part: Path, drop: bool) -> tuple[Look | None, list[str]]:
    """What is found in a file, and sentences that tell it or why it is not known."""
    deck = part.suffix.lower() in DECK_ENDINGS
    try:
        with progress.doing(f"looking at {part.name}"):
            found = look_at_deck(part) if deck else look(part)
    except (AntioscError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error).rstrip(".")
        return None, [f"{part.name} could not be looked at: {why}."]
    return found, found.sentences(part.name, drop)


def _pictured(found: Look, path: Path, drop: bool) -> list[str]:
    """A sentence on the picture; none where it cannot be drawn."""
    if path.exists():
        return []
    try:
        draw(found, path, drop)
    except AntioscError as error:
        return [f"{path.name} is not drawn: {error}"]
    return [f"a picture of it: {path}"]


def write(
    path: str | os.PathLike[str], part: str | None = None, drop: bool = False
) -> tuple[Path, list[str]]:
    """Write a new scene file, complete or absent; its path, and what is told of the part.

    InputError if it exists.
    """
    target = checks.new_file("the scene file", path)
    _absent(target)
    told: list[str] = []
    source = target.with_suffix(".geo") if part is None else Path(part)
    if part is None:
        _absent(source)
        files.write_text(source, PLATE, "the geometry")
        told.append(f"{source} is a plate to begin with; put your own part in its place.")
    else:
        checks.path("the file of the part", part)
    part = os.path.relpath(source, target.parent)
    if not f"{target.name}{part or ''}".isprintable():
        raise InputError(f"the name {checks.shown(part or target.name)} has control characters.")
    found, sentences = _looked(source, drop)
    told += sentences
    content = text(target.name, part, found, drop)
    beside = target.with_name(f".antiosc-{secrets.token_hex(6)}.toml")
    try:
        with beside.open("x", encoding="utf-8") as stream:
            stream.write(content)
        try:
            os.link(beside, target)  # fails if the target exists; a rename would replace it
        finally:
            beside.unlink()
    except FileExistsError:
        _absent(target)
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}.") from None
    picture = target.with_suffix(".png")
    return target, told + ([] if found is None else _pictured(found, picture, drop))


def _absent(target: Path) -> None:
    """InputError for a file that exists."""
    if target.exists():
        raise InputError(
            f"{str(target)!r} exists already, and is left as it is; choose another name."
        )
