"""Turns the sections of a scene file into calls that refer to each other.

geometry | deck | matrices | parts → structure → sites → model → impactor, contact → history
                                                         bodies, contacts → scene → history

Document → schema → build → scene → run: the tables of a file become calls to antiosc, which are
checked or made. A scene file holds data only: nothing in it is executed, imported or evaluated.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from antiosc import History
from antiosc.base._types import Array
from antiosc.base.errors import AntioscError, finite_element_packages
from antiosc.models.body import AUTO
from antiosc_app.scene_file.build import (
    Builder,
    Call,
    Evaluation,
    InvalidValue,
    calls_in,
    with_results,
)
from antiosc_app.scene_file.document import GEOMETRY_ENDINGS, Document, Place, Table, place_text
from antiosc_app.scene_file.schema import KIND_KEY, SECTIONS, SOURCE_SECTIONS, parameters_of
from antiosc_app.scene_file.shock import ProbeShock, shock_of

if TYPE_CHECKING:
    from antiosc import AntiOscillators, Fall, PeakField, Structure
    from antiosc_studies.drops.fall import WorstField

T = TypeVar("T")
#: Number of even times over a run at which probes are evaluated, besides those of the run.
PROBE_TIME_COUNT = 1001
#: Of a section that is missing.
MISSING_SECTION: Any = None


@dataclass(kw_only=True)
class SceneObjects(Generic[T]):
    """Objects of the sections of a scene, as calls or as results; None for a missing section.

    `batch` and `facts`: impacts of [sweep] and their error budgets; `sample`: runs of
    [monte_carlo]; `nominal`: the impact at the scene's own values; `peaks` and `worst`:
    accelerometers and largest stress of `fall`; `found`: the impact of [find].
    """

    structure: T = MISSING_SECTION
    model: T = MISSING_SECTION
    impactor: T = MISSING_SECTION
    contact: T = MISSING_SECTION
    scene: T = MISSING_SECTION
    history: T = MISSING_SECTION
    probes: Mapping[str, T] = field(default_factory=dict)
    spectra: Mapping[str, T] = field(default_factory=dict)
    stresses: T = MISSING_SECTION
    batch: T = MISSING_SECTION
    facts: T = MISSING_SECTION
    map: T = MISSING_SECTION
    sample: T = MISSING_SECTION
    nominal: T = MISSING_SECTION
    fall: T = MISSING_SECTION
    peaks: Mapping[str, T] = field(default_factory=dict)
    worst: T = MISSING_SECTION
    found: T = MISSING_SECTION
    warnings: list[str] = field(default_factory=list)


@dataclass(kw_only=True)
class CompiledScene(SceneObjects[Call | None]):
    """The calls of a document's sections; `output` describes the files to be written."""

    document: Document
    output: Call | None = None

    @property
    def simulation(self) -> Call | None:
        """The call whose result `antiosc run` computes; None if there is none."""
        return self.history or self.fall or self.found

    @property
    def is_strike(self) -> bool:
        """Whether the scene has [strike], which chooses mesh and model."""
        return self.history is not None and self.history.name == "strike"

    def runnable_commands(self) -> list[str]:
        """The commands that can run this scene."""
        commands = (
            n for n, study in COMMAND_STUDIES.items() if getattr(self, study.result) is not None
        )
        return [f"antiosc {name}" for name in commands]


class Study(NamedTuple):
    """A command: field of its result, message for scenes without it, fields to make in order."""

    result: str
    missing_message: str
    made_fields: tuple[str, ...]


#: Sections whose structure has a mesh.
MESHED_SECTIONS = "geometry deck parts"

