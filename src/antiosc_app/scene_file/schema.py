"""Content of a scene file: its sections, the objects that they make, and the keys of each.

The keys of a section are read from the signature of the object that it makes, so that a new
parameter becomes a key without changes here.
"""

from __future__ import annotations

import builtins
import collections.abc
import dataclasses
import functools
import inspect
import os
import pkgutil
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

import antiosc
from antiosc import ContactLaw, LinearBody
from antiosc.base import checks, materials
from antiosc.models.modal import as_damping

# -- kinds of values

#: Name of a kind -> types of its values, in words, several of them in words.
_KINDS: dict[str, tuple[tuple[type, ...], str, str]] = {
    "number": ((int, float), "a number", "numbers"),
    "whole": ((int,), "a whole number", "whole numbers"),
    "text": ((str,), 'a text in "quotes"', "texts"),
    "path": ((str,), 'a file name in "quotes"', "file names"),
    "flag": ((bool,), "true or false", "true or false"),
    "object": ((dict,), "a table { … }", "tables { … }"),
    "data": (
        (int, float, str, list),
        "a number, a list of numbers or a text",
        "numbers or texts",
    ),
}


@dataclass(frozen=True)
class ValueKind:
    """One kind of value.

    Attributes
    ----------
    name : a key of `_KINDS`, or "choice", "list", "table".
    options : the texts of a choice.
    kind : class of an "object"; type of the keys of a "table".
    items : permitted kinds of the entries of a list or table.
    each : permitted kinds of each entry of a list of fixed length, in order.
    """

    name: str
    options: tuple[str, ...] = ()
    kind: type = object
    items: tuple[ValueKind, ...] = ()
    each: tuple[tuple[ValueKind, ...], ...] = ()

    def fits(self, value: object) -> bool:
        """Whether a TOML value is of this kind; its entries are not checked."""
        if self.name == "list":
            return isinstance(value, list) and (not self.each or len(value) == len(self.each))
        if self.name == "choice":
            return isinstance(value, str) and value in self.options
        types = (dict,) if self.name == "table" else _KINDS[self.name][0]
        return isinstance(value, types) and (bool in types or not isinstance(value, bool))

    def first_entry_fits(self, value: object) -> bool:
        """Whether the first entry of a list is of a permitted kind; True for other values."""
        if not isinstance(value, list) or not value or self.name != "list":
            return True
        return any(kind.fits(value[0]) for kind in (self.each or (self.items,))[0])

    @property
    def text(self) -> str:
        """The kind in words: "a number"."""
        if self.name == "choice":
            return " or ".join(f'"{option}"' for option in self.options)
        if self.each:
            return f"a list [{', '.join(words(kinds).removeprefix('a ') for kinds in self.each)}]"
        if self.name in ("list", "table"):
            return f"a {self.name} of {plural(self.items)}"
        return _KINDS[self.name][1]

    @property
    def plural_text(self) -> str:
        """The kind in words, in the plural: "numbers"."""
        if self.name == "list":
            return f"lists of {plural(self.items or self.each[0])}"
        if self.name in _KINDS:
            return _KINDS[self.name][2]
        return self.text


NUMBER, WHOLE, TEXT, FLAG, PATH, DATA = map(
    ValueKind, ("number", "whole", "text", "flag", "path", "data")
)
NUMBERS = ValueKind("list", items=(NUMBER,))


def words(kinds: Sequence[ValueKind]) -> str:
    """The permitted kinds of a value in words: "a number or a text"."""
    *texts, last = dict.fromkeys(kind.text for kind in kinds)
    return f"{', '.join(texts)} or {last}" if texts else last


def plural(kinds: Sequence[ValueKind]) -> str:
    """The permitted kinds of several values in words: "numbers or texts"."""
    return " or ".join(dict.fromkeys(kind.plural_text for kind in kinds))


class Unknown:
    """Replaces a name that is imported only for type checkers, and that no file can contain."""


class _Names(dict[str, object]):
    """Names in annotations -> objects; Unknown for names imported only for type checkers."""

    def __missing__(self, name: str) -> object:
        definitions = (vars(module).get(name) for module in (builtins, typing, collections.abc))
        return next((value for value in definitions if value is not None), Unknown)


