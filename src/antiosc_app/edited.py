"""The scene of `antiosc open`: changes by clicks and fields of the page, and Undo.

The page stores no set-up: it sends changes of this scene, which begins as the scene of
`antiosc new`.
"""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from antiosc import IMPACTORS
from antiosc.base import checks, materials
from antiosc.base.errors import InputError
from antiosc.base.texts import rounded_up
from antiosc.models.body import AUTO
from antiosc_app import new
from antiosc_app.inspection import Inspection
from antiosc_app.scene_file.compiled import compile_document
from antiosc_app.scene_file.document import Document, Mistakes
from antiosc_app.scene_file.schema import KIND_KEY

#: A table of a scene.
Table = dict[str, Any]

#: Kinds of strikers on the page; the floor is that of a fall.
BALL_STRIKER, MASS_STRIKER, HAMMER_STRIKER, FLOOR_STRIKER = "ball", "mass", "hammer", "floor"
STRIKER_CLASSES = {
    BALL_STRIKER: "Sphere",
    MASS_STRIKER: "RigidMass",
    HAMMER_STRIKER: "named_impactor",
}
#: Hammers of IEC 60068-2-75 with a tip of steel.
STEEL_HAMMERS = tuple(
    name for name, impactor in IMPACTORS.items() if name[:2] == "IK" and impactor.steel
)
#: Names of isotropic materials, and the choice of one that is not among them.
ISOTROPIC_MATERIALS = tuple(name for name in materials.names() if materials.record(name).G is None)
OWN_MATERIAL = "own material"
#: Those with a yield strength, which a deck may have none of.
MATERIALS_THAT_YIELD = [name for name in materials.names() if materials.record(name).yield_strength]
#: Floors: rigid, or a half-space of a material.
RIGID_FLOOR = "rigid"
FLOOR_MATERIALS = (RIGID_FLOOR, *ISOTROPIC_MATERIALS)
#: Keys that fields of the page change, by section; no other is taken, and none names a file.
EDITABLE_KEYS: dict[str, frozenset[str]] = {
    "geometry": frozenset({"size"}),
    "deck": frozenset({"size", "yield_strength", "yield_range", "density", "modulus"}),
    "material": frozenset(
        {"E", "nu", "rho", "yield_strength", "yield_range", "thickness", "section.d"}
    ),
    "sites": frozenset({"point", "direction", "radius"}),
    "extract": frozenset({"n", "damping"}),
    "impactor": frozenset(
        {"radius", "tip_radius", "mass", "velocity", "name", "E", "nu", "rho", "yield_strength"}
    ),
    "simulate": frozenset({"duration"}),
    "drop": frozenset({"height", "tilt", "toward", "corner_radius", "damping", "floor.friction"}),
}
#: Keys without a value that a scene takes as "auto".
AUTOMATIC_KEYS = {"sites": "radius", "extract": "n", "simulate": "duration"}
#: How many times smaller the cells of a finer mesh are.
REFINEMENT_FACTOR = 3.0
#: Largest number of set-ups that Undo keeps.
MAX_UNDO = 50


class SceneState(NamedTuple):
    """Sections of an impact and of a fall, which of both is computed, names of held faces."""

    impact: Table
    fall: Table
    is_fall: bool
    held_faces: tuple[str, ...]


