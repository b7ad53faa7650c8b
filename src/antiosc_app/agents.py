"""`antiosc mcp`: a server of tools for an assistant (Model Context Protocol).

Each call runs in a process of its own.
"""

from __future__ import annotations

import inspect
import json
import multiprocessing
import os
import signal
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from antiosc.base import checks
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.base.packages import loading
from antiosc_app import info
from antiosc_app.agents_work import TOOLS, Refusal, Table, explain, run_call, sha256_of
from antiosc_app.scene_file.schema import KIND_KEY, SECTIONS, parameters_of

try:
    with loading():
        import anyio
        import mcp_types as types
        from anyio.to_thread import run_sync
        from jsonschema import Draft202012Validator
        from mcp.server.mcpserver import MCPServer
        from mcp.server.mcpserver.resources import FunctionResource
except ImportError as error:
    raise MissingDependencyError(
        f"`antiosc mcp` needs the package {error.name}: pip install 'antiosc[agents]'."
    ) from None

#: Calls at once, waiting calls, answers that `explain` knows, bytes of the arguments of a call.
CALLS_AT_ONCE, MAX_WAITING_CALLS, MAX_KEPT_ANSWERS, MAX_ARGUMENT_BYTES = 2, 16, 64, 1_000_000
#: Resources: pages of the documentation, and the schema of a scene with all keys.
RESOURCE_NAMES = ("glossary", "limits", "scene")
DOCS_FOLDER = Path(__file__).resolve().parents[2] / "docs"
DOCS_ADDRESS = "https://github.com/antiosc/antiosc/tree/main/docs"

INSTRUCTIONS = (
    "Impacts on structures, in SI units. Read a number with its bar [low, high] and the cautions;"
    " what was assumed has its key, and a refusal names the key to give and its choices."
)
SCENE_DESCRIPTION = (
    "The sections of a scene in SI units, or the path of a scene file (.toml), as"
    ' {"geometry": {"source": "part.step"}, "material": "steel S235", "supports": [{"plane":'
    ' [[0, 0, 0], [0, 0, 1]]}], "sites": {"tip": {"point": [0, 0, 0.1], "direction": [0, 0, -1],'
    ' "radius": "auto"}}, "extract": {"n": "auto", "error": "estimate"}, "impactor": {"kind":'
    ' "Sphere", "radius": 0.01, "material": "bearing steel 100Cr6", "velocity": 1.0}, "simulate":'
    ' {"duration": "auto"}}. All keys: the resource antiosc://scene.'
)
#: Argument of a tool -> its schema.
ARGUMENT_SCHEMAS: dict[str, Table] = {
    "scene": {
        "type": ["object", "string"],
        "description": SCENE_DESCRIPTION,
        "properties": {name: {"description": one.about} for name, one in SECTIONS.items()},
    },
    "file": {"type": "string", "description": "a path below the folder of this server"},
    "path": {"type": "string", "description": "a new file below the folder of this server"},
    "result": {"type": "string", "description": "the hash of an answer"},
    "quantity": {"type": "string", "description": "the name of a number of that answer"},
    "query": {"type": "string", "maxLength": 100},
    "unit": {"type": "string", "description": "of the file, as mm, in or m"},
    "piece": {"type": "integer", "minimum": 1},
    "pictures": {"type": "integer", "minimum": 0, "maximum": 8, "description": "1 by default"},
}


def input_schema(name: str) -> Table:
    """The JSON schema of a tool's arguments, read from the signature of its function."""
    known = inspect.signature(TOOLS[name][0]).parameters.values()
    given = [one for one in known if one.name in ARGUMENT_SCHEMAS]
    return {
        "type": "object",
        "properties": {one.name: ARGUMENT_SCHEMAS[one.name] for one in given},
        "required": [one.name for one in given if one.default is one.empty],
        "additionalProperties": False,
    }


def scene_schema() -> Table:
    """The JSON schema of a scene: its sections and their keys."""
    sections: Table = {}
    for name, section in SECTIONS.items():
        keys = dict.fromkeys(key for one in section.callables for key in parameters_of(one))
        table: Table = {"properties": {key: {} for key in keys if key not in section.given.split()}}
        if len(section.callables) > 1:
            table["properties"][KIND_KEY] = {"enum": list(section.callables)}
        key = {"named": "additionalProperties", "list": "items"}.get(section.form)
        sections[name] = {"description": section.about} | (table if key is None else {key: table})
    return {**ARGUMENT_SCHEMAS["scene"], "properties": sections}


def resource_text(name: str) -> str:
    """The text of the resource `name`, or the address of its page."""
    if name == "scene":
        return json.dumps(scene_schema(), indent=1)
    path = DOCS_FOLDER / f"{name}.md"
    return path.read_text(encoding="utf-8") if path.is_file() else f"{DOCS_ADDRESS}/{name}.md"


