"""Files are read in a separate process, one for each, so that a harmful file cannot affect the
caller. Scripts of gmsh are refused if they run programs, or read or write files.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import re
import resource
import signal
import stat
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

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
from antiosc.io.neutral import FileMesh, Json, unpacked

if TYPE_CHECKING:
    from importlib import metadata


#: Least address space of a reader, bytes; gmsh and its libraries need a tenth of it.
LEAST_MEMORY = 2 * 2**30
#: Additional address space of a reader of a mesh, over the size of the file.
MEMORY_PER_BYTE = 100
#: Share of the machine's memory that no reader exceeds.
READER_MEMORY_SHARE = 0.9
#: The only environment variables that the reading process gets.
READER_ENVIRONMENT = ("PATH", "LD_LIBRARY_PATH", "OMP_NUM_THREADS", "ANTIOSC_FOLDER")
#: Folders of files that are no data: reading them may never end.
SYSTEM_FOLDERS = ("/proc", "/sys", "/dev")


def read_isolated(path: Path, *, geometry: bool, options: Json, timeout: float | None) -> FileMesh:
    """Read a file in a separate process; `geometry`: the mesh may be much larger than the file."""
    name = printable(path.name)
    size = _file_size(path)
    most = int(READER_MEMORY_SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    needed = most if geometry else min(most, LEAST_MEMORY + MEMORY_PER_BYTE * size)
    memory = max(needed, LEAST_MEMORY)
    request = {**options, "path": str(path.absolute()), "name": name}
    request |= {"timeout": timeout, "memory": memory}

    with tempfile.TemporaryDirectory(prefix="antiosc-") as folder:
        # a trusted script may refer to files in the working folder
        request["folder"] = os.getcwd() if options.get("trust") else folder
        meshes = geometry and not options.get("outline")
        with doing(f"{'meshing' if meshes else 'reading'} {name}"):
            code, response = _run_reader(request)

    if code != 0:
        raise _reader_error(name, code, memory, geometry, timeout is None)
    return _mesh_of_response(name, response, memory)


def _file_size(path: Path) -> int:
    """Size of a regular file, bytes; MeshError for other paths, empty and unreadable files."""
    shown = printable(str(path))[:200]

    try:
        status = path.stat()
        real = str(path.resolve())
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MeshError(
            f"{shown!r} cannot be opened: {printable(reason)} (working folder: {Path.cwd()})."
        ) from None

    if not stat.S_ISREG(status.st_mode) or real.startswith(SYSTEM_FOLDERS):
        kind = "folder" if stat.S_ISDIR(status.st_mode) else "pipe or device"
        raise MeshError(f"{shown!r} is a {kind}, not a file with a mesh.")
    if not os.access(path, os.R_OK):
        raise MeshError(f"{shown!r} may not be read: its permissions forbid it.")
    if status.st_size == 0:
        raise MeshError(f"{printable(path.name)} is empty.")
    return status.st_size


def _run_reader(request: Json) -> tuple[int, bytes]:
    """Run the reading process `child.py` on a request; returns (exit code, response)."""
    # "" stands for the working folder, which holds no packages
    line = {**request, "sys_path": [os.path.abspath(p) for p in sys.path if p]}
    environment = {name: os.environ[name] for name in READER_ENVIRONMENT if name in os.environ}
    process = subprocess.Popen(
        [sys.executable, "-I", "-S", "-B", str(Path(__file__).resolve().with_name("child.py"))],
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


def _reader_error(name: str, code: int, memory: int, geometry: bool, again: bool) -> MeshError:
    """The error for a reader that ended early; `again`: another attempt may follow."""
    if -code in TIMEOUT_SIGNALS:
        size = ", or a larger element size" if geometry else ""
        return (UnmeshableError if geometry and again else MeshError)(
            f"reading {name} took longer than a file of its kind and size may take: give "
            f"read_mesh a longer timeout{size}."
        )

    end = signal.Signals(-code).name if code < 0 else f"code {code}"
    remedy = "give another element size" if geometry else "write the file anew"
    return (UnmeshableError if geometry else MeshError)(
        f"the reader of {name} broke off ({end}; it had {memory / 2**30:.1f} GiB): {remedy}."
    )


#: What a JSON text of printable ASCII names has none of: other characters, and their escapes.
ESCAPED = re.compile(rb"[^ -\[\]-~]")


def _mesh_of_response(name: str, response: bytes, memory: int) -> FileMesh:
    """The mesh in the reader's response; an error in the response is raised."""
    if not response:
        raise MeshError(f"the reader of {name} gave no mesh: a command of the file ends it (Exit).")

    try:
        with np.load(io.BytesIO(response), allow_pickle=False) as archive:
            first, *arrays = (archive[key] for key in archive.files)
        text = first.tobytes()
        header = json.loads(text)
        if ESCAPED.search(text):
            header = _printable(header)
        if "error" not in header:
            return unpacked(header, arrays)
    except (ValueError, KeyError, TypeError, OSError, zipfile.BadZipFile) as error:
        raise MeshError(f"{name} is damaged: {str(error).rstrip('.')}.") from error

    if header["error"] == "MemoryError":
        needed = f"more than {memory / 2**30:.1f} GiB to be read"
        raise MeshError(f"{name} needs {needed}: make the mesh coarser.")
    kinds: dict[str, type[AntioscError]] = {
        kind.__name__: kind for kind in (MissingDependencyError, PiecesError, UnmeshableError)
    }
    raise kinds.get(header["error"], MeshError)(header["message"])


