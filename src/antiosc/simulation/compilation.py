"""The march compiled by numba: a second copy of its package, loaded where the work is worth it."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import Lock
from types import ModuleType

from antiosc.simulation import march

# Interpreted steps, about 0.1 ms each, that it takes to load the compiled march (1 s) or to compile
# it (20 s) for the rest.
_WORTH_LOADING, _WORTH_COMPILING = 20_000, 400_000
_interpreted = 0
_PATIENCE = 120  # s that a process waits for another one that compiles

_COMPILED = march.__name__ + "_compiled"
_SOURCE = Path(march.__file__).parent
_loading = Lock()


def fitting_march(work: int) -> ModuleType:
    """The march to go on with after so many interpreted steps: compiled once that pays."""
    global _interpreted
    if _COMPILED in sys.modules:
        return _whole(sys.modules[_COMPILED]) or march
    _interpreted += work
    if _interpreted <= _WORTH_LOADING or (_interpreted <= _WORTH_COMPILING and not _cached()):
        return march
    return compiled_march() or march


def compiled_march() -> ModuleType | None:
    """The march compiled by numba; None where numba is not installed or does not work here."""
    with _loading:
        if _COMPILED not in sys.modules:
            sys.modules[_COMPILED] = _load()  # type: ignore[assignment]
        return _whole(sys.modules[_COMPILED])


def _whole(found: ModuleType | None) -> ModuleType | None:
    """The module, unless another thread is still loading it."""
    return found if found is not None and vars(found).get("WHOLE") else None


@cache
def _cached() -> bool:
    """Whether an earlier process has compiled this march."""
    folder = _folder()
    return folder is not None and any(folder.rglob("course.march-*.nbi"))


@cache
def _folder() -> Path | None:
    """Where the compiled code of just this source is kept; None where nothing can be written.

    numba compares the file of a function alone with what it compiled, and would miss a change of
    what is called from another file.
    """
    source = hashlib.sha256()
    for file in sorted(_SOURCE.glob("*.py")):
        source.update(file.read_bytes())
    own = _SOURCE / "__pycache__"
    given = os.environ.get("NUMBA_CACHE_DIR")
    for place in [Path(given)] if given else [own, _users()]:
        folder = place / f"march-{source.hexdigest()[:16]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError:
            continue
        if place == own:
            for older in place.glob("march-*"):
                if older != folder:
                    shutil.rmtree(older, ignore_errors=True)
        return folder
    return None


def _users() -> Path:
    """The user's folder for what can be made again."""
    given = os.environ.get("XDG_CACHE_HOME")
    return (Path(given) if given else Path("~/.cache").expanduser()) / "antiosc"


def _load() -> ModuleType | None:
    if importlib.util.find_spec("numba") is None:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what an old numba says of a newer Python
            import numba
    except ImportError:  # this numba does not know this NumPy
        return None
    folder, usual = _folder(), numba.config.CACHE_DIR
    for kept in (folder is not None, False):  # a folder may have become full meanwhile
        try:
            numba.config.CACHE_DIR = str(folder or "")
            with _alone(folder if kept else None):
                return _copy(kept)
        except (RuntimeError, OSError):
            continue
        finally:
            numba.config.CACHE_DIR = usual
    return None


@contextmanager
def _alone(folder: Path | None) -> Iterator[None]:
    """While one process compiles, others wait for what it leaves in the folder.

    They go on without it where files cannot be locked, or after `_PATIENCE` seconds.
    """
    with ExitStack() as stack:
        if folder is not None:
            with suppress(ImportError, OSError):
                import fcntl

                lock = stack.enter_context((folder / "lock").open("w"))
                for _ in range(10 * _PATIENCE):
                    with suppress(BlockingIOError):
                        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        break
                    time.sleep(0.1)
        yield


def _copy(kept: bool) -> ModuleType:
    """The package of the march under another name, compiled; `kept`: for later processes too."""
    spec = importlib.util.spec_from_file_location(
        _COMPILED, _SOURCE / "__init__.py", submodule_search_locations=[str(_SOURCE)]
    )
    assert spec is not None
    assert spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    package.CACHE = kept  # type: ignore[attr-defined]
    sys.modules[_COMPILED] = package  # its modules look for it there
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            spec.loader.exec_module(package)
    except BaseException:  # interrupted, too: the next one begins anew
        for name in [each for each in sys.modules if f"{each}.".startswith(f"{_COMPILED}.")]:
            del sys.modules[name]
        raise
    # straight in: numba 0.56 at times mistakes the types of long tuples
    (compiled,) = package.march.overloads.values()
    package.march = compiled.entry_point  # type: ignore[attr-defined]
    package.WHOLE = True  # type: ignore[attr-defined]
    return package
