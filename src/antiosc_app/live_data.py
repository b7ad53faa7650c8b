"""Data by which the page repeats an impact or a map, with the struck part."""

from __future__ import annotations

from antiosc import History, ImpactMap, Structure
from antiosc.fem import missing
from antiosc.impact.histories.bars import ErrorBudget
from antiosc_app.live import Data, engine_wasm, impact_of_history, striker_place


def data_of_map(impact_map: ImpactMap, structure: Structure | None) -> Data | None:
    """The data of a map, the same on every rank; None if the page cannot repeat its impacts."""
    from antiosc_app import live_meshes  # needs dolfinx

    blow_and_sites = live_meshes.map_data(impact_map, structure)
    if blow_and_sites is None:
        return None
    return {"engine": engine_wasm(), "blow": blow_and_sites[0], "sites": blow_and_sites[1]}


def data_of_history(
    hit: History, structure: Structure | None, budget: ErrorBudget | None
) -> Data | None:
    """The data of an impact, the same on every rank; None if the page cannot repeat it."""
    blow = impact_of_history(hit, budget)
    if blow is None:
        return None
    part = None
    if structure is not None and missing is None:
        from antiosc_app import live_meshes  # needs dolfinx

        part = live_meshes.part_data(structure, hit)
    place = striker_place(hit, blow) if part is not None else None
    return {"engine": engine_wasm(), "blow": blow, "part": part, "place": place}
