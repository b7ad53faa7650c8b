"""The user's folder of compiled forms, without which every run would call the C compiler.

FFCx loads the library of a form from its folder without any check, so that a library written by
somebody else would run in the process. antiosc therefore has its own folder, which only the user
may write. While antiosc compiles, dolfinx and FFCx read no configuration files, since these name
compilers, libraries and folders.
"""

from __future__ import annotations

import fcntl
import os
import shlex
import shutil
import stat
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import EPERM
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from textwrap import shorten
from types import ModuleType
from typing import IO, Any

import dolfinx.jit
import ffcx
import ffcx.codegeneration.jit as jit
from cffi import VerificationError

from antiosc.base.clock import uncounted
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.base.packages import quiet, restored

#: Time that a process waits for another one to compile the same form, s.
COMPILE_WAIT = 600
#: For the C compiler, before those of the environment; FFCx holds libraries of other flags apart.
FLAGS = ("-O2", "-g0")
#: Names of the functions of dolfinx and FFCx that read configuration files.
CONFIG_READERS = {"_load_options", "_load_parameters"}
#: FFCx's own options
FFCX_OPTIONS = ffcx.options if hasattr(ffcx, "options") else ffcx.parameters


@contextmanager
def user_folder() -> Iterator[None]:
    """Context in which dolfinx compiles into the user's folder and loads from it, or OSError."""
    folder = cache_folder()
    flags = [*FLAGS, *shlex.split(os.environ.get("CFLAGS", ""))]
    options = {"cache_dir": folder, "timeout": COMPILE_WAIT, "cffi_extra_compile_args": flags}

    with (
        _shared_folder(folder),
        _replaced(dolfinx.jit, lambda: (options, {})),
        _replaced(FFCX_OPTIONS, lambda: ({}, {})),
    ):
        yield


#: Folders from which this process has removed what ended processes left.
_cleared_folders: set[Path] = set()


@contextmanager
def _shared_folder(folder: Path) -> Iterator[None]:
    """Context that shares `folder` with other processes; removes unfinished files of ended ones."""
    with (folder / "lock").open("w") as file:
        if folder not in _cleared_folders:
            with suppress(OSError):  # somebody else compiles, or the file system has no locks
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                ready = {path.with_suffix("") for path in folder.glob("*.cached")}
                for source in ready.symmetric_difference(folder.glob("*.c")):
                    source.unlink(missing_ok=True)
                    source.with_suffix(".c.cached").unlink(missing_ok=True)
                _cleared_folders.add(folder)

        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_SH)
        yield


@contextmanager
def _replaced(module: ModuleType, function: Callable[..., object]) -> Iterator[None]:
    """Context in which `function` replaces the module's reader of configuration files."""
    originals = {name: value for name, value in vars(module).items() if name in CONFIG_READERS}
    vars(module).update(dict.fromkeys(originals, function))
    try:
        yield
    finally:
        vars(module).update(originals)


# -- where it is


def cache_folder() -> Path:
    """The cache folder, created if missing; PermissionError if it is somebody else's."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    users = Path(cache_home) if os.path.isabs(cache_home) else Path.home() / ".cache"
    build = EXTENSION_SUFFIXES[0].split(".")[1]
    folder = users / "antiosc" / f"ffcx-{ffcx.__version__}-{build}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
        raise PermissionError(EPERM, "a link, or a folder of another user", str(folder))

    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):  # anybody may have put something there
        shutil.rmtree(folder)
        folder.mkdir(mode=0o700)
    return folder


# -- Settings of FFCx while something is compiled, restored afterwards.


FFCX_VERSION = tuple(int(part) for part in ffcx.__version__.split(".")[:2])
#: Loggers that report every step; from 0.6 on FFCx itself keeps the root logger quiet.
NOISY_LOGGERS = ("UFL", "FFCx", "ffcx", *([""] if FFCX_VERSION < (0, 6) else []))

_compiling = threading.RLock()


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Context in which forms are compiled, without output, and while `clock` stands still.
    InputError without a writable cache or if another process does not finish a form,
    MissingDependencyError without a C compiler."""
    try:
        with (
            uncounted(),
            _compiling,
            restored(),
            quiet(*NOISY_LOGGERS),
            _ffcx_mended(),
            _loaded_once(),
            user_folder(),
        ):
            yield
    except (TimeoutError, FileExistsError, ImportError) as error:
        raise InputError(
            f"a finite element is not compiled after {COMPILE_WAIT} s: delete {cache_folder()}."
        ) from error
    except VerificationError as error:
        reason = shorten(str(error), 90)
        raise MissingDependencyError(
            f"finite elements are compiled, which fails here ({reason}): install a C compiler and "
            "Python's headers, on Debian by sudo apt install gcc libc6-dev python3-dev."
        ) from None
    except OSError as error:
        raise InputError(
            f"finite elements cannot be compiled ({error}): set XDG_CACHE_HOME to a folder for it."
        ) from error


#: (library, its folder) -> (its objects, its module), as this process has loaded them.
_loaded: dict[tuple[str, str], tuple[Any, Any]] = {}


@contextmanager
def _loaded_once() -> Iterator[None]:
    """Context in which FFCx loads each library once, as it lists the whole folder to find one."""
    load = jit.get_cached_module

    def loaded(library: str, names: Any, folder: object, timeout: int) -> tuple[Any, Any]:
        key = library, str(folder)
        found = _loaded.get(key) or load(library, names, folder, timeout)
        if found[0] is not None:  # it was compiled before
            _loaded[key] = found
        return found

    jit.get_cached_module = loaded
    try:
        yield
    finally:
        jit.get_cached_module = load


@contextmanager
def _ffcx_mended() -> Iterator[None]:
    """Context that corrects two faults of FFCx 0.5: it numbers second and higher derivatives on a
    shell by x, y, z instead of the cell's directions, as Basix does; and it never closes the empty
    C file that reserves a compilation."""
    if FFCX_VERSION >= (0, 6):
        yield
        return
    import ffcx.ir.elementtables as tables

    if hasattr(jit, "open"):  # inside another such context
        yield
        return
    values = tables.get_ffcx_table_values

    def in_the_cell(points: Any, cell: Any, *others: Any) -> Any:
        *head, counts, component = others
        counts = counts[: cell.topological_dimension()]
        return values(points, cell, *head, counts, component)

    def claimed(path: Path, mode: str) -> IO[str]:
        file = open(path, mode)  # noqa: SIM115
        if path.suffix == ".c":
            file.close()
        return file

    tables.get_ffcx_table_values = in_the_cell
    jit.open = claimed

    try:
        yield
    finally:
        tables.get_ffcx_table_values = values
        del jit.open
