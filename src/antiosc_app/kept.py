"""Caches of `antiosc open`: results by the text of their inputs, and free modes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from antiosc import AntiOscillators, from_free_modes
from antiosc.base._types import Array
from antiosc.base.errors import warn, warnings_to
from antiosc.models.body import ModelInfo
from antiosc_app.set_up import COUNT

if TYPE_CHECKING:
    from antiosc import Site, Structure

T = TypeVar("T")

#: Number of free modes after each round of the search, which runs between calls of the page.
MODE_ROUNDS = (10, 20, 40)
#: Number of models in the cache.
MOST_MODELS = 50


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


class FreeModeCache:
    """Free modes of a structure, computed in rounds, and models at any site from them."""

    def __init__(self, structure: Structure) -> None:
        from antiosc.extension import ModeSolver

        structure.factorize(np.inf)  # a click is one solve
        self._structure = structure
        self._solver = ModeSolver(structure)
        #: numbers of modes of the remaining rounds
        self.left = list(MODE_ROUNDS)
        self._known: tuple[Array, Array] | None = None
        self._models: ResultCache[AntiOscillators] = ResultCache(MOST_MODELS)

    def search(self) -> bool:
        """Compute one more round of modes; return whether another round is needed."""
        count = self.left[0]
        try:
            modes = self._solver.lowest(count)
        finally:
            self.left.pop(0)
        rigid = self._structure.rigid_modes
        omega = np.concatenate([np.zeros(rigid.shape[1]), modes.omega])
        self._known = omega, np.column_stack([rigid, modes.phi])
        self._models.clear()
        return bool(self.left) and not modes.complete

    def model(self, key: str, site: Site) -> AntiOscillators | None:
        """The model of a site, without mode shapes and error bars; None before the first round.

        `key`: the text of the inputs that determine the site.
        """
        if self._known is None:
            return None
        return self._models.of(key, lambda: self._computed_model(site))

    def _computed_model(self, site: Site) -> AntiOscillators:
        """The model of a site, by one solve."""
        from antiosc.fem.linalg.algebra import multiply
        from antiosc.reduce.site import functional, surfaces

        assert self._known is not None
        structure = self._structure
        omega, phi = self._known
        load = functional(structure, site)
        y = structure.factorize().solve_block(load.b[:, None])[:, 0]
        inertia = float(y @ multiply(structure.M, y))
        of_site = load.b @ phi, float(load.b @ y), inertia
        model = from_free_modes(omega, *of_site, COUNT, structure.shift, "krylov")
        assert load.point is not None
        assert load.direction is not None
        info = ModelInfo(
            point=load.point.tolist(),
            direction=load.direction.tolist(),
            surfaces=surfaces(structure, {"": load}, lengths=False),
        )
        return replace(
            model,
            local_compliance=load.local_compliance,
            radius=load.radius,
            direction=load.direction,
            info=info,
        )
