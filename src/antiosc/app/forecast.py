"""`--dry-run`: what a scene would compute and what it costs, before anything is factored."""

from __future__ import annotations

from math import pi, sqrt
from typing import TYPE_CHECKING

from antiosc.app.results import advice_of, lines
from antiosc.app.scene_file.document import Table
from antiosc.app.scene_file.outline import outlines
from antiosc.app.scene_file.run import Results, results, varied
from antiosc.app.scene_file.scene import Compiled
from antiosc.base.errors import AntioscError
from antiosc.base.process import free_memory
from antiosc.base.texts import engineering
from antiosc.simulation.reference import FIRST_STEPS
from antiosc.simulation.scene import DEFAULT_TOL
from antiosc.simulation.two_bodies import BAND_OVER_PULSE, impact_band
from antiosc.studies.drops.body import MODES
from antiosc.studies.drops.drop import GRAVITY

if TYPE_CHECKING:
    from antiosc.fem.structure.structure import Structure


def text(scene: Compiled) -> str:
    """Family, dofs, n, step and cost; the structure is built for it, but not factored."""
    found = results(scene, ("structure", "impactor", "contact"))
    rows: list[tuple[str, str]] = []
    if found.structure is not None:
        dofs = f"{found.structure.dofs}"
        rows += [*advice_of(found), ("dofs", dofs), ("factor", _factor(found.structure))]
    rows += [(f"box of {one.name}", one.text()) for one in outlines(scene)]
    rows += _of_model(scene, found)
    if scene.fall is not None:
        rows += _of_fall(scene.fall.arguments)
    if found.impactor is not None and found.contact is not None:
        rows += _of_impact(scene, found)
    rows += [("warning", sentence) for sentence in found.warnings]
    return lines(rows)


def _factor(structure: Structure) -> str:
    """Entries and memory of the Cholesky factor, by the analysis that makes it."""
    from antiosc.fem import missing

    if missing is not None or not hasattr(structure.K, "getSizes"):
        return "by SciPy; not forecast"
    from antiosc.fem.linalg.solver_choice import BYTES, Plan

    entries = Plan(structure.K).entries
    if not entries:
        return "not forecast"
    return (
        f"{entries:.3g} entries, {BYTES * entries / 1e9:.2g} GB of {free_memory() / 1e9:.3g} GB "
        f"free; {4e-9 * entries:.2g} Gflop for each solve"
    )


def _of_model(scene: Compiled, found: Results) -> list[tuple[str, str]]:
    if scene.model is None or found.structure is None:
        return []
    asked = scene.document.data.get("extract", {})
    sites = len(scene.document.data.get("sites", {}))
    if "band" in asked:
        until = asked["band"] / (2 * pi)
        return [("anti-oscillators", f"as many as needed up to {engineering(until, 'Hz')}")]
    from antiosc.fem.extraction.extract import DEFAULT_COUNT

    n = asked.get("n", min(DEFAULT_COUNT, found.structure.dofs - 1))
    return [("anti-oscillators", f"{n} of {sites} site(s): about {n + sites} solves")]


def _of_fall(asked: Table) -> list[tuple[str, str]]:
    height, gravity = asked["height"], asked.get("gravity", GRAVITY)
    rows = [
        ("free modes", f"{asked.get('modes', MODES)}: most of the cost of one fall"),
        ("first touch", f"after {engineering(sqrt(2 * height / gravity), 's')}"),
        ("speed", f"{sqrt(2 * height * gravity):.4g} m/s there, without [drop] velocity"),
    ]
    if "ensemble" in asked:
        rows.append(("falls", f"{asked.get('n', 100)}"))
    return rows


def _of_impact(scene: Compiled, found: Results) -> list[tuple[str, str]]:
    asked = scene.document.data.get("simulate", {})
    rows = []
    if "strike" in scene.document.data:
        tol = scene.document.data["strike"].get("tol")
        rows.append(("mesh, model, step", f"chosen while it runs, for an error of {tol:g}"))
    try:
        band = impact_band(found.impactor, found.contact)
    except AntioscError as error:
        rows.append(("contact time", f"not forecast: {error}"))
        return rows
    time = BAND_OVER_PULSE * pi / band
    rows.append(("contact time", f"at least {engineering(time, 's')}, that on a rigid wall"))
    rows.append(("band of the impact", f"up to {engineering(band / (2 * pi), 'Hz')}"))
    if "strike" not in scene.document.data:
        step = asked.get("step", time / FIRST_STEPS)
        tol = asked.get("tol", DEFAULT_TOL)
        how = "given" if "step" in asked else f"halved until tol = {tol:g} is met"
        rows.append(("step", f"{engineering(step, 's')}, {how}"))
    impacts = len(next(iter(varied(scene).values()), [0]))
    if impacts > 1:
        rows.append(("sweep", f"{impacts} impacts"))
    return rows
