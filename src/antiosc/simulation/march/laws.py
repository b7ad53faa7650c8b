"""The contact laws as the march takes them: its own by their parameters, others by callbacks."""

from __future__ import annotations

from ctypes import addressof
from typing import Any

from antiosc.base import march
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.contact.base import Compiled, is_compiled


class OwnLaw:
    """A law of the user's own: what the march calls, and the error that stopped it, if any."""

    def __init__(self, law: ContactLaw) -> None:
        self.law = law
        self.size = len(law.touch(1.0))
        if self.size > march.MEMORY - 2:
            raise InputError(
                f"the state of a contact law may hold up to {march.MEMORY - 2} numbers;"
                f" {type(law).__name__}.touch returns {self.size}."
            )
        self.error: BaseException | None = None
        functions = (
            march.FORCE(self._force), march.TOUCHED(self._touch), march.ADVANCE(self._advance),
            march.WORK(self._work),
        )  # fmt: skip
        self.kernel = march.UserLaw(None, self.size, law.rate_dependent, *functions)

    def _force(self, _: Any, delta: float, rate: float, state: Any, out: Any) -> int:
        try:
            now = tuple(state[: self.size])
            out[0] = self.law.force(delta, rate, now)
            out[1], out[2] = self.law.tangent(delta, rate, now)
        except BaseException as error:  # it is raised once the march has returned
            self.error = error
        return int(self.error is not None)

    def _touch(self, _: Any, speed: float, first: int, state: Any, origin: Any) -> int:
        try:
            before = None if first else tuple(state[: self.size])
            self._keep(self.law.touch(speed, before), state, origin)
        except BaseException as error:
            self.error = error
        return int(self.error is not None)

    def _advance(self, _: Any, delta: float, rate: float, state: Any, origin: Any) -> int:
        try:
            self._keep(self.law.advance(delta, rate, tuple(state[: self.size])), state, origin)
        except BaseException as error:
            self.error = error
        return int(self.error is not None)

    def _work(self, _: Any, speed: float, delta: float, work: Any) -> int:
        try:
            work[0] = self.law.potential(delta, self.law.touch(speed))
        except BaseException as error:
            self.error = error
        return int(self.error is not None)

    def _keep(self, new: tuple[float, ...], state: Any, origin: Any) -> None:
        for i, value in enumerate(new):
            state[i] = value
        origin[0] = self.law.origin(new)


def packed(law: ContactLaw) -> tuple[march.Law, Any]:
    """A law as the march takes it, and what keeps its numbers and functions alive."""
    if is_compiled(law):
        assert isinstance(law, Compiled)
        kernel, values = law.kernel
        return kernel, values
    own = OwnLaw(law)
    return march.Law(march.USER, 0, None, addressof(own.kernel)), own


def raise_error(own: Any) -> None:
    """Raise the error of a law of the user's own, if it failed; `own` as `packed` gives it."""
    if isinstance(own, OwnLaw) and own.error is not None:
        raise own.error
