"""Running a scene: its objects one by one, the same on all ranks, with their messages."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from antiosc.app.scene_file.evaluation import Evaluation
from antiosc.app.scene_file.scene import Compiled
from antiosc.base import progress
from antiosc.base.errors import AntioscError, warnings_to

T = TypeVar("T")

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
    from antiosc.fem.platform.mpi import on_root

    return on_root(comm, work)  # type: ignore[no-any-return]
