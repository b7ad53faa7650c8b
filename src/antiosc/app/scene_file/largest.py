"""The largest stresses of an impact: of [stress], or by the strengths of the materials."""

from __future__ import annotations

from typing import Any

import antiosc
from antiosc.app.scene_file.build import Builder, Call
from antiosc.app.scene_file.sections import MODELS
from antiosc.base.errors import finite_element_packages


def stresses(
    build: Builder, source: str, structure: Call | None, history: Call | None
) -> Call | None:
    """The call that makes {quantity: PeakField}; None where there is no impact of a mesh."""
    meshed = source not in ("", "matrices", *MODELS) and history is not None
    if "stress" not in build.data:
        return Call(by_strengths, {"structure": structure, "history": history}) if meshed else None
    if not meshed:
        build.note(("stress",), "[stress] needs a structure with a mesh, and its simulation.")
    asked = build.table("stress", given={"structure": structure, "history": history})
    return None if asked is None else Call(_one, {"peak": asked})


def by_strengths(structure: Any, history: Any) -> dict[str, Any]:
    """The fields of the criteria for which the materials have strengths; {} without any."""
    with finite_element_packages():
        from antiosc.results.largest import criteria_of
    return {name: antiosc.peak_field(structure, history, name) for name in criteria_of(structure)}


def _one(peak: Any) -> dict[str, Any]:
    return {peak.quantity: peak}
