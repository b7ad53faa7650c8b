"""`tradeoff` on a folder of scenes: its cost, and whether `best(tol)` is as accurate as it says.

The scenes are those that `antiosc new` writes. The reference of a part has cells half as large as
those of the finest member, or as large as `most` dofs allow, and `MORE` times its anti-oscillators.
It is the raw model of these, so that no error estimate takes part in it; beside it stands how far
its corrected model is from it. Where the cells cannot be divided it has the same mesh, marked by =.
The error of the member that `best` takes is the largest difference of peak force, impulse and
contact time to the reference. All seconds are those of the processor, with its children, without
the compilation of forms; the cost of the whole, all meshes included, is also told over that of its
finest member.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/tradeoff_of_parts.py --folder FOLDER
"""

from __future__ import annotations

import os
import time
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import options

import antiosc as ao
from antiosc.base.texts import percent
from antiosc.fem.platform import compat
from antiosc.reduce.error.remeshing import source_of
from antiosc.strikes.strike import Answer, simulated
from antiosc.strikes.tradeoff import Tradeoff, of_number
from antiosc_app.commands import one_impact, to_a_tolerance
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import Document, read

QUANTITIES = ("peak_force", "impulse", "contact_time")
HEAD = ("part", "finest: dofs, N, bar", "CPU s", "over finest", "reference: dofs, N, correction")
#: Of the impact itself, among the arguments of `tradeoff`.
SHARED = ("initial_velocity", "gravity", "gap")
#: Size of the cells of the reference over that of the finest member's.
HALF = 0.5
#: Its anti-oscillators over those of the finest member, and its tolerance in time.
MORE, STEPS = 3, 1e-5


def main(
    folder: Path = Path("out/parts"),
    tolerances: tuple[float, ...] = (0.05, 0.02),
    limit: float = 60.0,
    most: int = 400_000,
) -> None:
    """Print a table of the parts, and how many keep each tolerance.

    Parameters
    ----------
    folder : with scene files, also in its folders
    tolerances : relative errors that are asked for, the finest last
    limit : CPU seconds after which a part takes no further mesh
    most : dofs of a reference
    """
    time.perf_counter = processor
    heads = [*HEAD, *(f"best({percent(tol)}): dofs, N, s, bar, error" for tol in tolerances)]
    print(_row(heads), _row(["---"] * len(heads)), sep="\n", flush=True)
    kept: dict[float, list[bool]] = {tol: [] for tol in tolerances}
    for path in sorted(folder.rglob("*.toml")):
        try:
            cells = of_part(path, limit, most, kept)
        except ao.AntioscError as error:
            cells = [f"refused: {str(error)[:200]}"]
        print(_row([path.stem[:30], *cells]), flush=True)
    for tol, holds in kept.items():
        print(f"{percent(tol)}: a line meets it in {len(holds)} parts, and holds in {sum(holds)}")


def processor() -> float:
    """Seconds of the processor of this process and of its children."""
    return sum(os.times()[:4])


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def of_part(path: Path, limit: float, most: int, kept: dict[float, list[bool]]) -> list[str]:
    """The cells of a part in the table; whether each tolerance holds goes into `kept`."""
    scene = compiled(to_a_tolerance(read(path)))
    asked = {**one_impact(scene, str(path)), "tol": [*kept][-1], "limit": limit}
    given: dict[str, Any] = Evaluation(scene.document)(Call(dict, asked))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        began = processor()
        tried = ao.tradeoff(**given)
        spent = processor() - began - tried.compilation
        true = reference(scene.document, given, tried, most)
    finest = tried.table[-1]
    same = "" if true.structure is not tried.hit.structure else "="
    cells = [f"{finest.dofs}, {finest.n}, {percent(finest.bar)}"]
    cells += [f"{spent:.1f}", f"{spent / finest.seconds:.1f}"]
    cells += [f"{same}{true.structure.dofs}, {true.n}, {percent(_apart(true.hit, true.raw))}"]
    for tol, holds in kept.items():
        try:
            best = tried.best(tol=tol)
        except ao.InputError as error:
            cells.append(f"finest {percent(_apart(finest, true.raw))}; {error}")
            continue
        error = _apart(best, true.raw)
        figures = f"{best.dofs}, {best.n}, {best.seconds:.2g} s, {percent(best.bar)}"
        cells.append(f"{figures}, {percent(error)}")
        holds.append(error <= tol)
    return cells


def _apart(one: Any, true: ao.History) -> float:
    """The largest relative difference of a member or a history to the reference."""
    return max(abs(getattr(one, name) / getattr(true, name) - 1) for name in QUANTITIES)


def reference(document: Document, given: dict[str, Any], tried: Tradeoff, most: int) -> Answer:
    """The impact on smaller cells than those of the finest member, with more anti-oscillators."""
    structure = divided(document, given["source"], tried.hit.structure, most)
    shared = {name: given[name] for name in SHARED if name in given}
    run = partial(
        simulated, given["impactor"], given.get("contact", "auto"), given["duration"], shared
    )
    n = min(MORE * tried.table[-1].n, structure.dofs - 1)
    return of_number(structure, given["site"], run, STEPS, n)


def divided(document: Document, source: Any, structure: ao.Structure, most: int) -> ao.Structure:
    """The structure with cells half as large; itself where there are none."""
    if structure.made_of is None:
        return structure
    mesh, material, options = structure.made_of
    ratio = max(HALF, (structure.dofs / most) ** (1 / mesh.tdim))
    if ratio >= 1.0:
        return structure
    place = source_of(mesh if isinstance(source, ao.Structure) else source, options["order"])
    if not place.fixed:
        cells = compat.cell_map(mesh.dolfinx).size_local
        finer = place.finer(mesh, np.full(cells, ratio))
    elif "size" in document.data.get("geometry", {}):
        finer = remeshed(document, ratio)
    else:
        return structure
    return ao.Structure(finer, material, structure.supports, **options)


def remeshed(document: Document, ratio: float) -> ao.Mesh:
    """The geometry of a scene, meshed with sizes so many times its own."""
    sizes = dict(document.data["geometry"])
    sizes["size"] *= ratio
    sizes["refine"] = [[point, ratio * size] for point, size in sizes.get("refine", [])]
    finer = replace(document, data={**document.data, "geometry": sizes})
    mesh: ao.Mesh = Evaluation(finer)(compiled(finer).history.arguments["source"])
    return mesh


if __name__ == "__main__":
    options.command(main)
