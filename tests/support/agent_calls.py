"""Calls of the tools of `antiosc mcp` by the client of the protocol's SDK."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from antiosc_app import agents_work
from antiosc_app.cli import main
from paths import MESHES
from scene_files import SCENES

anyio = pytest.importorskip("anyio")
Client = pytest.importorskip("mcp.client.client").Client
ToolServer = pytest.importorskip("antiosc_app.agents").ToolServer
StdioServerParameters = pytest.importorskip("mcp.client.stdio").StdioServerParameters

MASS = {"kind": "RigidMass", "mass": 0.05, "velocity": 1.0}
#: A mass on a beam of given matrices, which needs no meshes.
BEAM = {
    "matrices": {"K": "beam_K.mtx", "M": "beam_M.mtx", "map": "beam_nodes.txt"},
    "sites": {"middle": {"node": 9, "dof": "z"}},
    "extract": {"n": 6},
    "impactor": MASS,
    "contact": {"kind": "Hertz", "stiffness": 5e8},
    "simulate": {"duration": 2e-3},
}
#: A ball on the eye of the bracket.
BRACKET = {
    "geometry": {"source": "bracket.msh", "unit": "m", "order": 1},
    "structure": {"order": 1},
    "material": "aluminium 6061-T6",
    "supports": [{"where": "clamp"}],
    "sites": {
        "eye": {
            "point": [0.020, 0.040, 0.075],
            "direction": [-0.2, -0.6, -0.8],
            "radius": 9e-3,
            "snap": True,
        }
    },
    "extract": {"n": 12, "error": "estimate"},
    "impactor": {
        "kind": "Sphere",
        "radius": 0.01,
        "material": "bearing steel 100Cr6",
        "velocity": 2.0,
    },
    "simulate": {"duration": 1e-3},
}
START = "import sys; from antiosc_app.cli import main; sys.exit(main(['mcp', *sys.argv[1:]]))"
KEPT = (
    *("PATH", "PYTHONPATH", "OMP_NUM_THREADS", "XDG_CACHE_HOME", "OPENBLAS_CORETYPE", "TMPDIR"),
    "CFLAGS",
)
Work: TypeAlias = Callable[[Any], Awaitable[Any]]


def served(folder: Path, work: Work) -> Any:
    """What `work` returns of a client of a server that was started for a folder."""
    environment = {name: os.environ[name] for name in (*KEPT, "HOME") if name in os.environ}
    environment |= {name: x for name, x in os.environ.items() if name.startswith(("OMPI", "PRTE"))}
    # the working folder is that of the files: none of them may become a module
    started = StdioServerParameters(
        command=sys.executable,
        args=["-P", "-c", START, str(folder)],
        env=environment,
        cwd=folder,
    )
    return worked_on(started, work)


def served_here(folder: Path, work: Work, *options: str) -> Any:
    """The same of the server that `antiosc mcp` makes, in this process."""
    made: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONSAFEPATH", "1")  # as it is set by the command
        patch.setattr(ToolServer, "run", lambda server: made.append(server))
        assert main(["mcp", str(folder), *options]) == 0
        return worked_on(made[0], work)


def worked_on(server: Any, work: Work) -> Any:
    """What `work` returns of a client of a server."""

    async def run() -> Any:
        async with Client(server) as client:
            return await work(client)

    return anyio.run(run)


def one_by_one(calls: Sequence[tuple[str, dict[str, Any]]]) -> Work:
    """Calls one after the other."""

    async def work(client: Any) -> list[Any]:
        return [await client.call_tool(name, arguments) for name, arguments in calls]

    return work


def worked(folder: Path, calls: Sequence[tuple[str, dict[str, Any]]]) -> list[Any]:
    """The answers of calls by the function that a process of the server calls."""
    return [agents_work.answer(folder, *call)[0] for call in calls]


def told(result: Any) -> dict[str, Any]:
    """The structured answer of a call, which is no refusal."""
    answer: dict[str, Any] = result.structured_content
    assert not result.is_error, answer["text"]
    return answer


def number(answer: dict[str, Any], name: str) -> dict[str, Any]:
    """A number of an answer by its name."""
    return next(one for one in answer["quantities"] if one["name"] == name)


def filled(folder: Path) -> Path:
    """A folder with the matrices of the beam, and the bracket as mesh and as CAD file."""
    for source in (*SCENES.glob("beam_*"), *MESHES.glob("b*.msh"), MESHES / "bracket.step"):
        shutil.copy(source, folder)
    return folder.resolve()
