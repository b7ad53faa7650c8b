"""The process that reads files: `python child.py`, requests on its standard input, line by line.

It loads gmsh once and reads each file in a fork of itself, so that what a file makes its reader do,
be it to crash, to hang or to take all memory, ends that fork alone. An answer is a line of JSON and
the bytes of arrays, never a pickle. The process ends when the one that asks does.
"""

import contextlib
import importlib
import json
import os
import select
import signal
import sys
import types
from pathlib import Path


def main() -> None:
    """Answer requests until there are no more."""
    requests = sys.stdin.buffer
    answers = os.fdopen(os.dup(1), "wb")  # for nobody else: what gmsh prints is no answer
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    _hollow_packages(Path(__file__).parents[2])
    for line in requests:
        asked = json.loads(line)
        sys.path[:] = asked.pop("sys_path")
        code, answer = _in_a_fork(asked, nowhere)
        answers.write(json.dumps({"code": code, "size": len(answer)}).encode() + b"\n")
        answers.write(answer)
        answers.flush()


def _hollow_packages(folder: Path) -> None:
    """The packages that readers lie in, without what they import: dolfinx and SciPy take long."""
    for name in ("antiosc", "antiosc.fem", "antiosc.fem.readers"):
        package = types.ModuleType(name)
        package.__path__ = [str(folder.joinpath(*name.split(".")[1:]))]
        sys.modules[name] = package


def _in_a_fork(asked, nowhere):  # type: ignore[no-untyped-def]
    """(exit code, answer) of a fork of this process that reads one file."""
    from antiosc.fem.readers.table import library_of

    with contextlib.suppress(ImportError):  # its absence is told by the reader
        importlib.import_module(library_of(asked["path"]))
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            os.close(reading)
            os.dup2(nowhere, 0)
            with os.fdopen(writing, "wb") as answer:
                _work(asked, answer)
            code = 0
        finally:
            os._exit(code)  # no cleaning up, in which gmsh may die
    os.close(writing)
    answer = _answer_of(pid, reading)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), answer


def _answer_of(pid: int, reading: int) -> bytes:
    """All that the fork writes; it is ended, and so is this process, if nobody waits any more."""
    poll = select.poll()
    poll.register(reading, select.POLLIN)
    poll.register(0, 0)  # tells only that the other end is closed
    parts: list[bytes] = []
    with os.fdopen(reading, "rb", buffering=0) as stream:
        while True:
            ready = dict(poll.poll())
            if 0 in ready:
                os.kill(pid, signal.SIGKILL)
                os._exit(1)
            part = stream.read(2**20)
            if not part:
                return b"".join(parts)
            parts.append(part)


def _work(asked, answer):  # type: ignore[no-untyped-def]
    """Read one file as asked, in a folder and with limits of its own, and write the answer."""
    from antiosc.fem.readers.request import Request

    folder = asked.pop("folder")
    os.chdir(folder)
    os.environ.update({"HOME": folder, "TMPDIR": folder})
    ask = Request(**asked)
    ask.limit_memory()
    ask.allow(30 + 1e-5 * os.path.getsize(ask.path))
    head, arrays = _read(ask)
    head["arrays"] = [[str(a.dtype), list(a.shape)] for a in arrays]
    answer.write(json.dumps(head).encode() + b"\n")
    for array in arrays:
        answer.write(array.tobytes())


def _read(ask):  # type: ignore[no-untyped-def]
    """(head, arrays) of the mesh, or of the error that the reader raised."""
    from antiosc.errors import AntioscError
    from antiosc.fem.readers.neutral import packed
    from antiosc.fem.readers.table import reader_of

    try:
        return packed(reader_of(ask.path)(ask))
    except AntioscError as error:
        return {"error": type(error).__name__, "message": str(error)}, []
    except MemoryError:
        return {"error": "MemoryError", "message": ""}, []
    except Exception as error:
        said = " ".join(str(error).replace(ask.path, ask.name).split())[:200].rstrip(".")
        message = f"{ask.name} cannot be read ({type(error).__name__}): {said or 'it is damaged'}."
        return {"error": "MeshError", "message": message}, []


if __name__ == "__main__":
    main()
