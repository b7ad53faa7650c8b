"""The user's folder of compiled forms, without which every run would call the C compiler.

FFCx loads the library of a form from its folder without any check. A library truncated by a full
disk ends the process; one written by somebody else runs in the process. antiosc therefore has its
own folder, which only the user may write. A library is loaded if its checksum is the one stored
beside it when it was compiled; otherwise it is compiled again. While antiosc compiles, dolfinx and
FFCx read no configuration files, since these name compilers, libraries and folders. Configuration
files in the working folder, which may come from a stranger, are never read in a process with
antiosc.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import stat
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import dolfinx.jit
import ffcx
import ffcx.codegeneration.jit as ffcx_jit

from antiosc.base.clock import uncounted
from antiosc.base.errors import InputError, warn
from antiosc.base.process import own_folder, quiet, restored

#: Time that a process waits for another one to compile the same form, s. A lock ends with its
#: process, and a form takes at most a minute of processor time, which may be long on a busy
#: machine.
PATIENCE = 3600.0
#: Names of the functions of dolfinx and FFCx that read configuration files.
READERS = {"_load_options", "_load_parameters"}
#: FFCx's own options
SETTINGS = ffcx.options if hasattr(ffcx, "options") else ffcx.parameters


def _of_the_user(read_settings: Callable[[], tuple[object, object]]) -> tuple[object, object]:
    """The compiler settings from the file in the user's folder; those of the working folder are
    ignored.
    """
    return read_settings()[0], {}


for _module in (dolfinx.jit, SETTINGS):
    for _name in READERS & vars(_module).keys():
        setattr(_module, _name, partial(_of_the_user, getattr(_module, _name)))


@contextmanager
def checked_folder() -> Iterator[None]:
    """Context in which dolfinx compiles into, and loads from, the user's folder only.

    OSError if the folder cannot be written.
    """
    load = ffcx_jit._load_objects
    cached = ffcx_jit.get_cached_module
    if isinstance(cached, partial):  # within such a context
        yield
        return
    folder = place()
    entries: dict[str, _Entry] = {}
    try:
        with (
            _replaced(dolfinx.jit, READERS, lambda: ({"cache_dir": folder}, {})),
            _replaced(SETTINGS, READERS, lambda: ({}, {})),
            _replaced(ffcx_jit, {"get_cached_module"}, partial(_cached, folder, entries, cached)),
            _replaced(ffcx_jit, {"_load_objects"}, partial(_compiled, entries, load)),
        ):
            yield
    finally:
        for entry in entries.values():  # of which the compiler has failed
            entry.release()


@contextmanager
def _replaced(
    module: ModuleType, names: set[str], function: Callable[..., object]
) -> Iterator[None]:
    """Context in which `function` replaces the functions `names` of a module."""
    originals = {name: value for name, value in vars(module).items() if name in names}
    vars(module).update(dict.fromkeys(originals, function))
    try:
        yield
    finally:
        vars(module).update(originals)


#: What this process has loaded: to look a library up in a folder of thousands takes 15 ms.
_loaded: dict[Path, tuple[object, object]] = {}


def _cached(
    folder: Path,
    entries: dict[str, _Entry],
    load_cached: Callable[..., tuple[object, object]],
    name: str,
    objects: list[str],
    cache_dir: Path,
    timeout: int,
) -> tuple[object, object]:
    """Replacement of FFCx's `get_cached_module`: (None, None) means compile, with the entry
    locked.
    """
    if Path(cache_dir) != folder:  # another thread of the program compiles for itself
        return load_cached(name, objects, cache_dir, timeout)
    library = folder / name
    if library in _loaded:
        return _loaded[library]
    entry = entries[name] = _Entry(folder, name)
    if not entry.whole():
        entry.clear()
    try:
        loaded = load_cached(name, objects, cache_dir, timeout)
    except ImportError:  # made for another system
        entry.clear()
        loaded = load_cached(name, objects, cache_dir, timeout)
    if loaded[0] is not None:
        entries.pop(name).release()
        _loaded[library] = loaded
    return loaded


def _compiled(
    entries: dict[str, _Entry],
    load_objects: Callable[..., tuple[object, object]],
    cache_dir: Path,
    name: str,
    objects: list[str],
) -> tuple[object, object]:
    """Replacement of FFCx's `_load_objects` for a form just compiled."""
    loaded = load_objects(cache_dir, name, objects)
    if name in entries:
        entry = entries.pop(name)
        entry.seal()
        entry.release()
    return loaded