COMMAND_STUDIES = {
    "run": Study(
        "simulation",
        "no simulation to run: give [simulate], [run] for a scene of several contacts, [drop] or"
        " [find]",
        ("structure", "model", "impactor", "contact", "history", "probes", "spectra", "stresses",
         "fall", "peaks", "worst", "found"),
    ),
    "sweep": Study(
        "batch",
        "no [sweep]; one is, for instance, [sweep] with impactor.velocity = [0.5, 1.0, 2.0]",
        ("structure", "model", "impactor", "nominal", "batch", "facts"),
    ),
    "map": Study(
        "map",
        "no [map]; with that line alone all of the surface is struck",
        ("structure", "impactor", "contact", "map"),
    ),
    "monte-carlo": Study(
        "sample",
        "no [monte_carlo]; one is, for instance, [monte_carlo] with"
        ' impactor.velocity = {kind = "normal", mean = 2.0, sigma = 0.1}',
        ("structure", "impactor", "nominal", "sample"),
    ),
}  # fmt: skip


# -- the objects


def structure_section(build: Builder) -> str:
    """Name of the section that describes the structure; "" if there are only rigid bodies."""
    return next((name for name in SOURCE_SECTIONS if name in build.data), "")


def structure_call(build: Builder) -> Call | None:
    """The call that makes the structure; None if the scene has none, or [strike] makes it."""
    name = structure_section(build)
    if name == "parts":
        return _assembly_call(build)
    if name == "matrices":
        return build.call_of_section("matrices")
    if name == "deck" or (name == "geometry" and not is_refined_by_strike(build)):
        return _part_call(build, build.data, ())
    return None


def is_refined_by_strike(build: Builder) -> bool:
    """Whether [strike] chooses the mesh, which needs a scene without [attached], [structure]."""
    mesh = {"geometry", "strike"} <= set(build.data)
    return mesh and not {"attached", "structure"} & set(build.data)


def _part_call(build: Builder, data: Table, place: Place) -> Call | None:
    """The call that makes the structure of a deck or mesh; `data`: sections at `place`."""
    supported = _support_arguments(build, data, place)
    if "deck" in data:
        return build.call_of_section("deck", data, place, given_arguments=supported)
    arguments = {"mesh": build.call_of_section("geometry", data, place), **supported}
    arguments["material"] = _material_call(build, data, place)
    section = "structure" if "structure" in data else "material"  # the section that is there
    if not place and "prestress" in data:
        arguments["prestress"] = build.call_of_section("prestress")
    options = build.section("structure", dict, data)
    return build.call(SECTIONS["structure"], options, (*place, section), arguments)


def _support_arguments(build: Builder, data: Table, place: Place) -> dict[str, object]:
    """The arguments `supports` and `attached` of a structure, if they are not empty."""
    lists = {name: build.calls_of_list(name, data, place) for name in ("supports", "attached")}
    return {name: value for name, value in lists.items() if value}


def _material_call(build: Builder, data: Table, place: Place) -> Call | dict[str, Call] | None:
    """The call that makes the material, or {group of cells: call}; None after a mistake."""
    table = data.get("material")
    material_place = (*place, "material")
    section = SECTIONS["material"]
    if not isinstance(table, dict):
        sentence = f"there is no [{place_text(material_place)}]; it takes kind and the constants"
        build.note(
            place,
            f'{sentence}, as in `[{place_text(material_place)}]` `kind = "Solid"`, '
            f'or a name, as `{place_text(material_place)} = "steel S235"`.',
        )
        return None
    if table and all(isinstance(group_table, dict) for group_table in table.values()):
        materials = {
            group: build.call(section, group_table, (*material_place, group))
            for group, group_table in table.items()
        }
        sound = {group: call for group, call in materials.items() if call is not None}
        if len(sound) == len(materials):
            return sound
        return None
    return build.call(section, table, material_place)


def _assembly_call(build: Builder) -> Call | None:
    """The call of `assemble`; None after a mistake in a part."""
    parts: dict[str, Call | None] = {}
    for name, data in build.section("parts").items():
        place: Place = ("parts", name)
        if not isinstance(data, dict):
            build.note(place, f"{place_text(place)} must be a table, [parts.{name}].")
            continue
        build.check_sections(data, SECTIONS["parts"].inner_sections, place)
        if "deck" in data or "geometry" in data:
            parts[name] = _part_call(build, data, place)
        else:
            build.note(place, f"{place_text(place)} lacks a geometry or a deck.")
    points: object = {}
    with contextlib.suppress(InvalidValue):
        rule = parameters_of("assemble")["points"]
        points = build.value(rule, build.section("points"), ("points",))
    joints = build.calls_of_list("joints")
    placements = build.calls_by_name("at")
    extra_arguments = {
        "at": placements,
        "points": points,
        **_support_arguments(build, build.data, ()),
    }
    arguments: dict[str, object] = {"parts": parts if None not in parts.values() else None}
    arguments |= {"joints": joints} | {
        name: value for name, value in extra_arguments.items() if value
    }
    return build.call_of_section("assembly", even_if_missing=True, given_arguments=arguments)


