"""The fall of [drop], and what it is asked for: peaks of accelerometers, the largest stress."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from antiosc.app.scene_file.build import Builder, Call
from antiosc.app.scene_file.sections import SOURCES

#: Sections of an impact, which a fall replaces.
_IMPACT = (
    *("impactor", "contact", "simulate", "strike", "bodies", "contacts", "loads", "base"),
    *("motion", "scene", "run", "sites", "extract", "probes", "sweep", "map"),
    "stress",
)
#: Sections that ask a fall for something.
_ASKED = ("accelerometers", "worst")


def fall(build: Builder, source: str, structure: Call | None) -> Mapping[str, Any]:
    """The calls of `drop`, `Fall.peak` and `Fall.worst`; {} without [drop]."""
    if "drop" not in build.data:
        for name in _ASKED:
            if name in build.data:
                build.note((name,), f"[{name}] belongs to a fall; this scene has no [drop].")
        return {}
    for name in _IMPACT:
        if name in build.data:
            build.note(
                (name,), f"[drop] describes a fall and [{name}] an impact; keep one of the two."
            )
    if "supports" in build.data:
        build.note(("supports",), "a part that is dropped is free: leave its [[supports]] out.")
    if source in ("", "model"):
        names = ", ".join(f"[{name}]" for name in SOURCES if name != "model")
        build.note(("drop",), f"[drop] needs a structure, by one of {names}.")
    found = build.section("drop", {"part": structure})
    if "ensemble" in build.part("drop"):
        for name in _ASKED:
            if name in build.data:
                build.note(
                    (name,), f"[{name}] is of one fall; [drop] has an ensemble: keep one of them."
                )
    peaks = build.named("accelerometers", {"self": found, "quantity": "acceleration"})
    return {"fall": found, "peaks": peaks, "worst": build.table("worst", given={"self": found})}
