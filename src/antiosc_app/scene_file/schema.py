"""The schema of scene files: sections, the callable of each of them, and its keys.

The keys of a section are read from the signature of its callable, so that a new parameter becomes a
key without changes here.
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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

import antiosc
from antiosc import ContactLaw, LinearBody
from antiosc.base import _types, checks
from antiosc.models.modal import as_damping

# -- what becomes of values


@dataclass(frozen=True)
class ValueForm:
    """Conversion of a value of a file to an argument; the callable checks it."""

    is_path: bool = False  # a text names a file
    to_float: bool = False  # a whole number becomes a float, unless
    allows_integer: bool = False  # it may be one
    to_array: bool = False  # a number or an array of them
    object_classes: tuple[type, ...] = ()  # classes of which a table makes one
    item_form: ValueForm | None = None  # of the entries of a list
    entry_form: ValueForm | None = None  # of the values of a table
    keys_are_nodes: bool = False  # whether the keys of that table are numbers of nodes

    def __or__(self, other: ValueForm) -> ValueForm:
        """The form of a value that may have either of two forms."""
        return ValueForm(
            self.is_path or other.is_path,
            self.to_float or other.to_float,
            self.allows_integer or other.allows_integer,
            self.to_array or other.to_array,
            self.object_classes + other.object_classes,
            _either_form(self.item_form, other.item_form),
            _either_form(self.entry_form, other.entry_form),
            self.keys_are_nodes or other.keys_are_nodes,
        )


def _either_form(first: ValueForm | None, second: ValueForm | None) -> ValueForm | None:
    """`first | second`; the other one if one is None."""
    return first | second if first and second else first or second


PLAIN_FORM, FLOAT_FORM, WHOLE_FORM, ARRAY_FORM = (
    ValueForm(),
    ValueForm(to_float=True),
    ValueForm(allows_integer=True),
    ValueForm(to_array=True),
)


class UnknownType:
    """Placeholder in annotations for names that only type checkers import; not for files."""


class _Names(dict[str, object]):
    """Objects by names in annotations; UnknownType for names imported only for type checkers."""

    def __missing__(self, name: str) -> object:
        definitions = (vars(module).get(name) for module in (builtins, typing, collections.abc))
        return next((value for value in definitions if value is not None), UnknownType)


_FORMS_BY_TYPE: dict[object, ValueForm] = {
    **{float: FLOAT_FORM, int: WHOLE_FORM, str: PLAIN_FORM, bool: PLAIN_FORM, Any: PLAIN_FORM},
    **{
        Path: ValueForm(is_path=True),
        os.PathLike: ValueForm(is_path=True),
        UnknownType: PLAIN_FORM,
    },
    np.ndarray: ARRAY_FORM,
    typing.Literal: PLAIN_FORM,
}
_LIST_TYPES = (collections.abc.Sequence, collections.abc.Iterable, list, tuple, set)


def form_of(annotation: object) -> ValueForm | None:
    """The form of an annotation; None if no file can hold it: functions, communicators."""
    if isinstance(annotation, dataclasses.InitVar):
        return form_of(annotation.type)
    if annotation in (ArrayLike, _types.ArrayLike):
        return ARRAY_FORM
    if hasattr(annotation, "__value__"):  # a name for a type, as NDArray is from NumPy 2.4 on
        return form_of(annotation.__value__)

    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        if complex in arguments:  # ArrayLike, which was a union of types before
            return ARRAY_FORM
        return functools.reduce(_either_form, map(form_of, set(arguments) - {UnknownType}), None)
    if origin in _LIST_TYPES:
        items = functools.reduce(_either_form, map(form_of, set(arguments) - {...}), None)
        return ValueForm(item_form=items or PLAIN_FORM)
    if origin in (collections.abc.Mapping, dict):
        return ValueForm(
            entry_form=form_of(arguments[1]) or PLAIN_FORM, keys_are_nodes=arguments[0] is int
        )
    if isinstance(annotation, type) and annotation.__module__.startswith("antiosc"):
        return _FORMS_BY_TYPE.get(annotation, ValueForm(object_classes=(annotation,)))
    return _FORMS_BY_TYPE.get(origin or annotation)


# -- parameters of what the sections make

#: Parameters that no file may give, beside those that only Python objects can be.
WITHHELD_PARAMETERS = {
    "trust": "a file cannot permit itself to run commands; use Python for a script that you trust",
    "shapes": "shapes are always kept, for fields and probes",
    **dict.fromkeys(
        ("comm", "earlier", "groups", "info", "history", "self"), "it is an object of Python"
    ),
}
#: Parameters whose texts are file names, beside those whose annotation says it.
FILE_PARAMETERS = ("Structure.from_files.map", "find_impact.signals")
#: Parameters that take an object of a class or its name, beside those whose annotation says it.
OBJECT_PARAMETERS = {"Floor.material": "Solid", "AntiOscillators.with_surface.material": "Solid"}
#: Functions and classes that only check and store values, or do more than that.
CHECKING_FUNCTIONS = ("material", "named_impactor", "normal", "lognormal", "uniform")
COMPUTING_CLASSES = ("Structure", "Scene", "AntiOscillators", "Fall")

#: (name, value) -> the value, or InputError
Check = Callable[[str, Any], object]


@dataclass(frozen=True)
class SceneParameter:
    """One key of a section: its conversion, whether it is needed, and the check of its value."""

    name: str
    form: ValueForm
    is_required: bool = True
    check: Check | None = None


#: Function -> keys of its section that only scenes have.
SCENE_KEYS = {"probe": (SceneParameter("srs", PLAIN_FORM, is_required=False),)}


@functools.cache
def parameters_of(function: str) -> Mapping[str, SceneParameter]:
    """Name -> SceneParameter of a public callable such as "Solid" or "Hertz.from_radii"."""
    call = callable_of(function)
    inner = inspect.unwrap(call.__init__ if inspect.isclass(call) else call)
    names = _Names(getattr(inner, "__func__", inner).__globals__)
    # fields of dataclasses have checks; the values of a batch are lists
    field_checks = (
        PARAMETER_CHECKS if not is_checking_only(function) and function != "simulate_many" else {}
    )
    if dataclasses.is_dataclass(call):
        metadata = {entry.name: entry.metadata for entry in dataclasses.fields(call)}
        field_checks = {key: data["check"] for key, data in metadata.items() if "check" in data}
    by_name = {}
    for name, parameter in inspect.signature(
        call, globals=names, locals=names, eval_str=True
    ).parameters.items():
        full = f"{function}.{name}"
        form = form_of(parameter.annotation)
        if full in OBJECT_PARAMETERS:
            form = ValueForm(object_classes=(callable_of(OBJECT_PARAMETERS[full]),))
        if full in FILE_PARAMETERS:
            form = ValueForm(is_path=True)
        if form and name not in WITHHELD_PARAMETERS and parameter.kind is not parameter.VAR_KEYWORD:
            required = parameter.default in (parameter.empty, checks.REQUIRED)
            check = PARAMETER_CHECKS.get(full, field_checks.get(name))
            by_name[name] = SceneParameter(name, form, required, check)
    return by_name | {parameter.name: parameter for parameter in SCENE_KEYS.get(function, ())}


def callable_of(function: str) -> Any:
    """The public callable of a dotted name ("Hertz.from_radii"); `Output` for "output"."""
    if function == "output":
        return Output
    return functools.reduce(getattr, function.split("."), antiosc)


def is_checking_only(function: str) -> bool:
    """Whether a callable only checks and stores values, and may be called by a check of a scene."""
    class_name = function.partition(".")[0]
    return function in CHECKING_FUNCTIONS or (
        inspect.isclass(callable_of(class_name)) and class_name not in COMPUTING_CLASSES
    )


def _choice_check(name: str) -> Check:
    """A check against the choices in "module:name", imported on use as it may need dolfinx."""
    return lambda key, value: checks.choice(key, value, tuple(pkgutil.resolve_name(name)))


#: What a support may fix.
SUPPORT_COMPONENTS = ("all", "x", "y", "z", "rx", "ry", "rz")
#: Parameter, or function and parameter, -> the check of its value: of functions that would refuse
#: it only after a mesh was made, or an impact computed.
PARAMETER_CHECKS: dict[str, Check] = {
    **dict.fromkeys(("duration", "step", "size", "radius", "height"), checks.positive),
    **dict.fromkeys(("band", "accuracy", "expansion"), checks.positive),
    "damping": lambda _, value: as_damping(value),
    "filter": _choice_check("antiosc.base.cfc:CLASS_FREQUENCIES"),
    "method": _choice_check("antiosc.impact.settings:METHODS"),
    "n": lambda name, value: value if value == "auto" else checks.whole(name, value, least=0),
    "quantity": _choice_check("antiosc.fields.probe:PROBED_QUANTITIES"),
    "times": checks.nonempty,
    "tol": lambda name, value: checks.tolerance(value, name),
    "Site.point": functools.partial(checks.floats, shape=None),
    "extract.method": functools.partial(checks.choice, options=("krylov", "modes")),
    "from_frf.band": functools.partial(checks.floats, shape=(2,)),
    "from_frf.damping": functools.partial(checks.choice, options=("viscous", "hysteretic")),
    "read_frf.quantity": functools.partial(
        checks.choice, options=("receptance", "mobility", "accelerance")
    ),
    "Support.fix": lambda _, value: [
        checks.choice("fix", component, SUPPORT_COMPONENTS)
        for component in np.ravel(value).tolist()
    ],
}

# -- sections


@dataclass(frozen=True)
class Output:
    """The files that `antiosc run` writes; their names are fixed."""

    csv: bool = True  # history.csv, probes.csv, srs.csv, sweep.csv, map.csv, force.csv
    json: bool = True  # all numbers: result.json
    plot: Literal["svg", "png", "pdf"] | None = None  # pictures of force, motion and model
    fields: bool = False  # the motion of the whole structure: series.pvd
    model: bool = False  # model.npz, which [model] reads

    def __post_init__(self) -> None:
        for name in ("csv", "json", "fields", "model"):
            checks.flag(name, getattr(self, name))
        if self.plot is not None:
            checks.choice("plot", self.plot, ("svg", "png", "pdf"))


#: The key that chooses one of several classes or constructors.
KIND_KEY = "kind"
# Classes and other constructors that `kind` chooses from. Materials:
FAMILY_NAMES = "AnisotropicSolid Beam Laminate Shell Solid Truss material"
LAW_NAMES = (
    "ElasticPlastic Flores Gonthier HuntCrossley LankaraniNikravesh Thornton Thornton.from_material"
    " YangSun Hertz Hertz.from_radii Linear Power Tabulated"
)
IMPACTOR_NAMES = "Impactor Obstacle RigidMass Sphere named_impactor"
DISTRIBUTION_NAMES = "normal lognormal uniform"
JOINT_NAMES = "Bolt Bushing Equation Ball Hinge Slider Weld Mean Rigid Tie"


@dataclass(frozen=True)
class SceneSection:
    """One section of a scene file.

    `names`: callables, separated by spaces, from which the key `kind` chooses; `about`: text on the
    section; `given`: parameters from other sections; `inner_sections`: sections within it.
    """

    form: Literal["table", "list", "named", "text"]
    names: str
    about: str
    given: str = ""
    inner_sections: Mapping[str, SceneSection] = field(default_factory=dict)
    allows_unnamed: bool = False  # whether [x] without a name is allowed, too

    @property
    def callables(self) -> tuple[str, ...]:
        """Names of the callables among which the key `kind` chooses."""
        return tuple(self.names.split())


def constructors_of(kind: type) -> tuple[str, ...]:
    """Names of the constructors of a class: "Section", "Section.rectangle", …"""
    if issubclass(kind, ContactLaw):
        return tuple(LAW_NAMES.split())
    if kind is LinearBody:
        return ("AntiOscillators.load",)
    name = kind.__name__
    try:
        methods = inspect.getmembers(callable_of(name), inspect.ismethod)
    except AttributeError:  # not public
        return ()
    results = {n: inspect.signature(m).return_annotation for n, m in methods if n[0] != "_"}
    return (name, *(f"{name}.{n}" for n, returned in results.items() if returned in (name, kind)))


#: Form of a section -> its type, what it must be, and its heading.
SECTION_FORMS: dict[str, tuple[type, str, str]] = {
    "table": (dict, "a table, ", "[{0}]"),
    "named": (dict, "a table of names, ", "[{0}.NAME]"),
    "list": (list, "a list of tables, ", "[[{0}]]"),
    "text": (str, 'a text in "quotes"', ""),
}


def heading_of(name: str) -> str:
    """The heading of a section: "[material]", "[[contacts]]", "[sites.NAME]"."""
    section = SECTIONS[name]
    return SECTION_FORMS["table" if section.allows_unnamed else section.form][2].format(name)


_table, _list, _named = (
    functools.partial(SceneSection, form) for form in ("table", "list", "named")
)
_STRUCTURE_SECTIONS: dict[str, SceneSection] = {
    "geometry": _table("read_mesh", "the mesh or CAD file of the structure"),
    "deck": _table("read_model", "a deck with materials and supports", "supports attached"),
    "material": _named(FAMILY_NAMES, 'the material; by name: material = "steel S235"',
        allows_unnamed=True),
    "supports": _list("Support", "displacements that are fixed"),
    "attached": _list("PointMass Spring Damper", "point masses, springs, dampers"),
    "structure": _table("Structure", "options of the structure",
        "mesh material supports attached prestress"),
}  # fmt: skip
SECTIONS: dict[str, SceneSection] = {
    "title": SceneSection("text", "", "what the scene shows; for tables and the report"),
    **_STRUCTURE_SECTIONS,
    "prestress": _table("Prestress", "loads that the structure carries all the time"),
    "matrices": _table("Structure.from_files", "matrices of another program"),
    "parts": _named("", "parts of an assembly, each with its own sections",
        inner_sections=_STRUCTURE_SECTIONS),
    "joints": _list(JOINT_NAMES, "how the parts are joined"),
    "at": _named("Placement", "where each part stands"),
    "points": _table("", "reference points of the assembly: name = [x, y, z]"),
    "assembly": _table("assemble", "options of the assembly",
        "parts joints at points supports attached"),
    "model": _table("AntiOscillators.load", "a reduced model that antiosc has saved"),
    "frf": _table("read_frf", "measured frequency responses in place of a structure"),
    "from_frf": _table("from_frf", "the model of a measurement", "frf"),
    "sites": _named("Site", "where the structure is struck"),
    "extract": _table("extract", "the reduction to a model", "structure site"),
    "surface": _table("AntiOscillators.with_surface",
        "what a model without a mesh is made of where it is struck", "self"),
    "impactor": _table(IMPACTOR_NAMES, "what strikes the structure"),
    "contact": _table(LAW_NAMES, 'the contact law; without it the one that is needed, "auto"'),
    "simulate": _table("simulate", "the impact of the impactor", "model impactor contact"),
    "strike": _table("strike", "the impact to a tolerance: mesh, model and step are chosen",
        "source site impactor contact material supports prestress"),
    "bodies": _named(f"{IMPACTOR_NAMES} RigidBody AntiOscillators.load",
        "bodies of a scene of several contacts"),
    "contacts": _list("Contact", "contacts between the sites of bodies"),
    "loads": _list("Load", "forces in time"),
    "base": _table("Base", "acceleration of the supports"),
    "motion": _named("Motion", "how free bodies start"),
    "scene": _table("Scene", "options of a scene of several contacts",
        "bodies contacts loads base motion"),
    "run": _table("Scene.run", "the simulation of a scene of several contacts"),
    "sweep": _table("", "values of a sweep: impactor.velocity = [1.0, 2.0]"),
    "map": _table("impact_map", "the same impact at many points", "structure impactor contact"),
    "monte_carlo": _table("monte_carlo", "runs with random values: n, seed, …", "run inputs"),
    "drop": _table("drop", "the fall of the structure, in place of an impact", "part"),
    "accelerometers": _named("Fall.peak", "points of a fall whose peak is told", "self quantity"),
    "worst": _table("Fall.worst", "the largest stress of a fall at every node", "self finer"),
    "sensors": _named("Sensor", "sensors whose signals identify a blow, in their order"),
    "find": _table("find_impact", "a blow that is looked for in the signals of sensors",
        "structure sensors impactor contact"),
    "stress": _table("peak_field", "the largest stress at every node", "structure history"),
    "probes": _named("probe", "points whose motion is written", "structure"),
    "output": _table("output", "the files that are written"),
}  # fmt: skip
#: Sections of which exactly one says what is struck.
SOURCE_SECTIONS = ("geometry", "deck", "matrices", "parts", "model", "frf")
#: Those that have no structure: their model has its own sites.
MODEL_SECTIONS = ("model", "frf")
#: Sections whose values a sweep may vary, and further ones that say what is struck.
SWEPT_SECTIONS = ("impactor", "contact", "simulate")
STRUCTURE_SECTIONS = (
    *("geometry", "deck", "matrices", "parts", "model", "frf", "material", "structure"),
    *("at", "points", "assembly", "sites", "extract", "from_frf", "surface"),
)
#: Sections of which [monte_carlo] draws values.
RANDOM_SECTIONS = ("impactor", "contact")
