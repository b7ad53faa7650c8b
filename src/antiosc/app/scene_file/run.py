"""Running a scene: its objects one by one, the same on all ranks, with their messages."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from antiosc.app.scene_file.build import Call, refused, replaced
from antiosc.app.scene_file.read import Document
from antiosc.app.scene_file.scene import Compiled
from antiosc.base import progress
from antiosc.base.errors import AntioscError, InputError, warnings_to

T = TypeVar("T")

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
#: Command -> the objects that it makes.
COMMANDS = {
    "run": (
        *("structure", "model", "impactor", "contact", "history", "probes", "stresses"),
        *("fall", "peaks", "worst", "found"),
    ),
    "sweep": ("structure", "model", "impactor", "batch"),
    "map": ("structure", "impactor", "contact", "map"),
    "monte-carlo": ("structure", "impactor", "sample"),
    "dry run": ("structure", "impactor", "contact"),
}


@dataclass
class Results:
    """What a scene has made; None for what it has not.

    Attributes
    ----------
    compiled : the scene; None of results that were computed by a program.
    title : of a report.
    warnings : sentences that were told on the way.
    """

    compiled: Any
    title: str = ""
    structure: Any = None
    model: Any = None
    impactor: Any = None
    contact: Any = None
    history: Any = None
    probes: Any = None
    stresses: Any = None
    batch: Any = None
    map: Any = None
    sample: Any = None
    fall: Any = None
    peaks: Any = None
    worst: Any = None
    found: Any = None
    warnings: list[str] = field(default_factory=list)


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


def results(compiled: Compiled, wanted: Sequence[str]) -> Results:
    """Make objects of a scene; SceneFileError with the line where one of them fails."""
    evaluate = Evaluation(compiled.document)
    title = compiled.title or compiled.document.path.stem
    found = Results(compiled, title, warnings=list(compiled.warnings))
    with telling(found.warnings):
        for name in wanted:
            setattr(found, name, evaluate(getattr(compiled, name)))
        if compiled.history is not None and compiled.history.name == "strike" and found.history:
            found.model = found.history.model
            found.structure = found.structure or found.history.structure
    return found


@contextlib.contextmanager
def telling(sentences: list[str]) -> Any:
    """Keep the warnings of the block, each once; an error tells them first: they may say why."""

    def keep(message: str) -> None:
        text = " ".join(message.split())
        if text not in sentences:
            sentences.append(text)

    try:
        with warnings_to(keep):
            yield
    except AntioscError:
        for sentence in sentences:
            progress.say(f"warning: {sentence}", sys.stderr)
        raise


# -- ranks


def communicator() -> Any:
    """MPI's ranks where mpi4py has been loaded; otherwise None: one process."""
    MPI = sys.modules.get("mpi4py.MPI")
    return None if MPI is None else MPI.COMM_WORLD  # type: ignore[attr-defined]


def on_first(work: Callable[[], T]) -> T:
    """What `work` returns on the first rank, on every rank; its error is raised on all of them.

    For files: a rank that goes on alone after an error of another would wait for it for ever.
    """
    comm = communicator()
    if comm is None or comm.size == 1:
        return work()
    from antiosc.fem.mpi import on_root

    return on_root(comm, work)  # type: ignore[no-any-return]
