"""The data of a live page: of an impact or a map, with the struck part where it is known."""

from __future__ import annotations

from antiosc import History, ImpactMap, Structure
from antiosc.extension import ErrorBudget
from antiosc_app.live import Data, blow_of_history, engine, striker_place


def data_of_map(found: ImpactMap, structure: Structure | None) -> Data | None:
    """The data of a map, on every rank; None where the page cannot strike it again."""
    from antiosc_app import live_meshes  # needs dolfinx

    struck = live_meshes.sites_of_map(found, structure)
    if struck is None:
        return None
    return {"engine": engine(), "blow": struck[0], "sites": struck[1]}


def data_of_history(
    hit: History, structure: Structure | None, budget: ErrorBudget | None
) -> Data | None:
    """The data of an impact, on every rank; None where the page cannot repeat it."""
    own = blow_of_history(hit, budget)
    if own is None:
        return None
    part = None
    if structure is not None:
        from antiosc_app import live_meshes  # needs dolfinx

        part = live_meshes.of_structure(structure, hit)
    place = striker_place(hit, own) if part is not None else None
    return {"engine": engine(), "blow": own, "part": part, "place": place}
