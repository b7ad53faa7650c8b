"""Ten jobs of an engineer by calls of the tools of `antiosc mcp` alone, each beside an own figure.

The own figures are closed forms, computed here without antiosc, or dimensions of the drawing.

    make bench-agents
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))
from agent_calls import filled, served, told

Table = dict[str, Any]
#: A steel bar that the matrices of demos/scenes describe: pinned at both ends.
LENGTH, WIDTH, HEIGHT, E, RHO = 0.8, 0.03, 0.01, 210e9, 7850.0
BENDING = 48 * E * WIDTH * HEIGHT**3 / 12 / LENGTH**3
BAR: Table = {
    "matrices": {"K": "beam_K.mtx", "M": "beam_M.mtx", "map": "beam_nodes.txt"},
    "sites": {"middle": {"node": 9, "dof": "z"}},
    "extract": {"n": 6},
}
#: The line of meshes/beam.msh as a round bar of steel, 1 m long.
ROUND: Table = {
    "geometry": {"source": "beam.msh", "unit": "m"},
    "material": {
        "kind": "Beam",
        "E": E,
        "nu": 0.3,
        "rho": RHO,
        "section": {"kind": "Section.circle", "d": 0.02},
    },
}
ROUND_I = np.pi / 64 * 0.02**4
DOWN = {"direction": [0, 0, -1]}


class Job(NamedTuple):
    """A question, the call that answers it, the name of its number, and the own figure."""

    question: str
    tool: str
    arguments: Table
    name: str
    figure: float
    within: float


def bodies(mass: float, speed: float, law: Table, other: Table) -> Table:
    """A scene of a rigid mass against another body."""
    struck = {"mass": {"kind": "RigidMass", "mass": mass, "velocity": speed}, "other": other}
    contacts = [{"a": "other", "b": "mass", "law": law}]
    return {"bodies": struck, "contacts": contacts, "run": {"duration": 0.05}}


def striker(mass: float, speed: float, stiffness: float, duration: float) -> Table:
    """The sections of a rigid mass on a linear contact."""
    return {
        "impactor": {"kind": "RigidMass", "mass": mass, "velocity": speed},
        "contact": {"kind": "Linear", "stiffness": stiffness},
        "simulate": {"duration": duration},
    }


def jobs() -> list[Job]:
    """The ten jobs."""
    wall = {"kind": "Obstacle"}
    still = {"kind": "RigidMass", "mass": 0.6, "velocity": 0.0}
    buffer, skin = ({"kind": "Linear", "stiffness": k} for k in (2e6, 75e3))
    nose = {"kind": "Hertz", "stiffness": 1e9}
    depth = (1.25 * 0.5 * 2.0**2 / 1e9) ** 0.4
    reduced = 1 / (1 / 0.6 + 1 / 5.0)

    # a soft and slow blow bends a bar as a weight does
    slow = striker(20.0, 0.1, 2e3, 0.5)
    bar_force = 0.1 * np.sqrt(20.0 / (1 / 2e3 + 1 / BENDING))
    swept = {"impactor": {"velocity": [0.1, 0.2]}}
    tip = {"supports": [{"where": "left"}], "sites": {"tip": {"point": [1.0, 0, 0], **DOWN}}}
    tip |= {"extract": {"n": 10}, **striker(50.0, 0.05, 200.0, 1.7)}
    root_force = 0.05 * np.sqrt(50.0 / (1 / 200.0 + 1 / (3 * E * ROUND_I)))
    simple = [{"where": end, "fix": ["x", "y", "z", "rx"]} for end in ("left", "right")]
    middle = {"supports": simple, "map": {"where": [[0.5, 0, 0]], **DOWN, "n": 6}}

    return [
        Job("modulus of S235", "materials", {"query": "S235"}, "steel S235: E", 210e9, 1e-9),
        Job("length of a part", "look", {"file": "bracket.step"}, "size x", 0.084, 1e-4),
        Job("force of a mass on a buffer", "strike", {"scene": bodies(0.5, 2.0, buffer, wall)},
            "peak_force", 2.0 * np.sqrt(2e6 * 0.5), 1e-3),
        Job("how long it presses", "strike", {"scene": bodies(0.5, 2.0, buffer, wall)},
            "contact_time", np.pi * np.sqrt(0.5 / 2e6), 1e-3),
        Job("force of a round nose", "strike", {"scene": bodies(0.5, 2.0, nose, wall)},
            "peak_force", 1e9 * depth**1.5, 1e-3),
        Job("force on a hand, ISO/TS 15066", "strike", {"scene": bodies(5.0, 0.25, skin, still)},
            "peak_force", 0.25 * np.sqrt(reduced * 75e3), 1e-3),
        Job("force of a slow blow on a bar", "strike", {"scene": {**BAR, **slow}},
            "peak_force", bar_force, 0.03),
        Job("force at twice the speed", "sweep", {"scene": {**BAR, **slow, "sweep": swept}},
            "peak_force", 2 * bar_force, 0.03),
        Job("stiffness of a bar's middle", "map", {"scene": {**ROUND, **middle}},
            "k0", 48 * E * ROUND_I, 0.01),
        Job("stress at the root of a bar", "strike", {"scene": {**ROUND, **tip}},
            "von_mises", root_force * 0.01 / ROUND_I, 0.03),
    ]  # fmt: skip


def main() -> list[tuple[str, float, float]]:
    """Do the jobs; return question, answer and own figure of each."""
    with tempfile.TemporaryDirectory() as name:

        async def work(client: Any) -> list[Any]:
            return [await client.call_tool(job.tool, job.arguments) for job in jobs()]

        results = served(filled(Path(name)), work)
    return checked([told(result) for result in results])


def checked(answers: list[Table]) -> list[tuple[str, float, float]]:
    """Question, number and own figure of each job, by their answers."""
    rows = []
    for job, answer in zip(jobs(), answers, strict=True):
        for one in answer["quantities"]:
            assert isinstance(one["bar"], list) or one["bar"].startswith("none: "), one
        found = [one["value"] for one in answer["quantities"] if one["name"] == job.name][-1]
        off = found / job.figure - 1
        print(
            f"{job.question:<30} {found:12.5g} {job.figure:12.5g} {100 * off:+8.3f} %", flush=True
        )
        assert len(answer["hash"]) == 64
        assert abs(off) <= job.within, f"{job.question}: off by more than {job.within:g}"
        rows.append((job.question, found, job.figure))
    return rows


if __name__ == "__main__":
    main()
