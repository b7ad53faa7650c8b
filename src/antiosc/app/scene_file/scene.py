"""A scene file as objects: which sections make which, and how they refer to each other.

geometry | deck | matrices | parts → structure → sites → model → impactor, contact → history
                                                         bodies, contacts → scene → history
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from antiosc.app.scene_file import blow, chance, fall, impact, largest, struck, studies
from antiosc.app.scene_file.build import Builder, Call
from antiosc.app.scene_file.problems import label
from antiosc.app.scene_file.read import Document
from antiosc.app.scene_file.sections import MODELS, SECTIONS
from antiosc.app.scene_file.variants import leaves


@dataclass(frozen=True)
class Compiled:
    """What the sections of a scene file make, as calls; None where a section is missing.

    Attributes
    ----------
    structure, model : what is struck; None where [strike] makes them.
    impactor, contact : of one impact; `scene` of several contacts.
    history : of the simulation.
    probes : name -> call, of the structure and the history.
    stresses : a call that makes {quantity: its largest values over the run}.
    batch, map, sample : of [sweep], [map] and [monte_carlo].
    fall : of [drop]; `peaks` name -> call, and `worst`, of the fall.
    found : of [find].
    output : the files that are written.
    warnings : of the objects that were made.
    """

    document: Document
    structure: Call | None = None
    model: Call | None = None
    impactor: Call | None = None
    contact: Call | None = None
    scene: Call | None = None
    history: Call | None = None
    probes: Mapping[str, Call] = field(default_factory=dict)
    stresses: Call | None = None
    batch: Call | None = None
    map: Call | None = None
    sample: Call | None = None
    fall: Call | None = None
    peaks: Mapping[str, Call] = field(default_factory=dict)
    worst: Call | None = None
    found: Call | None = None
    output: Call | None = None
    warnings: list[str] = field(default_factory=list)

    @property
    def title(self) -> str:
        """What the scene shows."""
        return str(self.document.data.get("title", ""))

    @property
    def varied(self) -> dict[str, Any]:
        """ "impactor.velocity" -> the values of a sweep."""
        table = self.document.data.get("sweep", {})
        return {label(place): values for place, values in leaves(table)}

    @property
    def simulation(self) -> Call | None:
        """What `antiosc run` computes."""
        return self.history or self.fall or self.found

    def does(self) -> list[str]:
        """The commands that this scene is for."""
        there = {"run": self.simulation, "sweep": self.batch, "map": self.map}
        there["monte-carlo"] = self.sample
        return [f"antiosc {name}" for name, call in there.items() if call is not None]


def compiled(document: Document) -> Compiled:
    """The objects of a document; SceneFileError with all its mistakes."""
    build = Builder(document)
    build.known_sections(build.data, SECTIONS)
    source = struck.source(build)
    structure = struck.structure(build, source)
    model = struck.model(build, source, structure)
    found = blow.blow(build, source, structure)
    made = {} if "find" in build.data else impact.impact(build, structure, model)
    impactor, contact, history = (made.get(n) for n in ("impactor", "contact", "history"))
    of_probes = structure
    if history is not None and history.name == "strike" and structure is None:
        of_probes = Call(_structure, {"history": history})
    probes = build.named("probes", {"structure": of_probes, "history": history})
    if "probes" in build.data and (
        source in ("", *MODELS) or not {"simulate", "run", "strike"} & set(build.data)
    ):
        build.note(("probes",), "[probes] need a structure of this scene and its simulation.")
    stresses = largest.stresses(build, source, of_probes, history)
    batch = studies.sweep(build, model, impactor, contact)
    surface = studies.surface(build, source, structure, impactor, contact)
    sample = chance.monte_carlo(build, structure, model, impactor, contact)
    fallen = fall.fall(build, source, structure)
    output = build.table("output")
    build.problems.raise_if_any()
    return Compiled(
        document, structure, model, **made, **fallen, probes=probes, stresses=stresses, batch=batch,
        map=surface, found=found, sample=sample, output=output, warnings=build.told,
    )  # fmt: skip


def _structure(history: Any) -> Any:
    """The structure of a strike's last mesh."""
    return history.structure
