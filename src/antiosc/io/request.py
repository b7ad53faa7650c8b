"""Requests to readers, the limits under which these work, and the registered readers and formats.

Packages register readers and formats by entry points, antiosc's own decks among them.
"""

from __future__ import annotations

import contextlib
import functools
import resource
import signal
import sys
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from antiosc.base.errors import AntioscError, MissingDependencyError
from antiosc.io.neutral import FileMesh, Json

if TYPE_CHECKING:
    from importlib import metadata

Refinement = tuple[Sequence[float], float]
#: Growth of the sizes per unit of distance from a refined point, and how many of the smallest size
#: are between the point and where it begins.
GRADING = (0.35, 2.0)
#: Elements around a full turn of a curved surface: of the first attempt to mesh a geometry, and of
#: the second. Second-order ones that are fewer fold over at fillets, and cut off their volume.
AROUND, AROUND_CLOSELY = 6.0, 12.0
#: Times as long as it may compute, a reader that waits may take: a busy machine lets it wait.
WAITING = 20.0
#: How the kernel ends a reader that takes too long.
OVERTIME = (signal.SIGALRM, signal.SIGPROF)
#: "unstated": what materials get that the deck does not state: density [kg/m³], modulus [Pa] (None:
#: nothing) and whether they may have no mass; "parts": names of parts, "piece": rank of a piece by
#: its size, None: all; "root": folder of included files, None: the reader chooses
ModelOptions = Json


@dataclass
class Request:
    """A file to be read by a separate process in a private working folder."""

    #: of the file, absolute
    path: str
    #: of the file, for messages
    name: str
    #: largest element size in m; geometry only
    size: float | None = None
    #: geometric order, 1 or 2
    order: int | None = None
    #: points with their element sizes, m; geometry only
    refine: Sequence[Refinement] = ()
    #: of the sizes around these points
    grading: Sequence[float] = GRADING
    #: element sizes all over the geometry, as arguments of a `SizeField`; geometry only
    sizes: Json | None = None
    #: least number of elements around a full turn of curved surfaces; geometry only
    around: float = AROUND
    #: fill a closed surface
    solid: bool = False
    #: fill it by fTetWild, as gmsh cannot
    by_ftetwild: bool = False
    #: cut the solids of an assembly at each other, so that they share nodes
    fragments: bool = False
    #: the solid alone that is meshed, by its volume: 1 is the largest; None: all
    piece: int | None = None
    #: groups of elements that are asked for: name -> their numbers in the file
    elements: Mapping[str, Sequence[int]] = field(default_factory=dict)
    #: the box around a geometry and its groups alone, without a mesh
    outline: bool = False
    #: whether all commands of gmsh are permitted
    trust: bool = False
    #: time limit, s; None: processor time, chosen for the kind of file
    timeout: float | None = None
    #: units of the file: m, N
    unit: Sequence[float] = (1.0, 1.0)
    #: options for reading a deck's materials, sections, supports and masses; None: do not
    model: ModelOptions | None = None
    #: address space in bytes
    memory: int = 2**33
    #: when the process began, s
    started: float = field(default_factory=time.monotonic)

    def limit_memory(self) -> None:
        """Limit the address space to `memory` bytes, and disable core files."""
        for resource_kind, most in ((resource.RLIMIT_AS, self.memory), (resource.RLIMIT_CORE, 0)):
            hard = resource.getrlimit(resource_kind)[1]
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(resource_kind, (most, hard))

    def allow(self, seconds: float) -> None:
        """End this process after `seconds` of processor time, or at the caller's timeout.

        The kernel does this, whatever code is running.
        """
        for ending in OVERTIME:
            signal.signal(ending, signal.SIG_DFL)
        if self.timeout is None:
            signal.setitimer(signal.ITIMER_PROF, seconds)
            signal.setitimer(signal.ITIMER_REAL, WAITING * seconds)
        else:
            remaining = max(self.timeout - (time.monotonic() - self.started), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, remaining)

    def seal(self) -> None:
        """Limit the size of files that are written from now on to 1 MB, unless the input is
        trusted.
        """
        if not self.trust:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            with contextlib.suppress(ValueError):  # a lower limit is in force
                resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, 2**20))


class FileReader(NamedTuple):
    """A reader of one file type, which a package registers under `antiosc.readers`."""

    read: Callable[[Request], FileMesh]
    #: whether the files may contain whole models, for `read_model`
    model: bool = False
    #: whether a file that begins with these bytes is of this type; None: the ending says it
    matches: Callable[[bytes], bool] | None = None


Kind = TypeVar("Kind")
#: The package of decks in this distribution; registrations of other packages precede its own.
OWN = "antiosc_decks."


def registered(group: str) -> tuple[metadata.EntryPoint, ...]:
    """The unloaded entry points of a group, those of other packages first.

    "" in `sys.path` is the working folder, where no packages are installed.
    """
    return _found(group, tuple(filter(None, sys.path)))


@functools.lru_cache
def _found(group: str, path: tuple[str, ...]) -> tuple[metadata.EntryPoint, ...]:
    from importlib import metadata  # its modules for mails take 16 ms of each start

    installed = [e for d in metadata.distributions(path=list(path)) for e in d.entry_points]
    entries = dict.fromkeys(e for e in [*installed, *_of_source_tree(group)] if e.group == group)
    return tuple(sorted(entries, key=lambda entry: entry.value.startswith(OWN)))


def _of_source_tree(group: str) -> list[metadata.EntryPoint]:
    """The entry points in pyproject.toml, if antiosc runs from its source tree."""
    try:
        text = Path(__file__).resolve().parents[3].joinpath("pyproject.toml").read_text("utf-8")
        project = tomllib.loads(text).get("project", {})
    except (OSError, ValueError):
        return []
    from importlib import metadata

    groups = project.get("entry-points", {}) if project.get("name") == "antiosc" else {}
    return [metadata.EntryPoint(name, to, group) for name, to in groups.get(group, {}).items()]


def loaded(entry: metadata.EntryPoint, kind: type[Kind]) -> Kind:
    """The object of an entry point; MissingDependencyError unless it is of this kind."""
    try:
        reader = entry.load()
    except AntioscError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
    else:
        if isinstance(reader, kind):
            return reader
        reason = f"it is a {type(reader).__name__}, not a {kind.__name__}"
    raise MissingDependencyError(
        f"{entry.value}, which a package registers as {entry.name!r} of {entry.group}, cannot be "
        f"used ({reason}): repair or uninstall the package."
    )
