"""Hostile calls: each is refused in one sentence with a hash, and nothing runs or leaks."""

from __future__ import annotations

import os
from typing import Any

import pytest

from agent_calls import (
    BEAM,
    BRACKET,
    MASS,
    anyio,
    filled,
    one_by_one,
    served,
    served_here,
    told,
    worked,
)
from antiosc_app import agents

pytestmark = pytest.mark.slow

#: Writes beside itself when it is imported or run.
EVIL = 'open("ran", "w").write("it ran")\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with links out of it, a module of the name of a library, and a harmful script."""
    outer = tmp_path_factory.mktemp("outer")
    (outer / "secret.toml").write_text('title = "secret"\n')
    (outer / "secret.inp").write_text("*NODE\n1, 0, 0, 0\n")
    inner = outer / "served"
    inner.mkdir()
    filled(inner)
    for name in ("json.py", "numpy.py", "antiosc.py"):
        (inner / name).write_text(EVIL)
    (inner / "link.toml").symlink_to(outer / "secret.toml")
    (inner / "out").symlink_to(outer)
    (inner / "loop").symlink_to(inner / "loop")
    (inner / "deck.inp").write_text("*INCLUDE, INPUT=../secret.inp\n*NODE\n1, 0, 0, 0\n")
    (inner / "run.geo").write_text('SystemCall "touch ran";\nPoint(1) = {0, 0, 0};\n')
    os.mkfifo(inner / "pipe.toml")
    return inner


def beam(**changes: Any) -> tuple[str, dict[str, Any]]:
    """A call with a changed scene of the beam."""
    return "strike", {"scene": {**BEAM, **changes}}


def bracket(**changes: Any) -> tuple[str, dict[str, Any]]:
    """A call with a changed scene of the bracket."""
    return "check", {"scene": {**BRACKET, **changes}}


DEEP: Any = {}
for _ in range(60):
    DEEP = {"a": DEEP}
#: Call that a process refuses -> a part of its refusal.
CALLS = [
    (("strike", {"scene": "../secret.toml"}), "outside"),
    (("strike", {"scene": "/etc/passwd"}), "outside"),
    (("strike", {"scene": "out/secret.toml"}), "outside"),
    (("strike", {"scene": "loop"}), "no path"),
    (("strike", {"scene": "a\0b.toml"}), "no path"),
    (("strike", {"scene": "x" * 5000}), "no path"),
    (("strike", {"scene": "pipe.toml"}), "regular file"),
    (("strike", {"scene": "missing.toml"}), "No such file"),
    (("look", {"file": "../secret.inp"}), "outside"),
    (("look", {"file": "missing.step"}), "no file"),
    (("look", {"file": "deck.inp"}), "deck.inp"),
    (("look", {"file": "run.geo"}), "SystemCall"),
    (("look", {"file": "bracket.msh", "unit": "furlong"}), "unit"),
    (("report", {"scene": BEAM, "path": "../a.html"}), "outside"),
    (("report", {"scene": BEAM, "path": "bracket.msh"}), "exists already"),
    (("report", {"scene": BEAM, "path": "a.py"}), ".html"),
    (("report", {"scene": BEAM, "path": "out/a.html"}), "outside"),
    (beam(impactor={**MASS, "velocity": float("nan")}), "impactor.velocity"),
    (beam(impactor={**MASS, "mass": -1.0}), "mass"),
    (beam(impactor={**MASS, "mass": 10**400}), "large"),
    (beam(matrices={**BEAM["matrices"], "K": "/etc/passwd"}), "outside"),
    (beam(matrices={**BEAM["matrices"], "K": "out/secret.toml"}), "outside"),
    (beam(sites={"a\nb": {"node": 9}}), "control character"),
    (beam(simulate={"duration": 1e-3, "comm": 1}), "comm"),
    (beam(nonsense={}), "nonsense"),
    (bracket(geometry={"source": "bracket.msh"}), "unit"),
    (bracket(geometry={"source": "run.geo", "unit": "m", "trust": True}), "trust"),
    (bracket(material="unobtainium"), "material"),
    (("materials", {"query": "unobtainium"}), "no material"),
]
#: The same of calls to the server; the first of them reaches its process.
SERVED = [
    (("strike", {"scene": "link.toml"}), "outside"),
    (("look", {"file": 7}), "$.file"),
    (("look", {"file": "bracket.msh", "trust": True}), "additionalProperties"),
    (("rm -rf", {}), "no tool"),
    (("strike", {}), "required"),
    (("strike", {"scene": []}), "$.scene"),
    (("strike", {"scene": BEAM, "pictures": 10**9}), "maximum"),
    (("strike", {"scene": {"title": "x" * 2_000_000}}), "bytes"),
    (("strike", {"scene": DEEP}), "deep"),
    (("explain", {"result": "0" * 64, "quantity": "peak_force"}), "hash"),
]