class EditedScene:
    """A scene that the page edits.

    `faces`: tables of supports by name of the face they fix; `held_faces`: names of the faces fixed
    at first.
    """

    def __init__(
        self,
        path: Path,
        inspected: Inspection,
        faces: Mapping[str, Mapping[str, Any]],
        held: Sequence[str],
    ) -> None:
        self._path = path.with_suffix(".toml")
        self._inspected = inspected
        self._faces = faces
        impact, fall = (_initial_sections(path, inspected, drop) for drop in (False, True))
        self._state = SceneState(impact, fall, False, tuple(held))
        if held:
            self._set_supports(impact)
        self._past: list[SceneState] = []

    @property
    def is_fall(self) -> bool:
        """Whether the computed scene is a fall."""
        return self._state.is_fall

    @property
    def sections(self) -> Table:
        """The sections of the scene that is computed."""
        return self._state.fall if self.is_fall else self._state.impact

    def document(self, more_sections: Table | None = None) -> Document:
        """The scene as if it were read from its file, with `more_sections` sections."""
        text = toml_text(self.sections | (more_sections or {}))
        return Document(self._path, tomllib.loads(text), Mistakes(self._path.name, text))

    def page_state(self) -> Table:
        """The state of the scene as data for the page."""
        sections = dict(self.sections)
        if not self.is_fall:
            sections["sites"] = self.site
        return {
            "scene": sections,
            "held": list(self._state.held_faces),
            "falls": self.is_fall,
            "undo": bool(self._past),
        }

    @property
    def site(self) -> Table:
        """The table of the struck site."""
        site: Table = next(iter(self._state.impact["sites"].values()))
        return site

    # -- what changes it

    def undo(self) -> None:
        """Undo the last change, if there is one."""
        if self._past:
            self._state = self._past.pop()

    def change(
        self, values: Table, stressed_place: Sequence[float] = (), cell_size: float = 0.0
    ) -> None:
        """Change the scene; an InputError for a mistake leaves it unchanged.

        `values`: name of a change -> its value. For a finer mesh, `stressed_place`: place [m] of
        the largest stress, and `cell_size`: size [m] of the cells at the site, in the last answer.
        """
        before = self._state
        self._state = copy.deepcopy(before)
        try:
            for name, value in values.items():
                self._apply_change(name, value, stressed_place, cell_size)
            compile_document(self.document())
        except BaseException:
            self._state = before
            raise
        self._past = [*self._past, before][-MAX_UNDO:]

    def _apply_change(
        self, name: str, value: Any, stressed_place: Sequence[float], cell_size: float
    ) -> None:
        """Apply the change `name`; `stressed_place` and `cell_size` as in `change`."""
        if name == "set":
            if not isinstance(value, dict):
                raise InputError("a change is a table of places and values.")
            for place, entry in value.items():
                self._set_key(place, entry)
        elif name == "hold":
            self._toggle_face(value)
        elif name == "striker":
            self._strike_with(
                checks.choice("the striker", value, (*STRIKER_CLASSES, FLOOR_STRIKER))
            )
        elif name == "material":
            self._set_material("material", value)
        elif name == "of":
            self._set_material("impactor", value)
        elif name == "onto":
            floor = self._state.fall["drop"].setdefault("floor", {})
            _set_or_remove(
                floor,
                "material",
                None if value == RIGID_FLOOR else _checked_name(value, ISOTROPIC_MATERIALS),
            )
        elif name == "finer":
            self._refine_cells(stressed_place, cell_size)
        else:
            raise InputError(f"the page has no change {checks.shown(name)}.")

    def _set_key(self, place: str, value: Any) -> None:
        """Set the key `place`, as "section.key"; None removes it, or makes it "auto"."""
        section, _, key = place.partition(".")
        if key not in EDITABLE_KEYS.get(section, ()):
            raise InputError(f"the page does not change {checks.shown(place)}.")
        has_patch = section != "sites" or self._inspected.family == "Solid"
        if value is None and AUTOMATIC_KEYS.get(section) == key and has_patch:
            value = AUTO
        for table in self._tables(section):
            *inner, last = key.split(".")
            for name in inner:
                table = table.setdefault(name, {})
            _set_or_remove(table, last, value)
        if place == "sites.point" and "refine" in self._state.impact.get("geometry", {}):
            refine = self._state.impact["geometry"]["refine"]  # the fine cells follow the site
            self._state.impact["geometry"]["refine"] = [[list(value), refine[0][1]]]

    def _tables(self, section: str) -> list[Table]:
        """The tables of a section in the scenes of impact and fall, which share the part."""
        if section == "sites":
            return [self.site]
        scenes = [self._state.impact, self._state.fall]
        tables = [scene[section] for scene in scenes if section in scene]
        if not tables:
            raise InputError(f"this scene has no [{section}].")
        return tables

    def _toggle_face(self, face: object) -> None:
        """Hold a face that is free, or free one that is held."""
        if not isinstance(face, str) or face not in self._faces:
            raise InputError(f"the part has no face {checks.shown(face)}.")
        held = self._state.held_faces
        held = tuple(one for one in held if one != face) if face in held else (*held, face)
        self._state = self._state._replace(held_faces=held)
        self._set_supports(self._state.impact)

    def _set_supports(self, scene: Table) -> None:
        """Set [[supports]] of a scene to those of the held faces."""
        supports = [dict(self._faces[name]) for name in self._state.held_faces]
        _set_or_remove(scene, "supports", supports or None)

    def _strike_with(self, striker_kind: str) -> None:
        """Change the kind of striker; common values are taken from the former striker."""
        self._state = self._state._replace(is_fall=striker_kind == FLOOR_STRIKER)
        if (
            striker_kind == FLOOR_STRIKER
            or self._state.impact["impactor"].get(KIND_KEY) == STRIKER_CLASSES[striker_kind]
        ):
            return
        before = self._state.impact["impactor"]
        radius = before.get("radius") or before.get("tip_radius") or self._inspected.ball_radius
        common = {"velocity": before.get("velocity", 1.0)}
        common["material"] = before.get("material", ISOTROPIC_MATERIALS[0])
        tables: dict[str, Table] = {
            BALL_STRIKER: {"radius": radius, **common},
            MASS_STRIKER: {
                "mass": self._inspected.heaviest_striker(0.5),
                "tip_radius": radius,
                **common,
            },
            HAMMER_STRIKER: {"name": STEEL_HAMMERS[0]},
        }
        self._state.impact["impactor"] = {
            KIND_KEY: STRIKER_CLASSES[striker_kind],
            **tables[striker_kind],
        }
        self._state.impact["contact"] = {KIND_KEY: AUTO}

    def _set_material(self, section: str, name: object) -> None:
        """Change a material; a user-defined one begins with the former material's constants."""
        _checked_name(name, (*ISOTROPIC_MATERIALS, OWN_MATERIAL))
        for table in self._tables(section):
            before = table.get(
                "name" if section == "material" else "material", ISOTROPIC_MATERIALS[0]
            )
            shape = {key: table[key] for key in ("thickness", "section") if key in table}
            own = self._material_constants(before, section)
            if section == "material":
                table.clear()
                table |= shape | (own if name == OWN_MATERIAL else {"name": name})
                continue
            for key in (*own, "material"):
                if key != KIND_KEY:
                    table.pop(key, None)
            table |= own if name == OWN_MATERIAL else {"material": name}

    def _material_constants(self, name: str, section: str) -> Table:
        """The constants of a named material, as keys of a section."""
        record = materials.record(name)
        constants: Table = {"E": record.E, "nu": record.nu, "rho": record.rho}
        if record.yield_strength is not None:
            constants["yield_strength"] = record.yield_strength
        if section == "impactor":
            if self._state.impact["impactor"].get(KIND_KEY) == STRIKER_CLASSES[MASS_STRIKER]:
                del constants["rho"]
            return constants
        if record.yield_range is not None:
            constants["yield_range"] = list(record.yield_range)
        return {KIND_KEY: self._inspected.family, **constants}

    def _refine_cells(self, stressed_place: Sequence[float], cell_size: float) -> None:
        """Refine cells at the site and the largest stress; all cells of a finished solid mesh."""
        inspected = self._inspected
        for scene in (self._state.impact, self._state.fall):
            read = scene.get("geometry") or scene["deck"]
            if not (inspected.is_meshed or inspected.is_divisible):
                read["size"] = rounded_up(read.get("size", inspected.longest_cell) / 2)
                continue
            point = list(self.site["point"])
            known = read.get("refine", [])
            size = rounded_up(
                (known[0][1] if known else cell_size or inspected.size) / REFINEMENT_FACTOR
            )
            places = [point, *([list(stressed_place)] if len(stressed_place) else [])]
            read["refine"] = [[place, size] for place in places]