class ToolServer(MCPServer[Any]):
    """Server of the tools on one folder; a call takes at most `seconds` and `memory` bytes."""

    def __init__(self, folder: Path, seconds: float, memory: int) -> None:
        super().__init__("antiosc", version=info.antiosc_version(), instructions=INSTRUCTIONS)
        self.folder = folder
        self.seconds = seconds
        self.memory = memory
        self.slots = anyio.Semaphore(CALLS_AT_ONCE)
        self.known: dict[str, Table] = {}
        for name in RESOURCE_NAMES:
            text = partial(resource_text, name)
            self.add_resource(FunctionResource(uri=f"antiosc://{name}", name=name, fn=text))

    async def list_tools(self) -> list[types.Tool]:
        """The tools."""
        return [
            types.Tool(name=name, description=about, input_schema=input_schema(name))
            for name, (_, about) in TOOLS.items()
        ]

    async def call_tool(self, name: str, arguments: Table, context: Any = None) -> Any:
        """The answer of the tool `name` as text, data and pictures; refusals are answers, too."""
        try:
            told, pictures = await self._checked_and_answered(context, name, arguments)
        except Refusal as refusal:
            told, pictures = refusal.told, []

        inputs = sha256_of({"tool": name, "arguments": arguments})
        told = {"tool": name[:100], "version": info.antiosc_version(), "hash": inputs, **told}
        refused = told["status"] == "refused"
        if not refused:
            self.known = dict([*self.known.items(), (told["hash"], told)][-MAX_KEPT_ANSWERS:])
        text = types.TextContent(type="text", text=json.dumps(told, ensure_ascii=False))
        images = [types.ImageContent(type="image", data=x, mime_type="image/png") for x in pictures]
        return types.CallToolResult(
            content=[text, *images], structured_content=told, is_error=refused
        )

    async def _checked_and_answered(
        self, context: Any, name: str, arguments: Table
    ) -> tuple[Table, list[str]]:
        """(answer, pictures) of a call; raises Refusal if it breaks a rule of the server."""
        if name not in TOOLS:
            raise Refusal("tool", f"there is no tool {checks.shown(name)}.", choices=TOOLS)
        if len(json.dumps(arguments)) > MAX_ARGUMENT_BYTES:
            raise Refusal(
                "limit", f"the arguments exceed {MAX_ARGUMENT_BYTES} bytes: name a scene file."
            )
        for mistake in Draft202012Validator(input_schema(name)).iter_errors(arguments):
            rule = f"{mistake.validator}: {checks.shown(mistake.validator_value)}"
            raise Refusal("arguments", f"{mistake.json_path} of {name} breaks its rule {rule}.")
        if name == "explain":
            return explain(self.known, **arguments)

        if self.slots.statistics().tasks_waiting >= MAX_WAITING_CALLS:
            raise Refusal("busy", f"{MAX_WAITING_CALLS} calls wait already: call again later.")
        async with self.slots:
            with anyio.move_on_after(self.seconds):
                return await self._run_in_process(context, name, arguments)
        limit = f"{self.seconds:g} s: start antiosc mcp with --seconds"
        raise Refusal("time", f"the call took longer than {limit}.")

    async def _run_in_process(
        self, context: Any, name: str, arguments: Table
    ) -> tuple[Table, list[str]]:
        """(answer, pictures) of a call run in a new process, which is killed at the call's end."""
        spawn = multiprocessing.get_context("spawn")
        wire, other = spawn.Pipe()
        given = other, self.folder, self.memory, name, arguments
        process = spawn.Process(target=run_call, args=given, daemon=True)
        process.start()
        other.close()
        began = anyio.current_time()
        try:
            while isinstance(told := await run_sync(wire.recv, abandon_on_cancel=True), str):
                await context.report_progress(anyio.current_time() - began, None, told)
        except EOFError:
            limit = f"memory: {self.memory / 2**30:.3g} GB"
            raise Refusal("memory", f"the call ended, perhaps for want of {limit}.") from None
        finally:
            assert process.pid
            with suppress(ProcessLookupError):  # it, and what it started
                os.killpg(process.pid, signal.SIGKILL)
            process.kill()
        return told


def serve(folder: str, seconds: float, gigabytes: float) -> None:
    """Serve the tools on `folder` over the standard streams until they are closed."""
    root = checks.path("the folder", folder).resolve()
    if not root.is_dir():
        raise InputError(f"there is no folder {checks.shown(folder)}.")
    checks.positive("--seconds", seconds)
    memory = int(2**30 * checks.positive("--gigabytes", gigabytes))
    os.environ["PYTHONSAFEPATH"] = "1"  # no file of the working folder is a module of a call
    ToolServer(root, seconds, memory).run()