def _printable(value: Any) -> Any:
    """A JSON value with escape characters in texts replaced, since names come from the file."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [_printable(item) for item in value]
    if isinstance(value, dict):
        return {printable(key): _printable(item) for key, item in value.items()}
    return value


#: A point, the size of the elements there [m], and the growth of sizes around it if it is given.
Refinement = tuple[Sequence[float], float] | tuple[Sequence[float], float, float]
#: Growth of sizes per distance from a refined point, and from how many smallest sizes on.
SIZE_GRADING = (0.35, 2.0)


def with_growth(place: Refinement, usual: float) -> tuple[Sequence[float], float, float]:
    """(point, size [m], growth) of a refined place; `usual`: growth if the place has none."""
    point, size, *growth = place
    return point, size, growth[0] if growth else usual


#: Elements around a full turn in a first and a second attempt: fewer of order 2 fold at fillets.
ELEMENTS_PER_TURN, RETRY_ELEMENTS_PER_TURN = 6.0, 12.0
#: Times as long as it may compute, a reader that waits may take: a busy machine lets it wait.
WAITING_FACTOR = 20.0
#: How the kernel ends a reader that takes too long.
TIMEOUT_SIGNALS = (signal.SIGALRM, signal.SIGPROF)
#: "unstated": what materials get that the deck does not state: density [kg/m³], modulus [Pa] (None:
#: nothing) and whether they may have no mass; "parts": names of parts, "piece": rank of a piece by
#: its size, None: all; "root": folder of included files, None: the reader chooses
ModelOptions = Json


@dataclass
class Request:
    """File and options for the reading process, which has a private working folder."""

    path: str  # of the file, absolute
    name: str  # of the file, for messages
    size: float | None = None  # largest element size in m; geometry only
    order: int | None = None  # geometric order, 1 or 2
    #: (point, element size there, m, and growth of sizes around it if given); geometry only
    refine: Sequence[Refinement] = ()
    #: usual growth of sizes per distance from these points, and from how many of their sizes on
    grading: Sequence[float] = SIZE_GRADING
    #: element sizes all over the geometry, as arguments of a `SizeField`; geometry only
    sizes: Json | None = None
    #: least number of elements around a full turn of curved surfaces; geometry only
    around: float = ELEMENTS_PER_TURN
    solid: bool = False  # fill a closed surface
    by_ftetwild: bool = False  # fill it by fTetWild, as gmsh cannot
    fragments: bool = False  # cut the solids of an assembly at each other, so that they share nodes
    #: rank in volume of the only solid that is meshed, 1: the largest; None: all solids
    piece: int | None = None
    outline: bool = False  # the box around a geometry and its groups alone, without a mesh
    trust: bool = False  # whether all commands of gmsh are permitted
    timeout: float | None = None  # time limit, s; None: processor time, chosen for the kind of file
    unit: Sequence[float] = (1.0, 1.0)  # units of the file: m, N
    #: options for reading a deck's materials, sections, supports and masses; None: not read
    model: ModelOptions | None = None
    memory: int = 2**33  # address space in bytes
    started: float = field(default_factory=time.monotonic)  # when the process began, s

    def limit_memory(self) -> None:
        """Limit the address space to `memory` bytes, and disable core files."""
        for resource_kind, most in ((resource.RLIMIT_AS, self.memory), (resource.RLIMIT_CORE, 0)):
            hard = resource.getrlimit(resource_kind)[1]
            most = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(resource_kind, (most, hard))

    def limit_time(self, seconds: float) -> None:
        """Let the kernel end this process after `seconds` of processor time, or at `timeout`."""
        for ending in TIMEOUT_SIGNALS:
            signal.signal(ending, signal.SIG_DFL)
        if self.timeout is None:
            signal.setitimer(signal.ITIMER_PROF, seconds)
            signal.setitimer(signal.ITIMER_REAL, WAITING_FACTOR * seconds)
        else:
            remaining = max(self.timeout - (time.monotonic() - self.started), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, remaining)

    def limit_output(self) -> None:
        """Limit each file written from now on to 1 MB, unless the input is trusted."""
        if not self.trust:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            with contextlib.suppress(ValueError):  # a lower limit is in force
                resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, 2**20))


class FileReader(NamedTuple):
    """A reader of one file type; packages register readers under `antiosc.readers`."""

    read: Callable[[Request], FileMesh]
    model: bool = False  # whether the files may contain whole models, for `read_model`
    #: whether a file that begins with these bytes is of this type; None: its ending decides
    matches: Callable[[bytes], bool] | None = None


Kind = TypeVar("Kind")
#: The package of decks in this distribution; registrations of other packages precede its own.
OWN_DECK_PACKAGE = "antiosc_decks."


def entry_points_of(group: str) -> tuple[metadata.EntryPoint, ...]:
    """Unloaded entry points of a group; entry points of other packages come first."""
    return _entry_points(group, tuple(filter(None, sys.path)))


@functools.lru_cache
def _entry_points(group: str, path: tuple[str, ...]) -> tuple[metadata.EntryPoint, ...]:
    """Unloaded entry points of `group` among the packages in the folders `path`."""
    from importlib import metadata  # its modules for mails take 16 ms of each start

    installed = (e for d in metadata.distributions(path=list(path)) for e in d.entry_points)
    entries = dict.fromkeys(entry for entry in installed if entry.group == group)
    return tuple(sorted(entries, key=lambda entry: entry.value.startswith(OWN_DECK_PACKAGE)))


def load_entry_point(entry: metadata.EntryPoint, kind: type[Kind]) -> Kind:
    """The object named by an entry point; MissingDependencyError unless it is a `kind`."""
    try:
        reader = entry.load()
    except AntioscError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
    else:
        if isinstance(reader, kind):
            return reader
        reason = f"it is a {type(reader).__name__}, not a {kind.__name__}"

    raise MissingDependencyError(
        f"{entry.value}, which a package registers as {entry.name!r} of {entry.group}, cannot be "
        f"used ({reason}): repair or uninstall the package."
    )


# --- Scripts ---
#
# A `.geo` file is a program. It can run system commands, read and write files, and execute programs
# named in fields, options and plugins (gmsh's `Gmsh.y`, `DefaultOptions.h`, `Field.cpp`; 4.8 to
# 4.15). None of that is needed to describe a part. Names can be composed at run time only by
# `StringToName`, which is refused too.

#: Comments, which gmsh does not get: gmsh runs the very text that is checked.
SCRIPT_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
#: Commands and fields that run programs, or read or write files.
REFUSED_COMMANDS = (
    *("System", "SystemCall", "NonBlockingSystemCall", "OnelabRun", "Plugin", "CreateDir"),
    *("Include", "Merge", "MergeWithBoundingBox", "Print", "Save", "SendToServer"),
    *("ShapeFromFile", "ListFromFile", "StringToName", "S2N"),
    *("ExternalProcess", "Structured", "ExternalField"),
)
#: Options that name files and programs, or commands to be executed later.
REFUSED_OPTIONS = (
    *(r"FileName\w*", r"File\d+", r"Command\w*", r"Executable\w*", "Interpreter", "Editor"),
    *(r"WatchFile\w*", r"RemoteLogin\d*", "SocketName", "SaveOptions", "SaveSession"),
    "Solver",
)
#: Anywhere in the text, also behind a digit or in a string: gmsh may begin a word there.
REFUSED_WORDS = re.compile(
    rf"(?:{'|'.join(REFUSED_COMMANDS + REFUSED_OPTIONS)})(?![A-Za-z_0-9])", re.ASCII
)
#: A geometry of CAD beside the script may be merged.
MERGE_COMMAND = re.compile(
    r'\bMerge\s*"(\w[\w\- .+=()]*\.(?:step|stp|brep|iges|igs))"\s*;', re.ASCII
)
#: `Printf("…") > "file"`: what is printed goes into a file.
PRINT_COMMAND = re.compile(r"Printf|Error|Warning")
FILE_OUTPUT = re.compile(r"[)\]]\s*>")


def checked_script(text: str, name: str) -> tuple[str, list[str]]:
    """(gmsh script without comments, names of its CAD files); MeshError unless it is harmless."""
    if "\0" in text:
        raise MeshError(f"{name} is binary and no script of gmsh: write it as .step or .inp.")

    text = SCRIPT_COMMENT.sub(lambda found: " " + "\n" * found[0].count("\n"), text)
    checked = MERGE_COMMAND.sub(lambda found: "\n" * found[0].count("\n"), text)
    refused = REFUSED_WORDS.search(checked)
    if refused is None and PRINT_COMMAND.search(checked):
        refused = FILE_OUTPUT.search(checked)
    if refused:
        line = checked.count("\n", 0, refused.start()) + 1
        raise MeshError(
            f"{name} is refused for line {line} ({' '.join(refused[0].split())}): a geometry may "
            "run no program, read no file but CAD beside it, and write none; if you know its"
            " writer, read it with trust (in Python alone)."
        )

    # gmsh 4.8 ignores a last line without a line end
    return text + "\n", MERGE_COMMAND.findall(text)
