"""The tools of `antiosc mcp`, called by the client of the SDK over standard streams."""

from __future__ import annotations

import base64
import json
from functools import partial
from pathlib import Path

import pytest

from agent_calls import (
    BEAM,
    BRACKET,
    MASS,
    anyio,
    filled,
    number,
    served,
    served_here,
    told,
    worked,
)
from antiosc_app import agents, agents_work, info

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::antiosc.AntioscWarning"),
]

TOOLS = ["check", "drop", "explain", "look", "map", "materials", "report", "strike", "sweep"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return filled(tmp_path_factory.mktemp("agents"))


def test_tools_and_resources_are_listed(folder):
    async def work(client):
        tools = (await client.list_tools()).tools
        resources = (await client.list_resources()).resources
        pages = [(await client.read_resource(one.uri)).contents[0].text for one in resources]
        return tools, dict(zip([one.name for one in resources], pages, strict=True))

    tools, pages = served_here(folder, work)
    assert sorted(tool.name for tool in tools) == [*TOOLS, "tradeoff"]
    assert all(tool.input_schema["type"] == "object" and tool.description for tool in tools)
    if agents.DOCS_FOLDER.is_dir():
        assert pages["glossary"].startswith("# Glossary")
        assert "## Sizes" in pages["limits"]
    else:  # a wheel has no pages
        assert pages["glossary"] == f"{agents.DOCS_ADDRESS}/glossary.md"
    schema = json.loads(pages["scene"])["properties"]
    assert "Sphere" in schema["impactor"]["properties"]["kind"]["enum"]
    assert {"point", "direction", "radius"} <= set(
        schema["sites"]["additionalProperties"]["properties"]
    )


def test_strikes_at_once_are_the_same_each_time_and_another_scene_has_another_hash(folder):
    softer = {**BEAM, "contact": {"kind": "Hertz", "stiffness": 4e8}}

    async def work(client):
        found = {}

        async def call(k, scene):
            found[k] = told(await client.call_tool("strike", {"scene": scene}))

        async with anyio.create_task_group() as group:
            for k, scene in enumerate((BEAM, BEAM, softer)):
                group.start_soon(call, k, scene)
        return [found[k] for k in range(3)]

    first, again, other = served_here(folder, work)
    assert first == again
    assert first["status"] == "completed"
    assert first["version"] == info.antiosc_version()
    assert len({first["hash"], other["hash"]}) == 2
    assert number(other, "peak_force")["value"] < number(first, "peak_force")["value"]
    for one in first["quantities"]:
        assert isinstance(one["bar"], list) or one["bar"].startswith("none: ")
    assert {"key": "extract.damping", "value": None, "by": "default"} in first["assumed"]


def test_the_hash_is_also_that_of_the_files(folder, tmp_path):
    filled(tmp_path)
    here, same = (hash_in(one) for one in (folder, tmp_path.resolve()))
    with (tmp_path / "beam_M.mtx").open("a") as stream:
        stream.write("\n")
    assert here == same != hash_in(tmp_path.resolve())


def hash_in(folder: Path) -> str:
    """The hash of a check of the beam."""
    return worked(folder, [("check", {"scene": BEAM})])[0]["hash"]


@pytest.mark.fem
def test_a_number_has_its_bar_by_cause_and_each_is_explained(folder):
    async def work(client):
        called = await client.call_tool("strike", {"scene": BRACKET, "pictures": 2})
        answer = told(called)
        asked = {"result": answer["hash"], "quantity": "peak_force"}
        return answer, told(await client.call_tool("explain", asked)), called.content

    answer, why, contents = served_here(folder, work)
    force = number(answer, "peak_force")
    low, high = force["bar"]
    assert 0 < low < force["value"] < high
    below = sum(cause["below"] for cause in force["causes"])
    assert below == pytest.approx(force["value"] - low, rel=1e-9)
    assert {cause["cause"] for cause in force["causes"]} >= {"mesh", "truncation", "law"}
    assert all(cause["narrowed_by"] in why["text"] for cause in force["causes"])
    assert answer["cards"][1]["text"].split(" ±")[0] in answer["text"]
    assert any(one["key"] == "simulate.gravity" for one in answer["assumed"])
    images = [content for content in contents if content.type == "image"]
    assert len(images) == 2
    for image in images:
        assert image.mime_type == "image/png"
        assert base64.b64decode(image.data).startswith(b"\x89PNG\r\n\x1a\n")


@pytest.mark.fem
def test_a_part_is_looked_at_and_its_draft_runs_once_it_is_decided(folder):
    part, pictures = agents_work.answer(folder, "look", {"file": "bracket.step"})
    assert pictures
    assert number(part, "size x")["value"] == pytest.approx(0.08, rel=0.2)
    assert part["give"] == ["material", "supports"]
    below = next(face["support"] for face in part["faces"] if face["at"] == "z = 0 mm")
    decided = {**part["draft"], "material": "aluminium 6061-T6", "supports": [below]}
    refused, fine = worked(folder, [("check", {"scene": one}) for one in (part["draft"], decided)])
    assert refused["refusal"]["key"] == "material"
    assert "antiosc run" in fine["text"]


BLOCK = """SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 0.06, 0.04, 0.02};
Physical Volume("block") = {1}; Physical Surface("below") = {5};
"""
#: A mass on the tip of a round bar of steel.
BAR = {
    "geometry": {"source": "beam.msh", "unit": "m"},
    "material": {"name": "steel S235", "section": {"kind": "Section.circle", "d": 0.02}},
    "supports": [{"where": "left"}],
    "sites": {"tip": {"point": [1.0, 0.0, 0.0], "direction": [0, 0, -1]}},
    "extract": {"n": 10, "error": "estimate"},
    "impactor": MASS,
    "contact": {"kind": "Hertz", "stiffness": 5e8},
    "simulate": {"duration": 5e-4},
}


@pytest.mark.fem
def test_a_fall_a_map_and_a_tradeoff_are_told_with_bars_or_reasons(folder):
    (folder / "block.geo").write_text(BLOCK)
    geometry = {"source": "block.geo", "unit": "m", "size": 0.02}
    part = {"geometry": geometry, "material": "aluminium 6061-T6"}
    drop = {"height": 0.3, "tilt": [10, 5, 0], "until": 1, "floor": {"material": "concrete C30/37"}}
    surface = {**part, "supports": [{"where": "below"}], "impactor": BRACKET["impactor"]}
    surface["map"] = {"duration": 1e-3, "most_sites": 3, "n": 4, "radius": 5e-3}
    calls = [
        ("drop", {"scene": {**part, "drop": drop}, "pictures": 0}),
        ("report", {"scene": surface, "path": "map.html"}),
        ("tradeoff", {"scene": BAR, "pictures": 0}),
    ]
    fall, page, compared = worked(folder, calls)
    for answer in (fall, page, compared):
        assert answer["quantities"]
        for one in answer["quantities"]:
            assert isinstance(one["bar"], list) or one["bar"].startswith("none: ")
    assert page["written"] == "map.html"
    assert "<html" in (folder / "map.html").read_text(encoding="utf-8")
    assert isinstance(number(compared, "peak_force")["bar"], list)


@pytest.mark.fem
def test_progress_is_told_and_a_cancelled_call_ends_its_process(folder):
    """The sites of this map would take minutes."""
    scene = {**BRACKET, "map": {"duration": 1e-2, "most_sites": 3000, "n": 60}}
    del scene["sites"], scene["extract"], scene["simulate"]

    async def work(client):
        told_texts = []
        running = anyio.Event()

        async def progress(_done, _total, text):
            told_texts.append(text)
            if len(told_texts) > 3:
                running.set()

        async with anyio.create_task_group() as group:
            call = partial(client.call_tool, progress_callback=progress)
            group.start_soon(call, "map", {"scene": scene})
            with anyio.fail_after(120):
                await running.wait()
            assert workers(folder)
            group.cancel_scope.cancel()
        with anyio.CancelScope(shield=True), anyio.fail_after(20):
            while workers(folder):
                await anyio.sleep(0.1)
            return told_texts, await client.call_tool("materials", {"query": "S235"})

    texts, after = served(folder, work)
    assert any(texts)
    told(after)


def workers(folder: Path) -> list[int]:
    """The processes of calls to a server that was started in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            of_call = b"spawn_main" in (process / "cmdline").read_bytes()
            if of_call and (process / "cwd").readlink() == folder:
                found.append(int(process.name))
        except OSError:  # it has ended
            continue
    return found
