"""The request to a reader, and the limits under which it works."""

from __future__ import annotations

import contextlib
import resource
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from antiosc.io.neutral import FileMesh

Refinement = tuple[Sequence[float], float]
#: Growth of the sizes per unit of distance from a refined point, and how many of the smallest size
#: are between the point and where it begins.
GRADING = (0.35, 2.0)
#: Times as long as it may compute, a reader that waits may take: a busy machine lets it wait.
WAITING = 20.0
#: How the kernel ends a reader that takes too long.
OVERTIME = (signal.SIGALRM, signal.SIGPROF)
#: "density": of materials without one, kg/m³; "parts": names of parts, "piece": rank of a piece by
#: its size, None: all; "root": folder of included files, None: the reader chooses
ModelOptions = dict[str, Any]


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
    sizes: dict[str, Any] | None = None
    #: fill a closed surface
    solid: bool = False
    #: cut the solids of an assembly at each other, so that they share nodes
    fragments: bool = False
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
        """Limit the address space to `memory`, and write no core file."""
        for what, most in ((resource.RLIMIT_AS, self.memory), (resource.RLIMIT_CORE, 0)):
            hard = resource.getrlimit(what)[1]
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(what, (most, hard))

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
            left = max(self.timeout - (time.monotonic() - self.started), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, left)

    def seal(self) -> None:
        """Limit the files written from now on to a megabyte, unless the file is trusted."""
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
    #: library that is imported once for all files
    library: str = "numpy"
