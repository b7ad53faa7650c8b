"""Compiles a document: to the calls that it describes, or to the list of its mistakes."""

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
    MESHED,
    CompiledScene,
    impactor_and_law,
    model,
    set_requested,
    set_search,
    set_several_contacts,
    set_single_impact,
    source,
    structure,
    with_smaller_cells,
    worst_by_strengths,
)
from antiosc_app.scene_file.schema import SECTIONS, SOURCES, headed

_OF_SCENE = "contacts bodies run"
_OF_IMPACT = "simulate strike"
_SEVERAL = f"{_OF_SCENE} loads base motion scene"
_REDUCED = "sites extract probes sweep map stress"
_KEEP_ONE = "keep one of the two"
#: Sections, others of which each of them needs one, and what to do without.
NEEDS: tuple[tuple[str, ...], ...] = (
    ("joints at points assembly", "parts"),
    ("from_frf", "frf"),
    ("sites", f"{MESHED} matrices"),
    ("scene loads base motion", _OF_SCENE),
    ("accelerometers worst", "drop"),
    ("drop", f"{MESHED} matrices frf"),
    ("sensors", "find"),
    ("find map stress", MESHED),
    ("find", "sensors"),
    (
        "surface",
        "matrices model frf",
        "the surface of a mesh follows from its own material and curvature: leave it out there",
    ),
    ("probes", f"{MESHED} matrices"),
    ("probes stress", f"{_OF_IMPACT} run"),
    *(("sweep monte_carlo", section) for section in ("impactor", "simulate")),
)
#: Sections, others beside which they have no place, and what to do.
EXCLUDES = (
    ("material structure", "parts", "give each part its own"),
    ("material structure", "deck matrices model frf", "leave it out"),
    ("supports attached", "matrices", 'fix nodes by supports = {12 = "all"} there'),
    ("supports attached", "model frf", "leave it out"),
    ("prestress", "deck matrices model frf", "give the part a [geometry]"),
    ("prestress", "parts", "an assembly carries no load: join the meshes to one part"),
    ("prestress", "drop", "leave it out"),
    ("supports", "drop", "a part that is dropped is free: leave it out"),
    ("simulate extract", "strike", _KEEP_ONE),
    (f"impactor contact {_OF_IMPACT} {_SEVERAL} {_REDUCED}", "drop", _KEEP_ONE),
    (f"{_OF_IMPACT} {_SEVERAL} {_REDUCED} drop", "find", _KEEP_ONE),
)


def _check_together(build: Builder) -> None:
    """Note the sections that exclude each other, or lack another that they need."""
    sections = {name for name, value in build.data.items() if value or name != "sensors"}
    for names, alternatives, *without in NEEDS:
        for name in names.split():
            if name in build.data and not sections & set(alternatives.split()):
                need = f"{headed(name)} needs {_one_of(alternatives)}"
                build.note((name,), f"{'; '.join([need, *without])}.")
    for names, alternatives, remedy in EXCLUDES:
        for name, excluded in product(names.split(), alternatives.split()):
            if name in build.data and excluded in sections:
                fault = f"{headed(name)} has no place beside {_one_of(excluded)}"
                build.note((name,), f"{fault}; {remedy}.")
    sources = [name for name in SOURCES if name in sections]
    if len(sources) > 1:
        section_names = f"[{sources[0]}] and [{sources[1]}]"
        build.note((sources[1],), f"{section_names} both say what is struck; {_KEEP_ONE}.")
    if not sources and not build.data.get("bodies"):
        names = ", ".join(f"[{name}]" for name in SOURCES)
        build.note((), f"the scene does not say what is struck: give one of {names}.")
    singles = [n for n in ("impactor", "contact", *_OF_IMPACT.split()) if n in sections]
    scenes = [n for n in _OF_SCENE.split() if n in sections]
    if singles and scenes:
        sentence = (
            f"[{singles[0]}] describes one impact and [{scenes[0]}] a scene of several contacts"
        )
        build.note((scenes[0],), f"{sentence}; {_KEEP_ONE}.")
    if "ensemble" in build.part("drop"):
        for name in sections.intersection(("accelerometers", "worst")):
            build.note((name,), f"[{name}] is of one fall; [drop] has an ensemble: {_KEEP_ONE}.")


def _one_of(names: str) -> str:
    """Text for sections `names`: "[x], its description", or "one of [x], [y]"."""
    first, *other_names = names.split()
    if other_names:
        return f"one of {', '.join(map(headed, names.split()))}"
    return f"{headed(first)}, {SECTIONS[first].about}"