_PLAIN: dict[object, ValueKind] = {
    **{float: NUMBER, int: WHOLE, str: TEXT, bool: FLAG, Any: DATA},
    **{Path: PATH, os.PathLike: PATH, Unknown: DATA},
}
_LISTS = (collections.abc.Sequence, collections.abc.Iterable, list, tuple, set)


def kinds_of(annotation: object) -> tuple[ValueKind, ...]:
    """The kinds of an annotation; () if no file can hold it: None, functions, communicators."""
    if isinstance(annotation, dataclasses.InitVar):
        return kinds_of(annotation.type)
    if hasattr(annotation, "__value__"):  # a name for a type, as ArrayLike is from NumPy 2.4
        return kinds_of(annotation.__value__)
    origin = typing.get_origin(annotation)
    arguments = typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        if complex in arguments:  # NumPy's ArrayLike
            return (DATA,)
        inner = (kind for part in arguments if part is not Unknown for kind in kinds_of(part))
        return tuple(dict.fromkeys(inner))
    if origin is typing.Literal:
        texts = tuple(text for text in arguments if isinstance(text, str))
        flags = (FLAG,) if len(texts) < len(arguments) else ()
        if texts:
            return (ValueKind("choice", texts), *flags)
        return flags
    if origin is np.ndarray:
        return (ValueKind("list", items=(NUMBER, NUMBERS)),)
    if origin is tuple and arguments and arguments[-1] is not ...:
        return (ValueKind("list", each=tuple(map(kinds_of, arguments))),)
    if origin in _LISTS:
        return (ValueKind("list", items=kinds_of(arguments[0]) or (DATA,)),)
    if origin in (collections.abc.Mapping, dict):
        return (ValueKind("table", kind=arguments[0], items=kinds_of(arguments[1])),)
    plain_kind = _PLAIN.get(origin or annotation)
    module = getattr(annotation, "__module__", "")
    if plain_kind is None and isinstance(annotation, type) and module.startswith("antiosc"):
        plain_kind = ValueKind("object", kind=annotation)
    if plain_kind is None:
        return ()
    return (plain_kind,)


# -- parameters of what the sections make

#: Parameters that no file may give, beside those that only Python objects can be.
WITHHELD = {
    "trust": "a file cannot permit itself to run commands; use Python for a script that you trust",
    "shapes": "shapes are always kept, for fields and probes",
    **dict.fromkeys(
        ("comm", "earlier", "groups", "info", "history", "self"), "it is an object of Python"
    ),
}
#: Parameters whose texts are file names, beside those whose annotation says it.
FILES = ("Structure.from_files.map", "find_impact.signals")
#: Parameters that take an object of a class or its name, beside those whose annotation says it.
OBJECTS = {"Floor.material": "Solid", "AntiOscillators.with_surface.material": "Solid"}
#: Functions and classes that only check and store values, or do more than that.
LIGHT = ("material", "named_impactor", "normal", "lognormal", "uniform", "soil_cone")
HEAVY = ("Structure", "Scene", "AntiOscillators", "Fall")

#: (name, value) -> the value, or InputError
Check = Callable[[str, Any], object]


@dataclass(frozen=True)
class Parameter:
    """One key of a section: permitted kinds, whether it is required, and check."""

    name: str
    kinds: tuple[ValueKind, ...]
    needed: bool = True
    check: Check | None = None


#: Function -> keys of its section that only scenes have.
FURTHER = {"probe": (Parameter("srs", (FLAG, NUMBER, NUMBERS), needed=False),)}


@functools.cache
def parameters(function: str) -> Mapping[str, Parameter]:
    """Name -> Parameter of a public callable such as "Solid" or "Hertz.from_radii"."""
    call = resolved(function)
    inner = inspect.unwrap(call.__init__ if inspect.isclass(call) else call)
    names = _Names(getattr(inner, "__func__", inner).__globals__)
    # fields of dataclasses have checks; the values of a batch are lists
    field_checks = CHECKS if not only_checks(function) and function != "simulate_many" else {}
    if dataclasses.is_dataclass(call):
        metadata = {entry.name: entry.metadata for entry in dataclasses.fields(call)}
        field_checks = {key: data["check"] for key, data in metadata.items() if "check" in data}
    by_name = {}
    for name, parameter in inspect.signature(
        call, globals=names, locals=names, eval_str=True
    ).parameters.items():
        full = f"{function}.{name}"
        kinds = kinds_of(parameter.annotation)
        if full in OBJECTS:
            kinds = (ValueKind("object", kind=resolved(OBJECTS[full])), TEXT)
        if full in FILES or PATH in kinds:
            kinds = (PATH, *(kind for kind in kinds if kind not in (PATH, TEXT, DATA)))
        if kinds and name not in WITHHELD and parameter.kind is not parameter.VAR_KEYWORD:
            required = parameter.default in (parameter.empty, checks.REQUIRED)
            check = CHECKS.get(full, field_checks.get(name))
            by_name[name] = Parameter(name, kinds, required, check)
    return by_name | {parameter.name: parameter for parameter in FURTHER.get(function, ())}


