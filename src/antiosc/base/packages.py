"""Changes that packages make to the process, and files that they may read when they load.

FFCx, dolfinx, PETSc and setuptools change loggers, warnings, flags of the dynamic loader, signal
handlers, environment and module path; `restored` undoes this. Several packages read configuration
files in the working folder (`.petscrc`, `matplotlibrc`, …), which can name programs to run. They
are therefore loaded in `/` (`loading`), so that an untrusted folder configures nothing.
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
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from antiosc.base.errors import MissingDependencyError

#: Loggers whose levels the packages change.
LOGGERS = ("UFL", "ffcx", "FFCx")
#: Environment variables that packages may set; package that puts its own folders on the module
#: path.
ENVIRONMENT = ("HOME", "KMP_DUPLICATE_LIB_OK", "PLAT")
VENDOR = "setuptools"
#: Folders that `VENDOR` put on the module path: it may import from them again later.
_appended: list[str] = []
#: Held during imports and compilation, which change the state of the whole process.
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
    thread = threading.get_ident()

    def is_shown(record: logging.LogRecord) -> bool:
        return record.levelno >= logging.WARNING or record.thread != thread

    for logger in loggers:
        logger.addFilter(is_shown)

    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(is_shown)


@contextmanager
def loading() -> Iterator[None]:
    """Context for imports of packages, with the working folder `/` and a home folder."""
    try:
        Path.home()
    except RuntimeError:  # packages need one to load
        os.environ["HOME"] = _home()

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


@cache
def _home() -> str:
    """A new folder that only this user may enter; it is removed when the process ends."""
    folder = tempfile.mkdtemp(prefix="antiosc-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def start_mpi() -> None:
    """Load MPI before packages that need it; MissingDependencyError under another MPI's mpirun."""
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
