"""Values of a scene that are "auto": radius of the patch, number of anti-oscillators, duration."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from antiosc.models.auto_contact import AUTO
from antiosc_app.scene_file.document import Document, Table

#: Sections of an impact at one site; `strike` gives the patch of a solid a radius by itself.
STRUCK = ("simulate", "strike")
#: First number of anti-oscillators, and first duration [s]: those of `antiosc.strikes.defaults`.
FIRST_COUNT, FIRST_DURATION = 20, 1e-3


class Choice(NamedTuple):
    """Values for "auto".

    radius : of the patch [m]; None: as the site has it without one.
    expansion : frequency of the expansion point [Hz]; None: static.
    """

    radius: float | None = None
    n: int = FIRST_COUNT
    duration: float = FIRST_DURATION
    expansion: float | None = None


def started(document: Document) -> Document:
    """The document with first values in place of "auto"; itself if it has none, or several sites
    or contacts, for which they are numbers.
    """
    if only_site(document) and any(isinstance(document.data.get(s), dict) for s in STRUCK):
        return with_values(document, Choice())
    return document


def is_auto(document: Document, section: str, key: str) -> bool:
    """Whether a key of a section is "auto"."""
    table = document.data.get(section)
    return isinstance(table, dict) and table.get(key) == AUTO


def with_values(document: Document, choice: Choice) -> Document:
    """The document with values in place of "auto"; itself if it has none."""
    data = dict(document.data)
    site = only_site(document)

    if site.get("radius") == AUTO:
        (name,) = data["sites"]
        others = {key: value for key, value in site.items() if key != "radius"}
        radius = {} if choice.radius is None else {"radius": choice.radius}
        data["sites"] = {name: {**others, **radius}}

    if is_auto(document, "simulate", "duration"):
        data["simulate"] = {**data["simulate"], "duration": choice.duration}

    if is_auto(document, "extract", "n"):
        data["extract"] = {**data["extract"], "n": choice.n}
        if choice.expansion and data["extract"].get("method", "krylov") == "krylov":
            data["extract"].setdefault("expansion", choice.expansion)

    return document if data == document.data else replace(document, data=data)


def only_site(document: Document) -> Table:
    """The table of the only site; {} if there is none, or there are several."""
    sites = document.data.get("sites")
    if not isinstance(sites, dict) or len(sites) != 1:
        return {}
    (site,) = sites.values()
    return site if isinstance(site, dict) else {}
