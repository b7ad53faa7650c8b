"""What `antiosc export` computes: the model or the scene, and the call that writes the file."""

from __future__ import annotations

from typing import Any

import antiosc
from antiosc.app.scene_file.build import Call
from antiosc.app.scene_file.evaluation import Evaluation
from antiosc.app.scene_file.run import telling
from antiosc.app.scene_file.scene import Compiled
from antiosc.base.errors import InputError

#: Of [simulate] or [strike]: what an exported run shares with the simulation; of [run] the first.
_SHARED = ("duration", "initial_velocity", "gravity", "gap")


def export(scene: Compiled, out: str, fmi: int, alone: bool) -> list[str]:
    """Write the impact or the scene of a file, or its model `alone`; warnings on the way."""
    history, source = scene.history, scene.scene or scene.model
    if history is not None and history.name == "strike":
        source = Call(_model, {"history": history})
    if source is None:
        raise InputError(
            f"{scene.document.path} has nothing to export: give a model ([extract] or [model]) or"
            " a scene of several contacts."
        )
    given: dict[str, Any] = {"path": out, "source": source, "fmi": fmi}
    if not alone:
        if scene.impactor is not None:
            given |= {"impactor": scene.impactor, "contact": scene.contact}
        names = _SHARED if scene.scene is None else _SHARED[:1]
        asked = {} if history is None else history.arguments
        given |= {name: asked[name] for name in names if name in asked}
    told = list(scene.warnings)
    with telling(told):
        Evaluation(scene.document)(Call(antiosc.export, given))
    return told


def _model(history: Any) -> Any:
    return history.model
