"""The unreduced model for the impact of `tradeoff`, on the mesh of one of its members."""

from __future__ import annotations

from collections.abc import Callable

from antiosc.base.errors import AntioscError
from antiosc.base.texts import plain
from antiosc.strikes import unreduced
from antiosc.strikes.unreduced import Blow, Outcome

UNREDUCED = "unreduced"


def outcomes(
    make_blow: Callable[[], Blow], seconds: float, report: Callable[[str], None]
) -> tuple[dict[str, Outcome], list[str]]:
    """(outcome of the unreduced model if it is expected to take at most `seconds`, sentences)."""
    try:
        blow = make_blow()
        expected = unreduced.forecast(blow)
        if expected > seconds:
            return {}, [
                f"{UNREDUCED}: not run, the forecast of {plain(expected)} s for"
                f" {blow.structure.dofs} dofs and {blow.steps} steps exceeds"
                f" compare = {seconds:g} s."
            ]

        report(f"{UNREDUCED}, about {plain(expected)} s")
        return {UNREDUCED: unreduced.newmark(blow)}, []
    except AntioscError as error:
        return {}, [f"{UNREDUCED}: {str(error).rstrip('.')}."]