def _initial_sections(path: Path, inspected: Inspection, drop: bool) -> Table:
    """Sections of the scene that `antiosc new` writes; `drop`: for a fall."""
    text = new.scene_text(path.with_suffix(".toml").name, path.name, inspected, drop)
    sections = tomllib.loads(text)
    if drop and inspected.is_deck:
        sections["deck"]["free"] = True
    return sections


def _checked_name(value: object, names: Any) -> str:
    """`value` if it is among `names`, else InputError."""
    if not isinstance(value, str) or value not in names:
        raise InputError(
            f"the choice must be one of {', '.join(names)}; got {checks.shown(value)}."
        )
    return value


def _set_or_remove(table: Table, key: str, value: Any) -> None:
    """Set a key, or remove it if `value` is None."""
    if value is None:
        table.pop(key, None)
    else:
        table[key] = value


# -- as text


def toml_text(sections: Mapping[str, Any]) -> str:
    """Sections as TOML: top-level keys first, then [x], [x.NAME] and [[x]]."""
    lines = [
        f"{name} = {_toml_value(value)}" for name, value in sections.items() if _is_top_level(value)
    ]
    for name, value in sections.items():
        if _is_top_level(value):
            continue
        if isinstance(value, list):
            for table in value:
                lines += ["", f"[[{name}]]", *_toml_lines(table)]
        elif value and all(isinstance(table, Mapping) for table in value.values()):
            for key, table in value.items():
                lines += ["", f"[{name}.{key}]", *_toml_lines(table)]
        else:
            lines += ["", f"[{name}]", *_toml_lines(value)]
    return "\n".join([*lines, ""])


def _is_top_level(value: object) -> bool:
    """Whether a value is a top-level key, neither table nor list of tables."""
    return not isinstance(value, Mapping | list)


def _toml_lines(table: Mapping[str, Any]) -> list[str]:
    """A table as lines "key = value" in TOML."""
    return [f"{key} = {_toml_value(value)}" for key, value in table.items()]


def _toml_value(value: object) -> str:
    """A value as TOML text."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(_toml_lines(value))} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_toml_value, value))}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
