"""A scene file as a program: which sections make which objects, and how they refer to each other.

geometry | deck | matrices | parts → structure → sites → model → impactor, contact → history
                                                         bodies, contacts → scene → history
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from antiosc.scene_file import impact, struck, studies
from antiosc.scene_file.program import Call, Name, Statement
from antiosc.scene_file.read import Document
from antiosc.scene_file.sections import SECTIONS
from antiosc.scene_file.tables import Tables

#: Sections that make a history.
SIMULATED = {"simulate", "run", "strike"}


@dataclass(frozen=True)
class Compiled:
    """What the sections of a scene file make, as statements of a program.

    Attributes
    ----------
    structure : make `structure`; empty for a saved model and for rigid bodies.
    model : make `model`.
    strike : make `impactor` and `contact`, or `bodies` and `scene`.
    simulation : makes `history`, if the scene has a simulation.
    probes : name -> call, of `structure` and `history`.
    sweep : make `batch`, if the scene has a sweep.
    map : makes `found`, if the scene has a map.
    output : the files that are written.
    """

    document: Document
    title: str = ""
    structure: list[Statement] = field(default_factory=list)
    model: list[Statement] = field(default_factory=list)
    strike: list[Statement] = field(default_factory=list)
    simulation: Statement | None = None
    probes: Mapping[str, Call] = field(default_factory=dict)
    sweep: list[Statement] = field(default_factory=list)
    map: Statement | None = None
    output: Call | None = None

    @property
    def varied(self) -> dict[str, Any]:
        """ "impactor.velocity" -> the values of a sweep."""
        table = self.document.data.get("sweep", {})
        return {f"{a}.{b}": values for a, lists in table.items() for b, values in lists.items()}

    @property
    def strike_before_model(self) -> list[Statement]:
        """What of the impact needs no model."""
        return [each for each in self.strike if each.variable in ("impactor", "contact")]

    def does(self) -> list[str]:
        """The commands that this scene is for."""
        there = {"run": self.simulation, "sweep": self.sweep, "map": self.map}
        return [f"antiosc {name}" for name, statements in there.items() if statements]

    def statements(self, command: str = "run") -> list[Statement]:
        """What `antiosc run`, `sweep` or `map` computes."""
        if command == "map" and self.map is not None:
            return [*self.structure, *self.strike, self.map]
        if command == "sweep":
            return [*self.structure, *self.model, *self.sweep]
        statements = [*self.structure, *self.model, *self.strike]
        if self.simulation is not None:
            statements.append(self.simulation)
            if self.simulation.expression.function == "ao.strike":
                statements.append(Statement("model", Name("history.model")))
                if not any(each.variable == "structure" for each in self.structure):
                    statements.append(Statement("structure", Name("history.structure")))
        if self.probes:
            statements.append(Statement("probes", dict(self.probes)))
        return statements


def compiled(document: Document) -> Compiled:
    """The objects of a document; SceneFileError with all its mistakes."""
    tables = Tables(document)
    tables.known_sections(tables.data, SECTIONS, ())
    source = struck.source(tables)
    structure = struck.structure(tables, source)
    sites = struck.sites(tables, source)
    model = struck.model(tables, source, sites)
    strike, simulation = impact.simulation(tables, source)
    probes = _probes(tables, source)
    sweep = studies.sweep(tables, model, strike)
    surface = studies.surface(tables, source, strike)
    output = tables.table("output")
    tables.problems.raise_if_any()
    title = str(tables.data.get("title", ""))
    return Compiled(
        document, title, structure, model, strike, simulation, probes, sweep, surface, output
    )


def _probes(tables: Tables, source: str) -> dict[str, Call]:
    given = {"*structure": Name("structure"), "*history": Name("history")}
    probes = tables.named("probes", given=given)
    if probes and (source in ("", "model") or not SIMULATED & set(tables.data)):
        tables.problems.add(
            ("probes",), "[probes] need a structure of this scene and its simulation."
        )
    return probes
