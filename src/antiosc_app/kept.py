"""What `antiosc open` keeps between answers: meshes, structures, models, and free modes."""

from __future__ import annotations

import contextlib
import json
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from antiosc import AntiOscillators, from_free_modes
from antiosc.base.errors import AntioscError, warn, warnings_to
from antiosc.models.body import ModelInfo
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.document import Document
from antiosc_app.scene_file.scene import CompiledScene

if TYPE_CHECKING:
    from antiosc import Site, Structure

T = TypeVar("T")

#: Number of free modes, which are computed between calls of the page.
MODES = 40
#: Anti-oscillators of a model from free modes.
COUNT = 20
#: Number of meshes, structures and models that are kept: with its shapes a model of 77 000 dofs has
#: 85 MB, and Undo finds it again.
MESHES, STRUCTURES, MODELS = 4, 2, 8
#: Sections of a scene on which a mesh depends, a structure, and a model.
OF_MESH = ("geometry",)
OF_STRUCTURE = ("geometry", "deck", "material", "supports")
OF_MODEL = (*OF_STRUCTURE, "sites", "extract")


class ResultCache(OrderedDict[str, T]):
    """A cache of the last `most` results, each with the text of its inputs as the key."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self._messages: dict[str, list[str]] = {}

    def of(self, key: str, make: Callable[[], T]) -> T:
        """The result for a key, computed if it is not known; its warnings are given each time."""
        if key not in self:
            messages: list[str] = []
            with warnings_to(messages.append):
                self[key] = make()
            self._messages[key] = messages
            while len(self) > self._most:
                oldest, _ = self.popitem(last=False)
                self._messages.pop(oldest, None)
        self.move_to_end(key)
        for message in self._messages.get(key, ()):
            warn(message)
        return self[key]


class Kept:
    """Meshes, structures, models and free modes of the scenes of one part."""

    def __init__(self, structure: Structure | None = None) -> None:
        self._given = structure
        self._meshes: ResultCache[object] = ResultCache(MESHES)
        self._structures: ResultCache[object] = ResultCache(STRUCTURES)
        self._models: ResultCache[object] = ResultCache(MODELS)
        self._modes: ResultCache[FreeModes] = ResultCache(STRUCTURES)

    def evaluation(self, document: Document) -> KeepingEvaluation:
        """The evaluation of a scene that takes what is kept."""
        return KeepingEvaluation(self, document)

    def made(self, data: dict[str, Any], call: Call, make: Callable[[], object]) -> object:
        """The object of a call of a scene, from what is kept."""
        if call.name in ("Structure", "read_model"):
            if self._given is not None:
                return self._given
            return self._structures.of(key_of(data, OF_STRUCTURE), make)
        if call.name == "extract":
            return self._models.of(key_of(data, OF_MODEL), make)
        if call.name == "read_mesh":
            return self._meshes.of(key_of(data, OF_MESH), make)
        return make()

    def from_modes(self, scene: CompiledScene) -> tuple[Structure, AntiOscillators] | None:
        """(structure, model from its free modes) of a scene; None if these are not known."""
        data = scene.document.data
        modes = self._modes.get(key_of(coarse(data), OF_STRUCTURE))
        if modes is None or scene.model is None or key_of(data, OF_MODEL) in self._models:
            return None
        return modes.structure, modes.model(scene.model.arguments["site"].made)

    def search_modes(self, structure: Structure, data: dict[str, Any]) -> None:
        """Compute the free modes of the structure of a scene."""
        with contextlib.suppress(AntioscError):  # without them every click is extracted
            self._modes.of(key_of(coarse(data), OF_STRUCTURE), lambda: FreeModes(structure))


def coarse(data: dict[str, Any]) -> dict[str, Any]:
    """A scene without the smaller cells at its site."""
    read = {key: value for key, value in data.get("geometry", {}).items() if key != "refine"}
    return {**data, "geometry": read}


class KeepingEvaluation(Evaluation):
    """An evaluation of a scene that takes what is kept."""

    def __init__(self, kept: Kept, document: Document) -> None:
        super().__init__(document)
        self._kept = kept

    def _object(self, call: Call) -> object:
        make = partial(super()._object, call)
        if call.made is not None or call in self._made:
            return make()
        return self._kept.made(self.document.data, call, make)


def key_of(data: dict[str, Any], sections: tuple[str, ...]) -> str:
    """Text of the sections that an object depends on."""
    return json.dumps({name: data[name] for name in sections if name in data}, sort_keys=True)


class FreeModes:
    """Free modes of a structure, and models at any site from them."""

    def __init__(self, structure: Structure) -> None:
        from antiosc.extension import ModeSolver

        structure.factorize(np.inf)  # a click is one solve
        self.structure = structure
        modes = ModeSolver(structure).lowest(MODES)
        rigid = structure.rigid_modes
        self.omega = np.concatenate([np.zeros(rigid.shape[1]), modes.omega])
        self.phi = np.column_stack([rigid, modes.phi])

    def model(self, site: Site) -> AntiOscillators:
        """The model of a site by one solve, without bars."""
        from antiosc.fem.linalg.algebra import multiply
        from antiosc.reduce.site import functional, surfaces

        structure = self.structure
        load = functional(structure, site)
        y = structure.factorize().solve_block(load.b[:, None])[:, 0]
        of_site = load.b @ self.phi, float(load.b @ y), float(y @ multiply(structure.M, y))
        model = from_free_modes(self.omega, *of_site, COUNT, structure.shift)
        assert load.point is not None
        assert load.direction is not None
        info = ModelInfo(
            point=load.point.tolist(),
            direction=load.direction.tolist(),
            surfaces=surfaces(structure, {"": load}),
        )
        return replace(
            model,
            local_compliance=load.local_compliance,
            radius=load.radius,
            direction=load.direction,
            info=info,
        )
