"""Undo the changes that the finite-element packages make to the process that imports them.

FFCx adds a handler to the root logger and redirects Python's warnings to it; dolfinx changes the
flags of the dynamic loader; PETSc installs signal handlers; setuptools, which calls the compiler,
changes the environment and the module path.

When they load, several packages take files of the working folder for their configuration
(`.petscrc`, `petsc.cfg`, `ucx.conf`, `matplotlibrc`); such a file can name programs and libraries
to run. They load in `/` instead, so that a folder from elsewhere configures nothing.
"""

from __future__ import annotations

import atexit
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

#: Loggers whose levels the packages change.
LOGGERS = ("UFL", "ffcx", "FFCx")
#: Variables that setuptools and threadpoolctl set; the package whose folders are put on the module
#: path.
ENVIRONMENT, VENDOR = ("HOME", "KMP_DUPLICATE_LIB_OK", "PLAT"), "setuptools"
#: Entries that it put there: it may look there again later.
_appended: list[str] = []
#: Held while something is imported or compiled, for all of this belongs to the process.
_lock = threading.RLock()


@contextmanager
def restored() -> Iterator[None]:
    """Restore logging, warnings, environment, paths, loader flags and locale at the end.

    One thread at a time. What other threads do to the environment and the module path meanwhile
    stays.
    """
    with _lock:
        yield from _restored()


def _restored() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level, show = list(root.handlers), root.level, warnings.showwarning
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
        if warnings.showwarning is not show:
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
    return logger.level if isinstance(logger, logging.Logger) else None


@contextmanager
def quiet(*names: str) -> Iterator[None]:
    """Keep what this thread reports below WARNING to the named loggers from all handlers."""
    loggers = [logging.getLogger(name) for name in names]
    filters = _Below()
    for logger in loggers:
        logger.addFilter(filters)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(filters)


class _Below(logging.Filter):
    def __init__(self) -> None:
        super().__init__()
        self.thread = threading.get_ident()

    def filter(self, record: logging.LogRecord) -> bool:
        return record.levelno >= logging.WARNING or record.thread != self.thread


@contextmanager
def loading() -> Iterator[None]:
    """Context in which packages are imported: outside the working folder, and with a home.

    The working folder is one of the whole process, hence only what is loaded once belongs here.
    """
    _give_home()
    with _lock:
        try:
            here = os.open(".", getattr(os, "O_PATH", os.O_RDONLY))
        except OSError:  # nothing can be read there
            yield
            return
        try:
            os.chdir("/")
            yield
        finally:
            os.fchdir(here)
            os.close(here)


def _give_home() -> None:
    """Set HOME to a folder of this process if the user has none: packages fail to load without.

    In a container the user may have neither HOME nor an entry in /etc/passwd.
    """
    try:
        Path.home()
    except RuntimeError:
        os.environ["HOME"] = _home()


@cache
def _home() -> str:
    return own_folder()


def own_folder() -> str:
    """A new folder that only this user may enter; it is removed when the process ends."""
    folder = tempfile.mkdtemp(prefix="antiosc-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def start_petsc() -> None:
    """Initialise PETSc once, without its signal handlers and its configuration files.

    By default these handlers abort all ranks on a broken pipe, a hang-up and other signals; the
    files are `.petscrc` of the home and of the working folder. Options in PETSC_OPTIONS are taken.
    """
    if "petsc4py.PETSc" not in sys.modules:
        import petsc4py

        petsc4py.init(["antiosc", "-no_signal_handler", "-skip_petscrc"])
