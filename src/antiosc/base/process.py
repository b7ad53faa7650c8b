"""The process: changes made by packages, its BLAS threads, and the free memory of its machine.

**Packages.** FFCx adds a handler to the root logger and redirects Python's warnings to it; dolfinx
changes the flags of the dynamic loader; PETSc installs signal handlers; setuptools, which calls the
compiler, changes the environment and the module path. `restored` undoes it. When they load, several
packages take files of the working folder for their configuration (`.petscrc`, `matplotlibrc`, …),
which can name programs and libraries to run. They load in `/` instead (`loading`), so that a folder
from elsewhere configures nothing.

**Threads.** One BLAS thread, and for large factorizations one fewer than there are cores, whatever
else the machine does, so that a run gives the same digits again. OpenBLAS threads synchronise in
busy loops, thousands of times in one sparse factorization: if another program has one of their
cores, two threads take up to nine times as long as one. A number of threads that the user has set
in the environment is respected; other libraries are not changed.

**Memory.** The free memory, the share of it that a run may use, and the message if it is too small.
"""

from __future__ import annotations

import atexit
import importlib.util
import locale
import logging
import os
import shutil
import sys
import tempfile
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from threading import Lock, get_ident
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar

import numpy as np

from antiosc.base._types import Array
from antiosc.base.errors import MissingDependencyError, OutOfMemoryError

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


#: Loggers whose levels the packages change.
LOGGERS = ("UFL", "ffcx", "FFCx")
#: Variables that setuptools and threadpoolctl set; the package that puts its own folders on the
#: module path.
ENVIRONMENT = ("HOME", "KMP_DUPLICATE_LIB_OK", "PLAT")
VENDOR = "setuptools"
#: Folders that `VENDOR` put on the module path: it may import from them again later.
_appended: list[str] = []
#: Held while something is imported or compiled, for all of this belongs to the process.
_lock = threading.RLock()


@contextmanager
def restored() -> Iterator[None]:
    """Restore logging, warnings, environment, paths, loader flags and locale at the end."""
    with _lock:
        root = logging.getLogger()
        handlers = list(root.handlers)
        level = root.level
        showwarning = warnings.showwarning
        levels = {name: _level(name) for name in LOGGERS}
        environment = {name: os.environ.get(name) for name in ENVIRONMENT}
        flags = sys.getdlopenflags()
        former = locale.setlocale(locale.LC_ALL)
        path = list(sys.path)
        sys.path.extend(entry for entry in _appended if entry not in path)

        try:
            yield
        finally:
            new = [entry for entry in sys.path if entry not in path and VENDOR in Path(entry).parts]
            _appended.extend(entry for entry in new if entry not in _appended)
            sys.path[:] = [entry for entry in sys.path if entry not in new]
            root.handlers[:] = handlers
            root.setLevel(level)
            if warnings.showwarning is not showwarning:
                logging.captureWarnings(False)
            for name, before in levels.items():
                if before is not None:
                    logging.getLogger(name).setLevel(before)
            for name, value in environment.items():
                if value is None:
                    os.environ.pop(name, None)
                elif os.environ.get(name) != value:
                    os.environ[name] = value
            sys.setdlopenflags(flags)
            locale.setlocale(locale.LC_ALL, former)


def _level(name: str) -> int | None:
    """Level of a logger; None if it does not exist yet."""
    logger = logging.root.manager.loggerDict.get(name)
    if isinstance(logger, logging.Logger):
        return logger.level
    return None


@contextmanager
def quiet(*names: str) -> Iterator[None]:
    """Hide messages below WARNING that this thread sends to the named loggers."""
    loggers = [logging.getLogger(name) for name in names]
    filters = _BelowWarning()
    for logger in loggers:
        logger.addFilter(filters)

    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(filters)


class _BelowWarning(logging.Filter):
    def __init__(self) -> None:
        super().__init__()
        self.thread = threading.get_ident()

    def filter(self, record: logging.LogRecord) -> bool:
        return record.levelno >= logging.WARNING or record.thread != self.thread


@contextmanager
def loading() -> Iterator[None]:
    """Context for imports of packages: in `/` and with a home folder, for the whole process."""
    _give_home()

    with _lock:
        try:
            working_folder = os.open(".", getattr(os, "O_PATH", os.O_RDONLY))
        except OSError:  # nothing can be read there
            yield
            return
        try:
            os.chdir("/")
            yield
        finally:
            os.fchdir(working_folder)
            os.close(working_folder)


