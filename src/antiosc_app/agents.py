"""`antiosc mcp`: tools for an assistant, by the Model Context Protocol over standard streams.

Each call runs in a process of its own (`agents_work`), so that its cancellation and its limits of
time and memory are real.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path
from subprocess import PIPE
from typing import Any

from antiosc.base import checks
from antiosc.base.errors import InputError, MissingDependencyError
from antiosc.base.process import loading
from antiosc_app import info
from antiosc_app.agents_work import TOOLS, Table, hash_of, refused
from antiosc_app.scene_file.schema import KIND, SECTIONS, parameters

try:
    with loading():
        import anyio
        import mcp_types as types
        from anyio.streams.buffered import BufferedByteReceiveStream
        from jsonschema import Draft202012Validator
        from mcp.server.lowlevel import Server
        from mcp.server.stdio import stdio_server
except ImportError as error:
    raise MissingDependencyError(
        f"`antiosc mcp` needs the package {error.name}: pip install 'antiosc[agents]'."
    ) from None

#: Calls that run at once, calls that may wait, and answers that `explain` knows.
AT_ONCE, WAITING, KNOWN = 2, 16, 64
#: Largest arguments of a call, and largest answer [bytes].
LARGEST, LARGEST_ANSWER = 1_000_000, 2**26
#: Resources: pages of the documentation, and the schema of scenes.
DOCS = Path(__file__).resolve().parents[2] / "docs"
ELSEWHERE = "https://github.com/antiosc/antiosc/tree/main/docs"
RESOURCES = {
    "glossary": "What the terms mean",
    "limits": "What the numbers leave out, and sizes",
    "scene": "JSON schema of a scene, with all keys",
}

INSTRUCTIONS = (
    "Impacts on structures, in SI units. An answer has text, quantities (value, unit, bar [low,"
    " high] and its causes), cautions, and what was assumed, each with its key. Read a number with"
    " its bar and the cautions; a refusal names the key to give and its choices."
)
#: Tool -> its arguments, and what it does.
ABOUT = {
    "look": ("file unit piece", "Look at a part (mesh, CAD, deck): pieces, faces with the support"
        " that fixes each, size, guessed unit, a draft of a scene, and a picture."),
    "materials": ("query", "Materials whose name contains the query: constants and sources."),
    "check": ("scene", "Look for mistakes in a scene, without meshing."),
    "strike": ("scene pictures", "Compute the impact of a scene."),
    "drop": ("scene pictures", "Compute the fall of a part: a scene with the section drop."),
    "map": ("scene pictures", "Compute an impact at many points: a scene with the section map."),
    "sweep": ("scene pictures", "Compute an impact for several values: the section sweep."),
    "tradeoff": ("scene pictures", "Error against seconds and memory of an impact."),
    "report": ("scene path pictures", "Compute a scene and write its report, a new .html file."),
    "explain": ("result quantity", "The causes of a number's bar, and what narrows each."),
}  # fmt: skip
#: Argument of a tool -> its schema, and those that may be left out.
ARGUMENTS: dict[str, Table] = {
    "file": {"type": "string", "description": "a path below the folder of this server"},
    "path": {"type": "string", "description": "a new file below the folder of this server"},
    "result": {"type": "string", "description": "the hash of an answer"},
    "quantity": {"type": "string", "description": "the name of a number of that answer"},
    "query": {"type": "string", "maxLength": 100},
    "unit": {"type": "string", "description": "of the file, as mm, in or m"},
    "piece": {"type": "integer", "minimum": 1},
    "pictures": {"type": "integer", "minimum": 0, "maximum": 8, "description": "1 by default"},
}
OPTIONAL = {"query", "unit", "piece", "pictures"}
SCENE = (
    "The sections of a scene in SI units, or the path of a scene file (.toml). An impact is"
    ' {"geometry": {"source": "part.step"}, "material": "steel S235", "supports": [{"plane":'
    ' [[0, 0, 0], [0, 0, 1]]}], "sites": {"tip": {"point": [0, 0, 0.1], "direction": [0, 0, -1],'
    ' "radius": "auto"}}, "extract": {"n": "auto", "error": "estimate"}, "impactor": {"kind":'
    ' "Sphere", "radius": 0.01, "material": "bearing steel 100Cr6", "velocity": 1.0}, "simulate":'
    ' {"duration": "auto"}}. Keys of all sections: the resource antiosc://scene.'
)


# -- schemas


def scene_schema(whole: bool) -> Table:
    """The JSON schema of a scene: its sections, and their keys if it is the `whole` one."""
    sections: Table = {name: {"description": one.about} for name, one in SECTIONS.items()}
    for name, section in SECTIONS.items() if whole else ():
        keys = dict.fromkeys(key for one in section.makes for key in parameters(one))
        table: Table = {"properties": {key: {} for key in keys if key not in section.given.split()}}
        if len(section.makes) > 1:
            table["properties"][KIND] = {"enum": list(section.makes)}
        key = {"named": "additionalProperties", "list": "items"}.get(section.form)
        sections[name] |= table if key is None else {key: table}
    return {"type": ["object", "string"], "description": SCENE, "properties": sections}


def input_schema(name: str) -> Table:
    """The JSON schema of the arguments of a tool."""
    known = {**ARGUMENTS, "scene": scene_schema(whole=False)}
    names = ABOUT[name][0].split()
    return {
        "type": "object",
        "properties": {key: known[key] for key in names},
        "required": [key for key in names if key not in OPTIONAL],
        "additionalProperties": False,
    }


# -- the server


class Tools:
    """The tools of one folder; a call takes at most `seconds` and `memory` bytes."""

    def __init__(self, folder: Path, seconds: float, memory: int) -> None:
        self.folder = folder
        self.seconds = seconds
        self.memory = memory
        self.waiting = 0
        self.slots = anyio.Semaphore(AT_ONCE)
        self.known: OrderedDict[str, Table] = OrderedDict()

    async def listed(self, _context: Any, _params: Any) -> types.ListToolsResult:
        """The tools."""
        tools = [
            types.Tool(name=name, description=about, input_schema=input_schema(name))
            for name, (_, about) in ABOUT.items()
        ]
        return types.ListToolsResult(tools=tools)

    async def called(self, context: Any, params: Any) -> types.CallToolResult:
        """The answer of a tool."""
        name, arguments = params.name, params.arguments or {}
        told, pictures = await self._answered(context, name, arguments)
        inputs = hash_of({"tool": name, "arguments": arguments})
        told = {"tool": name[:100], "version": info.version(), "hash": inputs, **told}
        if name in TOOLS:
            self.known[told["hash"]] = told
        while len(self.known) > KNOWN:
            self.known.popitem(last=False)
        text = types.TextContent(type="text", text=json.dumps(told, ensure_ascii=False))
        images = [types.ImageContent(type="image", data=x, mime_type="image/png") for x in pictures]
        return types.CallToolResult(
            content=[text, *images],
            structured_content=told,
            is_error=told["status"] == "refused",
        )

    async def _answered(self, context: Any, name: str, arguments: Table) -> tuple[Table, list[str]]:
        """Answer of a call and its pictures; a refusal of one that breaks a rule of the server."""
        if name not in ABOUT:
            sentence = f"there is no tool {checks.shown(name)}."
            return refused(sentence, kind="tool", choices=list(ABOUT)), []
        if len(json.dumps(arguments)) > LARGEST:
            sentence = f"the arguments are longer than {LARGEST} bytes: name a scene file."
            return refused(sentence, kind="limit"), []
        for mistake in Draft202012Validator(input_schema(name)).iter_errors(arguments):
            sentence = f"{mistake.json_path} of {name} breaks its rule {mistake.validator}: "
            sentence += checks.shown(mistake.validator_value)
            return refused(f"{sentence}.", kind="arguments"), []
        if name == "explain":
            return self._explained(**arguments), []
        if self.waiting >= AT_ONCE + WAITING:
            return refused(f"{WAITING} calls wait already: call again later.", kind="busy"), []

        self.waiting += 1
        try:
            async with self.slots:
                with anyio.move_on_after(self.seconds):
                    return await self._worked(context, name, arguments)
        finally:
            self.waiting -= 1
        sentence = (
            f"the call took longer than {self.seconds:g} s: start antiosc mcp with --seconds."
        )
        return refused(sentence, kind="time"), []

    async def _worked(self, context: Any, name: str, arguments: Table) -> tuple[Table, list[str]]:
        """The answer of a process, whose progress is reported; the process ends with the call."""
        # -P: no file of the working folder is a module
        command = [sys.executable, "-P", "-m", "antiosc_app.agents_work"]
        env = {**os.environ, "ANTIOSC_FOLDER": str(self.folder)}
        process = await anyio.open_process(
            command, stdin=PIPE, stdout=PIPE, stderr=None, env=env, start_new_session=True
        )
        began = anyio.current_time()
        request = {"tool": name, "arguments": arguments, "folder": str(self.folder)}
        try:
            assert process.stdin
            assert process.stdout
            await process.stdin.send(f"{json.dumps(request | {'memory': self.memory})}\n".encode())
            lines = BufferedByteReceiveStream(process.stdout)
            while True:
                line = json.loads(await lines.receive_until(b"\n", LARGEST_ANSWER))
                if "answer" in line:
                    return line["answer"], line["pictures"]
                seconds = anyio.current_time() - began
                await context.session.report_progress(seconds, None, line["doing"])
        except (anyio.EndOfStream, anyio.IncompleteRead, anyio.DelimiterNotFound):
            limit = f"{self.memory / 2**30:.3g} GB"
            sentence = f"the call ended without an answer, perhaps for want of memory ({limit})."
            return refused(sentence, kind="memory"), []
        finally:
            with anyio.CancelScope(shield=True), suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
                await process.aclose()

    def _explained(self, result: str, quantity: str) -> Table:
        """The causes of the bar of a number of an answer that was given."""
        answer = self.known.get(result)
        if answer is None:
            sentence = "no answer with this hash was given."
            return refused(sentence, kind="result", key="result", choices=list(self.known))
        found = [one for one in answer["quantities"] if one["name"] == quantity]
        if not found:
            names = list(dict.fromkeys(one["name"] for one in answer["quantities"]))
            sentence = f"the answer has no number {checks.shown(quantity)}."
            return refused(sentence, kind="quantity", key="quantity", choices=names)
        told = [
            f"{one['cause']}: -{one['below']:.2g} / +{one['above']:.2g}; {one['narrowed_by']}."
            for entry in found
            for one in entry["causes"]
        ]
        text = "\n".join(told or [str(found[0]["bar"])])
        return {"status": "completed", "text": text, "quantities": found, "of": result}

    # -- resources

    async def resources(self, _context: Any, _params: Any) -> types.ListResourcesResult:
        """The pages, and the schema of scenes."""
        resources = [
            types.Resource(uri=f"antiosc://{name}", name=name, description=about)
            for name, about in RESOURCES.items()
        ]
        return types.ListResourcesResult(resources=resources)

    async def read(self, _context: Any, params: Any) -> types.ReadResourceResult:
        """One resource."""
        name = str(params.uri).removeprefix("antiosc://").rstrip("/")
        if name not in RESOURCES:
            raise InputError(f"there is no resource {checks.shown(name)}.")

        page = DOCS / f"{name}.md"
        if name == "scene":
            text = json.dumps(scene_schema(whole=True), indent=1)
        else:
            text = page.read_text(encoding="utf-8") if page.is_file() else f"{ELSEWHERE}/{name}.md"
        contents = types.TextResourceContents(uri=str(params.uri), text=text)
        return types.ReadResourceResult(contents=[contents])


def serve(folder: str, seconds: float, gigabytes: float) -> None:
    """Answer calls on the standard streams until they are closed."""
    root = checks.path("the folder", folder).resolve()
    if not root.is_dir():
        raise InputError(f"there is no folder {checks.shown(folder)}.")
    checks.positive("--seconds", seconds)
    memory = int(2**30 * checks.positive("--gigabytes", gigabytes))

    async def run() -> None:
        tools = Tools(root, seconds, memory)
        server: Server[Any] = Server(
            "antiosc",
            version=info.version(),
            instructions=INSTRUCTIONS,
            on_list_tools=tools.listed,
            on_call_tool=tools.called,
            on_list_resources=tools.resources,
            on_read_resource=tools.read,
        )
        async with stdio_server() as streams:
            await server.run(*streams, server.create_initialization_options())

    anyio.run(run)
