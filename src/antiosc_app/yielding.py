"""The speeds from which a part yields, of the stress fields of an impact that has been computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from antiosc import History, SceneHistory, peak_field
from antiosc.base._types import Array
from antiosc.base.errors import finite_element_packages, without_warnings
from antiosc_app.live import force_bar
from antiosc_app.scene_file.run import error_budget

if TYPE_CHECKING:
    from antiosc import Margin, PeakField, Structure


def with_yield_speeds(
    structure: Structure | None, history: History, fields: Mapping[str, PeakField]
) -> dict[str, PeakField]:
    """The fields, with the speeds of the striker from which those judged by yield reach it."""
    return {name: _with_speeds(structure, history, field) for name, field in fields.items()}


def _with_speeds(structure: Structure | None, history: History, field: PeakField) -> PeakField:
    """A field with its speeds; as it is where it is of no impact of two bodies."""
    worst = field.worst_point
    if isinstance(history, SceneHistory) or worst is None or worst.criterion != "yield":
        return field
    struck: Any = history.structure if structure is None else structure
    if struck is None:
        return field
    with finite_element_packages():
        from antiosc.extension import yield_speeds

    def beyond(balls: Array) -> Margin | None:
        """The margin without the stresses in balls."""
        with without_warnings():
            other = peak_field(
                struck, history, field.quantity, leave_out=balls, sharp_edges=worst.away is None
            )
        return other.worst_point

    budget = error_budget(history)
    stretch = 0.0 if budget is None else budget["peak_force"].stretch

    def force(hit: History) -> float:
        """Relative error of the force at another speed; that of its motions is the one here."""
        return (force_bar(error_budget(hit)) or 0.0) + stretch

    return replace(field, yield_speeds=yield_speeds(struck, history, worst, force, beyond))