def resolved(function: str) -> Any:
    """The public callable of a dotted name; "output" is the section of the files."""
    if function == "output":
        return Output
    return functools.reduce(getattr, function.split("."), antiosc)


def only_checks(function: str) -> bool:
    """Whether a call only checks and stores values, so that it can be made without a run."""
    class_name = function.partition(".")[0]
    return function in LIGHT or (inspect.isclass(resolved(class_name)) and class_name not in HEAVY)


def _choice_check(name: str) -> Check:
    """A check against the choices "module:name", imported on use since it may need dolfinx."""
    return lambda key, value: checks.choice(key, value, tuple(pkgutil.resolve_name(name)))


def _check_named(name: str) -> Check:
    return lambda _, value: pkgutil.resolve_name(name)(value)


def _in_unit(unit: str) -> Check:
    return functools.partial(checks.positive, unit=unit)


#: What a support may fix.
COMPONENTS = ("all", "x", "y", "z", "rx", "ry", "rz")
#: Parameter, or function and parameter, -> the check of its value. A function checks its values
#: when it runs, which is too late for a file that is only looked at.
CHECKS: dict[str, Check] = {
    **dict.fromkeys(("duration", "step", "timeout"), _in_unit("s")),
    **dict.fromkeys(("size", "merge", "radius", "height", "corner_radius"), _in_unit("m")),
    **dict.fromkeys(("max_contacts", "max_steps", "modes"), checks.whole),
    "accuracy": checks.positive,
    "band": _in_unit("Hz"),
    "damping": lambda _, value: as_damping(value),
    "density": _in_unit("kg/m³"),
    "expansion": _in_unit("Hz"),
    "filter": _choice_check("antiosc.base.cfc:CLASSES"),
    "gap": functools.partial(checks.nonnegative, unit="m"),
    "method": _choice_check("antiosc.impact.reference:METHODS"),
    "n": lambda name, value: value if value == "auto" else checks.whole(name, value, least=0),
    "order": functools.partial(checks.choice, options=(1, 2)),
    "quantity": _choice_check("antiosc.fields.probe:PROBED_QUANTITIES"),
    "times": checks.nonempty,
    "tol": lambda name, value: checks.tolerance(value, name),
    "unit": _check_named("antiosc.io.neutral:UnitSystem.of"),
    "extract.method": functools.partial(checks.choice, options=("krylov", "modes")),
    "from_frf.band": functools.partial(checks.floats, shape=(2,)),
    "from_frf.damping": functools.partial(checks.choice, options=("viscous", "hysteretic")),
    "read_frf.quantity": functools.partial(
        checks.choice, options=("receptance", "mobility", "accelerance")
    ),
    "read_frf.unit": checks.positive,
    "until": _check_named("antiosc_studies.drops.drop:end_of"),
    "read_model.modulus": _in_unit("Pa"),
    "read_model.yield_strength": lambda name, value: (
        materials.yielding(value) if isinstance(value, str) else checks.positive(name, value, "Pa")
    ),
    "Sphere.radius": _in_unit("m"),
    "Support.fix": lambda _, value: [
        checks.choice("fix", component, COMPONENTS) for component in np.ravel(value).tolist()
    ],
    "Sphere.E": _in_unit("Pa"),
    "Sphere.nu": lambda _, value: checks.poisson(value),
    "Sphere.rho": _in_unit("kg/m³"),
}

# -- sections


