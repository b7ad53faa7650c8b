"""Client of the reading process, which starts with the first file and ends with this process."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from antiosc.base.errors import MeshError
from antiosc.io import child

#: The only environment variables that the reading process gets.
ENVIRONMENT = ("PATH", "LD_LIBRARY_PATH", "OMP_NUM_THREADS")

_lock = threading.Lock()
_process: subprocess.Popen[bytes] | None = None
_owner = 0


def ask(request: dict[str, Any]) -> tuple[int, bytes]:
    """(exit code, answer) of the reader of one file; see `child`."""
    with _lock:
        process = _running()
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            # "" stands for the working folder, which holds no packages
            line = {**request, "sys_path": [os.path.abspath(p) for p in sys.path if p]}
            process.stdin.write(json.dumps(line).encode() + b"\n")
            process.stdin.flush()
            head = json.loads(process.stdout.readline())
            return int(head["code"]), process.stdout.read(head["size"])
        except (OSError, ValueError):  # it has ended
            _end()
            return process.returncode or -signal.SIGKILL, b""
        except BaseException:  # such as Ctrl-C: the answer is not needed any more
            _end()
            raise


def _running() -> subprocess.Popen[bytes]:
    """The reading process of this process; a fork starts its own."""
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
    """End the reading process and its forks."""
    global _process
    process, _process = _process, None
    if process is None or _owner != os.getpid():
        return
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()
    process.wait()
