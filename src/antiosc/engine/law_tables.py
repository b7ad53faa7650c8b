"""Contact laws for the C library: compiled ones by their parameters, others by callbacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import addressof
from functools import partial
from math import isfinite, isnan
from typing import TYPE_CHECKING

from antiosc.base.errors import AntioscError, InputError
from antiosc.engine import library
from antiosc.engine.contact import ContactLaw
from antiosc.engine.contact.base import is_compiled

if TYPE_CHECKING:
    from ctypes import _Pointer, c_double

    Doubles = _Pointer[c_double]


class CallbackLaw:
    """Callbacks by which the C library calls a Python law; `error`: the exception of a callback."""

    def __init__(self, law: ContactLaw) -> None:
        self.law = law
        self.size = len(law.touch(1.0))
        if self.size > library.CONTACT_MEMORY - 2:
            raise InputError(
                f"the state of a contact law may hold up to {library.CONTACT_MEMORY - 2} numbers;"
                f" {type(law).__name__}.touch returns {self.size}."
            )
        self.error: BaseException | None = None
        functions = (
            library.FORCE_CALLBACK(self._force),
            library.TOUCH_CALLBACK(self._touch),
            library.ADVANCE_CALLBACK(self._advance),
            library.WORK_CALLBACK(self._work),
        )
        self.kernel = library.UserLaw(None, self.size, law.rate_dependent, *functions)

    def _force(self, _: object, delta: float, rate: float, state: Doubles, out: Doubles) -> int:
        def values() -> list[float]:
            law_state = tuple(state[: self.size])
            slopes = self.law.tangent(delta, rate, law_state)
            return [self.law.force(delta, rate, law_state), *slopes]

        return self._store_values(f"force and tangent at {delta:g} m and {rate:g} m/s", values, out)

    def _touch(self, _: object, speed: float, first: int, state: Doubles, origin: Doubles) -> int:
        old_state = None if first else tuple(state[: self.size])
        new_state = partial(self.law.touch, speed, old_state)
        return self._store_state(f"touch at {speed:g} m/s", state, origin, new_state)

    def _advance(
        self, _: object, delta: float, rate: float, state: Doubles, origin: Doubles
    ) -> int:
        new_state = partial(self.law.advance, delta, rate, tuple(state[: self.size]))
        return self._store_state(
            f"advance at {delta:g} m and {rate:g} m/s", state, origin, new_state
        )

    def _work(self, _: object, speed: float, delta: float, work: Doubles) -> int:
        def values() -> list[float]:
            return [self.law.potential(delta, self.law.touch(speed))]

        return self._store_values(f"potential at {delta:g} m", values, work)

    def _store_state(
        self, where: str, state: Doubles, origin: Doubles, new: Callable[[], tuple[float, ...]]
    ) -> int:
        """Store a new state and its origin, and return 0; 1 if computing them fails."""

        def of_state() -> list[float]:
            return [self.law.origin(tuple(state[: self.size]))]

        failed = self._store_values(where, new, state, lambda x: not isnan(x))
        return failed or self._store_values(where, of_state, origin)

    def _store_values(
        self,
        where: str,
        values: Callable[[], Sequence[float]],
        out: Doubles,
        sound: Callable[[float], bool] = isfinite,
    ) -> int:
        """Store values of a law's method, named `where`, in `out`; returns 0, or 1 if it fails."""
        try:
            for i, value in enumerate(values()):
                if not sound(value):
                    raise ValueError(f"it returns {value}")
                out[i] = value
        except Exception as error:
            message = f"{type(self.law).__name__}: {where} failed, {type(error).__name__}: {error}."
            self.error = error if isinstance(error, AntioscError) else InputError(message)
            self.error.__cause__ = None if self.error is error else error
        except BaseException as error:  # Ctrl-C: raised once the march has returned
            self.error = error

        return int(self.error is not None)


def packed_law(law: ContactLaw) -> tuple[library.CLaw, object]:
    """(a law as a structure for the C library, the objects whose memory it refers to)."""
    if is_compiled(law):
        return law.kernel
    callbacks = CallbackLaw(law)
    return library.CLaw(library.USER, 0, None, addressof(callbacks.kernel)), callbacks


def raise_error(memory: object) -> None:
    """Raise the error of a law in Python, if it failed; `memory`: second result of `packed_law`."""
    if isinstance(memory, CallbackLaw) and memory.error is not None:
        raise memory.error
