"""Compiles a document into the calls that it describes, or the list of its mistakes."""

from __future__ import annotations

import functools
from dataclasses import replace
from itertools import product
from typing import NamedTuple

from antiosc.models.body import AUTO
from antiosc_app.scene_file import run
from antiosc_app.scene_file.build import Builder, Call
from antiosc_app.scene_file.document import Document, Table
from antiosc_app.scene_file.scene import (
    MESHED_SECTIONS,
    CompiledScene,
    impactor_and_law,
    model_call,
    set_probes_and_stress,
    set_search,
    set_several_contacts,
    set_single_impact,
    structure_call,
    structure_section,
    with_smaller_cells,
    worst_stress_field,
)
from antiosc_app.scene_file.schema import SECTIONS, SOURCE_SECTIONS, heading_of

_SCENE_SECTIONS = "contacts bodies run"
_IMPACT_SECTIONS = "simulate strike"
_CONTACTS_SECTIONS = f"{_SCENE_SECTIONS} loads base motion scene"
_MODEL_SECTIONS = "sites extract probes sweep map stress"
_KEEP_ONE_REMEDY = "keep one of the two"
#: Sections, others of which each of them needs one, and what to do without.
NEEDED_SECTIONS: tuple[tuple[str, ...], ...] = (
    ("joints at points assembly", "parts"),
    ("from_frf", "frf"),
    ("sites", f"{MESHED_SECTIONS} matrices"),
    ("scene loads base motion", _SCENE_SECTIONS),
    ("accelerometers worst", "drop"),
    ("drop", f"{MESHED_SECTIONS} matrices frf"),
    ("sensors", "find"),
    ("find map stress", MESHED_SECTIONS),
    ("find", "sensors"),
    (
        "surface",
        "matrices model frf",
        "the surface of a mesh follows from its own material and curvature: leave it out there",
    ),
    ("probes", f"{MESHED_SECTIONS} matrices"),
    ("probes stress", f"{_IMPACT_SECTIONS} run"),
    *(("sweep monte_carlo", section) for section in ("impactor", "simulate")),
)
#: Sections, others beside which they have no place, and what to do.
EXCLUDED_SECTIONS = (
    ("material structure", "parts", "give each part its own"),
    ("material structure", "deck matrices model frf", "leave it out"),
    ("supports attached", "matrices", 'fix nodes by supports = {12 = "all"} there'),
    ("supports attached", "model frf", "leave it out"),
    ("prestress", "deck matrices model frf", "give the part a [geometry]"),
    ("prestress", "parts", "an assembly carries no load: join the meshes to one part"),
    ("prestress", "drop", "leave it out"),
    ("supports", "drop", "a part that is dropped is free: leave it out"),
    ("simulate extract", "strike", _KEEP_ONE_REMEDY),
    (
        f"impactor contact {_IMPACT_SECTIONS} {_CONTACTS_SECTIONS} {_MODEL_SECTIONS}",
        "drop",
        _KEEP_ONE_REMEDY,
    ),
    (
        f"{_IMPACT_SECTIONS} {_CONTACTS_SECTIONS} {_MODEL_SECTIONS} drop",
        "find",
        _KEEP_ONE_REMEDY,
    ),
)


def _check_combinations(build: Builder) -> None:
    """Note sections that exclude each other, and sections that need a missing one."""
    sections = {name for name, value in build.data.items() if value or name != "sensors"}
    for names, alternatives, *without in NEEDED_SECTIONS:
        for name in names.split():
            if name in build.data and not sections & set(alternatives.split()):
                need = f"{heading_of(name)} needs {_one_of_text(alternatives)}"
                build.note((name,), f"{'; '.join([need, *without])}.")
    for names, alternatives, remedy in EXCLUDED_SECTIONS:
        for name, excluded in product(names.split(), alternatives.split()):
            if name in build.data and excluded in sections:
                fault = f"{heading_of(name)} has no place beside {_one_of_text(excluded)}"
                build.note((name,), f"{fault}; {remedy}.")
    sources = [name for name in SOURCE_SECTIONS if name in sections]
    if len(sources) > 1:
        section_names = f"[{sources[0]}] and [{sources[1]}]"
        build.note((sources[1],), f"{section_names} both say what is struck; {_KEEP_ONE_REMEDY}.")
    if not sources and not build.data.get("bodies"):
        names = ", ".join(f"[{name}]" for name in SOURCE_SECTIONS)
        build.note((), f"the scene does not say what is struck: give one of {names}.")
    singles = [n for n in ("impactor", "contact", *_IMPACT_SECTIONS.split()) if n in sections]
    scenes = [n for n in _SCENE_SECTIONS.split() if n in sections]
    if singles and scenes:
        sentence = (
            f"[{singles[0]}] describes one impact and [{scenes[0]}] a scene of several contacts"
        )
        build.note((scenes[0],), f"{sentence}; {_KEEP_ONE_REMEDY}.")
    if "ensemble" in build.section("drop"):
        for name in sections.intersection(("accelerometers", "worst")):
            build.note(
                (name,), f"[{name}] is of one fall; [drop] has an ensemble: {_KEEP_ONE_REMEDY}."
            )


