"""The process that reads files: `python child.py`, requests on its standard input, line by line.

It loads gmsh once and reads each file in a fork of itself. If a file makes its reader crash, hang
or use all memory, only that fork ends. A response is a line of JSON and the bytes of arrays, never
a pickle. Lines {"progress": text} may precede it. The process ends when the process that sends the
requests ends.
"""

import contextlib
import importlib
import json
import os
import re
import select
import signal
import sys
import time
import types
from pathlib import Path

#: What gmsh prints of its work -> what is told of it, with the numbers in it.
PROGRESS = (
    (re.compile(rb"\[ *(\d+)%\] Meshing (?:curve|surface) \d+ order"), "middle nodes, {} of 100 %"),
    (re.compile(rb"\[ *(\d+)%\] Meshing curve"), "edges, {} of 100 %"),
    (re.compile(rb"\[ *(\d+)%\] Meshing surface"), "faces, {} of 100 %"),
    (re.compile(rb"Tetrahedrizing (\d+) nodes"), "volume between {} nodes of the faces"),
    (re.compile(rb"It\. \d+ - (\d+) nodes created"), "volume, {} nodes within it so far"),
    (re.compile(rb"Optimizing (?:mesh|volume)"), "improving the shape of cells"),
)
#: Seconds between two texts of progress.
EACH = 0.2


def main() -> None:
    """Answer requests until the input ends."""
    requests = sys.stdin.buffer
    answers = os.fdopen(os.dup(1), "wb")  # protected from what gmsh prints
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    _hollow_package(Path(__file__).parents[1])
    for line in requests:
        request = json.loads(line)
        sys.path[:] = request.pop("sys_path")
        code, response, seconds = _in_a_fork(request, nowhere, answers)
        header = {"code": code, "size": len(response), "seconds": seconds}
        answers.write(json.dumps(header).encode() + b"\n")
        answers.write(response)
        answers.flush()


def _hollow_package(folder: Path) -> None:
    """Make an empty package around the readers, since the real one would load all public names."""
    package = types.ModuleType("antiosc")
    package.__path__ = [str(folder)]
    sys.modules["antiosc"] = package


def _in_a_fork(request, nowhere, answers):  # type: ignore[no-untyped-def]
    """(exit code, response, processor time [s]) of a fork of this process that reads one file; its
    progress goes to `answers`.
    """
    from antiosc.io.table import reader_of

    with contextlib.suppress(Exception):  # the fork raises it again, and says it
        importlib.import_module(reader_of(request["path"], request.get("solid", False)).library)
    reading, writing = os.pipe()
    printed, printing = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            os.close(reading)
            os.dup2(nowhere, 0)
            os.dup2(printing, 1)
            with os.fdopen(writing, "wb") as answer:
                _work(request, answer)
            code = 0
        finally:
            os._exit(code)  # without the finalizers, in which gmsh may crash
    os.close(writing)
    os.close(printing)
    with os.fdopen(printed, "rb", buffering=0) as texts:
        answer = _answer_of(pid, reading, texts, answers)
    _, status, used = os.wait4(pid, 0)
    return os.waitstatus_to_exitcode(status), answer, used.ru_utime + used.ru_stime


def _answer_of(pid, reading, printed, answers):  # type: ignore[no-untyped-def]
    """The output of the fork; both processes end if the caller closes its end of the pipe. What
    the fork prints becomes lines of progress.
    """
    poll = select.poll()
    poll.register(reading, select.POLLIN)
    poll.register(printed, select.POLLIN)
    poll.register(0, 0)  # readable only if the other end is closed
    parts = []
    told = 0.0
    with os.fdopen(reading, "rb", buffering=0) as stream:
        while True:
            ready = dict(poll.poll())
            if 0 in ready:
                os.kill(pid, signal.SIGKILL)
                os._exit(1)
            if printed.fileno() in ready:
                text = printed.read(2**16)
                if not text:
                    poll.unregister(printed)
                about = progress_of(text)
                if about and time.monotonic() - told > EACH:
                    told = time.monotonic()
                    answers.write(json.dumps({"progress": about}).encode() + b"\n")
                    answers.flush()
            if reading in ready:
                part = stream.read(2**20)
                if not part:
                    return b"".join(parts)
                parts.append(part)


def progress_of(printed: bytes) -> str:
    """What is told of the last line of gmsh's output that tells its progress; "" of others."""
    for line in reversed(printed.splitlines()):
        for pattern, text in PROGRESS:
            found = pattern.search(line)
            if found:
                return text.format(*(number.decode() for number in found.groups()))
    return ""


def _work(request, answer):  # type: ignore[no-untyped-def]
    """Read one file in a private folder with limits, and write the response."""
    from antiosc.io.request import Request

    folder = request.pop("folder")
    os.chdir(folder)
    os.environ.update({"HOME": folder, "TMPDIR": folder})
    ask = Request(**request)
    ask.limit_memory()
    ask.allow(30 + 1e-5 * os.path.getsize(ask.path))
    header, arrays = _read(ask)
    header["arrays"] = [[str(a.dtype), list(a.shape)] for a in arrays]
    answer.write(json.dumps(header).encode() + b"\n")
    for array in arrays:
        answer.write(array.tobytes())


def _read(ask):  # type: ignore[no-untyped-def]
    """(head, arrays) of the mesh, or of the error that the reader raised."""
    from antiosc.base.errors import AntioscError
    from antiosc.io.neutral import packed
    from antiosc.io.table import reader_of

    try:
        return packed(reader_of(ask.path, ask.solid).read(ask))
    except AntioscError as error:
        return {"error": type(error).__name__, "message": str(error)}, []
    except MemoryError:
        return {"error": "MemoryError", "message": ""}, []
    except Exception as error:
        reason = " ".join(str(error).replace(ask.path, ask.name).split())[:200].rstrip(".")
        message = (
            f"{ask.name} cannot be read ({type(error).__name__}: {reason or 'no reason given'}): "
            "it is cut off, or a variant of its format that is not supported; write it anew in the "
            "program that made it, or as .msh, .inp, .bdf or .unv."
        )
        return {"error": "MeshError", "message": message}, []


if __name__ == "__main__":
    main()