def test_hostile_calls_are_refused_in_one_sentence(folder):
    told_answers = worked(folder, [call for call, _ in CALLS])
    results = served(folder, one_by_one([call for call, _ in SERVED]))
    assert all(result.is_error for result in results)
    told_answers += [result.structured_content for result in results]

    for (call, part), answer in zip(CALLS + SERVED, told_answers, strict=True):
        assert answer["status"] == "refused"
        assert len(answer["hash"]) == 64
        assert part in answer["text"], (call, answer["text"])
        assert "\n" not in answer["text"]
        assert len(answer["text"]) < 1000
        assert "secret" not in answer["text"].replace("secret.toml", "").replace("secret.inp", "")
    assert not (folder / "ran").exists()
    assert not (folder / "a.html").exists()


@pytest.mark.fem
def test_what_decides_is_refused_with_its_choices(folder):
    def without(*names: str) -> tuple[str, Any]:
        return "strike", {"scene": {key: x for key, x in BRACKET.items() if key not in names}}

    calls = [without("material", "supports"), without("supports")]
    calls.append(bracket(geometry={"source": "bracket.msh"}))
    told_refusals = [answer["refusal"] for answer in worked(folder, calls)]
    assert [one["kind"] for one in told_refusals] == ["material", "support", "unit"]
    assert [one["key"] for one in told_refusals] == ["material", "supports", "geometry.unit"]
    assert "steel S235" in told_refusals[0]["choices"]
    assert {"where": "clamp"} in told_refusals[1]["choices"]
    assert [] in told_refusals[1]["choices"]
    assert {"m", "mm", "in"} <= set(told_refusals[2]["choices"])


def test_time_and_memory_are_limited_and_the_server_goes_on(folder):
    calls = one_by_one([("materials", {"query": "S235"})])
    (slow,) = served_here(folder, calls, "--seconds", "0.05")
    assert slow.structured_content["refusal"]["kind"] == "time"
    (large,) = served_here(folder, calls, "--gigabytes", "0.05")
    assert large.structured_content["refusal"]["kind"] == "memory"


def test_a_flood_is_refused_and_the_server_goes_on(folder, monkeypatch):
    monkeypatch.setattr(agents, "MAX_WAITING_CALLS", 1)

    async def work(client):
        results = []

        async def call():
            results.append(await client.call_tool("materials", {"query": "S235"}))

        async with anyio.create_task_group() as group:
            for _ in range(20):
                group.start_soon(call)
        return results, await client.call_tool("materials", {"query": "S235"})

    results, after = served_here(folder, work)
    refused = [one.structured_content for one in results if one.is_error]
    assert {one["refusal"]["kind"] for one in refused} == {"busy"}
    assert all(len(one["hash"]) == 64 for one in refused)
    assert 3 <= len(results) - len(refused) < 10
    told(after)


def test_no_folder_is_refused_before_it_is_served(tmp_path, capsys):
    from antiosc_app.cli import main

    assert main(["mcp", str(tmp_path / "missing")]) == 1
    assert "there is no folder" in capsys.readouterr().err