def _one_of_text(names: str) -> str:
    """Text for one name: "[x], its description"; for several words: "one of [x], [y]"."""
    first, *other_names = names.split()
    if other_names:
        return f"one of {', '.join(map(heading_of, names.split()))}"
    return f"{heading_of(first)}, {SECTIONS[first].about}"


def compile_document(document: Document) -> CompiledScene:
    """Compile a document, with first values for "auto"; SceneFileError lists its mistakes."""
    document = with_initial_values(document)
    build = Builder(document)
    build.check_sections(build.data, SECTIONS)
    _check_combinations(build)
    scene = CompiledScene(document=document, warnings=build.warnings)
    scene.structure = structure_call(build)
    scene.model = model_call(build, scene.structure)
    if "find" in build.data:
        set_search(build, scene)
    elif set(_SCENE_SECTIONS.split()) & set(build.data):
        set_several_contacts(build, scene)
    elif {"impactor", "contact", *_IMPACT_SECTIONS.split()} & set(build.data):
        scene.impactor, scene.contact = impactor_and_law(build)
        set_single_impact(build, scene)
    set_probes_and_stress(build, scene)
    if "drop" in build.data:
        scene.fall = build.call_of_section("drop", given_arguments={"part": scene.structure})
        arguments = {"self": scene.fall}
        scene.peaks = build.calls_by_name(
            "accelerometers", arguments | {"quantity": "acceleration"}
        )
        scene.worst = build.call_of_section("worst", given_arguments=arguments)
        meshed = structure_section(
            build
        ) in MESHED_SECTIONS.split() and "ensemble" not in build.section("drop")
        if meshed and scene.structure is not None:
            known = {} if scene.worst is None else scene.worst.arguments
            finer = functools.partial(with_smaller_cells, build, scene.structure)
            known = {**arguments, "finer": finer, **known}
            scene.worst = Call(worst_stress_field, known, ("worst",))
    scene.batch = run.sweep_call(build, scene)
    if scene.batch is not None:
        known = {"batch": scene.batch, "arguments": scene.batch.arguments}
        scene.facts = Call(run.budgets_of_rows, known)
    scene.map = run.map_call(build, scene)
    scene.sample = run.monte_carlo_call(build, scene)
    sweeps = scene.batch is not None and scene.stresses is not None
    if scene.sample is not None or sweeps:
        fields = Call(dict, {}) if scene.stresses is None else scene.stresses
        known = {"hit": scene.history, "structure": scene.structure, "fields": fields}
        scene.nominal = Call(run.NominalImpact, known)
    scene.output = build.call_of_section("output")
    document.mistakes.raise_if_any()
    return scene


# -- values that are "auto": radius of the patch, number of anti-oscillators, duration

#: Sections of an impact at one site; `strike` gives the patch of a solid a radius by itself.
IMPACT_SECTIONS = ("simulate", "strike")
#: First number of anti-oscillators, and first duration [s]: those of `antiosc.strikes.defaults`.
INITIAL_COUNT, INITIAL_DURATION = 20, 1e-3


class AutoValues(NamedTuple):
    """Values for "auto": radius [m] of the patch, number of anti-oscillators, duration [s], and
    the frequency [Hz] of expansion.
    """

    radius: float | None = None
    oscillator_count: int = INITIAL_COUNT
    duration: float = INITIAL_DURATION
    expansion: float | None = None


def with_initial_values(document: Document) -> Document:
    """The document with initial values instead of "auto", if it is an impact at one site."""
    if only_site_table(document) and any(
        isinstance(document.data.get(s), dict) for s in IMPACT_SECTIONS
    ):
        return with_auto_values(document, AutoValues())
    return document


def is_auto(document: Document, section: str, key: str) -> bool:
    """Whether a key of a section is "auto"."""
    table = document.data.get(section)
    return isinstance(table, dict) and table.get(key) == AUTO


def with_auto_values(document: Document, values: AutoValues) -> Document:
    """The document with `values` instead of "auto"; unchanged if it has no "auto"."""
    data = dict(document.data)
    site = only_site_table(document)

    if site.get("radius") == AUTO:
        (name,) = data["sites"]
        others = {key: value for key, value in site.items() if key != "radius"}
        radius = {} if values.radius is None else {"radius": values.radius}
        data["sites"] = {name: {**others, **radius}}

    if is_auto(document, "simulate", "duration"):
        data["simulate"] = {**data["simulate"], "duration": values.duration}

    if is_auto(document, "extract", "n"):
        data["extract"] = {**data["extract"], "n": values.oscillator_count}
        if values.expansion and data["extract"].get("method", "krylov") == "krylov":
            data["extract"].setdefault("expansion", values.expansion)

    return document if data == document.data else replace(document, data=data)


def only_site_table(document: Document) -> Table:
    """The table of the only site; {} if there is none, or there are several."""
    sites = document.data.get("sites")
    if not isinstance(sites, dict) or len(sites) != 1:
        return {}
    (site,) = sites.values()
    return site if isinstance(site, dict) else {}