def _give_home() -> None:
    """Set HOME to a folder of this process if the user has none: packages need one to load."""
    try:
        Path.home()
    except RuntimeError:
        os.environ["HOME"] = _home()


@cache
def _home() -> str:
    """A new folder that only this user may enter; it is removed when the process ends."""
    folder = tempfile.mkdtemp(prefix="antiosc-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def start_mpi() -> None:
    """Load MPI before what needs it; MissingDependencyError under another MPI's mpirun."""
    refusal = (
        "this process was started by the mpirun of another MPI than that of its mpi4py: use the "
        "mpirun of that MPI, which of PyPI's packages stands beside python."
    )
    of_pypi = importlib.util.find_spec("dolfinx_solver") is not None  # by MPICH
    if of_pypi and "OMPI_COMM_WORLD_SIZE" in os.environ:
        raise MissingDependencyError(refusal)

    importlib.import_module("dolfinx_solver" if of_pypi else "mpi4py.MPI")
    from mpi4py import MPI

    if MPI.COMM_WORLD.size == 1 and int(os.environ.get("PMI_SIZE", 1)) > 1:
        raise MissingDependencyError(refusal)


def start_petsc() -> None:
    """Initialise PETSc once, without signal handlers that abort and without `.petscrc`."""
    if "petsc4py.PETSc" not in sys.modules:
        import petsc4py

        petsc4py.init(["antiosc", "-no_signal_handler", "-skip_petscrc"])


#: Variables by which users choose a number of threads; the first one that is set counts.
VARIABLES = (
    *("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "GOTO_NUM_THREADS"),
    "OMP_NUM_THREADS",
)
#: Operations of a front for each thread: with fewer, threads spend their time on waiting.
WORK_PER_THREAD = 5e8
#: Twice as many threads pay where they leave at most this share of the time.
WORTHWHILE = 0.8


def user_threads() -> tuple[str, str] | None:
    """(variable, number of threads) set by the user in the environment, or None."""
    return next(((name, os.environ[name]) for name in VARIABLES if os.environ.get(name)), None)


def cores() -> int:
    """Number of cores that this process may use (affinity and quota of the container)."""
    affinity = getattr(os, "sched_getaffinity", None)  # of Linux
    allowed = len(affinity(0)) if affinity else os.cpu_count() or 1
    quota = " ".join(_lines(f"{CONTAINER}/cpu.max")).split()
    if len(quota) == 2 and quota[0].isdigit():
        allowed = min(allowed, max(1, int(quota[0]) // int(quota[1])))
    return allowed


def useful_threads(fronts: Array, most: int) -> int:
    """Useful number of threads, at most `most`, for dense fronts of these operation counts."""

    def cost(threads: int) -> float:
        return float(np.sum(fronts / np.clip(fronts / WORK_PER_THREAD, 1, threads)))

    threads = 1
    while threads < most and cost(min(2 * threads, most)) < WORTHWHILE * cost(threads):
        threads = min(2 * threads, most)
    return threads


#: what threadpoolctl tells of a library
Pool: TypeAlias = dict[str, Any]


class _Blas:
    """The thread pools of the BLAS libraries that are loaded, kept at one thread while in use."""

    def __init__(self, controller: ThreadpoolController) -> None:
        self.controller = controller
        self.lock = Lock()
        self.users: Counter[int] = Counter()  # calls under way, by the Python thread
        self.limit: Any = None
        self.before = 1

    def pools(self) -> list[Pool]:
        """The data of threadpoolctl on each BLAS."""
        return [pool for pool in self.controller.info() if pool["user_api"] == "blas"]

    def enter(self) -> None:
        with self.lock:
            if not self.users:
                self.before = max((pool["num_threads"] for pool in self.pools()), default=1)
                self.limit = self.controller.limit(limits=1, user_api="blas")
            self.users[get_ident()] += 1

    def leave(self) -> None:
        with self.lock:
            self.users[get_ident()] -= 1
            self.users += Counter()  # drops the zeros
            if not self.users:
                self.limit.restore_original_limits()


@cache
def _blas() -> _Blas | None:
    """The BLAS libraries of this process, for all Python threads; None without threadpoolctl."""
    try:
        with restored():
            from threadpoolctl import ThreadpoolController
    except ImportError:
        return None

    import scipy.linalg  # noqa: F401  (loads the BLAS)

    return _Blas(ThreadpoolController())


def pools() -> list[Pool] | None:
    """The data of threadpoolctl on each loaded BLAS; None if it is not installed."""
    blas = _blas()
    if blas is None:
        return None
    return blas.pools()


@contextmanager
def one_thread() -> Iterator[None]:
    """Use one BLAS thread inside the block or the decorated function."""
    blas = None if user_threads() else _blas()
    if blas is None:
        yield
        return

    blas.enter()
    try:
        yield
    finally:
        blas.leave()


@contextmanager
def blas_threads(fronts: Array) -> Iterator[int | None]:
    """Context with as many BLAS threads as pay for these fronts; yields their number, or None.

    `fronts`: operation counts. None: no library of threads is known, or the user has set a number.
    """
    blas = None if user_threads() else _blas()
    if blas is None:
        yield None
        return

    with one_thread():
        limit = min(blas.before, cores() - 1) if len(blas.users) == 1 else 1
        threads = useful_threads(fronts, limit)
        with blas.controller.limit(limits=threads, user_api="blas"):
            yield threads


P = ParamSpec("P")
T = TypeVar("T")

#: Share of the free memory that a factor, a basis or a run may fill.
MEMORY_SHARE = 0.9
#: Folder of a container's limits.
CONTAINER = "/sys/fs/cgroup"
#: Bytes below which the free memory is not looked up: that takes longer than a short run.
NEGLIGIBLE = 1 << 26
#: Remedy where a run needs too much.
MEMORY_REMEDY = "use a coarser mesh or elements of order 1, or free some memory"


def free_memory() -> float:
    """Free memory of this machine, or of its container or process limit, in bytes."""
    free = np.inf
    for line in _lines("/proc/meminfo"):
        if line.startswith("MemAvailable:"):
            free = 1024 * float(line.split()[1])

    limit, used, stat = (_lines(f"{CONTAINER}/memory.{x}") for x in ("max", "current", "stat"))
    if limit and used and limit[0].isdigit():
        # the kernel gives up cached files first
        cached = [line.split()[1] for line in stat if line.startswith("inactive_file ")]
        free = min(free, float(limit[0]) - float(used[0]) + float((cached or ["0"])[0]))

    return min(free, _process_limit())


def _process_limit() -> float:
    """Bytes that the memory limit of this process (ulimit -v) leaves free."""
    try:
        import resource
    except ImportError:  # no Unix
        return np.inf

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    pages = _lines("/proc/self/statm")
    if limit == resource.RLIM_INFINITY or not pages:
        return np.inf
    return float(limit - int(pages[0].split()[0]) * resource.getpagesize())


def require(need: float, what: str, remedy: str, free: float | None = None) -> None:
    """OutOfMemoryError "`what` needs 3 GB and 2 GB are free: `remedy`." unless `need` bytes fit."""
    if free is None and need < NEGLIGIBLE:
        return
    free = free_memory() if free is None else free
    if need > MEMORY_SHARE * free:
        raise OutOfMemoryError(f"{shortage(what, need, free)}: {remedy}.")


def shortage(what: str, need: float, free: float) -> str:
    """The sentence that something needs more memory than is free, without the remedy."""
    return f"{what} needs about {need / 1e9:.3g} GB and {free / 1e9:.3g} GB are free"


def allocation_failed(
    what: str, error: BaseException | None = None, remedy: str = MEMORY_REMEDY
) -> OutOfMemoryError:
    """The error for an allocation that failed in the step `what`."""
    reason = "" if error is None else f" ({str(error) or 'Python itself'})"
    return OutOfMemoryError(f"{what} ran out of memory{reason}: {remedy}.")


def within_memory(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate `function`: a MemoryError in it becomes an OutOfMemoryError."""
    name = function.__qualname__.removesuffix(".__init__").removesuffix(".__new__")

    @wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except OutOfMemoryError:
            raise
        except MemoryError as error:
            raise allocation_failed(name, error) from error

    return guarded


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
