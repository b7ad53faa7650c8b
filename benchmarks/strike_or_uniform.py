"""`strike` beside fixed choices of mesh, anti-oscillators and step: error against CPU seconds.

For each tolerance three marks: what was asked, what the error budget promises, and the true error
(of the worst of peak force, impulse and contact time). Fixed choices are a grid of element size,
degree, number of anti-oscillators and time step, with smaller elements around the site, and with
and without correction. The truth is the corrected model of an adapted mesh of degree 2, whose own
share of the budget is printed. All runs have one radius of the patch, whose share is therefore no
part of the errors shown.

    .venv/bin/python benchmarks/strike_or_uniform.py --help
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import error_charts
import numpy as np
import options
from error_budget import finer
from strike_scenes import SCENES, Scene

import antiosc as ao
from antiosc import plotting
from antiosc.impact.histories.bars import relative_differences
from antiosc.plot.charts import few_log_ticks
from antiosc.reduce.error.division import mesh_source

#: The grid of fixed choices: sizes over the scene's, anti-oscillators, time tolerances.
SIZES, COUNTS, STEPS = (2.0, 1.0, 0.6), (6, 12, 20), (1e-2, 1e-3)
#: Seconds that `strike` gets for one answer.
LIMIT = 120.0
#: Anti-oscillators of truths, and meshes that are adapted for them.
MANY, ROUNDS = 40, 4
#: Errors that fixed choices are asked for: of `strike` itself, and the fine one.
MET, FINE = 0.01, 0.001

Row = dict[str, Any]
#: name -> what was found: "truth" and "runs"
Found = dict[str, dict[str, Any]]


def main(
    scenes: tuple[str, ...] = tuple(SCENES),
    tols: tuple[float, ...] = (0.1, 0.03, 0.01, 0.003, 0.001),
    dofs: int = 150_000,
    out: str = "",
) -> Found:
    """Strike with these tolerances, and on the grid; `dofs`: most of a truth.

    Scenes that the file `out` (JSON) holds are not run again.
    """
    kept = Path(out) if out else None
    found: Found = json.loads(kept.read_text()) if kept and kept.exists() else {}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.AntioscWarning)
        for name in (name for name in scenes if name not in found):
            scene = SCENES[name]
            path = scene.path(Path(folder))
            known, true = truth(scene, path, dofs)
            hits = [*struck(scene, path, tols), *fixed(scene, path)]
            rows = [
                {**row, "true": max(relative_differences(hit, true).values())} for row, hit in hits
            ]
            found[name] = {"truth": known, "runs": rows}
            print(f"\n**{name}**\n\n{table(found[name])}", flush=True)
            if kept:
                kept.write_text(json.dumps(found, indent=1) + "\n")
    if kept:
        chart(found, kept.with_suffix(".png"))
    return found


def truth(scene: Scene, path: Path, dofs: int) -> tuple[Row, ao.History]:
    """The impact on the corrected model of an adapted mesh of degree 2, its dofs and its bar."""
    source = mesh_source(path, 2)
    mesh = source.first(2 * scene.size, [(scene.site.point, scene.site.radius)])
    for turn in range(ROUNDS):
        part = scene.structure(mesh, 2)
        model = ao.extract(part, scene.site, n=MANY, error="estimate")
        hit = scene.struck(model)
        room = dofs / part.dofs
        if room < 1.3 or turn == ROUNDS - 1:
            break

        goal = 0.2 if room >= 3 else 0.05
        ratio = finer(part, model, hit, goal, 2, min(room, 4.0))
        mesh = source.finer(mesh, np.minimum(ratio, 1.0))

    share = max(bar.mesh for bar in hit.error_budget.of_corrected(hit).values())
    print(f"truth: {part.dofs} dofs, corrected; its own bar of the mesh {share:.1e}")
    return {"dofs": part.dofs, "bar": share}, scene.struck(model.corrected(), 1e-6)


def struck(scene: Scene, path: Path, tols: Sequence[float]) -> list[tuple[Row, ao.History]]:
    """`strike` with each tolerance."""
    found = []
    for tol in tols:
        started = time.process_time()
        hit = ao.strike(
            path, scene.site, *scene.impact, scene.duration,
            tol=tol, material=scene.material, supports=[scene.held], limit=LIMIT,
        )  # fmt: skip
        promised = max(bar.total - bar.patch for bar in hit.error_budget.values())
        row = {"run": "strike", "asked": tol, "promised": promised, "met": hit.status == 0}
        found.append(({**row, **spent(hit.model, started)}, hit))
    return found


def fixed(scene: Scene, path: Path) -> list[tuple[Row, ao.History]]:
    """The grid; each mesh is made once, and its seconds count for all its choices."""
    found = []
    for order in (1, 2):
        for factor in SIZES:
            size = factor * scene.size
            refine = [(scene.site.point, scene.site.radius)]
            part, meshed = timed(made, scene, path, size, refine, order)
            for n, error in (*((n, None) for n in COUNTS), (COUNTS[-1], "estimate")):
                model, extracted = timed(ao.extract, part, scene.site, n=n, error=error)
                model = model.corrected() if error else model
                for step in STEPS:
                    hit, run = timed(scene.struck, model, step)
                    row = {"run": "corrected" if error else "fixed", "size": size, "order": order}
                    row |= {"n": n, "step": step, "dofs": part.dofs}
                    found.append(({**row, "seconds": meshed + extracted + run}, hit))
    return found


def made(scene: Scene, path: Path, size: float, refine: Any, order: int) -> ao.Structure:
    """The part on a mesh of this size, factorized."""
    part = scene.structure(ao.read_mesh(path, size=size, refine=refine, order=order), order)
    part.factorize()
    return part


def timed(work: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[Any, float]:
    """What a function returns, and the CPU seconds that it took."""
    started = time.process_time()
    result = work(*arguments, **options)
    return result, time.process_time() - started


def spent(model: ao.AntiOscillators, started: float) -> Row:
    return {"dofs": model.info["dofs"], "seconds": time.process_time() - started}


def table(found: dict[str, Any]) -> str:
    """The runs of one scene in Markdown, and what `strike` costs against cheapest fixed choices."""
    rows = found["runs"]
    lines = ["| run | dofs | CPU s | asked | promised | true |", "|---|---|---|---|---|---|"]
    strikes = [row for row in rows if row["run"] == "strike"]
    best = {}
    for kind, goal in (("fixed", MET), ("corrected", MET), ("fixed", FINE), ("corrected", FINE)):
        good = [row for row in rows if row["run"] == kind and row["true"] <= goal]
        if good:
            best[kind, goal] = min(good, key=lambda row: row["seconds"])
    for row in [*strikes, *best.values()]:
        label = "strike" + ", not met" * (not row.get("met", True))
        if row["run"] != "strike":
            label = f"{row['run']}, {1e3 * row['size']:.3g} mm, degree {row['order']}, "
            label += f"n = {row['n']}, step {row['step']:g}"
        marks = [row.get(mark) for mark in ("asked", "promised", "true")]
        shown = " | ".join("" if mark is None else f"{mark:.1e}" for mark in marks)
        lines.append(f"| {label} | {row['dofs']} | {row['seconds']:.2f} | {shown} |")
    own = next((row for row in strikes if row["asked"] == MET), None)
    for (kind, goal), row in best.items():
        if own:
            share = own["seconds"] / row["seconds"]
            said = f"strike({MET:g}) over the cheapest {kind} choice within {goal:g}: {share:.2f}"
            lines += ["", said]
    return "\n".join(lines)


def chart(found: Found, path: Path) -> None:
    """Error against CPU seconds, a panel for each scene."""
    figure, grid = plotting.panels(2, (len(found) + 1) // 2, (8, 6.4))
    for axes, (name, content) in zip(grid.flat, found.items(), strict=False):
        rows = content["runs"]
        own = [row for row in rows if row["run"] == "strike"]
        for mark, sign in {"asked": "_", "promised": "^", "true": "o"}.items():
            values = [row[mark] for row in own]
            axes.loglog([row["seconds"] for row in own], values, sign, label=f"strike, {mark}")
        for run, order in (("fixed", 1), ("fixed", 2), ("corrected", 1), ("corrected", 2)):
            some = [row for row in rows if row["run"] == run and row["order"] == order]
            some = [row for row in some if (row["n"], row["step"]) == (COUNTS[-1], STEPS[-1])]
            seconds, errors = ([row[key] for row in some] for key in ("seconds", "true"))
            axes.loglog(seconds, errors, ".-", label=f"{run}, order {order}")
        axes.set_title(name, fontsize=10)
        few_log_ticks(axes)
    for axes in grid[-1]:
        axes.set_xlabel("CPU seconds")
    for axes in grid[:, 0]:
        axes.set_ylabel("relative error")
    handles, labels = grid.flat[0].get_legend_handles_labels()
    error_charts.legend_below(figure, dict(zip(labels, handles, strict=True)), 3)
    plotting.save_figure(figure, path, dpi=120)


def numbered(text: str) -> str:
    """The name of a scene by its number."""
    number = options.count(text)
    if number > len(SCENES):
        raise argparse.ArgumentTypeError(f"must be a number from 1 to {len(SCENES)}; got {text!r}")
    return tuple(SCENES)[number - 1]


def command(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    tols = options.listed(options.positive)
    parser.add_argument("--tols", type=tols, default=(0.1, 0.03, 0.01, 0.003, 0.001), help="asked")
    names = ", ".join(f"{k}: {name}" for k, name in enumerate(SCENES, 1))
    scenes = options.listed(numbered)
    parser.add_argument("--scenes", type=scenes, default=tuple(SCENES), help=f"numbers; {names}")
    parser.add_argument("--dofs", type=options.count, default=150_000, help="most of a truth")
    parser.add_argument("--out", default="", help="file for the runs (JSON), and a chart beside it")
    options.run(parser, main, arguments)


if __name__ == "__main__":
    command()
