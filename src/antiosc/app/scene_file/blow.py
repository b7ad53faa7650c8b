"""The blow of [find]: from signals of [sensors] to the place and the strength of an impact."""

from __future__ import annotations

from typing import Any

from antiosc.app.scene_file.build import Builder, Call
from antiosc.app.scene_file.impact import own_laws

#: Sections that describe an impact or a fall, which [find] looks for.
_IMPACT = (
    *("simulate", "strike", "bodies", "contacts", "loads", "base", "motion", "scene", "run"),
    *("sites", "extract", "probes", "sweep", "map", "stress", "drop"),
)


def blow(build: Builder, source: str, structure: Call | None) -> Call | None:
    """The call of `find_impact`; None without [find]."""
    if "find" not in build.data:
        if "sensors" in build.data:
            build.note(("sensors",), "[sensors] belong to [find]; motion is told by [probes].")
        return None
    for name in _IMPACT:
        if name in build.data:
            build.note(
                (name,),
                f"[find] looks for a blow, and [{name}] belongs to one that is described; keep one"
                " of the two.",
            )
    if source not in ("geometry", "deck", "parts"):
        build.note(("find",), "[find] needs a structure of [geometry], [deck] or [parts].")
    if not build.part("sensors"):
        build.note(("find",), "[find] needs sensors: give [sensors.NAME] in the order of signals.")
    sensors = build.named("sensors")
    given: dict[str, Any] = {"structure": structure, "sensors": list(sensors.values())}
    if "impactor" in build.data:
        given["impactor"] = build.table("impactor")
    if "contact" in build.data:
        methods = own_laws("impactor", build.data.get("impactor"), given.get("impactor"))
        given["contact"] = build.table("contact", methods=methods)
    return build.section("find", given)
