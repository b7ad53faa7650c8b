"""Values of a scene that are "auto": radius of the patch, number of anti-oscillators, duration."""

from __future__ import annotations

from dataclasses import replace

from antiosc.models.auto_contact import AUTO
from antiosc_app.scene_file.document import Document, Table
from antiosc_app.until_parted import OSCILLATORS, Choice

#: Sections of an impact at one site; `strike` gives the patch of a solid a radius by itself.
STRUCK = ("simulate", "strike")


def started(document: Document) -> Document:
    """The document with first values in place of "auto"; itself if it has none, or several sites
    or contacts, for which they are numbers.
    """
    if only_site(document) and any(isinstance(document.data.get(s), dict) for s in STRUCK):
        return with_values(document, Choice(None))
    return document


def with_values(document: Document, choice: Choice) -> Document:
    """The document with values in place of "auto"; itself if it has none."""
    data = dict(document.data)
    site = only_site(document)
    if site.get("radius") == AUTO:
        (name,) = data["sites"]
        others = {key: value for key, value in site.items() if key != "radius"}
        radius = {} if choice.radius is None else {"radius": choice.radius}
        data["sites"] = {name: {**others, **radius}}
    simulate = data.get("simulate")
    if isinstance(simulate, dict) and simulate.get("duration") == AUTO:
        data["simulate"] = {**simulate, "duration": choice.duration}
    extract = data.get("extract")
    if isinstance(extract, dict) and extract.get("n") == AUTO:
        data["extract"] = {**extract, "n": choice.n or OSCILLATORS[0]}
        if choice.expansion and extract.get("method", "krylov") == "krylov":
            data["extract"].setdefault("expansion", choice.expansion)
    if data == document.data:
        return document
    return replace(document, data=data)


def only_site(document: Document) -> Table:
    """The table of the only site; {} if there is none, or there are several."""
    sites = document.data.get("sites")
    if not isinstance(sites, dict) or len(sites) != 1:
        return {}
    (site,) = sites.values()
    return site if isinstance(site, dict) else {}
