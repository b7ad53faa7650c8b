"""Running a scene: its statements one by one, the same on all ranks, with their messages."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

from antiosc import progress
from antiosc.errors import AntioscError, InputError, warnings_to
from antiosc.scene_file.program import Call, Evaluation, Statement
from antiosc.scene_file.read import Document
from antiosc.scene_file.scene import Compiled
from antiosc.scene_file.trial import refused

T = TypeVar("T")

#: Variable -> what a progress line says while it is made.
DOING = {
    "mesh": "reading the mesh",
    "structure": "building the structure",
    "model": "reducing the structure",
    "history": "simulating the impact",
    "batch": "simulating the sweep",
    "found": "mapping the surface",
    "probes": "motion of the probes",
}


@dataclass
class Results:
    """What a scene has made.

    Attributes
    ----------
    compiled : the scene.
    variables : name of the program -> object; "structure", "model", "history", "batch", …
    warnings : sentences that were told on the way.
    """

    compiled: Compiled
    variables: dict[str, Any]
    warnings: list[str] = field(default_factory=list)

    def __getattr__(self, name: str) -> Any:
        """An object of the program, or None if the scene has none of this name."""
        if name.startswith("_") or name == "variables":
            raise AttributeError(name)
        return self.variables.get(name)


def results(compiled: Compiled, statements: list[Statement]) -> Results:
    """Run statements of a scene; SceneFileError with the line where one of them fails."""
    evaluation = Evaluation(_failure(compiled.document))
    found = Results(compiled, evaluation.variables)
    try:
        with warnings_to(partial(_told, found.warnings)):
            for each in statements:
                with progress.doing(DOING.get(each.variable, each.variable)):
                    evaluation.run(each)
    except AntioscError:  # what was told before may say why
        for sentence in found.warnings:
            progress.say(f"warning: {sentence}", sys.stderr)
        raise
    return found


def _failure(document: Document) -> Callable[[Call, Exception], Exception]:
    """What becomes of an exception of a call: antiosc's own gets its line."""

    def failed(call: Call, error: Exception) -> Exception:
        if not isinstance(error, AntioscError):
            return error
        if not call.place or not isinstance(error, InputError):
            return error
        place, sentence = refused(call, error)
        return document.problems.error(place, sentence)

    return failed


def _told(sentences: list[str], message: str) -> None:
    """Keep a warning as a sentence, once."""
    text = " ".join(message.split())
    if text not in sentences:
        sentences.append(text)


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
