"""The one table of sections: which names a scene file has, and which objects they make.

What a section takes is not written here; it is read from the signatures (`parameters`).
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from antiosc.app.scene_file.parameters import resolved
from antiosc.contact.base import ContactLaw
from antiosc.models.body import LinearBody

#: The key that chooses one of several classes or constructors.
KIND = "kind"
# Classes and other constructors that `kind` chooses from. Materials:
FAMILIES = "AnisotropicSolid Beam Laminate Shell Solid Truss"
LAWS = (
    "Flores Gonthier HuntCrossley LankaraniNikravesh Stronge TanSun Thornton"
    " Thornton.from_material YangSun Hertz Hertz.from_radii Linear Power Tabulated"
)
IMPACTORS = "Impactor Obstacle RigidMass Sphere named_impactor"
DISTRIBUTIONS = "normal lognormal uniform"
JOINTS = "Bolt Bushing Equation Ball Hinge Slider Weld Mean Rigid Tie"


@dataclass(frozen=True)
class Section:
    """One section of a scene file.

    Attributes
    ----------
    form : "table" [x], "list" [[x]], "named" [x.NAME], or "text": a key at the top of the file.
    names : of the callables of which `kind` chooses one.
    about : what it is, for `antiosc new`, messages and the schema.
    given : names of parameters that other sections give.
    inner : sections within it.
    alone : of a named section: whether [x] may also stand alone, without a name.
    """

    form: Literal["table", "list", "named", "text"]
    names: str
    about: str
    given: str = ""
    inner: Mapping[str, Section] = field(default_factory=dict)
    alone: bool = False

    @property
    def makes(self) -> tuple[str, ...]:
        """The callables of which `kind` chooses one."""
        return tuple(self.names.split())


def constructors_of(kind: type) -> tuple[str, ...]:
    """What makes an object of an annotated class: "Section", "Section.rectangle", …"""
    if issubclass(kind, ContactLaw):
        return tuple(LAWS.split())
    if kind is LinearBody:
        return ("AntiOscillators.load", "soil_cone")
    name = kind.__name__
    try:
        methods = inspect.getmembers(resolved(name), inspect.ismethod)
    except AttributeError:  # not public
        return ()
    made = {n: inspect.signature(m).return_annotation for n, m in methods if n[0] != "_"}
    return (name, *(f"{name}.{n}" for n, returned in made.items() if returned in (name, kind)))


_STRUCTURE: dict[str, Section] = {
    "geometry": Section("table", "read_mesh", "the mesh or CAD file of the structure"),
    "deck": Section(
        "table",
        "read_model",
        "a deck of Abaqus, CalculiX or Nastran with materials and supports",
        given="supports attached",
    ),
    "material": Section(
        "named", FAMILIES, "the material, of all cells or of named groups of them", alone=True
    ),
    "supports": Section("list", "Support", "displacements that are fixed"),
    "attached": Section(
        "list",
        "PointMass Spring Damper Footing",
        "point masses, springs, dampers, footings on soil",
    ),
    "structure": Section(
        "table",
        "Structure",
        "options of the structure",
        given="mesh material supports attached",
    ),
}
SECTIONS: dict[str, Section] = {
    "title": Section("text", "", "what the scene shows; for tables and the report"),
    **_STRUCTURE,
    "matrices": Section(
        "table", "Structure.from_files", "stiffness and mass matrices of another program"
    ),
    "parts": Section(
        "named", "", "the parts of an assembly, each with its own sections", inner=_STRUCTURE
    ),
    "joints": Section("list", JOINTS, "how the parts are joined"),
    "at": Section("named", "Placement", "where each part stands"),
    "points": Section("table", "", "reference points of the assembly: name = [x, y, z]"),
    "assembly": Section(
        "table",
        "assemble",
        "options of the assembly",
        given="parts joints at points supports attached",
    ),
    "model": Section("table", "AntiOscillators.load", "a reduced model that antiosc has saved"),
    "frf": Section("table", "read_frf", "measured frequency responses in place of a structure"),
    "from_frf": Section("table", "from_frf", "the model of a measurement", given="frf"),
    "sites": Section("named", "Site", "where the structure is struck"),
    "extract": Section("table", "extract", "the reduction to a model", given="structure site"),
    "impactor": Section("table", IMPACTORS, "what strikes the structure"),
    "contact": Section("table", LAWS, "the contact law between structure and impactor"),
    "simulate": Section(
        "table", "simulate", "the impact of the impactor", given="model impactor contact"
    ),
    "strike": Section(
        "table",
        "strike",
        "the impact to a tolerance, for which mesh, model and step are chosen",
        given="source site impactor contact material supports",
    ),
    "bodies": Section(
        "named",
        f"{IMPACTORS} RigidBody AntiOscillators.load soil_cone",
        "bodies of a scene of several contacts",
    ),
    "contacts": Section("list", "Contact", "contacts between the sites of bodies"),
    "loads": Section("list", "Load", "forces in time"),
    "base": Section("table", "Base", "acceleration of the supports"),
    "motion": Section("named", "Motion", "how free bodies start"),
    "scene": Section(
        "table",
        "Scene",
        "options of a scene of several contacts",
        given="bodies contacts loads base motion",
    ),
    "run": Section("table", "Scene.run", "the simulation of a scene of several contacts"),
    "sweep": Section("table", "", "values of a sweep: impactor.velocity = [1.0, 2.0]"),
    "map": Section(
        "table",
        "impact_map",
        "the same impact at many points of the surface",
        given="structure impactor contact",
    ),
    "monte_carlo": Section(
        "table",
        "monte_carlo",
        'runs with random values: n, seed, impactor.velocity = {kind = "normal", …}',
        given="run inputs executor store",
    ),
    "drop": Section(
        "table",
        "drop",
        "the fall of the structure from a height onto a floor, in place of an impact",
        given="part executor",
    ),
    "accelerometers": Section(
        "named",
        "Fall.peak",
        "points of a fall whose peak acceleration is told",
        given="self quantity",
    ),
    "worst": Section(
        "table", "Fall.worst", "the largest stress of a fall at every node", given="self"
    ),
    "sensors": Section("named", "Sensor", "sensors whose signals tell a blow, in their order"),
    "find": Section(
        "table",
        "find_impact",
        "a blow that is looked for in the signals of sensors, in place of an impact",
        given="structure sensors impactor contact",
    ),
    "stress": Section(
        "table",
        "peak_field",
        "the largest stress of the impact at every node",
        given="structure history",
    ),
    "probes": Section("named", "probe", "points whose motion is written", given="structure"),
    "output": Section("table", "output", "the files that are written"),
}
#: Sections of which exactly one says what is struck.
SOURCES = ("geometry", "deck", "matrices", "parts", "model", "frf")
#: Those that have no structure: their model has its own sites.
MODELS = ("model", "frf")
#: Sections whose values a sweep may vary.
VARIED = ("impactor", "contact", "simulate")