def model_call(build: Builder, structure: Call | None) -> Call | None:
    """The call that makes the reduced model; None if no section needs one."""
    model_call = _plain_model_call(build, structure)
    if "surface" not in build.data:
        return model_call
    return build.call_of_section("surface", given_arguments={"self": model_call})


def _plain_model_call(build: Builder, structure: Call | None) -> Call | None:
    """The call of the reduced model without its [surface]; None if no section needs one."""
    name = structure_section(build)
    sites = build.calls_by_name("sites")
    if name == "model":
        return build.call_of_section("model")
    if name == "frf":
        return build.call_of_section(
            "from_frf", even_if_missing=True, given_arguments={"frf": build.call_of_section("frf")}
        )
    model_sections = {"extract", "simulate", "contacts", "run", "sweep"} & set(build.data)
    if not name or "strike" in build.data or not (model_sections or sites):
        return None
    if not build.data.get("sites"):
        build.note((name,), "the scene has no site: give [sites.NAME] with point and direction.")
    has_sites = len(build.section("sites")) > 1 or "contacts" in build.data
    if has_sites and "contacts" not in build.data and "simulate" in build.data:
        sentence = "[simulate] takes one site, and there are several: give [[contacts]] between"
        build.note(("sites",), f'{sentence} "structure:SITE" and [bodies.NAME].')
    site = sites if has_sites else next(iter(sites.values()), None)
    return build.call_of_section(
        "extract", even_if_missing=True, given_arguments={"structure": structure, "site": site}
    )


# -- one impact, a blow that is looked for, or several contacts


def impactor_and_law(build: Builder) -> tuple[Call | None, Call | None]:
    """(call of the impactor, call of the contact law)."""
    return build.call_of_section("impactor"), _law_call(
        build, build.data.get("contact"), ("contact",)
    )


def _law_call(build: Builder, table: object, place: Place) -> Call | None:
    """The call of a contact law; "auto" without a table, or for the kind "auto"."""
    if table is None or table == AUTO or (isinstance(table, dict) and table.get(KIND_KEY) == AUTO):
        if isinstance(table, dict) and len(table) > 1:
            build.note(place, f"{place_text(place)} of the kind {AUTO!r} takes no other keys.")
        return Call(str, {}, place, AUTO)
    return build.call(SECTIONS["contact"], table, place)


def set_single_impact(build: Builder, compiled: CompiledScene) -> None:
    """Set the call of `simulate` or `strike` as the history."""
    calls: dict[str, object] = {"impactor": compiled.impactor, "contact": compiled.contact}
    if "impactor" not in build.data:
        build.note((), f"the scene has no [impactor], {SECTIONS['impactor'].about}: give its kind.")
    if "strike" not in build.data:
        call = build.call_of_section("simulate", given_arguments={"model": compiled.model, **calls})
        compiled.history = _with_second_order_forces(build, compiled, call)
        return

    sites = list(build.calls_by_name("sites").values())
    if len(build.section("sites")) != 1:
        build.note(("strike",), "[strike] needs a structure and one site, [sites.NAME].")
        return
    calls["source"] = compiled.structure
    if is_refined_by_strike(build):  # a file or mesh with material and supports
        read = build.call_of_section("geometry")
        calls["source"] = (
            read.arguments["source"] if read is not None and _strike_reads_file(read) else read
        )
        calls["material"] = _material_call(build, build.data, ())
        calls |= _support_arguments(build, build.data, ())
        if "prestress" in build.data:
            calls["prestress"] = build.call_of_section("prestress")
    compiled.history = build.call_of_section(
        "strike", given_arguments={"site": next(iter(sites), None), **calls}
    )