def compiled(document: Document) -> CompiledScene:
    """Compile a document, with first values for "auto"; SceneFileError lists its mistakes."""
    document = with_first_values(document)
    build = Builder(document)
    build.known_sections(build.data, SECTIONS)
    _check_together(build)
    scene = CompiledScene(document=document, warnings=build.warnings)
    scene.structure = structure(build)
    scene.model = model(build, scene.structure)
    if "find" in build.data:
        set_search(build, scene)
    elif set(_OF_SCENE.split()) & set(build.data):
        set_several_contacts(build, scene)
    elif {"impactor", "contact", *_OF_IMPACT.split()} & set(build.data):
        scene.impactor, scene.contact = impactor_and_law(build)
        set_single_impact(build, scene)
    set_requested(build, scene)
    if "drop" in build.data:
        scene.fall = build.table("drop", given={"part": scene.structure})
        arguments = {"self": scene.fall}
        scene.peaks = build.named("accelerometers", arguments | {"quantity": "acceleration"})
        scene.worst = build.table("worst", given=arguments)
        meshed = source(build) in MESHED.split() and "ensemble" not in build.part("drop")
        if meshed and scene.structure is not None:
            known = {} if scene.worst is None else scene.worst.arguments
            finer = functools.partial(with_smaller_cells, build, scene.structure)
            known = {**arguments, "finer": finer, **known}
            scene.worst = Call(worst_by_strengths, known, ("worst",))
    scene.batch = run.sweep(build, scene)
    if scene.batch is not None:
        known = {"batch": scene.batch, "arguments": scene.batch.arguments}
        scene.facts = Call(run.budgets_of_rows, known)
    scene.map = run.map_call(build, scene)
    scene.sample = run.monte_carlo(build, scene)
    sweeps = scene.batch is not None and scene.stresses is not None
    if scene.sample is not None or sweeps:
        fields = Call(dict, {}) if scene.stresses is None else scene.stresses
        known = {"hit": scene.history, "structure": scene.structure, "fields": fields}
        scene.nominal = Call(run.Nominal, known)
    scene.output = build.table("output")
    document.problems.raise_if_any()
    return scene


# -- values that are "auto": radius of the patch, number of anti-oscillators, duration

#: Sections of an impact at one site; `strike` gives the patch of a solid a radius by itself.
IMPACT_SECTIONS = ("simulate", "strike")
#: First number of anti-oscillators, and first duration [s]: those of `antiosc.strikes.defaults`.
FIRST_COUNT, FIRST_DURATION = 20, 1e-3


class Choice(NamedTuple):
    """Values for "auto": radius [m] of the patch, number of anti-oscillators, duration [s], and
    the frequency [Hz] of expansion.
    """

    radius: float | None = None
    n: int = FIRST_COUNT
    duration: float = FIRST_DURATION
    expansion: float | None = None


def with_first_values(document: Document) -> Document:
    """The document with first values in place of "auto", if it is an impact at one site."""
    if only_site(document) and any(isinstance(document.data.get(s), dict) for s in IMPACT_SECTIONS):
        return with_values(document, Choice())
    return document


def is_auto(document: Document, section: str, key: str) -> bool:
    """Whether a key of a section is "auto"."""
    table = document.data.get(section)
    return isinstance(table, dict) and table.get(key) == AUTO


def with_values(document: Document, choice: Choice) -> Document:
    """The document with the values of `choice` in place of "auto"; itself if it has no "auto"."""
    data = dict(document.data)
    site = only_site(document)

    if site.get("radius") == AUTO:
        (name,) = data["sites"]
        others = {key: value for key, value in site.items() if key != "radius"}
        radius = {} if choice.radius is None else {"radius": choice.radius}
        data["sites"] = {name: {**others, **radius}}

    if is_auto(document, "simulate", "duration"):
        data["simulate"] = {**data["simulate"], "duration": choice.duration}

    if is_auto(document, "extract", "n"):
        data["extract"] = {**data["extract"], "n": choice.n}
        if choice.expansion and data["extract"].get("method", "krylov") == "krylov":
            data["extract"].setdefault("expansion", choice.expansion)

    return document if data == document.data else replace(document, data=data)


def only_site(document: Document) -> Table:
    """The table of the only site; {} if there is none, or there are several."""
    sites = document.data.get("sites")
    if not isinstance(sites, dict) or len(sites) != 1:
        return {}
    (site,) = sites.values()
    return site if isinstance(site, dict) else {}
