"""The set-up of `antiosc open`: the values that its page sends, and the scene for them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, NamedTuple

from antiosc import IMPACTORS, Solid
from antiosc.base import checks, materials
from antiosc.base.errors import InputError
from antiosc.base.texts import piece_told, rounded_up
from antiosc_app.guessed_sites import RESOLVED, facet_size_at
from antiosc_app.inspection import (
    BALL_MATERIAL,
    FALL_HEIGHT,
    FLOOR_MATERIAL,
    FRICTION,
    TILT,
    Inspection,
)
from antiosc_app.new import IMPACTS

#: A table of a scene.
Table = dict[str, Any]

#: Name of the floor among the strikers; all kinds of strikers.
FLOOR = "floor"
STRIKERS = ("ball", "mass", "hammer", FLOOR)
#: Hammers of IEC 60068-2-75 with a tip of steel.
HAMMERS = tuple(name for name, impactor in IMPACTORS.items() if name[:2] == "IK" and impactor.steel)
#: Largest number of places of the largest stress around which it is refined.
MOST_STRESSED = 3
#: Refinement factor of a finer mesh.
FINER = 3.0
#: Largest number of held faces.
MOST_HELD = 200
#: Anti-oscillators of the first numbers, from free modes.
COUNT = 20
#: Largest number of anti-oscillators.
MOST_OSCILLATORS = 400
#: Names of isotropic materials; default of a part.
MATERIALS = tuple(name for name in materials.names() if materials.record(name).G is None)
FIRST = "steel S235"
#: The choice of a material that is not in the table, given by its constants.
OWN = "own material"
LACKING = "a material of your own needs E, nu and rho."
#: Names of floors: rigid, or a half-space of a material.
RIGID_FLOOR = "rigid"
FLOORS = (RIGID_FLOOR, *MATERIALS)
#: Soft layers on a floor: name -> modulus, its lowest and highest value [Pa], and loss factor.
#: Typical of what is sold (recalled, no source could be read); own values have a field.
LAYERS = {
    "cork": (12e6, (5e6, 25e6), 0.15),
    "rubber granulate": (1.5e6, (0.8e6, 3e6), 0.15),
    "polyethylene foam": (0.4e6, (0.2e6, 0.8e6), 0.2),
}
NO_LAYER = "none"
#: Direction in the axes of the file that points down in a fall.
DOWN = (0.0, 0.0, -1.0)


class InspectedFile(NamedTuple):
    """The inspected file of a part.

    Attributes
    ----------
    name : name of the file.
    look : the inspected part.
    faces : name -> table of the support that fixes this face.
    """

    name: str
    look: Inspection
    faces: Mapping[str, Mapping[str, Any]]

    @property
    def told(self) -> str:
        """Its name, with the piece of it that is read: "piece 1 of 12 of a.step"."""
        piece, count = self.look.read.get("piece"), len(self.look.pieces)
        of_pieces = f"piece {piece} of {count}" if piece and count else ""
        told = piece_told(self.look.notes) or of_pieces
        return f"{told} of {self.name}" if told else self.name

    def size_at(self, point: Sequence[float]) -> float:
        """Size [m] of the facets of the skin under the patch that they resolve at a point."""
        return facet_size_at(self.look.points, self.look.faces, point)


@dataclass(frozen=True)
class OwnMaterial:
    """The constants of a material that is not in the table; those of `Solid`, which checks them."""

    E: float
    nu: float
    rho: float
    yield_strength: float | None = None
    yield_range: tuple[float, float] | None = None
    #: name of the material that it begins as: one of its kind grows alike with the strain rate
    origin: str = ""

    def __post_init__(self) -> None:
        if self.origin:
            checks.choice("the material", self.origin, MATERIALS)
        solid = Solid(**self.table)
        if solid.yield_range is not None:
            checks.strength_range(solid.yield_range, solid.yield_strength)

    @property
    def table(self) -> Table:
        """The given constants, with the growth of the strength."""
        constants = {**asdict(self), "rate": self._rate()}
        del constants["origin"]
        return {name: value for name, value in constants.items() if value is not None}

    def _rate(self) -> tuple[float, ...] | None:
        """The growth of the strength, in proportion to the origin's, that the bar is no narrower
        than of the same constants by name.
        """
        if not self.origin or self.yield_strength is None:
            return None
        origin = materials.record(self.origin)
        if not materials.same_kind((self.E, origin.E), (self.rho, origin.rho)):
            return None
        return materials.growth(origin, self.yield_strength)


@dataclass(frozen=True)
class Striker:
    """The striker: a ball, a mass with a spherical tip, a hammer, or the floor of a fall."""

    kind: str = "ball"
    #: radius of the ball or the tip [m]
    radius: float = 0.01
    #: mass [kg] of the kind "mass"
    mass: float = 0.5
    #: [m/s]
    speed: float = 1.0
    #: material of the ball or the mass: a name, or OWN
    material: str = BALL_MATERIAL
    #: the constants of OWN
    own: OwnMaterial | None = None
    #: name of a hammer, whose speed is that of its test
    name: str = HAMMERS[0]
    #: height of a fall [m]
    height: float = FALL_HEIGHT
    #: direction of the part that points down; then rotations about x, y and z [degree]
    down: tuple[float, ...] = DOWN
    tilt: tuple[float, ...] = TILT
    #: places of impacts of a fall around which the mesh is refined
    finer: tuple[Sequence[float], ...] = ()
    #: radius of sharp corners in a fall [m]; None: as `antiosc.drop` takes it
    corner_radius: float | None = None
    #: material of the floor
    floor: str = FLOOR_MATERIAL
    #: its coefficient of friction
    friction: float = FRICTION
    #: name of a soft layer on it, which takes the place of the material
    layer: str = NO_LAYER
    #: thickness [m] and modulus [Pa] of the layer; None: the typical modulus with its range
    layer_thickness: float = 0.02
    layer_modulus: float | None = None

    def __post_init__(self) -> None:
        checks.choice("the striker", self.kind, STRIKERS)
        checks.choice("the hammer", self.name, HAMMERS)
        checks.choice("the striker's material", self.material, (*MATERIALS, OWN))
        if self.material == OWN and self.own is None:
            raise InputError(LACKING)
        checks.choice("the floor", self.floor, FLOORS)
        checks.choice("the layer", self.layer, (NO_LAYER, *LAYERS))
        lengths = (("radius", "m"), ("height", "m"), ("layer_thickness", "m"))
        for name, unit in (*lengths, ("mass", "kg"), ("speed", "m/s")):
            checks.positive(name, getattr(self, name), unit)
        checks.nonnegative("friction", self.friction)
        for name in ("down", "tilt"):
            checks.floats(name, getattr(self, name), (3,))
        if self.finer:
            checks.floats("finer", self.finer, (None, 3))
        for name, unit in (("corner_radius", "m"), ("layer_modulus", "Pa")):
            if getattr(self, name) is not None:
                checks.positive(name, getattr(self, name), unit)


@dataclass(frozen=True)
class SetUp:
    """One impact on the part of a file."""

    point: tuple[float, ...]
    direction: tuple[float, ...]
    #: radius of the patch [m]; None: as the mesh of a solid resolves it
    radius: float | None = None
    striker: Striker = field(default_factory=Striker)
    #: name of the material, or OWN; "" for a deck
    material: str = FIRST
    #: the constants of OWN
    own: OwnMaterial | None = None
    #: thickness of a sheet, or diameter of a bar [m]
    thickness: float | None = None
    #: names of the held faces
    held: tuple[str, ...] = ()
    #: damping ratio; None: none of an impact, that of `antiosc.drop` of a fall
    damping: float | None = None
    #: largest cell of the mesh [m]; None: as the file was read
    size: float | None = None
    #: whether the mesh is refined around the site; None: if the error bar asks for it
    finer: bool | None = None
    #: size of the cells of a finished mesh there [m]; None: what the waves of the contact need
    near: float | None = None
    #: places of the largest stress around which it is refined then, too
    stressed: tuple[Sequence[float], ...] = ()
    #: yield strength of the materials of a deck that state none [Pa], or the name of a material
    #: whose strength those of its kind have; None: unknown
    yield_strength: float | str | None = None
    #: range of that strength [Pa]; None: it is exact, or that of the name
    yield_range: tuple[float, float] | None = None
    #: number of anti-oscillators; None: as a new scene has
    n: int | None = None
    #: frequency of their expansion point [Hz]; None: static
    expansion: float | None = None
    #: density of the materials of a deck that state none [kg/m³]; None: as it was read
    density: float | None = None
    #: Young's modulus of the materials of a deck that state no elasticity [Pa]; None: as density
    modulus: float | None = None
    #: duration of the impact [s]; None: until striker and part no longer touch nor approach
    duration: float | None = None

    def __post_init__(self) -> None:
        for name in ("point", "direction"):
            checks.floats(name, getattr(self, name), (3,))
        for name in ("radius", "thickness", "size", "near"):
            if getattr(self, name) is not None:
                checks.positive(name, getattr(self, name), "m")
        if self.expansion is not None:
            checks.positive("expansion", self.expansion, "Hz")
        of_deck = [("density", "kg/m³"), ("modulus", "Pa")]
        if isinstance(self.yield_strength, str):
            checks.choice("the material of the yield strength", self.yield_strength, MATERIALS)
        else:
            of_deck.append(("yield_strength", "Pa"))
        for name, unit in (("duration", "s"), *of_deck):
            if getattr(self, name) is not None:
                checks.positive(name, getattr(self, name), unit)
        if self.yield_range is not None and not isinstance(self.yield_strength, str):
            checks.strength_range(self.yield_range, self.yield_strength)
        if self.damping is not None:
            checks.nonnegative("damping", self.damping)
        if self.n is not None:
            checks.whole("n", self.n, least=1, most=MOST_OSCILLATORS)
        if self.finer is not None:
            checks.flag("finer", self.finer)
        if self.stressed:
            checks.floats("stressed", self.stressed, (None, 3))
        if len(self.stressed) > MOST_STRESSED:
            raise InputError(f"stressed lists at most {MOST_STRESSED} places.")
        if self.material:
            checks.choice("the material", self.material, (*MATERIALS, OWN))
        if self.material == OWN and self.own is None:
            raise InputError(LACKING)
        if len(self.held) > MOST_HELD or not all(isinstance(face, str) for face in self.held):
            raise InputError(f"held lists at most {MOST_HELD} names of faces.")

    @property
    def is_finer(self) -> bool:
        """Whether the mesh is refined at the site, or at the impacts of a fall."""
        return bool(self.striker.finer if self.striker.kind == FLOOR else self.finer)


def constants_of(name: str) -> OwnMaterial:
    """The constants of a material of the table, from which an own one starts on the page."""
    record = materials.record(name)
    strengths = record.yield_strength, record.yield_range
    return OwnMaterial(record.E, record.nu, record.rho, *strengths, origin=name)


#: Names in messages that are other ones on the page.
LABELS = {
    "E": "Young's modulus",
    "nu": "Poisson's ratio",
    "rho": "density",
    "yield_range": "the range of the yield strength",
    "point": "place",
    "down": "what points down",
    "n": "anti-oscillators",
    "size": "cell size",
    "damping": "damping ratio",
}


def labelled(message: str) -> str:
    """A message with the labels of the page in place of the names of values."""
    names = [item.name for kind in (SetUp, Striker, OwnMaterial) for item in fields(kind)]
    labels = {name: name.replace("_", " ") for name in names if "_" in name} | LABELS
    return re.sub(r"\w+", lambda word: labels.get(word[0], word[0]), message)


def read(values: object) -> SetUp:
    """The set-up that the page sends; InputError, in the words of the page, for anything else."""
    try:
        return _read(values)
    except InputError as error:
        raise InputError(labelled(str(error))) from None


def _read(values: object) -> SetUp:
    """The set-up that the page sends."""
    table = dict(_checked_fields("set-up", values, SetUp))
    striker = dict(_checked_fields("striker", table.get("striker", {}), Striker))
    _as_tuples(striker, [name for name in ("down", "tilt", "finer") if name in striker])
    _as_tuples(table, ("point", "direction", "held", "stressed"))
    for owner in (table, striker):
        if owner.get("own") is not None:
            owner["own"] = _own(owner["own"])
    if table.get("yield_range") is not None:
        _as_tuples(table, ["yield_range"])
    return SetUp(**{**table, "striker": Striker(**striker)})


def _own(values: object) -> OwnMaterial:
    """The own material that the page sends."""
    table = dict(_checked_fields("material of your own", values, OwnMaterial))
    if not {"E", "nu", "rho"} <= table.keys():
        raise InputError(LACKING)
    if table.get("yield_range") is not None:
        _as_tuples(table, ["yield_range"])
    return OwnMaterial(**table)


def _as_tuples(table: Table, names: Sequence[str]) -> None:
    """Turn the lists of a table into tuples, in place; InputError for a value that is no list."""
    for name in names:
        values = table.get(name, [])
        if not isinstance(values, list):
            raise InputError(f"{name} must be a list.")
        table[name] = tuple(values)


def _checked_fields(what: str, values: object, kind: type) -> Mapping[str, Any]:
    """The values as a table with no other names than the fields of `kind`."""
    names = {item.name for item in fields(kind)}
    if not isinstance(values, dict) or not values.keys() <= names:
        raise InputError(f"a {what} is a table of {', '.join(sorted(names))}.")
    return values


def scene_of(source: InspectedFile, set_up: SetUp, duration: float) -> Table:
    """The sections of the scene of a set-up; `duration` of the impact [s]."""
    inspection = source.look
    title = f"An impact on {source.name}"
    if set_up.striker.kind == FLOOR:
        part = _part(source, set_up, set_up.striker.finer)
        if inspection.of_deck:
            part["deck"]["free"] = True
        return {"title": f"A fall of {source.name}", **part, "drop": _drop(set_up)}
    site: Table = {"point": list(set_up.point), "direction": list(set_up.direction), "snap": True}
    if inspection.family == "Solid":
        size = source.size_at(set_up.point)
        if set_up.finer and inspection.meshed:
            size = set_up.near or size / FINER
        site["radius"] = set_up.radius or rounded_up(RESOLVED * size)
    extract: Table = {"n": set_up.n or inspection.count}
    if set_up.expansion:
        extract["expansion"] = set_up.expansion
    if set_up.damping:
        extract["damping"] = set_up.damping
    if inspection.bars:
        extract["error"] = "estimate"
    return {
        "title": title,
        **_part(source, set_up, [set_up.point, *set_up.stressed] if set_up.finer else []),
        "supports": [dict(face_of(source, name)) for name in set_up.held],
        "sites": {"struck": site},
        "extract": extract,
        "impactor": _striker(set_up.striker),
        "simulate": {"duration": duration},
    }


def _part(source: InspectedFile, set_up: SetUp, finer: Sequence[Sequence[float]]) -> Table:
    """The sections of the part: mesh or geometry with material, or the deck.

    `finer`: places around which the mesh is refined.
    """
    inspection = source.look
    read = dict(source.look.read)
    if set_up.size is not None:
        read["size"] = set_up.size
    if finer and inspection.divides and set_up.near:
        read["refine"] = [[list(place), set_up.near] for place in finer]
    if inspection.of_deck:
        names = ("yield_strength", "yield_range", "density", "modulus")
        given = {name: value for name in names if (value := getattr(set_up, name))}
        return {"deck": {"path": source.name, **read, **given}}
    if finer and inspection.meshed:
        sizes = [rounded_up(source.size_at(place) / FINER) for place in finer]
        sizes[0] = set_up.near or sizes[0]
        read["refine"] = [[list(place), size] for place, size in zip(finer, sizes, strict=True)]
    own = set_up.own if set_up.material == OWN else None
    material: Table = {"name": set_up.material}
    if own is not None:
        material = {"kind": inspection.family, **own.table}
    thickness = set_up.thickness or inspection.thickness
    if inspection.family == "Shell":
        material["thickness"] = thickness
    if inspection.family == "Beam":
        material["section"] = {"kind": "Section.circle", "d": thickness}
    return {"geometry": {"source": source.name, **read}, "material": material}


def face_of(source: InspectedFile, name: object) -> Mapping[str, Any]:
    """The table of the support that fixes a face."""
    if not isinstance(name, str) or name not in source.faces:
        raise InputError(f"the part has no face {checks.shown(name)}.")
    return source.faces[name]


def _striker(striker: Striker) -> Table:
    """The section [impactor]."""
    common: Table = {"velocity": striker.speed, **_matter(striker)}
    if striker.kind == "ball":
        return {"kind": "Sphere", "radius": striker.radius, **common}
    if striker.kind == "mass":
        return {"kind": "RigidMass", "mass": striker.mass, "tip_radius": striker.radius, **common}
    return {"kind": "named_impactor", "name": striker.name}


def _matter(striker: Striker) -> Table:
    """The material of a ball or a mass: its name, or the constants of an own one, and the name of
    the origin of a known strength, that its bar is no narrower than by name.
    """
    own = striker.own
    if striker.material != OWN or own is None:
        return {"material": striker.material}
    constants: Table = {"E": own.E, "nu": own.nu}
    if striker.kind == "ball":
        constants["rho"] = own.rho
    if own.yield_strength is not None:
        constants["yield_strength"] = own.yield_strength
        if own.origin:
            constants["material"] = own.origin
    return constants


def _drop(set_up: SetUp) -> Table:
    """The section [drop]."""
    striker = set_up.striker
    floor: Table = {"friction": striker.friction}
    if striker.layer != NO_LAYER:
        floor["layer"] = _layer(striker)
    elif striker.floor != RIGID_FLOOR:
        floor["material"] = striker.floor
    options: Table = {"until": IMPACTS, "floor": floor}
    if set_up.damping is not None:
        options["damping"] = set_up.damping
    if striker.corner_radius is not None:
        options["corner_radius"] = striker.corner_radius
    if striker.down != DOWN:
        options["toward"] = list(striker.down)
    return {"height": striker.height, "tilt": list(striker.tilt), **options}


def _layer(striker: Striker) -> Table:
    """The table of a soft layer."""
    modulus, ends, loss = LAYERS[striker.layer]
    layer: Table = {"thickness": striker.layer_thickness, "E": modulus, "loss": loss}
    if striker.layer_modulus is None:
        return {**layer, "range": list(ends)}
    return {**layer, "E": striker.layer_modulus}


#: Below a written scene: what scenes have and the page has not.
SENSOR = """
# The motion of a point, its signal through a filter, and its shock response spectrum:
# [probes.sensor]
# point = [0.0, 0.0, 0.0]           # m
# quantity = "acceleration"
# filter = "CFC1000"                # of SAE J211 and ISO 6487; without it the peak is unfiltered
# srs = true                        # the spectrum; or the frequency in Hz of the value to be told
"""
#: The same below a fall.
SENSOR_OF_FALL = """
# The acceleration of a point of the part:
# [accelerometers.board]
# at = [0.0, 0.0, 0.0]              # m
# filter = "CFC1000"                # of SAE J211 and ISO 6487; without it the peak is unfiltered
"""


def toml(sections: Mapping[str, Any]) -> str:
    """Sections as TOML: top-level keys first, then [x], [x.NAME] and [[x]]."""
    lines = [f"{name} = {_value(value)}" for name, value in sections.items() if _plain(value)]
    for name, value in sections.items():
        if _plain(value):
            continue
        if isinstance(value, list):
            for table in value:
                lines += ["", f"[[{name}]]", *_lines(table)]
        elif value and all(isinstance(table, Mapping) for table in value.values()):
            for key, table in value.items():
                lines += ["", f"[{name}.{key}]", *_lines(table)]
        else:
            lines += ["", f"[{name}]", *_lines(value)]
    return "\n".join([*lines, ""])


def _plain(value: object) -> bool:
    """Whether a value is not a section."""
    return not isinstance(value, Mapping | list)


def _lines(table: Mapping[str, Any]) -> list[str]:
    """A table as lines "key = value"."""
    return [f"{key} = {_value(value)}" for key, value in table.items()]


def _value(value: object) -> str:
    """A value in TOML, which writes texts, flags and lists like JSON."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(_lines(value))} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
