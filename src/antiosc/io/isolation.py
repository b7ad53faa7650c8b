"""Files are read in a separate process, one for each, so that a harmful file cannot affect the
caller.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from antiosc.base.errors import (
    AntioscError,
    MeshError,
    MissingDependencyError,
    PiecesError,
    UnmeshableError,
)
from antiosc.base.progress import doing
from antiosc.base.texts import printable
from antiosc.io import child
from antiosc.io.neutral import FileMesh, Json, unpacked
from antiosc.io.request import OVERTIME

#: Least address space of a reader, bytes; gmsh and its libraries need a tenth of it.
LEAST_MEMORY = 2 * 2**30
#: Additional address space of a reader of a mesh, over the size of the file.
MEMORY_PER_BYTE = 100
#: Share of the machine's memory that no reader exceeds.
READER_MEMORY_SHARE = 0.9
#: The only environment variables that the reading process gets.
ENVIRONMENT = ("PATH", "LD_LIBRARY_PATH", "OMP_NUM_THREADS", "ANTIOSC_FOLDER")
#: Folders of files that are no data: reading them may never end.
SYSTEM = ("/proc", "/sys", "/dev")


def read_apart(path: Path, *, geometry: bool, options: Json, timeout: float | None) -> FileMesh:
    """The content of the file `path`, by the reader of its file type (`table`).

    `geometry`: whether the file is a geometry; its mesh may be much larger than the file.
    `options`: those of a `Request`.

    Raises
    ------
    MeshError
        No such file, no regular file, damaged, refused by its reader, or over the limits.
    MissingDependencyError
        gmsh, meshio or trimesh is not installed.
    """
    name = printable(path.name)
    size = _size(path)
    memory = _memory(None if geometry else size)
    request = {**options, "path": str(path.absolute()), "name": name}
    request |= {"timeout": timeout, "memory": memory}

    with tempfile.TemporaryDirectory(prefix="antiosc-") as folder:
        # a trusted script may refer to files in the working folder
        request["folder"] = os.getcwd() if options.get("trust") else folder
        meshes = geometry and not options.get("outline")
        with doing(f"{'meshing' if meshes else 'reading'} {name}"):
            code, response = _ask(request)

    if code != 0:
        raise _broken_off(name, code, memory, geometry, timeout is None)
    return _answer(name, response, memory)


def _size(path: Path) -> int:
    """Size of a regular file, bytes; MeshError for anything else, which might never end."""
    shown = printable(str(path))[:200]
    try:
        status = path.stat()
        real = str(path.resolve())
    except FileNotFoundError:
        raise MeshError(
            f"there is no mesh file {shown!r}; check the path (working folder: {Path.cwd()})."
        ) from None
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MeshError(f"{shown!r} cannot be opened: {printable(reason)}.") from None

    if not stat.S_ISREG(status.st_mode) or real.startswith(SYSTEM):
        kind = "folder" if stat.S_ISDIR(status.st_mode) else "pipe or device"
        raise MeshError(f"{shown!r} is a {kind}, not a file with a mesh.")
    if not os.access(path, os.R_OK):
        raise MeshError(f"{shown!r} may not be read: its permissions forbid it.")
    if status.st_size == 0:
        raise MeshError(f"{printable(path.name)} is empty.")
    if status.st_size > READER_MEMORY_SHARE * _machine_memory():
        raise MeshError(
            f"{printable(path.name)} has {status.st_size / 2**30:.3g} GiB, more than this "
            "machine's memory."
        )
    return status.st_size


def _machine_memory() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 2**34


def _memory(size: int | None) -> int:
    """Address space of a reader [bytes], for a file of this size; None: a geometry."""
    limit = int(READER_MEMORY_SHARE * _machine_memory())
    if size is not None:
        limit = min(limit, LEAST_MEMORY + MEMORY_PER_BYTE * size)
    return max(limit, LEAST_MEMORY)


def _ask(request: Json) -> tuple[int, bytes]:
    """(exit code, response) of the reading process; see `child`."""
    if not sys.executable:
        raise MeshError("meshes are read by a second Python, but sys.executable names none.")

    # "" stands for the working folder, which holds no packages
    line = {**request, "sys_path": [os.path.abspath(p) for p in sys.path if p]}
    environment = {name: os.environ[name] for name in ENVIRONMENT if name in os.environ}
    process = subprocess.Popen(
        [sys.executable, "-I", "-S", "-B", str(Path(child.__file__).resolve())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        cwd="/",
        env={**environment, "LC_ALL": "C.UTF-8", "OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,
    )
    try:
        response, _ = process.communicate(json.dumps(line).encode())
        return process.returncode, response
    finally:  # also at Ctrl-C, and what the reader has started
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _broken_off(name: str, code: int, memory: int, geometry: bool, again: bool) -> MeshError:
    """The error for a reader process that ended early; `again`: another attempt may follow."""
    remedy = "give another element size." if geometry else "write the file anew."
    if -code in OVERTIME:
        error_class = UnmeshableError if geometry and again else MeshError
        size = ", or a larger element size." if geometry else "."
        return error_class(
            f"reading {name} took longer than a file of its kind and size may take: give a longer "
            f"timeout in s (--timeout of `antiosc new` and `antiosc open`){size}"
        )

    kind = UnmeshableError if geometry else MeshError
    if code < 0:
        end = f"{signal.Signals(-code).name}; it had {memory / 2**30:.1f} GiB"
        return kind(f"the reader of {name} broke off ({end}): {remedy}")
    return kind(f"the reader of {name} ended with code {code} and gave no mesh: {remedy}")


def _answer(name: str, response: bytes, memory: int) -> FileMesh:
    """The mesh in the reader's response, or its error raised."""
    if not response:
        raise MeshError(f"the reader of {name} gave no mesh: a command of the file ends it (Exit).")
    try:
        with np.load(io.BytesIO(response), allow_pickle=False) as archive:
            first, *arrays = (archive[key] for key in archive.files)
        header = _printable(json.loads(first.tobytes()))
        if "error" not in header:
            return unpacked(header, arrays)
    except (ValueError, KeyError, TypeError, OSError, zipfile.BadZipFile) as error:
        raise MeshError(f"{name} is damaged: {str(error).rstrip('.')}.") from error

    if header["error"] == "MemoryError":
        raise MeshError(
            f"{name} needs more than {memory / 2**30:.1f} GiB to be read, which this machine "
            "lacks: make the mesh coarser."
        )
    kinds: dict[str, type[AntioscError]] = {
        kind.__name__: kind for kind in (MissingDependencyError, PiecesError, UnmeshableError)
    }
    raise kinds.get(header["error"], MeshError)(header["message"])


def _printable(value: Any) -> Any:
    """Values of JSON, whose texts can be printed: names in a file may hold escape characters."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [_printable(item) for item in value]
    if isinstance(value, dict):
        return {printable(key): _printable(item) for key, item in value.items()}
    return value