class _Entry:
    """The files of one compiled form, which one process at a time may read or change."""

    def __init__(self, folder: Path, name: str) -> None:
        self.library = folder / f"{name}{EXTENSION_SUFFIXES[0]}"
        self.ready = folder / f"{name}.c.cached"
        self.own = folder / f"{name}.sha256"
        self.file: IO[str] = self.own.open("a+", encoding="ascii")
        try:
            _lock(self.file)
        except BaseException:
            self.file.close()
            raise

    def whole(self) -> bool:
        """Whether the library is complete: its checksum is the stored one."""
        self.file.seek(0)
        with suppress(OSError, ValueError):
            return self.ready.is_file() and self.file.read() == self._checksum()
        return False

    def clear(self) -> None:
        """Remove everything but the locked file."""
        self.file.truncate(0)
        for path in self.own.parent.glob(f"{self.own.stem}.*"):
            if path != self.own:
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()

    def seal(self) -> None:
        """Write the checksum that marks the library as complete."""
        self.file.truncate(0)
        self.file.write(self._checksum())

    def release(self) -> None:
        """Release the lock on the library for other processes."""
        self.file.close()

    def _checksum(self) -> str:
        """SHA-256 of the library."""
        return hashlib.sha256(self.library.read_bytes()).hexdigest()


def _lock(file: IO[str]) -> None:
    """Wait until no other process holds the file; TimeoutError after `PATIENCE`."""
    import fcntl  # not on Windows

    end = time.monotonic() + PATIENCE
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > end:
                raise TimeoutError(
                    errno.ETIMEDOUT, f"another process has held it for {PATIENCE:g} s", file.name
                ) from None
            time.sleep(0.05)
        except OSError:  # a file system without locks: two processes may compile at once
            return


# -- where it is


def place() -> Path:
    """The cache folder, created if missing; a private one of this process if unsafe."""
    cache_home = os.environ.get("XDG_CACHE_HOME", "")
    users = Path(cache_home) if os.path.isabs(cache_home) else Path.home() / ".cache"
    build = EXTENSION_SUFFIXES[0].split(".")[1]
    folder = users / "antiosc" / f"ffcx-{ffcx.__version__}-{build}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
        return _instead_of(folder)
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):  # anybody may have put something there
        shutil.rmtree(folder)
        folder.mkdir(mode=0o700)
    return folder


@cache
def _instead_of(folder: Path) -> Path:
    """A private folder of this process instead of an unsafe one, with a warning."""
    warn(
        f"{folder} is a link or belongs to another user: what was compiled there is not run, and "
        "this run compiles its finite elements anew; set XDG_CACHE_HOME to a folder of your own."
    )
    return Path(own_folder())


# -- Settings of FFCx while something is compiled, restored afterwards.


FFCX = tuple(int(part) for part in ffcx.__version__.split(".")[:2])
#: Loggers that report every step; from 0.6 on FFCx itself keeps the root logger quiet.
NOISY = ("UFL", "FFCx", "ffcx", *([""] if FFCX < (0, 6) else []))

_compiling = threading.RLock()


@contextmanager
def compiler() -> Iterator[None]:
    """Context in which forms are compiled: without log output, outside the seconds of `clock`, and
    with the faults of FFCx 0.5 mended.

    InputError if the system refuses to write the compiled files.
    """
    try:
        with uncounted(), _compiling, restored(), quiet(*NOISY), _mended(), checked_folder():
            yield
    except OSError as error:
        raise InputError(
            "compiled finite elements cannot be written to "
            f"{error.filename or 'their cache folder'} ({error.strerror or error}): set "
            "XDG_CACHE_HOME, or HOME, to a folder that can be written."
        ) from error


@contextmanager
def _mended() -> Iterator[None]:
    """Context without two faults of FFCx 0.5.

    FFCx 0.5 numbers derivatives by x, y, z, while Basix numbers them by the directions of the cell:
    on a shell in space, derivatives of second and higher order differ. It also never closes the
    empty C file by which it claims a compilation, so that Python warns of it.
    """
    if FFCX >= (0, 6):
        yield
        return
    import ffcx.codegeneration.jit as jit
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
