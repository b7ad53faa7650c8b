"""The finite-element packages change the process that imports them; here that is put back.

FFCx gives the root logger a handler and redirects Python's warnings to it, dolfinx leaves the
flags of the loader changed, PETSc takes over the signals, setuptools, which calls the compiler,
writes to the environment and to the module path.
"""

from __future__ import annotations

import locale
import logging
import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

#: Loggers that the packages set to levels of their own.
LOGGERS = ("UFL", "ffcx", "FFCx")
#: Entries that a package appended to the module path: it may look there again later.
_appended: list[str] = []


@contextmanager
def restored() -> Iterator[None]:
    """Leave logging, warnings, environment, paths, loader flags, locale as they were before."""
    root = logging.getLogger()
    handlers, level, show = list(root.handlers), root.level, warnings.showwarning
    levels = {name: _level(name) for name in LOGGERS}
    environment = dict(os.environ)
    flags = sys.getdlopenflags()
    former = locale.setlocale(locale.LC_ALL)
    path = list(sys.path)
    sys.path.extend(entry for entry in _appended if entry not in path)
    try:
        yield
    finally:
        _appended.extend(entry for entry in sys.path if entry not in (*path, *_appended))
        sys.path[:] = path
        root.handlers[:] = handlers
        root.setLevel(level)
        if warnings.showwarning is not show:
            logging.captureWarnings(False)
        for name, before in levels.items():
            if before is not None:
                logging.getLogger(name).setLevel(before)
        for name in os.environ.keys() - environment.keys():
            del os.environ[name]
        for name, value in environment.items():
            if os.environ.get(name) != value:
                os.environ[name] = value
        sys.setdlopenflags(flags)
        locale.setlocale(locale.LC_ALL, former)


def _level(name: str) -> int | None:
    """Level of a logger, None where it does not exist yet."""
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


def start_petsc() -> None:
    """Initialise PETSc, unless it is, so that it leaves the signals as they are.

    By itself it catches a broken pipe, a hang-up and others, and aborts all ranks on them.
    """
    if "petsc4py.PETSc" not in sys.modules:
        import petsc4py

        petsc4py.init(["antiosc", "-no_signal_handler"])
