"""Files are read in a separate process, so that a harmful file cannot affect the caller.

The process (`child`) starts with the first file and ends with this one.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from antiosc.base.errors import (
    AntioscError,
    MeshError,
    MissingDependencyError,
    PiecesError,
    UnmeshableError,
)
from antiosc.base.progress import doing
from antiosc.io import child
from antiosc.io.cad import ATTEMPTS
from antiosc.io.geo_script import CAD
from antiosc.io.neutral import FileMesh, Json, unpacked
from antiosc.io.request import OVERTIME

#: Words of the error on a reader that took too long.
OVERTIME_WORDS = "took longer"
#: Least address space of a reader, bytes; gmsh and its libraries need a tenth of it.
LEAST_MEMORY = 2 * 2**30
#: Additional address space of a reader of a mesh, over the size of the file.
MEMORY_PER_BYTE = 100
#: Share of the machine's memory that no reader exceeds.
READER_MEMORY_SHARE = 0.9


def read_apart(path: Path, *, geometry: bool, options: Json, timeout: float | None) -> FileMesh:
    """The content of the file `path`, by the reader of its file type (`table`).

    `geometry`: whether the file is a geometry; its mesh may be much larger than the file.
    `options`: those of a `Request`, and what is told of the work besides ("told").

    Raises
    ------
    MeshError
        No such file, no regular file, damaged, refused by its reader, or over the limits.
    MissingDependencyError
        gmsh or meshio is not installed.
    """
    size = _size(path)
    memory = _memory(None if geometry else size)
    with tempfile.TemporaryDirectory(prefix="antiosc-") as folder:
        if options.get("trust"):  # a trusted script may refer to files in the working folder
            folder = os.getcwd()
        place = {"path": str(path.absolute()), "name": path.name, "folder": folder}
        attempt = options.get("attempt", 0)
        told, options = options.get("told", ""), {**options}
        options.pop("told", None)
        about = f" ({told}{ATTEMPTS[attempt].about})" if attempt else ""
        meshes = geometry and not options.get("outline")
        with doing(f"{'meshing' if meshes else 'reading'} {path.name}{about}") as tell:
            request = {**options, **place, "timeout": timeout, "memory": memory}
            code, response = ask(request, tell)
    if code != 0:
        again = bool(options.get("attempt") or options.get("solid"))
        again |= timeout is None and path.suffix.lower() in CAD
        raise _broken_off(path.name, code, memory, geometry, again)
    return _answer(path.name, response, memory)


def _size(path: Path) -> int:
    """Size of a regular file, bytes; MeshError for anything else, which might never end."""
    try:
        status = path.stat()
    except FileNotFoundError:
        raise MeshError(
            f"there is no mesh file {str(path)!r}; check the path (working folder: {Path.cwd()})."
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MeshError(f"{str(path)[:200]!r} cannot be opened: {reason}.") from None
    if not stat.S_ISREG(status.st_mode):
        kind = "folder" if stat.S_ISDIR(status.st_mode) else "pipe or device"
        raise MeshError(f"{str(path)!r} is a {kind}, not a file with a mesh.")
    if not os.access(path, os.R_OK):
        raise MeshError(f"{str(path)!r} may not be read: its permissions forbid it.")
    if status.st_size == 0:
        raise MeshError(f"{path.name} is empty.")
    if status.st_size > READER_MEMORY_SHARE * _machine_memory():
        raise MeshError(
            f"{path.name} has {status.st_size / 2**30:.3g} GiB, more than this machine's memory."
        )
    return status.st_size


def _machine_memory() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 2**34


def _memory(size: int | None) -> int:
    memory_limit = int(READER_MEMORY_SHARE * _machine_memory())
    if size is not None:
        memory_limit = min(memory_limit, LEAST_MEMORY + MEMORY_PER_BYTE * size)
    return max(memory_limit, LEAST_MEMORY)


def _broken_off(name: str, code: int, memory: int, geometry: bool, again: bool) -> MeshError:
    """The error for a reader process that ended early; `again`: other attempts may follow."""
    if -code in OVERTIME:
        error_class = UnmeshableError if again else MeshError
        return error_class(
            f"reading {name} {OVERTIME_WORDS} than a file of its kind and size may take: give a "
            "longer timeout in s (--timeout of `antiosc new` and `antiosc open`)"
            + (", or a larger element size." if geometry else ".")
        )
    kind = UnmeshableError if geometry else MeshError
    if code < 0:
        return kind(
            f"the reader of {name} broke off ({signal.Signals(-code).name}; it had "
            f"{memory / 2**30:.1f} GiB): "
            + ("give another element size." if geometry else "write the file anew.")
        )
    return kind(
        f"the reader of {name} ended with code {code} and gave no mesh: "
        + ("give another element size." if geometry else "write the file anew.")
    )


def _answer(name: str, answer: bytes, memory: int) -> FileMesh:
    """The mesh in the reader's response, or its error raised."""
    line, _, content = answer.partition(b"\n")
    if not line:
        raise MeshError(f"the reader of {name} gave no mesh: a command of the file ends it (Exit).")
    try:
        header = json.loads(line)
        if "error" in header:
            _raise(name, header, memory)
        return unpacked(header, _arrays(header["arrays"], content))
    except MeshError:
        raise
    except (ValueError, KeyError) as error:
        raise MeshError(f"{name} is damaged: {str(error).rstrip('.')}.") from error


