"""The process that reads one file: `python child.py` with a JSON `Request` on standard input.

It writes the mesh, or the error of its reader, to its standard output as an archive of NumPy (npz),
never a pickle. If the file makes it crash, hang or use all memory, only this process ends.
"""

import ctypes
import io
import json
import os
import signal
import sys
import types
from pathlib import Path

#: Linux's number of the option that ends a process with its parent.
PR_SET_PDEATHSIG = 1


def main() -> None:
    """Read the request from standard input, and its file; write the response to standard output."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    request = json.load(sys.stdin)

    # what gmsh prints goes nowhere
    response = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)

    # an empty package around the readers: the real one would load all public names
    package = types.ModuleType("antiosc")
    package.__path__ = [str(Path(__file__).parents[1])]
    sys.modules["antiosc"] = package
    sys.path[:] = request.pop("sys_path")

    folder = request.pop("folder")
    os.chdir(folder)
    os.environ.update({"HOME": folder, "TMPDIR": folder})
    response.write(_read(request))
    response.flush()
    os._exit(0)  # without the finalizers, in which gmsh may crash


def _read(fields: "dict[str, object]") -> bytes:
    """Archive (npz) of the mesh of the requested file, or of the error that its reader raised."""
    import numpy as np

    from antiosc.base.errors import AntioscError
    from antiosc.io.isolation import Request
    from antiosc.io.mesh_files import reader_of
    from antiosc.io.neutral import packed

    request = Request(**fields)  # type: ignore[arg-type]
    request.limit_memory()
    request.limit_time(30 + 1e-5 * os.path.getsize(request.path))

    try:
        header, arrays = packed(reader_of(request.path, request.solid).read(request))
    except AntioscError as error:
        header, arrays = {"error": type(error).__name__, "message": str(error)}, []
    except MemoryError:
        header, arrays = {"error": "MemoryError", "message": ""}, []
    except Exception as error:
        reason = " ".join(str(error).replace(request.path, request.name).split())[:200].rstrip(".")
        message = (
            f"{request.name} cannot be read ({type(error).__name__}: "
            f"{reason or 'no reason given'}): "
            "it is cut off, or a variant of its format that is not supported; write it anew in the "
            "program that made it, or as .msh, .inp, .bdf or .med."
        )
        header, arrays = {"error": "MeshError", "message": message}, []

    archive = io.BytesIO()
    np.savez(archive, np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), *arrays)
    return archive.getvalue()


if __name__ == "__main__":
    main()
