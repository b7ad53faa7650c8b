"""The data of a live report: the engine, the impact or map, and the part."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING

from antiosc.app.page import assets, blow
from antiosc.app.page.assets import Data
from antiosc.models.body import info_of, places_of
from antiosc.simulation.histories import History
from antiosc.simulation.histories.parts import ErrorBar
from antiosc.studies.map_results import ImpactMap

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure

#: Density [kg/m^3] of the ball as which a striker of unknown size is drawn.
STEEL = 7850.0


def of_map(found: ImpactMap, structure: Structure | None) -> Data | None:
    """The data of a map, on every rank; None for one that the page cannot strike anew."""
    from antiosc.app.page import sites

    struck = sites.of_map(found, structure)
    if struck is None:
        return None
    return {"engine": assets.engine(), "blow": struck[0], "sites": struck[1]}


def of_history(
    hit: History, structure: Structure | None, budget: Mapping[str, ErrorBar]
) -> Data | None:
    """The data of an impact, on every rank; None for one that the page cannot repeat."""
    own = blow.of_history(hit, budget)
    if own is None:
        return None
    part = None
    if structure is not None:
        from antiosc.app.page import body

        part = body.of_structure(structure, hit)
    place = _place(hit, own) if part is not None else None
    return {"engine": assets.engine(), "blow": own, "part": part, "place": place}


def drawn(data: Data) -> str:
    """What the picture of the set-up shows, in words."""
    told = "Drag to turn; dark: held by supports; the arrow is the direction of impact."
    place = data.get("place")
    if place and place["radius"] and not data["blow"]["radius"]:
        told += " The striker is drawn as a steel ball of its mass."
    return told


def _place(hit: History, own: Data) -> Data | None:
    """Where the striker is drawn; None where the site is not known in space."""
    points, direction = list(places_of(hit.model).values()), info_of(hit.model).direction
    if len(points) != 1 or len(points[0]) != 3 or direction is None or len(direction) != 3:
        return None
    radius, mass = own["radius"], own["mass"]
    if radius is None and mass is not None:
        radius = (mass / (STEEL * 4 / 3 * pi)) ** (1 / 3)
    return {"point": list(points[0]), "direction": list(direction), "radius": radius}