@dataclass(frozen=True)
class Output:
    """The files that `antiosc run` writes; their names are fixed.

    Parameters
    ----------
    csv : bool
        The histories as tables: history.csv, probes.csv, srs.csv, for a sweep or a map sweep.csv,
        map.csv, for an identified impact force.csv.
    json : bool
        All numbers of the result: result.json.
    plot : "svg", "png" or "pdf", optional
        Pictures of the force, the motion and the model, in this format.
    fields : bool
        The motion of the whole structure as series.pvd, for ParaView.
    model : bool
        The reduced model as model.npz, which [model] reads.
    """

    csv: bool = True
    json: bool = True
    plot: Literal["svg", "png", "pdf"] | None = None
    fields: bool = False
    model: bool = False


#: The key that chooses one of several classes or constructors.
KIND = "kind"
# Classes and other constructors that `kind` chooses from. Materials:
FAMILIES = "AnisotropicSolid Beam Laminate Shell Solid Truss material"
LAWS = (
    "ElasticPlastic Flores Gonthier HuntCrossley LankaraniNikravesh Thornton"
    " Thornton.from_material YangSun Hertz Hertz.from_radii Linear Power Tabulated"
)
IMPACTORS = "Impactor Obstacle RigidMass Sphere named_impactor"
DISTRIBUTIONS = "normal lognormal uniform"
JOINTS = "Bolt Bushing Equation Ball Hinge Slider Weld Mean Rigid Tie"


@dataclass(frozen=True)
class SceneSection:
    """One section of a scene file.

    Attributes
    ----------
    form : "table" [x], "list" [[x]], "named" [x.NAME], or "text": a key at the top of the file.
    names : names of the callables, separated by spaces; the key `kind` chooses one.
    about : description, for `antiosc new`, messages and the schema.
    given : names of parameters whose values come from other sections.
    inner : sections within it, by name.
    alone : for a named section: whether [x] without a name is allowed too.
    """

    form: Literal["table", "list", "named", "text"]
    names: str
    about: str
    given: str = ""
    inner: Mapping[str, SceneSection] = field(default_factory=dict)
    alone: bool = False

    @property
    def makes(self) -> tuple[str, ...]:
        """Names of the callables among which the key `kind` chooses."""
        return tuple(self.names.split())


def constructors_of(kind: type) -> tuple[str, ...]:
    """Names of the constructors of a class: "Section", "Section.rectangle", …"""
    if issubclass(kind, ContactLaw):
        return tuple(LAWS.split())
    if kind is LinearBody:
        return ("AntiOscillators.load", "soil_cone")
    name = kind.__name__
    try:
        methods = inspect.getmembers(resolved(name), inspect.ismethod)
    except AttributeError:  # not public
        return ()
    results = {n: inspect.signature(m).return_annotation for n, m in methods if n[0] != "_"}
    return (name, *(f"{name}.{n}" for n, returned in results.items() if returned in (name, kind)))


#: Form of a section -> its type, what it must be, and its heading.
FORMS: dict[str, tuple[type, str, str]] = {
    "table": (dict, "a table, ", "[{0}]"),
    "named": (dict, "a table of names, ", "[{0}.NAME]"),
    "list": (list, "a list of tables, ", "[[{0}]]"),
    "text": (str, 'a text in "quotes"', ""),
}


def headed(name: str) -> str:
    """The heading of a section: "[material]", "[[contacts]]", "[sites.NAME]"."""
    section = SECTIONS[name]
    return FORMS["table" if section.alone else section.form][2].format(name)


