"""Caches the meshes, structures and models of a part by the calls that make them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from antiosc.base.errors import warn, warnings_to
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.document import Document

if TYPE_CHECKING:
    from antiosc import Structure

T = TypeVar("T")

#: What is kept, and how many of it: a model of 77 000 dofs has 85 MB with its shapes, and Undo
#: finds it again.
KEPT_RESULTS = {
    **{"read_mesh": 4, "Structure": 2, "read_model": 2, "Structure.from_files": 2, "assemble": 2},
    **{"extract": 8, "from_frf": 2},
}


class ResultCache(OrderedDict[str, T]):
    """A cache of the `most` results used last; keys are texts of their inputs."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most
        self._messages: dict[str, list[str]] = {}

    def of(self, key: str, make: Callable[[], T]) -> T:
        """The result for `key`, by `make` if it is not known; its warnings are repeated."""
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
    """Cache of meshes, structures and models of one part.

    A `structure` takes the place of the one that scenes describe.
    """

    def __init__(self, structure: Structure | None = None) -> None:
        self._given = structure
        self.results: dict[str, ResultCache[object]] = {
            n: ResultCache(m) for n, m in KEPT_RESULTS.items()
        }

    def evaluation(self, document: Document) -> KeepingEvaluation:
        """An evaluation of a document's calls that uses this cache."""
        return KeepingEvaluation(self, document)

    def made(self, call: Call, make: Callable[[], object]) -> object:
        """The result of `call`, from the cache or by `make`."""
        if self._given is not None and call.name in ("Structure", "read_model"):
            return self._given
        if call.name not in self.results:
            return make()
        return self.results[call.name].of(repr(described(call)), make)


def described(value: object) -> object:
    """A value in which each call is replaced by its name and arguments, for a cache's key."""
    if isinstance(value, Call):
        return value.name, described(value.arguments)
    if isinstance(value, Mapping):
        return {key: described(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [described(entry) for entry in value]
    return value


class KeepingEvaluation(Evaluation):
    """An evaluation of a document's calls that uses the cache `kept`."""

    def __init__(self, kept: Kept, document: Document) -> None:
        super().__init__(document)
        self.kept = kept

    def _object(self, call: Call) -> object:
        make = partial(super()._object, call)
        if call.made is not None or call in self._made:
            return make()
        return self.kept.made(call, make)
