"""`tradeoff` on a folder of scenes: its cost, and whether `best(tol)` is as accurate as it says.

The scenes are those that `antiosc new` writes. The reference of a part is a `strike` to half of
the bar of the finest member. The error of the member that `best` takes is the largest difference of
peak force, impulse and contact time to that. All seconds are those of the processor, with its
children; the cost of the whole, all meshes included, is also told over that of its finest member.

    OMP_NUM_THREADS=1 .venv/bin/python benchmarks/tradeoff_of_parts.py --folder FOLDER
"""

from __future__ import annotations

import os
import time
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import options

import antiosc as ao
from antiosc.base.texts import percent
from antiosc_app.commands import one_impact, to_a_tolerance
from antiosc_app.scene_file.build import Call, Evaluation
from antiosc_app.scene_file.compiled import compiled
from antiosc_app.scene_file.document import read

QUANTITIES = ("peak_force", "impulse", "contact_time")
HEAD = ("part", "dofs", "N", "bar", "CPU s", "over finest", "reference dofs, N, bar")


class Kept(NamedTuple):
    """The cells of a part in the table, and whether each tolerance was kept."""

    cells: list[str]
    holds: list[bool]


def main(
    folder: Path = Path("out/parts"),
    tolerances: tuple[float, ...] = (0.05, 0.02),
    limit: float = 200.0,
) -> None:
    """Print a table of the parts, and how many keep each tolerance.

    Parameters
    ----------
    folder : with scene files, also in its folders
    tolerances : relative errors that are asked for, the finest last
    limit : CPU seconds after which a reference takes no further mesh
    """
    time.perf_counter = processor
    heads = [*HEAD, *(f"best({percent(tol)}): s, error" for tol in tolerances)]
    print(_row(heads), _row(["---"] * len(heads)), sep="\n", flush=True)
    scenes = sorted(folder.rglob("*.toml"))
    kept = []
    for path in scenes:
        try:
            found = of_part(path, tolerances, limit)
        except ao.AntioscError as error:
            print(_row([path.stem[:30], f"refused: {str(error)[:200]}"]), flush=True)
            continue
        kept.append(found.holds)
        print(_row([path.stem[:30], *found.cells]), flush=True)
    for tol, holds in zip(tolerances, zip(*kept, strict=True), strict=True):
        print(f"{percent(tol)}: {sum(holds)} of {len(holds)}")


def processor() -> float:
    """Seconds of the processor of this process and of its children."""
    return sum(os.times()[:4])


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def of_part(path: Path, tolerances: tuple[float, ...], limit: float) -> Kept:
    """Compare the methods of a part with its reference."""
    scene = compiled(to_a_tolerance(read(path)))
    asked = {**one_impact(scene, str(path)), "tol": tolerances[-1]}
    given: dict[str, Any] = Evaluation(scene.document)(Call(dict, asked))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        began = processor()
        tried = ao.tradeoff(**given)
        spent = processor() - began
        finest = tried.table[-1]
        true = ao.strike(**{**given, "tol": finest.bar / 2, "limit": limit})
    last = true.model.info.strike[-1]
    reference = f"{last['dofs']}, {last['n']}, {percent(true.error_budget.numerical)}"
    cells = [str(finest.dofs), str(finest.n), percent(finest.bar)]
    cells += [f"{spent:.1f}", f"{spent / finest.seconds:.1f}", reference]
    holds = []
    for tol in tolerances:
        try:
            best = tried.best(tol=tol)
        except ao.InputError as error:
            cells.append(str(error)[:200])
            holds.append(True)
            continue
        error = max(abs(getattr(best, n) / getattr(true, n) - 1) for n in QUANTITIES)
        cells.append(f"{best.seconds:.2g} s, {percent(error)}")
        holds.append(error <= tol)
    return Kept(cells, holds)


if __name__ == "__main__":
    options.command(main)
