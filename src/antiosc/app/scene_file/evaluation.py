"""From the calls of a scene to their objects."""

from __future__ import annotations

import contextlib
from typing import Any

from antiosc.app.scene_file.build import Call, refused, replaced
from antiosc.app.scene_file.read import Document
from antiosc.base import progress
from antiosc.base.errors import InputError

#: What is called -> what a progress line says meanwhile.
DOING = {
    "read_mesh": "reading the mesh",
    **dict.fromkeys(
        ("read_model", "Structure", "Structure.from_files", "assemble"), "building the structure"
    ),
    **dict.fromkeys(("extract", "AntiOscillators.load"), "reducing the structure"),
    "from_frf": "fitting the measurement",
    **dict.fromkeys(("simulate", "strike", "Scene.run"), "simulating the impact"),
    "simulate_many": "simulating the sweep",
    "impact_map": "mapping the surface",
    "nearby": "reducing structures nearby",
    "probe": "motion of the probes",
    **dict.fromkeys(("peak_field", "by_strengths"), "largest stresses"),
    "drop": "computing the fall",
    "find_impact": "finding the blow",
    "Fall.peak": "peaks of the accelerometers",
    "Fall.worst": "largest stresses",
}


class Evaluation:
    """Makes the objects of calls, each once; a mistake of the scene gets its line."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self._made: dict[int, Any] = {}

    def __call__(self, value: Any) -> Any:
        """A value with the objects of the calls in it."""
        return replaced(value, self._object)

    def _object(self, call: Call) -> Any:
        if call.made is not None:
            return call.made
        if id(call) not in self._made:
            arguments = {name: self(value) for name, value in call.arguments.items()}
            text = DOING.get(call.name)
            with progress.doing(text) if text else contextlib.nullcontext():
                self._made[id(call)] = self._called(call, arguments)
        return self._made[id(call)]

    def _called(self, call: Call, arguments: dict[str, Any]) -> Any:
        try:
            return call.make(**arguments)
        except InputError as error:
            if not call.place:
                raise
            raise self.document.problems.error(*refused(call, error)) from error