def _raise(name: str, head: Json, memory: int) -> None:
    if head["error"] == "MemoryError":
        raise MeshError(
            f"{name} needs more than {memory / 2**30:.1f} GiB to be read, which this machine "
            "lacks: make the mesh coarser."
        )
    kinds: dict[str, type[AntioscError]] = {
        kind.__name__: kind for kind in (MissingDependencyError, PiecesError, UnmeshableError)
    }
    raise kinds.get(head["error"], MeshError)(head["message"])


def _arrays(shapes: Sequence[tuple[str, list[int]]], content: bytes) -> list[NDArray[np.generic]]:
    arrays = []
    start = 0
    for dtype, shape in shapes:
        count = int(np.prod(shape, dtype=object))
        arrays.append(np.frombuffer(content, dtype, count, start).reshape(shape))
        start += arrays[-1].nbytes
    return arrays


# --- The reading process --------------------------------------------------------------------------


#: The only environment variables that the reading process gets.
ENVIRONMENT = ("PATH", "LD_LIBRARY_PATH", "OMP_NUM_THREADS")

_lock = threading.Lock()
_process: subprocess.Popen[bytes] | None = None
_owner = 0
_seconds = 0.0


def processor_time() -> float:
    """Processor time [s] of all files that were read so far."""
    return _seconds


def ask(request: Json, tell: Callable[[str], None] | None = None) -> tuple[int, bytes]:
    """Read one file in the other process: (exit code, response); see `child`. `tell` gets what is
    told of the progress.
    """
    global _seconds
    with _lock:
        process = _running()
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            # "" stands for the working folder, which holds no packages
            line = {**request, "sys_path": [os.path.abspath(p) for p in sys.path if p]}
            process.stdin.write(json.dumps(line).encode() + b"\n")
            process.stdin.flush()
            header = json.loads(process.stdout.readline())
            while "progress" in header:
                if tell is not None:
                    tell(header["progress"])
                header = json.loads(process.stdout.readline())
            _seconds += header["seconds"]
            return int(header["code"]), process.stdout.read(header["size"])
        except (OSError, ValueError):  # it has ended
            _end()
            return process.returncode or -signal.SIGKILL, b""
        except BaseException:  # such as Ctrl-C: the answer is not needed any more
            _end()
            raise


def _running() -> subprocess.Popen[bytes]:
    """The reader process of this process; a fork starts its own."""
    global _process, _owner
    if _process is not None and _owner == os.getpid() and _process.poll() is not None:
        _end()
    if _process is None or _owner != os.getpid():
        if not sys.executable:
            raise MeshError("meshes are read by a second Python, but sys.executable names none.")
        environment = {name: os.environ[name] for name in ENVIRONMENT if name in os.environ}
        _process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-B", str(Path(child.__file__).resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env={**environment, "LC_ALL": "C.UTF-8", "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,
        )
        _owner = os.getpid()
    return _process


@atexit.register
def _end() -> None:
    """End the reader process and its forks."""
    global _process
    process = _process
    _process = None
    if process is None or _owner != os.getpid():
        return
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()
    process.wait()