def _strike_reads_file(read: Call) -> bool:
    """Whether [strike] reads the file of [geometry] itself."""
    options = set(read.arguments) - {"source"}
    suffix = Path(str(read.arguments.get("source"))).suffix.lower()
    return not options or (options <= {"size", "refine"} and suffix in GEOMETRY_ENDINGS)


def _with_second_order_forces(
    build: Builder, compiled: CompiledScene, impact: Call | None
) -> Call | None:
    """The call `impact`, repeated with second-order forces if they matter.

    It is unchanged if [extract] has the key `stretch`.
    """
    given_there = "stretch" in build.section("extract")
    if impact is None or None in (compiled.structure, compiled.model) or given_there:
        return impact
    make = impact.function

    def run(structure: Structure, model: AntiOscillators, **given: Any) -> History:
        with finite_element_packages():
            from antiosc.strikes.second_order import simulated
        return simulated(structure, model, functools.partial(_history_with_model, make, given))

    arguments = {"structure": compiled.structure, "model": compiled.model, **impact.arguments}
    return replace(impact, function=run, arguments=arguments)


def _history_with_model(
    run: Callable[..., History], arguments: dict[str, Any], model: AntiOscillators
) -> History:
    """The history of `run` (an impact, or a scene `self`) with `model` of the structure."""
    scene = arguments.get("self")
    if scene is None:
        return run(model=model, **arguments)
    changed_scene = replace(scene, bodies={**scene.bodies, STRUCTURE_NAME: model})
    return run(**{**arguments, "self": changed_scene})


def set_search(build: Builder, compiled: CompiledScene) -> None:
    """Set the call of `find_impact`."""
    sensors = list(build.calls_by_name("sensors").values())
    arguments: dict[str, object] = {"structure": compiled.structure, "sensors": sensors}
    calls = zip(("impactor", "contact"), impactor_and_law(build), strict=True)
    arguments |= {name: call for name, call in calls if name in build.data}
    compiled.found = build.call_of_section("find", given_arguments=arguments)


#: The name of the structure among the bodies of a scene.
STRUCTURE_NAME = "structure"


def set_several_contacts(build: Builder, compiled: CompiledScene) -> None:
    """Set `compiled.scene` and `compiled.history` to the calls that make a `Scene` and run it."""
    structure = {STRUCTURE_NAME: compiled.model} if structure_section(build) else {}
    if STRUCTURE_NAME in build.section("bodies") and structure:
        build.note(
            ("bodies", STRUCTURE_NAME),
            f"the body {STRUCTURE_NAME!r} is the structure of this scene.",
        )
    body_calls = build.calls_by_name("bodies")
    bodies = {**body_calls, **structure}
    is_sound = None not in bodies.values() and len(body_calls) == len(build.section("bodies"))
    arguments: dict[str, object] = {"bodies": bodies if is_sound else None}
    arguments["contacts"] = _contact_calls(build)
    extra_arguments: dict[str, object] = {
        "loads": build.calls_of_list("loads"),
        "base": build.call_of_section("base"),
        "motion": build.calls_by_name("motion"),
    }
    arguments |= {name: call for name, call in extra_arguments.items() if call}
    compiled.scene = build.call_of_section("scene", even_if_missing=True, given_arguments=arguments)

    if "run" not in build.data and "map" not in build.data:
        build.note((), "a scene of several contacts needs [run] with its duration.")
    run_call = build.call_of_section("run", given_arguments={"self": compiled.scene})
    compiled.history = (
        _with_second_order_forces(build, compiled, run_call) if structure else run_call
    )


def _contact_calls(build: Builder) -> list[Call | None]:
    """The calls of [[contacts]]."""
    if not build.section("contacts", list):
        build.note((), "a scene of several bodies needs [[contacts]].")
    contacts = []
    for i, table in enumerate(build.section("contacts", list)):
        place: Place = ("contacts", i)
        if not isinstance(table, dict):
            build.note(place, f"{place_text(place)} must be a table, [[contacts]].")
            continue
        law = _law_call(build, table.get("law"), (*place, "law"))
        arguments = {key: value for key, value in table.items() if key != "law"}
        contacts.append(build.call(SECTIONS["contacts"], arguments, place, {"law": law}))
    return contacts


