"""Reading processes of tests: forks of one that has loaded its packages, in place of new ones.

Each runs `antiosc.io.child` with all its limits, 0.2 s sooner. `python readers.py` is their parent.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import types
from pathlib import Path
from typing import Any

PACKAGES = ("antiosc.io.mesh_files", "antiosc_decks.readers", "meshio", "gmsh", "scipy.sparse")
#: Endings of surfaces of triangles, for which their parent loads more packages.
SURFACES = (".stl", ".obj", ".ply", ".off")
_lock = threading.Lock()
_parent: subprocess.Popen[bytes] | None = None


def ask(request: dict[str, Any]) -> tuple[int, bytes]:
    """(exit code, response) of a reading process; stands for `antiosc.io.isolation._run_reader`."""
    from antiosc.io.isolation import READER_ENVIRONMENT

    global _parent
    path = [os.path.abspath(p) for p in sys.path if p]
    environment = {name: os.environ[name] for name in READER_ENVIRONMENT if name in os.environ}
    environment |= {"LC_ALL": "C.UTF-8", "OPENBLAS_NUM_THREADS": "1"}
    with _lock, tempfile.TemporaryDirectory() as folder:
        Path(folder, "request").write_text(json.dumps({**request, "sys_path": path}))
        os.mkfifo(f"{folder}/response")  # a reader may write no large file
        if _parent is None:
            _parent = subprocess.Popen(
                [sys.executable, "-I", "-S", "-B", __file__, *path],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=0,
            )  # fmt: skip
        try:
            _parent.stdin.write(json.dumps([folder, environment]).encode() + b"\n")
            response = Path(folder, "response").read_bytes()
            return int(_parent.stdout.readline()), response
        except BaseException:  # its next answer would be that of this request
            end()
            raise


@atexit.register
def end() -> None:
    """End the parent of the reading processes, and with it those."""
    global _parent
    if _parent is not None:
        with _parent:
            _parent.kill()
        _parent = None


def serve(child: types.ModuleType) -> None:
    """Fork a reading process for each request, and say how it ended."""
    for line in sys.stdin:
        folder, environment = json.loads(line)
        if any(ending in Path(folder, "request").read_text() for ending in SURFACES):
            load("scipy.spatial", "trimesh")
        with open(f"{folder}/response", "wb") as response:
            pid = os.fork()
            if pid == 0:
                with contextlib.suppress(BaseException):
                    read(child, f"{folder}/request", response.fileno(), environment)
                os._exit(1)

        _, status = os.waitpid(pid, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # what the reader has started
        print(os.waitstatus_to_exitcode(status), flush=True)


def load(*packages: str) -> None:
    """Import those of the packages that are installed."""
    for name in packages:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def read(child: types.ModuleType, request: str, response: int, environment: dict[str, str]) -> None:
    """Read one file as a process of its own would."""
    os.setsid()
    os.environ.clear()
    os.environ.update(environment)
    os.dup2(response, 1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    os.chdir("/")
    with open(request) as sys.stdin:
        child.main()


if __name__ == "__main__":
    sys.path[:] = sys.argv[1:]
    from antiosc.io import child

    load(*PACKAGES)
    serve(child)
