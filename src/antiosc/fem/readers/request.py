"""What a reader is asked for, and the limits within which it works."""

from __future__ import annotations

import contextlib
import resource
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

Refinement = tuple[Sequence[float], float]
#: "density": of materials that state none, kg/m³
ModelOptions = dict[str, float | None]


@dataclass
class Request:
    """A file to be read, in a process of its own whose working folder is private to it."""

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
    #: whether the file may do whatever gmsh lets it
    trust: bool = False
    #: seconds after which the reader is ended; None: by what it has to do
    timeout: float | None = None
    #: units of the file: m, N
    unit: Sequence[float] = (1.0, 1.0)
    #: read a deck's materials, sections, supports and masses as well, with these options
    model: ModelOptions | None = None
    #: address space in bytes
    memory: int = 2**33
    #: when the process began, s
    started: float = field(default_factory=time.monotonic)

    def limit_memory(self) -> None:
        """No more address space than `memory`, and no core file."""
        for what, most in ((resource.RLIMIT_AS, self.memory), (resource.RLIMIT_CORE, 0)):
            hard = resource.getrlimit(what)[1]
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(what, (most, hard))

    def allow(self, seconds: float) -> None:
        """End this process after `seconds` from now, or when the caller's own timeout is over.

        The kernel does it, whatever code is running then.
        """
        if self.timeout is not None:
            seconds = max(self.timeout - (time.monotonic() - self.started), 1e-3)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, seconds)

    def seal(self) -> None:
        """Write no file of more than a megabyte from now on, unless the file read is trusted."""
        if not self.trust:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            with contextlib.suppress(ValueError):  # a lower limit stands already
                resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, 2**20))
