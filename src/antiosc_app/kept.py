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
MAX_KEPT_RESULTS = {
    **{"read_mesh": 4, "Structure": 2, "read_model": 2, "Structure.from_files": 2, "assemble": 2},
    **{"extract": 8, "from_frf": 2},
}


class ResultCache(OrderedDict[str, T]):
    """A cache of the `max_results` results used last; keys are texts of their inputs."""

    def __init__(self, max_results: int) -> None:
        super().__init__()
        self._most = max_results
        self._messages: dict[str, list[str]] = {}

    def result_of(self, key: str, make: Callable[[], T]) -> T:
        """The result for `key`, from `make` if it is not known; its warnings are repeated."""
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


class PartCache:
    """Cache of meshes, structures and models of one part.

    A given `structure` replaces the structure that scenes describe.
    """

    def __init__(self, structure: Structure | None = None) -> None:
        self._given = structure
        self.results: dict[str, ResultCache[object]] = {
            n: ResultCache(m) for n, m in MAX_KEPT_RESULTS.items()
        }

    def cached_evaluation(self, document: Document) -> CachedEvaluation:
        """An evaluation of a document's calls that uses this cache."""
        return CachedEvaluation(self, document)

    def result_of(self, call: Call, make: Callable[[], object]) -> object:
        """The result of `call`, from the cache or by `make`."""
        if self._given is not None and call.name in ("Structure", "read_model"):
            return self._given
        if call.name not in self.results:
            return make()
        return self.results[call.name].result_of(repr(cache_key(call)), make)


def cache_key(value: object) -> object:
    """A value in which each call is replaced by its name and arguments, for a cache's key."""
    if isinstance(value, Call):
        return value.name, cache_key(value.arguments)
    if isinstance(value, Mapping):
        return {key: cache_key(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [cache_key(entry) for entry in value]
    return value


class CachedEvaluation(Evaluation):
    """An evaluation of a document's calls that uses a cache."""

    def __init__(self, cache: PartCache, document: Document) -> None:
        super().__init__(document)
        self.kept = cache

    def _result_of(self, call: Call) -> object:
        make = partial(super()._result_of, call)
        if call.result is not None or call in self._made:
            return make()
        return self.kept.result_of(call, make)