# -- what a simulation is asked for


def probe_times(history: History) -> Array:
    """Times [s] of probes: times of the history, and evenly spaced times for flights."""
    return np.union1d(history.time, np.linspace(0.0, history.time[-1], PROBE_TIME_COUNT))


#: Keys of [probes.NAME] that are its place.
PLACE_KEYS = ("point", "node", "part", "snap")


#: The key srs of a probe: whether its spectrum is made, or at which frequencies in Hz it is told.
SpectrumKey: TypeAlias = bool | float | Sequence[float]


def place_arguments(probe: Call) -> dict[str, Any]:
    """The arguments of a probe that give its place."""
    return {key: probe.arguments[key] for key in PLACE_KEYS if key in probe.arguments}


def shock_of_probe(
    structure: Structure,
    history: History,
    srs_key: SpectrumKey,
    quantity: str = "",
    **arguments: Any,
) -> ProbeShock:
    """The shock response spectra of a probe, computed from its velocity.

    `srs_key`: value of the key srs; `quantity` is not used; `arguments`: others of `shock_of`.
    """
    return shock_of(structure, history, _srs_frequencies(srs_key), **arguments)


def _srs_frequencies(srs_key: SpectrumKey) -> tuple[float, ...]:
    """The frequencies [Hz] in the key srs; () if it is true or false."""
    if isinstance(srs_key, bool):
        return ()
    return tuple(np.ravel(srs_key).tolist())


def set_probes_and_stress(build: Builder, compiled: CompiledScene) -> None:
    """Set the calls of [probes] and of [stress]; default: all criteria with a strength."""
    part: Call | None = compiled.structure
    if compiled.is_strike and part is None:
        part = Call(lambda history: history.structure, {"history": compiled.history})
    arguments = {"structure": part, "history": compiled.history}
    times = Call(probe_times, {"history": compiled.history})
    probes: dict[str, Call] = {}
    spectra: dict[str, Call] = {}
    for name, probe in build.calls_by_name("probes", arguments).items():
        keys = dict(probe.arguments)
        wanted = keys.pop("srs", False)
        if wanted is not False:
            _check_srs(build, name, keys.get("quantity", "displacement"), wanted)
            spectra[name] = replace(
                probe, function=shock_of_probe, arguments={"srs_key": wanted, **keys}
            )
        probes[name] = replace(probe, arguments={"times": times, **keys})
    compiled.probes, compiled.spectra = probes, spectra
    meshed = compiled.history is not None and structure_section(build) in MESHED_SECTIONS.split()
    if "stress" in build.data:
        _set_stress(build, compiled, arguments)
    elif meshed:
        compiled.stresses = Call(stress_fields, arguments)


def _set_stress(build: Builder, compiled: CompiledScene, arguments: Table) -> None:
    """Set the call of [stress]; with the key tol the mesh is refined to that error.

    `arguments`: the calls of structure and history.
    """
    table = build.section("stress")
    keys = {key: value for key, value in table.items() if key != "tol"}
    asked = build.call(SECTIONS["stress"], keys, ("stress",), arguments)
    if asked is None:
        return
    if "tol" not in table:
        compiled.stresses = Call(lambda peak: {peak.quantity: peak}, {"peak": asked})
        return

    tol = table["tol"]
    if type(tol) is not float or not 0 < tol < 1:
        build.note(("stress", "tol"), f"stress.tol must lie between 0 and 1, as 0.25; got {tol}.")
    elif compiled.history is not None and compiled.is_strike:
        striking = {**compiled.history.arguments, "stress_tol": tol}
        compiled.history = replace(compiled.history, arguments=striking)
        compiled.stresses = Call(lambda history: history.stresses, {"history": compiled.history})
    else:
        options = {key: value for key, value in asked.arguments.items() if key not in arguments}
        known = {**arguments, "build": build, "compiled": compiled, "tol": tol, **options}
        compiled.stresses = Call(_fields_to_tolerance, known, ("stress",))


