"""The set-up of `antiosc open`: what its page may send, and the scene that it stands for."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import ceil, floor, log10
from typing import Any, NamedTuple

import numpy as np

from antiosc import IMPACTORS
from antiosc.base import checks, materials
from antiosc.base.errors import InputError
from antiosc_app.new import Inspection

#: A table of a scene.
Table = dict[str, Any]

#: What falls on the part, and what the part falls on.
FLOOR = "floor"
STRIKERS = ("ball", "mass", "hammer", FLOOR)
#: Hammers of IEC 60068-2-75 with a tip of steel.
HAMMERS = tuple(name for name, one in IMPACTORS.items() if name[:2] == "IK" and one.steel)
#: Radius of a patch over the size of the faces there, which resolve it; by how much a finer mesh
#: has smaller ones; faces that are looked at.
RESOLVED, FINER, NEIGHBOURS = 1.05, 3.0, 12
#: Most faces that are held.
MOST_HELD = 200
#: Anti-oscillators of a solid or a bar, and of a sheet.
COUNT, COUNT_OF_SHEET = 20, 100
#: Materials by name that are the same in all directions; the first of a new part, of a ball.
MATERIALS = tuple(name for name in materials.names() if materials.record(name).G is None)
FIRST, FIRST_OF_BALL = "steel S235", "bearing steel 100Cr6"
#: Floors by name: rigid, or a half-space of a material; their friction; impacts and free modes of a
#: fall, as in the pages about drops.
RIGID_FLOOR = "rigid"
FLOORS = (RIGID_FLOOR, *MATERIALS)
FRICTION, IMPACTS, MODES = 0.3, 3, 20  # of a floor; of a fall
#: Inclination of a fall on a face [degree]: none lands quite flat, on all its vertices at once.
TILT = (2.0, 1.0, 0.0)
#: Duration of the impact on a solid or a bar [s].
DURATION = 1e-3


class Source(NamedTuple):
    """What the file of a part says.

    Attributes
    ----------
    name : of the file.
    look : what was found in it.
    faces : name -> the table of the support that holds this face.
    geometry : whether it is meshed here.
    """

    def size_at(self, point: Sequence[float]) -> float:
        """Size of the faces of the skin next to a point [m]."""
        corners = self.look.points[self.look.faces]
        far = np.linalg.norm(corners.mean(axis=1) - point, axis=1)
        near = corners[np.argsort(far)[:NEIGHBOURS]]
        return float(np.linalg.norm(near - np.roll(near, 1, axis=1), axis=2).mean(axis=1).max())

    name: str
    look: Inspection
    faces: Mapping[str, Mapping[str, Any]]
    geometry: bool


@dataclass(frozen=True)
class Striker:
    """What strikes: a ball, a mass with a spherical tip, a hammer, or the floor under a fall."""

    kind: str = "ball"
    #: m: of the ball, of the tip
    radius: float = 0.01
    #: kg, of the mass
    mass: float = 0.5
    #: m/s
    speed: float = 1.0
    #: of the ball, of the mass
    material: str = FIRST_OF_BALL
    #: of a hammer, whose speed is that of its test
    name: str = HAMMERS[0]
    #: m, of a fall; the site's direction points up
    height: float = 1.0
    #: material of the floor
    floor: str = RIGID_FLOOR

    def __post_init__(self) -> None:
        checks.choice("the striker", self.kind, STRIKERS)
        checks.choice("the hammer", self.name, HAMMERS)
        checks.choice("the striker's material", self.material, MATERIALS)
        checks.choice("the floor", self.floor, FLOORS)
        lengths = (("radius", "m"), ("height", "m"))
        for name, unit in (*lengths, ("mass", "kg"), ("speed", "m/s")):
            checks.positive(name, getattr(self, name), unit)


@dataclass(frozen=True)
class SetUp:
    """One impact on the part of a file."""

    point: tuple[float, ...]
    direction: tuple[float, ...]
    #: of the patch, m; None: that which the mesh of a solid resolves
    radius: float | None = None
    striker: Striker = field(default_factory=Striker)
    #: "" for a deck
    material: str = FIRST
    #: of a sheet, or diameter of a bar, m
    thickness: float | None = None
    #: names of faces
    held: tuple[str, ...] = ()
    damping: float = 0.0
    #: whether the mesh is refined around the site
    finer: bool = False

    def __post_init__(self) -> None:
        for name in ("point", "direction"):
            checks.array(name, getattr(self, name), (3,))
        for name in ("radius", "thickness"):
            if getattr(self, name) is not None:
                checks.positive(name, getattr(self, name), "m")
        checks.nonnegative("damping", self.damping)
        checks.flag("finer", self.finer)
        if self.material:
            checks.choice("the material", self.material, MATERIALS)
        if len(self.held) > MOST_HELD or not all(isinstance(one, str) for one in self.held):
            raise InputError(f"held lists at most {MOST_HELD} names of faces.")


def rounded_up(value: float) -> float:
    """A number with two digits, not below it."""
    power = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / power * (1 - 1e-9)) * power:.2g}")


def read(values: object) -> SetUp:
    """The set-up that the page sends; InputError for anything else."""
    table = dict(_known("set-up", values, SetUp))
    table["striker"] = Striker(**_known("striker", table.get("striker", {}), Striker))
    for name in ("point", "direction", "held"):
        given = table.get(name, [])
        if not isinstance(given, list):
            raise InputError(f"{name} must be a list.")
        table[name] = tuple(given)
    return SetUp(**table)


def _known(what: str, values: object, kind: type) -> Mapping[str, Any]:
    names = {one.name for one in fields(kind)}
    if not isinstance(values, dict) or not values.keys() <= names:
        raise InputError(f"a {what} is a table of {', '.join(sorted(names))}.")
    return values


def scene_of(source: Source, asked: SetUp, duration: float) -> Table:
    """The sections of the scene of a set-up; `duration` of the impact [s]."""
    look, title = source.look, f"An impact on {source.name}"
    if asked.striker.kind == FLOOR:
        part = _part(source, replace(asked, finer=False))
        return {"title": f"A fall of {source.name}", **part, "drop": _drop(asked), "worst": {}}
    site: Table = {"point": list(asked.point), "direction": list(asked.direction), "snap": True}
    if look.family == "Solid":
        finer = FINER if asked.finer and source.geometry else 1.0
        site["radius"] = asked.radius or rounded_up(RESOLVED * source.size_at(asked.point) / finer)
    extract: Table = {"n": COUNT_OF_SHEET if look.family == "Shell" else COUNT}
    if asked.damping:
        extract["damping"] = asked.damping
    if look.bars:
        extract["error"] = "estimate"
    return {
        "title": title,
        **_part(source, asked),
        "supports": [dict(face_of(source, name)) for name in asked.held],
        "sites": {"struck": site},
        "extract": extract,
        "impactor": _striker(asked.striker),
        "simulate": {"duration": duration},
    }


def _part(source: Source, asked: SetUp) -> Table:
    """What is struck: the mesh or geometry with its material, or the deck."""
    look, read = source.look, dict(source.look.read)
    if look.of_deck:
        return {"deck": {"path": source.name, **read}}
    if asked.finer and source.geometry:
        read["refine"] = [[list(asked.point), rounded_up(source.size_at(asked.point) / FINER)]]
    material: Table = {"name": asked.material}
    thickness = asked.thickness or look.thickness
    if look.family == "Shell":
        material["thickness"] = thickness
    if look.family == "Beam":
        material["section"] = {"kind": "Section.circle", "d": thickness}
    return {"geometry": {"source": source.name, **read}, "material": material}


def face_of(source: Source, name: object) -> Mapping[str, Any]:
    """The table of the support that holds a face."""
    if not isinstance(name, str) or name not in source.faces:
        raise InputError(f"the part has no face {checks.shown(name)}.")
    return source.faces[name]


def _striker(one: Striker) -> Table:
    """[impactor]."""
    made: Table = {"velocity": one.speed, "material": one.material}
    if one.kind == "ball":
        return {"kind": "Sphere", "radius": one.radius, **made}
    if one.kind == "mass":
        return {"kind": "RigidMass", "mass": one.mass, "tip_radius": one.radius, **made}
    return {"kind": "named_impactor", "name": one.name}


def _drop(asked: SetUp) -> Table:
    """[drop]: the place that was clicked leads the way."""
    one = asked.striker
    floor: Table = {"friction": FRICTION}
    if one.floor != RIGID_FLOOR:
        own = materials.record(one.floor)
        known = {name: getattr(own, name) for name in ("E", "nu", "rho", "yield_strength")}
        floor["material"] = {name: value for name, value in known.items() if value is not None}
    down = [-c for c in asked.direction]
    rest: Table = {"until": IMPACTS, "modes": MODES, "damping": asked.damping, "floor": floor}
    return {"height": one.height, "toward": down, "tilt": list(TILT), **rest}


def toml(sections: Mapping[str, Any]) -> str:
    """Sections as TOML: keys of the scene first, then [x], [x.NAME] and [[x]]."""
    lines = [f"{name} = {_value(value)}" for name, value in sections.items() if _plain(value)]
    for name, value in sections.items():
        if _plain(value):
            continue
        if isinstance(value, list):
            for one in value:
                lines += ["", f"[[{name}]]", *_lines(one)]
        elif value and all(isinstance(one, Mapping) for one in value.values()):
            for key, one in value.items():
                lines += ["", f"[{name}.{key}]", *_lines(one)]
        else:
            lines += ["", f"[{name}]", *_lines(value)]
    return "\n".join([*lines, ""])


def _plain(value: object) -> bool:
    """Whether a value is no section."""
    return not isinstance(value, Mapping | list)


def _lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {_value(value)}" for key, value in table.items()]


def _value(value: object) -> str:
    """A value in TOML, which writes texts, flags and lists as JSON does."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(_lines(value))} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
