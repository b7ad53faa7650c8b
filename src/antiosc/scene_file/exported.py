"""What `antiosc export` computes: the model or the scene, and the call that writes the file."""

from __future__ import annotations

from typing import Any

from antiosc.errors import InputError
from antiosc.scene_file.program import Call, Name, Statement
from antiosc.scene_file.scene import Compiled

#: Of [simulate], [strike] or [run]: what an exported run shares with the simulation.
_SHARED = ("duration", "initial_velocity", "gravity", "gap")


def exported(scene: Compiled, out: str, fmi: int, alone: bool) -> list[Statement]:
    """Statements that write the impact or the scene of a file, or its model `alone`."""
    statements = [*scene.structure, *scene.model]
    simulation = None if scene.simulation is None else scene.simulation.expression
    struck = simulation is not None and simulation.function == "ao.strike"
    posed = {each.variable for each in scene.strike}
    if scene.simulation is not None and struck:
        statements += [*scene.strike, scene.simulation, Statement("model", Name("history.model"))]
    elif not alone or "scene" in posed:
        statements += scene.strike
    if "scene" not in posed and not any(each.variable == "model" for each in statements):
        raise InputError(
            f"{scene.document.path} has nothing to export: give a model ([extract] or [model]) or"
            " a scene of several contacts."
        )
    given: dict[str, Any] = {
        "*path": out,
        "*source": Name("scene" if "scene" in posed else "model"),
    }
    if "scene" not in posed and posed and not alone:
        given |= {"*impactor": Name("impactor"), "*contact": Name("contact")}
    if simulation is not None and not alone:
        names = ("duration",) if "scene" in posed else _SHARED
        given |= {
            name: simulation.arguments[name] for name in names if name in simulation.arguments
        }
    return [*statements, Statement("exported", Call("ao.export", {**given, "fmi": fmi}))]
