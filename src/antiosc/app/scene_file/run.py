"""Running a scene: its objects one by one, the same on all ranks, with their messages."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from antiosc.app.scene_file.build import Evaluation
from antiosc.app.scene_file.scene import Compiled, Objects
from antiosc.base import progress
from antiosc.base.errors import AntioscError, warnings_to

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")


@dataclass(kw_only=True)
class Results(Objects[Any]):
    """What a scene has made, and the title of a report; no scene: a program made it."""

    compiled: Any = None
    title: str = ""


def results(compiled: Compiled, wanted: Sequence[str]) -> Results:
    """Make objects of a scene; SceneFileError with the line where one of them fails."""
    evaluate = Evaluation(compiled.document)
    title = str(compiled.document.data.get("title") or compiled.document.path.stem)
    found = Results(compiled=compiled, title=title, warnings=list(compiled.warnings))
    with telling(found.warnings):
        for name in wanted:
            setattr(found, name, evaluate(getattr(compiled, name)))
        if compiled.striking and found.history:
            found.model = found.history.model
            found.structure = found.structure or found.history.structure
    return found


@contextlib.contextmanager
def telling(sentences: list[str]) -> Iterator[None]:
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


def communicator() -> MPI.Comm | None:
    """MPI's ranks where mpi4py has been loaded; otherwise None: one process."""
    loaded = sys.modules.get("mpi4py.MPI")
    return getattr(loaded, "COMM_WORLD", None)


def on_first(work: Callable[[], T]) -> T:
    """What `work` returns on the first rank, on every rank; its error is raised on all of them.

    For files: a rank that goes on alone after an error of another would wait for it for ever.
    """
    comm = communicator()
    if comm is None or comm.size == 1:
        return work()
    from antiosc.fem.platform import on_root

    return on_root(comm, work)  # type: ignore[no-any-return]