def _fields_to_tolerance(
    build: Builder,
    compiled: CompiledScene,
    structure: Structure,
    history: History,
    tol: float,
    **options: Any,
) -> dict[str, PeakField]:
    """Stress fields of an impact by quantity, on meshes refined until the error is `tol`.

    `options`: further arguments of `peak_field`.
    """
    with finite_element_packages():
        from antiosc.strikes.stress import closed, fields_by_strength, struck_again
    call: Any = compiled.structure
    of_site: Any = compiled.model

    def strike_again(part: Structure) -> History:
        model = exchanged_call(of_site, {call: replace(call, result=part)})
        return struck_again(history, part, Evaluation(build.document)(model))

    finer = functools.partial(with_smaller_cells, build, call, structure)
    fields = functools.partial(fields_by_strength, **options)
    return closed(history, structure, tol, finer, strike_again, fields).fields


def with_smaller_cells(
    build: Builder, call: Call, structure: Structure, places: Sequence[tuple[Any, float]]
) -> Structure:
    """The structure that `call` made, with cells of given size at places [(point, size [m])].

    A [geometry] is meshed again; cells of decks are bisected.
    """
    geometry = next((one for one in calls_in(call) if one.place == ("geometry",)), None)
    if geometry is None:
        with finite_element_packages():
            from antiosc.strikes.stress import divided
        return divided(structure, places)

    refine = (*geometry.arguments.get("refine", ()), *places)
    finer = replace(geometry, arguments={**geometry.arguments, "refine": refine})
    return Evaluation(build.document)(exchanged_call(call, {geometry: finer}))


def exchanged_call(call: Call, exchanged_calls: Mapping[Call, Call]) -> Call:
    """A copy of `call` in which calls are replaced according to `exchanged_calls`.

    Models in it are extracted without error estimates.
    """

    @functools.cache
    def exchange(one: Call) -> Call:
        if one in exchanged_calls or one.result is not None:
            return exchanged_calls.get(one, one)
        arguments = {key: with_results(value, exchange) for key, value in one.arguments.items()}
        if one.place == ("extract",):
            arguments.pop("error", None)
        return replace(one, arguments=arguments)

    return exchange(call)


def _check_srs(build: Builder, name: str, quantity: object, srs_key: SpectrumKey) -> None:
    """Note mistakes of the key srs of a probe: wrong quantity, or frequencies out of range."""
    if not all(0 < frequency < np.inf for frequency in _srs_frequencies(srs_key)):
        build.note(
            ("probes", name, "srs"),
            f"[probes.{name}] srs = {srs_key}: give finite frequencies above 0 Hz, or true.",
        )
    if quantity not in ("acceleration", "velocity"):
        build.note(
            ("probes", name, "srs"),
            f'[probes.{name}] has the quantity "{quantity}", and a shock response spectrum is that '
            'of an acceleration: give quantity = "acceleration" or "velocity", or leave out srs.',
        )


def stress_fields(structure: Structure, history: History) -> dict[str, PeakField]:
    """Stress fields by quantity: each criterion with a strength, else von Mises stress."""
    with finite_element_packages():
        from antiosc.strikes.stress import fields_by_strength
    return fields_by_strength(structure, history)


def worst_stress_field(
    self: Fall, finer: Callable[..., Structure] | None = None, **options: Any
) -> WorstField | None:
    """The stress field with the largest exposure in a fall; None if no stress is known.

    `finer`: makes a structure with smaller cells; `options`: arguments of `Fall.worst`.
    """
    with finite_element_packages():
        from antiosc.fields.margin import criteria_of
    structure: Any = self.body.structure
    if finer is not None:
        options["finer"] = functools.partial(finer, structure)
    if "quantity" in options:
        return self.worst(**options)

    fields = [self.worst(name, **options) for name in criteria_of(structure)]
    if fields:
        return max(fields, key=lambda field: field.margin().exposure)
    with contextlib.suppress(AntioscError):  # beams whose sections have no outline have no stress
        return self.worst(**options)
    return None
