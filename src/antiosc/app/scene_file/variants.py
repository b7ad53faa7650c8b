"""A scene with other values in it: the structures of [sweep] and of [monte_carlo]."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from antiosc.app.scene_file import struck
from antiosc.app.scene_file.build import Builder, Call
from antiosc.app.scene_file.evaluation import Evaluation
from antiosc.app.scene_file.locations import Place
from antiosc.app.scene_file.problems import Problems, SceneFileError
from antiosc.app.scene_file.sections import KIND, MODELS

#: Sections that say what is struck, and how it is reduced.
STRUCTURAL = (
    *("geometry", "deck", "matrices", "parts", "model", "frf", "material", "structure"),
    *("at", "points", "assembly", "sites", "extract", "from_frf"),
)


def structural(build: Builder) -> list[str]:
    """The sections of STRUCTURAL that this scene has, or may have."""
    reduced = not set(MODELS) & set(build.data)
    return [n for n in STRUCTURAL if n in build.data or (n == "extract" and reduced)]


def leaves(table: Mapping[str, Any], place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """(place, value) of the values in tables within tables, of which one with a kind is a value."""
    for key, value in table.items():
        if isinstance(value, dict) and KIND not in value:
            yield from leaves(value, (*place, key))
        else:
            yield (*place, key), value


@dataclass
class _Elsewhere(Problems):
    """Mistakes at places whose values come from elsewhere in the file; others are known already."""

    main: Problems | None = None
    places: Mapping[Place, Place] = field(default_factory=dict)

    def add(self, place: Place, sentence: str) -> None:
        """Note it at the place of the value, in the section that varies it."""
        origin = self._origin(place)
        if origin is not None and self.main is not None:
            self.main.add(origin, sentence)

    def error(self, place: Place, sentence: str) -> SceneFileError:
        """An error of this one mistake, which was found while the scene runs."""
        return super().error(self._origin(place) or place, sentence)

    def _origin(self, place: Place) -> Place | None:
        within = (
            origin
            for own, origin in self.places.items()
            if place[: len(own)] == own or own[: len(place)] == place
        )
        return next(within, None)


def variant(build: Builder, values: Mapping[Place, Any], origins: Mapping[Place, Place]) -> Builder:
    """The scene with these values; its mistakes are noted at `origins` in the file."""
    data = copy.deepcopy({n: v for n, v in build.data.items() if isinstance(v, dict | list)})
    for place, value in values.items():
        table: Any = data
        for key in place[:-1]:
            table = table.setdefault(key, {})
        table[place[-1]] = value
    known = build.document.problems
    problems = _Elsewhere(known.name, known.text, main=known, places=origins)
    return Builder(replace(build.document, data=data, problems=problems))


def model_of(build: Builder) -> Call | None:
    """A call that makes the model of a variant, and keeps nothing else of it."""
    source = struck.source(build)
    model = struck.model(build, source, struck.structure(build, source))
    return None if model is None else Call(_made, {"lazily": [Alone(build, model)]})


@dataclass(frozen=True)
class Alone:
    """A call of a variant, which is evaluated by itself."""

    build: Builder
    call: Call

    def made(self) -> Any:
        """Its object; a mistake has the line of the section that was varied."""
        return Evaluation(self.build.document)(self.call)


def _made(lazily: list[Alone]) -> Any:
    """The model without shapes: those of all the models of a sweep would fill the memory."""
    model = lazily[0].made()
    return replace(model, shapes=None, hidden=None)
