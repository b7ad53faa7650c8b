"""The one table of sections: which names a scene file has, and which objects they make.

What a section takes is not written here; it is read from the signatures (`parameters`).
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import antiosc
from antiosc.contact.base import ContactLaw
from antiosc.models.body import LinearBody
from antiosc.scene_file.parameters import resolved

Form = Literal["table", "list", "named", "text"]


@dataclass(frozen=True)
class Section:
    """One section of a scene file.

    Attributes
    ----------
    form : "table" [x], "list" [[x]], "named" [x.NAME], or "text": a key at the top of the file.
    makes : the callables of which `kind` chooses one.
    about : what it is, for `antiosc new`, messages and the schema.
    given : parameters that other sections give.
    inner : sections within it.
    alone : of a named section: whether [x] may also stand alone, without a name.
    """

    form: Form
    makes: Callable[[], tuple[str, ...]]
    about: str
    given: tuple[str, ...] = ()
    inner: Mapping[str, Section] = field(default_factory=dict)
    alone: bool = False


def _only(*names: str) -> Callable[[], tuple[str, ...]]:
    return lambda: names


# -- the kinds of objects, by their classes


@functools.cache
def families() -> tuple[str, ...]:
    """Materials with their element family: public classes of `antiosc.fem.elements`."""
    return _public("antiosc.fem.elements", lambda kind: hasattr(kind, "weak_form"))


@functools.cache
def laws() -> tuple[str, ...]:
    """Contact laws and their other constructors."""
    return with_constructors(_public("antiosc.contact", lambda kind: issubclass(kind, ContactLaw)))


@functools.cache
def impactors() -> tuple[str, ...]:
    """Impactors with their velocity; `named_impactor` makes one of those of standards."""
    by_name = "antiosc.simulation.named_impactors"
    functions = [
        name
        for name, module in public_names().items()
        if module == by_name and inspect.isfunction(resolved(name))
    ]
    return (*with_constructors(_public("antiosc.simulation.impactors", _is_body)), *functions)


@functools.cache
def bodies() -> tuple[str, ...]:
    """Bodies of a scene of several contacts, besides the structure."""
    rigid = _public("antiosc.simulation.bodies", lambda _: True)
    return (*impactors(), *rigid, "AntiOscillators.load")


@functools.cache
def joints() -> tuple[str, ...]:
    """Joints of assemblies."""
    return _public("antiosc.fem.assembly", lambda kind: hasattr(kind, "constraints"))


def _is_body(kind: type) -> bool:
    return callable(getattr(kind, "modal", None))


def public_names() -> Mapping[str, str]:
    """Public name -> module that holds it."""
    return antiosc._MODULES  # type: ignore[attr-defined,no-any-return]


def _public(module: str, wanted: Callable[[type], bool]) -> tuple[str, ...]:
    """Names of the public, concrete classes below a module that are wanted."""
    names = [name for name, where in public_names().items() if where.startswith(module)]
    kinds = {name: resolved(name) for name in names}
    return tuple(
        name
        for name, kind in kinds.items()
        if inspect.isclass(kind) and not inspect.isabstract(kind) and wanted(kind)
    )


def with_constructors(names: tuple[str, ...]) -> tuple[str, ...]:
    """Each class, and its class methods that make one: "Hertz", "Hertz.from_radii"."""
    found: list[str] = []
    for name in names:
        kind = resolved(name)
        found.append(name)
        for other, method in inspect.getmembers(kind, inspect.ismethod):
            made = inspect.signature(method).return_annotation
            if not other.startswith("_") and made in (name, kind):
                found.append(f"{name}.{other}")
    return tuple(found)


def constructors_of(kind: type) -> tuple[str, ...]:
    """What makes an object of an annotated class: "Section", "Section.rectangle", …"""
    if issubclass(kind, ContactLaw):
        return laws()
    if kind is LinearBody or kind.__name__ == "LinearBody":
        return ("AntiOscillators.load",)
    name = kind.__name__
    return with_constructors((name,)) if name in public_names() else ()


# -- the table

_STRUCTURE: dict[str, Section] = {
    "geometry": Section("table", _only("read_mesh"), "the mesh or CAD file of the structure"),
    "deck": Section(
        "table",
        _only("read_model"),
        "a deck of Abaqus, CalculiX or Nastran with materials and supports",
        given=("supports", "attached"),
    ),
    "material": Section(
        "named", families, "the material, of all cells or of named groups of them", alone=True
    ),
    "supports": Section("list", _only("Support"), "displacements that are fixed"),
    "attached": Section("list", _only("PointMass", "Spring"), "point masses and springs"),
    "structure": Section(
        "table",
        _only("Structure"),
        "options of the structure",
        given=("mesh", "material", "supports", "attached"),
    ),
}

_ASSEMBLY: dict[str, Section] = {
    "parts": Section(
        "named", _only(), "the parts of an assembly, each with its own sections", inner=_STRUCTURE
    ),
    "joints": Section("list", joints, "how the parts are joined"),
    "at": Section("named", _only("Placement"), "where each part stands"),
    "points": Section("table", _only(), "reference points of the assembly: name = [x, y, z]"),
    "assembly": Section(
        "table",
        _only("assemble"),
        "options of the assembly",
        given=("parts", "joints", "at", "points", "supports", "attached"),
    ),
}

SECTIONS: dict[str, Section] = {
    "title": Section("text", _only(), "what the scene shows; for tables and the report"),
    **_STRUCTURE,
    "matrices": Section(
        "table", _only("Structure.from_files"), "stiffness and mass matrices of another program"
    ),
    **_ASSEMBLY,
    "model": Section(
        "table", _only("AntiOscillators.load"), "a reduced model that antiosc has saved"
    ),
    "sites": Section("named", _only("Site"), "where the structure is struck"),
    "extract": Section(
        "table", _only("extract"), "the reduction to a model", given=("structure", "site")
    ),
    "impactor": Section("table", impactors, "what strikes the structure"),
    "contact": Section("table", laws, "the contact law between structure and impactor"),
    "simulate": Section(
        "table",
        _only("simulate"),
        "the impact of the impactor",
        given=("model", "impactor", "contact"),
    ),
    "strike": Section(
        "table",
        _only("strike"),
        "the impact to a tolerance, for which mesh, model and step are chosen",
        given=("source", "site", "impactor", "contact", "material", "supports"),
    ),
    "bodies": Section("named", bodies, "bodies of a scene of several contacts"),
    "contacts": Section("list", _only("Contact"), "contacts between the sites of bodies"),
    "loads": Section("list", _only("Load"), "forces in time"),
    "base": Section("table", _only("Base"), "acceleration of the supports"),
    "motion": Section("named", _only("Motion"), "how free bodies start"),
    "scene": Section(
        "table",
        _only("Scene"),
        "options of a scene of several contacts",
        given=("bodies", "contacts", "loads", "base", "motion"),
    ),
    "run": Section("table", _only("Scene.run"), "the simulation of a scene of several contacts"),
    "sweep": Section("table", _only(), "values of a sweep: impactor.velocity = [1.0, 2.0]"),
    "map": Section(
        "table",
        _only("impact_map"),
        "the same impact at many points of the surface",
        given=("structure", "impactor", "contact"),
    ),
    "probes": Section(
        "named", _only("probe"), "points whose motion is written", given=("structure",)
    ),
    "output": Section("table", _only("output"), "the files that are written"),
}
#: Sections of which exactly one says what is struck.
SOURCES = ("geometry", "deck", "matrices", "parts", "model")
