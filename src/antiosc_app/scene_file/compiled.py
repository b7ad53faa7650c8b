"""Compilation of a document: the calls that it describes, or the list of its mistakes."""

from __future__ import annotations

from itertools import product

from antiosc_app.scene_file import run
from antiosc_app.scene_file.automatic import started
from antiosc_app.scene_file.build import Builder, Call
from antiosc_app.scene_file.document import Document
from antiosc_app.scene_file.scene import (
    MESHED,
    CompiledScene,
    model,
    pair,
    search,
    set_requested,
    several,
    single,
    source,
    structure,
    worst_by_strengths,
)
from antiosc_app.scene_file.schema import SECTIONS, SOURCES, headed

_MANY = "contacts bodies run"
_ONE = "simulate strike"
_SEVERAL = f"{_MANY} loads base motion scene"
_REDUCED = "sites extract probes sweep map stress"
_KEEP = "keep one of the two"
#: Sections, others of which each of them needs one, and what to do without.
NEEDS: tuple[tuple[str, ...], ...] = (
    ("joints at points assembly", "parts"),
    ("from_frf", "frf"),
    ("sites", f"{MESHED} matrices"),
    ("scene loads base motion", _MANY),
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
    ("probes stress", f"{_ONE} run"),
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
    ("simulate extract", "strike", _KEEP),
    (f"impactor contact {_ONE} {_SEVERAL} {_REDUCED}", "drop", _KEEP),
    (f"{_ONE} {_SEVERAL} {_REDUCED} drop", "find", _KEEP),
)


def _check_together(build: Builder) -> None:
    """Note sections that exclude each other, and sections without others that they need."""
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
        build.note((sources[1],), f"{section_names} both say what is struck; {_KEEP}.")
    if not sources and not build.data.get("bodies"):
        names = ", ".join(f"[{name}]" for name in SOURCES)
        build.note((), f"the scene does not say what is struck: give one of {names}.")
    singles = [n for n in ("impactor", "contact", *_ONE.split()) if n in sections]
    scenes = [n for n in _MANY.split() if n in sections]
    if singles and scenes:
        sentence = (
            f"[{singles[0]}] describes one impact and [{scenes[0]}] a scene of several contacts"
        )
        build.note((scenes[0],), f"{sentence}; {_KEEP}.")
    if "ensemble" in build.part("drop"):
        for name in sections.intersection(("accelerometers", "worst")):
            build.note((name,), f"[{name}] is of one fall; [drop] has an ensemble: {_KEEP}.")


def _one_of(names: str) -> str:
    """Text of one section with its description, or of a choice of several."""
    first, *other_names = names.split()
    if other_names:
        return f"one of {', '.join(map(headed, names.split()))}"
    return f"{headed(first)}, {SECTIONS[first].about}"


def compiled(document: Document) -> CompiledScene:
    """The calls of a document, with first values for "auto"; SceneFileError with its mistakes."""
    document = started(document)
    build = Builder(document)
    build.known_sections(build.data, SECTIONS)
    _check_together(build)
    scene = CompiledScene(document=document, warnings=build.warnings)
    scene.structure = structure(build)
    scene.model = model(build, scene.structure)
    if "find" in build.data:
        search(build, scene)
    elif set(_MANY.split()) & set(build.data):
        several(build, scene)
    elif {"impactor", "contact", *_ONE.split()} & set(build.data):
        scene.impactor, scene.contact = pair(build)
        single(build, scene)
    set_requested(build, scene)
    if "drop" in build.data:
        scene.fall = build.table("drop", given={"part": scene.structure})
        arguments = {"self": scene.fall}
        scene.peaks = build.named("accelerometers", arguments | {"quantity": "acceleration"})
        scene.worst = build.table("worst", given=arguments)
        meshed = source(build) in MESHED.split() and "ensemble" not in build.part("drop")
        if "worst" not in build.data and meshed:
            scene.worst = Call(worst_by_strengths, arguments)
    scene.batch = run.sweep(build, scene)
    scene.facts = run.facts_of_sweep(scene.batch)
    scene.map = run.surface(build, scene)
    scene.sample = run.monte_carlo(build, scene)
    sweeps = scene.batch is not None and scene.stresses is not None
    if scene.sample is not None or sweeps:
        fields = Call(dict, {}) if scene.stresses is None else scene.stresses
        known = {"hit": scene.history, "structure": scene.structure, "fields": fields}
        scene.nominal = Call(run.Nominal, known)
    scene.output = build.table("output")
    document.problems.raise_if_any()
    return scene
