"""Other methods for the impact of `tradeoff`, on the mesh of one of its members."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from antiosc.base.errors import AntioscError
from antiosc.base.texts import plain
from antiosc.strikes import calculix, unreduced
from antiosc.strikes.unreduced import Blow, Outcome


class Method(NamedTuple):
    """A method: the forecast of its seconds, and its run within a limit of seconds."""

    forecast: Callable[[Blow], float]
    run: Callable[[Blow, float], Outcome]


#: Name -> the method.
METHODS: Mapping[str, Method] = {
    "unreduced": Method(unreduced.forecast, lambda blow, _: unreduced.newmark(blow)),
    "CalculiX": Method(calculix.forecast, calculix.run),
}


def outcomes(
    make_blow: Callable[[], Blow], seconds: float, report: Callable[[str], None]
) -> tuple[dict[str, Outcome], list[str]]:
    """(outcome of each method that is expected to take at most `seconds`, sentences on others)."""
    try:
        blow = make_blow()
    except AntioscError as error:
        return {}, [f"No other method: {str(error).rstrip('.')}."]
    results = {}
    notes = []
    for name, method in METHODS.items():
        try:
            expected = method.forecast(blow)
            if expected > seconds:
                notes.append(
                    f"{name}: not run, the forecast of {plain(expected)} s for"
                    f" {blow.structure.dofs} dofs and {blow.steps} steps exceeds"
                    f" compare = {seconds:g} s."
                )
                continue
            report(f"{name}, about {plain(expected)} s")
            results[name] = method.run(blow, seconds)
        except AntioscError as error:
            notes.append(f"{name}: {str(error).rstrip('.')}.")
    return results, notes