_STRUCTURE: dict[str, SceneSection] = {
    "geometry": SceneSection("table", "read_mesh", "the mesh or CAD file of the structure"),
    "deck": SceneSection("table", "read_model",
        "a deck of Abaqus, CalculiX or Nastran with materials and supports", "supports attached"),
    "material": SceneSection("named", FAMILIES,
        'the material, of all cells or of named groups of them; by name: material = "steel S235"',
        alone=True),
    "supports": SceneSection("list", "Support", "displacements that are fixed"),
    "attached": SceneSection("list", "PointMass Spring Damper",
        "point masses, springs, dampers"),
    "structure": SceneSection("table", "Structure", "options of the structure",
        "mesh material supports attached prestress"),
}  # fmt: skip
SECTIONS: dict[str, SceneSection] = {
    "title": SceneSection("text", "", "what the scene shows; for tables and the report"),
    **_STRUCTURE,
    "prestress": SceneSection("table", "Prestress",
        "loads that the structure carries all the time: spin, pressure, tensions"),
    "matrices": SceneSection("table", "Structure.from_files",
        "stiffness and mass matrices of another program"),
    "parts": SceneSection("named", "", "the parts of an assembly, each with its own sections",
        inner=_STRUCTURE),
    "joints": SceneSection("list", JOINTS, "how the parts are joined"),
    "at": SceneSection("named", "Placement", "where each part stands"),
    "points": SceneSection("table", "", "reference points of the assembly: name = [x, y, z]"),
    "assembly": SceneSection("table", "assemble", "options of the assembly",
        "parts joints at points supports attached"),
    "model": SceneSection("table", "AntiOscillators.load",
        "a reduced model that antiosc has saved"),
    "frf": SceneSection("table", "read_frf",
        "measured frequency responses in place of a structure"),
    "from_frf": SceneSection("table", "from_frf", "the model of a measurement", "frf"),
    "sites": SceneSection("named", "Site", "where the structure is struck"),
    "extract": SceneSection("table", "extract", "the reduction to a model", "structure site"),
    "surface": SceneSection("table", "AntiOscillators.with_surface",
        "what a model without a mesh is made of where it is struck, for the law of the contact",
        "self"),
    "impactor": SceneSection("table", IMPACTORS, "what strikes the structure"),
    "contact": SceneSection("table", LAWS,
        'the contact law between structure and impactor; without it the one they need, "auto"'),
    "simulate": SceneSection("table", "simulate", "the impact of the impactor",
        "model impactor contact"),
    "strike": SceneSection("table", "strike",
        "the impact to a tolerance, for which mesh, model and step are chosen",
        "source site impactor contact material supports prestress"),
    "bodies": SceneSection("named", f"{IMPACTORS} RigidBody AntiOscillators.load soil_cone",
        "bodies of a scene of several contacts"),
    "contacts": SceneSection("list", "Contact", "contacts between the sites of bodies"),
    "loads": SceneSection("list", "Load", "forces in time"),
    "base": SceneSection("table", "Base", "acceleration of the supports"),
    "motion": SceneSection("named", "Motion", "how free bodies start"),
    "scene": SceneSection("table", "Scene", "options of a scene of several contacts",
        "bodies contacts loads base motion"),
    "run": SceneSection("table", "Scene.run", "the simulation of a scene of several contacts"),
    "sweep": SceneSection("table", "", "values of a sweep: impactor.velocity = [1.0, 2.0]"),
    "map": SceneSection("table", "impact_map", "the same impact at many points of the surface",
        "structure impactor contact"),
    "monte_carlo": SceneSection("table", "monte_carlo",
        'runs with random values: n, seed, impactor.velocity = {kind = "normal", …}',
        "run inputs"),
    "drop": SceneSection("table", "drop",
        "the fall of the structure from a height onto a floor, in place of an impact",
        "part"),
    "accelerometers": SceneSection("named", "Fall.peak",
        "points of a fall whose peak acceleration is reported", "self quantity"),
    "worst": SceneSection("table", "Fall.worst", "the largest stress of a fall at every node",
        "self"),
    "sensors": SceneSection("named", "Sensor",
        "sensors whose signals identify a blow, in their order"),
    "find": SceneSection("table", "find_impact",
        "a blow that is looked for in the signals of sensors, in place of an impact",
        "structure sensors impactor contact"),
    "stress": SceneSection("table", "peak_field", "the largest stress of the impact at every node",
        "structure history"),
    "probes": SceneSection("named", "probe", "points whose motion is written", "structure"),
    "output": SceneSection("table", "output", "the files that are written"),
}  # fmt: skip
#: Sections of which exactly one says what is struck.
SOURCES = ("geometry", "deck", "matrices", "parts", "model", "frf")
#: Those that have no structure: their model has its own sites.
MODELS = ("model", "frf")
#: Sections whose values a sweep may vary, and further ones that say what is struck.
VARIED = ("impactor", "contact", "simulate")
STRUCTURAL = (
    *("geometry", "deck", "matrices", "parts", "model", "frf", "material", "structure"),
    *("at", "points", "assembly", "sites", "extract", "from_frf", "surface"),
)
#: Sections of which [monte_carlo] draws values.
DRAWN = ("impactor", "contact")
