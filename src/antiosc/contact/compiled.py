"""Contact laws whose functions are kernels of the march's C library (`csrc/laws.c`).

A subclass gives the kind and the parameters; the formulas stand in C alone.
"""

from __future__ import annotations

from ctypes import addressof, byref, c_double
from dataclasses import fields
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from antiosc.base import march
from antiosc.base._types import Array
from antiosc.base.declared import Checked
from antiosc.contact.base import ContactLaw, State

_Three = c_double * 3


class Compiled(Checked, ContactLaw):
    """Base of the laws that the library knows."""

    #: the library's number of the law
    kind: ClassVar[int]
    #: numbers of the state
    size: ClassVar[int] = 0

    def parameters(self) -> list[float]:
        """Parameters as the library takes them: the fields of a dataclass."""
        return [getattr(self, one.name) for one in fields(self)]

    @cached_property
    def kernel(self) -> tuple[march.Law, Any]:
        """The law as the library takes it, and the numbers that it points to."""
        numbers = np.array(self.parameters(), dtype=float)
        return march.Law(self.kind, numbers.size, march.address(numbers), None), numbers

    @cached_property
    def _at(self) -> int:
        return addressof(self.kernel[0])

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k not in ("kernel", "_at")}

    def force(self, delta: float, rate: float, state: State) -> float:
        out = _Three()
        march.library.aom_law_force(self._at, delta, rate, _Three(*(state or ())[:3]), out)
        return out[0]

    def tangent(self, delta: float, rate: float, state: State) -> tuple[float, float]:
        out = _Three()
        march.library.aom_law_force(self._at, delta, rate, _Three(*(state or ())[:3]), out)
        return out[1], out[2]

    def energy(self, delta: float, state: State) -> float:
        out = c_double()
        at = byref(c_double(delta)), _Three(*state[:3]), byref(out)
        march.library.aom_law_energies(self._at, 1, *at)
        return out.value

    def potential(self, delta: float, state: State) -> float:
        return super().potential(delta, state) if self.has_memory else self.energy(delta, state)

    def energies(self, delta: Array, state: State) -> Array:
        depth, out = np.ascontiguousarray(delta, dtype=float), np.empty(len(delta))
        march.library.aom_law_energies(
            self._at, depth.size, march.address(depth), _Three(*state[:3]), march.address(out)
        )
        return out

    def forces_at_rest(self, delta: Array, state: State) -> Array:
        """Forces (n,) [N] at indentations (n,) [m] that do not change."""
        depth, out = np.ascontiguousarray(delta, dtype=float), np.empty(len(delta))
        march.library.aom_law_forces(
            self._at, depth.size, march.address(depth), _Three(*state[:3]), march.address(out)
        )
        return out

    def loading_work(self, delta: float) -> float:
        """Work [J] of loading a new contact up to delta."""
        return float(march.library.aom_law_loading_work(self._at, delta))

    def touch(self, speed: float, state: State | None = None) -> State:
        if not self.size:
            return ()
        now = _Three(*(state or ())[:3])
        march.library.aom_law_touch(self._at, speed, state is None, now)
        return tuple(now[: self.size])

    def advance(self, delta: float, rate: float, state: State) -> State:
        if not self.has_memory:
            return state
        now = _Three(*state[:3])
        march.library.aom_law_advance(self._at, delta, now)
        return tuple(now)

    def origin(self, state: State) -> float:
        if not self.has_memory:
            return 0.0
        return float(march.library.aom_law_origin(self._at, _Three(*state[:3])))

    def lost(self, state: State) -> float:
        return state[2] if self.has_memory else 0.0

    def damping(self, delta: float, rate: float, state: State) -> float:
        if not self.rate_dependent:
            return 0.0
        return self.force(delta, rate, state) - self.force(delta, 0.0, state)


def is_compiled(law: ContactLaw) -> bool:
    """Whether the library knows the law: a subclass made elsewhere may have other methods."""
    return _knows(type(law))


@lru_cache(maxsize=64)
def _knows(kind: type) -> bool:
    return issubclass(kind, Compiled) and kind.__module__.startswith("antiosc.contact.")
